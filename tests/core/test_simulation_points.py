# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks on points alone: contacts against closed forms, and the same falls as on triangles of the same surface."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases, overlapping, placed_on
from rockfall.core.terrain.cloud import Cloud, heights_above_points, nearest_points
from rockfall.core.terrain.kernels import STACK_SIZE
from rockfall.core.terrain.surface import Surface
from scipy.spatial import cKDTree

G = 9.81


def scattered(spacing: float, height, size: float = 20.0, seed: int = 1, noise: float = 0.0) -> Cloud:
    """Points at random places in plan, `spacing` the side of the square that each has on the mean."""
    rng = np.random.default_rng(seed)
    plan = rng.uniform(0, size, (int((size / spacing) ** 2), 2))
    z = height(*plan.T) + noise * rng.standard_normal(len(plan))
    return Cloud(np.column_stack([plan, z]), GlobalShift(), "cloud")


def lattice(spacing: float, size: float = 20.0) -> Cloud:
    line = np.arange(0, size, spacing)
    x, y = np.meshgrid(line, line)
    return Cloud(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), GlobalShift(), "lattice")


def falls_on(cloud: Cloud, radius: float, count: int, seed: int = 2):
    """Start, velocity, time, normal and place of first contacts of blocks that fall on it."""
    from rockfall.core.simulation.point_kernels import first_contact

    stack, times = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE)
    rng = np.random.default_rng(seed)
    for _ in range(count):
        start = np.array([*rng.uniform(8, 12, 2), radius + rng.uniform(0.2, 3)])
        velocity = np.array([*rng.normal(0, 2, 2), -rng.uniform(0, 6)])
        found = first_contact(
            cloud.index.tree, stack, times, tuple(start), tuple(velocity), (0.0, 0.0, -G), radius, np.inf
        )
        yield start, velocity, *found


def test_nearest_point_and_spacing() -> None:
    cloud = scattered(0.1, lambda x, y: np.sin(x) + 0.3 * y)
    places = np.random.default_rng(5).uniform([2, 2, -1], [18, 18, 4], (300, 3))
    distance, number = nearest_points(cloud, places)
    expected, which = cKDTree(cloud.points).query(places)
    np.testing.assert_allclose(distance, expected, rtol=1e-12)
    np.testing.assert_array_equal(number, which)
    slope = np.sqrt(1 + 0.09 + np.cos(cloud.points[:, 0]) ** 2)
    assert cloud.spacing_m == pytest.approx(0.1 * np.sqrt(np.median(slope)), rel=0.08)


def test_a_contact_is_where_the_parabola_meets_the_first_point_or_shortly_before() -> None:
    """The roots of |p + v t + ½ a t² − q|² = r² for every point near the path, by their polynomial."""
    cloud, radius = scattered(0.12, lambda x, y: 0.2 * np.sin(3 * x)), 0.3
    a = np.array([0, 0, -G])
    earlier = []
    for start, velocity, t, _, place in falls_on(cloud, radius, 100):
        away = start - cloud.points
        polynomials = np.column_stack(
            [
                np.full(len(away), a @ a / 4),
                np.full(len(away), velocity @ a),
                velocity @ velocity + away @ a,
                2 * away @ velocity,
                (away**2).sum(axis=1) - radius**2,
            ]
        )
        end = start + velocity * t + a / 2 * t**2
        near = np.flatnonzero(((cloud.points - end) ** 2).sum(axis=1) < (2 * radius) ** 2)
        first, which = np.inf, -1
        for i in near:
            roots = np.roots(polynomials[i])
            real = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0)].real
            if real.size and real.min() < first:
                first, which = real.min(), i
        assert cloud.index.number[place] == which
        assert t <= first + 1e-7
        earlier.append(np.linalg.norm(velocity + a * t) * (first - t))
    assert max(earlier) < 0.5 * radius
    assert np.median(earlier) < 0.05 * radius


@pytest.mark.parametrize(("spacing", "angle"), [(0.2, 0.1), (0.1, 0.02), (0.05, 0.02)])
def test_contacts_on_a_plane_of_points_against_the_closed_form(spacing: float, angle: float) -> None:
    """Between the points of a lattice a sphere sinks by r − √(r² − s²/2): no contact is later than that.

    The plane of the points gives the contact on the plane itself, up to the part that holds it level.
    """
    radius, cloud = 0.4, lattice(spacing)
    sag = radius - np.sqrt(radius**2 - spacing**2 / 2)
    for start, velocity, t, normal, _ in falls_on(cloud, radius, 150):
        plane = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * G * (start[2] - radius))) / G
        deep = (velocity[2] + np.sqrt(velocity[2] ** 2 + 2 * G * (start[2] - radius + sag))) / G
        assert plane - 1e-4 <= t <= deep
        assert t - plane < 0.02 * (deep - plane) + 1e-5
        assert np.degrees(np.arccos(min(normal[2], 1.0))) < angle


