# SPDX-License-Identifier: GPL-3.0-or-later
"""Marked meshes hold blocks where they stand; they are saved, undone, and go along with a project."""

from pathlib import Path

import bpy
import numpy as np
import pytest

WALL_X = 70.0


@pytest.fixture
def slope(scan: bpy.types.Scene, part) -> bpy.types.Scene:
    """The rough slope, which runs out from x = 60 on, and a line near its top, from which eight blocks start."""
    points = [np.array([6.0, y, 91.5]) for y in (20.0, 60.0, 100.0)]
    settings = scan.rockfall_simulation
    settings.source, settings.drawn = (
        "DRAWN",
        part("rockfall_addon.scene.simulation.drawn_releases").make(scan, "line", points),
    )
    settings.number, settings.seed, settings.models = 8, 3, {"noel_2017"}
    return scan


@pytest.fixture
def wall(slope: bpy.types.Scene) -> bpy.types.Object:
    """A board of 1 m × 2 m, turned and enlarged to stand high and wide across the foot of the slope; not marked."""
    mesh = bpy.data.meshes.new("board")
    mesh.from_pydata([(0, -1, -0.5), (0, 1, -0.5), (0, 1, 0.5), (0, -1, 0.5)], [], [(0, 1, 2, 3)])
    obj = bpy.data.objects.new("wall", mesh)
    slope.collection.objects.link(obj)
    obj.location, obj.scale = (WALL_X, 59.0, 30.0), (1.0, 65.0, 100.0)
    bpy.context.view_layer.update()
    return obj


def use(*objects: bpy.types.Object) -> set[str]:
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    return bpy.ops.rockfall.use_as_structure()


def farthest(scene: bpy.types.Scene) -> float:
    """Greatest x of all shown paths."""
    paths = next(obj for obj in scene.objects if obj.get("rockfall_role") == "simulated_paths")
    values = np.empty(3 * len(paths.data.points), dtype=np.float32)
    paths.data.attributes["position"].data.foreach_get("vector", values)
    return float(values[0::3].max())


def said(part, scene: bpy.types.Scene) -> str:
    return " ".join(remark.text for remark in part("rockfall_addon.scene.simulation.simulation_setup").remarks(scene))


def test_a_structure_across_the_slope_holds_blocks(slope: bpy.types.Scene, wall: bpy.types.Object, part) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert farthest(slope) > WALL_X + 1, "an object that is not marked is no obstacle"
    assert use(wall) == {"FINISHED"}
    assert part("rockfall_addon.scene.simulation.simulation_setup").is_stale(slope)
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert farthest(slope) < WALL_X + 1e-3
    simulations = part("core.workflow.simulation").run_scenario(
        part("rockfall_addon.scene.simulation.simulation_setup").plan(slope).scenario
    )
    assert simulations[0].ends[-1] == "structure:wall"
    records = simulations[0].records
    owner = simulations[0].ground.owner[records.face]
    impact = (records.what == part("core.simulation.engine").IMPACT) & (owner == 1)
    blocks, times = len(set(records.run[impact].tolist())), int(impact.sum())
    assert blocks > 0
    assert f"{blocks} of 8 blocks with Noël et al. 2017 hit wall, {times} times; 0 of them went on" in said(part, slope)
    wall.location.x += 200.0
    bpy.context.view_layer.update()
    assert part("rockfall_addon.scene.simulation.simulation_setup").is_stale(slope)
    with pytest.raises(RuntimeError, match="structure wall stands nowhere near"):
        bpy.ops.rockfall.simulate()
    wall.location.x -= 200.0
    bpy.context.view_layer.update()
    assert not part("rockfall_addon.scene.simulation.simulation_setup").is_stale(slope)
    wall.data.vertices[0].co.z -= 0.1
    wall.data.update()
    bpy.context.view_layer.update()
    assert part("rockfall_addon.scene.simulation.simulation_setup").is_stale(slope), "its mesh was edited"
    assert bpy.ops.rockfall.remove_structure(name="wall") == {"FINISHED"}
    assert wall.name in slope.objects
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert farthest(slope) > WALL_X + 1


def test_a_structure_is_taken_where_its_matrix_puts_it(slope: bpy.types.Scene, wall: bpy.types.Object, part) -> None:
    use(wall)
    structure = part("rockfall_addon.scene.simulation.simulation_setup").plan(slope).scenario.structures["wall"]
    corners = {(WALL_X, y, z) for y in (59.0 - 65.0, 59.0 + 65.0) for z in (-20.0, 80.0)}
    assert {tuple(corner) for corner in structure.vertices.tolist()} == corners
    assert len(structure.faces) == 2


