# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of impacts: analytic tables, and scipy and numpy as independent implementations."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from rockfall.core.analysis.clouds import measured_target
from rockfall.core.analysis.courses import find_courses
from rockfall.core.analysis.line_fits import (
    interval_by_cluster,
    line,
    line_through_origin,
    power_interval_by_cluster,
    power_law,
)
from rockfall.core.analysis.measured_rebounds import measured_rebounds
from rockfall.core.analysis.robust_slope import theil_sen
from rockfall.core.analysis.statistics import AngleClass, ImpactStatistics, impact_statistics
from rockfall.core.exchange.selection import group_medians
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.remarks import Remark

RNG = np.random.default_rng(7)


def impacts_with(theta1_deg: np.ndarray, rn: np.ndarray, rt: np.ndarray, speed: np.ndarray) -> Impacts:
    """A table of impacts on level ground with given angles and coefficients, through the reconstruction itself."""
    angle = np.radians(theta1_deg)
    v1 = np.stack([speed * np.cos(angle), 0.0 * angle, -speed * np.sin(angle)], axis=1)
    v2 = np.stack([rt * v1[:, 0], 0.0 * angle, -rn * v1[:, 2]], axis=1)
    drop, seconds = np.array([0.0, 0.0, 9.81]), 0.4
    names, times, places = [], [], []
    for i, (before, after) in enumerate(zip(v1, v2, strict=True)):
        names += [f"T{i:03d}"] * 3
        times += [0.0, seconds, 2 * seconds]
        # one flight that arrives with v1, one that leaves with v2
        places += [-(before * seconds + drop * seconds**2 / 2), np.zeros(3), after * seconds - drop * seconds**2 / 2]
    normal = np.tile([0.0, 0.0, 1.0], (len(names), 1))
    return reconstruct(make_picks(names, times, np.array(places), normal=normal)).impacts


@pytest.fixture
def exact() -> ImpactStatistics:
    theta1_deg = np.linspace(6.0, 60.0, 40)
    speed = np.linspace(4.0, 18.0, 40)
    return impact_statistics(impacts_with(theta1_deg, 12.0 * theta1_deg**-1.1, np.full(40, 0.66), speed))


def test_exact_laws_are_found_exactly(exact: ImpactStatistics) -> None:
    assert (exact.impacts, exact.used) == (120, 40)
    assert exact.rt.slope == pytest.approx(0.66, abs=1e-9)
    assert exact.rt.r2 == pytest.approx(1.0)
    assert exact.rt_free.intercept == pytest.approx(0.0, abs=1e-8)
    assert exact.rn_angle.slope == pytest.approx(-1.1, abs=1e-8)
    assert exact.rn_factor == pytest.approx(12.0, rel=1e-8)


def test_counts_and_quantiles(exact: ImpactStatistics) -> None:
    theta1_deg = np.linspace(6.0, 60.0, 40)
    rn = 12.0 * theta1_deg**-1.1
    assert exact.rn_above_one == (rn > 1).sum() == exact.rn_above_one_grazing
    assert exact.grazing == (theta1_deg < 20).sum()
    spread = exact.spreads["theta1_deg"]
    assert (spread.least, spread.greatest) == (pytest.approx(6.0), pytest.approx(60.0))
    assert spread.median == pytest.approx(33.0)
    assert spread.low == pytest.approx(np.quantile(theta1_deg, 0.1))
    assert exact.spreads["rt"].median == pytest.approx(0.66)


def test_free_line_against_scipy() -> None:
    x = RNG.uniform(0, 90, 103)
    y = 1.0 - 0.006 * x + 0.1 * RNG.standard_normal(103)
    mine, reference = line(x, y), scipy.stats.linregress(x, y)
    assert mine.slope == pytest.approx(reference.slope, rel=1e-10)
    assert mine.intercept == pytest.approx(reference.intercept, rel=1e-10)
    assert mine.r2 == pytest.approx(reference.rvalue**2, rel=1e-9)
    reach = scipy.stats.t.ppf(0.975, 101) * reference.stderr
    assert (mine.low, mine.high) == pytest.approx((reference.slope - reach, reference.slope + reach))


