# SPDX-License-Identifier: GPL-3.0-or-later
"""A cloud of a cliff with a roof, sampled from planes that are known, is meshed as it is."""

import numpy as np
import pytest
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import IMPACT, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain import folds
from rockfall.core.terrain.overhangs import find_overhangs
from rockfall.core.terrain.raycast import cast_rays
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.triangulation import mesh_cloud

SLOPE = np.tan(np.radians(20.0))
ROOF, FOOT, LOW, TOP = 0.0, 6.0, 6.0, 8.0  # x of the roof's edge and of the wall, heights of its two sides [m]


def cliff(seed, noise_m, spacing=0.3):
    """Points (n, 3) and the number of the plane of each; density varies by a factor of 19 from place to place."""
    rng, points, plane = np.random.default_rng(seed), [], []
    sides = (
        ((-20, 0, -26 * SLOPE), (26, 0, 26 * SLOPE), (0, 30, 0)),  # floor
        ((FOOT, 0, 0), (0, 8, 0), (0, 0, TOP)),  # wall, beside the roof and below it
        ((FOOT, 22, 0), (0, 8, 0), (0, 0, TOP)),
        ((FOOT, 8, 0), (0, 14, 0), (0, 0, LOW)),
        ((ROOF, 8, LOW), (FOOT, 0, 0), (0, 14, 0)),  # underside
        ((ROOF, 8, LOW), (0, 14, 0), (0, 0, TOP - LOW)),  # front and flanks of the roof
        ((ROOF, 8, LOW), (FOOT, 0, 0), (0, 0, TOP - LOW)),
        ((ROOF, 22, LOW), (FOOT, 0, 0), (0, 0, TOP - LOW)),
        ((ROOF, 8, TOP), (FOOT, 0, 0), (0, 14, 0)),  # top of the roof, and plateau
        ((FOOT, 0, TOP), (14, 0, 0), (0, 30, 0)),
    )
    for i, (origin, u, v) in enumerate(np.array(sides, dtype=float)):
        count = int(2 * np.linalg.norm(np.cross(u, v)) / spacing**2)
        part = origin + rng.random((count, 1)) * u + rng.random((count, 1)) * v
        dense = 0.5 + 0.45 * np.sin(0.5 * part[:, 1]) * np.cos(0.4 * (part[:, 0] + part[:, 2]))
        part = part[rng.random(count) < dense]
        points.append(part + rng.normal(0, noise_m, part.shape))
        plane.append(np.full(len(part), i))
    return np.concatenate(points), np.concatenate(plane)


NORMALS = np.array(
    [[-SLOPE, 0, 1], *[[-1, 0, 0]] * 3, [0, 0, -1], [-1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]],
    dtype=float,
)
NORMALS /= np.linalg.norm(NORMALS, axis=1)[:, None]
FLOOR, UNDERSIDE = 0, 4


@pytest.fixture(scope="module", params=[0.0, 0.02], ids=["exact", "noise of 2 cm"])
def meshed(request):
    points, plane = cliff(1, request.param)
    flat = mesh_cloud(points, None)
    found, said = folds.mesh_folds(points, flat, find_overhangs(points), None)
    return points, plane, flat, found, said


