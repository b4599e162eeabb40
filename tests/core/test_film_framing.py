# SPDX-License-Identifier: GPL-3.0-or-later
"""The film's camera sees what it should."""

import numpy as np
import pytest
from rockfall.core.film.framing import (
    UP,
    Margins,
    downhill_direction,
    fit,
    look_at,
    place_camera,
    rounded_scale,
    vertical_fov,
)


def slope(n: int = 300, angle_deg: float = 40.0) -> np.ndarray:
    """Points on bounces down a slope that falls towards the east, 100 m long, 20 m wide."""
    rng = np.random.default_rng(5)
    x = rng.uniform(0, 100, n)
    return np.column_stack([x, rng.uniform(-10, 10, n), -x * np.tan(np.radians(angle_deg)) + rng.uniform(0, 4, n)])


def test_projection_is_that_of_a_pinhole() -> None:
    view = look_at(np.array([0.0, 0, 0]), np.array([10.0, 0, 0]), np.radians(90), 2.0)
    points = np.array([[10.0, 0, 0], [10, -10, 0], [10, 0, 5], [20, 10, -5]])
    expected = [[0.5, 0.5, 10], [1.0, 0.5, 10], [0.5, 1.0, 10], [0.25, 0.25, 20]]
    np.testing.assert_allclose(view.project(points), expected, atol=1e-12)
    assert view.pixel_m(10.0, 640) == pytest.approx(20 / 640)
    assert vertical_fov(view) == pytest.approx(2 * np.arctan(0.5))


@pytest.mark.parametrize("forward", [(1.0, 0, 0), (0.3, 1, -0.4), (0, 0, -1), (-1, 0.2, 0.5)])
@pytest.mark.parametrize("aspect", [16 / 9, 0.6])
def test_fit_is_inside_and_touches(forward: tuple, aspect: float) -> None:
    margins = Margins(0.10, 0.20, 0.05, 0.15)
    points = slope() + 1000.0
    picture = fit(points, np.array(forward), np.radians(50), aspect, margins).project(points)
    u, v, depth = picture.T
    assert depth.min() > 0
    assert u.min() > 0.10 - 1e-9
    assert u.max() < 0.80 + 1e-9
    assert v.min() > 0.05 - 1e-9
    assert v.max() < 0.85 + 1e-9
    touching = np.isclose([u.min(), u.max()], [0.10, 0.80]).all() or np.isclose([v.min(), v.max()], [0.05, 0.85]).all()
    assert touching, "the camera stands farther away than it need"


@pytest.mark.parametrize("downhill", [(1.0, 0, 0), (0.6, -0.8, 0)])
def test_camera_stands_22_degrees_beside_the_fall_line(downhill: tuple) -> None:
    forward = place_camera(slope(), np.array(downhill), 16 / 9).forward
    along, across = -forward[:2] @ downhill[:2], forward[0] * downhill[1] - forward[1] * downhill[0]
    assert abs(np.degrees(np.arctan2(across, along))) == pytest.approx(22.0)


@pytest.mark.parametrize("angle_deg", [15.0, 40.0, 75.0])
def test_camera_shows_all_trajectories_from_below(angle_deg: float) -> None:
    points = slope(angle_deg=angle_deg)
    view = place_camera(points, np.array([1.0, 0, 0]), 16 / 9)
    picture = view.project(points)
    assert (picture > 0).all()
    assert (picture[:, :2] < 1).all()
    assert view.forward[0] < 0, "it looks up the slope"
    assert view.right[2] == pytest.approx(0), "the horizon is level"
    assert view.up @ UP > 0.7
    assert view.position[0] > points[:, 0].max(), "it stands beyond the foot"


def test_camera_goes_where_nothing_is_in_the_way() -> None:
    """A wall to the right of the fall line hides everything from there, and from low places."""
    points = slope()

    def seen(position: np.ndarray) -> np.ndarray:
        return np.full(10, float(position[1] > 20 and position[2] > points[:, 2].mean()))

    view = place_camera(points, np.array([1.0, 0, 0]), 16 / 9, seen)
    assert seen(view.position).all()


def test_downhill_is_level_and_defined_without_motion() -> None:
    way = downhill_direction(np.array([[0.0, 0, 50], [2, 0, 50]]), np.array([[3.0, 4, 0], [5, 4, 0]]))
    np.testing.assert_allclose(way, [0.6, 0.8, 0.0])
    np.testing.assert_allclose(downhill_direction(np.zeros((1, 3)), np.array([[0.0, 0, -9]])), [0, 1, 0])


@pytest.mark.parametrize(
    ("wanted", "scale"), [(0.2, 1.0), (1.0, 1.0), (1.2, 1.5), (3.4, 4.0), (6.9, 7.0), (400.0, 100.0)]
)
def test_blocks_are_enlarged_by_a_number_that_reads_well(wanted: float, scale: float) -> None:
    assert rounded_scale(wanted) == scale
