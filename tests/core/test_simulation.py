# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs of blocks, against closed forms, tables of other laws, and what cannot happen."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.progress import CancelledError
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.simulation import engine, turns
from rockfall.core.simulation.chance_kernels import fill_uniform, philox
from rockfall.core.simulation.engine import ENDS, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.pairs import make_pairs
from rockfall.core.simulation.parameter_draws import ParameterDraws, check_draws
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.terrain.kernels import STACK_SIZE
from rockfall.core.terrain.raycast import closest_points
from rockfall.core.terrain.surface import Surface

G = 9.81
ELASTIC = {"rn": 1.0, "rt": 1.0}
DEAD = {"rn": 0.1, "rt": 1.0}


def sheet(count: int, spacing: float, height) -> Surface:
    """A grid of triangles over x, y ≥ 0."""
    line = np.arange(count) * spacing
    x, y = np.meshgrid(line, line)
    vertices = np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()]).astype(np.float64)
    i = np.arange(count * count).reshape(count, count)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "sheet")


def slope(degrees: float, count: int = 60, spacing: float = 2.0) -> Surface:
    return sheet(count, spacing, lambda x, y: -np.tan(np.radians(degrees)) * x)


def rough(count: int = 200) -> Surface:
    def height(x, y):
        return (
            -0.7 * np.minimum(x, 80)
            - 0.2 * np.maximum(x - 80, 0)
            + 0.4 * np.sin(x / 3) * np.cos(y / 4)
            + (0.1 * np.sin(2.1 * x + y) * np.cos(1.7 * y))
        )

    return sheet(count, 1.0, height)


def drops(surface: Surface, count: int, seed: int = 1, above: float = 0.5, diameter: float = 0.4):
    rng = np.random.default_rng(seed)
    ground = make_ground(surface)
    places = placed_on(ground, rng.uniform([8, 30], [25, 170], (count, 2)), np.full(count, diameter))
    return ground, make_releases(places + np.array([0, 0, above]), diameter_m=diameter)


def test_random_numbers_are_philox_4x32_10() -> None:
    """Known answers of Random123 (Salmon et al. 2011)."""
    zero, full = np.uint64(0), np.uint64(0xFFFFFFFF)
    assert [int(x) for x in philox(*[zero] * 6)] == [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]
    assert [int(x) for x in philox(*[full] * 6)] == [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]


def test_random_numbers_are_uniform_and_belong_to_their_impact() -> None:
    values, again = np.empty(7), np.empty(3)
    rows = []
    for run in range(4000):
        fill_uniform(11, run, 5, values)
        rows.append(values.copy())
    table = np.array(rows)
    assert abs(table.mean() - 0.5) < 4 / np.sqrt(12 * table.size)
    assert abs(table.var() - 1 / 12) < 0.002
    assert abs(np.corrcoef(table.T) - np.eye(7)).max() < 0.07
    fill_uniform(11, 3999, 5, again)
    np.testing.assert_array_equal(again, table[-1, :3])
    fill_uniform(12, 3999, 5, again)
    assert (again != table[-1, :3]).all()


@pytest.mark.parametrize("degrees", [0.0, 12.0, 37.0, 64.0])
def test_first_contact_on_a_plane_is_the_closed_form(degrees: float) -> None:
    from rockfall.core.simulation.contact_kernels import first_contact

    index = slope(degrees).index
    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    normal = np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])
    rng, compared = np.random.default_rng(3), 0
    for _ in range(400):
        radius, velocity = rng.uniform(0.05, 2.0), rng.normal(0.0, 5.0, 3)
        x = rng.uniform(20, 80)
        start = np.array([x, rng.uniform(40, 80), -np.tan(np.radians(degrees)) * x])
        start += (radius + rng.uniform(0, 10)) * normal
        t, e, place = first_contact(
            (*index.tree, *make_pairs(index)),
            stack,
            times,
            tuple(start),
            tuple(velocity),
            (0.0, 0.0, -G),
            radius,
            np.inf,
        )
        away, speed, bend = start @ normal - radius, velocity @ normal, -G * normal[2]
        expected = (-speed - np.sqrt(speed**2 - 2 * bend * away)) / bend
        place_then = start + velocity * expected + [0, 0, -G / 2 * expected**2]
        if (place_then[:2] > 3).all() and (place_then[:2] < 115).all():
            compared += 1
            assert place >= 0
            assert t == pytest.approx(expected, abs=1e-6)
            np.testing.assert_allclose(e, normal, atol=1e-9)
    assert compared > 200


