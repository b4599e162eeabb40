# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps against closed forms: one parabola, a slide without friction, a Gaussian spread of directions."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard import cell_tally
from rockfall.core.hazard.cell_tally import CellTally, passages_of
from rockfall.core.hazard.cells import Cells, cells_over
from rockfall.core.hazard.maps import LAYERS
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.simulation.engine import IMPACT, Settings, Simulation, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.results import flights_of
from rockfall.core.terrain.surface import Surface
from scipy.special import ndtr

G = 9.81
PLAIN = Settings("azimi_desvarreux_1977", {"rn": 0.5, "rt": 0.9}, gravity_mps2=G)


def sheet(height: np.ndarray, spacing: float = 1.0) -> Surface:
    """A grid of heights [y, x]."""
    rows, columns = height.shape
    x, y = np.meshgrid(spacing * np.arange(columns), spacing * np.arange(rows))
    i = np.arange(rows * columns).reshape(rows, columns)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.stack([x, y, height], axis=-1).reshape(-1, 3)
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "sheet")


def plane(length: float, width: float, slope: float = 0.0) -> Surface:
    corners = [[0, 0, 0], [length, 0, -slope * length], [length, width, -slope * length], [0, width, 0.0]]
    return Surface(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "plane")


def rough(size: int = 60) -> Surface:
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    return sheet(-0.6 * np.minimum(x, 40.0) + np.random.default_rng(2).normal(0, 0.12, (size, size)) + 0.0 * y)


def passages(simulation: Simulation, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    key, values = passages_of(simulation, cells)
    return np.where(key < 0, -1 - key, key), values.astype(np.float64)


def thrown(surface: Surface, position: list[float], velocity: list[float], **more: object) -> Simulation:
    releases = make_releases(np.array([position]), velocity=np.array([velocity]), diameter_m=0.5, **more)
    return simulate(make_ground(surface), releases, PLAIN)


def test_one_parabola_in_each_cell() -> None:
    slope, p, v = 0.5, np.array([3.3, 5.5, 4.0]), np.array([7.0, 0.0, 6.0])
    simulation = thrown(plane(60, 10, slope), p.tolist(), v.tolist(), angular_velocity=np.array([[0.0, 3.0, 4.0]]))
    key, values = passages(simulation, Cells(0.0, 0.0, 2.0, 30, 5))
    hit = simulation.records.time_s[np.flatnonzero(simulation.records.what == IMPACT)[0]]
    whole = int((p[0] + v[0] * hit) // 2) - 1  # cells that are left before the impact
    assert whole >= 5
    assert key[: whole + 1].tolist() == list(range(60 + 1, 60 + whole + 2))
    mass = simulation.releases.mass_kg[0]
    spin = 0.5 * 0.4 * mass * 0.25**2 * 25.0
    apex = (v[2] + slope * v[0]) / G
    for k, row in enumerate(values[:whole]):
        start, stop = max((2.0 * (k + 1) - p[0]) / v[0], 0.0), (2.0 * (k + 2) - p[0]) / v[0]
        square = max(49.0 + (6.0 - G * start) ** 2, 49.0 + (6.0 - G * stop) ** 2)
        t = min(max(apex, start), stop)
        height = p[2] + v[2] * t - 0.5 * G * t * t + slope * (p[0] + v[0] * t)
        expected = [square**0.5, 0.5 * mass * square + spin, 0.5 * mass * square, height]
        np.testing.assert_allclose(row, expected, rtol=1e-6)


def test_blocks_that_slide_without_friction_have_the_energy_of_their_fall() -> None:
    slope, n = np.tan(np.radians(30)), 1000
    ground = make_ground(plane(60, 40, slope))
    radius = 0.25
    xy = np.column_stack([np.full(n, 2.5), np.linspace(1, 39, n)])
    z = -slope * xy[:, 0] + radius / np.cos(np.radians(30))
    releases = make_releases(np.column_stack([xy, z]), diameter_m=2 * radius, density_kgpm3=np.linspace(2000, 3000, n))
    settings = Settings("azimi_desvarreux_1977", rolling="coulomb", friction=0.0, gravity_mps2=G)
    simulation = simulate(ground, releases, settings)
    tally = CellTally(Cells(0.0, 0.0, 1.0, 60, 40))
    tally.add(simulation)
    maps = tally.maps()
    assert np.nansum(maps.layers["Nr_blocks"][:, 10]) == n
    assert np.nansum(maps.layers["Reach_probability"][:, 10]) == pytest.approx(100.0)
    lower = np.arange(4, 58)  # the eastern border of each cell, where the energy is greatest
    fallen = slope * (lower + 1 - 2.5)
    weighted = np.nansum(maps.layers["Et_mean"] * maps.layers["Nr_passages"], axis=0)[lower] / n
    np.testing.assert_allclose(weighted, releases.mass_kg.mean() * G * fallen / 1000, rtol=1e-3)
    np.testing.assert_allclose(maps.layers["V_max"][20, lower], np.sqrt(2 * G * fallen), rtol=1e-3)
    np.testing.assert_allclose(maps.layers["Ph_max"][20, lower], radius / np.cos(np.radians(30)), rtol=1e-5)


def test_reach_probability_of_a_gaussian_spread_of_directions() -> None:
    n, deviation, start = 20_000, np.radians(8.0), np.array([0.5, 30.0])
    angle = np.random.default_rng(3).normal(0, deviation, n)
    speed = 400.0
    releases = make_releases(
        np.tile([*start, 50.0], (n, 1)),
        velocity=speed * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)]), diameter_m=0.5,
    )  # fmt: skip
    tally = CellTally(Cells(0.0, 0.0, 3.0, 33, 20))
    tally.add(simulate(make_ground(plane(99, 60)), releases, PLAIN))
    reach = np.nan_to_num(tally.maps().layers["Reach_probability"]) / 100
    worst = []
    for row in range(20):
        for column in range(2, 33):
            corner = np.array([[x, y] for x in (3 * column, 3 * column + 3) for y in (3 * row, 3 * row + 3)]) - start
            seen = np.arctan2(corner[:, 1], corner[:, 0]) / deviation
            probability = ndtr(seen.max()) - ndtr(seen.min())
            scatter = np.sqrt(max(probability * (1 - probability), 1 / n) / n)
            worst.append(abs(reach[row, column] - probability) / scatter)
    assert max(worst) < 4.5
    assert np.median(worst) > 0.1, "draws scatter"


