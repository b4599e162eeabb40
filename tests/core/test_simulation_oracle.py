# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine against an independent simulator: flights, impacts, rolling, corners, and the smooth limit of meshes.

The simulator itself is held against closed forms first.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.constants import GRAVITY_MPS2 as G
from rockfall.core.impact_models.registry import find_model
from rockfall.core.simulation.engine import IMPACT, ON_GROUND, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface
from scipy.interpolate import RectBivariateSpline

sys.path.insert(0, str(Path(__file__).parent))
from sheets import sheet
from simulation_oracle import Triangles, _foot, fall, fall_on_function

RADIUS = 0.15
DATA = Path(__file__).parents[1] / "data"


def triangles(surface: Surface) -> Triangles:
    return Triangles(surface.vertices, surface.faces)


def kinked(turn: float) -> Surface:
    """45°, then gentler by a turn [rad], along x."""
    return sheet(
        np.array([-8.0, 0.0, 12.0]),
        np.array([0.0, 4.0]),
        lambda x, y: np.where(x < 0, -x, -np.tan(np.pi / 4 - turn) * x),
    )


@pytest.mark.parametrize("degrees", [10, 31, 60])
@pytest.mark.parametrize(("law", "c"), [("azzoni_1995", 0.4), ("coulomb", 0.0)])
def test_the_simulator_meets_a_second_plane_as_in_closed_form(degrees: float, law: str, c: float) -> None:
    """It keeps (cos T + c)/(1 + c) of its speed, from the momentum about the new contact alone."""
    turn = np.radians(degrees)
    up = np.array([np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])
    way = np.array([up[2], 0.0, -up[0]])
    start = -2.0 * way + RADIUS * up + np.array([0.0, 1.9, 0.0])
    run = fall(
        triangles(kinked(turn)), start, 3.0 * way - 1e-4 * up, RADIUS, parameters={"rn": 0.0, "rt": 1.0}, rolling=law,
        friction=0.3, most_s=1.0, keep_path=True,
    )  # fmt: skip
    pull = 2 * G / (1 + c)
    to_corner = 2.0 - RADIUS * np.tan(turn / 2)
    square = 9.0 + pull * to_corner * (np.sin(np.pi / 4) - 0.3 * np.cos(np.pi / 4))
    last = np.pi / 4 - turn
    behind = np.array([np.cos(last), 0.0, -np.sin(last)])
    place, speed = np.array([one[1] for one in run.path]), np.array([np.linalg.norm(one[2]) for one in run.path])
    s = place @ behind - RADIUS * np.tan(turn / 2)
    first = np.flatnonzero((place[:, 0] > RADIUS * np.sin(last) + 1e-6) & (s > 1e-4))[0]
    assert speed[first] / np.sqrt(square) == pytest.approx((np.cos(turn) + c) / (1 + c), rel=3e-3)


def test_the_simulator_leaves_a_crest_where_gravity_no_longer_bends_its_path() -> None:
    """cosβ = (2 + s²)/3 on a cylinder, started at the top with v² = s² g (R + r), sliding without friction."""
    height = lambda x, y: np.sqrt(100.0 - np.clip(x, -9.0, 9.0) ** 2)  # noqa: E731

    def function(x, y):
        z = height(x, y)
        zero = np.zeros_like(x)
        return z, -x / z, zero, -100.0 / z**3, zero, zero

    way = 10.0 + RADIUS
    start, velocity = np.array([[0.0, 0.0, way]]), np.array([[0.8 * np.sqrt(G * way), 0.0, 0.0]])
    limit = np.arccos((2 + 0.64) / 3)
    on = fall_on_function(
        function, start, velocity, RADIUS, rolling="coulomb", friction=0.0, parameters={"rn": 0.0, "rt": 1.0},
        inside=lambda p: p[:, 0] < way * np.sin(limit) - 0.05, dt=0.002, most_s=5.0,
    )  # fmt: skip
    off = fall_on_function(
        function, start, velocity, RADIUS, rolling="coulomb", friction=0.0, parameters={"rn": 0.0, "rt": 1.0},
        inside=lambda p: p[:, 0] < way * np.sin(limit) + 0.10, dt=0.002, most_s=5.0,
    )  # fmt: skip
    assert (on.offs[0], off.offs[0]) == (0, 1)


def rough(x, y):
    return -0.7 * x + 0.15 * np.sin(1.3 * x) * np.cos(0.9 * y) + 0.05 * np.sin(3.1 * x + 2.0 * y)


