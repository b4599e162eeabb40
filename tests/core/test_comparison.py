# SPDX-License-Identifier: GPL-3.0-or-later
"""Models on measured impacts: which impacts, with which spin, whatever the order; and how they are scored."""

import csv
from dataclasses import fields, replace

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.courses import find_courses
from rockfall.core.analysis.scores import ABSCISSA, energy_distance, scores, wasserstein_distance
from rockfall.core.errors import InputError
from rockfall.core.exchange.comparison_tables import read_predictions, write_predictions, write_scores
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.registry import COMPARED, FORMULAS, MODELS
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

RESULTS = ("v2", "omega1", "omega2", "vn2", "vt2", "rn", "rt", "r", "theta_dev", "into_ground")


def bounces(names=("a", "b"), each=7, seed=3, site="gully"):
    """Impacts down a slope of 35°; the first and the last of each trajectory lack a velocity."""
    rng = np.random.default_rng(seed)
    n = len(names) * each
    step = rng.uniform(0.4, 1.2, n)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(n, 3)) * 0.3, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.05 * rng.normal(size=(n, 3))
    picks = make_picks(np.repeat(names, each), np.cumsum(step), position, normal=normal)
    return reconstruct(picks, site=site).impacts


def rows_of(impacts, rows):
    """Some rows of a table, in any order."""
    taken = {}
    for field in fields(Impacts):
        value = getattr(impacts, field.name)
        if field.name in ("flags", "sigma", "intervals", "extra"):
            taken[field.name] = {name: each[rows] for name, each in value.items()}
        elif field.name != "shift":
            taken[field.name] = value[rows]
    return replace(impacts, **taken)


def with_spin(impacts, spin):
    return replace(impacts, angular_velocity=spin)


def test_impacts_without_a_state_are_skipped_and_listed():
    impacts = bounces()
    v1 = impacts.v1.copy()
    v1[3] = -v1[3]
    normal = impacts.normal.copy()
    normal[5] = np.nan
    predictions = compare(replace(impacts, v1=v1, normal=normal))
    assert dict(predictions.skipped) == {
        0: "no incident velocity",
        3: "departing from the ground",
        5: "no terrain normal",
        7: "no incident velocity",
    }
    assert predictions.row.tolist() == [1, 2, 4, 6, 8, 9, 10, 11, 12, 13]
    assert predictions.models == COMPARED
    assert predictions.v2.shape == (6, 1, 10, 3)
    assert np.isfinite(predictions.r).all()


@pytest.mark.parametrize("name", FORMULAS)
def test_the_spin_goes_from_impact_to_impact(name):
    """As computed one by one: what a model leaves at one impact it meets at the next."""
    impacts = bounces(("a",))
    predictions = compare(impacts, [name])
    radius, mass = impacts.diameter_m / 2, impacts.mass_kg
    spin = np.cross(impacts.normal[0], impacts.v2[0]) / radius[0]
    for k, row in enumerate(range(1, 7)):
        here = slice(row, row + 1)
        n = impacts.normal[here] / np.linalg.norm(impacts.normal[here])
        np.testing.assert_allclose(predictions.omega1[0, 0, k], spin, rtol=1e-6)
        out = MODELS[name].rebound(Incident(impacts.v1[here], n, spin[None], radius[here], mass[here]))
        np.testing.assert_allclose(predictions.v2[0, 0, k], out.velocity[0], rtol=1e-6)
        spin = out.angular_velocity[0]
        np.testing.assert_allclose(predictions.omega2[0, 0, k], spin, rtol=1e-6)


def test_a_gap_starts_a_new_chain():
    """Where an impact is missing, the block rolls again with its incident velocity."""
    impacts = bounces(("a",))
    cut = rows_of(impacts, [0, 1, 2, 4, 5, 6])
    predictions = compare(cut, ["wyllie_2014"])
    at = predictions.impact.tolist().index(5)
    n = cut.normal[3] / np.linalg.norm(cut.normal[3])
    expected = np.cross(n, cut.v1[3]) / (cut.diameter_m[3] / 2)
    np.testing.assert_allclose(predictions.omega1[0, 0, at], expected, rtol=1e-9)
    whole = compare(impacts, ["wyllie_2014"])
    np.testing.assert_array_equal(predictions.omega2[0, 0, :2], whole.omega2[0, 0, :2])


