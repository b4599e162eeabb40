# SPDX-License-Identifier: GPL-3.0-or-later
"""A shaking, panning and walking camera, found again from features with noise and wrong tracks."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, project, rotation_from_vector, vector_from_rotation
from rockfall.core.camera.motion import FeatureTracks, _bridged, solve_motion
from rockfall.core.camera.path import CameraPath, fixed
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import Array, norm

REFERENCE = 40
RATE_HZ = 30.0


def relief(x: Array, y: Array) -> Array:
    """A slope that rises away from the camera, with humps [m]."""
    return 0.6 * y + 6 * np.sin(x / 11) * np.cos(y / 9) - 20


def on_relief(origins: Array, directions: Array) -> Array:
    """Where rays meet the relief: marching, then halving."""
    near, far = np.full(len(origins), 5.0), np.full(len(origins), np.nan)
    above = None
    for distance in np.arange(5.0, 400.0, 1.0):
        place = origins + distance * directions
        now = place[:, 2] > relief(place[:, 0], place[:, 1])
        if above is not None:
            crossing = above & ~now & np.isnan(far)
            near[crossing], far[crossing] = distance - 1, distance
        above = now
    for _ in range(45):
        middle = (near + far) / 2
        place = origins + middle[:, None] * directions
        over = place[:, 2] > relief(place[:, 0], place[:, 1])
        near, far = np.where(over, middle, near), np.where(over, far, middle)
    return origins + ((near + far) / 2)[:, None] * directions


def true_path(frames: int, *, walking: bool, pan_deg: float = 8.0) -> tuple[Camera, Array, Array]:
    """The reference camera, and positions and rotations: a shake of 0.5° and a slow pan, or a walk besides."""
    rng = np.random.default_rng(11)
    start = look_at(1920, 1080, (0, 0, 5), (0, 80, 25), fov_deg=60)
    shake = np.radians(0.5) * rng.normal(size=(frames, 3))
    pan = np.radians(pan_deg) * (np.arange(frames) / (frames - 1) - 0.5)
    turn = shake + pan[:, None] * [0, 1, 0]
    rotation = rotation_from_vector(turn) @ start.rotation
    position = np.repeat(start.position[None], frames, axis=0)
    if walking:
        position = position + np.cumsum(rng.normal(size=(frames, 3)), axis=0) * 0.02
        position += np.linspace(0, 1, frames)[:, None] * [1.5, 0.5, 0]
    return replace(start, position=position[REFERENCE], rotation=rotation[REFERENCE]), position, rotation


def tracked(
    camera: Camera, position: Array, rotation: Array, *, features: int = 500, wrong: float = 0.3, noise: float = 0.5
) -> FeatureTracks:
    """Features on the relief that live while they are in view; wrong ones jump about, or drift with dust."""
    rng = np.random.default_rng(12)
    frames = len(position)
    pixels = rng.uniform((-300, 0), (2220, 1080), (3 * features, 2))
    world = on_relief(np.repeat(camera.position[None], len(pixels), axis=0), _directions(camera, pixels))
    world = world[np.isfinite(world[:, 0])][:features]
    n = len(world)
    frame, feature = (each.ravel() for each in np.meshgrid(np.arange(frames), np.arange(n), indexing="ij"))
    pixel = project(camera, world[feature], position=position[frame], rotation=rotation[frame])
    pixel = pixel + noise * rng.normal(size=pixel.shape)
    jumping = rng.random(frame.size) < wrong / 2
    pixel[jumping] += rng.uniform(-80, 80, (int(jumping.sum()), 2))
    drifting = feature < wrong / 2 * n
    pixel[drifting] += (frame[drifting] - REFERENCE)[:, None] * rng.uniform(-1, 1, (n, 2))[feature[drifting]]
    seen = ((pixel > 0) & (pixel < camera.size)).all(axis=1)
    return FeatureTracks(frame[seen], 7 * feature[seen] + 3, pixel[seen])


def _directions(camera: Camera, pixels: Array) -> Array:
    seen = np.column_stack([(pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(pixels))])
    return (seen / norm(seen)[:, None]) @ camera.rotation


def angles_deg(found: Array, true: Array) -> Array:
    return np.degrees(norm(vector_from_rotation(found @ np.swapaxes(true, 1, 2))))


def test_a_person_who_pans() -> None:
    frames = 120
    camera, position, rotation = true_path(frames, walking=False)
    times = 3.7 + np.arange(frames) / RATE_HZ
    found = solve_motion(camera, tracked(camera, position, rotation), times, REFERENCE)
    wrong = angles_deg(found.path.rotation, rotation)
    assert wrong.max() < 0.012
    assert np.sqrt(np.mean(wrong**2)) < 0.006
    np.testing.assert_allclose(found.path.rotation[REFERENCE], camera.rotation, atol=1e-14)
    np.testing.assert_allclose(found.path.position, position)
    assert found.path.sigma_rotation[REFERENCE] == 0
    scaled = np.radians(np.delete(wrong, REFERENCE)) / np.delete(found.path.sigma_rotation, REFERENCE) / np.sqrt(3)
    assert 0.5 < np.sqrt(np.mean(scaled**2)) < 1.6
    assert np.nanmax(found.residual_px) < 1
    assert found.remarks == ()


def test_a_pan_that_leaves_the_first_view() -> None:
    """Features that appear later get their ray from frames that are already solved."""
    frames = 150
    camera, position, rotation = true_path(frames, walking=False, pan_deg=70.0)
    tracks = tracked(camera, position, rotation, features=500, wrong=0.0)
    in_reference = np.isin(tracks.feature, tracks.feature[tracks.frame == REFERENCE])
    assert np.bincount(tracks.frame[in_reference], minlength=frames).min() < 100
    found = solve_motion(camera, tracks, np.arange(frames) / RATE_HZ, REFERENCE)
    assert angles_deg(found.path.rotation, rotation).max() < 0.02


def test_a_person_who_walks() -> None:
    frames = 90
    camera, position, rotation = true_path(frames, walking=True)
    tracks = tracked(camera, position, rotation)
    found = solve_motion(camera, tracks, np.arange(frames) / RATE_HZ, REFERENCE, mode="full", points_of=on_relief)
    away = norm(found.path.position - position)
    assert away.max() < 0.15
    assert angles_deg(found.path.rotation, rotation).max() < 0.1
    others = np.arange(frames) != REFERENCE
    scaled = away[others] / found.path.sigma_position_m[others] / np.sqrt(3)
    assert 0.4 < np.sqrt(np.mean(scaled**2)) < 2
    turned_only = solve_motion(camera, tracks, np.arange(frames) / RATE_HZ, REFERENCE)
    assert np.nanmedian(turned_only.residual_px) > 2 * np.nanmedian(found.residual_px)


def test_walking_needs_the_terrain() -> None:
    camera, position, rotation = true_path(50, walking=True)
    with pytest.raises(InputError) as caught:
        solve_motion(camera, tracked(camera, position, rotation), np.arange(50.0), REFERENCE, mode="full")
    assert str(caught.value) == "A camera that moves needs the terrain, to tell moving from turning."


def test_solved_frames_remove_a_drift() -> None:
    """All features slide by 0.05 px a frame, as a tracker's template does: 5 px at the end are 0.17°."""
    frames = 141
    camera, position, rotation = true_path(frames, walking=False)
    clean = tracked(camera, position, rotation, wrong=0.1)
    slid = replace(clean, pixel=clean.pixel + (clean.frame - REFERENCE)[:, None] * [0.05, 0.0])
    times = np.arange(frames) / RATE_HZ
    drifting = solve_motion(camera, slid, times, REFERENCE)
    assert angles_deg(drifting.path.rotation, rotation)[-1] > 0.12
    keys = {i: replace(camera, rotation=rotation[i]) for i in (0, frames - 1)}
    tied = solve_motion(camera, slid, times, REFERENCE, key_frames=keys)
    assert angles_deg(tied.path.rotation, rotation).max() < 0.015
    np.testing.assert_allclose(tied.path.rotation[-1], rotation[-1], atol=1e-12)
    assert (tied.path.sigma_rotation[[0, REFERENCE, -1]] == 0).all()
    assert np.isfinite(tied.path.sigma_rotation).all()


