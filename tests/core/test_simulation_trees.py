# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks that meet stems: the published loss of energy, where they are met, chance of meeting one, and bits."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.barriers import with_barriers
from rockfall.core.hazard.cell_tally import passages_of
from rockfall.core.hazard.cells import cells_over
from rockfall.core.hazard.face_tally import FaceTally
from rockfall.core.hazard.screens import Screen, hits_at
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.simulation.engine import ENDS, ON_GROUND, TREE, Settings, Simulation, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.parabolas import parabolas_of
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.simulation.trees import Trees, greatest_loss, placed_trees, random_trees, taken_of
from rockfall.core.terrain.surface import Surface
from scipy.stats import kstest

MODEL = "azimi_desvarreux_1977"


def plane(slope: float = 0.0, length: float = 400.0):
    """Two triangles that fall towards +x."""
    corners = np.array([[0, 0], [length, 0], [length, length], [0, length]], np.float64)
    vertices = np.column_stack([corners, -slope * corners[:, 0]])
    return make_ground(Surface(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GlobalShift(), "plane"))


def stems(ground, places, dbh: float = 0.4, height: float = 10.0) -> Trees:
    places = np.atleast_2d(places)
    size = np.full(len(places), dbh)
    return placed_trees(ground.terrain, places, size, np.full(len(places), height), greatest_loss(size))


def thrown(y, speed, z: float = 4.0) -> Releases:
    y, speed = np.broadcast_arrays(np.asarray(y, np.float64), np.asarray(speed, np.float64))
    velocity = np.zeros((y.size, 3))
    velocity[:, 0] = speed
    start = np.column_stack([np.full(y.size, 5.0), y, np.full(y.size, z)])
    return make_releases(start, diameter_m=0.6, velocity=velocity)


def hits(simulation: Simulation) -> np.ndarray:
    return np.flatnonzero(simulation.records.what == TREE)


def squares(vectors) -> np.ndarray:
    return (np.asarray(vectors) ** 2).sum(axis=1)


def test_the_loss_of_energy_is_the_published_one() -> None:
    """E = 38.7 D^2.31 J with D in cm, the part by a sigmoid of the offset; straight on, beside, and past the stem."""
    ground, reach = plane(), 0.3 + 0.2
    offsets = np.repeat([0.0, 0.2, 0.45, 0.6, 0.72, 0.9], 3)
    speeds = np.tile([12.0, 30.0, 70.0], 6)
    releases = thrown(200 + offsets * reach, speeds)
    run = simulate(ground, releases, Settings(MODEL, trees=stems(ground, [[8.0, 200.0]])))
    rows = hits(run)
    first = rows[np.r_[True, np.diff(run.records.run[rows]) > 0]]
    assert run.records.run[first].tolist() == list(range(18))
    before = 0.5 * releases.mass_kg * squares(run.records.v1[first])
    sigmoid = -0.046 + (0.98 + 0.046) / (1 + 10 ** ((0.58 - offsets) * -8.007))
    loss = np.minimum(np.maximum(sigmoid, 0) * 38.7 * 40**2.31, before)
    after = 0.5 * releases.mass_kg * squares(run.records.v2[first])
    np.testing.assert_allclose(after, before - loss, rtol=1e-12, atol=1e-12 * before.max())
    assert (after == 0).sum() >= 4
    assert (loss == 0).sum() == 3
    np.testing.assert_allclose(squares(run.records.omega2[first]), 0, atol=0)


def test_stems_are_met_where_both_radii_touch_and_turn_blocks_away() -> None:
    """In flight, with drag, and on the ground: on the circle, never through a stem that stands."""
    ground = plane(0.8)
    y = 200 + np.linspace(-0.49, 0.49, 21)
    trees = stems(ground, [[30.0, 200.0]], height=60.0)
    low = ground.terrain.vertices[:, 2].min()
    for drag, above in ((None, 6.0), (Drag(), 6.0), (None, None)):
        if above is None:
            start = np.column_stack([np.full(21, 25.0), y, -0.8 * 25.0 + 0.3 * np.hypot(1, 0.8) + np.zeros(21)])
            releases = make_releases(start, diameter_m=0.6, velocity=np.tile([3.0, 0.0, -2.4], (21, 1)))
        else:
            releases = thrown(y, np.full(21, 15.0), above)
        settings = Settings(MODEL, trees=trees, drag=drag, friction=0.3)
        run = simulate(ground, releases, settings)
        records, rows = run.records, hits(run)
        first = rows[np.r_[True, np.diff(records.run[rows]) > 0]]
        assert first.size == 21
        assert records.position[:, 2].min() > low - 1
        away = records.position[first, :2] - [30.0, 200.0]
        np.testing.assert_allclose(np.hypot(*away.T), 0.5, atol=1e-9)
        np.testing.assert_allclose(records.normal[first, :2] * 0.5, away, atol=1e-9)
        on_ground = (records.what[first - 1] == ON_GROUND) & (records.time_s[first - 1] == records.time_s[first])
        assert on_ground.all() if above is None else not on_ground.any()
        moving = squares(records.v2[first]) > 0
        outward = (records.v2[first] * records.normal[first]).sum(axis=1)
        assert moving.any()
        np.testing.assert_allclose(outward, 0, atol=1e-9)
        assert (np.hypot(*(records.position[:, :2] - [30.0, 200.0]).T) > 0.5 - 0.02).all()
        side = np.sign(records.v2[first, 1])[moving & (np.abs(y - 200) > 0.01)]
        np.testing.assert_array_equal(side, np.sign(y - 200)[moving & (np.abs(y - 200) > 0.01)])


