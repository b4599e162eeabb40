# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees of the panel are met by the blocks, seen in the scene, and go along with a project."""

from pathlib import Path

import bpy
import numpy as np
import pytest


@pytest.fixture
def slope(scan: bpy.types.Scene, part) -> bpy.types.Scene:
    """The rough slope, and a line near its top, from which eight blocks start."""
    points = [np.array([6.0, y, 91.5]) for y in (20.0, 60.0, 100.0)]
    settings = scan.rockfall_simulation
    settings.source, settings.drawn = (
        "DRAWN",
        part("rockfall_addon.scene.simulation.drawn_releases").make(scan, "line", points),
    )
    settings.number, settings.seed, settings.models = 8, 3, {"noel_2017"}
    return scan


def stems(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    return [obj for obj in scene.objects if obj.get("rockfall_role") == "simulated_trees"]


def said(part, scene: bpy.types.Scene) -> str:
    return " ".join(remark.text for remark in part("rockfall_addon.scene.simulation.simulation_setup").remarks(scene))


def test_a_forest_is_met_and_seen(slope: bpy.types.Scene, part) -> None:
    settings = slope.rockfall_simulation
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert not stems(slope)
    settings.trees, settings.stems_per_hectare, settings.dbh_cm, settings.dbh_sd_cm = "DRAWN", 900.0, 40.0, 0.0
    assert part("rockfall_addon.scene.simulation.simulation_setup").is_stale(slope)
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    (obj,) = stems(slope)
    trees = part("rockfall_addon.scene.simulation.simulation_setup").plan(slope).scenario.trees
    corners = np.empty(3 * len(obj.data.vertices), np.float32)
    obj.data.attributes["position"].data.foreach_get("vector", corners)
    corners = corners.reshape(len(trees), -1, 3)
    np.testing.assert_allclose(corners.mean(axis=1)[:, :2], trees.position, atol=1e-3)
    np.testing.assert_allclose(np.ptp(corners[:, :, 2], axis=1), settings.tree_height_m, atol=1e-3)
    np.testing.assert_allclose(np.ptp(corners[:, :, 0], axis=1), 0.4, atol=1e-3)
    assert not obj.data.validate()
    assert f"Blocks meet {len(trees)} trees" in said(part, slope)
    assert "blocks with Noël et al. 2017 hit trees" in said(part, slope)
    settings.show_trees = False
    assert obj.hide_viewport
    settings.trees = "NONE"
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert not stems(slope)


def test_a_table_of_trees_goes_along_with_a_project(slope: bpy.types.Scene, part, tmp_path: Path) -> None:
    settings = slope.rockfall_simulation
    settings.trees = "TABLE"
    with pytest.raises(RuntimeError, match="Choose the table of trees"):
        bpy.ops.rockfall.simulate()
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(slope)
    x, y = shift.x + 30.0, shift.y + 60.0
    table = tmp_path / "my trees.csv"
    table.write_text(f"x_m,y_m,dbh_cm,height_m\n{x!r},{y!r},50,12\n", encoding="utf-8")
    settings.trees_file, settings.tree_species = str(table), "broadleaved"
    trees = part("rockfall_addon.scene.simulation.simulation_setup").plan(slope).scenario.trees
    np.testing.assert_allclose(trees.position, [[30.0, 60.0]], atol=1e-6)
    np.testing.assert_allclose(trees.energy_j, 1.59 * 38.7 * 50**2.31)
    projects = part("rockfall_addon.scene.project")
    projects.save_project(slope, tmp_path / "exported")
    table.unlink()
    settings.trees, settings.tree_species = "NONE", "coniferous"
    other = bpy.data.scenes.new("other")
    projects.load_project(other, tmp_path / "exported" / "project.toml")
    opened = other.rockfall_simulation
    assert (opened.trees, opened.tree_species) == ("TABLE", "broadleaved")
    assert Path(opened.trees_file) == tmp_path / "exported" / "trees.csv"
    bpy.data.scenes.remove(other)


def test_another_table_under_the_same_name_is_told(slope: bpy.types.Scene, part, tmp_path: Path) -> None:
    shift = part("rockfall_addon.scene.terrain.georeference").read_shift(slope)
    table, settings = tmp_path / "trees.csv", slope.rockfall_simulation
    settings.trees, settings.trees_file = "TABLE", str(table)
    is_stale = part("rockfall_addon.scene.simulation.simulation_setup").is_stale
    for x in (30.0, 40.0):
        table.write_text(f"x_m,y_m,dbh_cm\n{shift.x + x!r},{shift.y + 60.0!r},50\n", encoding="utf-8")
        if x > 30:
            assert is_stale(slope)
        assert bpy.ops.rockfall.simulate() == {"FINISHED"}
        assert not is_stale(slope)
    moved = tmp_path / "elsewhere.csv"
    table.rename(moved)
    settings.trees_file = str(moved)
    assert not is_stale(slope)


def test_a_bad_table_is_refused_in_words(slope: bpy.types.Scene, tmp_path: Path) -> None:
    table = tmp_path / "bad.csv"
    table.write_text("x_m,y_m,dbh_cm\n5,5,30\n", encoding="utf-8")
    settings = slope.rockfall_simulation
    settings.trees, settings.trees_file = "TABLE", str(table)
    with pytest.raises(RuntimeError, match="No tree stands on the terrain"):
        bpy.ops.rockfall.simulate()
