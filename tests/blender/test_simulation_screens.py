# SPDX-License-Identifier: GPL-3.0-or-later
"""Screens drawn in Blender measure what passes; barriers hold it; both are saved with what was found."""

from pathlib import Path

import bpy
import numpy as np
import pytest

FOOT_X = 70.0


@pytest.fixture
def slope(scan: bpy.types.Scene, part) -> bpy.types.Scene:
    """The rough slope, which runs out from x = 60 on, and a line near its top, from which forty blocks start."""
    points = [np.array([6.0, y, 91.5]) for y in (20.0, 60.0, 100.0)]
    settings = scan.rockfall_simulation
    settings.source, settings.drawn = (
        "DRAWN",
        part("rockfall_addon.scene.simulation.drawn_releases").make(scan, "line", points),
    )
    settings.number, settings.seed, settings.models = 40, 3, {"noel_2017"}
    return scan


@pytest.fixture
def screen(slope: bpy.types.Scene, part) -> bpy.types.Object:
    """A line with a corner across the foot of the slope."""
    points = [np.array([FOOT_X, y, 20.0]) for y in (-1.0, 60.0, 121.0)]
    return part("rockfall_addon.scene.simulation.screens").make(slope, points, "road")


def paths(scene: bpy.types.Scene) -> list[np.ndarray]:
    """The places of each shown run, x, y, z."""
    found = next(obj for obj in scene.objects if obj.get("rockfall_role") == "simulated_paths")
    values = np.empty(3 * len(found.data.points), dtype=np.float32)
    found.data.attributes["position"].data.foreach_get("vector", values)
    first = [curve.first_point_index for curve in found.data.curves]
    return np.split(values.reshape(-1, 3), first[1:])


def result(part, scene: bpy.types.Scene) -> dict[str, object]:
    (found,) = part("rockfall_addon.scene.simulation.simulation_setup").screen_results(scene)
    return found


def test_a_screen_counts_the_paths_that_cross_it(slope: bpy.types.Scene, screen: bpy.types.Object, part) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    found = result(part, slope)
    beyond = sum(path[:, 0].max() > FOOT_X for path in paths(slope))
    assert (found["screen"], found["model"], found["blocks"], found["reach"]) == ("road", "noel_2017", 40, beyond)
    assert beyond > 3
    value, low, _high = found["energy_kj"]
    assert 0 < low <= value
    ((title, rows),) = part("rockfall_addon.scene.simulation.screens").result_rows([found], "road")
    assert title == part("core.impact_models.registry").MODELS["noel_2017"].title
    assert dict(rows)["Blocks that come"].startswith(f"{beyond} of 40")


def test_a_barrier_ends_the_shown_runs_that_it_holds(slope: bpy.types.Scene, screen: bpy.types.Object, part) -> None:
    setup = part("rockfall_addon.scene.simulation.simulation_setup")
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    before = result(part, slope)
    screen.rockfall_screen.holds = True
    assert setup.is_stale(slope)
    screen.rockfall_screen.height_m, screen.rockfall_screen.capacity_kj = 60.0, 1e6
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert max(path[:, 0].max() for path in paths(slope)) < FOOT_X + 1e-3
    found = result(part, slope)
    assert found["reach"] == before["reach"], "the same runs, told without and with it"
    assert (found["held"], found["over"], found["through"]) == (before["reach"], 0, 0)
    screen.rockfall_screen.capacity_kj = 0.1
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    found = result(part, slope)
    assert (found["held"], found["over"]) == (0, 0)
    assert found["through"] >= before["reach"]


def test_screens_are_saved_with_what_was_found(
    slope: bpy.types.Scene, screen: bpy.types.Object, part, tmp_path: Path
) -> None:
    screen.rockfall_screen.holds, screen.rockfall_screen.capacity_kj = True, 750.0
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    before = result(part, slope)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "kept.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "kept.blend"))
    scene = bpy.context.scene
    assert not part("rockfall_addon.scene.simulation.simulation_setup").is_stale(scene)
    assert result(part, scene) == before
    (again,) = part("rockfall_addon.scene.simulation.screens").screens_of(scene)
    assert (again.name, again.height_m, again.capacity_j) == ("road", 3.0, 750_000.0)
    np.testing.assert_allclose(again.line, [[FOOT_X, -1.0], [FOOT_X, 60.0], [FOOT_X, 121.0]])
    assert bpy.ops.rockfall.remove_screen(name="road") == {"FINISHED"}
    assert not part("rockfall_addon.scene.simulation.screens").objects_of(scene)


