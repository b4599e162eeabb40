# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether groups of impacts differ: SciPy's test, every arrangement listed, tables with and without a difference."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import scipy.stats
from rockfall.core.analysis.group_statistics import (
    group_by_number,
    group_by_text,
    group_statistics,
)
from rockfall.core.analysis.group_tests import group_tests, what_to_exchange
from rockfall.core.analysis.statistics import impact_statistics
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct


def bounces(trajectories: int, each: int, seed: int = 5) -> Impacts:
    """Impacts down a slope of 35°, `each` of a trajectory with all coefficients."""
    rng = np.random.default_rng(seed)
    n = trajectories * (each + 2)
    step = rng.uniform(0.4, 1.2, n)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(n, 3)) * 0.2, axis=0)
    names = np.repeat([f"T{i:03d}" for i in range(trajectories)], each + 2)
    return reconstruct(make_picks(names, np.cumsum(step), position, normal=np.tile([0.57, 0, 0.82], (n, 1)))).impacts


def kruskal(values: np.ndarray, number: np.ndarray) -> float:
    return float(scipy.stats.kruskal(*(values[number == i] for i in np.unique(number))).statistic)


def test_statistic_and_chi_square_against_scipy_with_ties() -> None:
    rng = np.random.default_rng(1)
    number = rng.integers(0, 4, 120)
    values = np.round(rng.normal(size=120) + 0.3 * number, 1)
    found = group_tests({"x": values}, number, list("abcd"), np.arange(120) % 30).tests[0]
    reference = scipy.stats.kruskal(*(values[number == i] for i in range(4)))
    assert found.statistic == pytest.approx(reference.statistic)
    assert found.p_independent == pytest.approx(reference.pvalue)
    assert found.effect == pytest.approx(reference.statistic / 119)


def test_whole_trajectories_against_all_their_arrangements() -> None:
    rng = np.random.default_rng(2)
    trajectory = np.repeat(np.arange(7), [3, 5, 2, 4, 3, 6, 1])
    group = np.array([0, 0, 0, 1, 1, 2, 2])
    values = rng.normal(size=24) + 0.8 * (group[trajectory] == 1)
    found = group_tests({"x": values}, group[trajectory], list("abc"), trajectory)
    assert found.exchanged == "trajectories"
    every = [kruskal(values, np.array(one)[trajectory]) for one in set(permutations(group.tolist()))]
    assert len(every) == 210
    exact = np.mean(np.array(every) >= kruskal(values, group[trajectory]) - 1e-9)
    assert found.tests[0].p == pytest.approx(exact, abs=4 * np.sqrt(exact * (1 - exact) / 9999) + 1e-4)


def test_within_trajectories_against_all_arrangements() -> None:
    rng = np.random.default_rng(3)
    trajectory = np.repeat([0, 1], [4, 4])
    group = np.array([0, 0, 1, 1, 0, 1, 1, 1])
    values = rng.normal(size=8) + 3.0 * trajectory + group
    found = group_tests({"x": values}, group, ["a", "b"], trajectory)
    assert found.exchanged == "within"
    first, second = set(permutations(group[:4].tolist())), set(permutations(group[4:].tolist()))
    every = [kruskal(values, np.array(one + other)) for one in first for other in second]
    assert len(every) == 24
    exact = np.mean(np.array(every) >= kruskal(values, group) - 1e-9)
    assert found.tests[0].p == pytest.approx(exact, abs=4 * np.sqrt(exact * (1 - exact) / 9999) + 1e-4)


def test_trajectories_that_differ_do_not_make_groups_differ() -> None:
    """16 trajectories with values of their own, in two groups by chance: 5 % of the tables may be called different."""
    rng = np.random.default_rng(4)
    trajectory = np.repeat(np.arange(16), 6)
    group = np.arange(16) % 2
    called, if_independent = 0, 0
    for i in range(400):
        values = rng.normal(size=16)[trajectory] + 0.3 * rng.normal(size=96)
        test = group_tests({"x": values}, group[trajectory], ["a", "b"], trajectory, seed=i).tests[0]
        called += test.p < 0.05
        if_independent += test.p_independent < 0.05
    assert called / 400 == pytest.approx(0.05, abs=0.033)
    assert if_independent / 400 > 0.3


def test_a_shift_is_found_and_belongs_to_its_pair() -> None:
    rng = np.random.default_rng(6)
    trajectory = np.repeat(np.arange(30), 5)
    group = (np.arange(30) % 3)[trajectory]
    values = {"shifted": rng.normal(size=150) + 1.2 * (group == 2), "same": rng.normal(size=150)}
    found = group_tests(values, group, ["a", "b", "c"], trajectory)
    assert [test.differs for test in found.tests] == [True, False]
    assert {(pair.first, pair.second) for pair in found.pairs if pair.differs} == {("a", "c"), ("b", "c")}
    assert all(pair.p_holm >= found.tests[1].p_holm for pair in found.pairs[3:])
    for pair in found.pairs[:3]:
        one, other = (values["shifted"][group == "abc".index(name)] for name in (pair.first, pair.second))
        delta = np.sign(other[:, None] - one).mean()
        assert pair.effect == pytest.approx(delta)
        assert (pair.median_first, pair.median_second) == (np.median(one), np.median(other))
    p = [pair.p for pair in found.pairs[:3]]
    floor = found.tests[0].p_holm
    assert [pair.p_holm for pair in found.pairs[:3]] == pytest.approx([max(one, floor) for one in holm_by_hand(p)])


