# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture without what moves: medians, spreads and places of made frames, computed independently."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.footage.background import BackgroundMotion, no_motion
from rockfall.core.footage.plates import NOISE_FLOOR, Plates, _sorted
from rockfall.core.footage.sources import Pictures

WIDTH, HEIGHT = 120, 80


def grey(values: list[int]) -> Pictures:
    """Frames of one grey level each."""
    return Pictures([np.full((HEIGHT, WIDTH), value, np.uint8) for value in values], np.arange(len(values)) / 30.0)


def spot(values: list[int]) -> Pictures:
    """Frames of one grey level, the same in all, but for 40 × 35 pixels from (5, 15)."""
    images = [np.full((HEIGHT, WIDTH), 90, np.uint8) for _ in values]
    for image, value in zip(images, values, strict=True):
        image[15:50, 5:45] = value
    return Pictures(images, np.arange(len(values)) / 30.0)


def panning(count: int, step: int, first: int = 0) -> BackgroundMotion:
    """A camera that pans to the right by some pixels a frame."""
    homography = np.tile(np.eye(3), (count, 1, 1))
    homography[:, 0, 2] = step * np.arange(count)
    return BackgroundMotion(np.arange(first, first + count), homography, np.full(count, 50), np.zeros(count), False)


@pytest.mark.parametrize("count", [*range(1, 9), 15])
def test_samples_in_any_order_are_sorted(count: int) -> None:
    """What sorts all rows of zeros and ones sorts everything (Knuth 5.3.4 Z)."""
    layers = [np.arange(2**count, dtype=np.uint32)[None] >> i & 1 for i in range(count)]
    ordered = _sorted([layer.astype(np.uint8) for layer in layers])
    np.testing.assert_array_equal(ordered, np.sort(layers, axis=0))


