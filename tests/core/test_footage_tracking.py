# SPDX-License-Identifier: GPL-3.0-or-later
"""Following the block: made clips whose truth is known, and a filmed ball that was checked by hand."""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rockfall
from rockfall.core.errors import InputError
from rockfall.core.footage import sources, tracking, tracking_start, tracking_steps
from rockfall.core.footage.background import BackgroundMotion, no_motion
from rockfall.core.footage.kinks import find_kinks
from rockfall.core.footage.plates import Plates
from rockfall.core.footage.sources import Pictures
from rockfall.core.footage.templates import Appearance, Sighting, cover, fit
from rockfall.core.footage.tracking import BlockTrack, track_block
from rockfall.core.footage.tracking_start import Footage
from rockfall.core.footage.tracking_steps import SHUTTERS, State, _moves
from rockfall.core.footage.video import open_video

BALL = Path(rockfall.__file__).parent / "assets" / "examples" / "bouncing_ball"
WIDTH, HEIGHT, RATE_HZ = 480, 240, 30.0
FINE = 3
"""Samples for each pixel and direction where the block is drawn."""
IMPACTS_S = (0.4, 1.1)
CREEP = 0.03
"""Of its speed is left to a block that nearly rests."""


@dataclass(frozen=True)
class Clip:
    """What is filmed, and what is asked of it."""

    diameter: float = 12.0
    block: float = 205.0
    ground: float = 110.0
    contrast: float = 18.0
    noise: float = 3.0
    shutter: float = 0.3
    shake: float = 0.0
    shadow: bool = False
    wall: tuple[int, int] | None = None
    walker: bool = False
    dust: bool = False
    shaded: bool = False
    exposure: float = 0.0
    creeps_s: float = np.inf
    seed: int = 1
    frames: int = 48


def path(time_s: np.ndarray) -> np.ndarray:
    """(n, 2) three flights that join at `IMPACTS_S`, in the picture of a camera that stands still."""
    u = 30 + 263 * time_s
    v = np.empty_like(time_s)
    base, start = 60.0, 0.0
    for speed, begin, end in ((160.0, -np.inf, IMPACTS_S[0]), (-190.0, *IMPACTS_S), (-200.0, IMPACTS_S[1], np.inf)):
        here = (time_s >= begin) & (time_s < end)
        elapsed = time_s[here] - start
        v[here] = base + speed * elapsed + 250 * elapsed**2
        base, start = base + speed * (end - start) + 250 * (end - start) ** 2, end
    return np.column_stack([u, v])


def slowed(clip: Clip, time_s: np.ndarray) -> np.ndarray:
    """Times of a block that nearly comes to rest."""
    return np.minimum(time_s, clip.creeps_s) + CREEP * np.maximum(time_s - clip.creeps_s, 0)


def camera(clip: Clip, frame: int) -> np.ndarray:
    """(3, 3) picture → standing picture of a hand-held camera."""
    if not clip.shake:
        return np.eye(3)
    angle, s = 0.004 * np.sin(frame / 5), clip.shake
    u, v = s * np.sin(frame / 4) + 0.4 * s * np.sin(frame * 1.3), s * np.cos(frame / 6) + 0.3 * s * np.cos(frame * 1.7)
    return np.array([[np.cos(angle), -np.sin(angle), u], [np.sin(angle), np.cos(angle), v], [0, 0, 1.0]])


def texture(rng: np.random.Generator, clip: Clip, margin: int) -> np.ndarray:
    size = (HEIGHT + 2 * margin, WIDTH + 2 * margin)
    total = np.zeros(size)
    for scale in (1.2, 3, 9, 30):
        layer = cv2.GaussianBlur(rng.normal(size=size), (0, 0), scale)
        total += layer / layer.std()
    return clip.ground + clip.contrast * total / 2


