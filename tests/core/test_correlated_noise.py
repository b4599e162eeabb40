# SPDX-License-Identifier: GPL-3.0-or-later
"""Trackers that are off by the same from frame to frame: standard deviations against the scatter of many fits."""

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.terrain.surface import Surface
from scipy.signal import lfilter

BLOCK = Block(0.05, 0.05, 0.05, density=1e5)  # so heavy that the air does nothing to it
PLANE = Surface(
    np.array([[-40.0, -40, 0], [40, -40, 0], [40, 40, 0], [-40, 40, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "floor",
)
CAMERA = look_at(1920, 1080, (5.0, -60.0, 12.0), (5, 0, 1), focal_px=3000.0)
TIME = np.array([0.5, 1.3, 2.2, 2.9])
PLACE = np.array([[-5.0, 0.0, 0.0], [1.0, 0.3, 0.0], [8.0, 0.1, 0.0], [13.0, -0.4, 0.0]])
RATE_HZ, SIGMA_PX, FITS = 60.0, 1.0, 40


def seen_with(correlation, rng):
    """Pixels of the bounces, off by noise with a standard deviation of one, correlated from each frame to the next."""
    time = np.arange(TIME[0] + 0.005, TIME[-1], 1 / RATE_HZ)
    flight = np.searchsorted(TIME, time) - 1
    since, whole = time - TIME[flight], np.diff(TIME)[flight]
    where = PLACE[flight] + (since / whole)[:, None] * np.diff(PLACE, axis=0)[flight]
    where[:, 2] += BLOCK.radius_m + 0.5 * 9.81 * since * (whole - since)
    fresh = rng.normal(size=(time.size + 200, 2)) * np.sqrt(1 - correlation**2)
    noise = lfilter([1.0], [1.0, -correlation], fresh, axis=0)[200:]
    pixel = project(CAMERA, where) + SIGMA_PX * noise
    stated = np.full(time.size, SIGMA_PX)
    return PixelObservations(np.zeros(time.size, dtype=np.intp), np.full(time.size, "a"), time, pixel, stated)


def fitted(correlation, rng):
    picks = make_picks(["a"] * 4, TIME + 0.01 * rng.normal(size=4), PLACE, sigma_time_s=np.full(4, 0.01))
    seen = seen_with(correlation, rng)
    view = View("one", fixed(CAMERA), pose_covariance=1e-12 * np.eye(6))
    return refine(picks, [view], seen, surface=PLANE, block=BLOCK, sigma_terrain_m=1e-4, sigma_aim=0.0)


@pytest.fixture(scope="module", params=[0.0, 0.9])
def fits(request):
    rng = np.random.default_rng(7)
    return request.param, [fitted(request.param, rng) for _ in range(FITS)]


def test_standard_deviations_are_the_scatter_of_fits(fits):
    _, results = fits
    found = np.stack([result.reconstruction.impacts.v1[1:] for result in results])
    stated = np.stack([result.reconstruction.impacts.sigma["v1"][1:] for result in results])
    ratio = found.std(axis=0) / np.sqrt((stated**2).mean(axis=0))
    assert 0.85 < np.sqrt((ratio**2).mean()) < 1.15


def test_correlation_is_said_where_there_is_one(fits):
    correlation, results = fits
    said = [any("from frame to frame" in remark.text for remark in result.remarks) for result in results]
    assert np.mean(said) == pytest.approx(float(correlation > 0), abs=0.06)