def test_line_through_the_origin_against_numpy_and_by_hand() -> None:
    x = RNG.uniform(2, 18, 103)
    y = 0.66 * x + 2.0 * RNG.standard_normal(103)
    mine = line_through_origin(x, y)
    slope, squares, _, _ = np.linalg.lstsq(x[:, None], y, rcond=None)
    assert mine.slope == pytest.approx(slope[0], rel=1e-12)
    assert mine.r2 == pytest.approx(1 - squares[0] / np.sum((y - y.mean()) ** 2), rel=1e-10)

    # x = 1, 2, 3 and y = 1, 1, 2: slope 9/14, residual 6 − 81/14, centred sum 2/3
    small = line_through_origin(np.array([1.0, 2.0, 3.0]), np.array([1.0, 1.0, 2.0]))
    assert small.slope == pytest.approx(9 / 14)
    assert small.r2 == pytest.approx(1 - (6 - 81 / 14) / (2 / 3))
    assert (small.high - small.low) / 2 == pytest.approx(4.302652729911275 * np.sqrt((6 - 81 / 14) / 2 / 14))


def test_the_interval_holds_the_true_slope_as_often_as_it_says() -> None:
    x = np.linspace(2, 18, 30)
    held = 0
    for _ in range(2000):
        fit = line_through_origin(x, 0.66 * x + RNG.standard_normal(30))
        held += fit.low <= 0.66 <= fit.high
    assert held / 2000 == pytest.approx(0.95, abs=0.015)


@pytest.mark.parametrize("origin", [True, False])
def test_interval_by_cluster_against_fits_without_each(origin: bool) -> None:
    cluster = RNG.integers(0, 7, 90)
    x = RNG.uniform(2, 18, 90)
    y = 0.6 * x + RNG.standard_normal(7)[cluster] * x + 5.0 * (not origin) + 0.3 * RNG.standard_normal(90)

    def slope(keep: np.ndarray) -> float:
        if origin:
            return float(np.linalg.lstsq(x[keep, None], y[keep])[0][0])
        return float(np.polyfit(x[keep], y[keep], 1)[0])

    full = slope(np.full(90, True))
    error = np.sqrt(6 / 7 * sum((slope(cluster != k) - full) ** 2 for k in range(7)))
    reach = scipy.stats.t.ppf(0.975, 6) * error
    found = interval_by_cluster(x, y, cluster, origin=origin)
    assert found == pytest.approx((full - reach, full + reach), rel=1e-9)
    assert np.isnan(interval_by_cluster(x, y, np.zeros(90, dtype=int), origin=origin)).all()


def test_the_interval_by_trajectory_holds_where_students_does_not() -> None:
    """Ten trajectories of eight impacts, each trajectory with an R_T of its own: what Student's interval denies."""
    cluster = np.repeat(np.arange(10), 8)
    held, by_student = 0, 0
    for _ in range(1500):
        x = RNG.uniform(4, 18, 80)
        y = (0.6 + 0.1 * RNG.standard_normal(10)[cluster]) * x + 0.3 * RNG.standard_normal(80)
        low, high = interval_by_cluster(x, y, cluster, origin=True)
        fit = line_through_origin(x, y)
        held += low <= 0.6 <= high
        by_student += fit.low <= 0.6 <= fit.high
    assert held / 1500 == pytest.approx(0.95, abs=0.02)
    assert by_student / 1500 < 0.75


def test_the_exponents_interval_by_trajectory_holds_where_the_usual_does_not() -> None:
    """Twelve trajectories of eight impacts, each at angles and with a ground of its own, to a law that is known."""
    rng = np.random.default_rng(3)
    cluster = np.repeat(np.arange(12), 8)
    held, usual = 0, 0
    for _ in range(400):
        angle = np.exp(3.0 + 0.6 * rng.standard_normal(12)[cluster] + 0.3 * rng.standard_normal(96))
        ground = 0.5 * rng.standard_normal(12)[cluster] + 0.3 * rng.standard_t(3, 96)
        rn = 12.0 * angle**-1.08 * np.exp(ground)
        low, high = power_interval_by_cluster(angle, rn, cluster)
        fit = power_law(angle, rn)
        held += low <= -1.08 <= high
        usual += fit.low <= -1.08 <= fit.high
    assert held / 400 == pytest.approx(0.95, abs=0.03)
    assert usual / 400 < 0.8


@pytest.mark.parametrize("n", [300, 3000])
def test_with_a_cluster_for_each_point_the_interval_is_scipys(n: int) -> None:
    """Both with few points, whose slopes are listed, and with many, of which some are compared."""
    rng = np.random.default_rng(n)
    x = rng.uniform(6, 60, n)
    y = 12.0 / x * np.exp(0.4 * rng.standard_normal(n))
    slope, _, low, high = scipy.stats.theilslopes(np.log(y), np.log(x), 0.95)
    found = power_interval_by_cluster(x, y, np.arange(n))
    assert found == pytest.approx((low, high), abs=0.04 * (high - low))
    assert found[0] < slope < found[1]
    assert np.isnan(power_interval_by_cluster(x, y, np.zeros(n, dtype=int))).all()
    assert np.isnan(power_interval_by_cluster(np.full(n, 9.0), y, np.arange(n))).all()


