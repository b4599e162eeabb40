# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of single trajectories: edited in the panel, kept in the file, exported as shown, used by what is computed."""

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest
from two_runs import picks_of, update


@pytest.fixture
def block(scene, part) -> bpy.types.PropertyGroup:
    """That of B, whose last impact is selected."""
    bpy.context.view_layer.objects.active = picks_of(scene, "B")[3]
    return scene.rockfall_block


@pytest.fixture
def mass_of(numbers) -> Callable[[bpy.types.Scene, str], float]:
    """Of the block of a trajectory, as its energy tells: 2E/v²."""

    def mass(scene: bpy.types.Scene, name: str) -> float:
        result = numbers(picks_of(scene, name)[1])
        return 2 * result["kinetic1_j"] / math.hypot(*result["incident_mps"]) ** 2

    return mass


def block_in_scene(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    return scene.objects[f"{name} block"]


def test_a_block_of_its_own_is_used_for_its_trajectory_alone(scene, block, mass_of) -> None:
    before = mass_of(scene, "A")
    assert before == pytest.approx(scene.rockfall.density_kgpm3 * math.pi / 6 * 0.35**3, rel=1e-6)
    block.own = True
    assert mass_of(scene, "B") == pytest.approx(before)
    block.d1, block.d2, block.d3, block.density = 1.2, 0.8, 0.5, 2800.0
    assert mass_of(scene, "B") == pytest.approx(math.pi / 6 * 1.2 * 0.8 * 0.5 * 2800)
    block.shape = "box"
    assert mass_of(scene, "B") == pytest.approx(1.2 * 0.8 * 0.5 * 2800)
    assert list(block_in_scene(scene, "B").scale) == pytest.approx([0.6, 0.4, 0.25])
    assert mass_of(scene, "A") == before
    scene.rockfall.block_diameter_m = 0.5
    assert mass_of(scene, "B") == pytest.approx(1.2 * 0.8 * 0.5 * 2800)
    assert mass_of(scene, "A") > before
    scene.rockfall.block_shape = "box"
    assert mass_of(scene, "A") == pytest.approx(scene.rockfall.density_kgpm3 * 0.5**3, rel=1e-6)
    block.own = False
    assert mass_of(scene, "B") == pytest.approx(mass_of(scene, "A"))


def test_numbers_that_no_block_has_end_at_the_range_of_their_field(scene, block, mass_of) -> None:
    block.d1 = block.d2 = block.d3 = 0.5
    for given, kept in ((1e6, 1e5), (0.0, 0.1), (2800.0, 2800.0)):
        block.density = given
        assert mass_of(scene, "B") == pytest.approx(math.pi / 6 * 0.5**3 * kept)
    for given, kept in ((1e9, 1e4), (-1.0, 1e-5)):
        block.d1 = block.d2 = block.d3 = given
        assert mass_of(scene, "B") == pytest.approx(math.pi / 6 * kept**3 * 2800, rel=1e-6)


def test_tables_projects_and_files_have_it(slope, part, tmp_path: Path, mass_of) -> None:
    bpy.context.view_layer.objects.active = picks_of(slope, "B")[3]
    block = slope.rockfall_block
    block.d1, block.shape = 0.7, "box"
    mass = mass_of(slope, "B")
    bpy.ops.rockfall.export_tables(directory=str(tmp_path / "tables"))
    with (tmp_path / "tables" / "impacts.csv").open(encoding="utf-8") as file:
        rows = {row["trajectory"]: row for row in csv.DictReader(file)}
    assert float(rows["B"]["mass_kg"]) == pytest.approx(mass)
    assert float(rows["B"]["diameter_m"]) == pytest.approx((0.7 + 0.35 + 0.35) / 3)
    assert float(rows["A"]["diameter_m"]) == pytest.approx(0.35)
    bpy.ops.rockfall.export_project(directory=str(tmp_path / "project"))
    project = part("core.exchange.project").read_project(tmp_path / "project" / "project.toml")
    assert [(one.name, one.d1_m, one.d2_m, one.shape) for one in project.blocks] == [("B", 0.7, 0.35, "box")]
    found = part("core.workflow.opening").open_project(project)[1]
    assert found.block["B"].mass_kg == pytest.approx(mass)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"), load_ui=False)
    assert mass_of(bpy.context.scene, "B") == mass
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project" / "project.toml"))
    assert mass_of(bpy.context.scene, "B") == pytest.approx(mass)


def test_the_default_of_a_project_can_be_edited(slope, part, tmp_path: Path, mass_of) -> None:
    bpy.ops.rockfall.export_project(directory=str(tmp_path))
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    bpy.ops.rockfall.open_project(filepath=str(tmp_path / "project.toml"))
    before = mass_of(bpy.context.scene, "A")
    bpy.context.scene.rockfall.block_diameter_m = 0.7
    assert mass_of(bpy.context.scene, "A") == pytest.approx(8 * before, rel=1e-6)


def test_a_ball_of_a_project_is_no_rock_and_stays_as_it_is(slope, part, tmp_path: Path, mass_of) -> None:
    """One of 4 cm and 84 kg/m³, as table tennis has them: the fields must hold what files hold."""
    bpy.ops.rockfall.export_project(directory=str(tmp_path))
    file = tmp_path / "project.toml"
    text = re.sub(r"(?m)^(d[123]_m) = .*$", r"\1 = 0.04", file.read_text(encoding="utf-8"))
    file.write_text(re.sub(r"(?m)^density_kgpm3 = .*$", "density_kgpm3 = 84.0", text), encoding="utf-8")
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    assert bpy.ops.rockfall.open_project(filepath=str(file)) == {"FINISHED"}
    assert mass_of(bpy.context.scene, "A") == pytest.approx(math.pi / 6 * 0.04**3 * 84, rel=1e-9)
    assert bpy.context.scene.rockfall.density_kgpm3 == 84.0


def test_a_density_in_grams_is_noticed(scene, block, part) -> None:
    block.density = 2.7
    (remark,) = part("rockfall_addon.scene.problems").remarks(scene)
    assert "a block of 2.7 kg/m³, which no rock has. In g/cm³? Then give 2700 kg/m³." in remark.text
    assert remark.about == "B"
    block.density = 2700
    assert not part("rockfall_addon.scene.problems").remarks(scene)


def test_undo_brings_the_block_back(scene, block, mass_of) -> None:
    bpy.ops.ed.undo_push(message="before")
    before = mass_of(scene, "B")
    block.d1 = 0.9
    bpy.ops.ed.undo_push(message="a larger block")
    bpy.ops.ed.undo()
    update()
    assert mass_of(bpy.context.scene, "B") == before
    bpy.ops.ed.redo()
    update()
    assert mass_of(bpy.context.scene, "B") == pytest.approx(before * 0.9 / 0.35, rel=1e-6)
