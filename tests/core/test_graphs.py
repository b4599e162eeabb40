# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs as data: points and links, limits and what lies beyond, what is under the pointer, selections, curves."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.curves import PAIRS, fit_curve, number, trend_of
from rockfall.core.analysis.graphs import (
    PAPER_GRAPHS,
    GraphSpec,
    axis_limits,
    in_box,
    make_graph,
    make_sheet,
    nearest,
)
from rockfall.core.analysis.variables import VARIABLES, measured_values
from rockfall.core.errors import InputError
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

BY_NAME = {spec.name: spec for spec in PAPER_GRAPHS}


@pytest.fixture(scope="module")
def impacts() -> Impacts:
    """Impacts down a slope of 35°, one of them at R_N = 24.4 as in the paper's list."""
    rng = np.random.default_rng(5)
    step = rng.uniform(0.4, 1.2, 16)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(16, 3)) * 0.3, axis=0)
    normal = np.tile([0.57, 0, 0.82], (16, 1))
    found = reconstruct(make_picks(np.repeat(["a", "b"], 8), np.cumsum(step), position, normal=normal)).impacts
    rn = found.rn.copy()
    rn[3] = 24.4
    return replace(found, rn=rn)


@pytest.fixture(scope="module")
def predictions(impacts):
    return compare(impacts, replicates=2, seed=1)


def test_the_four_graphs_of_the_paper() -> None:
    assert [(spec.x, spec.y) for spec in PAPER_GRAPHS] == [
        ("theta1_deg", "rn"),
        ("vn1_mps", "rn"),
        ("vt1_mps", "vt2_mps"),
        ("theta_dev_deg", "r"),
    ]
    assert BY_NAME["rn_theta1"].y_limits == BY_NAME["rn_vn1"].y_limits == (0.0, 5.0)


def test_what_the_axis_cuts_off_is_listed(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["rn_theta1"], predictions, "azimi_desvarreux_1977")
    assert [(point.row, point.series, point.y) for point in graph.beyond] == [(3, "measured", 24.4)]
    assert graph.beyond[0].x == pytest.approx(np.degrees(impacts.theta1[3]))
    free = make_graph(impacts, replace(BY_NAME["rn_theta1"], y_limits=None), predictions, "azimi_desvarreux_1977")
    assert free.beyond == ()
    assert free.y_limits[1] >= 24.4


def test_links_join_the_two_points_of_an_impact(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["r_theta_dev"], predictions, "noel_2017", run=2)
    rows = graph.row[graph.linked]
    which = predictions.index("noel_2017")
    np.testing.assert_allclose(graph.links[:, 0, 1], impacts.r[rows])
    np.testing.assert_allclose(graph.links[:, 0, 0], np.degrees(impacts.theta_dev[rows]))
    np.testing.assert_allclose(graph.links[:, 1, 1], predictions.r[which, 2][graph.linked])
    # first and last impacts have no restitution: no measured point, no link
    assert set(rows) == set(np.flatnonzero(np.isfinite(impacts.r)))


def test_what_a_model_does_not_change_is_the_measured_value(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["rn_vn1"], predictions, "wyllie_2014")
    np.testing.assert_array_equal(graph.measured[:, 0], graph.modelled[:, 0])


@pytest.mark.parametrize("name", VARIABLES)
def test_any_variable_against_any_other(impacts, predictions, name) -> None:
    graph = make_graph(impacts, GraphSpec("any", name, "v2_mps"), predictions, "stevens_1998")
    np.testing.assert_array_equal(graph.measured[:, 0], measured_values(impacts, predictions.row, name))
    assert graph.x_limits[0] < graph.x_limits[1]


