# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read off a simulation: hits of structures, who holds a block, and the tables' numbers."""

import numpy as np
import pytest
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.convergence import convergence
from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.hits import hits_of
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.structures import structure_frame
from rockfall.core.terrain.surface import Surface

G = 9.81
AZIMI = "azimi_desvarreux_1977"


def plane(slope: float = 0.0) -> Surface:
    """120 m × 120 m, falling towards the east."""
    vertices = np.array([[x, y, -slope * x] for y in (0.0, 120.0) for x in (0.0, 120.0)])
    return Surface(vertices, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane")


def wall(start: tuple[float, float], end: tuple[float, float], low: float, high: float, parts: int = 5) -> Surface:
    """Upright, of panels that become narrower: nothing may depend on how it is divided."""
    share = 1 - (1 - np.linspace(0, 1, parts + 1)) ** 2
    foot = np.array(start) + share[:, None] * (np.array(end) - np.array(start))
    vertices = np.concatenate([np.column_stack([foot, np.full(parts + 1, z)]) for z in (low, high)])
    i = np.arange(parts)
    faces = np.concatenate([np.stack([i, i + 1, i + parts + 2], 1), np.stack([i, i + parts + 2, i + parts + 1], 1)])
    return Surface(vertices, faces.astype(np.int32), GlobalShift(), "wall")


@pytest.mark.parametrize(
    ("start", "end", "western"),
    [((50, 40), (80, 70), (50, 40)), ((80, 70), (50, 40), (50, 40)), ((60, 90), (60, 30), (60, 30))],
)
def test_places_along_a_wall_count_from_its_western_or_southern_end(start, end, western) -> None:
    ground = make_ground(plane(), {"wall": wall(start, end, -1.0, 3.0)})
    frame = structure_frame(ground, 0)
    length = np.hypot(end[0] - start[0], end[1] - start[1])
    other = end if western == start else start
    ends = np.array([[*western, 7.0], [*other, -2.0]])
    np.testing.assert_allclose(frame.along_m(ends), [0.0, length], atol=1e-9)
    np.testing.assert_allclose(frame.across_m(ends), 0.0, atol=1e-9)
    assert frame.across_m(np.array([[western[0] - 1.0, western[1] + 1.0, 0.0]]))[0] > 0


def test_hits_of_an_oblique_wall_are_where_the_parabola_meets_it() -> None:
    """Blocks thrown level at a wall at 45°, at right angles to it: place, height and speed in closed form."""
    ground = make_ground(plane(0.1), {"wall": wall((50, 40), (80, 70), -20.0, 10.0)})
    normal = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    along = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    radius, speed, away = 0.25, 30.0, 4.0
    places = np.array([1.0, 13.0, 40.0])
    foot = np.array([50.0, 40.0, 0.0]) + places[:, None] * along
    start = foot + away * normal + [0.0, 0.0, 3.0]
    releases = make_releases(start, velocity=np.tile(-speed * normal, (3, 1)), diameter_m=2 * radius)
    simulation = simulate(ground, releases, Settings(AZIMI, {"rn": 0.3, "rt": 0.8}))
    hits = hits_of(simulation)
    first = np.array([np.flatnonzero(simulation.records.run[hits.record] == run)[0] for run in range(3)])
    t = (away - radius) / speed
    np.testing.assert_allclose(simulation.records.time_s[hits.record[first]], t, atol=1e-6)
    np.testing.assert_allclose(hits.along_m[first], places, atol=1e-6)
    z = 3.0 - G / 2 * t**2
    np.testing.assert_allclose(hits.up_m[first], z + 0.1 * foot[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.tan(hits.angle[first]), G * t / speed, rtol=1e-6)
    np.testing.assert_allclose(hits.kinetic_j[first], 0.5 * releases.mass_kg * (speed**2 + (G * t) ** 2), rtol=1e-9)
    assert not hits.passes.any()


def thrown_at(ground: Ground, heights: list[float]) -> Simulation:
    start = np.column_stack([np.full(len(heights), 50.0), np.full(len(heights), 60.0), heights])
    velocity = np.tile([25.0, 0.0, 0.0], (len(heights), 1))
    releases = make_releases(start, velocity=velocity, diameter_m=0.6)
    return simulate(ground, releases, Settings(AZIMI, {"rn": 0.3, "rt": 0.9}))


def test_a_block_passes_that_goes_on_beyond() -> None:
    """One against the middle of a wall of 2 m, one that clips its edge; the road is crossed by whoever hits it."""
    road = Surface(
        np.array([[70.0, 0, 0.05], [76, 0, 0.05], [76, 120, 0.05], [70, 120, 0.05]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        GlobalShift(),
        "road",
    )
    ground = make_ground(plane(), {"wall": wall((60, 20), (60, 100), 0.0, 2.0), "road": road})
    simulation = thrown_at(ground, [1.5, 2.95])
    hits = hits_of(simulation)
    run = simulation.records.run[hits.record]
    at_wall = hits.structure == 0
    assert set(run[at_wall].tolist()) == {0, 1}
    assert not hits.passes[at_wall & (run == 0)].any()
    assert hits.passes[at_wall & (run == 1)].all()
    assert simulation.position[0, 0] < 60 < simulation.position[1, 0]
    on_road = hits.structure == 1
    assert set(run[on_road].tolist()) == {1}
    assert hits.passes[on_road].all() == (simulation.position[1, 0] > 73.3)
    np.testing.assert_allclose(hits.up_m[on_road], 0.05, atol=1e-6)


def test_a_block_that_comes_to_rest_against_a_wall_is_held_by_it() -> None:
    """Down a slope of 45° into a wall, against which they lean; one rolls past its end and out of the terrain."""
    fence = wall((60, 20), (60, 100), -70.0, -55.0)
    ground = make_ground(plane(1.0), {"hut": wall((5, 5), (5, 8), -6.0, -4.0), "fence": fence})
    start = np.array([[40.0, 50, -39], [40.0, 80, -39], [40.0, 10, -39]])
    releases = make_releases(start, diameter_m=0.8)
    simulation = simulate(ground, releases, Settings(AZIMI, {"rn": 0.2, "rt": 0.8}))
    assert [simulation.ends[end] for end in simulation.end] == ["structure:fence", "structure:fence", "left_terrain"]
    assert simulation.at_rest.tolist() == [True, True, False]
    np.testing.assert_allclose(simulation.position[:2, 0], 60 - 0.4, atol=0.004 + 1e-6)
    beside = simulate(
        make_ground(plane(), {"fence": wall((60, 20), (60, 100), 0.0, 2.0)}),
        make_releases(np.array([[59.0, 60.0, 1.0]]), diameter_m=0.8),
        Settings(AZIMI),
    )
    assert [beside.ends[end] for end in beside.end] == ["stopped"]


def test_intervals_hold_what_they_are_for() -> None:
    """Of 2 000 samples of 200 exponential numbers, 95 % of the intervals contain the true 95 % quantile, ln 20."""
    rng = np.random.default_rng(3)
    found = [convergence(rng.exponential(size=200)) for _ in range(2000)]
    share = np.mean([one.q95_low <= np.log(20) <= one.q95_high for one in found])
    assert 0.945 < share < 0.985
    inside = np.mean([abs(one.mean - 1) < 1.96 * one.standard_error for one in found])
    assert 0.92 < inside < 0.97
    assert np.std([one.q95 for one in found]) == pytest.approx(np.sqrt(0.05 * 0.95 / 200) / 0.05, rel=0.1)
    few = convergence(np.array([1.0, 2.0, 3.0]))
    assert (few.mean, few.standard_error) == (2.0, pytest.approx(1 / np.sqrt(3)))
    assert np.isnan(few.q95_high)
    assert np.isnan(convergence(np.array([4.0])).standard_error)