def test_zero_and_measured_spin():
    impacts = bounces(("a",))
    zero = compare(impacts, ["noel_2017"], spin="zero")
    np.testing.assert_array_equal(zero.omega1[0, 0, 0], 0)
    np.testing.assert_array_equal(zero.omega1[0, 0, 1:], zero.omega2[0, 0, :-1])
    measured = np.random.default_rng(1).normal(size=(7, 3)) * 10
    measured[2] = np.nan
    table = compare(with_spin(impacts, measured), ["noel_2017"], spin="table")
    np.testing.assert_array_equal(table.omega1[0, 0], measured[[1, 3, 4, 5, 6]])
    assert (2, "no measured angular velocity") in table.skipped
    measured[3, 1] = np.nan  # a part of a spin is none
    assert (3, "no measured angular velocity") in compare(
        with_spin(impacts, measured), ["noel_2017"], spin="table"
    ).skipped


def test_replicates_do_not_depend_on_anything_else():
    """On other models and trajectories, the order of models or rows, the number of replicates."""
    impacts = bounces()
    whole = compare(impacts, replicates=5, seed=11)
    again = compare(impacts, replicates=5, seed=11)
    for name in RESULTS:
        np.testing.assert_array_equal(getattr(whole, name), getattr(again, name))
    shuffled = rows_of(impacts, np.random.default_rng(2).permutation(len(impacts)))
    few = compare(shuffled, ["stevens_1998", "noel_2017"], replicates=3, seed=11)
    place = {key: i for i, key in enumerate(zip(whole.trajectory.tolist(), whole.impact.tolist(), strict=True))}
    columns = [place[key] for key in zip(few.trajectory.tolist(), few.impact.tolist(), strict=True)]
    for name in RESULTS:
        for i, model in enumerate(few.models):
            part = getattr(whole, name)[whole.index(model), :4][:, columns]
            np.testing.assert_array_equal(getattr(few, name)[i], part)
    alone = compare(rows_of(impacts, np.arange(7, 14)), replicates=5, seed=11)
    np.testing.assert_array_equal(alone.v2, whole.v2[:, :, whole.trajectory == "b"])
    other = compare(impacts, replicates=5, seed=12)
    assert not np.array_equal(other.v2, whole.v2)
    np.testing.assert_array_equal(other.v2[:, 0], whole.v2[:, 0])


def test_only_random_models_scatter():
    spread = np.ptp(compare(bounces(), replicates=8).v2, axis=1).max(axis=(1, 2))
    scatter = [name for name, here in zip(COMPARED, spread, strict=True) if here > 0]
    assert scatter == ["dorren_2015", "noel_2017", "stevens_1998"]


def test_parameters_reach_the_models():
    impacts = bounces()
    settings = {"azimi_desvarreux_1977": {"rn": 0.5}}
    predictions = compare(impacts, ["azimi_desvarreux_1977"], settings)
    np.testing.assert_allclose(predictions.rn, 0.5, rtol=1e-9)
    assert predictions.settings["azimi_desvarreux_1977"] == {"rn": 0.5, "rt": 0.85, "definition": "velocity"}


def test_radius_given_and_mass_missing():
    impacts = replace(bounces(), diameter_m=np.full(14, np.nan), mass_kg=np.full(14, np.nan))
    with pytest.raises(
        InputError, match=r"trajectory a: The radius of the block is not known at impact 2\. .*--radius"
    ):
        compare(impacts)
    courses = find_courses(impacts, radius_m=0.5)
    np.testing.assert_array_equal(courses.incident.radius_m, 0.5)
    np.testing.assert_allclose(courses.incident.mass_kg, 2650 * 4 / 3 * np.pi * 0.125)