def covered(centres: np.ndarray, diameter: float, squash: float = 1.0) -> np.ndarray:
    """(h, w) share of the time for which a block at these centres covers each pixel."""
    low = np.floor(centres.min(axis=0) - diameter).astype(int)
    high = np.ceil(centres.max(axis=0) + diameter).astype(int)
    u = (np.arange((high[0] - low[0]) * FINE) + 0.5) / FINE + low[0]
    v = ((np.arange((high[1] - low[1]) * FINE) + 0.5) / FINE + low[1])[:, None]
    fine = np.mean(
        [((u - a) ** 2 + ((v - b) / squash) ** 2 < (diameter / 2) ** 2).astype(float) for a, b in centres], axis=0
    )
    part = fine.reshape(high[1] - low[1], FINE, high[0] - low[0], FINE).mean(axis=(1, 3))
    whole = np.zeros((HEIGHT, WIDTH))
    a, b, c, d = max(low[0], 0), min(high[0], WIDTH), max(low[1], 0), min(high[1], HEIGHT)
    if a < b and c < d:
        whole[c:d, a:b] = part[c - low[1] : d - low[1], a - low[0] : b - low[0]]
    return whole


def lit(centre: np.ndarray, diameter: float) -> np.ndarray:
    """(h, w) light on a sphere; the sun stands at the upper left, on this side, and the shade is as the ground."""
    u, v = (np.arange(WIDTH) + 0.5 - centre[0]) / diameter, (np.arange(HEIGHT)[:, None] + 0.5 - centre[1]) / diameter
    toward = np.sqrt(np.maximum(0.25 - u**2 - v**2, 0))
    return np.clip(2.4 * (-0.7 * u - 0.5 * v + 0.5 * toward) / 0.5, 0, 1)


def film(clip: Clip) -> tuple[Pictures, np.ndarray]:
    """The pictures, and (f, 2) the true centres."""
    rng = np.random.default_rng(clip.seed)
    margin = 60
    ground = texture(rng, clip, margin)
    time_s = np.arange(clip.frames) / RATE_HZ
    truth, pictures = [], []
    for frame, time in enumerate(time_s):
        view = camera(clip, frame)
        shifted = view.copy()
        shifted[:2, 2] += margin
        picture = cv2.warpPerspective(
            ground,
            shifted,
            (WIDTH, HEIGHT),
            flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REFLECT,
        )
        open_s = slowed(clip, time + np.linspace(-0.5, 0.5, 7) * clip.shutter / RATE_HZ)

        def seen(places: np.ndarray, view: np.ndarray = view) -> np.ndarray:
            back = np.linalg.inv(view)
            return places @ back[:2, :2].T + back[:2, 2]

        centres = seen(path(open_s))
        if clip.shadow:
            share = covered(seen(np.column_stack([path(open_s)[:, 0] + 9, 170 + 0 * open_s])), clip.diameter, 0.4)
            picture *= 1 - 0.45 * share
        if clip.dust and IMPACTS_S[0] < time < IMPACTS_S[0] + 0.3:
            share = covered(seen(path(np.full(1, IMPACTS_S[0]))), clip.diameter)
            picture = (1 - share) * picture + share * (clip.block - 10)
        if clip.walker:
            share = covered(seen(np.column_stack([420 - 160 * open_s, 100 + 40 * open_s])), 1.1 * clip.diameter)
            picture = (1 - share) * picture + share * (clip.block - 15)
        share = covered(centres, clip.diameter)
        facets = 8 * np.sin(frame * 0.7 + (np.arange(WIDTH) - centres[:, 0].mean()) / clip.diameter * 4)
        block = clip.block + facets
        if clip.shaded:
            block = clip.ground + lit(centres.mean(axis=0), clip.diameter) * (clip.block - clip.ground)
        picture = (1 - share) * picture + share * block
        if clip.wall:
            picture[:, slice(*clip.wall)] = ground[margin : margin + HEIGHT, slice(*clip.wall)]
        picture = cv2.GaussianBlur(picture, (0, 0), 0.6) * (1 + clip.exposure * np.sin(frame / 6)) + rng.normal(
            scale=clip.noise, size=picture.shape
        )
        pictures.append(np.clip(np.round(picture), 0, 255).astype(np.uint8))
        truth.append(centres.mean(axis=0) + 0.0)
    return Pictures(pictures, time_s), np.array(truth)