def test_a_block_passes_above_a_stem_and_below_nothing() -> None:
    ground = plane()
    trees = stems(ground, [[8.0, 200.0]], height=2.0)
    flat = Settings(MODEL, trees=trees)
    over, into, onto = (
        simulate(ground, thrown(200.0, speed, z), flat) for speed, z in ((30.0, 4.0), (10.0, 2.2), (6.0, 2.9))
    )
    assert over.tree_hits[0] == 0
    assert into.tree_hits[0] == 1
    assert onto.tree_hits[0] >= 1
    assert into.records.position[hits(into)[0], 2] < 2.0


def test_a_stem_that_gives_way_turns_and_slows_the_block_and_is_met_once() -> None:
    ground = plane()
    run = simulate(ground, thrown([200.2], [80.0], 6.0), Settings(MODEL, trees=stems(ground, [[10.0, 200.0]], 0.15)))
    row = hits(run)
    assert row.size == 1
    assert run.tree_hits.tolist() == [1]
    v1, v2, n = (getattr(run.records, name)[row[0]] for name in ("v1", "v2", "normal"))
    np.testing.assert_allclose(np.cross(v2 - v1, n), 0, atol=1e-9)
    assert (v2 - v1) @ n > 0
    assert v2 @ n < 0
    assert v2[1] > 0
    assert run.position[0, 0] > 50


def test_blocks_meet_as_many_stems_as_the_density_says() -> None:
    """Straight ways through a forest: n (D + 2r) stems a metre, and the way to the first is exponential."""
    ground = plane(length=1000.0)
    trees = random_trees(ground.terrain, 400.0, 0.3, 0.0, seed=4, height_m=50.0)
    assert abs(len(trees) - 40_000) < 4 * np.sqrt(40_000)
    y = np.arange(10.0, 990.0, 1.2)
    velocity = np.tile([2000.0, 0.0, 0.0], (y.size, 1))
    start = np.column_stack([np.full(y.size, 100.0), y, np.full(y.size, 20.0)])
    releases = make_releases(start, diameter_m=0.7, velocity=velocity)
    weak = Trees(trees.position, trees.foot_m, trees.height_m, trees.dbh_m, np.full(len(trees), 1e-6), trees.name)
    run = simulate(ground, releases, Settings(MODEL, trees=weak, gravity_mps2=1e-6, most_s=0.3))
    expected = 400e-4 * (0.3 + 0.7) * 600 * y.size
    rows = hits(run)
    assert abs((run.records.position[rows, 0] < 700.0).sum() - expected) < 4 * np.sqrt(expected)
    first = rows[np.r_[True, np.diff(run.records.run[rows]) > 0]]
    way = run.records.position[first, 0] - 100.0
    assert kstest(way, "expon", args=(0, 1 / (400e-4 * 1.0))).pvalue > 1e-3


def test_diameters_follow_their_law() -> None:
    trees = random_trees(plane().terrain, 2500.0, 0.32, 0.12, seed=1)
    assert abs(trees.dbh_m.mean() - 0.32) < 4 * 0.12 / np.sqrt(len(trees))
    assert abs(trees.dbh_m.std() / 0.12 - 1) < 0.03
    np.testing.assert_allclose(trees.energy_j, 0.93 * 38.7 * (100 * trees.dbh_m) ** 2.31, rtol=1e-12)
    again = random_trees(plane().terrain, 2500.0, 0.32, 0.12, seed=1)
    np.testing.assert_array_equal(again.position, trees.position)


@pytest.fixture(scope="module")
def slope() -> tuple:
    ground = plane(0.7)
    y = np.linspace(20, 380, 64)
    start = np.column_stack([np.full(64, 5.0), y, np.full(64, 1.0)])
    releases = make_releases(start, diameter_m=0.6, velocity=np.tile([4.0, 0.0, 0.0], (64, 1)))
    settings = Settings(MODEL, trees=random_trees(ground.terrain, 600.0, 0.35, 0.1, seed=3), friction=0.45)
    return ground, releases, settings, simulate(ground, releases, settings, threads=1)


def same(one: Simulation, other: Simulation) -> None:
    for name in ("what", "run", "time_s", "position", "v1", "v2", "omega2", "face"):
        np.testing.assert_array_equal(getattr(one.records, name), getattr(other.records, name))
    np.testing.assert_array_equal(one.tree_hits, other.tree_hits)


