# SPDX-License-Identifier: GPL-3.0-or-later
"""Energy, chance and contact of whole runs: closed forms, the models themselves, and what cannot happen."""

import numpy as np
import pytest
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.machinery.measured import MeasuredRebounds
from rockfall.core.impact_models.registry import MODELS, find_model
from rockfall.core.simulation import engine, motion_kernels
from rockfall.core.simulation.engine import ENDS, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.simulation.results import flights_of, run_figures
from rockfall.core.terrain.raycast import closest_points
from rockfall.core.terrain.surface import Surface
from scipy.stats import ks_2samp

G = 9.81
ELASTIC = {"rn": 1.0, "rt": 1.0}


def sheet(x, y, height) -> Surface:
    """A grid of triangles over two lines of coordinates."""
    u, v = np.meshgrid(x, y)
    vertices = np.column_stack([u.ravel(), v.ravel(), height(u, v).ravel()]).astype(np.float64)
    i = np.arange(u.size).reshape(u.shape)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "sheet")


def rough_height(x, y):
    return -0.5 * np.minimum(x, 90) + 0.5 * np.sin(x / 3) * np.cos(y / 4) + 0.12 * np.sin(2.1 * x + y) * np.cos(1.7 * y)


def rough_case(count: int, diameter: float = 0.5, above: float = 1.0):
    line = np.arange(0.0, 140.5, 1.0)
    ground = make_ground(sheet(line, line, rough_height))
    places = np.random.default_rng(8).uniform([5, 20], [25, 120], (count, 2))
    start = placed_on(ground, places, np.full(count, diameter)) + np.array([0.0, 0.0, above])
    return ground, make_releases(start, diameter_m=diameter)


def test_perfect_rebounds_keep_the_energy_over_thousands_of_contacts() -> None:
    """In a bowl without friction: 1e-9 of the energy for each contact, and no drift over all of them."""
    line = np.linspace(-30, 30, 61)
    ground = make_ground(sheet(line, line, lambda x, y: 0.02 * (x**2 + y**2) + 0.1 * np.sin(x) * np.cos(y)))
    places = np.random.default_rng(2).uniform(-8, 8, (20, 2))
    releases = make_releases(np.column_stack([places, np.full(20, 6.0)]), diameter_m=0.4)
    settings = Settings("azimi_desvarreux_1977", ELASTIC, friction=0.0, rolling="coulomb", most_impacts=400)
    records = simulate(ground, releases, settings, record="impacts").records
    hits = np.flatnonzero(records.what == engine.IMPACT)
    assert hits.size > 3000
    before, after = (
        0.5 * (speed[hits] ** 2).sum(axis=1) + G * records.position[hits, 2] for speed in (records.v1, records.v2)
    )
    np.testing.assert_allclose(after, before, rtol=1e-9)
    flying = np.ones(records.time_s.size, np.bool_)
    for run in range(20):
        own = np.flatnonzero(records.run == run)
        flying[own] = np.cumsum(records.what[own] == engine.ON_GROUND) == 0
    kept = hits[flying[hits]]
    assert kept.size > 1000
    energy = 0.5 * (records.v2[kept] ** 2).sum(axis=1) + G * records.position[kept, 2]
    np.testing.assert_allclose(energy, G * 6.0, rtol=1e-7)


@pytest.mark.parametrize("shape", ["corner", "ditch", "wall and floor"])
def test_contacts_at_once_never_gain_energy(shape: str) -> None:
    """Thrown into a corner of three planes, a narrow ditch, and between a wall and the floor."""
    heights = {
        "corner": lambda x, y: np.maximum(np.maximum(2.0 * np.abs(x) - 1.0, 2.0 * np.abs(y) - 1.0), 0.0),
        "ditch": lambda x, y: 3.0 * np.abs(x),
        "wall and floor": lambda x, y: np.where(np.maximum(np.abs(x), np.abs(y)) > 2.0, 9.0, 0.0),
    }
    line = np.linspace(-6, 6, 49)
    ground = make_ground(sheet(line, line, heights[shape]))
    rng = np.random.default_rng(4)
    start = np.column_stack([rng.uniform(-1.5, 0.2, 60), rng.uniform(-1.5, 1.5, 60), np.full(60, 6.0)])
    releases = make_releases(start, velocity=rng.normal(0, 4, (60, 3)), diameter_m=0.8)
    settings = Settings("azimi_desvarreux_1977", ELASTIC, rolling="coulomb", friction=0.0, most_impacts=200)
    run = simulate(ground, releases, settings)
    records = run.records
    energy = 0.5 * (records.v2**2).sum(axis=1) + G * records.position[:, 2]
    first = (0.5 * (releases.velocity**2).sum(axis=1) + G * releases.position[:, 2])[records.run]
    assert (energy <= first * (1 + 1e-9)).all()
    assert (records.what == engine.IMPACT).sum() > 500


