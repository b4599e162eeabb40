# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain in the scene is the surveyed one."""

import re
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest


def wave(path: Path) -> np.ndarray:
    """A small ESRI grid in survey coordinates; returns its points."""
    x, y = np.meshgrid(2600000.25 + 0.5 * np.arange(30), 1200000.25 + 0.5 * np.arange(20)[::-1])
    z = 500 + 0.4 * (x - 2600000) + np.sin(y)
    header = "ncols 30\nnrows 20\nxllcorner 2600000\nyllcorner 1200000\ncellsize 0.5\nNODATA_value -9999\n"
    path.write_text(header + "\n".join(" ".join(f"{v:.6f}" for v in row) for row in z) + "\n", encoding="utf-8")
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def test_mesh_and_shift_give_the_survey_coordinates_back(part, tmp_path: Path) -> None:
    points = wave(tmp_path / "wave.asc")
    assert bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "wave.asc")) == {"FINISHED"}
    state, terrain = part("rockfall_addon.scene.terrain.georeference"), part("rockfall_addon.scene.terrain.terrain")
    ground = terrain.active_terrain(bpy.context.scene)
    coordinates = np.empty(3 * len(ground.data.vertices), dtype=np.float32)
    ground.data.vertices.foreach_get("co", coordinates)
    survey = state.read_shift(bpy.context.scene).to_survey(coordinates.reshape(-1, 3).astype(np.float64))
    order = np.lexsort(survey.T.round(3)), np.lexsort(points.T.round(3))
    np.testing.assert_allclose(survey[order[0]], points[order[1]], atol=1e-4)
    assert ground.data.attributes.active_color_name == "relief"
    assert len(ground.data.polygons) == 2 * 29 * 19


def test_surface_of_a_mesh_is_the_mesh(part, tmp_path: Path) -> None:
    wave(tmp_path / "wave.asc")
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "wave.asc"))
    terrain = part("rockfall_addon.scene.terrain.terrain")
    ground = terrain.active_terrain(bpy.context.scene)
    imported = terrain.surface_of(ground)
    terrain._surfaces.clear()  # as when Blender starts
    again = terrain.surface_of(ground)
    assert again is not imported
    np.testing.assert_array_equal(again.faces, imported.faces)
    np.testing.assert_allclose(again.vertices, imported.vertices, atol=1e-4)


def test_second_tile_uses_the_projects_shift(part, tmp_path: Path) -> None:
    wave(tmp_path / "wave.asc")
    state = part("rockfall_addon.scene.terrain.georeference")
    shift = part("core.georeference").GlobalShift(2600010.0, 1199990.0, 400.0)
    state.write_shift(bpy.context.scene, shift)
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "wave.asc"))
    assert state.read_shift(bpy.context.scene) == shift
    ground = part("rockfall_addon.scene.terrain.terrain").active_terrain(bpy.context.scene)
    assert min(v.co.x for v in ground.data.vertices) == pytest.approx(-9.75, abs=1e-4)


def test_bad_terrain_is_reported_and_changes_nothing(part, tmp_path: Path) -> None:
    (tmp_path / "empty.ply").write_bytes(b"")
    with pytest.raises(RuntimeError, match=r"empty\.ply"):
        bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "empty.ply"))
    assert not bpy.context.scene.objects


def test_a_bad_terrain_in_the_file_browser_is_reported_in_one_sentence(part, tmp_path: Path) -> None:
    """The browser ends in an operator that calls another for the dialog: its error must not come out as a traceback."""
    for name, data in (("empty.ply", b""), ("nested.glb", b"glTF" + bytes(16)), ("none.asc", None)):
        if data is not None:
            (tmp_path / name).write_bytes(data)
        with pytest.raises(RuntimeError, match=re.escape(name)) as caught:
            bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / name), browsing=True)
        assert "Traceback" not in str(caught.value)
        assert str(caught.value).strip().count("\n") == 0
    assert not bpy.context.scene.objects


def test_material_is_made_once(part, tmp_path: Path) -> None:
    wave(tmp_path / "wave.asc")
    for _ in range(2):
        bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "wave.asc"))
    assert [m.name for m in bpy.data.materials if m.name.startswith("Rockfall terrain")] == ["Rockfall terrain"]


