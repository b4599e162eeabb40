# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens and barriers against closed forms: flights, falls and blocks that roll through."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.barriers import with_barriers
from rockfall.core.hazard.screen_tally import ScreenTally
from rockfall.core.hazard.screens import HELD, OVER, PASSES, THROUGH, Screen, check_screens, hits_at
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.distributions import Distribution
from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.hits import hits_of
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release import join_releases, make_releases
from rockfall.core.simulation.release_sources import in_polygon, on_points
from rockfall.core.terrain.surface import Surface

G = 9.81
ELASTIC = {"rn": 1.0, "rt": 1.0}


def plane(slope: float = 0.0, size: float = 400.0) -> Ground:
    """A square plane that falls towards the east."""
    corners = np.array([[-size, -size], [size, -size], [size, size], [-size, size]])
    vertices = np.column_stack([corners, -slope * corners[:, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return make_ground(Surface(vertices, faces, GlobalShift(), "plane"))


def thrown(n: int = 1, *, speed: float = 12.0, up: float = 6.0, drag: bool = False) -> Simulation:
    """Blocks that are thrown towards the east from 20 m above a plane."""
    y = np.linspace(-30, 30, n) if n > 1 else np.zeros(1)
    places = np.column_stack([np.zeros(n), y, np.full(n, 20.0)])
    releases = make_releases(places, velocity=np.tile([speed, 0.0, up], (n, 1)), diameter_m=0.5)
    settings = Settings("azimi_desvarreux_1977", drag=Drag() if drag else None, most_impacts=1)
    return simulate(plane(), releases, settings)


def test_a_parabola_crosses_a_screen_where_it_must() -> None:
    simulation = thrown()
    line = np.array([[10.0, -20.0], [14.0, 20.0]])
    hits = hits_at(simulation, [Screen("wall", line)])
    assert len(hits) == 1
    x = 12.0  # the line at y = 0
    t = x / 12.0
    assert hits.time_s[0] == pytest.approx(t, abs=1e-12)
    np.testing.assert_allclose(hits.position[0], [x, 0.0, 20 + 6 * t - G * t**2 / 2], atol=1e-9)
    np.testing.assert_allclose(hits.velocity[0], [12.0, 0.0, 6 - G * t], atol=1e-9)
    assert hits.up_m[0] == pytest.approx(hits.position[0, 2], abs=1e-9)
    assert hits.along_m[0] == pytest.approx(0.5 * np.hypot(4, 40))
    normal = np.array([40.0, -4.0, 0.0]) / np.hypot(4, 40)
    velocity = hits.velocity[0]
    assert np.cos(hits.angle[0]) == pytest.approx(abs(velocity @ normal) / np.linalg.norm(velocity))
    mass = simulation.releases.mass_kg[0]
    assert hits.kinetic_j[0] == pytest.approx(mass * velocity @ velocity / 2)
    assert hits.outcome[0] == PASSES


def test_through_air_it_is_where_the_equation_of_motion_has_it() -> None:
    simulation = thrown(drag=True)
    hits = hits_at(simulation, [Screen("wall", np.array([[15.0, -20.0], [15.0, 20.0]]))])
    k = simulation.releases.drag_per_m(Drag())
    there, velocity = fly(np.array([[0.0, 0, 20]]), np.array([[12.0, 0, 6]]), hits.time_s, G, k)
    np.testing.assert_allclose(there[0], hits.position[0], atol=0.011)
    np.testing.assert_allclose(velocity[0], hits.velocity[0], atol=0.05)
    assert hits.position[0, 0] == pytest.approx(15.0, abs=1e-9)


def test_a_screen_with_corners_is_crossed_once_even_at_its_corner() -> None:
    corner = np.array([[10.0, -20.0], [14.0, 0.0], [10.0, 20.0]])
    hits = hits_at(thrown(7), [Screen("bow", corner)])
    assert hits.number.tolist() == [2, 3, 4, 5, 6]  # those thrown at y = −20 … 20, its ends included
    np.testing.assert_allclose(hits.along_m, np.hypot(4, 20) * np.array([0, 0.5, 1, 1.5, 2]), atol=1e-9)


def test_a_block_that_comes_back_crosses_twice_and_reaches_once() -> None:
    wall = Surface(
        np.array([[30.0, -50, -1], [30, 50, -1], [30, 50, 60], [30, -50, 60]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "wall",
    )  # fmt: skip
    corners = 300.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    floor = Surface(
        np.column_stack([corners, np.zeros(4)]), np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "floor"
    )
    ground = make_ground(floor, {"wall": wall})
    releases = make_releases(np.array([[0.0, 0, 50]]), velocity=np.array([[20.0, 0, 0]]), diameter_m=0.5)
    simulation = simulate(ground, releases, Settings("azimi_desvarreux_1977", ELASTIC, most_impacts=2, rolling="none"))
    tally = ScreenTally([Screen("before it", np.array([[25.0, -20.0], [25.0, 20.0]]))])
    tally.add(simulation)
    figures = tally.figures()[0]
    assert (figures.blocks, figures.reach, figures.hits) == (1, 1, 2)
    assert figures.energy_j is not None
    assert figures.energy_j.quantile(0.95).count == 1, "one block is one observation"
    assert figures.energy_j.greatest == tally.hits.energy_j.max()


@pytest.mark.parametrize("backwards", [False, True])
def test_an_area_counts_a_block_once_when_it_comes_in(backwards: bool) -> None:
    """Thrown to the east from x = 0: through a square from x = 6 to 9, and out of one that they start in."""
    corners = np.array([[6.0, -40.0], [9.0, -40.0], [9.0, 40.0], [6.0, 40.0], [6.0, -40.0]])
    around = corners + np.array([-8.0, 0.0])
    step = -1 if backwards else 1
    simulation = thrown(5)
    hits = hits_at(simulation, [Screen("house", corners[::step]), Screen("source", around[::step])])
    assert hits.screen.tolist() == [0] * 5
    np.testing.assert_allclose(hits.position[:, 0], 6.0, atol=1e-9)
    lines = hits_at(simulation, [Screen("open", corners[:4])])
    assert len(lines) == 5, "an outline that is not closed is a line"


def test_blocks_know_the_place_that_they_are_released_from() -> None:
    ground = plane()
    points = np.array([[0.0, 0.0, np.nan], [5.0, 0.0, np.nan], [0.0, 0.0, np.nan]])
    blocks = Blocks("sphere", Distribution("fixed", 0.5), (1.0, 1.0, 1.0), Distribution("fixed", 2650.0))
    assert on_points(ground, points, blocks, 2).place.tolist() == [0, 0, 1, 1, 0, 0], "two stated points are one place"
    square = Polygon("area", (np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]),))
    area = in_polygon(ground, [square], blocks, 4)
    assert area.place.tolist() == [0, 1, 2, 3]
    both = join_releases([on_points(ground, points, blocks, 1), area])
    assert both.place.tolist() == [0, 1, 0, 2, 3, 4, 5]
    assert both.take(np.array([2, 5])).place.tolist() == [0, 4]


def test_blocks_that_fall_have_the_energy_of_their_fall() -> None:
    """1000 blocks slide without friction down a plane: at a screen each has m g h, whatever its size."""
    n, slope = 1000, 0.5
    rng = np.random.default_rng(4)
    places = np.column_stack([np.full(n, -300.0), rng.uniform(-300, 300, n), np.zeros(n)])
    diameter = rng.uniform(0.4, 1.5, n)
    ground = plane(slope)
    normal = np.array([slope, 0, 1]) / np.hypot(slope, 1)
    places[:, 2] = 150.0
    places += (diameter / 2)[:, None] * normal
    releases = make_releases(places, diameter_m=diameter)
    settings = Settings("azimi_desvarreux_1977", rolling="coulomb", friction=0.0, most_s=120.0)
    simulation = simulate(ground, releases, settings)
    tally = ScreenTally([Screen("foot", np.array([[-100.0, -400.0], [-100.0, 400.0]]))])
    tally.add(simulation)
    assert tally.figures()[0].reach == n
    hits = tally.hits
    fall = places[hits.number - 1, 2] - hits.position[:, 2]
    energy = releases.mass_kg[hits.number - 1] * G * fall
    np.testing.assert_allclose(hits.kinetic_j, energy, rtol=1e-3)
    np.testing.assert_allclose(hits.up_m, diameter[hits.number - 1] / 2 * np.hypot(slope, 1), rtol=1e-6)
    np.testing.assert_allclose(np.degrees(hits.angle), np.degrees(np.arctan(slope)), atol=0.1)


def test_a_barrier_holds_what_it_can_and_lets_others_over_and_through() -> None:
    simulation = thrown(3)
    line = np.array([[12.0, -50.0], [12.0, 50.0]])
    up = float(hits_at(simulation, [Screen("there", line)]).up_m[0])
    energy = float(hits_at(simulation, [Screen("there", line)]).energy_j[0])
    top = up + 0.25
    for height, capacity, outcome in (
        (top + 1e-6, energy * 1.001, HELD), (top - 1e-6, energy * 1.001, OVER), (top + 1e-6, energy * 0.999, THROUGH),
    ):  # fmt: skip
        fence = Screen("fence", line, height, capacity)
        behind = Screen("behind", line + np.array([1.0, 0.0]))
        hits = hits_at(simulation, [behind, fence])
        assert hits.screen.tolist() == [1, 0] * 3
        assert hits.outcome[hits.screen == 1].tolist() == [outcome] * 3
        assert hits.reaches[hits.screen == 0].tolist() == [outcome != HELD] * 3


def test_tallies_are_the_same_whatever_the_chunks() -> None:
    simulation = thrown(40)
    screens = [
        Screen("a", np.array([[5.0, -9.0], [5.0, 40.0]])),
        Screen("b", np.array([[9.0, -9.0], [9.0, 9.0]]), 9, 9e9),
    ]
    whole, parts = ScreenTally(screens), []
    whole.add(simulation)
    for start in (17, 0, 30):
        part = whole.empty()
        part.add(simulation.part(start, {0: 17, 17: 30, 30: 40}[start]))
        parts.append(ScreenTally.from_arrays(part.arrays()))
    first = parts[0]
    for other in parts[1:]:
        first.merge(other)
    ours, theirs = whole.arrays(), first.arrays()
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=name)


def test_of_too_many_hits_a_sample_stays_that_does_not_depend_on_the_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rockfall.core.hazard.screen_tally.MOST_KEPT", 20)
    simulation = thrown(200)
    screens = [Screen("a", np.array([[5.0, -40.0], [5.0, 40.0]]))]
    whole, turned = ScreenTally(screens), ScreenTally(screens)
    whole.add(simulation)
    for start in range(190, -1, -10):
        turned.add(simulation.part(start, start + 10))
    assert whole.hits.number.tolist() == turned.hits.number.tolist()
    assert len(whole.hits) == 20
    assert whole.figures()[0].hits == 200
    assert np.ptp(whole.hits.number) > 100


def test_blocks_dropped_on_a_plate_hit_it_with_the_energy_of_their_fall() -> None:
    rng = np.random.default_rng(8)
    n, height = 1000, rng.uniform(2.0, 40.0, 1000)
    corners = np.array([[-30.0, -30, 5], [30, -30, 5], [30, 30, 5], [-30, 30, 5]])
    plate = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "plate")
    ground = make_ground(plane().surface, {"plate": plate})
    diameter = rng.uniform(0.3, 2.0, n)
    places = np.column_stack([rng.uniform(-25, 25, (n, 2)), 5 + diameter / 2 + height])
    releases = make_releases(places, diameter_m=diameter)
    simulation = simulate(ground, releases, Settings("pfeiffer_bowen_1989", most_impacts=1))
    hits = hits_of(simulation)
    assert simulation.records.run[hits.record].tolist() == list(range(n))
    np.testing.assert_allclose(hits.kinetic_j, releases.mass_kg * G * height, rtol=1e-3)
    np.testing.assert_allclose(hits.angle, 0.0, atol=1e-6)


def test_runs_that_a_barrier_holds_end_there() -> None:
    simulation = thrown(3)
    line = np.array([[12.0, -50.0], [12.0, 1.0]])  # the third block passes beside it
    fence = Screen("fence", line, 50.0, 1e9)
    hits = hits_at(simulation, [fence])
    after = with_barriers(simulation, hits)
    assert after.at_rest.tolist() == [True, True, bool(simulation.at_rest[2])]
    np.testing.assert_allclose(after.position[:2], hits.position)
    np.testing.assert_allclose(after.time_s[:2], hits.time_s)
    np.testing.assert_array_equal(after.position[2], simulation.position[2])
    assert len(hits_at(after, [Screen("behind", line + np.array([0.1, 0.0]))])) == 0
    before = hits_at(after, [Screen("in front", line - np.array([1.0, 0.0]))])
    np.testing.assert_array_equal(before.kinetic_j, hits_at(simulation, [Screen("", line - [1.0, 0.0])]).kinetic_j)


@pytest.mark.parametrize(
    ("screen", "says"),
    [
        (lambda: Screen("s", np.array([[0.0, 0.0], [0.0, 0.0]])), "no line"),
        (lambda: Screen("s", np.array([[0.0, 0.0], [1.0, 0.0]]), 0.0), "0 m high"),
        (lambda: Screen("s", np.array([[0.0, 0.0], [1.0, 0.0]]), 2.0, -5.0), "capacity"),
        (lambda: check_screens([Screen("s", np.array([[9e3, 0.0], [9e3, 1.0]]))], plane()), "beside the terrain"),
        (lambda: check_screens([Screen("s", np.array([[0, 0.0], [9.0, 1.0]]))] * 2, plane()), "two screens 's'"),
    ],
)
def test_screens_that_cannot_be(screen, says: str) -> None:
    with pytest.raises(InputError, match=says):
        screen()
