# SPDX-License-Identifier: GPL-3.0-or-later
"""What all workers on one machine need, in one file that they map into their memory: written once, copied never."""

import mmap
import os
import pickle
from pathlib import Path
from typing import Any

ALIGNED = 4096
"""Bytes: of a page of memory, and more than any processor asks for."""


def write_shared(value: object, path: Path) -> None:
    """Write anything with large arrays.

    Raises
    ------
    OSError : the disk is full.
    """
    buffers: list[pickle.PickleBuffer] = []
    head = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
    parts = [one.raw() for one in buffers]
    sizes = [part.nbytes for part in parts]
    with path.open("wb") as file:
        pickle.dump((head, sizes), file, protocol=5)
        for part in parts:
            file.write(b"\0" * (-file.tell() % ALIGNED))
            file.write(part)


def read_shared(path: Path) -> Any:
    """The value; its arrays are the file's own pages, of which a process has a copy where it writes into them."""
    with path.open("rb") as file:
        head, sizes = pickle.load(file)
        at = file.tell()
        if not any(sizes):
            return pickle.loads(head, buffers=[bytearray(size) for size in sizes])
        pages = memoryview(mmap.mmap(file.fileno(), os.fstat(file.fileno()).st_size, access=mmap.ACCESS_COPY))
    parts = []
    for size in sizes:
        at += -at % ALIGNED
        parts.append(pages[at : at + size])
        at += size
    return pickle.loads(head, buffers=parts)