def follow(clip: Clip, frame: int = 20, **more: object) -> tuple[BlockTrack, np.ndarray]:
    pictures, truth = film(clip)
    background = None if clip.shake else no_motion(0, clip.frames - 1)
    track = track_block(pictures, frame, truth[frame] + (1.5, -1.0), background=background, **more)  # type: ignore[arg-type]
    return track, track.pixel - truth[track.frame]


def turned(track: BlockTrack, error: np.ndarray) -> float:
    """Root mean square of the errors in their standard deviations: 1 when these are right."""
    return float(np.sqrt(np.mean((error / track.sigma_px[:, None]) ** 2)))


@pytest.mark.parametrize(
    ("clip", "rms_px", "wide_px"),
    [
        pytest.param(Clip(), 0.12, 0.3, id="light"),
        pytest.param(Clip(block=35.0, shadow=True), 0.18, 0.3, id="dark beside its shadow"),
        pytest.param(Clip(shake=4.0), 0.12, 0.3, id="hand-held"),
        pytest.param(Clip(diameter=6.0, noise=5.0), 0.15, 1.0, id="small and noisy"),
        pytest.param(Clip(diameter=40.0, frames=40), 0.2, 0.6, id="large"),
        pytest.param(Clip(diameter=8.0, shutter=0.9), 0.45, 3.5, id="blurred to a streak"),
        pytest.param(Clip(walker=True), 0.4, 0.3, id="crossed by another thing"),
        pytest.param(Clip(dust=True), 0.4, 0.3, id="leaves something like it where it hits"),
        pytest.param(Clip(block=150.0, contrast=25.0, exposure=0.3), 0.3, 0.6, id="exposure that changes"),
        pytest.param(
            Clip(block=150.0, contrast=25.0, exposure=0.3, shake=4.0), 0.3, 0.6, id="hand-held, exposure that changes"
        ),
    ],
)
def test_made_clips_are_followed_to_the_end(clip: Clip, rms_px: float, wide_px: float) -> None:
    track, error = follow(clip)
    assert track.frame.size >= clip.frames - 2
    assert np.sqrt(np.mean(error**2)) < rms_px
    assert 0.65 < turned(track, error) < 1.3
    assert track.diameter_px[0] == pytest.approx(clip.diameter, abs=wide_px)
    if clip.frames > 45:
        kinks = find_kinks(track.time_s, track.stable, track.sigma_px)
        assert kinks.time_s == pytest.approx(IMPACTS_S, abs=0.004)


@pytest.mark.parametrize("shake", [0.0, 4.0])
def test_the_centre_is_that_of_the_block_and_not_of_its_sunlit_side(shake: float) -> None:
    """The shaded side looks like the ground on average, and is told by what it hides."""
    track, error = follow(Clip(diameter=16.0, shaded=True, shake=shake))
    assert track.frame.size >= 45
    assert np.median(np.hypot(*error.T)) < 0.6
    assert np.hypot(*np.median(error, axis=0)) < 0.5
    assert np.median(track.diameter_px) == pytest.approx(16, abs=2)


def test_a_block_that_nearly_rests_is_followed_to_the_end() -> None:
    """It stands in the pictures of its own background and fades into it: neither its size nor its looks are learned."""
    off = []
    for seed, contrast in ((1, 18.0), (2, 18.0), (1, 24.0)):
        clip = Clip(diameter=16.0, shaded=True, creeps_s=1.3, frames=100, seed=seed, contrast=contrast)
        track, error = follow(clip)
        assert track.frame.size == clip.frames
        off.append(np.hypot(*error[track.frame > 50].T).mean())
    assert np.mean(off) < 0.9