def test_a_path_through_corners_and_along_an_edge() -> None:
    cells = Cells(0.0, 0.0, 1.0, 60, 60)
    key, _ = passages(thrown(plane(60, 60), [2.5, 2.5, 30.0], [10.0, 10.0, 0.0]), cells)
    rows, columns = np.divmod(key[:20], 60)
    assert rows.tolist() == columns.tolist() == list(range(2, 22)), "only the cells of the diagonal"
    key, _ = passages(thrown(plane(60, 60), [2.5, 7.0, 30.0], [10.0, 0.0, 0.0]), cells)
    rows, columns = np.divmod(key[:20], 60)
    assert (set(rows.tolist()), columns.tolist()) == ({7}, list(range(2, 22))), "an edge belongs to the cell beyond"
    key, _ = passages(thrown(plane(60, 60), [22.5, 7.0, 30.0], [-10.0, 0.0, 0.0]), cells)
    assert np.divmod(key[:20], 60)[1].tolist() == list(range(22, 2, -1))


def test_a_block_that_comes_back_passes_twice_and_is_one_block() -> None:
    wall = np.array([[20, 0, -5], [20, 10, -5], [20, 10, 20], [20, 0, 20.0]])
    floor = plane(40, 10)
    terrain = Surface(
        np.concatenate([floor.vertices, wall]), np.concatenate([floor.faces, [[4, 5, 6], [4, 6, 7]]]).astype(np.int32),
        GlobalShift(), "wall",
    )  # fmt: skip
    tally = CellTally(Cells(0.0, 0.0, 1.0, 40, 10))
    tally.add(thrown(terrain, [10.5, 5.5, 9.0], [15.0, 0.0, 0.0]))
    layers = tally.maps().layers
    assert layers["Nr_passages"][5, 17] == 2
    assert layers["Nr_blocks"][5, 17] == 1
    assert layers["Reach_probability"][5, 17] == 100
    assert np.isnan(layers["Nr_passages"][5, 21]), "nothing is behind the wall"


@pytest.mark.parametrize("drag", [None, Drag()], ids=["free", "drag"])
def test_no_moment_of_a_flight_is_above_the_map_and_the_map_is_not_above_all(drag: Drag | None) -> None:
    """Heights that rays find at moments a few millimetres apart, over triangles of any tilt."""
    ground = make_ground(rough())
    rng = np.random.default_rng(8)
    places = np.column_stack([rng.uniform(2, 6, 30), rng.uniform(10, 50, 30), np.full(30, 2.0)])
    velocity = np.tile([5.0, 0.0, 3.0], (30, 1))
    releases = make_releases(places, velocity=velocity, diameter_m=0.4)
    simulation = simulate(ground, releases, Settings("noel_2017", drag=drag, seed=2))
    records, cells = simulation.records, cells_over(ground.surface, 1.0)
    rows, duration = flights_of(simulation)
    moments = np.ceil(duration * 4000).astype(int) + 2
    which = np.repeat(np.arange(rows.size), moments)
    elapsed = (duration / (moments - 1))[which] * (np.arange(which.size) - (np.cumsum(moments) - moments)[which])
    air = releases.drag_per_m(drag)[records.run[rows[which]]]
    gravity = simulation.settings.gravity_mps2
    place, velocity = fly(records.position[rows[which]], records.v2[rows[which]], elapsed, gravity, air)
    inside = (np.abs(place[:, :2] - np.round(place[:, :2])) > 1e-4).all(axis=1)  # of one cell, with any rounding
    column, row = np.floor(place[:, :2]).astype(int).T
    inside &= (column >= 0) & (column < cells.columns) & (row >= 0) & (row < cells.rows)
    cell = np.where(inside, row * cells.columns + column, 0)
    found = np.full((2, len(cells)), -np.inf)
    np.fmax.at(found[0], cell[inside], ground.heights_in_flight(place)[inside])
    np.maximum.at(found[1], cell[inside], np.sqrt((velocity**2).sum(axis=1))[inside])
    key, values = passages(simulation, cells)
    mapped = np.full((2, len(cells)), -np.inf)
    np.fmax.at(mapped[0], key, values[:, 3])
    np.maximum.at(mapped[1], key, values[:, 0])
    seen = np.isfinite(found[0])
    above = mapped[:, seen] - found[:, seen]
    assert above.min() > (-1e-4 if drag is None else -1e-3), "with drag, on the parabolas of the simulation"
    assert np.quantile(above[0], 0.9) < 0.01