def test_frames_without_features_lie_between_their_neighbours() -> None:
    frames = 80
    camera, position, rotation = true_path(frames, walking=False)
    tracks = tracked(camera, position, rotation, wrong=0.0)
    keep = (tracks.frame < 60) | (tracks.frame > 62)
    tracks = FeatureTracks(tracks.frame[keep], tracks.feature[keep], tracks.pixel[keep])
    found = solve_motion(camera, tracks, np.arange(frames) / RATE_HZ, REFERENCE)
    assert np.isinf(found.path.sigma_rotation[60:63]).all()
    assert np.isfinite(found.path.rotation).all()
    middle = (
        rotation_from_vector(0.5 * vector_from_rotation(found.path.rotation[63] @ found.path.rotation[59].T))
        @ found.path.rotation[59]
    )
    np.testing.assert_allclose(found.path.rotation[61], middle, atol=1e-12)
    assert "3 frames have no features" in found.remarks[0].text
    assert "frame 60" in found.remarks[0].text


UNEVEN = "The tracks have columns of different lengths."
CAMERA = true_path(50, walking=False)[0]
TIMES = np.arange(50.0)
SOME = FeatureTracks(np.full(5, REFERENCE), np.arange(5), np.random.default_rng(1).uniform(0, 1000, (5, 2)))