def test_the_measured_impacts_alone(impacts) -> None:
    graph = make_graph(impacts, BY_NAME["vt2_vt1"])
    assert graph.row.size == len(impacts)
    assert graph.links.shape == (0, 2, 2)
    assert graph.modelled_curve is None
    known = np.isfinite(graph.measured).all(axis=1)
    x, y = graph.measured[known].T
    assert graph.measured_curve.fit.slope == pytest.approx(np.linalg.lstsq(x[:, None], y)[0][0])
    np.testing.assert_allclose(graph.measured_curve.y, graph.measured_curve.fit.slope * graph.measured_curve.x)


def test_the_nearest_point_in_distances_along_the_axes(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["vt2_vt1"], predictions, "pfeiffer_bowen_1989")
    i = int(np.flatnonzero(graph.linked)[2])
    x, y = graph.measured[i]
    hit = nearest(graph, x, y)
    assert (hit.row, hit.series, hit.distance) == (graph.row[i], "measured", 0.0)
    width, height = np.ptp(graph.x_limits), np.ptp(graph.y_limits)
    hit = nearest(graph, x + 0.001 * width, y + 0.002 * height)
    assert hit.row == graph.row[i]
    assert hit.distance == pytest.approx(np.hypot(0.001, 0.002))
    assert nearest(graph, graph.x_limits[0], graph.y_limits[1]) is None
    x, y = graph.modelled[i]
    assert (nearest(graph, x, y).row, nearest(graph, x, y).series) == (graph.row[i], "model")


def test_what_is_cut_off_cannot_be_hit_or_selected(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["rn_theta1"], predictions, "azimi_desvarreux_1977")
    assert nearest(graph, float(np.degrees(impacts.theta1[3])), 24.4) is None
    angle = float(np.degrees(impacts.theta1[3]))
    assert 3 not in in_box(graph, (angle - 1, angle + 1), (20.0, 30.0))


def test_a_selection_is_rows_of_the_table(impacts, predictions) -> None:
    graph = make_graph(impacts, BY_NAME["r_theta_dev"], predictions, "azimi_desvarreux_1977")
    everything = in_box(graph, graph.x_limits, graph.y_limits)
    assert everything == set(graph.row[np.isfinite(graph.modelled[:, 0]) | np.isfinite(graph.measured[:, 0])].tolist())
    i = int(np.flatnonzero(graph.linked)[0])
    (x, y), tiny = graph.measured[i], 1e-6
    assert in_box(graph, (x + tiny, x - tiny), (y - tiny, y + tiny)) == {int(graph.row[i])}


def test_logarithmic_axes(impacts, predictions) -> None:
    spec = GraphSpec("log", "theta1_deg", "rn", x_log=True, y_log=True)
    graph = make_graph(impacts, spec, predictions, "wyllie_2014")
    assert graph.y_limits[0] > 0
    place = graph.placed(np.array([[np.sqrt(np.prod(graph.x_limits)), graph.y_limits[1]], [-1.0, 1.0]]))
    np.testing.assert_allclose(place[0], [0.5, 1.0])
    assert np.isnan(place[1, 0])


def test_the_sheet_has_one_scale_per_column(impacts, predictions) -> None:
    sheet = make_sheet(impacts, predictions)
    assert (len(sheet), {len(row) for row in sheet}) == (6, {4})
    assert [row[0].model for row in sheet] == list(predictions.models)
    assert {graph.run for row in sheet for graph in row} == {1}
    for column in zip(*sheet, strict=True):
        assert len({(graph.x_limits, graph.y_limits) for graph in column}) == 1
        points = np.concatenate([graph.modelled for graph in column])
        seen = np.isfinite(points).all(axis=1)
        if column[0].spec.y_limits is None:
            assert column[0].inside(points[seen]).all()


