# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled: colours between the corners of triangles."""

from ...compiled import borrowing


@borrowing
def mix_corners(points, face, vertices, triangles, bgr, colour, start, stop):  # type: ignore[no-untyped-def]
    """Fill `colour` (n, 3) at points on triangles by barycentric coordinates; rows without a face stay."""
    for row in range(start, stop):
        if face[row] < 0:
            continue
        i, j, k = triangles[face[row], 0], triangles[face[row], 1], triangles[face[row], 2]
        d11 = d12 = d22 = d1 = d2 = 0.0
        for axis in range(3):
            first, second = vertices[j, axis] - vertices[i, axis], vertices[k, axis] - vertices[i, axis]
            within = points[row, axis] - vertices[i, axis]
            d11 += first * first
            d12 += first * second
            d22 += second * second
            d1 += within * first
            d2 += within * second
        area = max(d11 * d22 - d12 * d12, 1e-300)
        u = min(max((d22 * d1 - d12 * d2) / area, 0.0), 1.0)
        v = min(max((d11 * d2 - d12 * d1) / area, 0.0), 1.0 - u)
        for channel in range(3):
            colour[row, channel] = (1.0 - u - v) * bgr[i, channel] + u * bgr[j, channel] + v * bgr[k, channel]
