# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a film's camera stands: opposite the slope, looking up it, so near that the trajectories fill the picture."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import atan, hypot, pi, radians, tan

import numpy as np

from ..vectors import Array, cross, unit

Seen = Callable[[Array], Array]
"""From a position (3,) to the share, 0…1, of each trajectory point that can be seen from there: (n,)."""

UP = np.array([0.0, 0.0, 1.0])
FIELD_OF_VIEW = radians(55.0)
TURNS_DEG = (0, 12, -12, 22, -22, 35, -35, 50, -50)
STEPS_DEG = (-8, 0, 8, 16, 24, 34)
BEST_TURN_DEG = 22.0
"""A little from the side, so that the height of the bounces shows."""
BEST_SIGHT_DEG = 33.0
"""Between the line of sight and the slope: from below, so that the slope rises before the camera, yet not so flat that
its parts hide each other."""


@dataclass(frozen=True)
class Margins:
    """Shares of the picture's width and height that are kept free for captions."""

    left: float = 0.08
    right: float = 0.08
    bottom: float = 0.13
    top: float = 0.13


@dataclass(frozen=True, eq=False)
class View:
    """A camera without roll or distortion.

    Attributes
    ----------
    position : (3,) [m].
    right, up, forward : (3,) unit vectors.
    fov : horizontal angle of view [rad].
    aspect : width of the picture over its height.
    """

    position: Array
    right: Array
    up: Array
    forward: Array
    fov: float
    aspect: float

    def project(self, points: Array) -> Array:
        """(n, 3): across and up the picture, 0…1 from the lower left corner, and the depth [m]."""
        away = points - self.position
        depth = away @ self.forward
        half = tan(self.fov / 2)
        across = away @ self.right / depth / half
        upwards = away @ self.up / depth / half * self.aspect
        return np.column_stack([(across + 1) / 2, (upwards + 1) / 2, depth])

    def pixel_m(self, depth: float | Array, width_px: int) -> float | Array:
        """Size of one pixel at a depth [m]."""
        return 2 * tan(self.fov / 2) * depth / width_px


def look_at(position: Array, target: Array, fov: float, aspect: float) -> View:
    """A view from a position to a target, its horizon level."""
    return _facing(np.asarray(position, dtype=np.float64), unit(np.asarray(target) - position), fov, aspect)


def fit(points: Array, forward: Array, fov: float, aspect: float, margins: Margins | None = None) -> View:
    """The nearest view in a direction that shows all points inside the margins.

    Notes
    -----
    Exact: for a fixed direction the four sides of the picture bound the position linearly. Where one pair of sides
    leaves room, the points are centred between them.
    """
    margins = margins or Margins()
    view = _facing(np.zeros(3), unit(np.asarray(forward, dtype=np.float64)), fov, aspect)
    x, y, z = points @ view.right, points @ view.up, points @ view.forward
    half = tan(fov / 2)
    left, right = (2 * margins.left - 1) * half, (1 - 2 * margins.right) * half
    low, high = (2 * margins.bottom - 1) * half / aspect, (1 - 2 * margins.top) * half / aspect
    nearest = [
        ((value - small * z).min() - (value - large * z).max()) / (large - small)
        for value, small, large in ((x, left, right), (y, low, high))
    ]
    depth = min(*nearest, float(z.min()) - 1.0)
    place = [
        ((value - small * (z - depth)).min() + (value - large * (z - depth)).max()) / 2
        for value, small, large in ((x, left, right), (y, low, high))
    ]
    position = place[0] * view.right + place[1] * view.up + depth * view.forward
    return _facing(position, view.forward, fov, aspect)


def place_camera(
    points: Array,
    downhill: Array,
    aspect: float,
    seen: Seen | None = None,
    margins: Margins | None = None,
) -> View:
    """Choose the view of a film.

    Parameters
    ----------
    points : (n, 3) along the trajectories.
    downhill : (3,) or (2,) the way the blocks go; its horizontal part counts.
    seen : what of the points is not hidden by terrain, None when nothing can hide them.

    Notes
    -----
    Directions around the fall line are tried, from below to well above; the one wins that shows the most of the
    trajectories, then the one nearest to `BEST_TURN_DEG` on either side and to `BEST_SIGHT_DEG`.
    """
    best, best_score = None, -np.inf
    wanted = float(np.clip(BEST_SIGHT_DEG - _inclination_deg(points, downhill), -10.0, 40.0))
    for turn, step, view in _candidates(points, downhill, aspect, margins, wanted):
        visible = 1.0 if seen is None else float(seen(view.position).mean())
        score = visible - 0.004 * abs(abs(turn) - BEST_TURN_DEG) - 0.006 * abs(step)
        if score > best_score + 1e-9:
            best, best_score = view, score
    assert best is not None
    return best


def downhill_direction(starts: Array, ends: Array) -> Array:
    """(3,) horizontal unit vector from where blocks start to where they end, (n, 3) each; north if nowhere."""
    way = ends.mean(axis=0) - starts.mean(axis=0)
    way[2] = 0.0
    return unit(way) if hypot(way[0], way[1]) > 1e-6 else np.array([0.0, 1.0, 0.0])


def vertical_fov(view: View) -> float:
    """Vertical angle of view [rad]."""
    return 2 * atan(tan(view.fov / 2) / view.aspect)


def rounded_scale(wanted: float) -> float:
    """By how much blocks are enlarged: 1 when they need not be, else a number that reads well in a caption."""
    steps = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 15.0, 20.0, 30.0, 50.0)
    return next((step for step in steps if step >= wanted - 1e-9), 100.0)


def _inclination_deg(points: Array, downhill: Array) -> float:
    """Mean inclination of the points along the fall line [°]."""
    along = points[:, :2] @ unit(np.asarray(downhill[:2], dtype=np.float64))
    spread = along - along.mean()
    run = float(spread @ spread)
    return float(np.degrees(np.arctan2(-(spread @ points[:, 2]), run))) if run > 1e-9 else 45.0


def _candidates(
    points: Array, downhill: Array, aspect: float, margins: Margins | None, best_pitch_deg: float
) -> Iterator[tuple[int, int, View]]:
    """Turn from the fall line [°], step from the best pitch [°], and the view."""
    uphill = -unit(np.array([downhill[0], downhill[1], 0.0]))
    for turn in TURNS_DEG:
        for step in STEPS_DEG:
            pitch = best_pitch_deg + step
            c, s = np.cos(turn * pi / 180), np.sin(turn * pi / 180)
            level = np.array([c * uphill[0] - s * uphill[1], s * uphill[0] + c * uphill[1], 0.0])
            forward = level * np.cos(radians(pitch)) - UP * np.sin(radians(pitch))
            yield turn, step, fit(points, forward, FIELD_OF_VIEW, aspect, margins)


def _facing(position: Array, forward: Array, fov: float, aspect: float) -> View:
    right = cross(forward, UP)
    if np.linalg.norm(right) < 1e-9:  # straight down: north is up
        right = np.array([1.0, 0.0, 0.0])
    right = unit(right)
    return View(position, right, cross(right, forward), forward, fov, aspect)