def test_flights_and_impacts_are_those_of_the_independent_simulator() -> None:
    """The first impacts of blocks that fall 3 m onto rough triangles: place and velocity, and so the rebounds."""
    surface = sheet(np.arange(0.0, 40.0, 0.5), np.arange(0.0, 12.0, 0.5), rough)
    rng = np.random.default_rng(8)
    place = np.column_stack([rng.uniform(2, 6, 12), rng.uniform(3, 9, 12), np.full(12, 1.5)])
    velocity = np.tile([3.0, 0.4, 0.0], (12, 1))
    parameters = {"rn": 0.7, "rt": 0.95}
    releases = make_releases(place, velocity=velocity, diameter_m=2 * RADIUS)
    records = simulate(make_ground(surface), releases, Settings("azimi_desvarreux_1977", parameters)).records
    checked = 0
    for i in range(12):
        run = fall(triangles(surface), place[i], velocity[i], RADIUS, parameters=parameters, most_s=3.0, fine=0.2)
        rows = np.flatnonzero((records.run == i) & (records.what == IMPACT))
        for (p, v), row in zip(run.impacts[:3], rows[:3].tolist(), strict=False):
            np.testing.assert_allclose(p, records.position[row], atol=1e-6)
            np.testing.assert_allclose(v, records.v1[row], atol=1e-5)
            checked += 1
    assert checked >= 24


@pytest.mark.parametrize("law", ["azzoni_1995", "coulomb"])
def test_a_block_in_a_gully_stops_where_the_simulator_and_the_smooth_limit_stop(law: str) -> None:
    """Across a trough of 25°, which ends on the flat: swinging from side to side, without a flight."""
    steep = np.tan(np.radians(25.0))

    def function(x, y):
        e, k, zero = 1 / (1 + np.exp(-(x - 10) / 1.5)), 0.12, np.zeros_like(x)
        z = -steep * x + steep * 1.5 * np.logaddexp(0.0, (x - 10) / 1.5) + k * (y - 6) ** 2
        return z, -steep + steep * e, 2 * k * (y - 6), steep * e * (1 - e) / 1.5, zero, zero + 2 * k

    surface = sheet(np.arange(0.0, 45.0, 0.25), np.arange(0.0, 12.01, 0.25), lambda x, y: function(x, y)[0])
    ground = make_ground(surface)
    start = placed_on(ground, np.array([[2.0, 4.5], [2.5, 6.9]]), np.full(2, 2 * RADIUS))
    velocity = np.tile([1.0, 0.0, -steep], (2, 1))
    parameters = {"rn": 0.0, "rt": 1.0}
    settings = Settings("azimi_desvarreux_1977", parameters, rolling=law, friction=0.3)
    releases = make_releases(start, velocity=velocity, diameter_m=2 * RADIUS)
    run = simulate(ground, releases, settings)
    way = np.linalg.norm((run.position - start)[:, :2], axis=1)
    plain = [
        fall(triangles(surface), p, v, RADIUS, parameters=parameters, rolling=law, friction=0.3, fine=0.2).position
        for p, v in zip(start, velocity, strict=True)
    ]
    np.testing.assert_allclose(np.linalg.norm((np.array(plain) - start)[:, :2], axis=1), way, rtol=0.03)
    _, normal, gap = _foot(function, start, start[:, :2].copy(), 6)
    on = start + (RADIUS - gap + 1e-6)[:, None] * normal
    smooth = fall_on_function(function, on, velocity, RADIUS, parameters=parameters, rolling=law, friction=0.3)
    np.testing.assert_allclose(np.linalg.norm((smooth.position - on)[:, :2], axis=1), way, rtol=0.03)


