# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that are missing, ground that is gone, a lens that zooms, a wrong rate: named, and in the deviations.

The truth is a ball that bounces over a floor, in closed form.
"""

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import Project, VideoEntry, read_project, write_project
from rockfall.core.footage.clock import Clock
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.terrain.surface import Surface

BLOCK = Block(0.6, 0.6, 0.6)
FLOOR = Surface(
    np.array([[-60.0, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "floor",
)
TIME = np.array([0.4, 1.1, 1.9, 2.55, 3.4, 4.0])
PLACE = np.array([[-9.0, 0, 0], [-5.2, 0.4, 0], [-1.0, 0.1, 0], [2.4, 0.5, 0], [7.0, 0.2, 0], [10.0, -0.3, 0]])
RATE_HZ, SIGMA_PX = 30.0, 0.7
CAMERAS = (
    look_at(1920, 1080, (2.0, -45.0, 14.0), (0.5, 0, 1), focal_px=2900.0),
    look_at(1920, 1080, (38.0, 22.0, 16.0), (0.5, 0, 1), focal_px=2900.0),
)
COVARIANCE = np.diag([2e-4, 2e-4, 2e-4, 0.03, 0.03, 0.03]) ** 2


def places(time, gone=None):
    """(m, 3) of the ball's centre, and its velocities after and before each contact, (n − 1, 3) of the flights."""
    centre = (
        PLACE + np.array([0, 0, BLOCK.radius_m]) - np.outer(np.zeros(len(PLACE)) if gone is None else gone, [0, 0, 1])
    )
    whole, way = np.diff(TIME), np.diff(centre, axis=0)
    leaving = way / whole[:, None] + np.outer(whole, [0, 0, 9.81 / 2])
    arriving = leaving - np.outer(whole, [0, 0, 9.81])
    flight = np.clip(np.searchsorted(TIME, time) - 1, 0, len(whole) - 1)
    since = (time - TIME[flight])[:, None]
    return centre[flight] + since * leaving[flight] - since**2 * [0, 0, 9.81 / 2], leaving, arriving


class Filmed:
    """The ball as seen by one or two cameras, each from its own first frame on.

    Parameters
    ----------
    lost : frames that the first video lost after its frame 47; below zero, that it shows again.
    gone : (n,) by how much the floor lies lower than it is given.
    zoom : amplitude of the first camera's focal length.
    rate_hz : pictures a second.
    slower : by how much longer all times are than they should be.
    """

    def __init__(self, seed, views=1, lost=0, gone=None, zoom=0.0, slower=1.0, rate_hz=RATE_HZ):
        rng = np.random.default_rng(seed)
        rows, self.views = [], []
        for number, camera in enumerate(CAMERAS[:views]):
            frames = np.arange(int(4.6 * rate_hz))
            common = 0.003 + 0.011 * number + frames / rate_hz
            if number == 0:
                common = common + np.where(frames > 47, lost / rate_hz, 0.0)
            inside = (common > TIME[0]) & (common < TIME[-1])
            pixel = project(camera, places(common[inside], gone)[0])
            if number == 0:
                factor = 1 + zoom * np.sin(2 * np.pi * 0.7 * (common[inside] - TIME[0]) / np.ptp(TIME) + 0.5)
                pixel = [960, 540] + (pixel - [960, 540]) * factor[:, None]
            pixel = pixel + SIGMA_PX * rng.normal(size=pixel.shape)
            rows.append((np.full(inside.sum(), number), frames[inside] / rate_hz, pixel))
            clock = Clock(offset_s=0.003 + 0.011 * number, rate=slower)
            self.views.append(View(f"from {number + 1}", fixed(camera), clock, pose_covariance=COVARIANCE))
        index, video_s, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
        name, sigma = np.full(index.size, "a"), np.full(index.size, SIGMA_PX)
        self.pixels = PixelObservations(index, name, video_s, pixel, sigma)
        shown = TIME - np.where(0.003 + 47 / rate_hz < TIME, lost / rate_hz, 0.0)
        marked = 0.003 + slower * (np.round((shown - 0.003) * rate_hz) / rate_hz)
        near = PLACE + 0.05 * rng.normal(size=PLACE.shape) * [1, 1, 0]
        self.picks = make_picks(["a"] * len(TIME), marked, near, sigma_time_s=np.full(len(TIME), 0.01))
        self.result = refine(
            self.picks, self.views, self.pixels, surface=FLOOR, block=BLOCK, sigma_terrain_m=0.02, sigma_aim=0.05
        )
        _, self.leaving, self.arriving = places(TIME, gone)

    @property
    def warnings(self):
        return [remark.text for remark in self.result.remarks if remark.severity == "warning"]

    @property
    def errors(self):
        """Errors of the velocities, and their standard deviations: (2n − 2, 3) each."""
        impacts = self.result.reconstruction.impacts
        found = np.concatenate([impacts.v2[:-1] - self.leaving, impacts.v1[1:] - self.arriving])
        return found, np.concatenate([impacts.sigma["v2"][:-1], impacts.sigma["v1"][1:]])

    def held(self):
        """Part of the velocities in their 95 % intervals."""
        error, sigma = self.errors
        return float((np.abs(error) < 1.96 * sigma).mean())


