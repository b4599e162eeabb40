# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations of the impacts against Monte Carlo runs of the whole reconstruction."""

import numpy as np
import pytest
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

COLUMNS = ("v1", "v2", "vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev", "kinetic1_j", "kinetic2_j")
NORMAL = np.array([np.sin(0.7), 0.0, np.cos(0.7)])
DRAWS = 10_000


def propagated_and_drawn(time, position, kind, sigma_time, sigma_position):
    """The standard deviations of the second impact, first order and from draws."""
    n = len(time)
    normal = np.tile(NORMAL, (n, 1))
    given = {"sigma_time_s": sigma_time, "sigma_position_m": sigma_position}
    picks = make_picks(["a"] * n, time, position, kind=kind, normal=normal, **given)
    impact = reconstruct(picks).impacts
    row = 1

    rng = np.random.default_rng(11)
    times = time + np.nan_to_num(sigma_time) * rng.normal(size=(DRAWS, n))
    positions = position + np.nan_to_num(sigma_position)[:, None] * rng.normal(size=(DRAWS, n, 3))
    names = np.repeat(np.arange(DRAWS).astype(str), n)
    weights = {"sigma_position_m": np.tile(sigma_position, DRAWS)}
    many = make_picks(
        names,
        times.ravel(),
        positions.reshape(-1, 3),
        kind=np.tile(kind, DRAWS),
        normal=np.tile(normal, (DRAWS, 1)),
        **weights,
    )
    drawn = reconstruct(many).impacts
    chosen = drawn.impact == row + 1
    spread = {name: np.nanstd(getattr(drawn, name)[chosen], axis=0) for name in COLUMNS}
    return {name: impact.sigma[name][row] for name in COLUMNS}, spread


def check(propagated, drawn):
    for name in COLUMNS:
        np.testing.assert_allclose(propagated[name], drawn[name], rtol=0.03, atol=1e-9, err_msg=name)


TIME = np.array([0.0, 0.9, 1.7])
POSITION = np.array([(0, 0, 0), (6, 0.5, -6.5), (13.0, 2.2, -13)])


def test_picks_only():
    sigma_time, sigma_position = np.array([0.004, 0.003, 0.005]), np.array([0.02, 0.03, 0.01])
    check(*propagated_and_drawn(TIME, POSITION, ["impact"] * 3, sigma_time, sigma_position))


def test_times_alone_share_the_impacts_instant():
    check(*propagated_and_drawn(TIME, POSITION, ["impact"] * 3, np.full(3, 0.004), np.full(3, np.nan)))


def test_passes_make_velocities_better_known():
    time = np.array([0.0, 0.3, 0.7, 0.9, 1.2, 1.7])
    start = np.array([(0, 0, 0), (6, 0.5, -6.5), (13.0, 2.2, -13)])
    position = np.empty((6, 3))
    for first, last, begin, end in ((0, 3, 0, 1), (3, 5, 1, 2)):
        duration = time[last] - time[first]
        velocity = (start[end] - start[begin]) / duration + np.array([0, 0, 9.81 * duration / 2])
        s = time[first : last + 1] - time[first]
        fall = np.outer(s**2, [0, 0, 9.81 / 2])
        position[first : last + 1] = start[begin] + np.outer(s, velocity) - fall
    kind = ["impact", "pass", "pass", "impact", "pass", "impact"]
    sigma_time, sigma_position = np.full(6, 0.002), np.array([0.02, 0.01, 0.02, 0.02, 0.01, 0.02])
    propagated, drawn = propagated_and_drawn(time, position, kind, sigma_time, sigma_position)
    check(propagated, drawn)
    fewer, _ = propagated_and_drawn(TIME, POSITION, ["impact"] * 3, sigma_time[[0, 3, 5]], sigma_position[[0, 3, 5]])
    assert propagated["r"] < fewer["r"]


def test_what_is_undefined_or_unknown_has_no_standard_deviation():
    sigma = np.array([np.nan, 0.02, 0.02, 0.02])
    position = np.array([(0, 0, 0), (6, 0.5, -6.5), (13.0, 2.2, -13), (19, 3, -20)])
    picks = make_picks(["a"] * 4, [0, 0.9, 1.7, 2.5], position, normal=np.tile(NORMAL, (4, 1)), sigma_position_m=sigma)
    impacts = reconstruct(picks).impacts
    assert np.isnan(impacts.sigma["v1"][0]).all()
    assert np.isnan(impacts.sigma["r"]).tolist() == [True, True, False, True]
    assert np.isnan(impacts.sigma["v2"][:, 0]).tolist() == [True, False, False, True]
    assert reconstruct(make_picks(["a"] * 4, [0, 0.9, 1.7, 2.5], position)).impacts.sigma == {}


def test_a_departing_impact_has_none_either():
    position = [(0, 0, 0), (4, 0, 2.77375), (8, 0, 3.095)]
    picks = make_picks(["a"] * 3, [0, 0.5, 1], position, normal=[(0, 0, 1)] * 3, sigma_position_m=[0.1] * 3)
    impacts = reconstruct(picks).impacts
    assert np.isnan(impacts.sigma["rn"][1])
    assert impacts.sigma["v1"][1] == pytest.approx(np.full(3, 0.1 * np.sqrt(2) / 0.5))