@pytest.mark.parametrize(
    ("values", "log", "limits"),
    [
        ([3.0, 21.0], False, (0.0, 22.5)),
        ([0.2, 1.3], False, (0.0, 1.4)),
        ([90.0, 100.0], False, (90.0, 100.0)),
        ([-3.0, 4.0], False, (-3.0, 4.0)),
        ([7.0], False, (6.0, 8.0)),
        ([0.02, 30.0], True, (0.01, 100.0)),
        ([], False, (0.0, 1.0)),
        ([np.nan, np.inf], True, (0.1, 10.0)),
    ],
)
def test_round_limits(values, log, limits) -> None:
    low, high = axis_limits(np.array(values), log)
    known = np.array(values)[np.isfinite(values)]
    assert low < high
    assert (known >= low).all()
    assert (known <= high).all()
    if len(known) != 1:
        assert (low, high) == pytest.approx(limits)


def test_bad_input(impacts, predictions) -> None:
    with pytest.raises(InputError, match="theta1_deg"):
        GraphSpec("wrong", "theta_deg", "rn")
    with pytest.raises(InputError, match="5 to 0"):
        GraphSpec("wrong", "theta1_deg", "rn", y_limits=(5.0, 0.0))
    with pytest.raises(InputError, match="above zero"):
        GraphSpec("wrong", "theta1_deg", "rn", y_limits=(0.0, 5.0), y_log=True)
    with pytest.raises(InputError, match="was not compared"):
        make_graph(impacts, PAPER_GRAPHS[0], predictions, "bourrier_hungr")
    with pytest.raises(InputError, match="There are 2"):
        make_graph(impacts, PAPER_GRAPHS[0], predictions, "noel_2017", run=3)


@pytest.mark.parametrize(
    ("trend", "law", "ends"),
    [
        ("line", lambda x: 1.0 + 2.0 * x, (2.0, 7.0)),
        ("origin", lambda x: 2.0 * x, (1.0, 7.0)),
        ("power", lambda x: 3.0 * x**-1.2, (2.0, 7.0)),
        ("exponential", lambda x: 3.0 * np.exp(0.4 * x), (2.0, 7.0)),
        ("logarithm", lambda x: 3.0 + 2.0 * np.log(x), (2.0, 7.0)),
    ],
)
def test_a_curve_is_that_of_its_points(trend, law, ends):
    """From the least to the greatest of the points, within the axes; a line through the origin from there."""
    x = np.array([2.0, 3.0, 4.5, 7.0])
    curve = fit_curve(trend, np.stack([x, law(x)], axis=1), (1.0, 9.0), (0.0, 100.0))
    np.testing.assert_allclose(curve.y, law(curve.x), rtol=1e-9)
    assert (curve.x[0], curve.x[-1]) == pytest.approx(ends)
    narrow = fit_curve(trend, np.stack([x, law(x)], axis=1), (2.5, 6.0), (0.0, 100.0))
    assert (narrow.x[0], narrow.x[-1]) == pytest.approx((2.5, 6.0))
    low, high = sorted(law(np.array([3.0, 4.0])))
    cut = fit_curve(trend, np.stack([x, law(x)], axis=1), (1.0, 9.0), (low, high))
    assert 0 < cut.x.size < 60
    assert ((cut.x > 2.99) & (cut.x < 4.01)).all()
    assert fit_curve("none", np.stack([x, law(x)], axis=1), (1.0, 9.0), (0.0, 100.0)) is None


def test_any_pair_has_a_fit_that_is_straight_as_drawn() -> None:
    pairs = {(x, y) for x in VARIABLES for y in VARIABLES} - PAIRS.keys()
    for x, y in pairs:
        assert [trend_of(x, y, *log) for log in ((0, 0), (1, 1), (0, 1), (1, 0))] == [
            "line",
            "power",
            "exponential",
            "logarithm",
        ]
    assert trend_of("vt1_mps", "vt2_mps", True, True) == "origin"
    assert GraphSpec("any", "mass_kg", "kinetic2_j", x_log=True, y_log=True).fitted == "power"
    assert GraphSpec("any", "mass_kg", "kinetic2_j", trend="none").fitted == "none"