def test_many_pixels_ask_for_no_other_focal_length():
    """A larger one makes all pixels smaller, and must not make their noise smaller than it is."""
    for seed in range(3):
        assert Filmed(seed, rate_hz=240.0).warnings == []


@pytest.mark.parametrize("views", [1, 2])
def test_nothing_is_named_where_nothing_is_wrong(views):
    for seed in range(6):
        assert Filmed(seed, views).warnings == []


@pytest.mark.parametrize("views", [1, 2])
@pytest.mark.parametrize("lost", [3, 1, -1])
def test_missing_and_doubled_frames_are_named_and_corrected(views, lost):
    clean, bad = Filmed(1, views), Filmed(1, views, lost=lost)
    what = f"{abs(lost)} frame{'s' if abs(lost) > 1 else ''}"
    (text,) = bad.warnings
    assert what in text
    assert ("missing" in text) == (lost > 0)
    (gap,) = bad.result.views[0].clock.gaps
    assert abs(gap[0] * RATE_HZ - 47) < 1.5
    assert gap[1] == pytest.approx(lost / RATE_HZ, abs=0.012)
    assert np.abs(bad.errors[0]).max() < 3 * np.abs(clean.errors[0]).max()
    assert bad.held() > 0.85
    np.testing.assert_allclose(bad.result.picks.time_s, TIME, atol=0.02)


def test_ground_that_is_gone_at_one_impact_is_named_with_its_metres():
    gone = np.array([0, 0, 0, 0.3, 0, 0])
    bad = Filmed(2, 2, gone=gone)
    (text,) = bad.warnings
    assert "impact at 2.5" in text
    assert "of trajectory a" in text
    assert float(text.split("lies ")[1].split(" ")[0]) == pytest.approx(0.3, abs=0.05)
    assert "lower than the terrain" in text
    assert bad.held() > 0.85
    assert bad.result.views[0].clock.gaps == ()


def test_a_zoom_is_in_the_deviations_and_named():
    held, named = [], []
    for seed in range(6):
        bad = Filmed(seed, zoom=0.05)
        held.append(bad.held())
        named.append(any("zoom" in text for text in bad.warnings))
    assert np.mean(held) > 0.85
    assert np.mean(named) > 0.8


def test_a_wrong_rate_is_said_and_in_the_deviations():
    bad = Filmed(3, slower=29.97 / 25)
    said = [text for text in bad.warnings if "capture rate" in text]
    assert len(said) == 1
    assert "0.83" in said[0], "by what times are to be multiplied: 25 / 29.97"
    assert bad.held() > 0.9
    assert bad.result.views[0].clock.rate == pytest.approx(29.97 / 25), "the clock is left to the person"


def test_a_clock_with_gaps():
    clock = Clock(10.0, 0.0, 1.0, 0.5, ((2.0, 0.4), (3.0, -0.2)))
    video = np.array([1.0, 2.0, 2.1, 3.0, 3.1])
    common = np.array([10.0, 10.5, 10.75, 11.2, 11.15])  # 10 + ½ (video − 1), and ½ · 0.4 and −½ · 0.2 later
    np.testing.assert_allclose(clock.to_common(video), common)
    np.testing.assert_allclose(clock.to_video(common[:4]), video[:4])
    assert clock.to_video(10.6) == pytest.approx(2.0), "no frame: the last one before"
    assert clock.to_video(11.4) == pytest.approx(3.6)
    assert clock.to_common(clock.to_video(11.4)) == pytest.approx(11.4)
    assert Clock.of_numbers(clock.numbers) == clock
    assert clock.with_gap(3.0, 0.2).with_gap(2.5, 0.1).gaps == ((2.0, 0.4), (2.5, 0.1), (3.0, 0.0))


def test_gaps_of_a_project(tmp_path):
    file = tmp_path / "project.toml"
    write_project(Project(videos=(VideoEntry("left", gaps=((4.5, 0.1),)), VideoEntry("right"))), file)
    assert [video.gaps for video in read_project(file).videos] == [((4.5, 0.1),), ()]
    assert "gaps" not in file.read_text().split("right")[1]
    file.write_text(file.read_text().replace("4.5", '"4.5"'))
    with pytest.raises(InputError, match="gaps"):
        read_project(file)
