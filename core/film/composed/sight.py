# SPDX-License-Identifier: GPL-3.0-or-later
"""How a composed film sees: a camera for the film's own pixels, and what of points the terrain hides from it."""

from dataclasses import dataclass, replace

import numpy as np

from ...camera.model import Camera, project
from ...terrain.raycast import any_hit
from ...terrain.surface import Surface
from ...vectors import Array, Mask, norm

LEAST_SLACK_M = 0.05
"""Terrain that is nearer to a point than this hides nothing: scans have noise."""


@dataclass(frozen=True)
class Window:
    """The part of a video, or of another picture, that fills a film's picture.

    Attributes
    ----------
    scale : pixels of the film for one of the video.
    left, top : place of the video's corner in the film [px].
    width, height : of the film [px].
    """

    scale: float
    left: float
    top: float
    width: int
    height: int

    @property
    def matrix(self) -> Array:
        """(2, 3) from pixels of the video to those of the film, both from the centre of the first, as OpenCV."""
        shift = (self.scale - 1) / 2
        return np.array([[self.scale, 0.0, self.left + shift], [0.0, self.scale, self.top + shift]])

    def camera(self, camera: Camera) -> Camera:
        """The video's camera for the film's pixels; the lens bends as before."""
        s = self.scale
        return replace(
            camera,
            width=self.width,
            height=self.height,
            fx=s * camera.fx,
            fy=s * camera.fy,
            cx=s * camera.cx + self.left,
            cy=s * camera.cy + self.top,
        )


def whole(size: tuple[int, int], film: tuple[int, int], fill: bool = False) -> Window:
    """The window that shows the whole of a picture in the middle; with `fill`, the one that leaves no border."""
    scales = [film[i] / size[i] for i in range(2)]
    scale = max(scales) if fill else min(scales)
    return Window(scale, (film[0] - scale * size[0]) / 2, (film[1] - scale * size[1]) / 2, *film)


def centred(size: tuple[int, int], film: tuple[int, int], scale: float, on: Array) -> Window:
    """The window about a pixel of a picture, moved so far that it shows nothing beyond the picture if that can be.

    Parameters
    ----------
    on : (2,) [px] of the picture, which comes to the middle.
    """
    corner = []
    for i in range(2):
        wanted, room = film[i] / 2 - scale * float(on[i]), film[i] - scale * size[i]
        corner.append(room / 2 if room > 0 else min(max(wanted, room), 0.0))
    return Window(scale, corner[0], corner[1], *film)


def visible(surface: Surface | None, camera: Camera, points: Array, slack_m: float = LEAST_SLACK_M) -> Mask:
    """Which of points (n, 3) no terrain hides from a camera; NaN is hidden.

    Parameters
    ----------
    slack_m : terrain so near to a point does not hide it.
    """
    known: Mask = np.asarray(np.isfinite(points).all(axis=1))
    if surface is None or not known.any():
        return known
    away = points[known] - camera.position
    distance = norm(away)
    reach = np.maximum(distance - max(slack_m, LEAST_SLACK_M), 0.0)
    seen = known.copy()
    seen[known] = ~any_hit(surface, camera.position, away, reach)
    return seen


def pixel_size(camera: Camera, point: Array) -> float:
    """How large a metre is at a point [px]; NaN behind the camera."""
    depth = float((camera.rotation @ (point - camera.position))[2])
    return camera.fx / depth if depth > 0 else float("nan")


def pixels(camera: Camera, points: Array) -> Array:
    """(n, 2) [px]; NaN stays NaN, and what lies behind the camera becomes it."""
    return project(camera, points)
