# SPDX-License-Identifier: GPL-3.0-or-later
"""Many points of a figure as one picture.

Points of one colour that lie over one another let 1 − (1 − opacity)ⁿ of it through, n of them, whatever their order. So
it is enough to count, for each pixel, the markers that cover it: points in pixels, spread by the marker's shape.
"""

from typing import Any, Literal

import cv2
import numpy as np
from matplotlib.artist import Artist, allow_rasterization
from matplotlib.colors import to_rgb

from ..vectors import Array

FINER = 8
"""Places in a pixel, along each axis, that tell how much of it a marker covers."""


class PointCloud(Artist):
    """n points of one colour, drawn as one picture within its axes.

    Parameters
    ----------
    points : (n, 2) in data coordinates; those that are not finite are left out.
    shape : a circle of a diameter, or a square of a side on its corner, of `size_pt`.
    opacity : of a single marker, 0 to 1.
    """

    def __init__(
        self,
        points: Array,
        shape: Literal["circle", "diamond"],
        size_pt: float,
        colour: str,
        opacity: float,
        zorder: float,
    ) -> None:
        super().__init__()
        self.points, self.shape, self.size_pt = points, shape, size_pt
        self.colour, self.opacity = colour, opacity
        self.set_zorder(zorder)
        self.set_rasterized(True)
        self.set_in_layout(False)

    @allow_rasterization
    def draw(self, renderer: Any) -> None:
        """Draw it with Matplotlib's renderer."""
        axes = self.axes
        if axes is None or not self.get_visible():
            return
        box = axes.bbox
        left, bottom = int(np.floor(box.x0)), int(np.floor(box.y0))
        width, height = int(np.ceil(box.x1)) - left, int(np.ceil(box.y1)) - bottom
        marker = marker_of(self.shape, renderer.points_to_pixels(self.size_pt))
        margin = len(marker) // 2
        with np.errstate(invalid="ignore", divide="ignore"):
            place = axes.transData.transform(self.points) - [left - margin, bottom - margin]
        wide, high = width + 2 * margin, height + 2 * margin
        seen = np.isfinite(place).all(axis=1) & (place >= 0).all(axis=1) & (place < [wide, high]).all(axis=1)
        column, row = place[seen].astype(np.intp).T
        count = np.bincount(row * wide + column, minlength=high * wide).reshape(high, wide)
        covered = cv2.filter2D(count.astype(np.float32), -1, marker.astype(np.float32))
        covered = covered[margin : margin + height, margin : margin + width]
        picture = np.empty((height, width, 4), dtype=np.uint8)
        picture[:, :, :3] = np.round(255 * np.array(to_rgb(self.colour)))
        picture[:, :, 3] = np.round(-255 * np.expm1(np.log1p(-self.opacity) * covered))
        graphics = renderer.new_gc()
        graphics.set_clip_rectangle(box)
        renderer.draw_image(graphics, left, bottom, picture)
        graphics.restore()


def marker_of(shape: Literal["circle", "diamond"], size_px: float) -> Array:
    """(k, k) how much of each pixel about its middle a marker covers, 0 to 1; k is odd."""
    reach = size_px / 2 if shape == "circle" else size_px / np.sqrt(2)
    half = int(np.ceil(reach - 0.5)) if reach > 0.5 else 0
    fine = (np.arange((2 * half + 1) * FINER) + 0.5) / FINER - half - 0.5
    x, y = np.meshgrid(fine, fine)
    inside = np.hypot(x, y) <= reach if shape == "circle" else np.abs(x) + np.abs(y) <= reach
    blocks = inside.reshape(2 * half + 1, FINER, 2 * half + 1, FINER)
    return np.asarray(blocks.mean(axis=(1, 3)), dtype=np.float64)