def test_the_fence_stands_on_the_terrain(slope: bpy.types.Scene, screen: bpy.types.Object, part) -> None:
    foot = part("rockfall_addon.scene.simulation.screens").fence(slope, screen)
    there = np.isfinite(foot[:, 2])
    surface = part("rockfall_addon.scene.terrain.terrain").surface_of_scene(slope)
    above = part("core.terrain.raycast").heights_above(surface, foot[there] + [0.0, 0.0, 1.0])
    np.testing.assert_allclose(above, 1.0, atol=1e-4)
    assert 0 < (~there).sum() < 10, "its ends are beside the terrain"


def test_what_is_no_screen_is_refused(slope: bpy.types.Scene, screen: bpy.types.Object, part) -> None:
    setup = part("rockfall_addon.scene.simulation.simulation_setup")
    with pytest.raises(part("core.errors").RockfallError, match="two points"):
        part("rockfall_addon.scene.simulation.screens").make(slope, [np.zeros(3)])
    screen.location.x = 500.0
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="'road' is beside the terrain"):
        bpy.ops.rockfall.simulate()
    screen.data.clear_geometry()
    assert "road has 0 points" in setup.missing(slope)
    assert not bpy.ops.rockfall.simulate.poll()


def test_exported_tables_have_the_hits(slope: bpy.types.Scene, screen: bpy.types.Object, part, tmp_path: Path) -> None:
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert bpy.ops.rockfall.export_simulation(directory=str(tmp_path / "tables")) == {"FINISHED"}
    lines = (tmp_path / "tables" / "hits.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) - 1 == result(part, slope)["hits"]
    assert all(line.startswith("road,") for line in lines[1:])


def test_a_project_takes_screens_along(slope: bpy.types.Scene, screen: bpy.types.Object, part, tmp_path: Path) -> None:
    screen.rockfall_screen.holds, screen.rockfall_screen.capacity_kj = True, 750.0
    assert bpy.ops.rockfall.export_project(directory=str(tmp_path / "out")) == {"FINISHED"}
    project = tmp_path / "out" / "project.toml"
    (entry,) = part("core.exchange.project").read_project(project).simulation.screens
    assert (entry.name, entry.height_m, entry.capacity_kj) == ("road", 3.0, 750.0)
    np.testing.assert_allclose(entry.points_m[1], [2_600_000.0 + FOOT_X, 1_200_060.0])
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(project)) == {"FINISHED"}
    scene = bpy.context.scene
    (again,) = part("rockfall_addon.scene.simulation.screens").screens_of(scene)
    assert (again.name, again.height_m, again.capacity_j) == ("road", 3.0, 750_000.0)
    np.testing.assert_allclose(again.line, [[FOOT_X, -1.0], [FOOT_X, 60.0], [FOOT_X, 121.0]], atol=1e-5)
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    assert result(part, scene)["reach"] > 0


def test_the_design_sheet_of_a_drawn_screen(
    slope: bpy.types.Scene, screen: bpy.types.Object, part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(part("rockfall_addon.scene.simulation.design_sheet"), "is_there", lambda extra: False)
    out = tmp_path / "sheet"
    screen.rockfall_screen.holds = True
    assert bpy.ops.rockfall.design_sheet(directory=str(out), factors="none", holdout=False) == {"FINISHED"}
    assert {path.name for path in out.iterdir()} == {"design.html", "design.json", "screens.csv"}
    page = (out / "design.html").read_text(encoding="utf-8")
    assert "road" in page
    assert "No figures: this page was made where Matplotlib is not installed" in page
    bpy.ops.rockfall.remove_screen(name="road")
    assert not bpy.ops.rockfall.design_sheet.poll(), "there is nothing to design for"


def test_a_barrier_is_green_only_while_it_is_known_to_be_enough(
    slope: bpy.types.Scene, screen: bpy.types.Object, part
) -> None:
    screens, fences = part("rockfall_addon.scene.simulation.screens"), part("rockfall_addon.steps.simulation.fences")
    settings, simulated = screen.rockfall_screen, slope.rockfall_simulation
    settings.holds, settings.height_m, settings.capacity_kj = True, 60.0, 1e6

    def shown() -> tuple[str, tuple[float, ...]]:
        results = part("rockfall_addon.scene.simulation.simulation_setup").screen_results(slope)
        ((_, rows),) = screens.result_rows(results, "road")
        return dict(rows)["Verdict (95 %)"], fences._colour(screen, results)

    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    words, colour = shown()
    assert words.startswith("not known yet: about "), "40 blocks are released"
    assert colour == fences.HOLDS
    simulated.number = 400
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    words, colour = shown()
    assert words == "enough, without partial factors"
    assert colour == fences.JUDGED["enough"]
    settings.height_m = 50.0
    assert shown()[1] == fences.HOLDS, "nothing was found of a barrier of this height"
    settings.capacity_kj = 0.1
    assert bpy.ops.rockfall.simulate() == {"FINISHED"}
    words, colour = shown()
    assert words == "not enough"
    assert colour == fences.JUDGED["not_enough"]