def test_bad_tables_are_refused():
    impacts = bounces()
    flat = impacts.normal.copy()
    flat[9] = 0
    for table, message in (
        (replace(impacts, normal=flat), "trajectory b: The normal of impact 3 has the length zero"),
        (replace(impacts, v1=np.full((14, 3), np.nan)), "No impact can be compared: 14 with no incident velocity"),
        (replace(impacts, normal=np.full((14, 3), np.nan)), "12 with no terrain normal"),
        (replace(impacts, v1=-impacts.v1), "12 with departing from the ground"),
        (rows_of(impacts, []), "The table has no impacts"),
        (replace(impacts, diameter_m=np.zeros(14)), "The radius of the block is 0 m"),
    ):
        with pytest.raises(InputError) as caught:
            compare(table)
        assert message in str(caught.value)
    with pytest.raises(InputError, match="no measured angular velocity"):
        compare(impacts, spin="table")
    with pytest.raises(InputError, match="too many for the memory"):
        compare(impacts, replicates=10**9)
    with pytest.raises(InputError, match="whole numbers of zero or more"):
        compare(impacts, seed=-1)
    with pytest.raises(InputError, match="no spin 'fast'"):
        compare(impacts, spin="fast")


def test_predictions_round_trip(tmp_path):
    one = bounces()
    two = replace(bounces(("a",), seed=9), site=np.full(7, "other"))
    merged = {}
    for field in fields(Impacts):
        a, b = getattr(one, field.name), getattr(two, field.name)
        if field.name == "flags":
            merged["flags"] = {name: np.r_[a[name], b[name]] for name in a}
        elif field.name not in ("sigma", "intervals", "extra", "shift"):
            merged[field.name] = np.concatenate([a, b])
    for impacts in (one, replace(one, **merged)):
        predictions = compare(impacts, replicates=2, seed=1)
        write_predictions(predictions, tmp_path / "predictions.csv")
        again = read_predictions(tmp_path / "predictions.csv", impacts)
        assert again.models == predictions.models
        for name in ("row", "site", "trajectory", "impact"):
            np.testing.assert_array_equal(getattr(again, name), getattr(predictions, name))
        for name in (each for each in RESULTS if each != "omega1"):
            np.testing.assert_allclose(getattr(again, name), getattr(predictions, name), rtol=1e-15)


@pytest.mark.parametrize("replicate", ["1000000000000", "1e15", "-3"])
def test_a_run_of_a_huge_number_takes_no_memory(tmp_path, replicate):
    impacts, path = bounces(), tmp_path / "predictions.csv"
    write_predictions(compare(impacts, ["dorren_2015"], replicates=1), path)
    lines = path.read_text().splitlines()
    model, _, *rest = lines[-1].split(",")
    path.write_text("\n".join([*lines[:-1], ",".join([model, replicate, *rest])]))
    with pytest.raises(InputError, match=r"rows are not 1 models with runs 0…\d+ of \d+ impacts"):
        read_predictions(path, impacts)


def test_the_columns_of_the_format(tmp_path):
    write_predictions(compare(bounces(), ["dorren_2015"], replicates=3), tmp_path / "predictions.csv")
    lines = (tmp_path / "predictions.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == (
        "model,replicate,trajectory,impact,v2x_mps,v2y_mps,v2z_mps,omega2x_radps,omega2y_radps,omega2z_radps,vn2_mps,"
        "vt2_mps,rn,rt,r,theta_dev_deg,flags"
    )
    assert len(lines) == 1 + 4 * 12
    assert lines[1].startswith("dorren_2015,0,a,2,")
    assert lines[-1].startswith("dorren_2015,3,b,7,")


