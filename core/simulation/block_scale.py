# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface at the scale of a block: how far bends of a mesh are those of a surface, and how far noise.

A sphere that rolls feels what is as large as itself. Where edges are shorter, the bends around each triangle are summed
with the weights of a normal law, as wide as `WIDE` of the radius. On a crest or in a hollow they add up, those of noise
do not. With A, the size of the sum, and B, the sum of the sizes,

- A/B says how far the curvature of the triangles themselves counts, beside the mean curvature around: not at all up to
  `NOISE`, alone from `SURFACE` on;
- `NOISY` (B − A), as a mean over the edges, is the noise, which no crease may be part of.

This holds where edges are shorter than the diameter. Where they are twice as long or more, nothing is known of the
scale of the block, and the bends of the mesh are taken for those of the surface; between, in part.
"""

from typing import Any

import numpy as np

from ..vectors import Array

WIDE = 0.6
"""Standard deviation of what is around, as a part of the radius."""
SMALL = 0.003
"""A mean bend [rad] that is no noise."""
NOISE, SURFACE = 0.2, 0.5
"""The sum of the bends around as a part of the sum of their sizes."""
NOISY = 3.0
"""So many times its mean size, noise of a normal law is in 98 of 100 cases smaller."""
FINEST = 8
"""So many cells a triangle, at most."""


def step_of(radius_m: Array) -> Array:
    """(n,) integers: the powers of √2 m that stand for radii. A block's does not depend on other blocks."""
    return np.asarray(np.rint(2.0 * np.log2(radius_m)).astype(np.int64))


class Around:
    """Sums over what is around each triangle.

    Parameters
    ----------
    middle : (m, 2) in plan [m]. scale_m : standard deviation. spacing_m : between triangles.
    """

    def __init__(self, middle: Array, scale_m: float, spacing_m: float) -> None:
        low, high = middle.min(axis=0), middle.max(axis=0)
        least = float(np.sqrt(np.prod(np.maximum(high - low, scale_m)) / (FINEST * len(middle))))
        self.cell = max(0.5 * scale_m, 0.5 * spacing_m, least)
        self.sigma = scale_m / self.cell
        place = np.floor((middle - low) / self.cell).astype(np.intp)
        self.shape = tuple((place.max(axis=0) + 1).tolist())
        self.bin = place[:, 0] * self.shape[1] + place[:, 1]

    def __call__(self, values: Array) -> Array:
        """(m,) sums of values (m,)."""
        from scipy.ndimage import gaussian_filter

        cells = np.bincount(self.bin, values, self.shape[0] * self.shape[1]).reshape(self.shape)
        summed: Array = gaussian_filter(cells, self.sigma, mode="constant").ravel()[self.bin]
        return summed


def at_scale(corners: Any, linked: tuple[Any, Any, Any, Any], radius_m: float) -> tuple[Any, Any]:
    """Curvature (m, 4) and creases (m, 3) for blocks of a radius, see `facet_kernels`.

    Parameters
    ----------
    corners : (m, 3, 3) of the triangles, in the order of the leaves.
    linked : `across`, `bend`, `excess` and `width` of `facet_kernels.link`.
    """
    from .facet_kernels import curve, measure, spread

    across, bend, excess, width = linked
    m = len(corners)
    sums = np.empty((m, 4))
    own, crease, curvature = (np.empty((m, size), np.float32) for size in (3, 3, 4))
    measure(corners, bend, width, sums)
    area = sums[:, 0]
    noise, coherent, mean = np.zeros(m), np.ones(m), np.zeros((m, 3))
    spacing = float(np.sqrt(2.0 * np.median(area))) if m else np.inf
    around = None
    if spacing < 4.0 * radius_m:
        around = Around(np.asarray(corners, dtype=np.float64).mean(axis=1)[:, :2], WIDE * radius_m, spacing)
        all_area = np.maximum(around(area), 1e-12)
        local = np.sqrt(2.0 * all_area / np.maximum(around(np.ones(m)), 1e-12))
        smaller = np.clip(4.0 * radius_m / local - 1.0, 0.0, 1.0)
        length = np.maximum(around(sums[:, 1]), 1e-12)
        turn, size = np.abs(around(sums[:, 2])) / length, around(sums[:, 3]) / length
        together = (turn + SMALL) / (np.maximum(size, turn) + SMALL)
        coherent = 1.0 - smaller * (1.0 - np.clip((together - NOISE) / (SURFACE - NOISE), 0.0, 1.0))
        noise = smaller * NOISY * np.maximum(size - turn, 0.0)
    curve(corners, bend, excess, width, noise, own, crease)
    if around is not None:
        mean = np.stack([around(area * own[:, k]) / all_area for k in range(3)], axis=1)
    spread(across, own, mean, coherent, noise, curvature)
    return curvature, crease