@pytest.mark.parametrize("speed_of_take_off", [0.8, 1.25])
def test_a_block_leaves_a_crest_where_gravity_no_longer_bends_its_path(speed_of_take_off: float) -> None:
    """On a cylinder v² > g R cosβ, with the radius R of the path of the centre; it slides without friction.

    With a start at the top and v² = s² g R it leaves at cosβ = (2 + s²)/3, with s > 1 at once.
    """
    radius, block = 40.0, 0.25
    x = np.concatenate([np.arange(-20, 0, 4.0), radius * np.sin(np.linspace(0, 1.2, 481))])
    ground = make_ground(sheet(x, np.linspace(0, 20, 3), lambda x, y: np.sqrt(radius**2 - np.maximum(x, 0) ** 2)))
    path = radius + block
    start = np.array([[0.05, 9.0, path]])
    velocity = np.array([[speed_of_take_off * np.sqrt(G * path), 0.0, 0.0]])
    place = placed_on(ground, start[:, :2], np.array([2 * block]))
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0}, rolling="coulomb", friction=0.0)
    records = simulate(ground, make_releases(place, velocity=velocity, diameter_m=2 * block), settings).records
    if speed_of_take_off > 1:
        assert not np.isin(records.what, [engine.IMPACT, engine.ON_GROUND]).any()
        return
    leaves = np.flatnonzero(records.what == engine.FLIES_OFF)[0]
    cosine, speed = records.position[leaves, 2] / path, np.linalg.norm(records.v2[leaves])
    # Facets let it go a little early: each of their edges is a small jump.
    assert cosine == pytest.approx((2 + speed_of_take_off**2) / 3, abs=0.02)
    assert speed**2 == pytest.approx(G * path * cosine, rel=0.06)


def test_a_slow_block_stays_on_the_ground_over_a_crest_and_through_a_hollow() -> None:
    """Where v² < g R cosβ everywhere, there is not one impact and no flight, on triangles larger than the block."""
    x = np.arange(0.0, 90.0, 1.0)
    ground = make_ground(sheet(x, np.linspace(0, 20, 5), lambda x, y: 4.0 * np.cos(x * np.pi / 30)))
    place = placed_on(ground, np.array([[3.0, 9.1]]), np.array([0.5]))
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0}, rolling="coulomb", friction=0.02)
    velocity = np.array([[4.0, 0.0, -0.6]])
    run = simulate(ground, make_releases(place, velocity=velocity, diameter_m=0.5), settings)
    what = run.records.what
    assert (what == engine.FLIES_OFF).sum() == 0
    assert run.impacts[0] <= 1
    assert run.position[0, 0] > 25


