# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera against OpenCV, finite differences and itself."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rockfall.core.camera.model import (
    INTRINSICS,
    Camera,
    distort,
    full_frame_mm,
    look_at,
    project,
    project_with_derivatives,
    quaternion_from_rotation,
    rays,
    rotation_from_vector,
    undistort,
    validity_radius,
    vector_from_rotation,
    with_intrinsics,
)
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import Array, norm

ACTION_CAMERA = {"k1": -0.28, "k2": 0.09, "k3": -0.012, "p1": 0.0007, "p2": -0.0011}


def some_camera(seed: int = 3, **distortion: float) -> Camera:
    rng = np.random.default_rng(seed)
    rotation = rotation_from_vector(rng.normal(size=3))
    return Camera(
        1920, 1080, 1500.0, 1480.0, 950.0, 555.0, **distortion, position=rng.normal(size=3) * 50, rotation=rotation
    )


def seen_points(camera: Camera, n: int, seed: int = 4) -> Array:
    """Points in front of a camera, within about 50°."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(3, 400, n)
    plane = rng.uniform(-0.7, 0.7, (n, 2))
    return camera.position + (np.column_stack([plane, np.ones(n)]) * depth[:, None]) @ camera.rotation


def opencv_matrix(camera: Camera) -> Array:
    """OpenCV counts from the centre of the first pixel."""
    return np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1.0]])


def opencv_distortion(camera: Camera) -> Array:
    return np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])


def test_pixels_are_opencvs() -> None:
    camera = some_camera(**ACTION_CAMERA)
    points = seen_points(camera, 300)
    turn = cv2.Rodrigues(camera.rotation)[0]
    theirs, _ = cv2.projectPoints(
        points, turn, -camera.rotation @ camera.position, opencv_matrix(camera), opencv_distortion(camera)
    )
    np.testing.assert_allclose(project(camera, points), theirs[:, 0] + 0.5, atol=1e-7)


def test_normalised_coordinates_are_opencvs() -> None:
    camera = some_camera(**ACTION_CAMERA)
    rng = np.random.default_rng(5)
    pixels = rng.uniform((0, 0), camera.size, (300, 2))
    exact = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 500, 1e-15)
    theirs = cv2.undistortPoints(
        (pixels - 0.5)[:, None], opencv_matrix(camera), opencv_distortion(camera), criteria=exact
    )
    np.testing.assert_allclose(undistort(camera, pixels), theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize("distortion", [{}, ACTION_CAMERA])
def test_derivatives_are_those_of_finite_differences(distortion: dict[str, float]) -> None:
    camera = some_camera(**distortion)
    points = seen_points(camera, 20)
    found = project_with_derivatives(camera, points)
    np.testing.assert_allclose(found.pixel, project(camera, points), rtol=1e-13)
    np.testing.assert_allclose(found.depth, (points - camera.position) @ camera.rotation[2])

    def slope(pixels: "list[Array]", h: float) -> Array:
        return (pixels[0] - pixels[1]) / (2 * h)

    for axis in range(3):
        e = np.zeros(3)
        e[axis] = 1e-4
        by_point = slope([project(camera, points + sign * e) for sign in (1, -1)], 1e-4)
        np.testing.assert_allclose(found.d_point[:, :, axis], by_point, rtol=1e-6, atol=1e-5)
        by_position = slope(
            [project(replace(camera, position=camera.position + sign * e), points) for sign in (1, -1)], 1e-4
        )
        np.testing.assert_allclose(found.d_position[:, :, axis], by_position, rtol=1e-6, atol=1e-5)
        e[axis] = 1e-6
        by_rotation = slope(
            [
                project(replace(camera, rotation=rotation_from_vector(sign * e) @ camera.rotation), points)
                for sign in (1, -1)
            ],
            1e-6,
        )
        np.testing.assert_allclose(found.d_rotation[:, :, axis], by_rotation, rtol=1e-6, atol=1e-2)
    for number, name in enumerate(INTRINSICS):
        h = 1e-2 if number < 4 else 1e-6
        values = np.zeros(9)
        values[number] = h
        by_value = slope(
            [project(with_intrinsics(camera, camera.intrinsics + sign * values), points) for sign in (1, -1)], h
        )
        np.testing.assert_allclose(found.d_intrinsics[:, :, number], by_value, rtol=1e-6, atol=1e-3, err_msg=name)


coefficient = st.floats(-0.4, 0.4)
small = st.floats(-0.01, 0.01)


@settings(deadline=None, max_examples=60)
@given(
    focal=st.floats(300, 20_000),
    k1=coefficient,
    k2=st.floats(-0.2, 0.2),
    k3=st.floats(-0.1, 0.1),
    p1=small,
    p2=small,
    turn=st.tuples(*[st.floats(-2, 2)] * 3),
    place=st.tuples(*[st.floats(-1000, 1000)] * 3),
    seed=st.integers(0, 10_000),
)
def test_rays_lead_back_to_their_pixels(
    focal: float,
    k1: float,
    k2: float,
    k3: float,
    p1: float,
    p2: float,
    turn: tuple[float, ...],
    place: tuple[float, ...],
    seed: int,
) -> None:
    """To 1e-9 px, for every pixel that has a ray; and every direction within the validity radius has its pixel."""
    rotation = rotation_from_vector(np.array(turn))
    camera = Camera(
        1920, 1080, focal, focal, 960.0, 540.0, k1, k2, k3, p1, p2, position=np.array(place), rotation=rotation
    )
    rng = np.random.default_rng(seed)
    reach = min(validity_radius(camera), 3.0)
    angle = rng.uniform(0, 2 * np.pi, 50)
    plane = 0.999 * reach * np.sqrt(rng.uniform(0, 1, 50))[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    pixels = distort(camera, plane)
    assert np.isfinite(pixels).all()
    origins, directions = rays(camera, pixels)
    assert np.isfinite(directions).all()
    # The world's coordinates of 1000 m have 1e-13 m steps; a point at the camera's side is near enough for 1e-9 px.
    again = project(camera, origins + directions * rng.uniform(500, 3000, (50, 1)))
    tolerance = 1e-9 + 4e-12 * np.abs(pixels - [camera.cx, camera.cy]) + 2e-15 * focal
    assert (np.abs(again - pixels) <= tolerance).all()


def test_round_trip_within_the_image_to_a_billionth_of_a_pixel() -> None:
    camera = some_camera(**ACTION_CAMERA)
    pixels = np.random.default_rng(1).uniform((0, 0), camera.size, (2000, 2))
    origins, directions = rays(camera, pixels)
    np.testing.assert_allclose(norm(directions), 1, rtol=1e-14)
    np.testing.assert_allclose(project(camera, origins + 100 * directions), pixels, atol=1e-9)


def test_behind_the_camera_there_are_no_pixels() -> None:
    camera = look_at(1920, 1080, (0, 0, 0), (0, 10, 0), fov_deg=60)
    pixels = project(camera, [[0, -5, 0], [0, 0, 1], [0, 5, 0]])
    assert np.isnan(pixels[:2]).all()
    np.testing.assert_allclose(pixels[2], [960, 540])
    assert np.isnan(project_with_derivatives(camera, [[0, -5, 0]]).pixel).all()


def test_validity_radius_of_one_coefficient() -> None:
    """1 + 3 k1 r² = 0."""
    camera = some_camera(k1=-0.3)
    reach = 1 / np.sqrt(0.9)
    assert validity_radius(camera) == pytest.approx(reach)
    assert np.isinf(validity_radius(some_camera()))
    assert np.isinf(validity_radius(some_camera(k1=0.3)))
    beyond = distort(camera, [[reach * 0.999, 0], [reach * 1.001, 0]])
    assert np.isfinite(beyond[0]).all()
    assert np.isnan(beyond[1]).all()
    edge = beyond[0, 0]
    assert np.isfinite(undistort(camera, [[edge, camera.cy]])).all()
    assert np.isnan(undistort(camera, [[edge + 5, camera.cy]])).all()
    assert np.isnan(rays(camera, [[edge + 5, camera.cy], [np.nan, 1]])[1]).all()


@pytest.mark.parametrize("seed", range(8))
def test_validity_radius_is_where_the_determinant_first_vanishes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = some_camera(k1=rng.uniform(-0.5, 0.1), k2=0.1, k3=rng.uniform(-0.3, -0.05), p1=rng.normal() / 10, p2=0.06)
    reach = validity_radius(camera)
    angle = np.linspace(0, 2 * np.pi, 721)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def least_determinant(radius: float) -> float:
        h = 1e-6
        flat = replace(camera, fx=1.0, fy=1.0, cx=0.0, cy=0.0)
        columns = [
            cv2.projectPoints(
                np.column_stack([radius * ring + e, np.ones(len(ring))]),
                np.zeros(3),
                np.zeros(3),
                np.eye(3),
                opencv_distortion(flat),
            )[0][:, 0]
            for e in ([h, 0], [-h, 0], [0, h], [0, -h])
        ]
        dx, dy = (columns[0] - columns[1]) / (2 * h), (columns[2] - columns[3]) / (2 * h)
        return float((dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0]).min())

    assert all(least_determinant(share * reach) > 0 for share in (0.3, 0.6, 0.9, 0.99))
    assert least_determinant(1.01 * reach) < 0


def test_every_row_may_have_its_own_pose() -> None:
    cameras = [some_camera(seed, **ACTION_CAMERA) for seed in range(5)]
    points = np.concatenate([seen_points(camera, 1) for camera in cameras])
    position = np.array([camera.position for camera in cameras])
    rotation = np.array([camera.rotation for camera in cameras])
    together = project(cameras[0], points, position=position, rotation=rotation)
    alone = np.concatenate([project(camera, point[None]) for camera, point in zip(cameras, points, strict=True)])
    np.testing.assert_allclose(together, alone, rtol=1e-12)
    origins, directions = rays(cameras[0], together, position=position, rotation=rotation)
    np.testing.assert_array_equal(origins, position)
    np.testing.assert_allclose(np.cross(directions, points - position), 0, atol=1e-9)
    derived = project_with_derivatives(cameras[0], points, position=position, rotation=rotation)
    for row, camera in enumerate(cameras):
        one = project_with_derivatives(camera, points[row : row + 1])
        np.testing.assert_allclose(derived.d_point[row], one.d_point[0], rtol=1e-10)
        np.testing.assert_allclose(derived.d_rotation[row], one.d_rotation[0], rtol=1e-10, atol=1e-9)


def test_looking_at_a_point() -> None:
    camera = look_at(1920, 1080, (10, -3, 5), (100, 40, -20), fov_deg=50)
    assert camera.fx == pytest.approx(960 / np.tan(np.radians(25)))
    np.testing.assert_allclose(project(camera, [[100, 40, -20]]), [[960, 540]], atol=1e-9)
    above = project(camera, [[100, 40, -10]])[0]
    assert above[0] == pytest.approx(960)
    assert above[1] < 540
    down = look_at(100, 100, (0, 0, 50), (0, 0, 0), focal_px=100)
    np.testing.assert_allclose(project(down, [[0, 10, 0], [10, 0, 0]]), [[50, 30], [70, 50]], atol=1e-9)


@settings(deadline=None)
@given(
    axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3),
    angle=st.floats(0, np.pi) | st.floats(0, 1e-7) | st.floats(np.pi - 1e-7, np.pi),
)
def test_rotation_vectors(axis: tuple[float, ...], angle: float) -> None:
    vector = np.array(axis) / np.linalg.norm(axis) * angle
    rotation = rotation_from_vector(vector)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rotation, cv2.Rodrigues(vector)[0], atol=1e-12)
    np.testing.assert_allclose(rotation_from_vector(vector_from_rotation(rotation)), rotation, atol=1e-14)
    assert norm(quaternion_from_rotation(rotation)) == pytest.approx(1)
    assert norm(vector_from_rotation(rotation)) == pytest.approx(angle, abs=1e-12)


def test_another_shift_is_the_same_place() -> None:
    camera = some_camera()
    moved = camera.in_shift(GlobalShift(2_600_000, 1_200_000, 1500))
    np.testing.assert_allclose(moved.shift.to_survey(moved.position), camera.position, atol=1e-8)


NOT_FINITE = "The camera's inner parameters are not finite, or its focal length is not positive."
NO_PLACE = "The camera's position is not three finite numbers."
NO_ROWS = "The camera's rotation is not three rows of three finite numbers."
NO_ROTATION = "The camera's rotation is not a rotation: its rows are not at right angles, or it mirrors."


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fx": 0.0}, NOT_FINITE),
        ({"fy": -1.0}, NOT_FINITE),
        ({"k1": np.nan}, NOT_FINITE),
        ({"width": 0}, "The camera's image is 0 × 1080 px, which is no size."),
        ({"height": -1}, "The camera's image is 1920 × -1 px, which is no size."),
        ({"position": np.array([0, np.inf, 0])}, NO_PLACE),
        ({"position": np.zeros(2)}, NO_PLACE),
        ({"rotation": np.full((3, 3), np.nan)}, NO_ROWS),
        ({"rotation": np.eye(4)}, NO_ROWS),
        ({"rotation": np.diag([1.0, 1, -1])}, NO_ROTATION),
        ({"rotation": np.eye(3) * 1.1}, NO_ROTATION),
    ],
)
def test_impossible_cameras_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        replace(some_camera(), **change)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("target", "lens", "message"),
    [
        ((0, 1, 0), {}, "A camera needs either its focal length or its angle of view."),
        (
            (0, 1, 0),
            {"focal_px": 1e3, "fov_deg": 60},
            "A camera needs either its focal length or its angle of view.",
        ),
        ((5, 5, 5), {"fov_deg": 60}, "The camera cannot look at the place where it stands."),
    ],
)
def test_what_a_camera_cannot_look_at(target: tuple[float, ...], lens: dict[str, float], message: str) -> None:
    with pytest.raises(InputError) as caught:
        look_at(1920, 1080, (5, 5, 5), target, **lens)
    assert str(caught.value) == message


def test_the_principal_point_of_a_distorted_camera_is_straight_ahead() -> None:
    """Where the distorted radius is exactly 0, so is the undistorted one."""
    camera = some_camera(k1=-0.2, k2=0.05)
    np.testing.assert_array_equal(undistort(camera, [[camera.cx, camera.cy]]), [[0, 0]])
    np.testing.assert_allclose(rays(camera, [[camera.cx, camera.cy]])[1], camera.rotation[2:], atol=1e-15)


def test_a_focal_length_on_full_frame() -> None:
    """An image of 3 : 2 that is as wide as its focal length is a 36 mm one, whatever its size."""
    assert full_frame_mm(3600.0, (3600, 2400)) == pytest.approx(36.0, abs=1e-4)
    assert full_frame_mm(50.0, (36, 24)) == pytest.approx(50.0, abs=1e-4)