def test_wrong_predictions_are_refused(tmp_path):
    impacts, path = bounces(), tmp_path / "predictions.csv"
    write_predictions(compare(impacts, ["wyllie_2014", "noel_2017"]), path)
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join(lines[:-1]), encoding="utf-8")
    with pytest.raises(InputError, match="23 rows are not 2 models with runs 0…0 of 12 impacts"):
        read_predictions(path, impacts)
    path.write_text("\n".join([*lines[:3], lines[3].replace(",a,4,", ",a,40,")]), encoding="utf-8")
    with pytest.raises(InputError, match="row 4, trajectory a: There is no impact 40"):
        read_predictions(path, impacts)


def test_scores_of_known_errors(tmp_path):
    """The measured values are the model's own plus 0.1: bias, RMSE and Wasserstein distance are 0.1."""
    impacts = bounces()
    predictions = compare(impacts, ["azimi_desvarreux_1977"])
    known = predictions.row
    rt = np.full(len(impacts), np.nan)
    rt[known[:-1]] = predictions.rt[0, 0, :-1] - 0.1
    marks = {mark.quantity: mark for mark in scores(replace(impacts, rt=rt), predictions)}
    assert set(marks) == set(ABSCISSA)
    rt_mark = marks["rt"]
    assert rt_mark.n == 11
    np.testing.assert_allclose([rt_mark.bias, rt_mark.rmse, rt_mark.median_error, rt_mark.wasserstein], 0.1, rtol=1e-9)
    assert np.isnan(rt_mark.coverage90)
    assert rt_mark.energy_distance > 0
    write_scores(tuple(marks.values()), tmp_path / "scores.csv")
    with (tmp_path / "scores.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    expected = [
        {name: "" if value != value else str(value) for name, value in vars(mark).items()} for mark in marks.values()
    ]
    assert rows == expected


def test_coverage_of_a_model_that_is_right():
    """Impacts that a random model made itself: half of them lie in its middle half, 90 % in its 90 %."""
    impacts = bounces(("a",), each=400)
    made = compare(impacts, ["noel_2017"], replicates=1, seed=5, spin="zero")
    v2 = np.full((len(impacts), 3), np.nan)
    v2[made.row] = made.v2[0, 1]
    columns = {}
    for name in ("vn2", "vt2", "rn", "rt", "r", "theta_dev"):
        columns[name] = np.full(len(impacts), np.nan)
        columns[name][made.row] = getattr(made, name)[0, 1]
    predictions = compare(impacts, ["noel_2017", "wyllie_2014"], replicates=200, seed=6, spin="zero")
    marks = {(mark.model, mark.quantity): mark for mark in scores(replace(impacts, **columns), predictions)}
    for quantity in ("rn", "r", "vt2_mps"):
        own, other = marks["noel_2017", quantity], marks["wyllie_2014", quantity]
        assert own.coverage50 == pytest.approx(0.5, abs=0.1)
        assert own.coverage90 == pytest.approx(0.9, abs=0.06)
        assert own.energy_distance < 0.25 * other.energy_distance
        assert own.wasserstein < 0.25 * other.wasserstein


@pytest.mark.parametrize("draws", [1, 7])
def test_wasserstein_distance(draws):
    from scipy.stats import wasserstein_distance as expected

    rng = np.random.default_rng(8)
    y, drawn = rng.normal(size=50).round(1), rng.gamma(2.0, size=(draws, 50)).round(1)
    assert wasserstein_distance(y, drawn) == pytest.approx(expected(y, drawn.ravel()), rel=1e-12)


def test_energy_distance():
    """0 for the same cloud; for two single points the square root of twice their distance."""
    cloud = np.random.default_rng(1).normal(size=(50, 2))
    assert energy_distance(cloud, cloud) == pytest.approx(0, abs=1e-7)
    assert energy_distance(np.zeros((1, 2)), np.array([[3.0, 4.0]])) == pytest.approx(np.sqrt(10))
    assert energy_distance(cloud, cloud + 1) == pytest.approx(energy_distance(cloud * [1, 1e3], (cloud + 1) * [1, 1e3]))
