# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning once, for the command line and Blender: which pairs count, which frames are solved, where the path goes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.camera.model import Camera, look_at, project, rotation_from_vector
from rockfall.core.camera.pairs import Pairs, pair_residuals
from rockfall.core.camera.path import CameraPath, bent_through, camera_at, fixed, project_at, rays_at
from rockfall.core.camera.resection.problem import needed_pairs
from rockfall.core.camera.resection.resect import resect
from rockfall.core.errors import InputError
from rockfall.core.exchange.cameras import read_pairs
from rockfall.core.georeference import GlobalShift
from rockfall.core.vectors import norm
from rockfall.core.workflow.alignment import AlignmentOptions, align, counting_pairs, reference_frame, with_aspect

SIZE = (1920, 1080)
START = look_at(*SIZE, (-40.0, -55.0, 12.0), (0.0, 0.0, 20.0), focal_px=1500)


def turned(camera: Camera, angle: float) -> Camera:
    return replace(camera, rotation=rotation_from_vector([0.0, angle, 0.02]) @ camera.rotation)


def marked(cameras: dict[int, tuple[Camera, int]], seed: int = 4, sigma_px: float = 0.3) -> Pairs:
    """Pairs in the frames of cameras, as many as is said."""
    rng = np.random.default_rng(seed)
    pixel, point, frame = [], [], []
    for number, (camera, count) in cameras.items():
        truth = rng.uniform((100, 100), (1800, 980), (count, 2))
        origin, direction = rays_at(fixed(camera), truth, np.zeros(count))
        point.append(origin + direction * rng.uniform(40, 110, (count, 1)))
        pixel.append(project(camera, point[-1]) + sigma_px * rng.normal(size=(count, 2)))
        frame.append(np.full(count, number))
    n = sum(map(len, frame))
    return Pairs(
        pixel=np.concatenate(pixel),
        point=np.concatenate(point),
        name=np.array([f"P{i}" for i in range(n)]),
        frame=np.concatenate(frame),
        sigma_px=np.full(n, np.nan),
        sigma_m=np.full(n, np.nan),
        used=np.ones(n, dtype=bool),
        shift=GlobalShift(),
    )


def test_the_reference_frame_has_most_pairs_that_are_used() -> None:
    pairs = marked({30: (START, 5), 10: (START, 5), 20: (START, 6)})
    assert reference_frame(pairs) == 20
    assert reference_frame(replace(pairs, used=pairs.frame != 20)) == 10, "the first of equals"
    assert reference_frame(replace(pairs, used=np.zeros(16, dtype=bool))) == 20
    assert reference_frame(replace(pairs, frame=np.full(16, -1))) == 0


def test_which_pairs_count() -> None:
    pairs = marked({3: (START, 4), 7: (START, 2)})
    pairs = replace(pairs, frame=np.array([3, 3, 3, -1, 7, 7]), used=np.array([1, 0, 1, 1, 1, 1], dtype=bool))
    assert counting_pairs(pairs, 3, moves=False).tolist() == [True, False, True, True, True, True]
    assert counting_pairs(pairs, 3, moves=True).tolist() == [True, False, True, True, False, False]


def test_frames_with_four_pairs_are_solved_with_the_lens_of_the_reference_frame() -> None:
    pairs = marked({0: (START, 12), 40: (turned(START, 0.05), 4), 60: (turned(START, 0.08), 3)})
    wild = pairs.pixel.copy()
    wild[5] += [60, -30]
    pairs = replace(pairs, pixel=wild)
    found = align(pairs, AlignmentOptions(SIZE, moves=True))
    assert (found.frame, list(found.keys)) == (0, [40])
    assert found.keys[40].parameters == ("rx", "ry", "rz", "x", "y", "z")
    assert found.keys[40].camera.fx == found.found.camera.fx
    assert np.flatnonzero(found.wrong).tolist() == [5]
    assert found.used.tolist() == [i != 5 for i in range(16)] + [False] * 3
    assert {remark.about for remark in found.remarks} == {"frame 40", "frame 60"}
    assert "3 pairs, too few" in str(found.remarks[1])
    alone = resect(pairs.pixel[:12], pairs.point[:12], *SIZE)
    np.testing.assert_array_equal(found.pose_covariance, alone.pose_covariance_given_lens)
    still = align(pairs, AlignmentOptions(SIZE, moves=False))
    assert still.keys == {}
    assert still.found.used.size == 19


def test_nothing_to_solve_from() -> None:
    pairs = marked({0: (START, 12)})
    with pytest.raises(InputError, match="No pair is to be used in frame 3"):
        align(pairs, AlignmentOptions(SIZE, moves=True, frame=3))
    with pytest.raises(InputError, match="too few"):
        align(replace(pairs, used=np.arange(12) < 3), AlignmentOptions(SIZE))


@pytest.mark.parametrize("free", [(), ("f",), ("f", "c"), ("f", "c", "k1"), ("fx", "fy", "cx", "cy", "k1", "k2", "k3")])
def test_as_many_pairs_as_needed_are_accepted(free: tuple[str, ...]) -> None:
    n = needed_pairs(free)
    pairs = marked({0: (START, n)})
    options = AlignmentOptions(SIZE, free=free, start=START)
    assert align(pairs, options).found.used.size == n
    with pytest.raises(InputError, match=f"needs {n}"):
        align(replace(pairs, used=np.arange(n) > 0), options)


