# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of many runs: those that the core counts, kept with the file, undone, and said to be old when they are."""

import json
from pathlib import Path

import bpy
import numpy as np
import pytest


@pytest.fixture
def slope(scan: bpy.types.Scene, part) -> bpy.types.Scene:
    """The rough slope, with a line near its top from which blocks start."""
    points = [np.array([6.0, y, 91.5]) for y in (20.0, 60.0, 100.0)]
    settings = scan.rockfall_simulation
    settings.source, settings.drawn = (
        "DRAWN",
        part("rockfall_addon.scene.simulation.drawn_releases").make(scan, "line", points),
    )
    settings.map_number, settings.seed, settings.map_cell_m = 150, 3, 4.0
    return scan


@pytest.fixture
def mapped(slope: bpy.types.Scene) -> bpy.types.Scene:
    assert bpy.ops.rockfall.compute_maps() == {"FINISHED"}
    return slope


def kept(part, scene: bpy.types.Scene):
    maps = part("rockfall_addon.scene.simulation.hazard_maps")
    return maps.read(maps.maps_of(scene))


def said(part, scene: bpy.types.Scene) -> str:
    return " ".join(remark.text for remark in part("rockfall_addon.scene.simulation.hazard_maps").remarks(scene))


def test_the_maps_are_those_of_the_core(mapped: bpy.types.Scene, part) -> None:
    """Against runs that are simulated at once, and cells that are looked up in plain NumPy."""
    setup, maps = part("rockfall_addon.scene.simulation.simulation_setup"), kept(part, mapped)
    sources = part("rockfall_addon.scene.simulation.simulated_sources")
    scenario = setup.plan(mapped, sources.entry_with(mapped, ["noel_2017"], 150)).scenario
    (simulation,) = part("core.workflow.simulation").run_scenario(scenario)
    cells = maps.cells
    assert (maps.blocks, cells.size_m) == (150, 4.0)
    rest = simulation.position[simulation.at_rest]
    column, row = np.floor((rest[:, :2] - [cells.x0_m, cells.y0_m]) / 4.0).astype(int).T
    expected = np.zeros(cells.shape)
    np.add.at(expected, (row, column), 1)
    np.testing.assert_array_equal(np.nan_to_num(maps.layers["Nr_deposited"]), expected)
    column, row = np.floor((simulation.releases.position[:, :2] - [cells.x0_m, cells.y0_m]) / 4.0).astype(int).T
    assert (maps.layers["Nr_blocks"][row, column] > 0).all()
    fastest = np.nanmax(maps.layers["V_max"])
    # A short step that ends at a corner is drawn as a parabola, which is a little faster than its ends.
    assert fastest == pytest.approx(simulation.v_max_mps.max(), rel=1e-3)
    assert "Maps of 150 blocks with Noël et al. 2017" in said(part, mapped)


def test_maps_are_saved_and_undone(mapped: bpy.types.Scene, tmp_path: Path, part) -> None:
    before = {name: values.copy() for name, values in kept(part, mapped).layers.items()}
    path = tmp_path / "maps.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    assert bpy.ops.rockfall.remove_maps() == {"FINISHED"}
    assert part("rockfall_addon.scene.simulation.hazard_maps").maps_of(mapped) is None
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    again = kept(part, scene)
    assert again.layers.keys() == before.keys() == part("core.hazard.maps").LAYERS.keys()
    for name, values in before.items():
        np.testing.assert_array_equal(again.layers[name], values)
    assert not part("rockfall_addon.scene.simulation.hazard_maps").is_stale(scene)


def test_changes_make_maps_old_and_others_do_not(mapped: bpy.types.Scene, part) -> None:
    maps, settings = part("rockfall_addon.scene.simulation.hazard_maps"), mapped.rockfall_simulation
    settings.number, settings.models, settings.map_layer = 7, {"stevens_1998"}, "E_95CI"
    assert not maps.is_stale(mapped), "what the paths are of, and which map is shown"
    for name, value in (("map_number", 151), ("map_cell_m", 3.0), ("seed", 4), ("friction", 0.9)):
        old = getattr(settings, name)
        setattr(settings, name, value)
        assert "compute the maps again" in said(part, mapped), name
        setattr(settings, name, old)
        assert not maps.is_stale(mapped), name
    settings.seed = 9
    with pytest.raises(RuntimeError, match="compute them again"):
        bpy.ops.rockfall.export_maps(directory="//")