def test_results_do_not_depend_on_the_threshold_between_hop_and_roll(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run-outs with half the threshold have the same distribution (two-sample Kolmogorov-Smirnov, 5 %).

    The kernels take the threshold in when they are compiled: they are compiled anew with the other one.
    """
    ground, releases = rough_case(1000)
    settings = Settings("pfeiffer_bowen_1989", {"roughness": 0.02}, seed=3)
    whole = simulate(ground, releases, settings, record="ends")
    half = _with_half_the_hop(monkeypatch, ground, releases, settings)
    one, other = (np.linalg.norm((run.position - releases.position)[:, :2], axis=1) for run in (whole, half))
    assert not np.array_equal(one, other)
    assert ks_2samp(one, other).pvalue > 0.05
    assert abs(one.mean() - other.mean()) < 3 * np.hypot(one.std(), other.std()) / np.sqrt(one.size)


def _with_half_the_hop(monkeypatch: pytest.MonkeyPatch, ground, releases, settings):
    from types import FunctionType

    from rockfall.core.compiled import kernel

    def anew(function, **own):
        plain = function.py_func
        return kernel(FunctionType(plain.__code__, {**plain.__globals__, **own}, plain.__name__ + "_half"))

    run_block = anew(motion_kernels.run_block, HOP=motion_kernels.HOP / 2)
    monkeypatch.setattr(motion_kernels, "run_blocks", anew(motion_kernels.run_blocks, run_block=run_block))
    engine._compiled_for.cache_clear()
    run = simulate(ground, releases, settings, record="ends")
    engine._compiled_for.cache_clear()
    return run


LIVELY = {
    "dorren_2015": {"rn": 0.6, "soil_type": 7},
    "pfeiffer_bowen_1989": {"rn": 0.9, "rt": 0.95, "roughness": 0.05},
    "stevens_1998": {"rn": 0.9, "rt": 0.95},
}
"""Parameters with which blocks bounce more often before they keep to the ground."""


@pytest.mark.parametrize("name", [name for name, model in MODELS.items() if model.is_random])
def test_a_million_contacts_have_the_distribution_of_the_model_itself(name: str) -> None:
    """Runs down a plane; the model itself rebounds once from each of their incident states, with another generator.

    So the two samples of n have one distribution: of the normal rebound, and of the tangential one along and across the
    incident velocity, all relative to it. Kolmogorov-Smirnov's distance is less than 2.23 √(2/n) with 99.99 %, 0.003
    for a million; means differ by less than 5 standard errors of their difference.
    """
    beta, far, blocks, wanted = 0.8, np.array([0.0, 4000.0]), 10_000, 1_000_000
    ground = make_ground(sheet(far, far, lambda x, y: -np.tan(beta) * x))
    releases = make_releases(
        np.tile([20.0, 2000.0, 3.0 - np.tan(beta) * 20.0], (blocks, 1)),
        velocity=np.random.default_rng(3).uniform([5, -3, -30], [20, 3, 0], (blocks, 3)),
        diameter_m=0.4,
    )
    columns = {"theta1": (0.1, 1.5), "vn1": (0.5, 12), "rn": (0.4, 1.2), "rt": (0.6, 0.95), "turn": (0, 0.3)}
    rng = np.random.default_rng(5)
    values = {column: rng.uniform(*limits, 60) for column, limits in columns.items()}
    each = np.arange(60).astype(np.str_)
    measured = MeasuredRebounds(site=each, trajectory=each, weight=rng.uniform(0.5, 1, 60), left_out={}, **values)
    parts, seed = [], 0
    while sum(len(part[0]) for part in parts) < wanted:
        settings = Settings(name, LIVELY.get(name, {}), measured, rolling="none", most_impacts=50, seed=seed)
        records = simulate(ground, releases, settings, record="impacts").records
        hits = np.flatnonzero(records.what == engine.IMPACT)
        hits = hits[-(records.v1[hits] * records.normal[hits]).sum(axis=1) > 0.1]
        parts.append([getattr(records, column)[hits] for column in ("v1", "normal", "omega1", "v2")])
        seed += 1
    v1, normal, spin, simulated = map(np.concatenate, zip(*parts, strict=True))
    n = len(v1)
    direct = Incident(v1, normal, spin, np.full(n, 0.2), np.full(n, releases.mass_kg[0]))
    drawn = find_model(name).rebound(direct, LIVELY.get(name), np.random.default_rng(1), measured=measured).velocity
    approach = -(v1 * normal).sum(axis=1)
    tangential = v1 + approach[:, None] * normal
    speed = np.linalg.norm(tangential, axis=1)
    along = tangential / speed[:, None]
    for direction, size in ((normal, approach), (along, speed), (np.cross(normal, along), speed)):
        one, other = ((velocity * direction).sum(axis=1) / size for velocity in (simulated, drawn))
        if np.ptp(other) < 1e-9:
            np.testing.assert_allclose(one, other, atol=1e-9)
        else:
            assert np.abs(one - other).max() > 0.01  # other numbers
            assert ks_2samp(one, other, method="asymp").statistic < 2.23 * np.sqrt(2 / n)
            assert abs((one - other).mean()) < 5 * (one - other).std() / np.sqrt(n)


def test_no_block_is_in_rough_ground_on_any_flight_or_rolls_deeper_than_a_thousandth() -> None:
    ground, releases = rough_case(150)
    for name in ("noel_2017", "azimi_desvarreux_1977"):
        run = simulate(ground, releases, Settings(name, seed=2))
        records = run.records
        rows, duration = flights_of(run)
        assert rows.size > 250
        for part in (0.02, 0.2, 0.5, 0.8, 0.98, 1.0):
            t = (part * duration)[:, None]
            place = records.position[rows] + records.v2[rows] * t + np.array([0, 0, -G / 2]) * t**2
            inside = (place[:, :2] > 0).all(axis=1) & (place[:, :2] < 140).all(axis=1)
            assert closest_points(ground.terrain, place[inside]).distance.min() > 0.25 - 3e-7
        rolls = np.flatnonzero(records.what == engine.ON_GROUND)
        assert rolls.size > 1000
        distance = closest_points(ground.terrain, records.position[rolls]).distance
        assert distance.min() > 0.25 * (1 - 1e-3) - 1e-7
        assert np.quantile(distance, 0.99) < 0.25 * 1.01


def test_what_is_recorded_changes_no_run_and_flights_are_known_without_the_steps() -> None:
    ground, releases = rough_case(60)
    runs = {level: simulate(ground, releases, Settings("stevens_1998"), record=level) for level in engine.RECORDED}
    for level in engine.RECORDED:
        for name in ("end", "time_s", "length_m", "v_max_mps", "impacts", "position"):
            np.testing.assert_array_equal(getattr(runs[level], name), getattr(runs["all"], name))
    assert len(runs["ends"].records) == 2 * 60
    assert len(runs["impacts"].records) < 0.8 * len(runs["all"].records)
    for level in ("impacts", "all"):
        assert (runs[level].records.what == engine.IMPACT).sum() == runs["all"].impacts.sum()
    (rows, duration), (all_rows, all_duration) = (flights_of(runs[level]) for level in ("impacts", "all"))
    np.testing.assert_array_equal(duration, all_duration)
    np.testing.assert_array_equal(runs["impacts"].records.position[rows], runs["all"].records.position[all_rows])
    heights = [run_figures(runs[level]).height_max_m for level in ("impacts", "all")]
    np.testing.assert_array_equal(*heights)
    assert np.isnan(run_figures(runs["ends"]).height_max_m).all()


def test_greatest_heights_are_above_what_is_next_below() -> None:
    """Over a roof at 3 m, whose edge a flight comes by before its apex: there it is highest above the ground."""
    line = np.arange(0.0, 41.0, 1.0)
    floor, roof = sheet(line, line, lambda x, y: 0 * x), sheet(line[12:25], line, lambda x, y: 3 + 0 * x)
    vertices = np.concatenate([floor.vertices, roof.vertices])
    faces = np.concatenate([floor.faces, roof.faces + np.int32(len(floor.vertices))])
    ground = make_ground(Surface(vertices, faces, GlobalShift(), "roofed"))
    start, speed = np.array([[5.03, 20.3, 0.5], [5.03, 4.7, 0.5]]), np.array([[8.0, 0.0, 11.0], [1.0, 0.0, 11.0]])
    run = simulate(ground, make_releases(start, velocity=speed, diameter_m=0.5), Settings("noel_2017", most_impacts=1))
    t = (12 - 5.03) / 8
    at_edge = 0.5 + 11 * t - G * t**2 / 2
    assert at_edge > 0.5 + 11**2 / (2 * G) - 3
    np.testing.assert_allclose(run_figures(run).height_max_m, [at_edge, 0.5 + 11**2 / (2 * G)], rtol=0, atol=0.05)


def test_small_blocks_roll_far_on_large_triangles() -> None:
    """v²/(2 A g μ) on a plane of two triangles, a thousand times as wide as the block."""
    ground = make_ground(sheet(np.array([0.0, 60.0]), np.array([0.0, 60.0]), lambda x, y: 0.0 * x))
    velocity = np.array([[9.0, 4.0, 0.0]])
    releases = make_releases(np.array([[5.0, 20.0, 0.03 + 1e-6]]), velocity=velocity, diameter_m=0.06)
    run = simulate(ground, releases, Settings("azimi_desvarreux_1977", {"rn": 0.1, "rt": 1.0}))
    assert ENDS[run.end[0]] == "stopped"
    way = (velocity**2).sum() / (2 * 5 / 7 * G * 0.5)
    assert run.length_m[0] == pytest.approx(way, abs=0.01)  # the first 5 mm in the air
    assert (run.records.what == engine.ON_GROUND).sum() < 40


@pytest.mark.parametrize("law", ["azzoni_1995", "coulomb"])
def test_a_block_that_rolls_across_a_slope_turns_downhill_as_its_equation_says(law: str) -> None:
    """v' = A (g − (g·n) n) − A μ g cosβ v/|v|, integrated independently."""
    from scipy.integrate import solve_ivp

    beta, mu, factor = np.radians(25), 0.3, {"azzoni_1995": 5 / 7, "coulomb": 1.0}[law]
    ground = make_ground(sheet(np.linspace(0, 200, 81), np.linspace(0, 200, 81), lambda x, y: -np.tan(beta) * x))
    normal, along = np.array([np.sin(beta), 0, np.cos(beta)]), np.array([np.cos(beta), 0, -np.sin(beta)])
    start = np.array([20.3, 30.2, -np.tan(beta) * 20.3]) + 0.3 * normal
    first = np.array([0.0, 8.0, 0.0])
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0}, rolling=law, friction=mu, most_s=4.0)
    releases = make_releases(start[None], velocity=(first - 1e-4 * normal)[None], diameter_m=0.6)
    run = simulate(ground, releases, settings)

    def moves(t, state):
        v = state[3:]
        pull = factor * G * np.sin(beta) * along - factor * mu * G * np.cos(beta) * v / np.linalg.norm(v)
        return np.concatenate([v, pull])

    exact = solve_ivp(moves, (0, run.time_s[0]), np.concatenate([start, first]), rtol=1e-10, atol=1e-10).y[:3, -1]
    assert np.linalg.norm(exact - start) > 20
    np.testing.assert_allclose(run.position[0], exact, atol=0.02)
