# SPDX-License-Identifier: GPL-3.0-or-later
"""The relief's sliders, and the coarse view of large terrain."""

from dataclasses import asdict

import bpy
import numpy as np
import pytest

RELIEF = ("hillshade", "eye_dome", "thin", "brightness", "contrast")


@pytest.fixture
def slope(part):
    """A rough slope of 20 000 triangles in the scene, some of its data thin."""
    x, y = np.meshgrid(np.arange(101) * 0.5, np.arange(101) * 0.5)
    z = 0.7 * x + np.random.default_rng(0).normal(0, 0.1, x.shape)
    i = np.arange(101 * 101, dtype=np.int32).reshape(101, 101)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    shift = part("core.georeference").GlobalShift(2_600_000.0, 1_200_000.0, 0.0)
    surface = part("core.terrain.surface").Surface(np.stack([x, y, z], -1).reshape(-1, 3), faces, shift, "slope.ply")
    shading = part("core.terrain.shading").shade(surface)
    return (
        part("rockfall_addon.scene.terrain.terrain").add_terrain(bpy.context.scene, surface, shading),
        surface,
        shading,
    )


def colours(mesh) -> np.ndarray:
    found = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    mesh.attributes["relief"].data.foreach_get("color", found)
    return found.reshape(-1, 4)


def drawn(obj) -> int:
    """Triangles that the 3-D view draws of an object."""
    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    return len(obj.evaluated_get(graph).data.polygons)


def values() -> dict[str, float]:
    nodes = bpy.data.materials["Rockfall terrain"].node_tree.nodes
    return {n: nodes[n].outputs[0].default_value for n in (*RELIEF, "scan_colours", "footage_colours")}


def test_usual_look_is_that_of_the_paper(part, slope) -> None:
    """rock × (0.25 + 0.75 hillshade) × (0.25 + 0.75 eye-dome) × 1.2; half-way to blue where data are thin."""
    ground, _, shading = slope
    rock, thin = np.array((0.47, 0.43, 0.38)), np.array((0.30, 0.42, 0.60))
    light = (0.25 + 0.75 * shading.hillshade) * (0.25 + 0.75 * shading.eye_dome) * 1.2
    mixed = np.where(shading.thin[:, None], 0.5 * (rock + thin), rock)
    assert shading.thin.any()
    np.testing.assert_allclose(colours(ground.data)[:, :3], mixed * light[:, None], atol=1e-6)


def test_each_slider_does_its_own(part, slope) -> None:
    ground, _, shading = slope
    settings = bpy.context.scene.rockfall_terrain
    for name in ("hillshade", "eye_dome", "thin"):
        setattr(settings, name, 0.0)
    flat = colours(ground.data)
    np.testing.assert_allclose(flat[:, :3], np.tile(1.2 * np.array((0.47, 0.43, 0.38)), (len(flat), 1)), rtol=1e-5)
    settings.hillshade = 1.0
    light = colours(ground.data)[:, 0] / flat[:, 0]
    np.testing.assert_allclose(light, shading.hillshade, atol=1e-5)
    settings.hillshade, settings.eye_dome = 0.0, 1.0
    np.testing.assert_allclose(colours(ground.data)[:, 0] / flat[:, 0], shading.eye_dome, atol=1e-5)
    settings.eye_dome, settings.thin = 0.0, 1.0
    blue = colours(ground.data)[:, 2] > flat[:, 2] + 0.01
    np.testing.assert_array_equal(blue, shading.thin)
    settings.thin, settings.brightness = 0.0, 0.5
    np.testing.assert_allclose(colours(ground.data)[:, :3], 0.5 * flat[:, :3], rtol=1e-5)
    settings.contrast, settings.brightness = 2.0, 1.0
    np.testing.assert_allclose(colours(ground.data)[:, 0], np.minimum(flat[:, 0] / 0.55, 1.0), rtol=1e-5)
    np.testing.assert_allclose(list(values().values()), [0.0, 0.0, 0.0, 1.0, 2.0, 1.0, 1.0])
    assert bpy.ops.rockfall.reset_relief() == {"FINISHED"}
    look = asdict(part("rockfall_addon.scene.terrain.terrain_look").look_of(bpy.context.scene))
    assert look == {
        **dict(zip(RELIEF, (0.75, 0.75, 0.7, 1.0, 1.0), strict=True)),
        "scan_colours": 1.0,
        "footage_colours": 1.0,
    }
    np.testing.assert_allclose(list(values().values()), list(look.values()), rtol=1e-6)


def test_sliders_and_coarse_view_are_in_the_file(part, slope, tmp_path) -> None:
    ground, surface, _ = slope
    settings = bpy.context.scene.rockfall_terrain
    settings.view_limit = 9000
    settings.hillshade = 0.2
    before, coarse = colours(ground.data), drawn(ground)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
    scene = bpy.context.scene
    (ground,) = [o for o in scene.objects if o.get("rockfall_role") == "terrain"]
    np.testing.assert_array_equal(colours(ground.data), before)
    assert values()["hillshade"] == pytest.approx(0.2)
    assert drawn(ground) == coarse
    assert len(ground.data.polygons) == len(surface.faces)
    scene.rockfall_terrain.full_resolution = True
    assert drawn(ground) == len(surface.faces)