def test_below_an_overhang_the_height_is_that_above_the_ground_below() -> None:
    """A roof over a part of the plane, in one mesh: over it the height is that above the roof."""
    floor = plane(60, 20)
    roof = np.array([[20, 0, 6], [30, 0, 6], [30, 20, 6], [20, 20, 6.0]])
    terrain = Surface(
        np.concatenate([floor.vertices, roof]), np.concatenate([floor.faces, [[4, 5, 6], [4, 6, 7]]]).astype(np.int32),
        GlobalShift(), "roof",
    )  # fmt: skip
    cells = Cells(0.0, 0.0, 5.0, 12, 4)
    key, values = passages(thrown(terrain, [2.5, 12.5, 40.0], [30.0, 0.0, 0.0]), cells)
    heights = dict(zip((key - 24).tolist(), values[:, 3].tolist(), strict=True))
    entry = [40 - 0.5 * G * (max(5.0 * k - 2.5, 0) / 30) ** 2 for k in range(12)]
    assert [heights[k] for k in (2, 3)] == pytest.approx(entry[2:4], rel=1e-5)
    assert [heights[k] for k in (4, 5)] == pytest.approx([z - 6 for z in entry[4:6]], rel=1e-5)
    assert heights[7] == pytest.approx(entry[7], rel=1e-5)
    key, values = passages(thrown(terrain, [2.5, 12.5, 4.0], [30.0, 0.0, 0.0]), cells)
    below = dict(zip((key - 24).tolist(), values[:, 3].tolist(), strict=True))
    assert below[4] == pytest.approx(4 - 0.5 * G * (17.5 / 30) ** 2, rel=1e-5)


def test_passages_for_which_the_room_is_too_small_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of blocks on the same way: the run that has no room for its last is followed again from its beginning."""
    ground = make_ground(rough())
    releases = make_releases(np.tile([3.5, 30.5, 0.5], (9, 1)), velocity=np.tile([5.0, 0, 0], (9, 1)), diameter_m=0.5)
    runs, cells = simulate(ground, releases, PLAIN), cells_over(ground.surface, 1.0)
    key, values = passages_of(runs, cells)
    assert (key < 0).sum() == 9 * np.unique(key[key < 0]).size, "each run has a first passage through each cell"
    monkeypatch.setattr(cell_tally, "PER_METRE", 0.0)
    for room in (1, 2, 3):
        monkeypatch.setattr(cell_tally, "PER_RUN", room)
        again, their_values = passages_of(runs, cells)
        np.testing.assert_array_equal(again, key)
        np.testing.assert_array_equal(their_values, values)


def test_deposits_and_classes_of_energy() -> None:
    ground = make_ground(plane(60, 10))
    releases = make_releases(
        np.tile([5.5, 5.5, 0.5], (2, 1)), velocity=np.array([[0.0, 0, 0], [20.0, 0, 0]]), diameter_m=1.0
    )
    settings = Settings("azimi_desvarreux_1977", rolling="coulomb", friction=0.5, gravity_mps2=G)
    tally = CellTally(Cells(0.0, 0.0, 1.0, 60, 10))
    tally.add(simulate(ground, releases, settings))
    layers = tally.maps().layers
    stop = int(5.5 + 400 / (2 * G * 0.5))
    assert (layers["Nr_deposited"][5, 5], layers["Nr_deposited"][5, stop]) == (1, 1)
    assert np.nansum(layers["Nr_deposited"]) == 2
    assert layers["E_over_30kJ"][5, 5] == 50, "one of two has half of m v² = 283 kJ"
    assert layers["E_over_300kJ"][5, 5] == (50 if releases.mass_kg[1] * 200 > 300e3 else 0)
    assert set(layers) == set(LAYERS)


def test_an_empty_tally_has_maps_without_values() -> None:
    maps = CellTally(Cells(0.0, 0.0, 1.0, 3, 2)).maps()
    assert maps.blocks == 0
    assert all(np.isnan(values).all() and values.shape == (2, 3) for values in maps.layers.values())


def test_a_simulation_that_did_not_record_all() -> None:
    ground = make_ground(plane(20, 20))
    simulation = simulate(ground, make_releases(np.array([[5.0, 5.0, 2.0]])), PLAIN, record="impacts")
    with pytest.raises(InputError, match="whole motion"):
        CellTally(Cells(0.0, 0.0, 1.0, 20, 20)).add(simulation)
