# SPDX-License-Identifier: GPL-3.0-or-later
"""What the preferences say is what new projects begin with, and only these."""

from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

NAMES = ("block_diameter_m", "density_kgpm3", "block_shape", "sigma_px", "colour_by")


@pytest.fixture
def preferences(part, rockfall) -> Iterator[bpy.types.AddonPreferences]:
    ours = bpy.context.preferences.addons[rockfall.__name__].preferences
    yield ours
    for name in NAMES:
        ours.property_unset(name)


def settings() -> list[object]:
    scene = bpy.context.scene
    return [getattr(scene.rockfall, name) for name in NAMES[:3]] + [scene.rockfall_picking.sigma_px]


def new_file() -> None:
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)


def test_without_a_word_they_are_those_of_the_settings(part, preferences) -> None:
    scene = bpy.context.scene
    of = {name: scene.rockfall.bl_rna.properties[name].default for name in NAMES[:3]}
    of["colour_by"] = scene.rockfall.bl_rna.properties["colour_by"].default
    of["sigma_px"] = scene.rockfall_picking.bl_rna.properties["sigma_px"].default
    assert {name: getattr(preferences, name) for name in NAMES} == of


def test_new_projects_begin_with_them(part, preferences, table: Path, tmp_path: Path, numbers) -> None:
    preferences.block_diameter_m, preferences.density_kgpm3 = 0.75, 2500.0
    preferences.block_shape, preferences.sigma_px = "box", 2.5
    wanted = [0.75, 2500.0, "box", 2.5]
    assert settings() == wanted, "a scene with nothing of ours follows at once"
    new_file()
    assert settings() == wanted
    bpy.ops.rockfall.import_picks(filepath=str(table))
    result = numbers(bpy.context.scene.objects["A impact 1"])
    speed2 = sum(value**2 for value in result["incident_mps"])
    assert 2 * result["kinetic1_j"] / speed2 == pytest.approx(2500 * 0.75**3)
    preferences.block_diameter_m, preferences.sigma_px = 1.5, 0.5
    assert settings() == wanted, "a project that has begun keeps what it has"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    new_file()
    assert settings() == [1.5, 2500.0, "box", 0.5]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"), load_ui=False)
    assert settings() == wanted


def test_new_projects_have_the_colours_that_were_preferred(part, preferences, table: Path) -> None:
    preferences.colour_by = "DOUBT"
    new_file()
    bpy.ops.rockfall.import_picks(filepath=str(table))
    assert bpy.context.scene.rockfall.colour_by == "DOUBT"
    preferences.colour_by = "ENERGY"
    assert bpy.context.scene.rockfall.colour_by == "DOUBT", "a project that has begun keeps what it has"