@pytest.mark.parametrize(
    ("rolling", "degrees", "stops_after"),
    [("azzoni_1995", 0, 14.2712), ("coulomb", 0, 10.1937), ("azzoni_1995", 20, 55.8225), ("coulomb", 20, 39.8732)],
)
def test_rolling_and_sliding_stop_where_their_laws_say(rolling, degrees, stops_after) -> None:
    """v²/(2 A g cosβ (μ − tanβ)) from 10 m/s with μ = 0.5, A = 5/7 for a rolling sphere, 1 for sliding."""
    along = np.array([np.cos(np.radians(degrees)), 0.0, -np.sin(np.radians(degrees))])
    normal = np.array([-along[2], 0.0, along[0]])
    start = np.array([5.3, 60.7, -np.tan(np.radians(degrees)) * 5.3]) + 0.5 * normal
    settings = Settings("azimi_desvarreux_1977", DEAD, rolling=rolling)
    releases = make_releases(start[None], velocity=(10 * along - 1e-4 * normal)[None], diameter_m=1.0)
    run = simulate(make_ground(slope(degrees)), releases, settings)
    assert ENDS[run.end[0]] == "stopped"
    assert np.linalg.norm(run.position[0] - start) == pytest.approx(stops_after, abs=1e-4)
    assert run.length_m[0] == pytest.approx(stops_after, abs=1e-3)


@pytest.mark.parametrize("degrees", [20, 35])
def test_a_block_at_rest_begins_to_roll_where_the_slope_is_steep_enough(degrees: int) -> None:
    """s = ½ A g cosβ (tanβ − μ) t²: from rest at 35°, never at 20°."""
    ground = make_ground(slope(degrees))
    place = placed_on(ground, np.array([[5.0, 60.0]]), np.array([1.0]))
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.1, "rt": 1.0}, most_s=3.0)
    run = simulate(ground, make_releases(place, diameter_m=1.0), settings)
    moved = np.linalg.norm(run.position[0] - place[0])
    beta = np.radians(degrees)
    if np.tan(beta) < 0.5:
        assert moved < 1e-3
        assert ENDS[run.end[0]] == "stopped"
    else:
        expected = 0.5 * 5 / 7 * G * np.cos(beta) * (np.tan(beta) - 0.5) * run.time_s[0] ** 2
        assert moved == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    "height",
    [
        lambda x: 17.4 + 0.84 * np.logaddexp(0.0, (30 - x) / 2.0),
        lambda x: 30 * np.exp(-x / 30),
        lambda x: 20 + 10 * np.cos(np.minimum(x, 60) * np.pi / 60),
    ],
    ids=["ramp", "hollow", "hill"],
)
def test_start_and_stop_of_a_sliding_block_are_joined_by_a_line_of_slope_mu(height) -> None:
    """The energy line of Coulomb's law: (z0 − z + v0²/2g) / horizontal path = μ on any profile."""
    mu = 0.35
    ground = make_ground(sheet(241, 0.5, lambda x, y: height(x)))
    place = placed_on(ground, np.array([[3.0, 60.0]]), np.array([0.5]))
    velocity = np.array([[6.0, 0.0, 0.0]])
    slope_there = (height(3.01) - height(2.99)) / 0.02
    velocity = 6.0 * np.array([[1.0, 0.0, slope_there]]) / np.hypot(1.0, slope_there)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0}, rolling="coulomb", friction=mu)
    run = simulate(ground, make_releases(place, velocity=velocity, diameter_m=0.5), settings)
    assert ENDS[run.end[0]] == "stopped"
    flat = np.hypot(*(run.position[0, :2] - place[0, :2]))
    fallen = place[0, 2] - run.position[0, 2] + 6.0**2 / (2 * G)
    assert flat > 10
    assert fallen / flat == pytest.approx(mu, rel=0.02)