def test_the_probe_tells_the_numbers_of_the_cell(mapped: bpy.types.Scene, part) -> None:
    probe, maps = part("rockfall_addon.steps.simulation.map_probe"), kept(part, mapped)
    row, column = np.unravel_index(np.nanargmax(maps.layers["Nr_passages"]), maps.cells.shape)
    sentences, table = probe.card_of(maps, row, column)
    assert sentences[0].startswith(f"{maps.layers['Nr_blocks'][row, column]:.0f} of 150 blocks enter this cell of 4 m")
    energy = next(cells for cells in table if cells[0] == "kinetic energy [kJ]")
    assert energy[table[0].index("95 %")] == f"{maps.layers['E_95CI'][row, column]:.3g}"
    assert energy[table[0].index("max")] == f"{maps.layers['E_max'][row, column]:.3g}"
    empty = np.argwhere(np.isnan(maps.layers["Nr_blocks"]))[0]
    assert probe.card_of(maps, *empty) == (["No block enters this cell of 4 m."], [])
    where = part("rockfall_addon.scene.simulation.hazard_maps").cell_at
    x, y = maps.cells.x0_m + 4.0 * column + 0.1, maps.cells.y0_m + 4.0 * row + 3.9
    assert where(maps.cells, np.array([x, y, 0.0])) == (row, column)
    assert where(maps.cells, np.array([maps.cells.x0_m - 0.1, y, 0.0])) is None


