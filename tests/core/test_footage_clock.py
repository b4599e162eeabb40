# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks: round trips, known offsets and drifts found again, and advice with known numbers."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rockfall.core.errors import InputError
from rockfall.core.footage.advice import (
    content_advice,
    pixel_size_m,
    rate_advice,
    rolling_turns_hz,
    time_sigma_s,
    turn_advice,
    uncountable,
)
from rockfall.core.footage.clock import Clock, clock_for, synchronise
from rockfall.core.footage.video import open_video

FOLDER = Path(__file__).parent.parent / "data" / "videos"


@pytest.fixture(scope="module")
def constant():
    """40 frames at 30 a second."""
    return open_video(FOLDER / "constant.mp4")


@given(
    st.floats(-1e5, 1e5),
    st.floats(-0.5, 0.5),
    st.floats(-1e3, 1e3),
    st.floats(1e-2, 10),
    st.floats(-1e4, 1e4),
)
def test_common_time_and_back(offset, drift, origin, rate, time):
    clock = Clock(offset, drift, origin, rate)
    assert clock.to_video(clock.to_common(time)) == pytest.approx(time, abs=1e-7)
    assert clock.to_common(origin) == offset


def test_a_clock_with_known_numbers():
    clock = Clock(offset_s=100.0, drift=0.01, origin_s=2.0, rate=1 / 8)
    np.testing.assert_allclose(clock.to_common(np.array([2.0, 10.0])), [100.0, 101.01])
    assert Clock().to_common(3.5) == 3.5


@pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"rate": -1.0}, {"drift": -1.0}, {"offset_s": np.nan}])
def test_clocks_run_forwards(wrong):
    with pytest.raises(InputError, match="does not run"):
        Clock(**wrong)


def test_slow_motion(constant):
    clock = clock_for(constant, 240.0, offset_s=5.0)
    assert clock.rate == pytest.approx(1 / 8)
    assert clock.to_common(0.8) == pytest.approx(5.1)
    assert clock_for(constant).rate == 1
    # Lost frames do not make the camera slower.
    assert clock_for(open_video(FOLDER / "variable.mp4"), 240.0).rate == pytest.approx(1 / 8, rel=0.01)
    with pytest.raises(InputError, match="not above 0"):
        clock_for(constant, 0.0)
    with pytest.raises(InputError, match="single frame"):
        clock_for(open_video(FOLDER / "single.mp4"), 240.0)


@pytest.mark.parametrize("fit_drift", [False, True])
@pytest.mark.parametrize("told", [False, True])
def test_offset_and_drift_are_found_within_their_sigmas(fit_drift, told):
    rng = np.random.default_rng(7)
    drift, rate, pulls = 2e-4 * fit_drift, 0.25, []
    for _ in range(300):
        truth = Clock(12.5, drift, 40.0, rate)
        seen = rng.uniform(0, 400, 8)
        sigma = rng.uniform(0.002, 0.02, 8) if told else np.full(8, 0.01)
        common = truth.to_common(seen) + rng.normal(0, sigma)
        found = synchronise(common, seen, rate=rate, fit_drift=fit_drift, sigma_s=sigma if told else None)
        error = found.clock.offset_s - truth.to_common(found.clock.origin_s)
        pulls.append([error / found.sigma_offset_s, (found.clock.drift - drift) / (found.sigma_drift or 1)])
        assert (found.sigma_drift > 0) == fit_drift
        np.testing.assert_allclose(found.residual_s, common - found.clock.to_common(seen), atol=1e-12)
    # The median of |pull| is 0.674 for a normal distribution, 0.718 for Student's t of the scatter's 6 degrees of
    # freedom, and somewhat less where told sigmas are enlarged now and then.
    middle = np.median(np.abs(pulls), axis=0)
    assert 0.5 < middle[0] < 0.85
    assert 0.5 < middle[1] < 0.85 if fit_drift else middle[1] == 0


def test_least_squares_agree_with_a_straight_line():
    seen, common = np.array([1.0, 20, 33, 50]), np.array([3.01, 22.0, 35.02, 51.99])
    found = synchronise(common, seen, fit_drift=True, sigma_s=0.02)
    slope, shift = np.polyfit(seen, common, 1)
    assert found.clock.drift == pytest.approx(slope - 1)
    assert found.clock.to_common(0.0) == pytest.approx(shift)


def test_one_event_tells_the_offset():
    found = synchronise([10.0], [2.5])
    assert found.clock.to_common(2.5) == 10
    assert np.isnan(found.sigma_offset_s)
    assert synchronise([10.0], [2.5], sigma_s=0.01).sigma_offset_s == pytest.approx(0.01)