def test_perfect_rebounds_keep_the_energy() -> None:
    ground, releases = drops(rough(), 40)
    settings = Settings("azimi_desvarreux_1977", ELASTIC, most_impacts=60)
    records = simulate(ground, releases, settings).records
    hits = records.what == engine.IMPACT
    before = 0.5 * (records.v1[hits] ** 2).sum(axis=1)
    after = 0.5 * (records.v2[hits] ** 2).sum(axis=1)
    np.testing.assert_allclose(after, before, rtol=1e-9)
    on_ground = np.full(len(releases), np.inf)
    np.minimum.at(
        on_ground, records.run[records.what == engine.ON_GROUND], records.time_s[records.what == engine.ON_GROUND]
    )
    bouncing = records.time_s[hits] < on_ground[records.run[hits]]
    assert bouncing.sum() > 200
    total = after + G * records.position[hits, 2]
    first = G * releases.position[records.run[hits], 2]
    np.testing.assert_allclose(total[bouncing], first[bouncing], rtol=1e-7, atol=1e-5)


@pytest.mark.parametrize("name", sorted(MODELS))
def test_no_model_gains_energy_in_a_whole_run_where_it_promises_so(name: str) -> None:
    if not MODELS[name].energy_never_grows:
        pytest.skip("this model promises nothing")
    ground, releases = drops(rough(), 30)
    releases = make_releases(releases.position, diameter_m=0.4, shape="cube")
    run = simulate(ground, releases, Settings(name))
    records = run.records
    energy = 0.5 * (records.v2**2).sum(axis=1) + G * records.position[:, 2]
    highest = (0.5 * (releases.velocity**2).sum(axis=1) + G * releases.position[:, 2])[records.run]
    spin = 0.5 * 2 / 3 * (releases.diameter_m[0] / 2) ** 2 * (records.omega2**2).sum(axis=1)
    assert (energy <= highest + 1e-6 + spin).all()


def test_no_block_is_in_the_ground_on_any_flight() -> None:
    ground, releases = drops(rough(), 60)
    records = simulate(ground, releases, Settings("noel_2017")).records
    start = np.flatnonzero((records.what[:-1] == engine.IMPACT) & (records.what[1:] == engine.IMPACT))
    start = start[records.run[start] == records.run[start + 1]]
    assert start.size > 500
    for part in (0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
        t = part * (records.time_s[start + 1] - records.time_s[start])[:, None]
        place = records.position[start] + records.v2[start] * t + np.array([0, 0, -G / 2]) * t**2
        assert closest_points(ground.terrain, place).distance.min() > 0.2 - 2e-7
    touching = closest_points(ground.terrain, records.position[start + 1]).distance
    np.testing.assert_allclose(touching, 0.2, atol=1.1e-7)


def test_no_block_goes_through_a_wall_without_thickness() -> None:
    """2 m high, of needles 40 m long and a hand wide, hit at up to 100 m/s from both sides."""
    edges = np.linspace(0, 118, 1181)
    vertices = np.array([[59.0, y, z] for y in edges for z in (-1.0, 2.0)])
    i = 2 * np.arange(len(edges) - 1)[:, None]
    faces = np.concatenate([i + np.array([0, 1, 2]), i + np.array([1, 3, 2])]).astype(np.int32)
    wall = Surface(vertices, faces, GlobalShift(), "wall")
    ground = make_ground(slope(0.0), {"wall": wall})
    rng = np.random.default_rng(5)
    n = 2000
    radius = 0.1
    side = rng.choice([-1.0, 1.0], n)
    start = np.column_stack([59.0 + side * rng.uniform(0.5, 20, n), rng.uniform(30, 88, n), rng.uniform(0.2, 1.5, n)])
    speed = rng.uniform(20, 100, n)
    velocity = np.column_stack([-side * speed, rng.uniform(-0.2, 0.2, n) * speed, rng.uniform(-2, 1, n)])
    velocity[:, 2] = np.minimum(velocity[:, 2], 0.0)
    releases = make_releases(start, velocity=velocity, diameter_m=2 * radius)
    run = simulate(ground, releases, Settings("azimi_desvarreux_1977", {"rn": 0.05, "rt": 0.4}, friction=5.0))
    records = run.records
    beyond = (records.position[:, 0] - 59.0) * side[records.run] < 0
    low = records.position[:, 2] < 1.9
    assert not (beyond & low).any()
    assert (ground.owner[records.face[records.what == engine.IMPACT]] == 1).sum() > 1000


def test_a_ditch_catches_small_blocks_and_large_ones_ride_over_it() -> None:
    def height(x, y):
        return np.where((x > 40) & (x < 41), -1.0, 0.0) - 0.05 * np.minimum(x, 38)

    surface = sheet(480, 0.25, height)
    ground = make_ground(surface)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.05, "rt": 1.0}, friction=0.12)
    ends = {}
    for diameter in (0.3, 3.0):
        places = placed_on(ground, np.column_stack([np.full(40, 25.0), np.linspace(30, 90, 40)]), np.full(40, diameter))
        releases = make_releases(places, velocity=np.tile([7.0, 0.0, -0.35], (40, 1)), diameter_m=diameter)
        ends[diameter] = simulate(ground, releases, settings).position[:, 0]
    assert ((ends[0.3] > 39.9) & (ends[0.3] < 41.1)).mean() > 0.9
    assert (ends[3.0] > 41.5).mean() > 0.9