def test_maps_that_cannot_be_are_set_aside(mapped: bpy.types.Scene, tmp_path: Path, part) -> None:
    obj = part("rockfall_addon.scene.simulation.hazard_maps").maps_of(mapped)
    obj["rockfall_map_cells"] = [0.0, 0.0, -1.0, 5.0, 5.0]
    path = str(tmp_path / "damaged.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert part("rockfall_addon.scene.simulation.hazard_maps").maps_of(bpy.context.scene) is None
    assert any("Maps" in obj.name for obj in bpy.context.scene.objects)


def test_points_have_no_maps_and_nothing_is_lost(mapped: bpy.types.Scene, part) -> None:
    mapped.rockfall_simulation.contact = "points"
    with pytest.raises(RuntimeError, match="points"):
        bpy.ops.rockfall.compute_maps()
    assert kept(part, mapped).blocks == 150


def test_maps_are_exported(mapped: bpy.types.Scene, tmp_path: Path, part) -> None:
    assert bpy.ops.rockfall.export_maps(directory=str(tmp_path / "maps")) == {"FINISHED"}
    written = {file.name for file in (tmp_path / "maps").iterdir()}
    assert {"E_95CI.tif", "E_95CI.qml", "Reach_probability.tif", "Nr_deposited.tif"} <= written
    source = part("core.terrain.geotiff").read_geotiff(tmp_path / "maps" / "Ph_max.tif")  # metres: kJ are no heights
    np.testing.assert_allclose(np.nanmax(source.points[:, 2]), np.nanmax(kept(part, mapped).layers["Ph_max"]))
    assert json.loads(mapped.objects["Maps"]["rockfall_map_of"])["remarks"]


def test_faces_are_mapped_beside_the_cells(mapped: bpy.types.Scene, part, tmp_path: Path) -> None:
    """Against the same runs, counted by the core; after saving, too."""
    module = part("rockfall_addon.scene.simulation.hazard_maps")
    found = module.faces_of(mapped)
    asked = module.plan(mapped)
    ground = part("core.workflow.simulation").ground_of(asked.plan.scenario)
    simulate = part("core.simulation.engine").simulate
    runs = simulate(ground, asked.plan.scenario.releases(ground), asked.plan.scenario.settings[0], record="all")
    tally = part("core.hazard.face_tally").FaceTally(len(ground.owner))
    tally.add(runs)
    layers = tally.layers()
    touched = np.flatnonzero(layers["Nr_contacts"] > 0)
    np.testing.assert_array_equal(found.faces, touched)
    assert touched.size > 50
    for name, values in layers.items():
        np.testing.assert_array_equal(found.layers[name], values[touched].astype(np.float32), err_msg=name)
    np.testing.assert_allclose(found.corners, ground.vertices[ground.faces[touched]], atol=1e-4)
    assert set(found.of.tolist()) == {"terrain"}
    path = str(tmp_path / "faces.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    again = module.faces_of(bpy.context.scene)
    np.testing.assert_array_equal(again.layers["E_max"], found.layers["E_max"])
    assert again.blocks == found.blocks == 150
    assert bpy.ops.rockfall.export_maps(directory=str(tmp_path / "maps")) == {"FINISHED"}
    rows = (tmp_path / "maps" / "faces.csv").read_text().splitlines()
    assert len(rows) == len(found.faces) + 1
    assert (tmp_path / "maps" / "faces.gpkg").is_file()
    obj = next(one for one in bpy.data.objects if one.get("rockfall_role") == "face_maps")
    names = list(obj["face_of"])
    for damage in ([], 5, "terrain"):
        obj["face_of"] = damage
        assert module.faces_of(bpy.context.scene) is None
    obj["face_of"] = names
    assert module.faces_of(bpy.context.scene) is not None
    assert bpy.ops.rockfall.remove_maps() == {"FINISHED"}
    assert module.faces_of(bpy.context.scene) is None
    assert not [one for one in bpy.data.objects if one.get("rockfall_role") == "face_maps"]


def test_the_probe_tells_the_numbers_of_the_face(mapped: bpy.types.Scene, part) -> None:
    probe = part("rockfall_addon.steps.simulation.face_overlay")
    faces = part("rockfall_addon.scene.simulation.hazard_maps").faces_of(mapped)
    row = int(np.nanargmax(faces.layers["Nr_contacts"]))
    middle = faces.corners[row].mean(axis=0)
    above = middle + np.array([0.0, 0.0, 30.0])
    down = np.array([0.0, 0.0, -1.0])
    assert probe.face_under(faces, above, down, 30.0) == row
    assert probe.face_under(faces, above, down, 10.0) == -1, "the terrain is before it"
    sentences, table = probe.card_of(faces, row)
    assert sentences[0].startswith(f"{faces.layers['Nr_blocks'][row]:.0f} of 150 blocks touch this face of the terrain")
    energy = next(cells for cells in table if cells[0] == "kinetic energy [kJ]")
    assert energy[table[0].index("max")] == f"{faces.layers['E_max'][row]:.3g}"
    assert probe.card_of(faces, -1) == (["No block touches this face."], [])


def test_maps_mean_the_same_with_and_without_barriers(mapped: bpy.types.Scene, part) -> None:
    """A drawn barrier changes no map by itself; with *With Barriers* fewer blocks come below it."""
    maps, screens = part("rockfall_addon.scene.simulation.hazard_maps"), part("rockfall_addon.scene.simulation.screens")
    plain = np.nan_to_num(kept(part, mapped).layers["Nr_blocks"]).copy()
    surface = part("rockfall_addon.scene.picks.reconstruction").ground(mapped)
    screen = part("core.hazard.screens").Screen("net", np.array([[30.0, -10.0], [30.0, 130.0]]), 3.0, 1e9)
    screens.keep(mapped, screen, surface)
    assert bpy.ops.rockfall.compute_maps() == {"FINISHED"}
    np.testing.assert_array_equal(np.nan_to_num(kept(part, mapped).layers["Nr_blocks"]), plain)
    mapped.rockfall_simulation.map_with_barriers = True
    assert maps.is_stale(mapped)
    assert bpy.ops.rockfall.compute_maps() == {"FINISHED"}
    held = np.nan_to_num(kept(part, mapped).layers["Nr_blocks"])
    assert (held <= plain).all()
    assert held.sum() < plain.sum()
    assert maps.with_barriers(maps.maps_of(mapped))
    assert "Blocks end where a barrier holds them: net" in said(part, mapped)


def test_what_says_little_is_kept_with_the_maps(mapped: bpy.types.Scene, part, tmp_path: Path) -> None:
    maps = part("rockfall_addon.scene.simulation.hazard_maps")
    few = part("core.hazard.evidence").FEW
    mapped.rockfall_simulation.map_number, mapped.rockfall_simulation.map_cell_m = 300, 10.0
    assert bpy.ops.rockfall.compute_maps() == {"FINISHED"}
    read = kept(part, mapped)
    found = maps.evidence_of(maps.maps_of(mapped), read)
    blocks = np.nan_to_num(read.layers["Nr_blocks"])
    np.testing.assert_array_equal(found.few, (blocks > 0) & (blocks < few))
    assert 0 < found.few.sum() < (blocks > 0).sum()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "maps.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "maps.blend"))
    again = maps.evidence_of(maps.maps_of(bpy.context.scene), kept(part, bpy.context.scene))
    np.testing.assert_array_equal(again.weak, found.weak)
    assert again.in_words == found.in_words