def normals_of(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    twice = np.cross(b - a, c - a)
    return twice / np.linalg.norm(twice, axis=1)[:, None]


def borders(faces):
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    return edges[count == 1]


def test_both_sheets_are_kept_with_their_normals(meshed):
    _, plane, _, found, _ = meshed
    normal = normals_of(found.points, found.faces)
    own = plane[found.origin][found.faces]
    middle = found.points[found.faces].mean(axis=1)
    under = (middle[:, 0] > ROOF) & (middle[:, 0] < FOOT) & (middle[:, 1] > 8) & (middle[:, 1] < 22)
    for sheet in (FLOOR, UNDERSIDE):
        which = under & (own == sheet).all(axis=1)
        right = normal[which] @ NORMALS[sheet] > np.cos(np.radians(10))
        assert right.mean() > 0.95
        assert np.abs(normal[which][:, 2]).min() > np.cos(np.radians(75)), "no spike"
    # Of all triangles there, over edges too, those that lie in one of the planes that their corners are from.
    best = np.einsum("mi,mki->mk", normal, NORMALS[own]).max(axis=1)
    assert (best[under] > np.cos(np.radians(10))).mean() > 0.9


def test_in_plan_they_were_spikes(meshed):
    """The check above can fail."""
    _, _, flat, _, _ = meshed
    normal = normals_of(flat.points, flat.faces)
    middle = flat.points[flat.faces].mean(axis=1)
    under = (middle[:, 0] > ROOF) & (middle[:, 0] < FOOT) & (middle[:, 1] > 8) & (middle[:, 1] < 22)
    assert np.median(np.degrees(np.arccos(normal[under, 2]))) > 80


def test_away_from_the_overhang_nothing_differs(meshed):
    _, _, flat, found, _ = meshed

    def away(mesh):
        corners = mesh.points[mesh.faces]
        return {tuple(sorted(map(tuple, face))) for face in corners[(corners[:, :, 0] < -12).all(axis=1)].tolist()}

    assert len(away(flat)) > 1000
    assert away(found) == away(flat)


def test_it_is_sewn_to_the_rest(meshed):
    _, _, _, found, _ = meshed
    middle = found.points[borders(found.faces)].mean(axis=1)
    outer = (np.abs(middle[:, 1] - 15) > 14) | (middle[:, 0] < -19) | (middle[:, 0] > 19)
    assert outer.all()


def test_the_noise_is_taken_out_and_said(meshed):
    points, plane, _, found, said = meshed
    moved = np.linalg.norm(found.points - points[found.origin], axis=1) > 1e-9
    if "moved" not in said:
        assert not moved.any()
        return
    under = plane[found.origin] == UNDERSIDE
    assert (moved & under).sum() > 0.8 * under.sum()
    assert np.abs(found.points[under, 2] - LOW).mean() < 0.6 * np.abs(points[plane == UNDERSIDE, 2] - LOW).mean()


def test_a_roof_that_nothing_holds_faces_down(tmp_path):
    rng = np.random.default_rng(3)
    floor = np.column_stack([rng.uniform(0, 20, (20_000, 2)), rng.normal(0, 0.02, 20_000)])
    roof = np.column_stack([rng.uniform(7, 13, (2_000, 2)), rng.normal(6, 0.02, 2_000)])
    np.savetxt(tmp_path / "roof.xyz", np.vstack([floor, roof]), fmt="%.4f")
    surface = read_terrain(tmp_path / "roof.xyz", shift=GlobalShift())
    assert surface.summary[0].startswith("The cloud has an overhang")
    assert "triangles are meshed in space" in surface.summary[1]
    seen = cast_rays(surface, np.column_stack([rng.uniform(8, 12, (50, 2)), np.ones(50)]), (0, 0, 1))
    np.testing.assert_allclose(seen.distance, 5, atol=0.05)
    assert (surface.face_normals[seen.face, 2] < -0.95).all()
    below = cast_rays(surface, np.column_stack([rng.uniform(8, 12, (50, 2)), np.ones(50)]), (0, 0, -1))
    np.testing.assert_allclose(below.distance, 1, atol=0.05)
    assert (surface.face_normals[below.face, 2] > 0.95).all()


@pytest.fixture(scope="module")
def ground(tmp_path_factory):
    points, _ = cliff(2, 0.02)
    path = tmp_path_factory.mktemp("cliff") / "cliff.xyz"
    np.savetxt(path, points, fmt="%.4f")
    return make_ground(read_terrain(path, shift=GlobalShift()))


def test_rays_from_below_hit_the_underside_and_rays_from_above_the_top(ground):
    rng = np.random.default_rng(4)
    places = np.column_stack([rng.uniform(ROOF + 0.5, FOOT - 0.5, 500), rng.uniform(8.5, 21.5, 500), np.full(500, 2.0)])
    up, down = (cast_rays(ground.terrain, places, (0, 0, z)) for z in (1, -1))
    np.testing.assert_allclose(up.point[:, 2], LOW, atol=0.06)
    np.testing.assert_allclose(down.point[:, 2], SLOPE * (places[:, 0] - FOOT), atol=0.06)
    above = cast_rays(ground.terrain, places + np.array([0, 0, 20]), (0, 0, -1))
    np.testing.assert_allclose(above.point[:, 2], TOP, atol=0.06)


def test_blocks_fall_past_the_roof_and_others_below_it(ground):
    y = np.linspace(10.0, 20.0, 11)
    over, under = (np.column_stack([np.full(11, x), y, np.full(11, z)]) for x, z in ((1.0, TOP + 0.3), (3.0, 2.0)))
    velocity = np.repeat([[-6.0, 0, 0], [0.0, 0, 0]], 11, axis=0)
    releases = make_releases(np.vstack([over, under]), velocity=velocity, diameter_m=0.4)
    records = simulate(ground, releases, Settings("noel_2017")).records
    hit = records.what == IMPACT
    first = [np.flatnonzero(hit & (records.run == run)) for run in range(22)]
    places = np.array([records.position[rows[records.position[rows, 2] < TOP - 0.5][0]] for rows in first])
    height = places[:, 2] - SLOPE * (places[:, 0] - FOOT)
    np.testing.assert_allclose(height * np.cos(np.radians(20)), 0.2, atol=0.06)
    assert (places[:11, 0] < ROOF - 3).all()
    np.testing.assert_allclose(places[11:, :2], under[:, :2], atol=1e-6)


def test_too_large_ones_stay_in_plan_and_that_is_said(monkeypatch):
    points, _ = cliff(1, 0.0, 0.4)
    flat = mesh_cloud(points, None)
    monkeypatch.setattr(folds, "MOST_POINTS", 1000)
    found, said = folds.mesh_folds(points, flat, find_overhangs(points), None)
    assert found is flat
    assert "more than can be meshed in space (1,000)" in said
    assert "Thin the cloud" in said