def test_power_law_is_not_moved_by_the_papers_outliers() -> None:
    theta1_deg = np.concatenate([RNG.uniform(6, 60, 100), [0.3, 1.1, 4.3]])
    rn = 12.0 * theta1_deg**-1.1 * np.exp(0.15 * RNG.standard_normal(103))
    rn[-3:] = 24.4, 8.1, 5.1
    fit = power_law(theta1_deg, rn)
    assert fit.slope == pytest.approx(-1.1, abs=0.1)
    assert fit.low < -1.1 < fit.high
    reference = scipy.stats.theilslopes(np.log(rn), np.log(theta1_deg), 0.95)
    assert (fit.slope, fit.low, fit.high) == pytest.approx((reference[0], reference[2], reference[3]))


def test_classes_of_the_incident_angle_and_their_intervals() -> None:
    theta1_deg = np.array([4.0, 10.0, 12.0, 19.9, 20.0, 35.0, 36.0, 88.0])
    rn = np.array([3.0, 1.2, 0.9, 1.1, 1.0, 0.4, 1.3, 0.2])
    found = impact_statistics(impacts_with(theta1_deg, rn, np.full(8, 0.6), np.full(8, 9.0)))
    assert [(one.n, one.above_one) for one in found.classes] == [
        (1, 1), (3, 2), (1, 0), (2, 1), (0, 0), (0, 0), (0, 0), (0, 0), (1, 0)
    ]  # fmt: skip
    assert (found.rn_above_one, found.grazing, found.rn_above_one_grazing) == (4, 4, 3)
    for n, above in ((8, 8), (41, 19), (10, 0), (1, 1)):
        reference = scipy.stats.binomtest(above, n).proportion_ci(0.95, "wilson")
        assert AngleClass(0, 10, n, above).interval == pytest.approx((reference.low, reference.high), abs=1e-12)
    assert np.isnan(AngleClass(0, 10, 0, 0).interval).all()


def test_the_same_impacts_count_in_statistics_comparisons_fits_medians_and_draws() -> None:
    """Discarded ones, and those with wrong velocities, nowhere; doubtful ones, and those beside a gap, everywhere."""
    impacts = impacts_with(np.linspace(10, 40, 24), np.full(24, 0.8), np.full(24, 0.6), np.full(24, 9.0))
    marks = {name: mask.copy() for name, mask in impacts.flags.items()}
    row = np.flatnonzero(impacts.complete)
    marks["discarded"][row[:3]], marks["doubtful"][row[2:5]], marks["gap"][row[5]] = True, True, True
    marks["into_ground"][row[6]], marks["below_terrain"][row[7]] = True, True
    marked, left = replace(impacts, flags=marks), np.delete(row, [0, 1, 2, 6, 7])
    found = impact_statistics(marked)
    assert found.used == 19
    assert found.doubts == {"doubtful": 2}
    courses = find_courses(marked)
    assert set(courses.row) & set(row) == set(left)
    target = measured_target(marked, courses)
    assert set(courses.row[target.counted]) == set(left)
    np.testing.assert_allclose(np.sort(measured_rebounds(marked).rn), np.sort(impacts.rn[left]))
    (group,) = group_medians(marked, ["site"])
    assert group["median_theta1_deg"] == pytest.approx(
        np.nanmedian(np.degrees(np.delete(impacts.theta1, row[[0, 1, 2, 6, 7]])))
    )
    warning = found.remarks()[0]
    assert (warning.severity, warning.text) == ("warning", "Flagged among the 19 impacts used: doubtful 2.")


@pytest.mark.parametrize(
    ("exponent", "said"),
    [(-1.05, "hyperbolic, as published"), (-0.3, "more slowly than"), (-2.0, "more steeply"), (0.4, "no clear fall")],
)
def test_the_fall_of_rn_is_called_what_it_is(exponent: float, said: str) -> None:
    theta1_deg = np.linspace(5.0, 60.0, 30)
    rn = theta1_deg**exponent
    found = impact_statistics(impacts_with(theta1_deg, rn, np.full(30, 0.6), np.full(30, 9.0)))
    texts = {remark.about: remark.text for remark in found.remarks()}
    assert said in texts["rn"]


