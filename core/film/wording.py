# SPDX-License-Identifier: GPL-3.0-or-later
"""What the captions of a film say."""

from collections.abc import Iterable

import numpy as np

from ..vectors import Array


def fastest_speed(motions: Iterable[tuple[Array, Array]], at_s: Array) -> Array:
    """Speed of the fastest moving block [m/s].

    Parameters
    ----------
    motions : (m,) times and (m,) speeds of each block, by time.
    at_s : (q,) [s].

    Returns
    -------
    (q,) 0 where no block moves.
    """
    fastest = np.zeros(len(at_s))
    for time_s, speed in motions:
        fastest = np.maximum(fastest, np.interp(at_s, time_s, speed, left=0.0, right=0.0))
    return fastest


def scale_note(block_scale: float) -> str:
    """How large the blocks are drawn; empty when they have their true size."""
    return "" if abs(block_scale - 1.0) < 1e-6 else f"Blocks drawn {block_scale:g}× their size"


def speed_note(time_scale: float) -> str:
    """Whether the film runs slower or faster than the fall; empty at true speed."""
    if abs(time_scale - 1.0) < 1e-6:
        return ""
    return f"slowed down {1 / time_scale:.3g}×" if time_scale < 1 else f"sped up {time_scale:.3g}×"


def duration_words(seconds: float) -> str:
    """A duration that is known roughly: "20 s", "4 min", "2.5 h"."""
    if seconds < 90:
        return f"{max(5 * round(seconds / 5), 5)} s"
    return f"{round(seconds / 60)} min" if seconds < 90 * 60 else f"{round(seconds / 1800) / 2:g} h"


def estimate(frame_s: float, frames: int) -> str:
    """How long a film will take, from how long one of its frames took [s]."""
    return f"About {duration_words(frame_s * frames)} for {frames} frames on this machine"


def compared_lines(models: int) -> tuple[str, str]:
    """Two lines that say what is seen when the blocks of models are shown beside the real ones."""
    return (
        f"Measured (white), and calculated by {models} models"
        if models > 1
        else "Measured (white), and calculated by a model",
        "from the same velocity before each impact",
    )


def simulated_lines(blocks: int, models: int) -> tuple[str, str]:
    """Two lines that say what is seen when simulated blocks fall beside measured ones."""
    return (
        f"{blocks} measured block{'' if blocks == 1 else 's'} (white), and simulated ones by "
        + (f"{models} models" if models > 1 else "a model"),
        "from the same starts, with the measured velocity",
    )


def notes(block_scale: float = 1.0, time_scale: float = 1.0, rings: bool = False) -> str:
    """The note under the picture.

    Parameters
    ----------
    rings : whether impacts are marked with rings.
    """
    parts = (scale_note(block_scale), "rings mark impacts" if rings else "", speed_note(time_scale))
    text = ", ".join(part for part in parts if part)
    return text[:1].upper() + text[1:]