def test_coarse_view_draws_a_third_of_the_limit_and_measures_on_all(part, slope) -> None:
    ground, surface, _ = slope
    scene = bpy.context.scene
    view, terrain = part("rockfall_addon.scene.terrain.terrain_view"), part("rockfall_addon.scene.terrain.terrain")
    assert drawn(ground) == len(surface.faces) == 20_000
    scene.rockfall_terrain.view_limit = 12_000
    assert drawn(ground) == pytest.approx(4000, rel=0.3)
    assert drawn(ground) == view.drawn_triangles(ground)
    assert terrain.surface_of_scene(scene) is surface
    assert len(scene.objects) == 1, "the coarse mesh is in no scene"
    assert any("of 20,000 triangles" in said for said in terrain.remarks(scene))
    evaluated = ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert evaluated.attributes.active_color_name == "relief"
    assert [slot.name for slot in evaluated.materials] == ["Rockfall terrain"]
    assert bpy.ops.rockfall.toggle_full_terrain() == {"FINISHED"}
    assert drawn(ground) == len(surface.faces)
    assert bpy.ops.rockfall.toggle_full_terrain() == {"FINISHED"}
    scene.rockfall_terrain.view_limit = 3_000_000
    assert drawn(ground) == len(surface.faces)
    assert not ground.modifiers
    assert [mesh.name for mesh in bpy.data.meshes] == [ground.data.name], "nothing is left"


def test_a_tile_of_two_triangles_beside_a_large_one_is_drawn_as_it_is(part, slope) -> None:
    ground, surface, _ = slope
    bpy.context.scene.rockfall_terrain.view_limit = 1000
    corners = surface.vertices[[0, 1, 101, 102]]
    small = part("core.terrain.surface").Surface(corners, np.array([[0, 1, 3], [0, 3, 2]]), surface.shift, "corner.obj")
    corner = part("rockfall_addon.scene.terrain.terrain").add_terrain(
        bpy.context.scene, small, part("core.terrain.shading").shade(small)
    )
    assert drawn(corner) == 2
    assert 0 < drawn(ground) < 1000


def test_coarse_view_follows_the_sliders(part, slope) -> None:
    ground, _, _ = slope
    scene = bpy.context.scene
    scene.rockfall_terrain.view_limit = 12_000
    before = colours(ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).data)
    scene.rockfall_terrain.brightness = 0.5
    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    after = colours(ground.evaluated_get(graph).data)
    assert len(after) < len(ground.data.vertices) / 2
    np.testing.assert_allclose(after[:, :3], before[:, :3] / 2, rtol=1e-5)
    assert colours(ground.data)[:, :3].mean() == pytest.approx(after[:, :3].mean(), rel=0.1)


def test_coarse_view_follows_an_edit(part, slope) -> None:
    ground, _, _ = slope
    bpy.context.scene.rockfall_terrain.view_limit = 12_000
    before = drawn(ground)
    for vertex in ground.data.vertices:
        vertex.co.z += 5.0
    ground.data.update()
    bpy.context.view_layer.update()
    assert drawn(ground) == before
    seen = ground.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    heights = [vertex.co.z - 0.7 * vertex.co.x for vertex in seen.vertices]
    assert min(heights) > 4.0
    assert max(heights) < 6.0


def test_a_render_takes_the_full_mesh(part, slope) -> None:
    ground, _, _ = slope
    bpy.context.scene.rockfall_terrain.view_limit = 12_000
    modifier = ground.modifiers["Coarse view"]
    assert (modifier.show_viewport, modifier.show_render) == (True, False)
    bpy.context.scene.rockfall_terrain.full_resolution = True
    assert (modifier.show_viewport, modifier.show_render) == (False, False)


def test_a_coarse_mesh_that_somebody_deletes_shows_the_full_one(part, slope) -> None:
    ground, surface, _ = slope
    scene = bpy.context.scene
    scene.rockfall_terrain.view_limit = 12_000
    bpy.data.objects.remove(part("rockfall_addon.scene.terrain.terrain_mesh").stand_in(ground))
    bpy.context.view_layer.update()
    assert drawn(ground) == len(surface.faces)
    scene.rockfall_terrain.brightness = 0.9


def test_tiles_share_the_view(part, slope) -> None:
    ground, surface, shading = slope
    scene = bpy.context.scene
    scene.rockfall_terrain.view_limit = 30_000
    assert drawn(ground) == 20_000
    second = part("rockfall_addon.scene.terrain.terrain").add_terrain(scene, surface, shading)
    assert drawn(ground) + drawn(second) == pytest.approx(10_000, rel=0.3)
    assert drawn(ground) == pytest.approx(drawn(second), rel=0.01)


def test_a_material_of_an_older_file_gets_its_sliders(part) -> None:
    old = bpy.data.materials.new("Rockfall terrain")
    materials = part("rockfall_addon.scene.storage.materials")
    assert materials.terrain_material() == old
    assert set(materials.TERRAIN_VALUES) <= set(old.node_tree.nodes.keys())