@pytest.mark.parametrize("count", [1, 4, 15])
def test_a_still_camera_gives_the_median_and_the_quartiles(count: int) -> None:
    values = np.random.default_rng(count).permutation(np.arange(count) * 7 + 20)
    picture, sigma, seen = Plates(spot(values.tolist()), no_motion(0, count - 1)).window(0, 10, 20, 30, 25)
    assert picture.shape == (25, 30, 3)
    ordered = np.sort(values)
    assert (picture == ordered[(count - 1) // 2]).all()
    spread = (ordered[int(0.75 * (count - 1))] - ordered[int(0.25 * (count - 1))]) / 1.349
    np.testing.assert_allclose(sigma, np.hypot(spread, NOISE_FLOOR), rtol=1e-6)
    assert (seen == 1).all()


def test_fifteen_frames_from_all_of_a_long_clip_make_a_plate() -> None:
    values = np.arange(200).tolist()
    picture, _, _ = Plates(spot(values), no_motion(0, 199)).window(0, 20, 30, 5, 5)
    assert (picture == np.sort(np.linspace(0, 199, 15).round())[7]).all()


@pytest.mark.parametrize("looked", [True, False])
def test_an_exposure_that_changes_leaves_the_picture_as_the_plate(looked: bool) -> None:
    """Frames of one texture in other exposures, of a camera whose brightness is known or that is said to be still."""
    exposure = np.linspace(0.7, 1.3, 9)
    texture = np.random.default_rng(5).integers(60, 180, (HEIGHT, WIDTH, 3)).astype(np.float64)
    pictures = [np.round(texture * factor).astype(np.uint8) for factor in exposure]
    pictures[6][40:50, 60:70] = 200  # what moves
    motion = no_motion(0, 8)
    motion = replace(motion, brightness=2 * exposure) if looked else motion
    part, (behind, sigma, _) = Plates(Pictures(pictures, np.arange(9) / 30), motion).beside(
        pictures[6], 6, (30, 20, 90, 60)
    )
    apart = np.abs(part - behind)
    moving = np.zeros(apart.shape[:2], bool)
    moving[20:30, 30:40] = True
    assert apart[~moving].max() <= 3  # roundings
    assert apart[moving].mean() > 20
    assert np.median(sigma) < 1.5 * NOISE_FLOOR


def test_an_exposure_that_stays_changes_nothing() -> None:
    motion = replace(no_motion(0, 8), brightness=1 + 0.004 * np.sin(np.arange(9.0)))
    assert motion.exposure is None
    texture = np.random.default_rng(5).integers(60, 180, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    part, _ = Plates(Pictures([texture] * 9, np.arange(9) / 30), motion).beside(texture, 4, (30, 20, 90, 60))
    assert (part == texture[20:60, 30:90]).all()


def test_the_plate_of_a_panning_camera_lies_where_the_picture_does() -> None:
    texture = np.random.default_rng(3).integers(0, 255, (HEIGHT, WIDTH + 20, 3), dtype=np.uint8)
    pictures = [texture[:, frame : frame + WIDTH] for frame in range(12)]
    pictures[:3] = [255 - pictures[0]] * 3  # before the motion is known
    plates = Plates(Pictures(pictures, np.arange(12) / 30), panning(9, 1, first=3))
    for frame in (7, 3, 11, 8):
        left, top, width, height = 30, 15, 50, 40
        picture, _, seen = plates.window(frame, left, top, width, height)
        assert (seen == 1).all()
        apart = np.abs(picture - pictures[frame][top : top + height, left : left + width])
        assert apart.max() <= 1


def test_at_its_edges_a_plate_holds_the_frames_that_saw_them() -> None:
    """Of the frames with their grey levels, each column of the plate takes the median of those that reach it."""
    count, step = 9, 14
    picture, _, seen = Plates(grey([20 * frame for frame in range(count)]), panning(count, step)).window(
        0, 0, 30, WIDTH, 1
    )
    near = [frame for frame in range(count) if step * frame < 0.5 * WIDTH]
    for column in range(WIDTH):
        reach = [20 * frame for frame in near if 0 <= column - step * frame < WIDTH]
        assert bool(seen[0, column]) == (len(reach) >= 3), column
        if seen[0, column]:
            assert picture[0, column, 0] == sorted(reach)[(len(reach) - 1) // 2], column


def test_the_plate_of_a_zooming_camera_lies_where_the_picture_does() -> None:
    """Brightness grows along the picture, so that its mean tells a shift of a hundredth of a pixel."""
    zoom = np.array([1.0, 1.1, 1.2, 1.3, 1.4])
    homography = np.array([np.diag([z, z, 1.0]) for z in zoom])
    column = np.arange(WIDTH) + 0.5
    pictures = [np.tile(np.clip(np.round(3 * column * z), 0, 255).astype(np.uint8), (HEIGHT, 1)) for z in zoom]
    motion = BackgroundMotion(np.arange(5), homography, np.full(5, 50), np.zeros(5), False)
    plates = Plates(Pictures(pictures, np.arange(5) / 30), motion)
    for frame in range(5):
        picture, _, seen = plates.window(frame, 5, 5, 50, 40)
        assert (seen == 1).all()
        assert (picture - pictures[frame][5:45, 5:55, None]).mean() == pytest.approx(0, abs=0.1)


def test_a_plate_serves_until_the_camera_has_wandered_off() -> None:
    made = []
    plates = Plates(grey([9] * 20), panning(20, 5), lambda text, *_: made.append(text))
    for frame in (0, 2, 3, 5, 6, 8):
        plates.window(frame, 0, 0, 2, 2)
    assert made == [f"Making the background around frame {anchor}" for anchor in (0, 3, 6)]


def test_the_two_latest_plates_are_kept() -> None:
    made = []
    source = Pictures([np.full((8, 10), 9, np.uint8)] * 2101, np.arange(2101) / 30.0)
    plates = Plates(source, no_motion(0, 2100), lambda text, *_: made.append(text))
    for frame in (0, 300, 301, 0, 1, 700, 400, 2100, 700, 0):
        plates.window(frame, 0, 0, 2, 2)
    assert made == [f"Making the background around frame {anchor}" for anchor in (0, 301, 700, 2100, 0)]


def test_a_part_of_a_plate_is_what_the_whole_plate_shows_there() -> None:
    texture = np.random.default_rng(5).integers(0, 255, (240, 420, 3), dtype=np.uint8)
    noise = np.random.default_rng(6).normal(scale=6, size=(12, 240, 400, 3))
    pictures = [np.clip(texture[:, frame : frame + 400] + noise[frame], 0, 255).astype(np.uint8) for frame in range(12)]
    source, motion = Pictures(pictures, np.arange(12) / 30), panning(12, 1)
    whole = Plates(source, motion).window(4, 0, 0, 400, 240)
    parts = Plates(source, motion)
    for left, top in ((150, 100), (160, 110), (20, 5), (378, 216)):
        for part, full in zip(parts.window(4, left, top, 22, 24), whole, strict=True):
            np.testing.assert_allclose(part, full[top : top + 24, left : left + 22], atol=1e-4)
