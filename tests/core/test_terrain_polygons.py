# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces with more than three corners: their triangles have their area and all their corners, and lie inside."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.terrain.polygons import triangles_of
from rockfall.core.terrain.readers import read_terrain

CASES = Path(__file__).parents[1] / "data" / "field_cases" / "08-concave-polygon"
SURVEY = np.array([2_600_000.0, 1_200_000.0, 1_500.0])
L_SHAPE = np.array([[0, 0], [20, 0], [20, 20], [10, 20], [10, 10], [0, 10]], dtype=float)
"""Of 300 m²."""


def tilted(plan: np.ndarray) -> np.ndarray:
    """A plane polygon (n, 2) somewhere in space, turned by a rotation: areas stay."""
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    return np.column_stack([plan, np.zeros(len(plan))]) @ rotation.T + SURVEY


def area_vectors(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def plan_area(path: Path) -> tuple[float, int]:
    surface = read_terrain(path)
    return float(np.abs(area_vectors(surface.vertices, surface.faces)[:, 2]).sum()), len(surface.vertices)


@pytest.mark.parametrize("first", range(6))
@pytest.mark.parametrize("clockwise", [False, True])
def test_a_concave_polygon_has_its_area_wherever_it_begins(first, clockwise):
    points = tilted(L_SHAPE)
    corners = np.roll(np.arange(6), first)[:: -1 if clockwise else 1]
    made = triangles_of(points, corners, [6])
    vectors = area_vectors(points, made.faces)
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(300.0)
    assert np.linalg.norm(vectors.sum(axis=0)) == pytest.approx(300.0), "all are wound as the polygon is"
    assert len(made.faces) == 4
    assert "Cut ear by ear" in made.notes[0]


def test_files_with_concave_polygons_have_the_area_that_they_were_made_with():
    """An L of 300 m²; 20 strips of 42 corners each over 20 m by 20 m, every corner of which another strip shares."""
    assert plan_area(CASES / "L2.obj")[0] == pytest.approx(300.0)
    area, vertices = plan_area(CASES / "ngon.obj")
    assert (area, vertices) == (pytest.approx(400.0), 441)
    surface = read_terrain(CASES / "ngon.obj")
    assert "Left out what is no face: lines (1), points (1)." in surface.summary
    assert any(said.startswith("Faces with more than three corners: 20. Cut ear by ear") for said in surface.summary)


def test_random_star_shaped_polygons_between_triangles_and_quadrilaterals():
    """Each has the area of the shoelace formula; the order of the faces is that of the polygons."""
    rng = np.random.default_rng(3)
    points, corners, counts, areas = [], [], [], []
    for _ in range(200):
        n = int(rng.integers(3, 15))
        angle = 2 * np.pi * (np.arange(n) + rng.uniform(0, 0.8, n)) / n
        plan = rng.uniform(0.3, 3.0, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        x, y = plan.T
        areas.append(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
        corners.append(np.arange(n) + len(points))
        counts.append(n)
        points += tilted(plan).tolist()
    made = triangles_of(np.array(points), np.concatenate(corners), counts)
    found = np.linalg.norm(area_vectors(np.array(points), made.faces), axis=1)
    np.testing.assert_allclose(np.bincount(made.polygon, found), areas, rtol=1e-6)
    assert [len(set(np.ravel(made.faces[made.polygon == i]))) for i in range(200)] == counts
    assert not any("cross" in said for said in made.notes)


def test_convex_polygons_are_fans_and_convex_quadrilaterals_are_cut_from_their_first_to_their_third_corner():
    angle = 2 * np.pi * np.arange(5) / 5
    points = tilted(
        np.concatenate([np.stack([np.cos(angle), np.sin(angle)], axis=1), [[9, 0], [11, 1], [10, 3], [8, 2]]])
    )
    made = triangles_of(points, np.arange(9), [5, 4])
    np.testing.assert_array_equal(made.faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7], [5, 7, 8]])
    assert made.notes == ()


def test_polygons_that_are_not_flat_or_cross_themselves_are_said_with_their_numbers():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.4], [0, 1, 0]], dtype=float)
    bent = triangles_of(points, np.arange(4), [4]).notes
    assert [said.startswith("Faces with more than three corners that are not flat: 1 of 1") for said in bent] == [True]
    away = 0.4 / 4 / np.linalg.norm([0.2, 0.2, 1.0])  # from z = 0.2 x + 0.2 y − 0.1, at all four corners
    assert f"up to {away:.2g} m" in bent[0]
    bow_tie = triangles_of(np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [2, 3.0, 0]]), np.arange(4), [4]).notes
    assert any(said.startswith("Faces that cross themselves or have no area: 1.") for said in bow_tie)
    turn = 4 * np.pi * np.arange(5) / 5
    star = triangles_of(np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1), np.arange(5), [5]).notes
    assert any("cross themselves" in said for said in star), "a pentagram turns left at each corner"


@pytest.mark.parametrize("corner", [np.nan, np.inf, 1e300])
def test_coordinates_that_are_none_have_no_ears(corner):
    points = np.column_stack([L_SHAPE, np.zeros(6)])
    points[4, 2] = corner
    assert len(triangles_of(points, np.arange(6), [6]).faces) == 4


def test_a_ply_with_polygons_with_more_and_fewer_corners(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 6\nproperty double x\nproperty double y\nproperty double z\n"
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    body = "".join(f"{x} {y} 0\n" for x, y in L_SHAPE.tolist())
    (tmp_path / "a.ply").write_text(f"{head}{body}6 3 4 5 0 1 2\n2 0 1\n")
    assert plan_area(tmp_path / "a.ply")[0] == pytest.approx(300.0)
    assert "Left out 1 faces with fewer than three corners." in read_terrain(tmp_path / "a.ply").summary
