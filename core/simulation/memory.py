# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the memory is enough: what blocks and their records need, and what is there."""

from ..errors import InputError
from ..memory import available_bytes, in_words

BLOCK_BYTES = 1000
"""Of one block without its impacts, at the most at once: as it is released, simulated and kept (measured)."""
RECORD_BYTES = 370
"""Of one recorded moment, at the most at once (measured)."""


def check_blocks(number: int) -> None:
    """Raises `InputError` when so many blocks do not fit into the memory, even without their impacts."""
    needed, there = number * BLOCK_BYTES, available_bytes()
    if needed > there:
        raise InputError(
            f"{number} blocks are too many for this memory: they need {in_words(needed)} even without their impacts, "
            f"and {in_words(there)} are there",
            advice=f"Release up to {there // BLOCK_BYTES}, in several simulations with seeds of their own",
        )


def check_records(number: int, finished: int, recorded: int, there: int) -> None:
    """Raises `InputError` when the records of all blocks will not fit, to judge by those that are finished.

    Parameters
    ----------
    number, finished : blocks; recorded : moments of the finished ones; there : memory at the beginning [bytes].
    """
    needed = int(recorded / finished * number * RECORD_BYTES)
    if needed > there:
        raise InputError(
            f"The motion of {number} blocks does not fit into the memory: it needs {in_words(needed)}, "
            f"and {in_words(there)} are there",
            advice="Record less, release fewer blocks, or compute them in parts (rockfall simulate --runs)",
        )
