# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain normal at block scale: analytic cases, large triangles, overhangs; shading."""

import numpy as np
import pytest
import trimesh
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.orientation import block_scale_normals, default_normal_radius
from rockfall.core.terrain.shading import shade, thin_share
from rockfall.core.terrain.surface import Surface


def surface_of(vertices, faces) -> Surface:
    return Surface(np.asarray(vertices, float), np.asarray(faces, np.int32), GlobalShift(), "test")


def height_field(height, n: int = 41, step: float = 0.25) -> Surface:
    x, y = np.meshgrid((np.arange(n) - n // 2) * step, (np.arange(n) - n // 2) * step)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return surface_of(np.stack([x, y, height(x, y)], -1).reshape(-1, 3), faces)


def test_plane_gives_its_normal_and_the_disc_exactly():
    plane = height_field(lambda x, y: 0.5 * x - 0.25 * y)
    normal = np.array([-0.5, 0.25, 1]) / np.linalg.norm([-0.5, 0.25, 1])
    found = block_scale_normals(plane, [[0.1, 0.2, 0.3], [1.0, -0.7, 0.4]], 1.3)
    np.testing.assert_allclose(found.normal, [normal] * 2, atol=1e-12)
    np.testing.assert_allclose(found.spread_deg, 0, atol=1e-6)
    np.testing.assert_allclose(found.area_m2, np.pi * 1.3**2, rtol=1e-12)
    np.testing.assert_allclose(found.point @ normal, 0, atol=1e-12)


def test_one_triangle_much_larger_than_the_radius_counts_by_clipping():
    large = surface_of([[-1e4, -1e4, 0], [1e4, -1e4, 0], [0, 2e4, 0]], [[0, 1, 2]])
    found = block_scale_normals(large, [[3, 4, 0.5]], 0.7)
    np.testing.assert_allclose(found.normal, [[0, 0, 1]])
    np.testing.assert_allclose(found.area_m2, np.pi * 0.49, rtol=1e-9)


def test_sphere_normal_is_radial_and_the_cap_has_its_area_and_spread():
    radius, cap = 5.0, 1.2
    sphere = trimesh.creation.icosphere(6, radius)
    sphere = surface_of(sphere.vertices, sphere.faces)
    directions = np.random.default_rng(0).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = block_scale_normals(sphere, directions * (radius + 0.4), cap)
    np.testing.assert_allclose((found.normal * directions).sum(1), 1, atol=1e-5)
    # The cap of a sphere inside a ball of radius a around a point of it has the area πa² (Archimedes).
    np.testing.assert_allclose(found.area_m2, np.pi * cap**2, rtol=2e-3)
    polar = np.linspace(0, 2 * np.arcsin(cap / 2 / radius), 20001)
    spread = np.degrees(np.sqrt(np.average(polar**2, weights=np.sin(polar))))
    np.testing.assert_allclose(found.spread_deg, spread, rtol=0.02)


def test_patch_integrals_agree_with_sampling():
    """Independent computation: points spread evenly over the triangles, kept when inside the sphere."""
    rng = np.random.default_rng(1)
    bumps = height_field(lambda x, y: 0.3 * np.sin(2 * x) * np.cos(1.5 * y) + 0.4 * x, step=0.4)
    centre, radius = np.array([0.33, 0.21, 0.4]), 1.7
    found = block_scale_normals(bumps, centre, radius)
    triangles = bumps.vertices[bumps.faces]
    k, sampled = 200, []
    u, v = rng.uniform(size=(2, len(triangles), k, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    sampled = triangles[:, None, 0] + u * (triangles[:, 1] - triangles[:, 0])[:, None]
    sampled = sampled + v * (triangles[:, 2] - triangles[:, 0])[:, None]
    weight = np.broadcast_to(bumps.face_areas[:, None] / k, sampled.shape[:2])
    inside = np.linalg.norm(sampled - found.point[0], axis=2) < radius
    points, weights = sampled[inside], weight[inside]
    assert weights.sum() == pytest.approx(found.area_m2[0], rel=0.01)
    centred = points - np.average(points, axis=0, weights=weights)
    _, axes = np.linalg.eigh((centred * weights[:, None]).T @ centred)
    assert abs(axes[:, 0] @ found.normal[0]) == pytest.approx(1, abs=1e-4)
    assert found.normal[0, 2] > 0


def test_the_part_of_a_triangle_inside_a_sphere_has_its_moments():
    """Area, first and second moments against fine strips across the triangle, for triangles in every position."""
    from rockfall.core.terrain.patch_kernels import SUMS, add_face

    rng = np.random.default_rng(8)
    radius, strips, kinds = 1.0, 20_000, 0
    for size in np.repeat([0.3, 0.8, 1.5, 4.0], 12):
        corners = rng.normal(0, 0.4, 3) + size * rng.normal(0, 1, (3, 3))
        twice = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal = twice / np.linalg.norm(twice)
        axis = np.array([0.0, 0.6, 0.8])
        sums = np.zeros(SUMS)
        add_face(sums, np.empty(6), corners, normal, axis, radius)
        expected, clipped = strip_moments(corners, normal, radius, strips)
        np.testing.assert_allclose(sums[:10], expected, atol=2e-6)
        np.testing.assert_allclose(sums[10:13], sums[0] * normal, atol=1e-12)
        assert sums[13] == pytest.approx(sums[0] * np.arccos(normal @ axis) ** 2, abs=1e-9)
        kinds += clipped
    assert 15 < kinds < 45


def strip_moments(corners, normal, radius, strips):
    """(10,) area, first moments, second moments xx yy zz xy yz zx; and whether the sphere cuts something off."""
    u = (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    v, height = np.cross(normal, u), corners[0] @ normal
    if abs(height) >= radius:
        return np.zeros(10), True
    flat = np.column_stack([corners @ u, corners @ v])
    edges = np.linspace(flat[:, 0].min(), flat[:, 0].max(), strips + 1)
    x = 0.5 * (edges[1:] + edges[:-1])
    low, high = np.full(strips, np.inf), np.full(strips, -np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        (ax, ay), (bx, by) = sorted((flat[a].tolist(), flat[b].tolist()))
        here = (x >= ax) & (x <= bx) & (bx > ax)
        y = ay + (x[here] - ax) / (bx - ax) * (by - ay)
        low[here], high[here] = np.minimum(low[here], y), np.maximum(high[here], y)
    half = np.sqrt(np.maximum(radius**2 - height**2 - x**2, 0))
    clipped = bool(((low < -half) | (high > half)).any())
    low, high = np.clip(low, -half, half), np.clip(high, -half, half)
    across, width = high - low, edges[1] - edges[0]
    area, mx, my = (width * part.sum() for part in (across, x * across, (high**2 - low**2) / 2))
    xx, yy, xy = (width * part.sum() for part in (x**2 * across, (high**3 - low**3) / 3, x * (high**2 - low**2) / 2))
    centre = height * normal
    first = area * centre + mx * u + my * v
    second = area * np.outer(centre, centre) + np.outer(centre, mx * u + my * v) + np.outer(mx * u + my * v, centre)
    second += xx * np.outer(u, u) + yy * np.outer(v, v) + xy * (np.outer(u, v) + np.outer(v, u))
    return np.array([area, *first, *np.diag(second), second[0, 1], second[1, 2], second[2, 0]]), clipped


def test_big_triangles_beside_small_ones_weigh_by_area():
    """A crease: one side finely meshed, the other two large triangles. The normal is the bisector all the same."""
    n = 60
    fine = height_field(lambda x, y: 0 * x, n=n + 1, step=0.1)
    fine_vertices = np.stack([fine.vertices[:, 0] + 3, fine.vertices[:, 1], -(fine.vertices[:, 0] + 3)], 1)
    edge = np.flatnonzero(np.isclose(fine_vertices[:, 0], 0))
    edge = edge[np.argsort(fine_vertices[edge, 1])]
    far = len(fine_vertices)
    fan = [[edge[i], edge[i + 1], far] for i in range(n)]
    vertices = np.concatenate([fine_vertices, [[-50, 0, -50]]])
    crease = surface_of(vertices, np.concatenate([fine.faces, fan]))
    assert (crease.face_normals[:, 2] > 0).all()
    found = block_scale_normals(crease, [[0, 0, 0.2]], 1.0)
    np.testing.assert_allclose(found.normal, [[0, 0, 1]], atol=1e-6)
    np.testing.assert_allclose(found.area_m2, np.pi, rtol=1e-9)
    np.testing.assert_allclose(found.spread_deg, 45, rtol=1e-6)


@pytest.mark.parametrize("thickness", [0.4, 0.05])
def test_thin_plate_does_not_mix_its_sheets(thickness):
    plate = trimesh.creation.box((4, 4, thickness))
    for _ in range(3):
        plate = plate.subdivide()
    plate = surface_of(plate.vertices, plate.faces)
    above, below = [0.3, 0.2, thickness / 2 + 0.1], [0.3, 0.2, -thickness / 2 - 0.1]
    found = block_scale_normals(plate, [above, below, [1.8, 0.1, thickness / 2 + 0.1]], 1.0)
    np.testing.assert_allclose(found.normal[:2], [[0, 0, 1], [0, 0, -1]], atol=1e-9)
    np.testing.assert_allclose(found.area_m2[:2], np.pi, rtol=1e-9)
    assert found.normal[2, 2] > 0.9
    assert found.area_m2[2] < np.pi


def test_two_unconnected_sheets_do_not_mix():
    low, high = height_field(lambda x, y: 0 * x), height_field(lambda x, y: 0.2 + 0.5 * x)
    both = surface_of(
        np.concatenate([low.vertices, high.vertices]), np.concatenate([low.faces, high.faces + len(low.vertices)])
    )
    found = block_scale_normals(both, [[0.0, 0.0, 0.05], [0.0, 0.0, 0.3]], 1.0)
    np.testing.assert_allclose(found.normal[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(found.normal[1], np.array([-0.5, 0, 1]) / 1.25**0.5, atol=1e-12)


def test_a_notch_deeper_than_wide_still_points_out():
    notch = height_field(lambda x, y: 8 * np.maximum(np.abs(x) - 0.101, 0), n=61, step=0.04)
    found = block_scale_normals(notch, [[0.0, 0.01, 0.0]], 0.8)
    np.testing.assert_allclose(found.normal, [[0, 0, 1]], atol=0.02)
    assert 60 < found.spread_deg[0] < np.degrees(np.arctan(8))


def test_a_tilted_seed_face_does_not_decide():
    """The closest triangle is a steep facet of a step: the patch still holds both sides of it."""
    step = height_field(lambda x, y: np.clip(x, 0, 0.25) * 4)
    found = block_scale_normals(step, [[0.125, 0.0, 0.5]], 2.0)
    assert np.degrees(np.arccos(found.normal[0, 2])) < 40
    np.testing.assert_allclose(found.normal[0, 1], 0, atol=0.02)


def test_nothing_within_reach_is_nan_and_bad_radii_are_refused():
    plane = height_field(lambda x, y: 0 * x)
    found = block_scale_normals(plane, [[0, 0, 50], [0, 0, 0.1]], 1.0)
    np.testing.assert_array_equal(found.normal[0], [np.nan] * 3)
    np.testing.assert_array_equal(found.spread_deg[0], np.nan)
    assert found.area_m2[0] == 0
    np.testing.assert_allclose(found.normal[1], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(
        block_scale_normals(plane, [[0, 0, 50]], 1.0, reach_m=60).normal, [[0, 0, 1]], atol=1e-12
    )
    assert len(block_scale_normals(plane, np.empty((0, 3)), 1.0).normal) == 0
    for radius in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="radius"):
            block_scale_normals(plane, [[0, 0, 0]], radius)
    with pytest.raises(InputError, match="not finite"):
        block_scale_normals(plane, [[0, np.nan, 0]], 1.0)


def test_default_radius():
    plane = height_field(lambda x, y: 0 * x)
    spacing = 10 / 41
    assert default_normal_radius(plane, 2.0) == 2.0
    assert default_normal_radius(plane, 0.1) == pytest.approx(3 * spacing)


def test_many_points_equal_single_points():
    bumps = height_field(lambda x, y: np.sin(x) * np.cos(y), n=81)
    points = np.random.default_rng(4).uniform(-8, 8, (9000, 3)) * [1, 1, 0.1]
    together = block_scale_normals(bumps, points, 0.8)
    for i in (0, 4095, 4096, 8999):
        np.testing.assert_array_equal(together.normal[i], block_scale_normals(bumps, points[i], 0.8).normal[0])


def test_hillshade_of_planes_and_even_eye_dome():
    north_west_45 = height_field(lambda x, y: (x - y) / 2**0.5)
    shading = shade(north_west_45)
    np.testing.assert_allclose(shading.hillshade, 1.0)
    np.testing.assert_allclose(shade(north_west_45, azimuth_deg=135).hillshade, 0.0, atol=1e-12)
    inner = (np.abs(north_west_45.vertices[:, :2]) < 3).all(axis=1)
    np.testing.assert_allclose(shading.roughness[inner], 0, atol=1e-9)
    flat = shade(height_field(lambda x, y: 0 * x), altitude_deg=30)
    np.testing.assert_allclose(flat.hillshade, 0.5)
    np.testing.assert_allclose(flat.eye_dome, 0.5, atol=1e-6)


def test_edges_are_bright_crevices_dark_and_noise_is_rough():
    wave = height_field(lambda x, y: 0.5 * np.cos(2 * np.pi * x / 2.5), n=101)
    shading = shade(wave)
    x = wave.vertices[:, 0] / 2.5
    inner = (np.abs(wave.vertices[:, :2]) < 9).all(axis=1)
    crest, trough = inner & (np.abs(x - np.round(x)) < 0.01), inner & (np.abs(x - 0.5 - np.round(x - 0.5)) < 0.01)
    assert shading.eye_dome[crest].min() > 0.6
    assert shading.eye_dome[trough].max() < 0.4
    rng = np.random.default_rng(0)
    noisy = shade(height_field(lambda x, y: rng.normal(0, 0.02, x.shape), n=101))
    assert 0.015 < np.median(noisy.roughness) < 0.025


def test_density_and_thin_data():
    step = 0.25
    field = height_field(lambda x, y: 0.3 * x, n=61, step=step)
    shading = shade(field)
    inner = (np.abs(field.vertices[:, :2]) < 5).all(axis=1)
    np.testing.assert_allclose(shading.density[inner], 1 / step**2 / 1.09**0.5, rtol=1e-9)
    border = np.isclose(np.abs(field.vertices[:, :2]).max(axis=1), 7.5)
    np.testing.assert_array_equal(shading.thin, border)
    hole = np.linalg.norm(field.vertices[field.faces].mean(axis=1)[:, :2], axis=1) > 1
    with_hole = surface_of(field.vertices, field.faces[hole])
    ring = shade(with_hole).thin & ~border
    distance = np.linalg.norm(field.vertices[ring, :2], axis=1)
    assert ring.sum() > 10
    assert distance.max() < 1.5
    # Left half with every fourth point only: sixteen times thinner.
    sparse_x = np.r_[np.arange(-10, 0, 1.0), np.arange(0, 10, 0.25)]
    x, y = np.meshgrid(sparse_x, np.arange(-10, 10, 0.25))
    keep = (x >= 0) | np.isclose(y % 1, 0)
    from scipy.spatial import Delaunay

    points = np.stack([x[keep], y[keep]], 1)
    half = surface_of(np.c_[points, np.zeros(len(points))], Delaunay(points).simplices)
    thin = shade(half).thin
    away = (np.abs(points[:, 1]) < 7) & (np.abs(points[:, 0]) < 7)
    assert thin[away & (points[:, 0] < -3)].all()
    assert not thin[away & (points[:, 0] > 3)].any()
    assert 0.45 < thin_share(half, shade(half)) < 0.65, "half of the area, though few of the points"
    assert thin.mean() < 0.4


@pytest.mark.parametrize(
    "bad",
    [
        {"azimuth_deg": np.nan},
        {"altitude_deg": np.inf},
        {"thin_spacings": 1.0},
        {"thin_spacings": -2.0},
        {"thin_spacings": np.nan},
    ],
)
def test_light_and_multiples_that_make_no_sense_are_refused(bad):
    with pytest.raises(InputError, match=r"^The shading needs a light direction in degrees and a multiple"):
        shade(height_field(lambda x, y: 0.3 * x, n=5), **bad)