def holm_by_hand(p: list[float]) -> list[float]:
    """Step-down by its definition."""
    order, worst, corrected = sorted(range(len(p)), key=lambda i: p[i]), 0.0, [0.0] * len(p)
    for place, i in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - place) * p[i]))
        corrected[i] = worst
    return corrected


def test_what_changes_places() -> None:
    trajectory = np.repeat([0, 1, 2, 3], 3)
    assert what_to_exchange(np.repeat([0, 0, 1, 1], 3), trajectory) == "trajectories"
    assert what_to_exchange(np.tile([0, 1, 1], 4), trajectory) == "within"
    assert what_to_exchange(trajectory, trajectory) == "impacts"


def test_too_few_trajectories_are_no_probability() -> None:
    rng = np.random.default_rng(8)
    trajectory = np.repeat(np.arange(6), 20)
    group = (trajectory < 3).astype(int)
    values = rng.normal(size=120) + 5.0 * group
    found = group_tests({"x": values}, group, ["a", "b"], trajectory)
    assert np.isnan(found.tests[0].p)  # 20 arrangements, two by two alike: no p below 0.1
    assert not found.tests[0].differs
    assert found.tests[0].p_independent < 1e-6
    same = group_tests({"x": np.ones(120)}, trajectory % 2, ["a", "b"], np.arange(120) % 40)
    assert np.isnan(same.tests[0].statistic)


def test_groups_of_a_table() -> None:
    impacts = bounces(6, 5)
    soil = np.where(np.arange(len(impacts)) % 2 == 0, "scree", "rock")
    soil[:7] = ""
    found = group_statistics(impacts, group_by_text("soil", soil))
    assert list(found.groups) == [soil[7], soil[8]]
    assert found.undefined == 7
    assert found.groups["rock"] == impact_statistics(impacts, soil == "rock")
    assert found.groups["scree"] != found.groups["rock"]
    assert found.tests.exchanged == "within"
    assert "7 impacts have no soil" in found.remarks()[0].text


def test_what_cannot_be_told_is_said_first() -> None:
    impacts = bounces(4, 5)
    one = group_statistics(impacts, group_by_text("soil", np.full(len(impacts), "all"))).remarks()
    assert (one[0].severity, one[0].text[:36]) == ("problem", "Fewer than two groups have 3 impacts")
    names = np.where(impacts.trajectory < "T002", "a", "b")
    few = group_statistics(impacts, group_by_text("block", names)).remarks()
    assert few[0].severity == "problem"
    assert "too few trajectories" in few[0].text
    names = np.where(np.arange(len(impacts)) == 3, "alone", names)
    left = group_statistics(impacts, group_by_text("block", names))
    assert left.tests.left_out == ("alone",)
    assert next(remark.text for remark in left.remarks() if "fewer than 3" in remark.text).endswith("alone.")


def test_a_difference_that_is_the_angles_is_called_so() -> None:
    """Two grounds with the same law of R_N and other angles."""
    impacts = bounces(40, 6, seed=9)
    rng = np.random.default_rng(10)
    steep = impacts.trajectory < "T020"
    theta1_deg = np.where(steep, rng.uniform(25, 50, steep.size), rng.uniform(8, 20, steep.size))
    rn = 15.0 / theta1_deg * np.exp(0.2 * rng.normal(size=steep.size))
    shaped = replace(
        impacts,
        theta1=np.where(np.isfinite(impacts.theta1), np.radians(theta1_deg), np.nan),
        rn=np.where(np.isfinite(impacts.rn), rn, np.nan),
    )
    found = group_statistics(shaped, group_by_text("place", np.where(steep, "cliff", "chute")))
    differs = {test.quantity: test.differs for test in found.tests.tests}
    assert (differs["rn"], differs["theta1_deg"], differs["rn_over_law"]) == (True, True, False)
    assert "at the same angle no difference" in "".join(map(str, found.remarks()))


def test_groups_of_texts_and_of_numbers() -> None:
    texts = group_by_text("soil", np.array(["b", "", "a", "b", "a"]))
    assert texts.names == ("b", "a")
    assert texts.number.tolist() == [0, -1, 1, 0, 1]
    each = group_by_number("diameter_m", np.array([0.4, np.nan, 0.35, 0.4]))
    assert each.names == ("0.35", "0.4")
    assert each.number.tolist() == [1, -1, 0, 1]
    values = np.r_[np.arange(1.0, 100.0), np.nan]
    cut = group_by_number("theta1_deg", values, 3)
    assert np.bincount(cut.number[:-1]).tolist() == [33, 33, 33]
    assert cut.number[-1] == -1
    assert cut.names == ("1–33.7", "33.7–66.3", "66.3–99")
    assert group_by_number("x", np.full(9, 2.0), 4).names == ("2–2",)
    assert group_by_number("x", np.full(9, np.nan), 4).names == ()


def test_very_many_groups() -> None:
    impacts = bounces(3, 1000)
    labels = np.array([f"g{i % 1600}" for i in range(len(impacts))])
    found = group_statistics(impacts, group_by_text("cell", labels))
    assert len(found.groups) == 1600
    assert found.tests.pairs == ()
    assert len(found.tests.left_out) == 1600
    assert sum(one.impacts for one in found.groups.values()) == len(impacts)
