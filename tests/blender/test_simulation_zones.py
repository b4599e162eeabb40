# SPDX-License-Identifier: GPL-3.0-or-later
"""Zones of the ground that are painted or chosen in Blender have parameters of their own."""

import bpy
import numpy as np
import pytest


@pytest.fixture
def scan(part) -> bpy.types.Scene:
    """A plane of 40 × 40 squares of 1 m that falls along x, in survey coordinates."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(41.0), np.arange(41.0), indexing="ij"))
    corner = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    ring = np.column_stack([corner, corner + 41, corner + 42, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    shift = part("core.georeference").GlobalShift(2_600_000.0, 1_200_000.0, 0.0)
    surface = part("core.terrain.surface").Surface(np.column_stack([x, y, -0.7 * x]), faces, shift, "scan", ())
    scene = bpy.context.scene
    part("rockfall_addon.scene.terrain").add_terrain(scene, surface, part("core.terrain.shading").shade(surface))
    settings = scene.rockfall_simulation
    settings.source, settings.steeper_than_deg, settings.number, settings.models = "STEEP", 20.0, 6, {"noel_2017"}
    return scene


def tile_of(scene: bpy.types.Scene) -> bpy.types.Object:
    return next(obj for obj in scene.objects if obj.get("rockfall_role") == "terrain")


def plan(part, scene: bpy.types.Scene):
    return part("rockfall_addon.scene.simulation_setup").plan(scene)


def middles(surface) -> np.ndarray:
    return surface.vertices[surface.faces].mean(axis=1)


def test_a_vertex_group_and_an_attribute_are_zones(scan: bpy.types.Scene, part) -> None:
    tile, settings = tile_of(scan), scan.rockfall_simulation
    assert plan(part, scan).scenario.zones is None
    assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
    wood = settings.zones[0]
    wood.friction, wood.parameters = 0.8, "rt = 0.4, noel_2017.rt_sd=0"
    group = tile.vertex_groups[wood.name]
    place = np.array([vertex.co for vertex in tile.data.vertices])
    group.add(np.flatnonzero(place[:, 0] >= 30).tolist(), 0.7, "REPLACE")
    group.add(np.flatnonzero(place[:, 0] < 10).tolist(), 0.3, "REPLACE")
    assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
    scree = settings.zones[1]
    scree.name, scree.use_friction = "scree", False
    attribute = tile.data.attributes.new("scree", "BOOLEAN", "FACE")
    corners = np.array([list(face.vertices) for face in tile.data.polygons])
    chosen = (place[corners].mean(axis=1)[:, 1] < 10) & (place[corners].mean(axis=1)[:, 0] < 35)
    attribute.data.foreach_set("value", chosen)
    part("rockfall_addon.scene.terrain_mesh").mistrust(tile.data)

    scenario = plan(part, scan).scenario
    zones, at = scenario.zones, middles(scenario.terrain)
    assert zones.names == ("terrain", wood.name, "scree")
    expected = np.where((at[:, 1] < 10) & (at[:, 0] < 35), 2, 0)
    # Two of three corners at 30 and more: the upper triangles of the column from 29 to 30, and all that follow.
    expected[at[:, 0] > 29.5] = 1
    np.testing.assert_array_equal(zones.of_face, expected)
    assert zones.friction == {wood.name: pytest.approx(0.8)}
    assert zones.parameters == {wood.name: {"noel_2017": {"rt": 0.4, "rt_sd": 0.0}}}
    said = [str(remark) for remark in zones.remarks]
    assert any("in more than one zone" in text for text in said)
    assert any("Zones without parameters of their own: scree" in text for text in said)
    assert bpy.ops.rockfall.remove_zone(place=1) == {"FINISHED"}
    assert plan(part, scan).scenario.zones.names == ("terrain", wood.name)


def test_zones_that_change_make_the_result_stale(scan: bpy.types.Scene, part) -> None:
    setup = part("rockfall_addon.scene.simulation_setup")
    tile = tile_of(scan)
    assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
    prints = [setup.fingerprint(scan)]
    tile.vertex_groups[0].add(range(900), 1.0, "REPLACE")
    part("rockfall_addon.scene.terrain_mesh").mistrust(tile.data)
    prints.append(setup.fingerprint(scan))
    scan.rockfall_simulation.zones[0].parameters = "rt = 0.4"
    prints.append(setup.fingerprint(scan))
    assert len(set(prints)) == 3
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    said = [str(remark) for remark in setup.remarks(scan)]
    assert any("in no zone" in text for text in said)
    assert not setup.is_stale(scan)


def test_a_project_keeps_the_zones(scan: bpy.types.Scene, part, tmp_path) -> None:
    project = part("rockfall_addon.scene.project")
    tile, settings = tile_of(scan), scan.rockfall_simulation
    place = np.array([vertex.co for vertex in tile.data.vertices])
    for friction, parameters, chosen in ((0.8, "rt = 0.4", place[:, 0] > 25), (0.25, "", place[:, 1] < 6)):
        assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
        settings.zones[-1].friction, settings.zones[-1].parameters = friction, parameters
        tile.vertex_groups[settings.zones[-1].name].add(np.flatnonzero(chosen).tolist(), 1.0, "REPLACE")
    part("rockfall_addon.scene.terrain_mesh").mistrust(tile.data)
    before = plan(part, scan).scenario
    path, _ = project.save_project(scan, tmp_path / "project")

    core = part("core.workflow.scenarios")
    stated = core.open_simulation(part("core.exchange.project").read_project(path), path)[0]
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    project.load_project(bpy.context.scene, path)
    after = plan(part, bpy.context.scene).scenario
    for scenario in (stated, after):
        assert scenario.zones.names == before.zones.names
        assert scenario.zones.parameters == before.zones.parameters
        assert scenario.zones.friction == pytest.approx(before.zones.friction)
        np.testing.assert_array_equal(
            scenario.zones.of_face[np.lexsort(middles(scenario.terrain).round(3).T)],
            before.zones.of_face[np.lexsort(middles(before.terrain).round(3).T)],
        )


def test_zones_that_make_no_sense_are_refused(scan: bpy.types.Scene, part) -> None:
    error = part("core.errors").RockfallError
    assert bpy.ops.rockfall.add_zone() == {"FINISHED"}
    with pytest.raises(error, match="No zone is anywhere on the terrain"):
        plan(part, scan)
    tile_of(scan).vertex_groups[0].add(range(900), 1.0, "REPLACE")
    part("rockfall_addon.scene.terrain_mesh").mistrust(tile_of(scan).data)
    zone = scan.rockfall_simulation.zones[0]
    for text, message in (
        ("rtt = 0.4", "Did you mean rt"),
        ("rt", "'rt' sets no parameter"),
        ("rt = 7", "outside its range"),
    ):
        zone.parameters = text
        with pytest.raises(error, match=message):
            plan(part, scan)