def test_a_run_does_not_depend_on_the_others_nor_on_the_threads(slope) -> None:
    ground, releases, settings, run = slope
    assert run.tree_hits.sum() > 100
    same(simulate(ground, releases, settings, threads=2), run)
    part = simulate(ground, releases.take(slice(40, 64)), settings, first_run=40)
    same(part, run.part(40, 64))


def test_trees_out_of_the_way_change_nothing(slope) -> None:
    ground, releases, _settings, _ = slope
    bare = Settings(MODEL, friction=0.45)
    far = Settings(MODEL, friction=0.45, trees=stems(ground, [[399.0, 1.0]]))
    same(simulate(ground, releases, far), simulate(ground, releases, bare))


def test_less_recorded_is_the_same_motion(slope) -> None:
    ground, releases, settings, run = slope
    for level in ("impacts", "ends"):
        same(simulate(ground, releases, settings, record=level), run.with_records(level))


def test_paths_go_through_the_hits_of_trees(slope) -> None:
    """What screens, maps and pictures follow ends where the next piece begins."""
    *_, run = slope
    pieces = parabolas_of(run)
    within = np.flatnonzero((pieces.run[1:] == pieces.run[:-1]) & np.isfinite(pieces.duration_s[:-1]))
    there, _ = pieces.states(within, pieces.duration_s[within])
    assert np.linalg.norm(there - pieces.position[within + 1], axis=1).max() < 0.02


def test_a_forest_keeps_blocks_back(slope) -> None:
    ground, releases, settings, run = slope
    bare = simulate(ground, releases, replace(settings, trees=None))
    assert (bare.position[:, 0] > 200).sum() > 2 * (run.position[:, 0] > 200).sum()
    assert (run.end == ENDS.index("stopped")).any()
    assert not bare.tree_hits.any()


def test_screens_and_maps_behind_a_stem_see_the_block_as_the_stem_left_it() -> None:
    ground = plane()
    releases = thrown([200.2], [80.0], 6.0)
    run = simulate(ground, releases, Settings(MODEL, trees=stems(ground, [[10.0, 200.0]], 0.15)))
    row = hits(run)[0]
    before, after = run.records.v1[row], run.records.v2[row]
    lines = [np.array([[x, 150.0], [x, 250.0]]) for x in (8.0, 12.0)]
    crossed = hits_at(run, [Screen(str(i), line) for i, line in enumerate(lines)])
    np.testing.assert_allclose(crossed.velocity[:, :2], [before[:2], after[:2]], rtol=1e-12)
    key, values = passages_of(run, cells_over(ground.surface, 1.0))
    column = np.where(key < 0, -1 - key, key) % 400
    speeds = [values[column == x, 0].max() for x in (8, 12)]
    assert np.hypot(*before[:2]) < speeds[0] < 1.001 * np.hypot(*before[:2])
    assert np.hypot(*after[:2]) < speeds[1] < 1.001 * np.hypot(*after[:2])


def test_a_barrier_before_a_stem_leaves_it_unhit() -> None:
    ground = plane()
    run = simulate(ground, thrown([200.2], [30.0], 6.0), Settings(MODEL, trees=stems(ground, [[20.0, 200.0]])))
    barrier = Screen("net", np.array([[15.0, 150.0], [15.0, 250.0]]), 20.0, 1e9)
    held = with_barriers(run, hits_at(run, [barrier]))
    assert run.tree_hits[0] > 0
    assert held.tree_hits.tolist() == [0]
    assert held.position[0, 0] == pytest.approx(15.0)


def test_a_stem_on_the_ground_does_not_end_the_stay_on_a_face() -> None:
    ground = plane(0.8)
    start = np.array([[25.0, 200.4, -0.8 * 25.0 + 0.3 * np.hypot(1, 0.8)]])
    releases = make_releases(start, diameter_m=0.6, velocity=np.array([[3.0, 0.0, -2.4]]))
    run = simulate(ground, releases, Settings(MODEL, trees=stems(ground, [[30.0, 200.0]]), friction=0.3))
    assert run.tree_hits[0] > 0
    tally = FaceTally(len(ground.owner))
    tally.add(run)
    contacts = tally.layers()["Nr_contacts"]
    face = run.records.face[hits(run)[0] - 1]
    assert contacts[face] == 1


def test_what_cannot_be_is_said() -> None:
    ground = plane()
    with pytest.raises(InputError, match="No tree stands on the terrain"):
        stems(ground, [[-500.0, 3.0]])
    with pytest.raises(InputError, match="diameter of 35 m") as refused:
        stems(ground, [[5.0, 3.0]], dbh=35.0)
    assert "cm" in (refused.value.advice or "")
    beside = stems(ground, [[5.0, 3.0], [-5.0, 3.0]])
    assert len(beside) == 1
    assert "1 of 2 trees stand beside the terrain" in beside.left_out[0]
    np.testing.assert_allclose(taken_of(np.array([0.0, 0.9])), [0.98, 0.0], atol=5e-5)