def test_no_trend_with_the_deviation_is_said() -> None:
    rng = np.random.default_rng(12)
    theta1_deg = rng.uniform(10, 50, 40)
    r = rng.uniform(0.3, 0.9, 40)
    noise = impact_statistics(impacts_with(theta1_deg, r, r, np.full(40, 9.0)))
    (text,) = (remark.text for remark in noise.remarks() if remark.about == "r")
    assert noise.r_deviation.low < 0 < noise.r_deviation.high
    assert text.startswith("R shows no clear trend with the deviation")


def test_what_is_the_same_everywhere_has_no_r2_and_never_the_word_nan() -> None:
    theta1_deg = np.linspace(10.0, 50.0, 30)
    speed = 6.0 / np.cos(np.radians(theta1_deg))
    same = impact_statistics(impacts_with(theta1_deg, np.full(30, 0.5), np.full(30, 0.5), speed))
    texts = {remark.about: remark.text for remark in same.remarks()}
    assert "no R², all values are the same: slope of |v_T2| on |v_T1|" in texts["rt"]
    assert "at 0° (no R², all values are the same)" in texts["r"]
    assert not any("nan" in text for text in texts.values())


def test_rows_and_sentences(exact: ImpactStatistics) -> None:
    rows = exact.as_rows()
    names = [row[0] for row in rows]
    assert len(set(names)) == len(names)
    values = {row[0]: row[1] for row in rows}
    assert values["rt_slope"] == pytest.approx(0.66)
    assert values["rn_angle_exponent"] == pytest.approx(-1.1)
    assert values["theta1_median"] == pytest.approx(33.0)
    texts = {remark.about: remark.text for remark in exact.remarks()}
    assert texts["impacts"].startswith("40 of 120 impacts have all coefficients (incident speed ")
    assert texts["rt"].startswith("R_T = 0.660 (0.660–0.660; 0.660–0.660 if the impacts of a trajectory depend on")
    assert "R² 1.000: slope of |v_T2| on |v_T1| through the origin. " in texts["rt"]
    assert texts["rt"].endswith("Published: 0.66, R² 0.31.")
    assert "·θ1^−1.10 (θ1 in degrees; exponent −1.10 to −1.10; −1.10 to −1.10 if the impacts of a " in texts["rn"]
    assert "depend on each other): hyperbolic, as published. R_N > 1 at " in texts["rn"]
    assert texts["r"].startswith("R falls by ")
    assert {remark.severity for remark in exact.remarks()} == {"note"}


def test_too_few_impacts_give_no_numbers_and_no_warnings() -> None:
    few = impact_statistics(impacts_with(np.array([20.0]), np.array([0.8]), np.array([0.7]), np.array([9.0])))
    assert few.used == 1
    assert np.isnan(few.rt.slope)
    text = "1 of 3 impacts have all coefficients: too few for statistics."
    assert few.remarks() == [Remark(text, "problem", "impacts")]
    same = line(np.ones(5), np.arange(5.0))
    assert np.isnan(same.slope)
    assert np.isnan(power_law(np.full(4, 10.0), np.ones(4)).slope)
    nearly = 10.0 + 1e-15 * np.array([0.0, 2.0, 0.0, 2.0])
    assert np.ptp(nearly) > 0.0
    assert np.isnan(power_law(nearly, nearly).slope)


def test_the_robust_slope_of_mostly_equal_points_is_not_known() -> None:
    x, y = np.array([1.0, 1.0, 1.0, 1.0, 2.0]), np.array([5.0, 5.0, 5.0, 5.0, 8.0])
    slope, _, low, high = theil_sen(x, y, 0.95)
    assert slope == low == high == 3.0  # all pairs that have a slope have this one
    slope, _, low, high = theil_sen(x, np.array([5.0, 5.0, 5.0, 6.0, 8.0]), 0.95)
    assert (low, high) == (2.0, 3.0)
    assert slope == 3.0


@pytest.mark.parametrize("case", ["scattered", "few abscissae", "few abscissae and ordinates", "a law", "two clusters"])
def test_the_robust_slope_of_many_points_is_that_of_all_pairs(case) -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=1500)
    y = 2 * x + rng.standard_t(1.5, size=1500)
    if case.startswith("few"):
        x, y = np.round(x, 1), np.round(y, 0 if case.endswith("ordinates") else 9)
    if case == "a law":
        y = 3.0 - 2.0 * x
    if case == "two clusters":
        x = np.r_[np.zeros(1490), np.ones(10)]
    reference = scipy.stats.theilslopes(y, x, 0.95)
    half = np.subtract(*np.quantile(y, [0.75, 0.25])) / np.std(x)
    np.testing.assert_allclose(theil_sen(x, y, 0.95), reference, atol=1e-4 * half)
    assert np.isnan(theil_sen(x, y, 0.95, interval=False)[2:]).all()
