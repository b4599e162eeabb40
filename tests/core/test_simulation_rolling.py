# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks on the ground that are taken over edges in closed form: what is near them, and the ways that they go."""

import numpy as np
import pytest
from rockfall.core.constants import GRAVITY_MPS2
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.simulation import engine
from rockfall.core.simulation.engine import ENDS, Settings, simulate
from rockfall.core.simulation.facet_kernels import _look_about
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.terrain.cloud import Cloud
from rockfall.core.terrain.kernels import STACK_SIZE
from rockfall.core.terrain.raycast import closest_points
from rockfall.core.terrain.surface import Surface

ROLLS = {"rn": 0.0, "rt": 1.0}


def sheet(x: np.ndarray, y: np.ndarray, height) -> Surface:
    x, y = np.meshgrid(x, y)
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(
        np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3), faces.astype(np.int32), GlobalShift(), "sheet"
    )


def needles(count: int, seed: int) -> Surface:
    """A slope of triangles of any shape: rows of very different widths, their nodes moved at random."""
    rng = np.random.default_rng(seed)
    x = np.concatenate([[0.0], np.cumsum(rng.choice([0.03, 0.2, 0.9, 2.5], count))])
    x, y = x * (30 / x[-1]), np.linspace(0, 20, 24)
    rough = rng.normal(0, 1, (24, count + 1))
    return sheet(x, y, lambda x, y: -0.5 * x + 0.03 * rough * np.minimum(np.gradient(x, axis=1), 1.0))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_no_block_rolls_deeper_than_a_thousandth_on_needles(seed: int) -> None:
    ground = make_ground(needles(60, seed))
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(2, 6, 60), rng.uniform(3, 17, 60), np.full(60, 1.0)])
    diameter = rng.choice([0.2, 0.6, 1.4], 60)
    releases = make_releases(places, velocity=np.tile([3.0, 0.5, 0.0], (60, 1)), diameter_m=diameter)
    records = simulate(ground, releases, Settings("azimi_desvarreux_1977", {"rn": 0.1, "rt": 0.95})).records
    rolls = np.flatnonzero(records.what == engine.ON_GROUND)
    assert rolls.size > 2000
    radius = diameter[records.run[rolls]] / 2
    distance = closest_points(ground.terrain, records.position[rolls]).distance
    assert ((radius - distance) / radius).max() < 1e-3 + 1e-7


@pytest.mark.parametrize("diameter", [0.3, 1.2])
def test_no_rolling_block_passes_a_wall_that_shares_no_corner_with_the_terrain(diameter: float) -> None:
    """A thin wall of one large triangle pair stands through the triangles of a slope, at an angle to their edges."""
    slope = sheet(np.arange(0.0, 31.0), np.arange(0.0, 21.0), lambda x, y: -0.5 * x + 0.02 * np.sin(3 * x + 2 * y))
    corners = np.array([[19.3, -1.0, -14.0], [20.9, 21.0, -14.0], [20.9, 21.0, -5.0], [19.3, -1.0, -5.0]])
    wall = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "wall")
    rng = np.random.default_rng(4)
    places = np.column_stack([rng.uniform(8, 12, 200), rng.uniform(5, 15, 200), np.zeros(200)])
    places[:, 2] = -0.5 * places[:, 0] + 0.6 * diameter + 0.03
    releases = make_releases(places, velocity=np.tile([4.0, 0.0, -2.0], (200, 1)), diameter_m=diameter)
    run = simulate(make_ground(slope, {"wall": wall}), releases, Settings("azimi_desvarreux_1977", ROLLS, friction=0.3))
    records = run.records
    assert (records.what == engine.ON_GROUND).sum() > 2000
    normal = np.array([22.0, -1.6, 0.0]) / np.hypot(22.0, 1.6)
    before = (records.position - corners[0]) @ normal
    assert -0.5 * diameter - 0.01 < before.max() < -0.5 * diameter * (1 - 1e-3) + 1e-7
    assert (run.end != ENDS.index("left_terrain")).all()


