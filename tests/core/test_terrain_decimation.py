# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.decimation import decimate
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.surface import Surface


def slope(n: int, spacing: float = 0.5):
    """A wavy slope of n × n points, 40 m long waves."""
    x, y = np.meshgrid(np.arange(n) * spacing, np.arange(n) * spacing)
    z = 0.6 * x + 2 * np.sin(x * 2 * np.pi / 40) * np.cos(y * 2 * np.pi / 40)
    i = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return np.stack([x, y, z], -1).reshape(-1, 3), faces


def test_coarse_slope_lies_on_the_slope_and_has_about_as_many_triangles_as_asked():
    vertices, faces = slope(301)
    coarse = decimate(vertices, faces, 20_000)
    assert len(coarse.faces) == pytest.approx(20_000, rel=0.3)
    full = Surface(vertices, faces, GlobalShift(), "full")
    away = closest_points(full, coarse.vertices).distance
    assert away.max() < 0.1, "1.5 m cells on waves of 40 m and 2 m height sag by a few centimetres"
    made = Surface(coarse.vertices, coarse.faces, GlobalShift(), "coarse")
    assert (made.face_normals[:, 2] > 0).mean() > 0.99, "a few fold over where cells cut a corner"
    assert np.unique(np.sort(coarse.faces, axis=1), axis=0).shape == coarse.faces.shape
    inside = np.random.default_rng(0).uniform(3, 147, (2000, 2))
    above = np.column_stack([inside, np.full(2000, 500.0)])
    hits, exact = cast_rays(made, above, (0, 0, -1)), cast_rays(full, above, (0, 0, -1))
    assert np.isfinite(hits.distance).all(), "the sheet has no hole"
    assert np.abs(hits.distance - exact.distance).max() < 0.3


def test_values_are_means_over_the_cells():
    vertices, faces = slope(101)
    values = np.stack([vertices[:, 0], np.full(len(vertices), 0.25)], axis=1)
    coarse = decimate(vertices, faces, 2000, values)
    np.testing.assert_allclose(coarse.values[:, 0], coarse.vertices[:, 0], rtol=1e-12)
    np.testing.assert_allclose(coarse.values[:, 1], 0.25, rtol=1e-12)


def test_two_sheets_further_apart_than_the_cells_stay_two():
    vertices, faces = slope(201)
    both = np.concatenate([vertices, vertices + np.array([0, 0, 8.0])])
    coarse = decimate(both, np.concatenate([faces, faces + len(vertices)]), 16_000)
    made = Surface(coarse.vertices, coarse.faces, GlobalShift(), "coarse")
    down = cast_rays(made, [[50.3, 50.4, 300.0]], (0, 0, -1))
    below = cast_rays(made, down.point - [0, 0, 0.5], (0, 0, -1))
    assert below.distance[0] == pytest.approx(7.5, abs=0.4)


def test_small_mesh_stays_as_it_is_and_nonsense_is_refused():
    vertices, faces = slope(5)
    coarse = decimate(vertices, faces, 1000, np.arange(25.0))
    assert coarse.vertices is vertices
    assert coarse.faces is faces
    np.testing.assert_array_equal(coarse.values[:, 0], np.arange(25.0))
    with pytest.raises(InputError, match="0 triangles"):
        decimate(vertices, faces, 0)


def test_triangles_far_smaller_than_their_distance_from_the_origin():
    vertices, faces = slope(101)
    there = decimate(vertices + np.array([2.6e6, 1.2e6, 500.0]), faces, 2000)
    here = decimate(vertices, faces, 2000)
    assert len(there.faces) == pytest.approx(len(here.faces), rel=0.05)
