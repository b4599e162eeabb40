# SPDX-License-Identifier: GPL-3.0-or-later
"""PredictedFlights land where the parabola meets the terrain: analytic planes, real flights, border and ground."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.predicted_flights import fly_predictions, score_landings
from rockfall.core.cli import main
from rockfall.core.colours import MEASURED_COLOUR
from rockfall.core.commands.demo import SITE
from rockfall.core.constants import GRAVITY_MPS2 as G
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.predicted_flight_tables import write_predicted_flights
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.selection import rows_of
from rockfall.core.exchange.tables import read_impacts, write_impacts
from rockfall.core.film.job import FilmJob
from rockfall.core.film.wording import compared_lines
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import COMPARED, MODELS
from rockfall.core.reconstruction import landing
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.reconstruction.landing import Launches, find_landings, greatest_heights
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.opening import open_project


def plane(slope_deg: float, half_m: float = 60.0, cells: int = 24) -> Surface:
    """Falls towards +x, through the origin."""
    side = np.linspace(-half_m, half_m, cells + 1)
    x, y = (values.ravel() for values in np.meshgrid(side, side, indexing="ij"))
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    ring = np.column_stack([first, first + cells + 1, first + cells + 2, first + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    vertices = np.column_stack([x, y, -x * np.tan(np.radians(slope_deg))])
    return Surface(vertices, faces, GlobalShift(), "plane", ())


def launches(position, velocity, drag_per_m=0.0) -> Launches:
    velocity = np.atleast_2d(np.asarray(velocity, dtype=float))
    position = np.broadcast_to(np.asarray(position, dtype=float), velocity.shape).copy()
    return Launches(position, velocity, np.full(len(velocity), drag_per_m), G)


VELOCITIES = np.array([[4.0, 1.0, 3.0], [7.0, -2.0, 0.4], [0.5, 0.2, 9.0], [11.0, 0.0, 0.03]])


@pytest.mark.parametrize("slope_deg", [0.0, 25.0, 40.0])
def test_landing_on_a_plane_is_the_analytic_one(slope_deg):
    slope = np.radians(slope_deg)
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    found = find_landings(launches([0, 0, 0], VELOCITIES), plane(slope_deg), 0.175)
    expected = 2 * VELOCITIES @ normal / (G * np.cos(slope))
    np.testing.assert_allclose(found.duration_s, expected, atol=1e-9)
    assert not found.into_ground.any()
    assert not found.left_terrain.any()
    ends = VELOCITIES * expected[:, None] - [[0, 0, G / 2]] * expected[:, None] ** 2
    np.testing.assert_allclose(found.position, ends, atol=1e-8)
    np.testing.assert_allclose(found.velocity, VELOCITIES - np.outer(expected, [0, 0, G]), atol=1e-8)


@pytest.mark.parametrize("above", [-0.04, 0.04])
def test_a_start_beside_the_surface_does_not_stop_the_flight(above):
    found = find_landings(launches([0, 0, above], VELOCITIES[:3]), plane(0.0), 0.175)
    upward = VELOCITIES[:3, 2]
    rises = upward**2 / (2 * G) > -above
    expected = np.where(rises, (upward + np.sqrt(np.maximum(upward**2 + 2 * G * above, 0))) / G, 0.0)
    np.testing.assert_allclose(found.duration_s, expected, atol=1e-9)
    np.testing.assert_array_equal(found.into_ground, ~rises)


def test_the_chord_does_not_matter():
    surface = plane(30.0)
    start = launches([-20, 0.3, 20 * np.tan(np.radians(30))], VELOCITIES)
    found = [find_landings(start, surface, 0.175, step_s=step).position for step in (0.02, 0.005, 0.001)]
    np.testing.assert_allclose(found[0], found[2], atol=1e-8)
    np.testing.assert_allclose(found[1], found[2], atol=1e-8)


def test_drag_is_the_equation_of_motion():
    surface, drag = plane(35.0), 0.02
    start = launches([0, 0, 0], VELOCITIES[:3], drag)
    found = find_landings(start, surface, 0.175)
    moved, velocity = fly(np.zeros((3, 3)), VELOCITIES[:3], found.duration_s, G, np.full(3, drag))
    np.testing.assert_allclose(found.position, moved, atol=1e-8)
    np.testing.assert_allclose(found.velocity, velocity, atol=1e-8)
    np.testing.assert_allclose(moved[:, 2], -moved[:, 0] * np.tan(np.radians(35)), atol=1e-7)
    free = find_landings(launches([0, 0, 0], VELOCITIES[:3]), surface, 0.175)
    assert (found.duration_s < free.duration_s).all()


def test_a_flight_with_an_absurd_drag_is_given_up_at_the_limit(monkeypatch):
    """A drag coefficient of 1e5 lets a block sink at 0.3 m/s; no part of its flight is computed again and again."""
    flown = []

    def counted(position, velocity, elapsed_s, *law):
        flown.append(elapsed_s.sum())
        return fly(position, velocity, elapsed_s, *law)

    monkeypatch.setattr(landing, "fly", counted)
    drag = Drag(coefficient=1e5).per_metre(Block())
    found = find_landings(launches([0, 0, 50.0], VELOCITIES, drag), plane(35.0))
    assert found.left_terrain.all()
    np.testing.assert_array_equal(found.duration_s, 60.0)
    np.testing.assert_allclose(found.velocity[:, 2], -np.sqrt(G / drag), atol=1e-9)
    assert sum(flown) < 4 * found.duration_s.sum()


def test_into_the_ground_and_over_the_border():
    found = find_landings(launches([0, 0, 0], [[1.0, 0, -2.0], [0, 40.0, 20.0], [0, -40.0, 20.0]]), plane(20.0), 0.175)
    assert found.into_ground.tolist() == [True, False, False]
    assert found.left_terrain.tolist() == [False, True, True]
    assert found.duration_s[0] == 0.0
    lowest = -60 * np.tan(np.radians(20))
    np.testing.assert_allclose(found.position[1:, 2], lowest, atol=1e-8)
    upwards = replace(launches([0, 0, 0], [[0, 0, 5.0]]), gravity_mps2=0.0)
    up = find_landings(upwards, plane(0.0), limit_s=2.0)
    assert up.left_terrain[0]
    assert up.duration_s[0] == pytest.approx(2.0)
    assert find_landings(launches([0, 0, 0], np.empty((0, 3))), plane(0.0)).duration_s.size == 0
    with pytest.raises(RockfallError, match="positive"):
        find_landings(upwards, plane(0.0), step_s=0.0)


def test_greatest_height_over_a_plane():
    start, flat = launches([0, 0, 0], VELOCITIES[:1]), plane(0.0)
    assert greatest_heights(start, np.array([2 * 3.0 / G]), flat)[0] == pytest.approx(9 / (2 * G), rel=1e-9)
    assert np.isnan(greatest_heights(start, np.array([np.nan]), flat)[0])


def bounces(shift: GlobalShift | None = None) -> tuple:
    """Exact picks of a block that bounces down a plane."""
    surface = plane(35.0)
    normal = np.array([np.sin(np.radians(35)), 0, np.cos(np.radians(35))])
    places, times, velocity = [np.array([-50.0, 0, 50 * np.tan(np.radians(35))])], [3.0], np.array([4.0, 0.3, 2.0])
    for _ in range(5):
        duration = 2 * velocity @ normal / (G * normal[2])
        places.append(places[-1] + velocity * duration - [0, 0, G / 2 * duration**2])
        times.append(times[-1] + duration)
        velocity = velocity - [0, 0, G * duration]
        velocity = 0.8 * (velocity - 2 * (velocity @ normal) * normal)
    n = len(places)
    picks = make_picks(["A"] * n, times, np.array(places), kind=["release"] + ["impact"] * (n - 1))
    return surface, reconstruct(picks, surface=surface, block=Block(), site="slope").impacts


def as_model(impacts, velocity=None):
    """Predictions of a model that is always right (or says `velocity`)."""
    mean = compare(impacts, ["azimi_desvarreux_1977"])
    keep = np.isfinite(impacts.v2[mean.row]).all(axis=1)
    row = mean.row[keep]
    v2 = impacts.v2[row] if velocity is None else np.tile(velocity, (row.size, 1))
    fields = {name: getattr(mean, name)[keep] for name in ("site", "trajectory", "impact")}
    into = impacts.flags["into_ground"][row][None, None]
    return replace(mean, models=("measured",), row=row, v2=v2[None, None], into_ground=into, **fields)


def test_the_real_velocity_lands_on_the_next_impact():
    surface, impacts = bounces()
    flights = fly_predictions(impacts, as_model(impacts), surface)
    assert len(flights) == 4
    assert np.nanmax(flights.landing_offset_m) < 1e-6
    for values in (flights.duration_difference_s, flights.length_difference_m, flights.height_difference_m):
        assert np.nanmax(np.abs(values)) < 1e-6
    halfway = flights.time_s + flights.duration_s / 2
    position, velocity = flights.states(np.arange(4), halfway)
    expected = (
        flights.launches.position + (flights.launches.velocity + velocity) / 2 * (flights.duration_s / 2)[:, None]
    )
    np.testing.assert_allclose(position, expected, atol=1e-9)


def test_the_order_of_the_rows_does_not_matter():
    """Also not for the flight that ends at the impact in the first row."""
    surface, impacts = bounces()
    turned = rows_of(impacts, slice(None, None, -1))
    one, other = (fly_predictions(each, as_model(each), surface) for each in (impacts, turned))
    order = [np.argsort(each.impact) for each in (one, other)]
    for name in ("measured_duration_s", "measured_landing", "landing_offset_m", "height_difference_m"):
        there, here = (getattr(each, name)[rows] for each, rows in zip((one, other), order, strict=True))
        np.testing.assert_allclose(here, there, atol=1e-9, err_msg=name)
    assert np.isfinite(other.measured_duration_s).all()


def test_the_real_velocity_lands_on_the_next_impact_of_the_demo_within_the_noise():
    surface, result = open_project(read_project(SITE / "project.toml"))
    flights = fly_predictions(result.impacts, as_model(result.impacts), surface)
    assert np.isfinite(flights.landing_offset_m).sum() > 60
    assert np.nanmedian(flights.landing_offset_m) < 0.005
    assert np.nanmax(flights.landing_offset_m) < 0.05
    models = fly_predictions(result.impacts, compare(result.impacts), surface)
    finer = fly_predictions(result.impacts, compare(result.impacts), surface, step_s=0.004)
    assert np.linalg.norm(models.landing - finer.landing, axis=1).max() < 1e-3
    marks = {mark.model: mark for mark in score_landings(models)}
    assert tuple(marks) == COMPARED
    assert marks["pfeiffer_bowen_1989"].median_offset_m == pytest.approx(marks["stevens_1998"].median_offset_m)
    assert all(mark.n > 80 for mark in marks.values())


def test_a_models_block_lands_where_its_parabola_meets_the_plane():
    surface, impacts = bounces()
    normal = np.array([np.sin(np.radians(35)), 0, np.cos(np.radians(35))])
    settings = {"azimi_desvarreux_1977": {"rn": 0.35, "rt": 0.85, "definition": "velocity"}}
    (mark,) = score_landings(
        fly_predictions(impacts, compare(impacts, ["azimi_desvarreux_1977"], parameters=settings), surface)
    )
    inwards = (impacts.v1 @ normal)[:, None] * normal
    flown = []
    for velocity in (0.85 * (impacts.v1 - inwards) - 0.35 * inwards, impacts.v2):
        velocity, place = velocity[:-1], impacts.position[:-1]
        duration = 2 * velocity @ normal / (G * normal[2])
        moved = velocity * duration[:, None] - np.outer(duration**2, [0, 0, G / 2])
        height = (velocity @ normal) ** 2 / (2 * G * normal[2] ** 2)  # vertically over the plane
        flown.append((place + moved, duration, np.linalg.norm(moved, axis=1), height))
    model, real = flown
    offset = np.linalg.norm(model[0] - real[0], axis=1)
    assert mark.n == 4
    assert mark.median_offset_m == pytest.approx(np.median(offset), rel=1e-9)
    assert mark.p90_offset_m == pytest.approx(np.quantile(offset, 0.9), rel=1e-9)
    assert mark.median_duration_difference_s == pytest.approx(np.median(model[1] - real[1]), rel=1e-9)
    assert mark.median_length_difference_m == pytest.approx(np.median(model[2] - real[2]), rel=1e-9)
    assert mark.median_height_difference_m == pytest.approx(np.median(model[3] - real[3]), rel=1e-6)


def test_a_model_into_the_ground_flies_nowhere():
    surface, impacts = bounces()
    predictions = as_model(impacts, velocity=[1.0, 0.0, -5.0])
    flights = fly_predictions(impacts, replace(predictions, into_ground=np.ones_like(predictions.into_ground)), surface)
    assert flights.into_ground.all()
    np.testing.assert_array_equal(flights.length_m, 0.0)
    real = np.linalg.norm(flights.measured_landing - flights.launches.position, axis=1)
    np.testing.assert_allclose(flights.landing_offset_m, real)


def test_runs_are_flown_model_by_model():
    surface, impacts = bounces()
    predictions = compare(impacts, ["noel_2017", "stevens_1998"], replicates=3, seed=5)
    flights = fly_predictions(impacts, predictions, surface, runs=None)
    m = predictions.row.size
    assert len(flights) == 2 * 4 * m
    assert flights.model[4 * m] == "stevens_1998"
    np.testing.assert_array_equal(flights.replicate[: 4 * m], np.repeat(np.arange(4), m))
    np.testing.assert_array_equal(flights.launches.velocity, predictions.v2.reshape(-1, 3))
    mean = fly_predictions(impacts, predictions, surface)
    np.testing.assert_array_equal(mean.landing[:m], flights.landing[:m])


def test_drag_needs_the_block():
    surface, impacts = bounces()
    drag = Drag()
    flights = fly_predictions(impacts, as_model(impacts), surface, drag=drag)
    np.testing.assert_allclose(flights.launches.drag_per_m, drag.per_metre(Block()), rtol=1e-12)
    with pytest.raises(InputError, match="Diameter and mass"):
        fly_predictions(replace(impacts, mass_kg=np.full(len(impacts), np.nan)), as_model(impacts), surface, drag=drag)
    with pytest.raises(InputError, match="position of impact"):
        fly_predictions(replace(impacts, position=np.full_like(impacts.position, np.nan)), as_model(impacts), surface)


def test_a_film_of_models(tmp_path, capsys):
    job = FilmJob("film", tmp_path / "project.toml", tmp_path / "film.mp4", models=("noel_2017", "wyllie_2014"))
    assert FilmJob.from_json(job.to_json()) == job
    assert main(["render", str(SITE / "project.toml"), "--model", "noel", "--out", str(tmp_path / "film")]) == 1
    assert "Did you mean noel_2017?" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    assert compared_lines(2)[0] == "Measured (white), and calculated by 2 models"


def test_model_colours_are_told_apart():
    colours = np.array([MEASURED_COLOUR, *(model.colour for model in MODELS.values())])
    apart = np.linalg.norm(colours[:, None] - colours, axis=-1)[np.triu_indices(len(colours), 1)]
    assert apart.min() > 0.3


COLUMNS = (
    "model,replicate,site,trajectory,impact,time_s,x_m,y_m,z_m,v2x_mps,v2y_mps,v2z_mps,gravity_mps2,drag_per_m,"
    "duration_s,landing_x_m,landing_y_m,landing_z_m,landing_vx_mps,landing_vy_mps,landing_vz_mps,height_m,"
    "measured_duration_s,measured_x_m,measured_y_m,measured_z_m,measured_height_m,length_m,duration_difference_s,"
    "length_difference_m,height_difference_m,landing_offset_m,flags"
)


def cells(path):
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def column(rows, name):
    return np.array([float(row[name] or "nan") for row in rows])


def vectors(rows, name):
    return np.stack([column(rows, name.format(axis)) for axis in "xyz"], axis=1)


def test_a_flight_can_be_computed_again_from_its_row(tmp_path):
    surface, impacts = bounces()
    shift = GlobalShift(2600000.0, 1200000.0, 500.0)
    surface = Surface(surface.vertices, surface.faces, shift, "plane", ())
    impacts = replace(impacts, shift=shift)
    flights = fly_predictions(impacts, compare(impacts, replicates=1), surface, runs=None)
    write_predicted_flights(flights, tmp_path / "predicted_flights.csv")
    rows = cells(tmp_path / "predicted_flights.csv")
    assert ",".join(rows[0]) == COLUMNS
    assert [row["model"] for row in rows] == flights.model.tolist()
    assert [int(row["replicate"]) for row in rows] == flights.replicate.tolist()
    assert [row["flags"] for row in rows] == ["into_ground" if into else "" for into in flights.into_ground]
    for name in ("time_s", "duration_s", "height_m", "landing_offset_m", "measured_duration_s", "length_difference_m"):
        np.testing.assert_array_equal(column(rows, name), getattr(flights, name), err_msg=name)
    start, v2 = vectors(rows, "{}_m"), vectors(rows, "v2{}_mps")
    fall = vectors(rows, "landing_{}_m") - start - v2 * column(rows, "duration_s")[:, None]
    expected = -column(rows, "gravity_mps2") / 2 * column(rows, "duration_s") ** 2
    np.testing.assert_allclose(fall, np.outer(expected, [0, 0, 1]), atol=1e-8)
    np.testing.assert_allclose(start, shift.to_survey(flights.launches.position), atol=1e-9)


def test_compare_with_a_terrain_leaves_predicted_flights(tmp_path, capsys):
    _, result = open_project(read_project(SITE / "project.toml"))
    write_impacts(result.impacts, tmp_path / "impacts.csv")
    options = ["--model", "noel_2017", "wyllie_2014", "--tables-only", "--replicates", "0"]
    options += ["--terrain", str(SITE / "terrain.ply")]
    out = tmp_path / "out"
    status = main(["compare", str(tmp_path / "impacts.csv"), *options, "--out", str(out)])
    said = capsys.readouterr()
    assert status == 0, said.err
    assert "predicted_flights.csv" in said.out
    assert "Landings with each model's mean" in said.out
    rows = cells(out / "predicted_flights.csv")
    assert list(dict.fromkeys(row["model"] for row in rows)) == ["noel_2017", "wyllie_2014"]
    impacts = read_impacts(tmp_path / "impacts.csv")
    assert {row["trajectory"] for row in rows} <= set(impacts.trajectory.tolist())
    own = [row for row in rows if row["model"] == "noel_2017"]
    assert np.nanmedian(column(own, "landing_offset_m")) == pytest.approx(1.707, abs=0.001)