@pytest.mark.parametrize("spacing", [0.11, 1.0, 7.0])
def test_the_energy_line_holds_over_gentle_edges_of_any_size(spacing: float) -> None:
    """v² = 2 g (drop − μ way in plan) where a block slides straight down a valley of facets, whatever their size."""
    line = np.arange(0.0, 60.0 + spacing, spacing)
    profile = lambda x: 0.004 * (x - 60.0) ** 2  # noqa: E731
    ground = make_ground(sheet(line, np.linspace(0, 20, 3), lambda x, y: profile(x)))
    at = np.searchsorted(line, 5.0)
    middle = 0.5 * (line[at - 1] + line[at])
    slope = (profile(line[at]) - profile(line[at - 1])) / spacing
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    height = 0.5 * (profile(line[at - 1]) + profile(line[at]))
    start = np.array([[middle, 9.7, height]]) + 0.2 * normal
    releases = make_releases(start, velocity=-1e-4 * normal[None], diameter_m=0.4)
    settings = Settings("azimi_desvarreux_1977", ROLLS, rolling="coulomb", friction=0.1)
    records = simulate(ground, releases, settings).records
    rolls = records.what == engine.ON_GROUND
    drop, way = start[0, 2] - records.position[rolls, 2], records.position[rolls, 0] - start[0, 0]
    expected = 2 * GRAVITY_MPS2 * (drop - 0.1 * way)
    speed2 = (records.v2[rolls] ** 2).sum(axis=1)
    assert rolls.sum() > 5
    assert speed2.max() > 50
    np.testing.assert_allclose(speed2, expected, atol=0.005 * expected.max())


def test_what_a_sphere_is_clear_of_does_not_depend_on_who_asked_before() -> None:
    """Small and large blocks alone, together, and in the other order: the same bits."""
    surface = needles(40, 5)
    rng = np.random.default_rng(6)
    places = np.column_stack([rng.uniform(2, 6, 40), rng.uniform(3, 17, 40), np.full(40, 1.0)])
    diameter = np.where(np.arange(40) % 2, 0.2, 1.6)
    releases = make_releases(places, velocity=np.tile([3.0, 0.5, 0.0], (40, 1)), diameter_m=diameter)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.1, "rt": 0.95})

    def ends(ground: Ground, numbers: list[int]) -> dict[int, tuple[float, ...]]:
        runs = [simulate(ground, releases.take(slice(i, i + 1)), settings, first_run=i) for i in numbers]
        return {i: (*run.position[0], run.time_s[0]) for i, run in zip(numbers, runs, strict=True)}

    forth, back = ends(make_ground(surface), [*range(40)]), ends(make_ground(surface), [*range(39, -1, -1)])
    assert forth == back


def test_whether_a_sphere_is_clear_is_the_same_after_a_lookup_for_a_larger_one() -> None:
    """On a steep, rough slope: triangles high above the plane of another are looked at by large spheres only."""
    line, rng = np.arange(0.0, 20.0, 0.4), np.random.default_rng(3)
    surface = sheet(line, line, lambda x, y: -2.0 * x + rng.normal(0.0, 0.1, np.shape(x)))
    found = {}
    for radius in (0.15, 0.3, 0.8):
        ground = make_ground(surface)
        stack = np.empty(STACK_SIZE, np.int64)
        for i in range(len(ground.faces)):
            _look_about(ground.tree[:4], stack, ground.facets, i, radius)
        found[radius] = ground.facets[2]
    small = np.abs(found[0.15][:, 0]) >= 0.15
    assert 0.02 < small.mean() < 0.98
    for radius in (0.3, 0.8):
        np.testing.assert_array_equal(np.abs(found[radius][:, 0]) >= 0.15, small)
        np.testing.assert_array_equal(found[radius][:, 1:], found[0.15][:, 1:])


@pytest.mark.parametrize(("law", "part"), [("azzoni_1995", 5 / 7), ("coulomb", 1.0)])
@pytest.mark.parametrize("points", [False, True])
def test_drag_slows_blocks_on_the_ground_as_in_closed_form(law: str, part: float, points: bool) -> None:
    """Down a plane, v² = v∞² (1 − exp(−2 A k s)) with v∞² = g (sin β − μ cos β)/k, in air 200 times as dense."""
    slope, mu = np.radians(35.0), 0.4
    line, across = (
        (np.arange(0.0, 60.0, 0.2), np.arange(0.0, 4.0, 0.2)) if points else np.array([[0, 30, 60], [0, 2, 4]])
    )
    surface = sheet(line, across, lambda x, y: -np.tan(slope) * x)
    cloud = Cloud(surface.vertices, GlobalShift(), "plane")
    up = np.array([np.sin(slope), 0.0, np.cos(slope)])
    place = np.array([[4.0, 1.9, -np.tan(slope) * 4.0]]) + 0.5 * up
    releases = make_releases(place, diameter_m=1.0)
    thick = Drag(air_density=240.0)
    settings = Settings("azimi_desvarreux_1977", ROLLS, drag=thick, rolling=law, friction=mu)
    records = simulate(make_ground(cloud if points else surface), releases, settings).records
    rolls = records.what == engine.ON_GROUND
    k = releases.drag_per_m(thick)[0]
    way = np.linalg.norm(records.position[rolls] - place, axis=1)
    true = np.sqrt(GRAVITY_MPS2 * (np.sin(slope) - mu * np.cos(slope)) / k * -np.expm1(-2 * part * k * way))
    speed = np.linalg.norm(records.v2[rolls], axis=1)
    far = (way > 3.0) & (way < 45.0)
    assert far.sum() > 20
    assert 2 * part * k * way[far].max() > 2
    np.testing.assert_allclose(speed[far], true[far], rtol=0.01)