def test_residuals_are_those_of_each_pairs_own_time() -> None:
    path = CameraPath(
        START, np.array([0.0, 1.0]), np.array([[-40.0, -55, 12], [-39, -55, 12]]), np.array([START.rotation] * 2),
        np.zeros(2), np.zeros(2),
    )  # fmt: skip
    pairs = marked({0: (START, 6)}, sigma_px=0.0)
    time_s = np.array([0, 0, 0, 0.5, 0.5, 1.0])
    left, away = pair_residuals(path, pairs, time_s)
    np.testing.assert_allclose(left[:3], 0, atol=1e-9)
    np.testing.assert_allclose(left, pairs.pixel - project_at(path, pairs.point, time_s))
    # A sideways step of a camera moves the ray at the point by what of the step is across the ray.
    direction = (pairs.point[5] - START.position) / norm(pairs.point[5] - START.position)
    step = np.array([1.0, 0, 0])
    assert away[5] == pytest.approx(norm(step - (step @ direction) * direction), rel=1e-9)
    assert camera_at(path, 0.5).position.tolist() == [-39.5, -55, 12]


def test_a_bent_path_goes_through_the_solved_frames() -> None:
    """Halfway between two of them, half of both bends; beyond the last one, its bend."""
    times = np.linspace(0, 4, 9)
    rotation = np.array([turned(START, 0.01 * t).rotation for t in times])
    path = CameraPath(START, times, np.zeros((9, 3)), rotation, np.ones(9), np.ones(9))
    there = {t: camera_at(path, t) for t in (1.0, 3.0)}
    there[3.0] = replace(there[3.0], position=np.array([2.0, 0, 0]), rotation=turned(there[3.0], 0.2).rotation)
    bent = bent_through(path, there)
    for t, camera in there.items():
        np.testing.assert_allclose(camera_at(bent, t).rotation, camera.rotation, atol=1e-12)
    np.testing.assert_allclose(bent.position[:, 0], [0, 0, 0, 0.5, 1, 1.5, 2, 2, 2], atol=1e-12)
    assert bent.reference is START
    turn = bent.rotation[4] @ path.rotation[4].T
    assert np.arccos((np.trace(turn) - 1) / 2) == pytest.approx(norm(np.array([0.0, 0.2, 0.02])) / 2, rel=1e-6)


FIELD = Path(__file__).parent.parent / "data" / "field_cases" / "10-nonsquare-camera"


def lens_remarks(name: str, options: AlignmentOptions) -> list[str]:
    found = align(read_pairs(FIELD / f"{name}.csv"), options)
    return [remark.text for remark in found.remarks if remark.about in ("lens", "focal")]


def test_pixels_that_are_not_square_are_found_and_the_lens_to_free_is_named() -> None:
    """The pairs were made with pixels 10 / 11 as wide as high, fx 1980 px, and 0.4 px of noise."""
    (said,) = lens_remarks("nonsq", AlignmentOptions(SIZE))
    assert said.startswith("With fx and fy apart they fit to 0.36 px: pixels are 0.911 times as wide as high")
    assert said.endswith("Free fx,fy.")
    assert lens_remarks("nonsq", AlignmentOptions(SIZE, free=("fx", "fy"), pixel_aspect=0.911)) == []


def test_the_pixels_that_the_video_names_are_held() -> None:
    pairs = read_pairs(FIELD / "nonsq.csv")
    start = with_aspect(SIZE, None, 10 / 11, pairs.shift)
    found = align(pairs, AlignmentOptions(SIZE, start=start, pixel_aspect=10 / 11))
    camera = found.found.camera
    assert camera.fy / camera.fx == pytest.approx(10 / 11)
    assert camera.fx == pytest.approx(1980, rel=0.01)
    assert found.found.rmse_px < 0.5
    assert [remark.text for remark in found.remarks] == [
        "The video says that pixels are 0.909 times as wide as high: fy is 0.909 times fx."
    ]
    square = AlignmentOptions(SIZE, start=with_aspect(SIZE, None, 1.0, pairs.shift), pixel_aspect=10 / 11)
    assert "the video 0.909 times: free fx,fy" in align(pairs, square).remarks[0].text
    free = AlignmentOptions(SIZE, free=("fx", "fy"), pixel_aspect=1.2)
    assert (
        "0.911 times as wide as high by the pairs, and 1.200 times by the video" in align(pairs, free).remarks[0].text
    )


def test_a_centre_of_the_lens_off_the_middle_is_found() -> None:
    """The pairs were made with the principal point at (1100, 473) of 1920 × 1080 px."""
    (said,) = lens_remarks("pp", AlignmentOptions(SIZE))
    assert "it lies 140 px to the right of the image's middle and 67 px above it" in said
    assert said.endswith("cropped or stabilised. Free c.")
    pairs = read_pairs(FIELD / "pp.csv")
    both = AlignmentOptions(SIZE, start=with_aspect(SIZE, None, 10 / 11, pairs.shift), pixel_aspect=10 / 11)
    assert any(remark.text.endswith("Free fx,fy,c.") for remark in align(pairs, both).remarks)


def test_pairs_that_fit_are_given_no_other_lens() -> None:
    pairs = marked({0: (START, 20)})
    assert align(pairs, AlignmentOptions(SIZE)).remarks == ()


def test_distortion_is_named_where_it_explains_the_pairs() -> None:
    bent = replace(START, k1=-0.2)
    (remark,) = align(marked({0: (bent, 30)}), AlignmentOptions(SIZE)).remarks
    assert remark.text.startswith("With the distortion k1 free they fit to")
    assert remark.text.endswith("Free k1.")