@pytest.mark.parametrize(
    ("tracks", "times", "reference", "keys", "message"),
    [
        (
            SOME,
            TIMES,
            3,
            {},
            "The solved frame 3 has 0 features, too few to lead to other frames. Track more features, or solve another "
            "frame.",
        ),
        (replace(SOME, feature=np.zeros(5, dtype=int)), TIMES, REFERENCE, {}, "A feature is seen twice in one frame."),
        (
            replace(SOME, frame=np.array([3, 3, 3, 12, 3])),
            TIMES[:10],
            3,
            {},
            "A feature is in frame 12, but the video has the frames 0 to 9.",
        ),
        (SOME, TIMES[::-1], REFERENCE, {}, "The times of the frames do not ascend, or there are none."),
        (SOME, TIMES[:0], REFERENCE, {}, "The times of the frames do not ascend, or there are none."),
        (SOME, TIMES, 50, {}, "Frame 50 was solved, but the video has the frames 0 to 49."),
        (SOME, TIMES, REFERENCE, {-1: CAMERA}, "Frame -1 was solved, but the video has the frames 0 to 49."),
        (
            SOME,
            TIMES,
            REFERENCE,
            {4: replace(CAMERA, width=100)},
            "The camera of frame 4 has another shift or image size than the reference frame's.",
        ),
        (
            SOME,
            TIMES,
            REFERENCE,
            {4: replace(CAMERA, shift=GlobalShift(1.0, 0.0, 0.0))},
            "The camera of frame 4 has another shift or image size than the reference frame's.",
        ),
        (replace(SOME, frame=SOME.frame[1:]), TIMES, REFERENCE, {}, UNEVEN),
        (
            replace(SOME, feature=SOME.feature[1:]),
            TIMES,
            REFERENCE,
            {},
            UNEVEN,
        ),
    ],
)
def test_bad_tracks_are_refused(
    tracks: FeatureTracks, times: Array, reference: int, keys: dict[int, Camera], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        solve_motion(CAMERA, tracks, times, reference, key_frames=keys)
    assert str(caught.value) == message


def test_between_solved_frames_the_deviation_is_that_of_a_bridge() -> None:
    """A random walk tied at both ends has the variance s·a·b/(a + b), with what every frame scatters; none at its ends.

    Outside it grows from the nearer end; a frame of which nothing is known stays so.
    """
    step = 0.09
    variance = step * np.abs(np.arange(12) - 3.0)
    spread = np.sqrt(np.stack([variance, 4 * variance], axis=1))
    spread[[5, 10]] = np.inf
    found = _bridged(spread, [3, 8]) ** 2
    own = step
    for frame in range(12):
        before, after = frame - 3, 8 - frame
        expected = before * after / 5 * step if 3 <= frame <= 8 else step * -min(before, after)
        expected = 0.0 if frame in (3, 8) else np.inf if frame in (5, 10) else expected + own
        np.testing.assert_allclose(found[frame], [expected, 4 * expected], err_msg=str(frame))


def test_poses_between_frames() -> None:
    camera = look_at(1920, 1080, (0, 0, 0), (0, 10, 0), fov_deg=60)
    turn = rotation_from_vector([[0, 0, 0], [0, 0.4, 0], [0.3, 0.4, 0]])
    path = CameraPath(
        camera,
        np.array([1.0, 2.0, 4.0]),
        np.array([[0, 0, 0], [1.0, 2, 0], [1, 2, 8]]),
        turn @ camera.rotation,
        np.zeros(3),
        np.zeros(3),
    )
    position, rotation = path.poses_at([0.0, 1.25, 2.0, 3.0, 9.0])
    np.testing.assert_allclose(position, [[0, 0, 0], [0.25, 0.5, 0], [1, 2, 0], [1, 2, 4], [1, 2, 8]])
    np.testing.assert_allclose(rotation[1], rotation_from_vector([0, 0.1, 0]) @ camera.rotation, atol=1e-14)
    np.testing.assert_allclose(rotation[[0, 2, 4]], path.rotation, atol=1e-14)
    half = angles_deg(rotation[3:4], path.rotation[1:2]), angles_deg(rotation[3:4], path.rotation[2:])
    np.testing.assert_allclose(*half)


def test_a_fixed_camera_stays() -> None:
    camera = look_at(1920, 1080, (1, 2, 3), (0, 10, 0), fov_deg=60)
    path = fixed(camera)
    assert path.is_fixed
    position, rotation = path.poses_at([-5.0, 0, 100])
    np.testing.assert_array_equal(position, [[1, 2, 3]] * 3)
    np.testing.assert_array_equal(rotation[2], camera.rotation)


def test_a_path_that_cannot_be_is_refused() -> None:
    turn = np.repeat(CAMERA.rotation[None], 2, axis=0)
    with pytest.raises(InputError) as caught:
        CameraPath(CAMERA, np.zeros(2), np.zeros((2, 3)), turn, np.zeros(2), np.zeros(2))
    assert str(caught.value) == "The times of a camera's path do not ascend."
    columns = {
        1: (np.zeros((3, 3)), turn, np.zeros(2), np.zeros(2)),
        2: (np.zeros((2, 3)), turn[0], np.zeros(2), np.zeros(2)),
        3: (np.zeros((2, 3)), turn, np.zeros(1), np.zeros(2)),
        4: (np.zeros((2, 3)), turn, np.zeros(2), np.zeros(3)),
    }
    for wrong in columns.values():
        with pytest.raises(InputError) as caught:
            CameraPath(CAMERA, np.arange(2.0), *wrong)
        shapes = tuple(column.shape for column in wrong)
        assert str(caught.value) == f"The path of a camera has 2 times, but its other columns have the shapes {shapes}."
    with pytest.raises(InputError) as caught:
        CameraPath(CAMERA, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0), np.zeros(0))
    assert str(caught.value).startswith("The path of a camera has 0 times")
