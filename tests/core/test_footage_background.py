# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion of the background: made clips whose homographies are known, a tripod, and what cannot be followed."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import rockfall
from rockfall.core.errors import InputError
from rockfall.core.footage.advice import layered_background
from rockfall.core.footage.background import (
    BackgroundMotion,
    _fit,
    _Follower,
    background_motion,
    destabilise,
    glance,
    layers_px,
    no_motion,
    stabilise,
)
from rockfall.core.footage.sources import Pictures
from rockfall.core.footage.video import open_video
from scipy.optimize import least_squares

DEMO = Path(rockfall.__file__).parent / "assets" / "demo" / "footage" / "footage.mp4"
SIZE = (400, 300)
CORNER = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])


def ground(seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    total = np.zeros((700, 1100))
    for scale in (1.5, 4, 12):
        layer = cv2.GaussianBlur(rng.normal(size=total.shape), (0, 0), scale)
        total += layer / layer.std()
    return 120 + 22 * total


def hand(frame: int) -> np.ndarray:
    """(3, 3) frame → ground, with shaking, panning, turning, zooming and a little perspective."""
    angle, zoom = 0.01 * np.sin(frame / 9), 1 + 0.03 * np.sin(frame / 20)
    u, v = 8 * np.sin(frame / 3) + 4.5 * frame, 6 * np.cos(frame / 4)
    c, s = zoom * np.cos(angle), zoom * np.sin(angle)
    return np.array([[c, -s, 150 + u], [s, c, 150 + v], [2e-5 * np.sin(frame / 15), 0, 1]])


def film(count: int, *, still: bool = False, noise: float = 3.0) -> list[np.ndarray]:
    rng, texture = np.random.default_rng(1), ground()
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    pictures = []
    for frame in range(count):
        picture = cv2.warpPerspective(texture, hand(0 if still else frame), SIZE, flags=flags)
        cv2.circle(picture, (40 + 7 * frame, 60 + 3 * frame), 14, 230.0, -1)  # a block
        pictures.append(np.clip(picture + rng.normal(scale=noise, size=picture.shape), 0, 255).astype(np.uint8))
    return pictures


def clip(pictures: list[np.ndarray]) -> Pictures:
    return Pictures(pictures, np.arange(len(pictures)) / 30)


def true_places(frame: int, pixel: np.ndarray) -> np.ndarray:
    across = CORNER @ np.linalg.inv(hand(0)) @ hand(frame) @ np.linalg.inv(CORNER)
    moved = np.column_stack([pixel, np.ones(len(pixel))]) @ across.T
    return moved[:, :2] / moved[:, 2:]


def test_hand_held_panning_is_followed_without_drift() -> None:
    """Half of the picture is new at the end, and corners and centre are still in their places."""
    count = 45
    motion, features = background_motion(clip(film(count)))
    assert not motion.still
    points = np.array([[0.0, 0.0], [400, 0], [0, 300], [400, 300], [200, 150]])
    worst = 0.0
    for frame in range(count):
        found = stabilise(motion, np.full(5, frame), points)
        worst = max(worst, float(np.hypot(*(found - true_places(frame, points)).T).max()))
        assert destabilise(motion, np.full(5, frame), found) == pytest.approx(points, abs=1e-9)
    assert worst < 0.35
    assert motion.rms_px.max() < 0.3

    apart = []
    for feature in np.unique(features.feature):
        seen = features.feature == feature
        if seen.sum() > 10:
            places = [
                true_places(f, p[None])[0] for f, p in zip(features.frame[seen], features.pixel[seen], strict=True)
            ]
            apart.append(np.std(places, axis=0).max())
    assert len(apart) > 50  # corners that last
    assert np.median(apart) < 0.1
    assert motion.inliers.min() > 100


@pytest.mark.parametrize("sign", [-1, 1])
def test_an_exposure_that_changes_does_not_bend_the_path(sign: int) -> None:
    """The camera looks into the sun, or away from it, and the pictures change their brightness by a third."""
    count = 40
    pictures = film(count, noise=1.0)
    exposed = [
        np.clip(picture * (1 + sign * 0.33 * frame / count), 0, 255).astype(np.uint8)
        for frame, picture in enumerate(pictures)
    ]
    points = np.array([[0.0, 0.0], [400, 0], [0, 300], [400, 300], [200, 150]])
    motion, _ = background_motion(clip(exposed))
    assert motion.brightness == pytest.approx(1 + sign * 0.33 * np.arange(count) / count, abs=0.03)
    worst = max(
        float(np.hypot(*(stabilise(motion, np.full(5, frame), points) - true_places(frame, points)).T).max())
        for frame in range(count)
    )
    assert worst < 0.35


def test_a_homography_is_the_least_squares_fit_to_the_corners_that_agree() -> None:
    rng = np.random.default_rng(2)
    reference = rng.uniform(0, 400, (120, 2))
    true = np.array([[1.02, -0.01, 8.0], [0.015, 0.99, -5.0], [2e-5, 1e-5, 1.0]])
    moved = np.column_stack([reference, np.ones(120)]) @ np.linalg.inv(true).T
    pixel = moved[:, :2] / moved[:, 2:] + rng.normal(0, 0.2, (120, 2))
    pixel[::6] += rng.uniform(8, 40, (20, 2))
    homography, agrees = _fit(pixel, reference)
    assert not agrees[::6].any()
    assert agrees.sum() > 90

    def residual(values: np.ndarray) -> np.ndarray:
        found = np.column_stack([pixel[agrees], np.ones(agrees.sum())]) @ np.append(values, 1.0).reshape(3, 3).T
        return (found[:, :2] / found[:, 2:] - reference[agrees]).ravel()

    best = least_squares(residual, (true / true[2, 2]).ravel()[:8], x_scale="jac", xtol=1e-15, ftol=1e-15)
    found = residual((homography / homography[2, 2]).ravel()[:8])
    assert found @ found == pytest.approx(2 * best.cost, rel=1e-4)


def test_where_corners_are_looked_for_follows_a_turn() -> None:
    """A jerk of 8° moves the edges of the picture by 28 px about its middle, where no one shift is right."""
    angle = np.radians(8)
    c, s = np.cos(angle), np.sin(angle)
    middle = np.array([SIZE[0] / 2, SIZE[1] / 2])
    first = np.array([[1, 0, 300.0], [0, 1, 200.0], [0, 0, 1]])
    turned = first @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned[:2, 2] += first[:2, :2] @ (middle - np.array([[c, -s], [s, c]]) @ middle)
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    grey = [np.clip(cv2.warpPerspective(ground(), way, SIZE, flags=flags), 0, 255).astype(np.uint8)
            for way in (first, turned)]  # fmt: skip
    follower = _Follower(grey[0], 0)
    guess, _ = follower._guess(cv2.pyrDown(cv2.pyrDown(grey[1])))
    away = follower.pixel - middle
    true = middle + away @ np.array([[c, -s], [s, c]])  # the picture turns the other way
    assert np.median(np.hypot(*(guess - true).T)) < 2.0
    assert np.median(np.hypot(*(follower.pixel - true).T)) > 10.0


def test_a_tripod_is_the_identity() -> None:
    motion, _ = background_motion(clip(film(20, still=True)))
    assert motion.still
    assert (motion.homography == np.eye(3)).all()


def test_a_camera_that_settles_slowly_is_no_tripod() -> None:
    texture = ground()
    pictures = []
    for frame in range(25):
        shift = np.array([[1, 0, 200 + 0.04 * frame], [0, 1, 200.0], [0, 0, 1]])
        picture = cv2.warpPerspective(texture, shift, SIZE, flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)
        pictures.append(np.clip(picture, 0, 255).astype(np.uint8))
    motion, _ = background_motion(clip(pictures))
    assert not motion.still
    assert stabilise(motion, np.array([24]), np.array([[200.0, 150.0]]))[0] == pytest.approx([200.96, 150.0], abs=0.05)


@pytest.mark.parametrize("what", ["blackout", "cut", "sky"])
def test_what_cannot_be_followed_is_told_with_its_frame(what: str) -> None:
    pictures = film(12)
    if what == "blackout":
        pictures[7][:] = 4
    elif what == "cut":
        other = np.clip(ground(9)[:300, :400], 0, 255).astype(np.uint8)
        pictures[7:] = [other] * 5
    else:
        pictures = [np.full((300, 400), 180, np.uint8)] * 12
    with pytest.raises(InputError, match="frame 0" if what == "sky" else "frame 7"):
        background_motion(clip(pictures))


def test_frames_beyond_what_is_known() -> None:
    with pytest.raises(InputError, match="frame 12"):
        stabilise(no_motion(3, 9), np.array([12]), np.zeros((1, 2)))


def test_a_first_look_tells_a_hand_from_a_tripod() -> None:
    """Four pictures: those of the pan lie apart by what it was made with; a block alone moves nothing."""
    count = 31
    moved = glance(clip(film(count)))
    middle = np.array([[200.0, 150.0]])
    true = max(np.hypot(*(true_places(frame, middle) - middle).T)[0] for frame in (10, 20, 30))
    assert moved == pytest.approx(true, rel=0.25)
    assert glance(clip(film(count, still=True))) < 0.5


def test_a_first_look_at_different_scenes_says_nothing() -> None:
    other = [np.clip(ground(seed)[:300, :400], 0, 255).astype(np.uint8) for seed in (3, 4, 5, 6)]
    assert np.isnan(glance(clip(other)))


def swayed(frame: int, moved_px: float) -> np.ndarray:
    """(3, 3) frame → ground of one layer, which a camera that is moved from side to side shifts by so much at most."""
    across = hand(frame)
    across[:2, 2] += moved_px * np.sin(frame / 12), 0.6 * moved_px * (1 - np.cos(frame / 15))
    return across


def layered(count: int, share: float, far_px: float, near_px: float) -> list[np.ndarray]:
    """Far ground, before it the near ground in the lower `share` of the first picture, each shifted in its own way."""
    rng, far, near = np.random.default_rng(1), ground(), ground(7)
    edge = 150 + SIZE[1] * (1 - share) + 15 * np.sin(np.arange(near.shape[1]) / 40)
    inside, flags = (
        (np.arange(near.shape[0])[:, None] > edge).astype(np.float64),
        cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
    )
    pictures = []
    for frame in range(count):
        behind = cv2.warpPerspective(far, swayed(frame, far_px), SIZE, flags=flags)
        before, there = (cv2.warpPerspective(a, swayed(frame, near_px), SIZE, flags=flags) for a in (near, inside))
        picture = behind * (1 - there) + before * there + rng.normal(scale=3.0, size=behind.shape)
        pictures.append(np.clip(picture, 0, 255).astype(np.uint8))
    return pictures


def error_px(motion: BackgroundMotion, moved_px: float, row: float) -> float:
    """How far the middle of a row is off at worst, as it lies on a layer that is shifted by so much."""
    place, worst = np.array([[200.0, row]]), 0.0
    for frame in motion.frames.tolist():
        across = CORNER @ np.linalg.inv(swayed(0, moved_px)) @ swayed(frame, moved_px) @ np.linalg.inv(CORNER)
        true = across @ (*place[0], 1.0)
        worst = max(worst, float(np.hypot(*(stabilise(motion, np.array([frame]), place)[0] - true[:2] / true[2]))))
    return worst


@pytest.mark.parametrize("share", [0.25, 0.4, 0.6, 0.75])
def test_near_and_far_ground_that_move_differently_are_noticed(share: float) -> None:
    """One motion of all cannot be right for both: it is off by half a pixel or several, and this is said."""
    motion, _ = background_motion(clip(layered(60, share, 2.0, 8.0)))
    assert max(error_px(motion, 2.0, 40.0), error_px(motion, 8.0, 270.0)) > 0.5
    found = layers_px(motion, SIZE[0])
    assert found is not None
    assert 0.4 < found[0] < 3
    said = layered_background(motion, SIZE[0])
    assert f"{found[0]:.1f} px about frame {found[1]}" in said


@pytest.mark.parametrize(("share", "far_px", "near_px"), [(0.0, 2, 8), (1.0, 2, 8), (0.4, 5, 5), (0.4, 0, 0.5)])
def test_of_one_ground_nothing_is_said(share: float, far_px: float, near_px: float) -> None:
    """Nor of two that move alike, or nearly, so that the motion is right for both."""
    motion, _ = background_motion(clip(layered(60, share, far_px, near_px)))
    assert layers_px(motion, SIZE[0]) is None
    assert layered_background(motion, SIZE[0]) == ""
    if share == 0.4:
        assert max(error_px(motion, far_px, 40.0), error_px(motion, near_px, 270.0)) < 0.3


def test_of_the_demo_and_of_what_passes_through_the_picture_nothing_is_said() -> None:
    passing = film(30)
    for frame, picture in enumerate(passing):
        cv2.rectangle(picture, (10 * frame - 60, 200), (10 * frame + 60, 260), 90.0, -1)
        cv2.putText(picture, "ROCK", (10 * frame - 55, 245), cv2.FONT_HERSHEY_SIMPLEX, 1.3, 220.0, 3)
    assert layers_px(background_motion(clip(passing))[0], SIZE[0]) is None
    assert layers_px(no_motion(0, 9), SIZE[0]) is None
    if DEMO.exists():
        video = open_video(DEMO)
        assert layers_px(background_motion(video, last=60)[0], video.width) is None
