# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults that mesh files commonly have: vertices stored several times, faces without area, loose vertices."""

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Mask

CHUNK = 1 << 15
FLAT = 1e-12
"""A triangle is degenerate when twice its area is below this part of its longest edge squared."""


def merge_duplicates(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32], int]:
    """Vertices with exactly the same coordinates become one; the third value says how many are gone.

    The order of the remaining vertices is kept.
    """
    # Sorting one hash per vertex is many times faster than sorting rows; equal hashes are checked below.
    hashed = point_hashes(vertices)
    ordered = np.sort(hashed)
    if not (ordered[1:] == ordered[:-1]).any():
        return vertices, faces, 0
    order = np.argsort(hashed, kind="stable").astype(np.int32)
    first_of_run = np.r_[True, ordered[1:] != ordered[:-1]]
    original = np.empty(len(vertices), np.int32)
    original[order] = order[first_of_run][np.cumsum(first_of_run) - 1]
    del hashed, ordered, order, first_of_run
    for start in range(0, len(vertices), CHUNK):
        part = slice(start, start + CHUNK)
        same = (vertices[original[part]] == vertices[part]).all(axis=1)
        original[part] = np.where(same, original[part], np.arange(start, start + len(same)))
    kept = original == np.arange(len(vertices), dtype=np.int32)
    number = (np.cumsum(kept, dtype=np.int32) - 1)[original]
    return vertices[kept], number[faces], int((~kept).sum())


def point_hashes(vertices: Array) -> NDArray[np.uint64]:
    """(n,) the same for the same coordinates (n, 3)."""
    hashed = np.empty(len(vertices), np.uint64)
    for start in range(0, len(vertices), CHUNK):
        hashed[start : start + CHUNK] = _hashes(vertices[start : start + CHUNK])
    return hashed


def _hashes(vertices: Array) -> NDArray[np.uint64]:
    """(n,) of the bits of vertices (n, 3); −0 has those of 0."""
    bits = (vertices + 0.0).view(np.uint64)
    hashed = np.zeros(len(vertices), np.uint64)
    for axis, factor in enumerate((0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)):
        hashed ^= bits[:, axis] * np.uint64(factor)
        hashed = (hashed ^ (hashed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    return hashed


def examine_faces(vertices: Array, faces: NDArray[np.int32]) -> tuple[Mask, Array, Mask]:
    """(m,) degenerate; (3,) twice the total vector area; (2,) any face up, any down."""
    from .triangle_kernels import examine

    degenerate = np.zeros(len(faces), np.bool_)
    *total, up, down = examine(vertices, faces, FLAT, degenerate)
    return degenerate, np.array(total), np.array([up, down])


def drop_loose(vertices: Array, faces: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32], int]:
    """Only vertices that a face uses; the third value says how many are gone."""
    used = np.zeros(len(vertices), np.bool_)
    used[faces] = True
    loose = len(vertices) - int(used.sum())
    if not loose:
        return vertices, faces, 0
    return vertices[used], (np.cumsum(used, dtype=np.int32) - 1)[faces].astype(np.int32), loose
