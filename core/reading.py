# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading files that may be damaged: whatever a library makes of one becomes an `InputError` that names it."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import cast

import numpy as np

from .errors import InputError, RockfallError
from .progress import CancelledError

AGAIN = "It is damaged, or of another kind than its name says: copy or export it again"
MOST_PACKED = 1100
"""Deflate makes data no more than so many times smaller (RFC 1951: 1032), and no other packing here does better."""
PANIC = "PanicException"
"""What the decoder of LAZ raises; it is no Exception, and has no name that can be imported."""

for library in ("laspy", "tifffile", "trimesh"):  # else Python prints what they log of damaged files
    logging.getLogger(library).addHandler(logging.NullHandler())


@contextmanager
def reading(file: str | Path, what: str = "file", advice: str = AGAIN) -> Iterator[None]:
    """Around what reads a file: every error in it names the file and says what to do.

    Parameters
    ----------
    what : it is, and `advice`, for messages about damages that nobody has foreseen.

    Raises
    ------
    InputError : the file is not there, cannot be read, does not fit into the memory, or is damaged.
    """
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError as error:
        if error.file is not None and error.advice:
            raise
        raise InputError(
            error.problem,
            file=error.file or file,
            row=error.row,
            trajectory=error.trajectory,
            advice=error.advice or advice,
        ) from error
    except (RockfallError, CancelledError):
        raise
    except OSError as error:
        raise _unreadable(error, error.filename or file, what) from error
    except MemoryError as error:
        raise InputError(
            f"The {what} needs more memory than there is", file=file, advice="Reduce it, or close other programs"
        ) from error
    except RecursionError as error:
        raise InputError(f"The {what} is nested too deeply", file=file, advice=advice) from error
    except BaseException as error:
        if not isinstance(error, Exception) and type(error).__name__ != PANIC:
            raise
        said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise InputError(f"The {what} cannot be read ({said})", file=file, advice=advice) from error


def reader[**P, T](what: str, advice: str = AGAIN) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A function whose first argument is a file, with `reading` around it."""

    def guard(read: Callable[P, T]) -> Callable[P, T]:
        @wraps(read)
        def guarded(*arguments: P.args, **options: P.kwargs) -> T:
            file = cast("str | Path", (*arguments, *options.values())[0])
            with reading(file, what, advice):
                return read(*arguments, **options)

        return guarded

    return guard


def check_promise(what: str, promised: int, size: int, file: str | Path, packed: bool = False) -> None:
    """Refuse a header that promises more bytes than the file can hold, before memory is taken for them.

    Raises
    ------
    InputError : it does.
    """
    if promised > size * (MOST_PACKED if packed else 1):
        raise InputError(
            f"The file is truncated or damaged: its header promises {what}, and it has {size:,} bytes",
            file=file,
            advice="Copy or export it again",
        )


def _unreadable(error: OSError, file: str | Path, what: str) -> InputError:
    if isinstance(error, FileNotFoundError):
        return InputError("There is no such file", file=file, advice="Check the name and the folder")
    if isinstance(error, IsADirectoryError):
        return InputError("This is a folder", file=file, advice=f"Choose the {what} itself")
    return InputError(
        f"The {what} cannot be read ({error.strerror or error})", file=file, advice="Check its permissions and the disk"
    )
