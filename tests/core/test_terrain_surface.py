# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays, closest points, heights and winding against analytic cases and independent computations."""

import numpy as np
import pytest
import trimesh
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.cleaning import examine_faces, merge_duplicates
from rockfall.core.terrain.index import build_index
from rockfall.core.terrain.raycast import any_hit, cast_ray, cast_rays, closest_point, closest_points, heights_above
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.winding import orient


def surface_of(vertices, faces) -> Surface:
    return Surface(np.asarray(vertices, float), np.asarray(faces, np.int32), GlobalShift(), "test")


def of_mesh(mesh: trimesh.Trimesh) -> Surface:
    return surface_of(mesh.vertices, mesh.faces)


def rough_sheet(n: int, seed: int = 0) -> Surface:
    x, y = np.meshgrid(np.arange(float(n)), np.arange(float(n)))
    z = np.random.default_rng(seed).normal(0, 1, x.shape)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return surface_of(np.stack([x, y, z], -1).reshape(-1, 3), faces)


def brute_force_hits(triangles, origin, direction) -> float:
    """Möller & Trumbore, written independently of the kernels."""
    e1, e2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(direction, e2)
    det = (e1 * p).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - triangles[:, 0]
        u = (s * p).sum(1) / det
        q = np.cross(s, e1)
        v = (q @ direction) / det
        t = (e2 * q).sum(1) / det
        hit = (det != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
    return t[hit].min() if hit.any() else np.inf


def test_normals_of_plane_box_and_sphere():
    plane = surface_of([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_allclose(plane.face_normals, [[-(0.5**0.5), 0, 0.5**0.5]] * 2, atol=1e-15)
    np.testing.assert_allclose(plane.vertex_normals, [[-(0.5**0.5), 0, 0.5**0.5]] * 4, atol=1e-15)
    assert plane.face_areas.sum() == pytest.approx(2**0.5)
    box = of_mesh(trimesh.creation.box((2, 2, 2)))
    centres = box.vertices[box.faces].mean(axis=1)
    np.testing.assert_allclose((box.face_normals * centres).sum(1), 1.0)
    assert box.mean_spacing_m == pytest.approx((24 / 8) ** 0.5)
    sphere = of_mesh(trimesh.creation.icosphere(4, 3.0))
    np.testing.assert_allclose(sphere.vertex_normals, sphere.vertices / 3, atol=6e-3)
    np.testing.assert_array_equal(sphere.bounds, [sphere.vertices.min(0), sphere.vertices.max(0)])


def test_mean_spacing_is_that_of_a_grid_whatever_its_slope_and_noise():
    flat = rough_sheet(101)
    assert flat.mean_spacing_m == pytest.approx(100 / 101, rel=0.02)
    tilted = surface_of(flat.vertices * [1, 1, 0] + flat.vertices[:, :1] * [0, 0, 1], flat.faces)
    assert tilted.mean_spacing_m == pytest.approx(100 / 101 * 2**0.25)


def test_rays_on_a_plane():
    plane = surface_of([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2], [0, 2, 3]])
    hits = cast_rays(
        plane, [[1, 2, 4], [1, 2, -4], [1, 2, 4], [20, 0, 1]], [[3, 0, -4], [0, 0, 2], [0, 0, 1], [0, 0, -1]]
    )
    np.testing.assert_allclose(hits.distance, [5, 4, np.inf, np.inf])
    np.testing.assert_allclose(hits.point[:2], [[4, 2, 0], [1, 2, 0]], atol=1e-15)
    np.testing.assert_array_equal(hits.face >= 0, [True, True, False, False])
    assert np.isnan(hits.point[2:]).all()
    assert cast_rays(plane, [1, 2, 4], [0, 0, -1], max_distance=3.9).face[0] == -1
    assert cast_rays(plane, [1, 2, 4], [0, 0, -1e-200], max_distance=4.0).distance[0] == 4.0


def test_rays_agree_with_brute_force_on_a_random_soup():
    rng = np.random.default_rng(1)
    triangles = rng.uniform(-1, 1, (300, 1, 3)) + rng.normal(0, 0.2, (300, 3, 3))
    soup = surface_of(triangles.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    origins, directions = rng.uniform(-2, 2, (2000, 3)), rng.normal(0, 1, (2000, 3))
    directions[::3, rng.integers(0, 3)] = 0.0
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    expected = [brute_force_hits(triangles, o, d) for o, d in zip(origins, unit, strict=True)]
    hits = cast_rays(soup, origins, directions)
    np.testing.assert_allclose(hits.distance, expected, rtol=1e-9, atol=1e-12)
    assert np.isfinite(expected).sum() > 300
    on_face = hits.face >= 0
    corner = triangles[hits.face[on_face], 0]
    off_plane = ((hits.point[on_face] - corner) * soup.face_normals[hits.face[on_face]]).sum(1)
    np.testing.assert_allclose(off_plane, 0, atol=1e-12)


def test_no_ray_leaks_through_shared_edges_and_vertices():
    sphere = of_mesh(trimesh.creation.icosphere(3, 1.0))
    rng = np.random.default_rng(2)
    edges = np.concatenate([sphere.faces[:, [0, 1]], sphere.faces[:, [1, 2]]])
    part = rng.uniform(0, 1, (len(edges), 1))
    on_edges = sphere.vertices[edges[:, 0]] * part + sphere.vertices[edges[:, 1]] * (1 - part)
    for targets in (sphere.vertices, on_edges):
        assert (cast_rays(sphere, [0, 0, 0], targets).face >= 0).all()
        assert (cast_rays(sphere, [0.3, -0.2, 0.1], targets - [0.3, -0.2, 0.1]).face >= 0).all()
    # Axis-parallel rays through the nodes of a grid run in the sides of the boxes too.
    sheet = rough_sheet(30)
    inner = (sheet.vertices[:, :2] > 0).all(1) & (sheet.vertices[:, :2] < 29).all(1)
    hits = cast_rays(sheet, sheet.vertices[inner] + [0, 0, 100], [0, 0, -1])
    np.testing.assert_allclose(hits.distance, 100)


def test_closest_points_agree_with_trimesh_and_analytic_cases():
    triangle = surface_of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    queries = [[0.2, 0.2, 3], [-1, -1, 0], [0.5, -2, 1], [1, 1, 0], [3, 0, 0]]
    expected = [[0.2, 0.2, 0], [0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0], [1, 0, 0]]
    found = closest_points(triangle, queries)
    np.testing.assert_allclose(found.point, expected, atol=1e-15)
    np.testing.assert_allclose(found.distance, np.linalg.norm(np.subtract(queries, expected), axis=1))
    rng = np.random.default_rng(3)
    triangles = rng.uniform(-1, 1, (200, 1, 3)) + rng.normal(0, 0.2, (200, 3, 3))
    soup = surface_of(triangles.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    points = rng.uniform(-2, 2, (200, 3))
    every = trimesh.triangles.closest_point(np.tile(triangles, (200, 1, 1)), np.repeat(points, 200, axis=0))
    distance = np.linalg.norm(every.reshape(200, 200, 3) - points[:, None], axis=2)
    found = closest_points(soup, points)
    np.testing.assert_allclose(found.distance, distance.min(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(found.face, distance.argmin(axis=1))
    assert closest_points(soup, [50, 0, 0], max_distance=1.0).face[0] == -1


def test_closest_points_at_every_corner_case():
    """Small whole coordinates, so that points lie exactly above corners, edges and on the borders between regions."""
    rng = np.random.default_rng(5)
    triangles = rng.integers(-2, 3, (400, 3, 3)).astype(float)
    triangles[::3, :, 2] = 0.0
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    triangles = triangles[(normals != 0).any(axis=1)]
    points = np.concatenate([rng.integers(-4, 5, (300, 3)) / 1.0, rng.integers(-8, 9, (300, 3)) / 2.0])
    for triangle in triangles:
        found = closest_points(surface_of(triangle, [[0, 1, 2]]), points)
        assert found.distance == pytest.approx(distance_to(triangle, points), abs=1e-12)
        np.testing.assert_allclose(np.linalg.norm(found.point - points, axis=1), found.distance, atol=1e-12)


def distance_to(triangle, points):
    """Least distance to the three edges, and to the plane where its foot is inside."""
    distance = np.full(len(points), np.inf)
    for k in range(3):
        begin, way = triangle[k], triangle[(k + 1) % 3] - triangle[k]
        along = np.clip((points - begin) @ way / (way @ way), 0, 1)
        distance = np.minimum(distance, np.linalg.norm(points - begin - along[:, None] * way, axis=1))
    u, v = triangle[1] - triangle[0], triangle[2] - triangle[0]
    weights = np.linalg.lstsq(np.column_stack([u, v]), (points - triangle[0]).T, rcond=None)[0]
    inside = (weights >= 0).all(axis=0) & (weights.sum(axis=0) <= 1)
    foot = np.linalg.norm(triangle[0] + weights.T @ np.array([u, v]) - points, axis=1)
    return np.where(inside, np.minimum(distance, foot), distance)


def test_a_surface_without_faces_has_no_index():
    with pytest.raises(RockfallError, match=r"^A surface without faces has no spatial index\.$"):
        build_index(np.zeros((3, 3)), np.zeros((0, 3), np.int32))


def test_index_of_many_coinciding_triangles():
    soup = surface_of(np.tile([[0, 0, 0], [1, 0, 0], [0, 1, 0]], (1000, 1)), np.arange(3000).reshape(-1, 3))
    assert cast_rays(soup, [0.2, 0.2, 1], [0, 0, -1]).distance[0] == 1.0
    assert closest_points(soup, [0.2, 0.2, 1]).distance[0] == 1.0
    assert sorted(soup.index.face) == list(range(1000))


def test_bad_rays_are_refused():
    plane = rough_sheet(3)
    with pytest.raises(InputError, match="ray 1 has length zero"):
        cast_rays(plane, [0, 0, 1], [[0, 0, 1], [0, 0, 0]])
    with pytest.raises(InputError, match="origin 0 is not finite"):
        cast_rays(plane, [0, np.nan, 1], [0, 0, 1])
    with pytest.raises(InputError, match="point 1 is not finite"):
        closest_points(plane, [[0, 0, 0], [0, 0, np.inf]])
    with pytest.raises(InputError, match="do not match"):
        cast_rays(plane, np.zeros((2, 3)), np.ones((3, 3)))
    with pytest.raises(InputError, match="shape"):
        closest_points(plane, [[0, 0]])
    assert len(cast_rays(plane, np.empty((0, 3)), [0, 0, 1]).distance) == 0


def test_one_ray_and_one_closest_point_on_a_plane():
    plane = surface_of([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], [[0, 1, 2], [0, 2, 3]])
    hit = cast_ray(plane, (1, 2, 4), np.array([3, 0, -4]))
    assert (hit.distance, hit.face) == (pytest.approx(5), 0)
    np.testing.assert_allclose(hit.point, [4, 2, 0], atol=1e-15)
    assert cast_ray(plane, (1, 2, 4), (0, 0, 1)) is None
    assert cast_ray(plane, (1, 2, 4), (0, 0, -1), max_distance=3.9) is None
    near = closest_point(plane, [12, 2, 4])
    assert near.distance == pytest.approx(5)
    np.testing.assert_allclose(near.point, [9, 2, 0], atol=1e-15)
    assert closest_point(plane, [12, 2, 4], max_distance=4.9) is None
    with pytest.raises(InputError, match="direction of ray 0 has length zero"):
        cast_ray(plane, (1, 2, 4), (0, 0, 0))
    with pytest.raises(InputError, match="not finite"):
        cast_ray(plane, (1, np.nan, 4), (0, 0, 1))
    with pytest.raises(InputError, match="point 0 is not finite"):
        closest_point(plane, (np.inf, 0, 0))
    with pytest.raises(InputError, match="three numbers"):
        closest_point(plane, (1, 2))


def test_any_hit_agrees_with_brute_force_on_a_random_soup():
    rng = np.random.default_rng(5)
    triangles = rng.uniform(-1, 1, (300, 1, 3)) + rng.normal(0, 0.2, (300, 3, 3))
    soup = surface_of(triangles.reshape(-1, 3), np.arange(900).reshape(-1, 3))
    origins, directions = rng.uniform(-2, 2, (1000, 3)), rng.normal(0, 1, (1000, 3))
    unit, limits = directions / np.linalg.norm(directions, axis=1, keepdims=True), rng.uniform(0.1, 3, 1000)
    first = np.array([brute_force_hits(triangles, o, d) for o, d in zip(origins, unit, strict=True)])
    hit = any_hit(soup, origins, directions, limits)
    assert 100 < hit.sum() < 900
    np.testing.assert_array_equal(hit, first <= limits)
    np.testing.assert_array_equal(any_hit(soup, origins, directions), np.isfinite(first))


def test_heights_above_a_slope_and_around_an_overhang():
    slope = surface_of([[0, 0, 0], [10, 0, 10], [10, 10, 10], [0, 10, 0]], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_allclose(heights_above(slope, [[4, 3, 9], [4, 3, 1], [4, 3, 4], [40, 3, 1]]), [5, -3, 0, np.nan])
    # A floor, and over it a slab from z = 5 to z = 6: under the slab the height counts from the floor, in the slab
    # it is the way up out of it.
    floor = [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]
    slab = trimesh.creation.box(bounds=[[-2, -2, 5], [2, 2, 6]])
    site = surface_of(np.concatenate([floor, slab.vertices]), np.concatenate([[[0, 1, 2], [0, 2, 3]], slab.faces + 4]))
    heights = heights_above(site, [[1, 0.5, 3], [1, 0.5, 4.9], [1, 0.5, 5.3], [1, 0.5, 8], [1, 0.5, -2]])
    np.testing.assert_allclose(heights, [3, 4.9, -0.7, 2, -2])


@pytest.mark.parametrize("seed", range(3))
def test_mixed_winding_is_made_consistent(seed):
    rng = np.random.default_rng(seed)
    sheet, boulder = rough_sheet(12), trimesh.creation.icosphere(2, 2.0)
    vertices = np.concatenate([sheet.vertices, np.add(boulder.vertices, [0, 0, 50])])
    faces = np.concatenate([sheet.faces, boulder.faces.astype(np.int32) + len(sheet.vertices)])
    expected = trimesh.Trimesh(vertices, faces, process=False).face_normals
    turned = rng.uniform(size=len(faces)) < 0.5
    mixed = np.where(turned[:, None], faces[:, ::-1], faces).astype(np.int32)
    degenerate, _, (up, down) = examine_faces(vertices, mixed)
    oriented = orient(vertices, mixed, bool(up), bool(down))
    assert not degenerate.any()
    assert (oriented.flipped, oriented.components, oriented.contradictions) == (turned.sum(), 2, 0)
    np.testing.assert_allclose(surface_of(vertices, oriented.faces).face_normals, expected, atol=1e-12)


def test_overhanging_sheet_keeps_its_underside_and_upright_piece_follows_the_file():
    # An S-shaped sheet: the middle faces down, as it should on an overhang.
    profile = np.array([[0, 0], [4, 0], [5, 1], [2, 2], [3, 3], [9, 3.0]])
    x, z = np.repeat(profile, 2, axis=0).T
    vertices = np.stack([x, np.tile([0.0, 1.0], 6), z], axis=1)
    i = np.arange(0, 10, 2)
    faces = np.concatenate([np.stack([i, i + 2, i + 3], 1), np.stack([i, i + 3, i + 1], 1)]).astype(np.int32)
    wall = np.array([[20, 0, 0], [20, 1, 0], [20, 1, 1], [20, 0, 1.0]])
    wall_faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32) + len(vertices)
    both, all_faces = np.concatenate([vertices, wall]), np.concatenate([faces, wall_faces])
    for wound in (all_faces, np.ascontiguousarray(all_faces[:, ::-1])):
        result = surface_of(both, orient(both, wound, True, True).faces)
        assert (result.face_normals[[2, 7], 2] < 0).all()
        np.testing.assert_allclose(result.face_normals[10:], [[1, 0, 0]] * 2)


def test_a_moebius_strip_is_reported():
    n = 12
    angle = np.arange(n) * 2 * np.pi / n
    across = np.stack([np.cos(angle) * np.cos(angle / 2), np.sin(angle) * np.cos(angle / 2), np.sin(angle / 2)], 1)
    middle = 3 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    vertices = np.concatenate([middle - across, middle + across])
    faces = []
    for i in range(n):
        a, b, c, d = i, i + n, (i + 1) % n, (i + 1) % n + n
        c, d = (d, c) if i == n - 1 else (c, d)
        faces += [[a, c, d], [a, d, b]]
    assert orient(vertices, np.array(faces, np.int32), True, True).contradictions == 1


def test_neighbours_across_edges():
    strip = surface_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.5, 1]], [[0, 1, 2], [2, 1, 3], [2, 1, 4]])
    np.testing.assert_array_equal(strip.neighbours, [[-1, -2, -1], [-2, -1, -1], [-2, -1, -1]])
    np.testing.assert_array_equal(surface_of(strip.vertices, strip.faces[:2]).neighbours, [[-1, 1, -1], [0, -1, -1]])
    sheet = rough_sheet(9)
    of_trimesh = trimesh.Trimesh(sheet.vertices, sheet.faces, process=False).face_adjacency
    pairs = {(f, g) for f, row in enumerate(sheet.neighbours.tolist()) for g in row if f < g}
    assert pairs == {tuple(sorted(pair)) for pair in of_trimesh.tolist()}


def test_merging_keeps_order_and_close_vertices_apart():
    vertices = np.array([[1, 2, 3], [0.0, 0, 0], [1, 2, 3], [-0.0, 0, 0], [1, 2, 3 + 1e-12], [9, 9, 9]])
    merged, faces, gone = merge_duplicates(vertices, np.array([[0, 1, 2], [3, 4, 5]], np.int32))
    np.testing.assert_array_equal(merged, vertices[[0, 1, 4, 5]])
    np.testing.assert_array_equal(faces, [[0, 1, 0], [1, 2, 3]])
    assert gone == 2


def test_neighbours_around_the_hub_of_a_large_fan():
    n = 300
    angle = np.arange(n) * 2 * np.pi / n
    vertices = np.concatenate([[[0, 0, 1]], np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)])
    i = np.arange(n)
    faces = np.stack([0 * i, i + 1, (i + 1) % n + 1], axis=1)
    shuffled = np.random.default_rng(0).permutation(n)
    cone = surface_of(vertices, faces[shuffled])
    of_trimesh = trimesh.Trimesh(cone.vertices, cone.faces, process=False).face_adjacency
    pairs = {(f, g) for f, row in enumerate(cone.neighbours.tolist()) for g in row if f < g}
    assert pairs == {tuple(sorted(pair)) for pair in of_trimesh.tolist()}
    fin = surface_of(np.concatenate([vertices, [[2, 0, 1]]]), np.concatenate([cone.faces, [[0, 1, n + 1]]]))
    assert (fin.neighbours == -2).sum() == 3
