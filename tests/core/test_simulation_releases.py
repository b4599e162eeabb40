# SPDX-License-Identifier: GPL-3.0-or-later
"""Where blocks are released: touching the terrain, as many on each square metre, as they were measured."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.simulation.blocks import Blocks, block_of
from rockfall.core.simulation.distributions import parse_distribution
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.measured_releases import from_impacts, from_reconstruction, start_times
from rockfall.core.simulation.polygons import Polygon
from rockfall.core.simulation.release import placed_on
from rockfall.core.simulation.release_sources import in_polygon, on_line, on_points, steeper_than
from rockfall.core.terrain.raycast import closest_points, heights_above
from rockfall.core.terrain.surface import Surface
from scipy import stats

SMALL = block_of("sphere", 0.2, 0.2, 0.2)


def strip(profile: list[tuple[float, float]], width: float = 40.0, steps: int = 20, cuts: int = 8) -> Surface:
    """A surface that is a profile of (x, z), drawn out along y; its normals are on the left of the way."""
    points = [
        (x0 + (x1 - x0) * k / cuts, z0 + (z1 - z0) * k / cuts)
        for (x0, z0), (x1, z1) in pairwise(profile)
        for k in range(cuts)
    ]
    points.append(profile[-1])
    y = np.linspace(0.0, width, steps + 1)
    vertices = np.array([(x, w, z) for x, z in points for w in y])
    i = np.arange(len(vertices)).reshape(len(points), -1)
    lower = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 3)
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "strip")


@pytest.fixture(scope="module")
def cliff() -> Ground:
    """20 m of plain, 30 m at 45°, 30 m at 85°, 10 m of overhang at 110°, and plain below, that falls along +x."""
    profile, x, z = [(0.0, 0.0)], 0.0, 0.0
    for length, degrees in ((20, 0), (30, 45), (30, 85), (10, 110), (40, 0)):
        x, z = x + length * np.cos(np.radians(degrees)), z - length * np.sin(np.radians(degrees))
        profile.append((x, z))
    return make_ground(strip(profile))


def dip_below(ground: Ground, releases) -> np.ndarray:
    nearest = closest_points(ground.terrain, releases.position)
    return np.degrees(np.arccos(ground.terrain.face_normals[nearest.face, 2]))


def test_blocks_touch_the_terrain_and_are_out_of_it(cliff: Ground) -> None:
    law = Blocks(diameter=parse_distribution("0.3..2"))
    for made in (
        steeper_than(cliff, np.radians(30), law, 500, 1),
        in_polygon(cliff, [square(5, 5, 45, 35)], law, 500, 1),
        on_line(cliff, [np.array([[2.0, 3.0, np.nan], [38.0, 30.0, np.nan]])], law, 200, 1),
        on_points(cliff, np.array([[10.0, 10.0, np.nan], [43.0, 20.0, -40.0]]), law, 50, 1),
    ):
        away = closest_points(cliff.terrain, made.position).distance
        np.testing.assert_allclose(away, made.radius_m, atol=3e-6)
        assert (heights_above(cliff.terrain, made.position) > 0).all()


def square(x0: float, y0: float, x1: float, y1: float, name: str = "") -> Polygon:
    return Polygon(name, (np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]),))


def test_a_wall_of_85_degrees_has_as_many_on_a_square_metre_as_a_slope_of_45(cliff: Ground) -> None:
    n = 20_000
    made = steeper_than(cliff, np.radians(40), SMALL, n, 5)
    dip = dip_below(cliff, made)
    counts = np.array([(abs(dip - angle) < 1).sum() for angle in (45, 85, 110)])
    assert counts.sum() > 0.998 * n  # a few touch the next face, across an edge
    per_m2 = counts / (np.array([30, 30, 10]) * 40)
    np.testing.assert_allclose(per_m2 / per_m2.mean(), 1.0, atol=0.05)
    assert made.position[abs(dip - 110) < 1, 2].max() < -40  # below the overhang's face, not on top


def test_places_are_uniform_within_large_triangles() -> None:
    """Two triangles of 40 m and their parts in a polygon: both coordinates are uniform, and do not go together."""
    ground = make_ground(strip([(0.0, 0.0), (40.0, -40.0)], steps=1, cuts=1))
    lift = 0.1 / np.sqrt(2)
    everywhere = steeper_than(ground, np.radians(40), SMALL, 4000, 3).position - [lift, 0, 0]
    some = in_polygon(ground, [square(10, 5, 30, 35)], SMALL, 4000, 3).position - [lift, 0, 0]
    for places, low, high in ((everywhere, (0, 0), (40, 40)), (some, (10, 5), (30, 35))):
        for axis in range(2):
            law = stats.uniform(low[axis], high[axis] - low[axis])
            assert stats.kstest(places[:, axis], law.cdf).pvalue > 1e-3
        assert abs(np.corrcoef(places[:, :2].T)[0, 1]) < 0.06


def test_polygons_have_as_many_on_each_square_metre_of_the_terrain(cliff: Ground) -> None:
    """Half on the plain, half over the slope of 45°, which has √2 times the area; and one with a hole."""
    foot = 20 + 15 / np.sqrt(2)
    made = in_polygon(cliff, [square(20 - 15 / np.sqrt(2), 5, foot, 25)], SMALL, 20_000, 2)
    dip = dip_below(cliff, made)
    assert (dip > 22).mean() == pytest.approx(np.sqrt(2) / (1 + np.sqrt(2)), abs=0.015)
    hole = np.array([[6.0, 10.0], [10.0, 10.0], [10.0, 14.0], [6.0, 14.0]])
    with_hole = Polygon("area", (square(2, 5, 14, 20).rings[0], hole))
    assert with_hole.area_m2 == pytest.approx(12 * 15 - 16)
    made = in_polygon(cliff, [with_hole], SMALL, 5000, 2)
    x, y = made.position[:, 0], made.position[:, 1]
    assert not ((x > 6) & (x < 10) & (y > 10) & (y < 14)).any()
    assert (y < 10).mean() == pytest.approx(12 * 5 / 164, abs=0.03)
    assert (made.name == "area").all()


def test_a_polygon_that_winds_is_cut_as_its_area_says(cliff: Ground) -> None:
    """A star on the flat, smaller than a face here and larger there: the area by the shoelace formula."""
    rng = np.random.default_rng(8)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 60))
    away = rng.uniform(2, 9, 60)
    ring = np.column_stack([10 + away * np.cos(angle), 20 + away * np.sin(angle)])
    x, y = ring.T
    shoelace = 0.5 * abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
    polygon = Polygon("", (ring,))
    assert polygon.area_m2 == pytest.approx(shoelace)
    terrain = cliff.terrain
    parts, source = polygon.clipped(terrain.vertices[terrain.faces])
    assert 0.5 * np.linalg.norm(np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0]), axis=1).sum() == (
        pytest.approx(shoelace)
    )
    assert polygon.contains(parts.mean(axis=1)[:, :2]).mean() > 0.999
    assert source.max() < len(terrain.faces)


def test_a_vertical_face_counts_with_its_own_area() -> None:
    wall = make_ground(strip([(0.0, 0.0), (10.0, 0.0), (10.0, -10.0), (30.0, -10.0)]))
    made = in_polygon(wall, [square(0, 10, 20, 30)], SMALL, 9000, 4)
    assert (dip_below(wall, made) > 80).mean() == pytest.approx(1 / 3, abs=0.02)


def test_steep_faces_within_a_polygon_only(cliff: Ground) -> None:
    made = in_polygon(cliff, [square(0, 0, 60, 20)], SMALL, 400, 2, steeper_than=np.radians(80))
    assert (dip_below(cliff, made) > 80).mean() > 0.98  # a few were moved on, to touch the foot
    assert made.position[:, 1].max() < 20.2


def test_a_line_gives_blocks_along_its_length(cliff: Ground) -> None:
    line = np.array([[2.0, 5.0, np.nan], [12.0, 5.0, np.nan], [12.0, 35.0, np.nan]])
    evenly = on_line(cliff, [line], SMALL, 40, evenly=True)
    np.testing.assert_allclose(evenly.position[:10, 0], np.arange(10) + 2.5, atol=1e-9)
    np.testing.assert_allclose(evenly.position[10:, 1], np.arange(30) + 5.5, atol=1e-9)
    by_chance = on_line(cliff, [line], SMALL, 4000, 3)
    assert (by_chance.position[:, 1] < 5.01).mean() == pytest.approx(0.25, abs=0.03)
    drawn_on_the_wall = np.array([[42.0, 5.0, -30.0], [42.0, 35.0, -30.0]])
    on_wall = on_line(cliff, [drawn_on_the_wall], SMALL, 20, names=["edge"])
    assert (dip_below(cliff, on_wall) > 80).all()
    assert (on_wall.name == "edge").all()


def test_one_more_block_changes_no_other_place(cliff: Ground) -> None:
    law = Blocks(diameter=parse_distribution("0.3..6"))
    for make in (
        lambda n: steeper_than(cliff, np.radians(40), law, n, 9),
        lambda n: in_polygon(cliff, [square(5, 5, 45, 35)], law, n, 9),
        lambda n: on_line(cliff, [np.array([[2.0, 5.0, np.nan], [12.0, 35.0, np.nan]])], SMALL, n, 9),
    ):
        few, many = make(20), make(200)
        np.testing.assert_array_equal(few.position, many.position[:20])
        np.testing.assert_array_equal(few.mass_kg, many.mass_kg[:20])


def test_a_block_rests_between_the_walls_of_a_ditch_and_on_its_edges() -> None:
    """A sphere of radius r between two planes of 45° has its centre √2 r above their edge; a slot is bridged."""
    ditch = make_ground(strip([(0.0, 0.0), (20.0, -20.0), (40.0, 0.0)]))
    made = on_points(ditch, np.array([[20.0, 20.0, np.nan]]), block_of("sphere", 4, 4, 4))
    np.testing.assert_allclose(made.position, [[20.0, 20.0, -20 + 2 * np.sqrt(2)]], atol=1e-4)
    slot = make_ground(strip([(0.0, 0.0), (20.0, 0.0), (20.2, -3.0), (20.8, -3.0), (21.0, 0.0), (40.0, 0.0)]))
    made = on_points(slot, np.array([[20.5, 20.0, np.nan]]), block_of("sphere", 2, 2, 2))
    np.testing.assert_allclose(made.position[0, 2], np.sqrt(1 - 0.25), atol=0.01)


def test_spheres_dropped_on_a_slope_touch_it_from_above(cliff: Ground) -> None:
    places = np.array([[30.0, 20.0], [10.0, 10.0], [500.0, 0.0]])
    centres = placed_on(cliff, places, np.array([1.0, 0.5, 1.0]))
    assert np.isnan(centres[2]).all()
    np.testing.assert_allclose(centres[:2, :2], places[:2])
    np.testing.assert_allclose(centres[:2, 2], [-10 + 0.5 * np.sqrt(2), 0.25], atol=1e-5)


@pytest.fixture(scope="module")
def measured():
    """A block that flies from 5 m above the plain, hits it twice, and one that is seen from its first impact on."""
    g = 9.81
    fall = np.sqrt(2 * 5 / g)
    first = np.array([2.0 + 3 * fall, 10.0, 0.0])
    return reconstruct(
        make_picks(
            ["a", "a", "a", "b", "b"],
            [0.0, fall, fall + 0.5, 10.0, 10.6],
            [[2.0, 10.0, 5.0], first, first + np.array([1.0, 0.5, 0.0]), [4.0, 20.0, 0.0], [6.0, 20.0, 0.0]],
            kind=["release", "impact", "impact", "impact", "impact"],
            normal=[[0.0, 0.0, 1.0]] * 5,
            angular_velocity=[[np.nan] * 3, [np.nan] * 3, [0.0, 7.0, 0.0], [np.nan] * 3, [np.nan] * 3],
        ),
        block=Block(0.6, 0.5, 0.4, 2700, "box"),
    )


def test_measured_releases_and_impacts_start_as_they_were_measured(cliff: Ground, measured) -> None:
    made = from_reconstruction(cliff, measured, number=2)
    assert made.name.tolist() == ["a", "a", "b", "b"]
    np.testing.assert_allclose(made.position[0], [2.0, 10.0, 5.0], atol=1e-9)
    np.testing.assert_allclose(made.velocity[0], [3.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(made.position[2], [4.0, 20.0, 0.25], atol=1e-5)
    rise = 9.81 * 0.6 / 2
    np.testing.assert_allclose(made.velocity[2], [2 / 0.6, 0.0, rise], atol=1e-9)
    np.testing.assert_allclose(made.angular_velocity[2], [0.0, 2 / 0.6 / 0.25, 0.0], atol=1e-9)
    np.testing.assert_allclose(made.mass_kg, 2700 * 0.6 * 0.5 * 0.4)
    assert (made.shape == "box").all()
    assert made.remarks[0].text == (
        "1 of 2 trajectories begins with an impact instead of a release: the simulated blocks start just after it."
    )
    assert start_times(measured) == {"a": 0.0, "b": 10.0}

    leaving = from_impacts(cliff, measured.impacts)
    assert leaving.name.tolist() == ["a 1", "b 1"]
    np.testing.assert_allclose(leaving.velocity[0], [2.0, 1.0, 9.81 * 0.25], atol=1e-9)
    np.testing.assert_allclose(leaving.angular_velocity[0], [0.0, 7.0, 0.0])
    np.testing.assert_allclose(leaving.mass_kg, 2700 * 0.6 * 0.5 * 0.4)
    np.testing.assert_allclose(from_impacts(cliff, measured.impacts, spin="zero").angular_velocity[1], 0.0)
    assert "2 of 4 impacts are left out" in str(leaving.remarks[0])


def test_a_release_has_the_spin_that_was_measured_in_its_flight(cliff: Ground, measured) -> None:
    np.testing.assert_allclose(from_reconstruction(cliff, measured).angular_velocity[0], 0.0)
    omega = measured.picks.angular_velocity.copy()
    omega[1] = [1.0, 9.0, -2.0]
    turning = replace(measured, picks=replace(measured.picks, angular_velocity=omega))
    np.testing.assert_allclose(from_reconstruction(cliff, turning).angular_velocity[0], [1.0, 9.0, -2.0])
    other = from_impacts(cliff, measured.impacts, SMALL, 3)
    assert len(other) == 6
    np.testing.assert_allclose(other.diameter_m, 0.2)


def test_bad_input_is_refused_in_words(cliff: Ground) -> None:
    line = np.array([[2.0, 5.0, np.nan], [12.0, 5.0, np.nan]])
    for make, message in (
        (lambda: steeper_than(cliff, np.radians(120), SMALL, 10), "the steepest is 110.0°"),
        (lambda: steeper_than(cliff, np.radians(200), SMALL, 10), "200° is no angle"),
        (lambda: steeper_than(cliff, np.nan, SMALL, 10), "no angle"),
        (lambda: steeper_than(cliff, 0.5, SMALL, 0), "0 blocks"),
        (lambda: steeper_than(cliff, 0.5, SMALL, 10**9), "too many"),
        (lambda: steeper_than(cliff, 0.5, block_of("sphere", 400, 400, 400), 10), "larger than the terrain"),
        (lambda: on_line(cliff, [line[:1]], SMALL, 5), "no length"),
        (lambda: on_line(cliff, [line[[0, 0]]], SMALL, 5), "no length"),
        (lambda: on_line(cliff, [line - np.array([0.0, 30.0, 0.0])], SMALL, 5), "wholly outside of the terrain"),
        (lambda: on_line(cliff, [], SMALL, 5), "no line"),
        (lambda: on_points(cliff, np.array([[10.0, 10.0, 99.0]]), SMALL), "99.0 m from the terrain"),
        (lambda: in_polygon(cliff, [square(500, 500, 510, 510)], SMALL, 5), "wholly outside of the terrain"),
        (lambda: in_polygon(cliff, [square(2, 2, 9, 9)], SMALL, 5, steeper_than=1.0), "steeper than 57"),
        (lambda: square(2, 2, 9, 2), "fewer than three corners|no area"),
        (lambda: Polygon("x", (np.array([[0.0, 0], [1, 1], [2, 2], [3, 3]]),)), "polygon x has no area"),
        (lambda: Polygon("x", (np.array([[0.0, 0], [4, 4], [4, 0], [0, 3]]),)), "crosses itself"),
    ):
        with pytest.raises(InputError, match=message):
            make()