def test_the_normal_on_a_plane_of_random_points_betters_with_their_density() -> None:
    """The mean direction alone would be off by 0.33 s/r (rms): its scatter over a patch that counts by depth."""
    errors = {}
    for spacing in (0.2, 0.1, 0.05):
        cloud = scattered(spacing, lambda x, y: 0 * x)
        normals = np.array([normal for _, _, _, normal, _ in falls_on(cloud, 0.5, 300)])
        errors[spacing] = np.sqrt((np.arccos(np.minimum(normals[:, 2], 1.0)) ** 2).mean())
        assert errors[spacing] < 0.33 * spacing / 0.5
    assert errors[0.1] < errors[0.2] / 2
    assert errors[0.05] < errors[0.1] / 2
    noisy = [
        np.sqrt(np.mean([n[2] for *_, n, _ in falls_on(scattered(0.05, lambda x, y: 0 * x, noise=s), 0.5, 200)]))
        for s in (0.0, 0.02)
    ]
    assert noisy[1] < noisy[0]


def test_heights_above_points() -> None:
    cloud = scattered(0.1, lambda x, y: 0.8 * x + 0.1 * np.sin(x))
    rng = np.random.default_rng(4)
    plan, above = rng.uniform(2, 18, (500, 2)), rng.uniform(0.2, 5, 500)
    ground = 0.8 * plan[:, 0] + 0.1 * np.sin(plan[:, 0])
    heights = heights_above_points(cloud, np.column_stack([plan, ground + above]))
    np.testing.assert_allclose(heights, above, atol=0.01)
    below = heights_above_points(cloud, np.column_stack([plan, ground - 3.0]))
    np.testing.assert_allclose(below, -3.0, atol=0.01)
    assert np.isnan(heights_above_points(cloud, np.array([[-5.0, 3.0, 1.0]]))).all()


def test_releases_are_placed_on_points_and_their_depth_is_known() -> None:
    ground = make_ground(scattered(0.05, lambda x, y: -0.5 * x))
    places = placed_on(ground, np.array([[10.0, 10.0], [5.0, 12.0], [50.0, 10.0]]), np.full(3, 0.6))
    expected = -0.5 * places[:2, 0] + 0.3 * np.hypot(1, 0.5)
    np.testing.assert_allclose(places[:2, 2], expected, atol=0.01)
    assert np.isnan(places[2]).all()
    releases = make_releases(places[:2] - np.array([[0, 0, 0], [0, 0, 0.2]]), diameter_m=0.6)
    np.testing.assert_allclose(overlapping(ground, releases), [0, 0.2 / np.hypot(1, 0.5)], atol=0.01)
    with pytest.raises(InputError, match="beside the terrain"):
        overlapping(ground, make_releases(np.array([[50.0, 10.0, 0.0]]), diameter_m=0.6))


def test_blocks_that_would_fall_between_the_points_are_refused() -> None:
    ground = make_ground(lattice(0.5))
    releases = make_releases(np.array([[10.0, 10.0, 3.0]] * 3), diameter_m=np.array([2.0, 0.5, 0.6]))
    with pytest.raises(InputError, match=r"2 of 3 blocks would fall between the points of the terrain.*0\.5 m in diam"):
        simulate(ground, releases, Settings("azimi_desvarreux_1977"))


def test_a_wall_of_points_on_a_mesh_and_a_wall_of_triangles_on_points() -> None:
    flat = np.array([[0.0, 0, 0], [20, 0, 0], [20, 20, 0], [0, 20, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    floor = Surface(flat, faces, GlobalShift(), "floor")
    line, up = np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 2, 0.1))
    points = Cloud(np.column_stack([np.full(line.size, 15.0), line.ravel(), up.ravel()]), GlobalShift(), "wall")
    corners = np.array([[15.0, 0, 0], [15, 20, 0], [15, 20, 2], [15, 0, 2]])
    wall = Surface(corners, faces, GlobalShift(), "wall")
    releases = make_releases(np.array([[11.0, 10.0, 1.2]]), velocity=np.array([[20.0, 1.0, 0.0]]), diameter_m=1.0)
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.3, "rt": 0.8})
    for terrain, structure in ((floor, points), (lattice(0.1), wall), (lattice(0.1), points)):
        run = simulate(make_ground(terrain, {"wall": structure}), releases, settings)
        hits = run.ground.owner[run.records.face[run.records.what == 1]] == 1
        assert hits.any()
        assert 0.5 < 15 - run.position[0, 0] < 10
        first = np.flatnonzero(run.records.what == 1)[np.argmax(hits)]
        np.testing.assert_allclose(run.records.normal[first], [-1, 0, 0], atol=0.02)
        np.testing.assert_allclose(15 - run.records.position[first, 0], 0.5, atol=0.02)