@pytest.mark.parametrize("trend", ["origin", "line", "power", "exponential", "logarithm"])
def test_a_fit_has_the_numbers_of_scipy(trend) -> None:
    """Of scattered points with ties, and with some that have no place on a logarithmic axis."""
    rng = np.random.default_rng(8)
    x = np.round(rng.uniform(-1.0, 9.0, 300), 1)
    y = np.round(0.5 + 0.3 * np.abs(x) + rng.normal(size=300), 1)
    u, v = x, y
    keep = np.ones(300, dtype=bool)
    if trend in ("power", "logarithm"):
        keep &= x > 0
    if trend in ("power", "exponential"):
        keep &= y > 0
    u = np.log(x[keep]) if trend in ("power", "logarithm") else x[keep]
    v = np.log(y[keep]) if trend in ("power", "exponential") else y[keep]
    if trend == "origin":
        slope, intercept = np.linalg.lstsq(u[:, None], v)[0][0], 0.0
    elif trend == "power":
        slope, intercept = scipy.stats.theilslopes(v, u)[:2]
    else:
        slope, intercept = scipy.stats.linregress(u, v)[:2]
    curve = fit_curve(trend, np.stack([x, y], axis=1), (0.1, 10.0), (0.0, 100.0))
    assert (curve.fit.slope, curve.fit.intercept) == pytest.approx((slope, intercept))
    assert curve.fit.r2 == pytest.approx(1 - np.var(v - intercept - slope * u) / np.var(v), abs=0.02)
    if trend in ("line", "exponential", "logarithm"):
        assert curve.fit.r2 == pytest.approx(scipy.stats.pearsonr(u, v).statistic ** 2)
    assert curve.rank == pytest.approx(scipy.stats.spearmanr(x, y).statistic)
    assert (curve.n, curve.fit.n) == (300, keep.sum())
    said = curve.text("y", "x")
    assert f"R² = {curve.fit.r2:.2f}, ρ = {curve.rank:.2f}, n = {keep.sum()}" in said.replace("−", "-")
    assert "ρ" not in curve.text("y", "x", full=False)


@pytest.mark.parametrize(
    ("trend", "points", "words"),
    [
        ("line", [[1.0, 2.0]], "too few points for a fit, n = 1"),
        ("line", [[1.0, 2.0], [2.0, 2.0]], "too few points for a fit, n = 2"),
        ("line", [[1.0, 2.0], [1.0, 3.0], [1.0, 4.0]], "no fit: all points have one abscissa, n = 3"),
        ("power", [[-1.0, 2.0], [0.0, 3.0], [1.0, 4.0]], "too few points for a fit above zero, ρ = 1.00, n = 3"),
    ],
)
def test_why_there_is_no_fit_is_said(trend, points, words) -> None:
    curve = fit_curve(trend, np.array(points), (0.1, 10.0), (0.0, 10.0))
    assert not curve.is_fitted
    assert curve.x.size == curve.y.size == 0
    assert curve.text("y", "x") == words


def test_a_constant_ordinate_has_a_line_and_no_correlation() -> None:
    points = np.array([[1.0, 2.0], [2.0, 2.0], [4.0, 2.0]])
    assert fit_curve("line", points, (0.0, 5.0), (0.0, 5.0)).text("y", "x") == "y = 2.00, n = 3"
    points = np.stack([np.arange(1.0, 800.0), 0.35 * (1 + 1e-15 * np.arange(799.0) % 3)], axis=1)
    assert fit_curve("power", points, (0.0, 800.0), (0.0, 5.0)).text("y", "x") == "y = 0.350, n = 799"
    assert fit_curve("line", np.empty((0, 2)), (0.0, 5.0), (0.0, 5.0)) is None


def test_numbers_for_people() -> None:
    texts = {0.55: "0.550", -1.034: "−1.03", 123456.0: "1.23·10⁵", 123.0: "123", 4e-5: "4.00·10⁻⁵", np.nan: "–"}
    assert [number(value) for value in texts] == list(texts.values())
