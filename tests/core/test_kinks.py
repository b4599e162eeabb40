# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts proposed from tracks whose truth is known."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.footage.kinks import find_kinks

RATE_HZ = 30.0
FALL = 300.0
"""Acceleration in the picture [px/s²]."""


def bounces(
    impacts_s: tuple[float, ...], end_s: float, *, rate_hz: float = RATE_HZ, keep: float = 0.6
) -> tuple[np.ndarray, np.ndarray]:
    """Times and places of a ball that falls along v, meets the ground at `impacts_s`, and loses speed along u there."""
    time_s = np.arange(0, end_s, 1 / rate_hz)
    place = np.empty((time_s.size, 2))
    start, here, speed = 0.0, np.array([20.0, 40.0]), np.array([180.0, 30.0])
    for impact in (*impacts_s, np.inf):
        inside = (time_s >= start) & (time_s < impact)
        elapsed = time_s[inside] - start
        place[inside] = here + np.outer(elapsed, speed) + 0.5 * FALL * np.outer(elapsed**2, [0, 1])
        if np.isfinite(impact):
            here = here + (impact - start) * speed + [0, 0.5 * FALL * (impact - start) ** 2]
            speed = np.array([0.9 * speed[0], -keep * (speed[1] + FALL * (impact - start))])
            start = impact
    return time_s, place


def test_exact_tracks_give_exact_times() -> None:
    """Parabolas meet where they meet: the times lie between frames and come out to a hundredth of one."""
    impacts = (0.613, 1.279, 1.702)
    time_s, place = bounces(impacts, 2.3)
    kinks = find_kinks(time_s, place, np.full(time_s.size, 0.1))
    assert kinks.time_s == pytest.approx(impacts, abs=0.01 / RATE_HZ)
    fall = kinks.velocity_before[:, 1]
    assert kinks.velocity_after[:, 1] == pytest.approx(-0.6 * fall, rel=1e-3)
    assert kinks.velocity_after[:, 0] == pytest.approx(0.9 * kinks.velocity_before[:, 0], rel=1e-3)


def test_standard_deviations_are_right() -> None:
    """Over many noisy tracks the errors of time are as large as they are said to be, and nothing is made up."""
    rng = np.random.default_rng(4)
    impacts = np.array([0.613, 1.279])
    time_s, place = bounces(tuple(impacts), 2.0)
    normalised, wrong = [], 0
    for _ in range(60):
        sigma = np.full(time_s.size, 0.4)
        kinks = find_kinks(time_s, place + rng.normal(scale=0.4, size=place.shape), sigma)
        if len(kinks) == 2:
            normalised.append((kinks.time_s - impacts) / kinks.sigma_time_s)
        else:
            wrong += 1
    assert wrong <= 1
    assert 0.6 < np.sqrt(np.mean(np.square(normalised))) < 1.5
    assert np.abs(np.mean(normalised)) < 0.4


def test_a_flight_has_no_kinks() -> None:
    """Nor one seen obliquely: the image of a parabola under a homography is no parabola in time."""
    time_s, place = bounces((), 2.5)
    rng = np.random.default_rng(5)
    oblique = place / (1 + 4e-4 * place[:, :1])
    for path in (place, oblique):
        kinks = find_kinks(time_s, path + rng.normal(scale=0.2, size=path.shape), np.full(time_s.size, 0.2))
        assert len(kinks) == 0


def test_gaps_and_uneven_times() -> None:
    """Frames around an impact may be missing, as behind dust, and frames need not come evenly."""
    rng = np.random.default_rng(6)
    time_s, place = bounces((0.907,), 2.0, rate_hz=240.0)
    kept = np.sort(rng.choice(time_s.size, 90, replace=False))
    kept = kept[np.abs(time_s[kept] - 0.92) > 0.05]
    noisy = place[kept] + rng.normal(scale=0.2, size=(kept.size, 2))
    kinks = find_kinks(time_s[kept], noisy, np.full(kept.size, 0.2))
    assert kinks.time_s == pytest.approx([0.907], abs=4 * kinks.sigma_time_s[0])
    assert kinks.sigma_time_s[0] < 0.01


def test_rolling_into_rest_is_smooth() -> None:
    time_s = np.arange(60) / RATE_HZ
    rolled = np.where(time_s < 1.2, 100 * time_s - 100 / 2.4 * time_s**2, 60)
    place = np.column_stack([rolled, 0.3 * rolled]) + np.random.default_rng(7).normal(scale=0.2, size=(60, 2))
    assert len(find_kinks(time_s, place, np.full(60, 0.2))) == 0


def test_few_sightings_and_wrong_times() -> None:
    assert len(find_kinks(np.arange(5.0), np.zeros((5, 2)), np.ones(5))) == 0
    with pytest.raises(InputError, match="ascend"):
        find_kinks(np.array([0.0, 1.0, 1.0]), np.zeros((3, 2)), np.ones(3))
