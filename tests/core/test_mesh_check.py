# SPDX-License-Identifier: GPL-3.0-or-later
"""What a simulation says of its mesh: edges beside blocks, and the same blocks on a finer mesh of the same surface."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.simulation.zones import Zones
from rockfall.core.terrain.cloud import Cloud
from rockfall.core.terrain.subdivision import subdivided
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow import mesh_check
from rockfall.core.workflow.mesh_check import change_remarks, mesh_changes, refined_ground
from rockfall.core.workflow.mesh_fineness import fineness, fineness_remarks
from rockfall.core.workflow.simulation import Scenario, remarks_of


def sheet(x: np.ndarray, y: np.ndarray, height) -> Surface:
    x, y = np.meshgrid(x, y)
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(
        np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3), faces.astype(np.int32), GlobalShift(), "sheet"
    )


def rough(x, y):
    """Waves of 3 m and more on a slope of 31°."""
    return -0.6 * x + 0.02 * np.sin(2 * x + y) + 0.04 * np.sin(x - 0.7 * y)


def slope(spacing: float, height=rough) -> Surface:
    return sheet(np.arange(0.0, 40.0 + spacing / 2, spacing), np.arange(0.0, 12.0 + spacing / 2, spacing), height)


def blocks(ground, count: int = 40, diameter: float = 0.3) -> Releases:
    places = np.random.default_rng(2).uniform([2, 4], [4, 8], (count, 2))
    centre = placed_on(ground, places, np.full(count, diameter))
    return make_releases(centre, velocity=np.tile([2.0, 0.0, -1.2], (count, 1)), diameter_m=diameter)


def scenario(terrain, **own) -> Scenario:
    return Scenario(terrain, blocks, {"azimi_desvarreux_1977": {}}, friction=0.7, **own)


def test_divided_triangles_of_a_sphere_come_nearer_to_it() -> None:
    """The chord's middle is s²/8R below the arc; after the division a twentieth of that is left."""
    x = np.arange(-5.0, 5.1, 1.0)
    surface = sheet(x, x, lambda x, y: np.sqrt(100.0 - x**2 - y**2))
    fine = subdivided(surface)
    new = fine.vertices[len(surface.vertices) :]
    inner = new[np.abs(new[:, :2]).max(axis=1) < 3.9]
    assert len(inner) > 100
    assert np.abs(np.linalg.norm(inner, axis=1) - 10.0).max() < 0.05 * 2.0 / 80.0
    np.testing.assert_array_equal(fine.vertices[: len(surface.vertices)], surface.vertices)


def test_planes_true_edges_and_borders_stay_and_faces_keep_their_order() -> None:
    """A kink of 70° between two planes: every new vertex is on one of them, each face within its own."""
    line = np.arange(-3.0, 4.0)
    surface = sheet(line, line, lambda x, y: np.tan(np.radians(35)) * np.abs(x))
    fine = subdivided(surface)
    np.testing.assert_allclose(fine.vertices[:, 2], np.tan(np.radians(35)) * np.abs(fine.vertices[:, 0]), atol=1e-12)
    np.testing.assert_allclose(fine.face_normals, np.repeat(surface.face_normals, 4, axis=0), atol=1e-12)
    np.testing.assert_allclose(fine.face_areas, np.repeat(surface.face_areas, 4) / 4, rtol=1e-12)
    assert (fine.neighbours == -1).sum() == 2 * (surface.neighbours == -1).sum()
    assert (fine.neighbours != -2).all()


@pytest.mark.parametrize(
    ("spacing", "height", "coarse"),
    [(0.1, rough, False), (1.0, rough, True), (4.0, lambda x, y: -0.6 * x, False)],
    ids=["fine", "coarse", "plane"],
)
def test_the_ratio_is_always_said_and_warned_of_where_the_ground_is_curved(spacing, height, coarse) -> None:
    ground = make_ground(slope(spacing, height))
    run = simulate(ground, blocks(ground), Settings("azimi_desvarreux_1977", friction=0.7))
    (remark,) = [one for one in remarks_of([run]) if one.about == "mesh"]
    found = fineness([run])
    assert spacing < found.edge_m < 1.6 * spacing
    assert found.diameter_m == pytest.approx(0.3)
    assert f"edges of {found.edge_m / 0.3:.2g} diameters" in remark.text
    assert remark.severity == ("warning" if coarse else "note")
    assert ("Check the mesh" in remark.text) == coarse


def test_points_have_no_mesh() -> None:
    surface = slope(0.05)
    cloud = Cloud(surface.vertices, GlobalShift(), "cloud")
    ground = make_ground(cloud)
    run = simulate(ground, blocks(ground), Settings("azimi_desvarreux_1977"), record="ends")
    assert fineness_remarks([run]) == []
    with pytest.raises(InputError, match="no mesh to check"):
        refined_ground(scenario(cloud), 0.1)


def test_a_plane_changes_nothing_and_a_coarse_mesh_as_much_as_it_does() -> None:
    """The change is that of a run on the finer mesh, which anyone can make."""
    flat = scenario(slope(4.0, lambda x, y: -0.6 * x))
    ground = make_ground(flat.terrain)
    (one,) = mesh_changes(flat, ground, blocks(ground))
    assert abs(one.change) < 2e-3
    assert one.is_settled
    coarse = scenario(slope(1.0))
    ground = make_ground(coarse.terrain)
    releases = blocks(ground)
    (one,) = mesh_changes(coarse, ground, releases)
    before = simulate(ground, releases, coarse.settings[0], record="ends")
    way = np.linalg.norm((before.position - releases.position)[:, :2], axis=1)
    assert one.runout_m == pytest.approx(way.mean())
    assert one.change == pytest.approx(one.refined_m / one.runout_m - 1)
    assert one.edge_m <= 0.15
    assert f"{100 * one.change:+.1f}" in change_remarks([one])[0].text


def test_a_mesh_that_cannot_be_made_fine_enough_is_said_to_depend_by_more(monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = scenario(slope(1.0))
    ground = make_ground(coarse.terrain)
    monkeypatch.setattr(mesh_check, "MOST_FACES", 5 * len(coarse.terrain.faces))
    (one,) = mesh_changes(coarse, ground, blocks(ground))
    assert not one.is_settled
    (remark,) = change_remarks([one])
    assert remark.severity == "warning"
    assert "or more" in remark.text
    monkeypatch.setattr(mesh_check, "MOST_FACES", 3 * len(coarse.terrain.faces))
    with pytest.raises(InputError, match="too many to divide"):
        mesh_changes(coarse, ground, blocks(ground))


def test_zones_go_along() -> None:
    """The upper half holds blocks, however fine it is."""
    terrain = slope(1.0, lambda x, y: -0.6 * x)
    upper = terrain.vertices[terrain.faces].mean(axis=1)[:, 0] < 20.0
    zones = Zones(("rest", "upper"), upper.astype(np.int32), friction={"upper": 5.0})
    held = scenario(terrain, zones=zones)
    ground, _ = refined_ground(held, 0.5)
    middle = ground.terrain.vertices[ground.terrain.faces].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(ground.zone.astype(bool), middle < 20.0)