@pytest.mark.parametrize("fit_drift", [False, True])
@pytest.mark.parametrize("wrong", range(5))
def test_a_wrong_event_is_named(wrong, fit_drift):
    seen = np.array([0.0, 10, 25, 40, 60])
    common = 5 + seen + np.array([2, -3, 1, 0, -1]) * 1e-3
    common[wrong] += 0.5
    found = synchronise(common, seen, fit_drift=fit_drift)
    assert found.suspects.tolist() == [wrong]
    assert re.match(rf"Event {wrong + 1} is \+0\.(50|49)\d s off the others", found.remarks[0].text)
    assert (found.remarks[0].severity, found.remarks[0].about) == ("warning", f"event {wrong + 1}")
    named = synchronise(common, seen, fit_drift=fit_drift, names=list("pqrst"))
    assert named.remarks[0].text.startswith(f"Event {'pqrst'[wrong]} is ")
    right = synchronise(np.delete(common, wrong), np.delete(seen, wrong), fit_drift=fit_drift)
    assert right.suspects.size == 0
    assert right.remarks == ()


def test_two_events_that_disagree_and_a_rate_that_is_wrong():
    assert "disagree by +0.400 s" in synchronise([1.0, 5.4], [0.0, 4.0]).remarks[0].text
    assert synchronise([1.0, 5.01], [0.0, 4.0]).remarks == ()
    seen = np.array([0.0, 20, 40, 60])
    found = synchronise(2 * seen, seen, fit_drift=True)
    assert "0.5 times as high" in found.remarks[0].text


def test_impossible_synchronisations():
    with pytest.raises(InputError, match="no event"):
        synchronise([], [])
    with pytest.raises(InputError, match="at least 3 events, there are 2"):
        synchronise([1, 2], [1, 2], fit_drift=True)
    with pytest.raises(InputError, match="too close together"):
        synchronise([1, 1.1, 1.2], [1, 1.1, 1.2], fit_drift=True)
    with pytest.raises(InputError, match="too close together"):
        synchronise([1, 1, 1], [1, 1, 1], fit_drift=True)
    with pytest.raises(InputError, match="2 common times and 3 video times"):
        synchronise([1, 2], [1, 2, 3])
    with pytest.raises(InputError, match="Event 2 has no time"):
        synchronise([1, np.nan], [1, 2])
    with pytest.raises(InputError, match="not above 0"):
        synchronise([1, 2], [1, 2], sigma_s=0.0)


def test_five_frames_a_turn():
    """Noël et al. 2018; 9 m/s and 0.35 m diameter: 9 / (0.35 π) = 8.19 turns a second."""
    assert rolling_turns_hz(9, 0.175) == pytest.approx(8.185, abs=1e-3)
    sentence = turn_advice(30, rolling_turns_hz(9, 0.175))
    assert (
        sentence == "A block turns 8.2 times a second: 41 frames a second are needed to count turns, this video has 30."
    )
    assert turn_advice(60, 8.2).endswith("this video has 60, which is enough.")
    said = uncountable(25, 9.0, 0.195)
    assert "At 9 m/s a rolling block of 0.39 m diameter turns 7.3 times a second" in said
    assert said.endswith("37 frames a second are needed to count turns, this video has 25.")
    assert uncountable(37, 9.0, 0.195) == "" == uncountable(25, 1.0, 0.195)
    assert "30 frames a second are the least" in turn_advice(25, 2.0)
    assert "enough" not in turn_advice(25, 2.0)
    assert "enough" in turn_advice(30_000 / 1001, 2.0)


def test_advice_on_a_video(constant):
    said = rate_advice(constant, speed_mps=9, radius_m=0.175)
    assert said[0].startswith("At 9 m/s a rolling block of 0.35 m diameter turns 8.2 times a second: 41 frames")
    assert "± 9.6 ms" in said[1]
    assert "0.087 m" in said[1]
    assert "which is enough" in rate_advice(constant, capture_rate_hz=240, speed_mps=9, radius_m=0.175)[0]
    assert "1.0 times" in rate_advice(constant, spin_radps=-2 * np.pi)[0]
    assert "up to 6 a second" in rate_advice(constant)[0]
    assert content_advice(constant) == []
    assert len(content_advice(open_video(FOLDER / "variable.mp4"))) == 2
    assert "repeat" in content_advice(open_video(FOLDER / "repeated.avi", thorough=True))[0]
    assert "One frame" in rate_advice(open_video(FOLDER / "single.mp4"))[0]


def test_what_a_frame_and_a_pixel_span():
    moments = (np.arange(10_000) + 0.5) / 10_000 / 30  # evenly within a frame
    assert time_sigma_s(30) == pytest.approx(moments.std(), rel=1e-6)
    assert pixel_size_m(100.0, 2000.0) == 0.05
