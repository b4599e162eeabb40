# SPDX-License-Identifier: GPL-3.0-or-later
"""Points of graphs by source, and the columns that colour and filter them."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.colouring import (
    MODEL_SHAPES,
    ONE_MODEL,
    colour_by,
    group_colour,
    model_colours,
    model_shape,
)
from rockfall.core.analysis.columns import Filter, column_titles, find_column, passing
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.graph_series import (
    beyond,
    measured_series,
    model_series,
    pair_links,
    usual_limits,
    whole_limits,
)
from rockfall.core.analysis.graphs import GraphSpec
from rockfall.core.analysis.variable_sigma import measured_sigma
from rockfall.core.errors import InputError
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

SPEC = GraphSpec("g", "theta1_deg", "rn")


@pytest.fixture(scope="module")
def impacts() -> Impacts:
    """Two falls of eight impacts, one of them at R_N = 24.4; first and last have no coefficients."""
    rng = np.random.default_rng(5)
    step = rng.uniform(0.4, 1.2, 16)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(16, 3)) * 0.3, axis=0)
    picks = make_picks(
        np.repeat(["a", "b"], 8), np.cumsum(step), position, normal=np.tile([0.57, 0, 0.82], (16, 1)),
        sigma_position_m=np.full(16, 0.1), sigma_time_s=np.full(16, 0.01),
    )  # fmt: skip
    found = reconstruct(picks).impacts
    rn = found.rn.copy()
    rn[3] = 24.4
    extra = {
        "material": np.repeat(["rock", "scree"], 8),
        "phase": np.array(["1", "2"] * 8),
        "hardness": np.array([f"{0.1 * i:.1f}" for i in range(15)] + [""]),
    }
    return replace(found, rn=rn, extra=extra)


def test_points_of_measured_impacts_and_models_are_linked(impacts) -> None:
    predictions = compare(impacts, ["noel_2017"], replicates=2, seed=1)
    kept = np.ones(len(impacts), dtype=bool)
    kept[2] = False
    measured = measured_series(impacts, "theta1_deg", "rn", np.flatnonzero(kept))
    model = model_series(impacts, predictions, "noel_2017", (1, 2), "theta1_deg", "rn", kept)
    assert measured.defined.sum() == 16 - 4 - 1
    assert set(model.row) == set(predictions.row) - {2}
    assert model.row.size == 2 * (predictions.row.size - 1)
    links = pair_links(measured, model)
    both = set(measured.row[measured.defined]) & set(predictions.row)
    assert len(links) == 2 * len(both)
    theta, rn = np.degrees(impacts.theta1), impacts.rn
    for (x0, y0), (x1, y1) in links:
        row = int(np.nanargmin(np.abs(theta - x0) + np.abs(rn - y0)))
        assert x1 == pytest.approx(theta[row]), "the model does not change the incident angle"
        place = predictions.row.tolist().index(row)
        assert min(abs(predictions.rn[0, 1:, place] - y1)) < 1e-12


def test_the_axis_of_normal_restitution_is_cut_where_the_paper_cuts_it(impacts) -> None:
    series = measured_series(impacts, "theta1_deg", "rn", np.arange(16))
    whole = whole_limits([series], (False, False))
    assert whole[1][1] >= 24.4
    limits = usual_limits(SPEC, whole)
    assert limits[1] == (0.0, 5.0)
    assert [int(series.row[i]) for i in beyond(series, *limits)] == [3]
    assert usual_limits(replace(SPEC, y_log=True), whole)[1] == whole[1]
    assert usual_limits(replace(SPEC, y_limits=(1.0, 2.0)), whole)[1] == (1.0, 2.0)
    low = measured_series(impacts, "theta1_deg", "rn", np.array([1, 2]))
    assert usual_limits(SPEC, whole_limits([low], (False, False)))[1][1] <= 5.0


def test_limits_of_nothing() -> None:
    assert whole_limits([], (False, True)) == ((0.0, 1.0), (0.1, 10.0))


def test_columns_of_texts_numbers_and_groups(impacts) -> None:
    assert find_column(impacts, "trajectory").groups == ("a", "b")
    assert find_column(impacts, "material").groups == ("rock", "scree")
    assert find_column(impacts, "phase").groups == ("1", "2"), "two numbers are names of groups"
    assert find_column(impacts, "hardness").numbers[3] == pytest.approx(0.3)
    assert np.isnan(find_column(impacts, "hardness").numbers[15])
    assert find_column(impacts, "rn").numbers[3] == 24.4
    assert {"site", "trajectory", "flags", "material", "diameter_m"} <= set(column_titles([impacts]))
    with pytest.raises(InputError, match="materiel"):
        find_column(impacts, "materiel")


def test_filters_leave_what_has_all_that_they_ask_for(impacts) -> None:
    rock, steep = Filter("material", texts=frozenset({"rock"})), Filter("theta1_deg", low=30.0)
    expected = (np.arange(16) < 8) & (np.degrees(impacts.theta1) >= 30.0)
    assert passing(impacts, [rock, steep]).tolist() == expected.tolist()
    assert passing(impacts, [Filter("rn", high=5.0)]).tolist() == (impacts.rn <= 5.0).tolist()
    assert not passing(impacts, [Filter("no_such_column")]).any()
    assert passing(impacts, [Filter("material")]).all(), "no text is asked for"


def test_colours_by_groups_and_by_scale(impacts) -> None:
    groups = colour_by([find_column(impacts, "material")], dark=True)
    assert [name for name, _ in groups.groups] == ["rock", "scree"]
    assert len({tuple(colour) for colour in groups.colours[0][:8]}) == 1
    assert tuple(groups.colours[0][0]) != tuple(groups.colours[0][8])
    scale = colour_by([find_column(impacts, "time_s")], dark=True)
    assert scale.ends is not None
    assert scale.ends[0] < scale.ends[1]
    assert tuple(scale.colours[0][0]) != tuple(scale.colours[0][-1])
    colours = np.array([group_colour(i, dark=False) for i in range(8)])
    apart = np.linalg.norm(colours[:, None] - colours[None], axis=2) + np.eye(8)
    assert apart.min() > 0.1


def test_one_model_is_red_and_several_have_a_hue_and_a_shape_each() -> None:
    assert model_colours(["noel_2017"]) == {"noel_2017": ONE_MODEL}
    several = model_colours(list(MODELS))
    assert {name: tuple(MODELS[name].colour) for name in MODELS} == several
    assert len({model_shape(name) for name in MODELS}) == len(MODELS) == len(MODEL_SHAPES)


def test_standard_deviations_of_speeds_agree_with_random_velocities(impacts) -> None:
    row = np.arange(16)
    for name in ("rn", "r", "theta1_deg", "vn1_mps"):
        attribute = name.removesuffix("_mps").removesuffix("_deg")
        expected = impacts.sigma[attribute]
        expected = np.degrees(expected) if name.endswith("_deg") else expected
        assert measured_sigma(impacts, row, name) == pytest.approx(expected, nan_ok=True)
    rng = np.random.default_rng(2)
    plain = replace(impacts, sigma={"v1": impacts.sigma["v1"]})
    drawn = impacts.v1[3] + rng.normal(size=(40_000, 3)) * impacts.sigma["v1"][3]
    assert measured_sigma(plain, row, "v1_mps")[3] == pytest.approx(np.linalg.norm(drawn, axis=1).std(), rel=0.05)
    assert np.isnan(measured_sigma(plain, row, "diameter_m")).all()