def test_terminal_speed_with_drag() -> None:
    """v = √(2mg/(ρC_D A)) = 106 m/s for 0.35 m, 2650 kg/m³, ρ 1.2 and C_D 0.9."""
    terminal = np.sqrt(2 * 2650 * np.pi / 6 * 0.35**3 * G / (1.2 * 0.9 * np.pi / 4 * 0.35**2))
    assert terminal == pytest.approx(106, rel=0.002)
    releases = make_releases(np.array([[60.0, 60.0, 9000.0]]), diameter_m=0.35)
    run = simulate(make_ground(slope(0)), releases, Settings("noel_2017", drag=Drag()))
    assert run.v_max_mps[0] == pytest.approx(terminal, rel=1e-3)


def test_flight_with_drag_is_the_reconstructions_flight() -> None:
    from rockfall.core.reconstruction.free_flight import fly

    velocity = np.array([[22.0, 3.0, 18.0]])
    releases = make_releases(np.array([[10.0, 60.0, 40.0]]), velocity=velocity, diameter_m=0.3)
    run = simulate(make_ground(slope(0)), releases, Settings("noel_2017", drag=Drag(), most_impacts=1))
    hit = np.flatnonzero(run.records.what == engine.IMPACT)[0]
    drag = releases.drag_per_m(Drag())
    place, final = fly(releases.position, velocity, run.records.time_s[hit : hit + 1], G, drag)
    np.testing.assert_allclose(run.records.position[hit], place[0], atol=1e-4)
    np.testing.assert_allclose(run.records.v1[hit], final[0], atol=1e-4)