def test_a_scan_in_millimetres_is_noticed_and_read_again(part, tmp_path: Path) -> None:
    """Survey coordinates, too: the shift that was proposed for the wrong unit is not kept."""
    points = wave(tmp_path / "wave.asc").reshape(20, 30, 3) - (2574000.0, 1188000.0, 0.0)
    file, corner = tmp_path / "mm.obj", np.arange(600).reshape(20, 30) + 1
    rows = [f"v {1000 * x:.3f} {1000 * y:.3f} {1000 * (z + 20 * (x - 26000)):.3f}" for x, y, z in points.reshape(-1, 3)]
    a, b, c, d = (each.ravel() for each in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    rows += [f"f {i} {j} {k} {m}" for i, j, k, m in zip(a, b, c, d, strict=True)]
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_terrain(filepath=str(file)) == {"FINISHED"}
    scene, following = bpy.context.scene, part("rockfall_addon.scene.next_step")
    step = following.next_step(scene)
    assert "is its file in another unit?" in step.sentence
    assert (step.actions[0], step.unit_m) == ("rockfall.import_terrain", 0.001)
    again = {"replaces": step.tile, "unit_m": step.unit_m}
    assert bpy.ops.rockfall.import_terrain(filepath=str(file), **again) == {"FINISHED"}
    (tile,) = part("rockfall_addon.scene.terrain.terrain").tiles(scene)
    middle = (
        np.array(tile.bound_box).mean(axis=0)
        + part("rockfall_addon.scene.terrain.georeference").read_shift(scene).vector
    )
    np.testing.assert_allclose(middle[:2], points.reshape(-1, 3).mean(axis=0)[:2], atol=0.01)
    assert np.abs(tile.bound_box).max() < 10_000, "near the origin of the scene"
    assert not following.next_step(scene).tile


def test_a_unit_is_chosen_by_its_name(part) -> None:
    """The lengths are those of NIST's Handbook 44, appendix C; single precision would move a place by decimetres."""
    unit = part("rockfall_addon.steps.terrain.file_unit")
    lengths = {"FOOT": Fraction(3048, 10000), "US_FOOT": Fraction(1200, 3937), "MILLIMETRE": Fraction(1, 1000)}
    for number, name in enumerate(item[0] for item in unit.ITEMS):
        if name in lengths:
            told = SimpleNamespace(unit_m=1.0, types_unit=True)
            unit.set_by_name(told, number)
            told.unit_m = float(np.float32(told.unit_m))  # as Blender keeps it
            assert unit.get(told) == number
            assert unit.exact(told.unit_m) == float(lengths[name])
    other = SimpleNamespace(unit_m=1.0, types_unit=False)
    unit.set_by_name(other, len(unit.ITEMS) - 1)
    assert (other.unit_m, unit.ITEMS[unit.get(other)][0]) == (1.0, "OTHER")
    assert unit.exact(float(np.float32(0.9144))) == 0.9144
    assert unit.size([131.2336, 131.2336, 6.5617], [0.3048] * 3) == "Read so, it measures 40 × 40 × 2 m."


def test_a_file_in_survey_feet_says_so_and_can_be_overruled(part) -> None:
    """The dialog reads it with the same function, and shows what that says."""
    file = Path(__file__).parents[1] / "data" / "field_cases" / "02-crs-in-feet" / "ftUS.tif"
    terrain, scene = part("rockfall_addon.scene.terrain.terrain"), bpy.context.scene
    foot = 1200 / 3937
    for told, flat, height in (
        ({}, 1.0, 1.0),
        ({"unit_m": 1.0}, 1 / foot, 1 / foot),
        ({"height_unit": "METRE"}, 1.0, 1 / foot),
        ({"unit_m": 1.0, "height_unit": "US_FOOT"}, 1 / foot, 1.0),
    ):
        for tile in terrain.tiles(scene):
            terrain.remove(scene, [tile])
        part("rockfall_addon.scene.terrain.georeference").forget_shift(scene)
        assert bpy.ops.rockfall.import_terrain(filepath=str(file), **told) == {"FINISHED"}
        (tile,) = terrain.tiles(scene)
        extent = np.ptp(np.array(tile.bound_box), axis=0)
        np.testing.assert_allclose(extent, [20 * flat, 20 * flat, 13 * height], rtol=1e-3)
    found = part("core.terrain.readers").inspect_terrain(file)
    assert (found.units_m, found.stated_units_m) == ((foot, foot), (foot, foot))
    assert any("US survey feet, as EPSG:2229 says" in sentence for sentence in found.summary)
    assert "SRID" not in scene, "other add-ons would take it for the system in feet"


def test_survey_feet_far_from_the_origin_come_to_their_place(part, tmp_path: Path) -> None:
    file, foot = tmp_path / "feet.obj", Fraction(1200, 3937)
    corners = [(7_000_000, 2_000_000, 100), (7_000_400, 2_000_000, 100), (7_000_000, 2_000_400, 300)]
    file.write_text("\n".join([*("v {} {} {}".format(*c) for c in corners), "f 1 2 3"]) + "\n", encoding="utf-8")
    assert bpy.ops.rockfall.import_terrain(filepath=str(file), unit_m=float(foot)) == {"FINISHED"}
    (tile,) = part("rockfall_addon.scene.terrain.terrain").tiles(bpy.context.scene)
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(bpy.context.scene)
    found = np.array([vertex.co for vertex in tile.data.vertices]) + shift.vector
    known = np.array([[float(c * foot) for c in corner] for corner in corners])
    np.testing.assert_allclose(np.sort(found, axis=0), np.sort(known, axis=0), atol=0.002)


FIELD_CASES = Path(__file__).parents[1] / "data" / "field_cases"


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("03-point-number-first/numid.txt", "The first column counts the points (1 to 441)"),
        ("05-las-withheld/withheld.las", "2 points marked as withheld"),
        ("07-coarse-coordinates/f32utm.ply", "Coordinates are stored in steps of 0.0312 m (x) and 0.5 m (y)"),
        ("08-concave-polygon/ngon.obj", "Faces with more than three corners: 20."),
        ("14-ply-vertex-list/be_list.ply", "Left out elements that are no vertices and no faces: edge (2)."),
    ],
)
def test_the_dialog_and_what_was_read_say_what_the_file_says_of_its_numbers(part, file: str, words: str) -> None:
    operators = part("rockfall_addon.steps.terrain.operators")
    dialog = SimpleNamespace(filepath=str(FIELD_CASES / file), unit_m=1.0, _units=dict)
    found = operators.ROCKFALL_OT_import_terrain._inspected(dialog)
    assert any(words in sentence for sentence in found.summary)
    assert bpy.ops.rockfall.import_terrain(filepath=str(FIELD_CASES / file)) == {"FINISHED"}
    ((_, said),) = part("rockfall_addon.scene.terrain.terrain").readings(bpy.context.scene)
    assert any(words in sentence for sentence in said)


