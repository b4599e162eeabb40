# SPDX-License-Identifier: GPL-3.0-or-later
"""Cloud-optimised point clouds (COPC 1.0): LAZ whose parts are the levels of an octree."""

import struct
from pathlib import Path

from ..errors import InputError

ENTRY = struct.Struct("<4iQ2i")
"""Level and place of a part, where it begins, its bytes, its points: COPC 1.0, Hierarchy. Points −1: another page."""
A_PAGE = -1
MOST_PAGES = 1_000_000


def counted_points(path: Path, offset: int, length: int) -> int:
    """How many points the hierarchy counts: every point is in one part of one level.

    Parameters
    ----------
    offset, length : of the first page of the hierarchy, as the file's "info" record says [bytes].

    Raises
    ------
    InputError : the hierarchy is outside of the file, or has no end.
    """
    pages, seen, points = [(offset, length)], set[int](), 0
    size = path.stat().st_size
    with path.open("rb") as file:
        while pages:
            offset, length = pages.pop()
            if offset + length > size or length % ENTRY.size or offset in seen or len(seen) > MOST_PAGES:
                raise InputError(
                    "The hierarchy of the cloud-optimised file is damaged", file=path, advice="Copy or export it again"
                )
            seen.add(offset)
            file.seek(offset)
            for *_, begin, many_bytes, many in ENTRY.iter_unpack(file.read(length)):
                if many == A_PAGE:
                    pages.append((begin, many_bytes))
                else:
                    points += many
    return points