def test_a_block_that_touches_two_walls_of_a_ditch_rolls_along_it() -> None:
    """A straight ditch of two planes of 40°, its bottom falling at 20°: both are touched all the way."""
    side, fall_of = np.tan(np.radians(40.0)), np.tan(np.radians(20.0))
    surface = sheet(np.array([0.0, 30.0]), np.array([0.0, 2.0, 4.0]), lambda x, y: side * np.abs(y - 2.0) - fall_of * x)
    ground = make_ground(surface)
    start = placed_on(ground, np.array([[2.0, 2.0]]), np.full(1, 2 * RADIUS))
    velocity = np.array([[np.cos(np.radians(20.0)), 0.0, -np.sin(np.radians(20.0))]])
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0}, friction=0.2, most_s=2.0)
    run = simulate(ground, make_releases(start, velocity=velocity, diameter_m=2 * RADIUS), settings)
    on = run.records.what == ON_GROUND
    gaps = triangles(surface)
    assert on.any()
    for p in run.records.position[on][:20]:
        assert abs(p[1] - 2.0) < 1e-3 * RADIUS
    plain = fall(gaps, start[0], velocity[0], RADIUS, parameters={"rn": 0.0, "rt": 1.0}, friction=0.2, most_s=2.0)
    assert np.linalg.norm(plain.position - start[0]) > 3.0
    np.testing.assert_allclose(run.position[0], plain.position, atol=0.03 * np.linalg.norm(plain.position - start[0]))


def test_a_real_grid_of_5_m_gives_the_run_out_of_a_smooth_surface_through_it() -> None:
    """Tschamut: blocks on the survey's grid, and on the bicubic spline through its nodes, sampled every 0.5 m."""
    coarse = read_terrain(DATA / "tschamut_2014_terrain.asc")
    v = coarse.vertices
    x, y = np.unique(v[:, 0]), np.unique(v[:, 1])
    z = np.empty((x.size, y.size))
    z[np.searchsorted(x, v[:, 0]), np.searchsorted(y, v[:, 1])] = v[:, 2]
    spline = RectBivariateSpline(x, y, z)
    fine = sheet(np.arange(x[0], x[-1], 0.5), np.arange(y[0], y[-1], 0.5), lambda x, y: spline.ev(x, y))
    with (DATA / "tschamut_2014_releases.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))[::2]
    place, velocity = (
        np.array([[float(row[name]) for name in names] for row in rows])
        for names in (("x_m", "y_m"), ("vx_mps", "vy_mps", "vz_mps"))
    )
    size = np.full(len(rows), 0.35)
    far = []
    for surface in (coarse, fine):
        ground = make_ground(surface)
        start = placed_on(ground, place, size)
        releases = make_releases(start, velocity=velocity, diameter_m=size)
        run = simulate(ground, releases, Settings("azimi_desvarreux_1977", friction=0.46), record="ends")
        far.append(float(np.hypot(*(run.position - start)[:, :2].T).mean()))
    assert far[1] > 80.0
    assert far[0] == pytest.approx(far[1], rel=0.05)


def test_an_impact_on_a_second_plane_is_recorded_as_it_was() -> None:
    """A kink of 60°: x² (3 − 2 x), x = (60 − 45)/45, of the model's velocity and spin, the rest of the meeting's."""
    turn, parameters = np.radians(60.0), {"rn": 0.3, "rt": 0.8}
    up = np.array([np.sin(np.pi / 4), 0.0, np.cos(np.pi / 4)])
    way = np.array([up[2], 0.0, -up[0]])
    start = -4.0 * way + RADIUS * up + np.array([0.0, 1.9, 0.0])
    releases = make_releases(start[None], velocity=(3.0 * way - 1e-4 * up)[None], diameter_m=2 * RADIUS)
    settings = Settings("azimi_desvarreux_1977", parameters, friction=0.3)
    records = simulate(make_ground(kinked(turn)), releases, settings).records
    row = np.flatnonzero((records.what == IMPACT) & (records.time_s > 0.1))[0]
    v, w, n = records.v1[row], records.omega1[row], records.normal[row]
    model = find_model(settings.model)
    numbers = model.parameter_type(*model.numbers(parameters))
    draws = model.draw_type(*np.full(model.draws, np.nan))
    hit, spun = (np.array(x) for x in model.function(tuple(v), tuple(n), tuple(w), RADIUS, 1.0, numbers, draws))
    last = np.pi / 4 - turn
    behind = np.array([np.cos(last), 0.0, -np.sin(last)])
    rolls = (np.cos(turn) + 0.4) / 1.4 * np.linalg.norm(v) * behind
    x = 1.0 / 3.0
    part = x * x * (3.0 - 2.0 * x)
    np.testing.assert_allclose(records.v2[row], rolls + part * (hit - rolls), atol=1e-3 * np.linalg.norm(v))
    spin = np.cross(n, rolls) / RADIUS
    np.testing.assert_allclose(records.omega2[row], spin + part * (spun - spin), atol=2e-3 * np.linalg.norm(w))
