# SPDX-License-Identifier: GPL-3.0-or-later
"""A finer mesh of the same surface: each triangle becomes four, and what is curved stays curved."""

from dataclasses import replace

import numpy as np

from ..vectors import dot
from .surface import Surface

SHARP_COS = 0.866
"""Two faces that differ by more than 30° meet in a true edge."""


def subdivided(surface: Surface) -> Surface:
    """Four faces in place of each, in its order: face i becomes 4 i to 4 i + 3, the last of them the one in the middle.

    Notes
    -----
    The vertices stay. The middle of an edge from a to b is moved off the chord by −(w·n_a − w·n_b)/8 along the
    normals, w = b − a: that of a PN triangle (Vlachos et al. 2001), a cubic through both ends at right angles to the
    normals there. On an arc of the turn θ that leaves a sixteenth of the sagitta's error, O(θ⁴). Borders, true
    edges, and the edges that end on these stay straight.
    """
    vertices, faces = surface.vertices, surface.faces
    normals = np.nan_to_num(surface.vertex_normals)
    start, end = faces.astype(np.int64).ravel(), np.roll(faces, -1, axis=1).astype(np.int64).ravel()
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    edges, edge = np.unique(key, return_inverse=True)
    a, b = edges // len(vertices), edges % len(vertices)
    way = vertices[b] - vertices[a]
    bow = -(dot(way, normals[a])[:, None] * normals[a] - dot(way, normals[b])[:, None] * normals[b]) / 8
    both = [np.bincount(edge, np.repeat(surface.face_normals[:, k], 3), len(edges)) for k in range(3)]
    faces_at = np.bincount(edge, minlength=len(edges))
    with np.errstate(invalid="ignore"):
        smooth = (faces_at == 2) & (sum(one**2 for one in both) > 2 + 2 * SHARP_COS)  # |n + m|² = 2 + 2 n·m
    true_edge = (faces_at == 2) & ~smooth
    sharp = np.zeros(len(vertices), np.bool_)
    sharp[a[true_edge]] = sharp[b[true_edge]] = True
    curved = smooth & ~sharp[a] & ~sharp[b]
    middles = vertices[a] + way / 2 + np.where(curved[:, None], bow, 0.0)
    p, q, r = faces.T
    pq, qr, rp = (len(vertices) + edge.reshape(-1, 3)).astype(np.int32).T
    parts = np.stack([[p, pq, rp], [pq, q, qr], [rp, qr, r], [pq, qr, rp]])  # (4, 3, m)
    return replace(
        surface,
        vertices=np.vstack([vertices, middles]),
        faces=np.ascontiguousarray(parts.transpose(2, 0, 1).reshape(-1, 3), dtype=np.int32),
        colours=None,
    )
