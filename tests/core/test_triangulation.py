# SPDX-License-Identifier: GPL-3.0-or-later
"""Single points from pixels, against geometry by hand and draws."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.triangulation import epipolar_curve, pick_on_terrain, triangulate
from rockfall.core.terrain.surface import Surface
from scipy.spatial.transform import Rotation

GROUND = Surface(
    np.array([[-500.0, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "ground",
)


def test_the_ellipse_on_level_ground_is_that_of_the_geometry():
    """At 45° from 100√2 m, a pixel of 1/1000 rad is 0.1414 m across and 0.1414/sin 45° along."""
    camera = look_at(2000, 1000, (0, -100, 100), (0, 0, 0), focal_px=1000.0)
    found = pick_on_terrain(camera, [[1000.0, 500.0]], GROUND, 1.0)
    np.testing.assert_allclose(found.point, [[0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(found.grazing, np.pi / 4)
    np.testing.assert_allclose(np.abs(found.ellipse[0]), [[0, 0.2, 0], [0.1 * np.sqrt(2), 0, 0]], atol=1e-9)
    np.testing.assert_allclose(found.covariance[0], np.diag([0.02, 0.04, 0]), atol=1e-9)
    assert found.warning == ("",)


def test_the_ellipse_is_the_spread_of_draws():
    camera = replace(look_at(2000, 1000, (30, -100, 40), (0, 0, 0), focal_px=1500.0), k1=-0.1, p1=1e-3)
    rng = np.random.default_rng(1)
    draws = np.array([700.0, 420.0]) + 0.5 * rng.normal(size=(20_000, 2))
    found = pick_on_terrain(camera, [[700.0, 420.0]], GROUND, 0.5)
    np.testing.assert_allclose(np.cov(pick_on_terrain(camera, draws, GROUND).point.T), found.covariance[0], atol=3e-4)


def test_a_lens_and_a_pose_that_depend_on_each_other_spread_a_click_as_draws_of_both_do():
    """A focal length that is 0.5 % uncertain while the camera backs away along: of a click, and of one in two views."""
    camera = replace(look_at(2000, 1000, (30, -100, 40), (0, 0, 0), focal_px=1500.0), k1=-0.1)
    back = -camera.rotation[2] * camera.position @ camera.rotation[2] / camera.fx
    whole = np.zeros((15, 15))
    change = np.zeros(15)
    change[3:6], change[6:8] = back, 1.0  # metres and pixels of focal length for one pixel of it
    change *= 7.5
    pixel = np.array([[700.0, 420.0]])
    found = pick_on_terrain(camera, pixel, GROUND, 1e-6, pose_covariance=whole + np.outer(change, change))
    ends = [
        pick_on_terrain(replace(camera, position=camera.position + k * change[3:6], fx=camera.fx + k * change[6],
                                fy=camera.fy + k * change[7]), pixel, GROUND).point[0]
        for k in (-0.1, 0.1)
    ]  # fmt: skip
    moved = (ends[1] - ends[0]) / 0.2
    np.testing.assert_allclose(found.covariance[0], np.outer(moved, moved), atol=1e-3 * float(moved @ moved))
    cameras, pixels = [camera, CAMERAS[0]], np.stack([project(camera, found.point), project(CAMERAS[0], found.point)])
    sharp = triangulate(cameras, pixels, 0.1)
    both = triangulate(cameras, pixels, 0.1, pose_covariances=[np.outer(change, change), np.zeros((6, 6))])
    assert np.trace(both.covariance[0]) > 1.05 * np.trace(sharp.covariance[0])


def test_grazing_and_missing_rays_are_told():
    camera = look_at(2000, 1000, (0, -100, 5), (0, 0, 0), focal_px=1000.0)
    found = pick_on_terrain(camera, [[1000.0, 500.0], [1000.0, 100.0]], GROUND)
    angle, reach = np.arctan(5 / 100), np.linalg.norm(found.ellipse[0, 0])
    assert reach == pytest.approx(np.hypot(100, 5) / 1000 / np.sin(angle), rel=1e-9)
    assert found.warning == (
        f"The ray grazes the terrain at {np.degrees(angle):.1f}°: its place is known to {reach:.1f} m.",
        "The ray misses the terrain.",
    )
    assert np.isnan(found.point[1]).all()


CAMERAS = [
    look_at(1920, 1080, (100, -10, 20), (0, 0, 0), focal_px=2000.0),
    replace(look_at(1920, 1080, (10, -120, 10), (0, 0, 0), focal_px=1800.0), k1=-0.05),
    look_at(1920, 1080, (-60, -80, 30), (0, 0, 0), focal_px=2500.0),
]


def test_exact_rays_meet():
    points = np.random.default_rng(2).uniform(-8, 8, (50, 3))
    pixels = np.stack([project(camera, points) for camera in CAMERAS])
    found = triangulate(CAMERAS, pixels)
    np.testing.assert_allclose(found.point, points, atol=1e-9)
    np.testing.assert_allclose(found.miss_distance, 0, atol=1e-8)


def test_the_covariance_is_the_spread_of_draws():
    point = np.array([[3.0, -2.0, 4.0]])
    rng = np.random.default_rng(3)
    pixels = np.stack([np.repeat(project(camera, point), 20_000, axis=0) for camera in CAMERAS])
    sigma = np.array([0.5, 1.0, 2.0])[:, None]
    found = triangulate(CAMERAS, pixels + sigma[:, :, None] * rng.normal(size=pixels.shape), sigma)
    np.testing.assert_allclose(np.cov(found.point.T), found.covariance[0], atol=4e-5)
    np.testing.assert_allclose(found.point.mean(axis=0), point[0], atol=1e-3)


def test_a_view_may_be_blind():
    points = np.array([[1.0, 2, 3], [4, 5, 6]])
    pixels = np.stack([project(camera, points) for camera in CAMERAS])
    pixels[1, 0] = np.nan
    pixels[:2, 1] = np.nan
    found = triangulate(CAMERAS, pixels)
    np.testing.assert_allclose(found.point[0], points[0], atol=1e-9)
    assert np.isnan(found.point[1]).all()


@pytest.mark.parametrize(
    ("views", "shape"), [(1, (1, 2, 2)), (3, (2, 2, 2)), (3, (3, 2, 3)), (3, (3, 2)), (3, (3, 2, 2, 2))]
)
def test_too_few_views_or_pixels_of_another_shape(views: int, shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError) as caught:
        triangulate(CAMERAS[:views], np.zeros(shape))
    assert str(caught.value) == (
        f"{views} views with pixels of the shape {shape} cannot be triangulated. "
        "Give two views or more, and pixels (views, points, 2)."
    )


def test_the_point_lies_on_the_epipolar_curve():
    point = np.array([[3.0, -2.0, 4.0]])
    pixel, other = project(CAMERAS[0], point)[0], project(CAMERAS[1], point)[0]
    curve = epipolar_curve(CAMERAS[0], pixel, CAMERAS[1], 50.0, 150.0, samples=20_000)
    assert np.linalg.norm(curve - other, axis=1).min() < 0.1
    low = epipolar_curve(CAMERAS[0], pixel, CAMERAS[1], 50.0, 1e4, GROUND)
    end = pick_on_terrain(CAMERAS[0], pixel[None], GROUND).point
    np.testing.assert_allclose(low[-1], project(CAMERAS[1], end)[0], atol=1e-6)


@pytest.mark.parametrize(("near", "far"), [(5.0, 1.0), (5.0, 5.0), (0.0, 5.0)])
def test_a_ray_that_cannot_run(near: float, far: float) -> None:
    with pytest.raises(InputError) as caught:
        epipolar_curve(CAMERAS[0], np.array([960.0, 540.0]), CAMERAS[1], near, far)
    assert str(caught.value) == f"The ray cannot run from {near} m to {far} m. Give 0 < near < far."


def test_a_pixel_that_the_lens_cannot_see_has_no_ray() -> None:
    narrow = replace(CAMERAS[0], k1=-3.0)
    with pytest.raises(InputError) as caught:
        epipolar_curve(narrow, np.array([5.0, 5.0]), CAMERAS[1], 1.0, 100.0)
    assert str(caught.value) == "The pixel is outside of what the lens can see, so that it has no ray."


SLOPE = Surface(
    np.array([[-500.0, -500, -150], [500, -500, 150], [500, 500, 150], [-500, 500, -150]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "slope",
)
SPACE = np.diag([0.002, 0.001, 0.003, 0.2, 0.1, 0.3])
TURNED = np.linalg.qr(np.random.Generator(np.random.MT19937(4)).normal(size=(6, 6)))[0]
POSE = SPACE @ (0.6 * np.eye(6) + 0.4 * TURNED @ np.diag([2.0, 1, 1, 0.5, 0.2, 0.1]) @ TURNED.T) @ SPACE
"""Of rotation and position, which are correlated, as those of a camera that was solved from pairs."""
DRAWS = 40_000


def drawn_poses(camera, rng):
    """Poses of a camera whose errors have the covariance POSE: turned about the axes of the camera, and moved."""
    errors = rng.multivariate_normal(np.zeros(6), POSE, size=DRAWS)
    turned = Rotation.from_rotvec(errors[:, :3]).as_matrix() @ camera.rotation
    return camera.position + errors[:, 3:], turned


def on_plane(camera, position, rotation, pixel, height):
    """Where rays through pixels meet the plane of SLOPE that was raised along its normal; by hand, with no lens."""
    seen = np.column_stack([(pixel - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(pixel))])
    way = np.einsum("nji,nj->ni", rotation, seen)
    normal = np.array([-0.3, 0.0, 1.0]) / np.sqrt(1.09)
    along = (height - position @ normal) / (way @ normal)
    return position + along[:, None] * way


def test_the_covariance_on_the_terrain_holds_the_camera_and_the_terrain():
    """Against draws of clicks, poses and heights, by the geometry of a plane."""
    camera = look_at(2000, 1000, (30, -100, 60), (0, 0, 0), focal_px=1500.0)
    rng = np.random.Generator(np.random.MT19937(11))
    pixel, sigma_px, sigma_terrain = np.array([700.0, 420.0]), 3.0, 0.15
    found = pick_on_terrain(camera, pixel[None], SLOPE, sigma_px, pose_covariance=POSE, sigma_terrain_m=sigma_terrain)
    upward = 1 / np.sqrt(1.09)
    height = sigma_terrain * (upward * rng.normal(size=DRAWS) + rng.normal(size=DRAWS))  # common to all, and smooth
    clicks = pixel + sigma_px * rng.normal(size=(DRAWS, 2))
    draws = on_plane(camera, *drawn_poses(camera, rng), clicks, height)
    spread = np.cov(draws.T)
    np.testing.assert_allclose(found.covariance[0], spread, atol=0.025 * np.trace(spread))
    exact = pick_on_terrain(camera, pixel[None], SLOPE, sigma_px).covariance[0]
    assert np.trace(exact) < 0.5 * np.trace(spread)  # the click alone is far from the truth
    half = found.ellipse[0]
    normal = np.array([-0.3, 0.0, 1.0]) * upward
    along = np.eye(3) - np.outer(normal, normal)
    np.testing.assert_allclose(half.T @ half, along @ spread @ along, atol=0.025 * np.trace(spread))


def test_the_covariance_in_space_holds_the_cameras():
    point = np.array([[3.0, -2.0, 4.0]])
    rng = np.random.Generator(np.random.MT19937(12))
    sigma = np.array([0.5, 1.0])[:, None]
    cameras = [CAMERAS[0], CAMERAS[2]]
    truth = [project(camera, point) for camera in cameras]
    found = triangulate(cameras, np.stack(truth), sigma, pose_covariances=[POSE, POSE])
    # A pose that is off moves the pixels: those that the solved camera would need, to see what the true one sees.
    pixels = np.stack(
        [
            project(camera, np.repeat(point, DRAWS, axis=0), position=place, rotation=turn)
            for camera in cameras
            for place, turn in [drawn_poses(camera, rng)]
        ]
    )
    draws = triangulate(cameras, pixels + sigma[:, :, None] * rng.normal(size=pixels.shape), sigma).point
    spread = np.cov(draws.T)
    np.testing.assert_allclose(found.covariance[0], spread, atol=0.025 * np.trace(spread))
    assert np.trace(triangulate(cameras, np.stack(truth), sigma).covariance[0]) < 0.5 * np.trace(spread)