def test_structures_are_saved_and_undone(slope: bpy.types.Scene, wall: bpy.types.Object, part, tmp_path: Path) -> None:
    structures, setup = (
        part("rockfall_addon.scene.simulation.structures"),
        part("rockfall_addon.scene.simulation.simulation_setup"),
    )
    bpy.ops.ed.undo_push(message="before")
    use(wall)
    bpy.ops.ed.undo_push(message="marked")
    assert [obj.name for obj in structures.objects_of(bpy.context.scene)] == ["wall"]
    bpy.ops.ed.undo()
    assert not structures.objects_of(bpy.context.scene)
    bpy.ops.ed.redo()
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    before = farthest(bpy.context.scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    scene = bpy.context.scene
    assert not setup.is_stale(scene)
    assert [obj.name for obj in structures.objects_of(scene)] == ["wall"]
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert farthest(scene) == before < WALL_X + 1e-3


@pytest.mark.parametrize("with_releases", [True, False])
def test_a_project_takes_structures_along(
    slope: bpy.types.Scene, wall: bpy.types.Object, part, tmp_path: Path, with_releases: bool
) -> None:
    use(wall)
    if not with_releases:
        slope.rockfall_simulation.drawn = None
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    project = tmp_path / "out" / "project.toml"
    (entry,) = part("core.exchange.project").read_project(project).simulation.structures
    read = part("core.terrain.readers").read_structure(entry.file, part("core.terrain.opening").HowToRead(up="z"))
    survey = read.shift.to_survey(read.vertices)
    np.testing.assert_allclose(survey.min(axis=0), [2_600_000.0 + WALL_X, 1_200_000.0 - 6.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(survey.max(axis=0), [2_600_000.0 + WALL_X, 1_200_000.0 + 124.0, 80.0], atol=1e-9)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(project)) == {"FINISHED"}
    scene = bpy.context.scene
    again = part("rockfall_addon.scene.simulation.structures").met_of(scene)
    assert list(again) == ["wall"]
    np.testing.assert_allclose(again["wall"].bounds, [[WALL_X, -6.0, -20.0], [WALL_X, 124.0, 80.0]], atol=1e-5)
    if with_releases:
        assert bpy.ops.rockfall.simulate() == {"FINISHED"}
        assert farthest(scene) < WALL_X + 1e-3


def test_a_cloud_without_faces_is_a_structure_and_goes_along_with_a_project(
    slope: bpy.types.Scene, part, tmp_path: Path
) -> None:
    """A wall of points 0.12 m apart; blocks meet the terrain's triangles all the same."""
    mesh = bpy.data.meshes.new("net")
    mesh.from_pydata([(0.0, y, z) for y in np.arange(0.0, 119.0, 0.12) for z in np.arange(14.0, 36.0, 0.12)], [], [])
    points, net = len(mesh.vertices), bpy.data.objects.new("net", mesh)
    net.location.x = WALL_X
    slope.collection.objects.link(net)
    bpy.context.view_layer.update()
    assert use(net) == {"FINISHED"}
    slope.rockfall_simulation.diameter_m = 1.0
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert farthest(slope) < WALL_X
    assert "hit net" in said(part, slope)
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(tmp_path / "out" / "project.toml")) == {"FINISHED"}
    again = part("rockfall_addon.scene.simulation.structures").met_of(bpy.context.scene)["net"]
    np.testing.assert_allclose(again.points.min(axis=0), [WALL_X, 0.0, 14.0], atol=1e-5)
    assert len(again.points) == points


def test_what_cannot_be_a_structure_is_refused(slope: bpy.types.Scene, wall: bpy.types.Object, part) -> None:
    terrain = next(obj for obj in slope.objects if obj.get("rockfall_role") == "terrain")
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj == terrain)
    assert not bpy.ops.rockfall.use_as_structure.poll(), "terrain is no structure"
    empty = bpy.data.objects.new("empty", bpy.data.meshes.new("empty"))
    slope.collection.objects.link(empty)
    with pytest.raises(RuntimeError, match="nothing that a block could meet"):
        use(wall, empty)
    assert not part("rockfall_addon.scene.simulation.structures").objects_of(slope), "all or none"
    use(wall)
    wall.modifiers.new("thick", "SOLIDIFY")
    assert "Apply the modifiers" in part("rockfall_addon.scene.simulation.simulation_setup").missing(slope)
    assert not bpy.ops.rockfall.simulate.poll()