def test_a_click_is_not_led_astray_by_faint_things_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their score can be twice that of the block, and they lie so that a quick motion would join them."""
    pictures, truth = film(Clip())
    motion, frame = no_motion(0, 47), 20
    beside = iter([(frame - 1, 45.0), (frame + 1, -45.0)])

    def found(*_: object) -> tuple[np.ndarray, np.ndarray]:
        other, down = next(beside)
        return np.array([truth[frame] + (0, down), truth[other]]), np.array([1.88, 0.7])

    monkeypatch.setattr(tracking_start, "search", found)
    start = tracking_start.start_at(Footage(pictures, motion, Plates(pictures, motion)), frame, truth[frame], None)
    assert start.velocity is not None
    assert start.velocity == pytest.approx((truth[frame + 1] - truth[frame - 1]) / 2 * RATE_HZ, abs=30)


@pytest.mark.parametrize("last", [False, True])
def test_a_clip_that_begins_or_ends_at_the_click_keeps_the_block(last: bool) -> None:
    clip = Clip(walker=True)
    pictures, truth = film(clip)
    some = slice(0, 30) if last else slice(18, 48)
    cut = Pictures(pictures.images[some], pictures.time_s[some])
    frame = 29 if last else 0
    track = track_block(cut, frame, truth[some][frame] + (1.5, -1.0), background=no_motion(0, 29))
    assert track.frame.size >= 28
    assert np.abs(track.pixel - truth[some][track.frame]).max() < 2.5


def test_of_things_that_look_like_the_block_those_at_rest_are_left_out() -> None:
    looks = Appearance(np.full((4, 3), 200.0), 8.0)
    state = State(looks, (), (), np.zeros(len(SHUTTERS)), rivals=(np.array([50.0, 60.0]), np.array([90.0, 60.0])))
    assert not _moves(state, np.array([51.0, 58.5]))
    assert _moves(state, np.array([54.0, 60.0]))


def test_a_gap_is_bridged_and_left_empty() -> None:
    track, error = follow(Clip(wall=(215, 235)))
    missing = sorted(set(range(48)) - set(track.frame.tolist()))
    assert 1 <= len(missing) <= 4
    assert all(200 < path(np.array([frame / RATE_HZ]))[0, 0] < 250 for frame in missing)
    assert np.median(np.hypot(*error.T)) < 0.15
    assert turned(track, error) < 1.8  # where a part is hidden the standard deviation says so


@pytest.mark.parametrize("walker", [False, True])
def test_what_hides_for_good_is_lost_where_it_hides(walker: bool) -> None:
    clip = Clip(wall=(300, 480), walker=walker)
    track, error = follow(clip)
    hides = int(np.argmax(path(np.arange(clip.frames) / RATE_HZ)[:, 0] > 300))
    assert hides - 3 <= track.frame[-1] <= hides + 1
    assert str(track.frame[-1]) in track.stopped[1]
    assert "hidden" in track.stopped[1]
    assert np.abs(error).max() < 2.5


def test_leaving_the_picture_is_told() -> None:
    clip = Clip(frames=60)
    track, error = follow(clip)
    assert track.frame[-1] >= 50
    assert "leaves the picture" in track.stopped[1]
    assert np.abs(error[:-2]).max() < 0.5


def test_what_is_unknown_of_the_background_does_not_tell_how_bright_the_picture_is() -> None:
    """A camera that pans: of the upper part of its last picture there are too few others. No block is in it."""
    clip = Clip()
    ground = texture(np.random.default_rng(1), clip, 60).astype(np.uint8)
    pictures = Pictures([ground[120 - 10 * k : 240 - 10 * k, :200] for k in range(9)], np.arange(9) / RATE_HZ)
    homography = np.tile(np.eye(3), (9, 1, 1))
    homography[:, 1, 2] = -10.0 * np.arange(9)
    motion = BackgroundMotion(np.arange(9), homography, np.full(9, 50), np.zeros(9), False)
    looks = Appearance(np.array([[ground.mean() - 40.0] * 3, [205.0] * 3]), 8.0)
    plates = Plates(pictures, motion)
    picture = np.repeat(pictures.images[8][:, :, None], 3, axis=2)
    here = cover(picture, 8, plates, looks, np.array([100.0, 10.0]), 24.0)
    known = here.weight > 0
    assert 0.2 < known.mean() < 0.5
    assert np.abs(here.alpha[known]).max() < 0.1
    seen = fit(here, looks, np.array([100.0, 20.0]), np.zeros(2))
    assert seen is None or seen.visible < 0.7


def test_a_second_click_brings_the_track_back() -> None:
    pictures, truth = film(Clip(wall=(180, 320)))
    alone = track_block(pictures, 10, truth[10], background=no_motion(0, 47))
    both = track_block(pictures, 10, truth[10], clicks=[(44, *truth[44])], background=no_motion(0, 47))
    assert alone.frame[-1] < 20
    assert both.frame[-1] == 47
    assert np.median(np.hypot(*(both.pixel - truth[both.frame]).T)) < 0.2


def test_a_block_of_the_grounds_colour_is_off_by_what_it_says_or_not_found() -> None:
    """With gaps, and sure of no place that it does not have; or nothing that could be followed."""
    hidden = Clip(block=112.0, contrast=10.0, noise=4.0)
    pictures, truth = film(hidden)
    track = track_block(pictures, 20, truth[20], background=no_motion(0, 47))
    error = track.pixel - truth[track.frame]
    assert 1 < track.frame.size < 40
    assert np.hypot(*error.T).max() < 0.65 * hidden.diameter
    assert np.median(track.sigma_px) > 0.8
    assert turned(track, error) < 1.8
    pictures, truth = film(replace(hidden, seed=2))
    with pytest.raises(InputError, match=r"Nothing moves at \(\d+\.?\d*, \d+\.?\d*\) in frame 20"):
        track_block(pictures, 20, truth[20], background=no_motion(0, 47))


@pytest.mark.parametrize(
    ("frame", "pixel", "says"),
    [
        (20, (20.0, 220.0), "Nothing moves"),
        (20, (500.0, 10.0), "outside the picture"),
        (99, (100.0, 100.0), "outside the frames"),
    ],
)
def test_clicks_that_hit_nothing(frame: int, pixel: tuple[float, float], says: str) -> None:
    pictures, _ = film(Clip())
    with pytest.raises(InputError, match=says):
        track_block(pictures, frame, pixel, background=no_motion(0, 47))


@pytest.mark.parametrize(("first", "last"), [(-1, 20), (0, 48), (21, 20)])
def test_frames_that_are_not_in_the_video(first: int, last: int) -> None:
    pictures, _ = film(Clip())
    with pytest.raises(InputError, match=rf"^Frames {first} to {last} are not in the video, .* the frames 0 to 47"):
        track_block(pictures, 20, (100.0, 100.0), first=first, last=last, background=no_motion(0, 47))


def test_a_block_that_fills_the_picture_needs_its_diameter() -> None:
    clip = Clip(diameter=90.0)
    with pytest.raises(InputError, match=r"in frame 10 is 90 pixels large\. Give the block's diameter in pixels"):
        follow(clip, frame=10)


@pytest.mark.parametrize("contrast", [2.9, 3.1])
def test_a_block_that_hardly_stands_out_at_its_click(monkeypatch: pytest.MonkeyPatch, contrast: float) -> None:
    """At the click three standard deviations of a pixel are needed, elsewhere two."""

    def weak(*arguments: object) -> Sighting | None:
        seen = fit(*arguments)  # type: ignore[arg-type]
        return None if seen is None else replace(seen, contrast=contrast)

    monkeypatch.setattr(tracking_steps, "fit", weak)
    if contrast > 3:
        assert follow(Clip(frames=24))[0].frame.size == 24
    else:
        with pytest.raises(
            InputError, match=r"^The block hardly stands out from the background in frame 20\. Click on"
        ):
            follow(Clip(frames=24))


def test_the_filmed_ball() -> None:
    """One click; against the centres by colour, checked by hand, that come with the video."""
    video = open_video(BALL / "balle1-vp9.avi")
    track = track_block(video, 60, (148.0, 48.0), background=no_motion(0, 294))
    hand = np.loadtxt(BALL / "balle1_redball_track_px.csv", delimiter=",", skiprows=1)
    seen = (track.frame > 30) & (track.frame < 292)
    apart = np.hypot(*(track.pixel[seen] - hand[track.frame[seen], 1:3] - 0.5).T)
    assert np.nanmedian(apart) < 0.7
    assert np.nanquantile(apart, 0.97) < 2.5  # the coloured blob is cut by the picture's border, the disc is not
    assert seen.sum() > 250
    time_s = track.frame / 187.35
    for begin, end in ((0.2, 0.72), (0.745, 1.25), (1.3, 1.56)):
        mine, theirs = ((t > begin) & (t < end) for t in (time_s, hand[:, 0] / 187.35))
        theirs &= np.isfinite(hand[:, 1])
        assert residual(time_s[mine], track.pixel[mine]) < 1.25 * residual(hand[theirs, 0] / 187.35, hand[theirs, 1:3])
    kinks = find_kinks(time_s, track.stable, track.sigma_px)
    assert kinks.time_s == pytest.approx((0.733, 1.274), abs=0.006)  # a frame lasts 5.3 ms


def residual(time_s: np.ndarray, pixel: np.ndarray) -> float:
    """Root mean square about a parabola [px]."""
    fitted = np.polynomial.polynomial.polyfit(time_s, pixel, 2)
    return float(np.sqrt(np.mean((np.polynomial.polynomial.polyval(time_s, fitted).T - pixel) ** 2)))


def test_large_pictures_are_followed_reduced_unless_the_block_is_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """The filmed ball: at half the size its places are those of the whole pictures; too small there, the same ones."""
    video = open_video(BALL / "balle1-vp9.avi")

    span = 40, 290

    def followed() -> BlockTrack:
        still = no_motion(span[0], span[1])
        return track_block(video, 60, (148.0, 48.0), background=still, first=span[0], last=span[1])

    whole = followed()
    monkeypatch.setattr(sources, "LARGEST", 0.6 * video.width * video.height)
    half = followed()
    shared, a, b = np.intersect1d(whole.frame, half.frame, return_indices=True)
    assert shared.size > 0.9 * whole.frame.size
    assert np.median(np.hypot(*(whole.pixel[a] - half.pixel[b]).T)) < 0.05 * np.median(whole.diameter_px)
    assert np.median(np.hypot(*(whole.stable[a] - half.stable[b]).T)) < 0.05 * np.median(whole.diameter_px)
    assert np.median(half.diameter_px) == pytest.approx(np.median(whole.diameter_px), rel=0.1)
    assert 0.3 < np.median(half.sigma_px) / np.median(whole.sigma_px) < 3
    monkeypatch.setattr(tracking, "SMALLEST", 1e3)
    small = followed()
    assert np.abs(small.pixel - whole.pixel).max() < 0.2


def test_reduced_to_five_pixels_a_block_is_found_as_exactly_as_its_sigma_says() -> None:
    clip = Clip(diameter=10.0)
    pictures, truth = film(clip)
    half = Pictures([sources.reduced(picture, 2) for picture in pictures.images], pictures.time_s)
    track = track_block(half, 20, truth[20] / 2, background=no_motion(0, 47))
    error = 2 * track.pixel - truth[track.frame]
    assert track.frame.size == 48
    assert np.sqrt(np.mean(error**2)) < 0.12
    assert 0.65 < turned(track, error / 2) < 1.3