def test_the_same_bits_for_any_threads_and_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    ground, releases = drops(rough(), 150)
    settings = Settings("stevens_1998", seed=4)
    one = simulate(ground, releases, settings, threads=1)
    monkeypatch.setattr(turns, "BATCH", 7)
    for threads, window in ((2, 4096), (7, 14)):
        monkeypatch.setattr(turns, "WINDOW", window)
        other = simulate(ground, releases, settings, threads=threads)
        for name in ("end", "time_s", "length_m", "v_max_mps", "impacts", "position"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
        np.testing.assert_array_equal(other.records.run, np.sort(other.records.run))
        np.testing.assert_array_equal(other.records.v2, one.records.v2)
    fewer = simulate(ground, releases.take(slice(0, 40)), settings)
    np.testing.assert_array_equal(fewer.position, one.position[:40])
    assert not np.array_equal(simulate(ground, releases, Settings("stevens_1998", seed=5)).position, one.position)


def test_records_for_which_the_room_is_too_small_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The run that does not fit is simulated again with more room: nothing of it is kept, and nothing is lost."""
    ground, spheres = drops(rough(), 7)
    releases = make_releases(spheres.position, axes_m=np.tile([0.4, 0.5, 0.7], (7, 1)), shape="ellipsoid")
    settings = Settings("pfeiffer_bowen_1989", {"roughness": 0.1})
    whole = simulate(ground, releases, settings)
    monkeypatch.setattr(engine, "ROOM", dict.fromkeys(engine.ROOM, 1))
    again = simulate(ground, releases, settings)
    assert len(whole.records) > 100
    for name in type(whole.records).__dataclass_fields__:
        np.testing.assert_array_equal(getattr(again.records, name), getattr(whole.records, name), name)
    np.testing.assert_array_equal(again.length_m, whole.length_m)
    np.testing.assert_array_equal(again.impacts, whole.impacts)


def test_every_block_has_an_end() -> None:
    ground, releases = drops(rough(), 200)
    run = simulate(ground, releases, Settings("stevens_1998"))
    counts = np.bincount(run.end, minlength=len(ENDS))
    assert counts.sum() == 200
    plane = make_ground(slope(35.0))
    gone = simulate(plane, make_releases(np.array([[20.0, 60.0, 0.0], [90.0, 60.0, -50.0]])), Settings("noel_2017"))
    assert [ENDS[end] for end in gone.end] == ["left_terrain", "left_terrain"]
    assert (gone.position[:, 0] > 117).all()
    few = simulate(ground, releases, Settings("stevens_1998", most_impacts=2))
    assert (few.impacts <= 2).all()
    assert (few.end == ENDS.index("limit")).sum() > 100


def test_cancelling_keeps_what_is_finished() -> None:
    ground, releases = drops(rough(), 800)
    finished = [0]

    def stop(text: str, done: int = 0, total: int = 0) -> None:
        finished.append(done)
        if done >= 256:
            raise CancelledError

    run = simulate(ground, releases, Settings("noel_2017"), threads=2, progress=stop)
    assert max(finished) <= len(run) < 800
    assert run.wanted == 800
    whole = simulate(ground, releases, Settings("noel_2017"))
    np.testing.assert_array_equal(run.position, whole.position[: len(run)])


def test_zones_have_parameters_of_their_own() -> None:
    surface = slope(0.0)
    zone = (surface.vertices[surface.faces].mean(axis=1)[:, 1] > 60).astype(np.int32)
    ground = make_ground(surface, zone=zone, zones=("rock", "soil"))
    releases = make_releases(np.array([[60.0, 30.0, 5.0], [60.0, 90.0, 5.0]]), diameter_m=0.5)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.5, "rt": 1.0}, zones={"soil": {"rn": 0.2}})
    records = simulate(ground, releases, settings).records
    for run, rn in ((0, 0.5), (1, 0.2)):
        first = np.flatnonzero((records.run == run) & (records.what == engine.IMPACT))[0]
        assert -records.v2[first, 2] / records.v1[first, 2] == pytest.approx(rn, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        (Settings("noel_2017", rolling="sideways"), "no rolling law"),
        (Settings("noel_2017", friction=-1.0), "friction"),
        (Settings("noel_2017", gravity_mps2=0.0), "gravity"),
        (Settings("noel_2017", zones={"lake": {}}), "no zone 'lake'"),
        (Settings("noel_2018"), "no impact model 'noel_2018'"),
    ],
)
def test_settings_that_cannot_be(settings: Settings, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        simulate(make_ground(slope(0)), make_releases(np.array([[60.0, 60.0, 5.0]])), settings)


def test_bad_releases_are_named() -> None:
    place = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0]])
    with pytest.raises(InputError, match=r"position is not a finite number \(release 2\)"):
        make_releases(place)
    with pytest.raises(InputError, match="mass is not a number above zero"):
        make_releases(place[:1], density_kgpm3=0.0)
    with pytest.raises(InputError, match="0 blocks"):
        make_releases(place[:1], number=0)


def drawn(**values: list[float]) -> ParameterDraws:
    table = np.array(list(values.values()), dtype=np.float64).T
    return ParameterDraws(tuple(values), table, np.arange(1.0, len(table) + 1.0))


def test_each_run_has_the_parameters_that_it_drew() -> None:
    """As if each had been simulated with them alone; which ones, its number and the seed say."""
    ground, releases = drops(rough(), 120)
    sets = [{"rn": 0.2, "rt": 0.9}, {"rn": 0.5, "rt": 0.7}, {"rn": 0.35, "rt": 0.8}]
    mu = [0.3, 0.5, 0.7]
    draws = drawn(rn=[one["rn"] for one in sets], friction=mu, rt=[one["rt"] for one in sets])
    settings = Settings("pfeiffer_bowen_1989", draws=draws, seed=5)
    together = simulate(ground, releases, settings)
    chosen = draws.set_of(5, np.arange(120))
    assert set(chosen.tolist()) == {0, 1, 2}
    for place, one in enumerate(sets):
        alone = simulate(ground, releases, Settings(settings.model, one, friction=mu[place], seed=5))
        own = chosen == place
        np.testing.assert_array_equal(together.position[own], alone.position[own])
        assert (together.position[~own] != alone.position[~own]).any()
    part = simulate(ground, releases.take(slice(70, 120)), settings, first_run=70, threads=1)
    np.testing.assert_array_equal(part.position, together.position[70:])


def test_parameters_are_drawn_by_their_weights() -> None:
    draws = ParameterDraws(("rn",), np.array([[0.1], [0.2], [0.3], [0.4]]), np.array([0.0, 1.0, 3.0, 0.0]))
    counts = np.bincount(draws.set_of(3, np.arange(1000, 21_000)), minlength=4)
    assert counts[0] == counts[3] == 0
    assert counts[2] / 20_000 == pytest.approx(0.75, abs=4 * np.sqrt(0.75 * 0.25 / 20_000))
    assert draws.mean() == pytest.approx({"rn": 0.275})
    in_turn = ParameterDraws(draws.names, draws.values, draws.weight, runs_each=3)
    assert in_turn.set_of(3, np.arange(4, 16)).tolist() == [1, 1, 2, 2, 2, 3, 3, 3, 0, 0, 0, 1]


def test_what_a_zone_has_of_its_own_is_not_drawn() -> None:
    surface = slope(37.0)
    west = surface.vertices[surface.faces].mean(axis=1)[:, 0] < 60
    ground = make_ground(surface, {}, west.astype(np.int32), ("east", "west"))
    draws = drawn(rn=[0.2, 0.3], friction=[0.4, 0.6])
    settings = Settings("pfeiffer_bowen_1989", zones={"west": {"rn": 0.7}}, zone_friction={"east": 0.1}, draws=draws)
    rows, friction = engine.check_settings(ground, settings)
    rn = [spec.name for spec in MODELS["pfeiffer_bowen_1989"].parameters].index("rn")
    assert rows[:, rn].tolist() == [0.2, 0.7, 0.3, 0.7]
    assert friction.tolist() == [0.1, 0.4, 0.1, 0.6]


@pytest.mark.parametrize(
    ("model", "draws", "problem"),
    [
        ("pfeiffer_bowen_1989", {"rx": [0.1]}, "has no parameter 'rx'"),
        ("pfeiffer_bowen_1989", {"rn": [0.1, 1.7]}, "rn is 1.7 among the drawn"),
        ("pfeiffer_bowen_1989", {"friction": [-0.1]}, "friction is -0.1 among the drawn"),
        ("azimi_desvarreux_1977", {"definition": [0.0]}, "is a choice"),
        ("observed", {"friction": [0.1]}, "draws from measured impacts"),
    ],
)
def test_draws_that_cannot_be(model: str, draws: dict, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        check_draws(drawn(**draws), MODELS[model])