def noisy_plane(sigma: float) -> Surface:
    """30° down, then flat, with a point every 10 cm that is off by as much."""
    rng = np.random.default_rng(3)
    line, across = np.arange(0.0, 50.0, 0.1), np.arange(0.0, 16.0, 0.1)
    steep = np.tan(np.radians(30.0))
    return sheet(
        line,
        across,
        lambda x, y: steep * (2.0 * np.logaddexp(0.0, (x - 22.0) / 2.0) - x) + rng.normal(0, sigma, x.shape),
    )


@pytest.mark.parametrize(("diameter", "sigma"), [(0.3, 0.003), (1.0, 0.01)])
def test_noise_of_a_scan_below_the_scale_of_the_block_is_no_friction(diameter: float, sigma: float) -> None:
    """The stop is that of the energy line: drop/μ, though noel_2017 takes most of the speed at each impact."""
    ground, friction = make_ground(noisy_plane(sigma)), 0.35
    start = placed_on(ground, np.column_stack([np.full(5, 2.0), np.linspace(7, 9, 5)]), np.full(5, diameter))
    way = np.array([np.cos(np.radians(30)), 0.0, -np.sin(np.radians(30))])
    releases = make_releases(start, velocity=np.tile(way, (5, 1)), diameter_m=diameter)
    run = simulate(ground, releases, Settings("noel_2017", friction=friction))
    drop = start[:, 2] - run.position[:, 2]
    head = 1.4 / (2 * GRAVITY_MPS2)  # of the start's 1 m/s and its spin
    assert (run.end == ENDS.index("stopped")).all()
    np.testing.assert_allclose((run.position - start)[:, 0], (drop + head) / friction, rtol=0.04)


def test_a_sharp_kink_takes_as_much_with_noise_around() -> None:
    """45° onto 14°: (cos T + c)/(1 + c) of the speed, whatever a point every 10 cm is off by."""
    steep, gentle, turn, radius = 1.0, np.tan(np.radians(14.0)), np.radians(31.0), 0.15
    stops = []
    for sigma in (0.0, 0.002):
        rng = np.random.default_rng(3)
        line, across = np.arange(0.0, 60.0, 0.1), np.arange(0.0, 8.0, 0.1)
        bent = lambda x, y: np.where(x < 5.0, 5.0 - steep * x, gentle * (5.0 - x)) + rng.normal(0, sigma, x.shape)  # noqa: E731,B023
        ground = make_ground(sheet(line, across, bent))
        start = placed_on(ground, np.column_stack([np.full(5, 1.0), np.linspace(3.5, 4.5, 5)]), np.full(5, 2 * radius))
        velocity = np.tile([np.sqrt(0.5), 0.0, -np.sqrt(0.5)], (5, 1))
        releases = make_releases(start, velocity=velocity, diameter_m=2 * radius)
        run = simulate(ground, releases, Settings("azimi_desvarreux_1977", ROLLS, friction=0.5))
        stops.append(float((run.position - start)[:, 0].mean()))
    kept = ((np.cos(turn) + 0.4) / 1.4) ** 2
    before = 1.4 / (2 * GRAVITY_MPS2) + 4.0 * (1.0 - 0.5)  # less the friction of the way to the kink
    expected = 4.0 + kept * before / (0.5 - gentle)
    assert stops[0] == pytest.approx(expected, rel=0.03)
    assert stops[1] == pytest.approx(stops[0], rel=0.05)