def test_faces_that_a_person_made_are_said_where_they_are_not_flat_or_cross_themselves(part, tmp_path: Path) -> None:
    """A concave one has its own area, as Blender cuts it."""
    wave(tmp_path / "wave.asc")
    bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "wave.asc"))
    terrain, terrain_mesh = (
        part("rockfall_addon.scene.terrain.terrain"),
        part("rockfall_addon.scene.terrain.terrain_mesh"),
    )
    ground = terrain.active_terrain(bpy.context.scene)
    assert not any("more than three corners" in said for said in terrain.remarks(bpy.context.scene))
    corners = [(0, 0, 0), (20, 0, 12), (20, 20, 12), (10, 20, 6), (10, 10, 6), (0, 10, 0)]

    def redraw(points: list, faces: list) -> list[str]:
        ground.data.clear_geometry()
        ground.data.from_pydata(points, [], faces)
        terrain_mesh.mistrust(ground.data)
        return [said for said in terrain.remarks(bpy.context.scene) if "corners" in said or "cross" in said]

    assert len(redraw(corners, [range(6)])) == 1, "not convex"
    vertices, faces = terrain_mesh.mesh_arrays(ground.data)
    a, b, c = (vertices[faces[:, k], :2].astype(float) for k in range(3))
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert np.abs(double).sum() / 2 == pytest.approx(300.0)
    bent = redraw([(0, 0, 0), (1, 0, 0), (1, 1, 0.4), (0, 1, 0)], [range(4)])
    assert "not flat: 1 of 1" in bent[0]
    crossing = redraw([(0, 0, 0), (2, 0, 0), (0, 1, 0), (2, 3, 0)], [range(4)])
    assert any("cross themselves" in said for said in crossing)
