# SPDX-License-Identifier: GPL-3.0-or-later
"""project.toml: a round trip, and a clear message for each kind of bad input."""

import dataclasses
from pathlib import Path

import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import (
    BlockEntry,
    CameraPlacement,
    Project,
    ReconstructionSettings,
    RenderPreset,
    Site,
    TerrainSource,
    read_project,
    write_project,
)

FULL = """
schema = 1
title = "kept"

[site]
name = "Gully"
operator = "kept"

[terrain]
file = "data/terrain.ply"
shift = [2600000.1, 1200000, 1234.5678901234567]
crs = "EPSG:2056"
up = "z"
tiles = ["kept"]

[picks]
file = "picks.csv"
encoding = "kept"

[block]
d1_m = 0.4

[[blocks]]
name = "B01"
d2_m = 0.3
density_kgpm3 = 2400

[[videos]]
file = "kept.mp4"

[reconstruction]
normal_radius_m = 0.5
drag = true

[[render]]
name = "preview"
width = 640
height = 360
stagger_s = 0
engine = "cycles"
samples = 16
camera = { position = [2600050.25, 1200000, 1300], target = [2600000, 1200000, 1250] }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "terrain.ply").touch()
    (tmp_path / "picks.csv").touch()
    return tmp_path


def read(folder: Path, text: str) -> Project:
    path = folder / "project.toml"
    path.write_text(text, encoding="utf-8")
    return read_project(path)


def test_everything_is_read(folder: Path) -> None:
    project = read(folder, FULL)
    assert project.site.name == "Gully"
    assert project.terrain is not None
    assert project.terrain.file == folder / "data" / "terrain.ply"
    shift = project.terrain.global_shift
    assert shift is not None
    assert (shift.x, shift.y, shift.z, shift.crs) == (2600000.1, 1200000.0, 1234.5678901234567, "EPSG:2056")
    assert project.picks == folder / "picks.csv"
    assert project.block.d1_m == 0.4
    assert project.block_of("B01") == BlockEntry("B01", 0.4, 0.3, 0.35, 2400.0)
    assert project.block_of("B02") == project.block
    assert project.reconstruction == ReconstructionSettings(normal_radius_m=0.5, drag=True)
    preset = project.preset("preview")
    assert (preset.width, preset.height, preset.engine, preset.stagger_s) == (640, 360, "cycles", 0.0)
    assert preset.camera == CameraPlacement((2600050.25, 1200000.0, 1300.0), (2600000.0, 1200000.0, 1250.0))


def test_unknown_keys_and_sections_survive_reading_and_writing(folder: Path) -> None:
    project = read(folder, FULL)
    assert project.extra["title"] == "kept"
    assert project.extra["videos"] == [{"file": "kept.mp4"}]
    assert project.extra["picks"] == {"encoding": "kept"}
    assert project.terrain is not None
    assert project.terrain.extra == {"tiles": ["kept"]}
    assert project.preset("preview").extra == {"samples": 16}
    write_project(project, folder / "again.toml")
    assert read_project(folder / "again.toml") == project


def test_round_trip_of_doubles_is_exact(folder: Path) -> None:
    project = Project(
        site=Site("Ülschen “Süd”", "two\nlines"),
        terrain=TerrainSource(folder / "data" / "terrain.ply", shift=(0.1 + 0.2, 1e-300, 2_600_000.000_000_1)),
        picks=folder / "picks.csv",
        blocks=(BlockEntry("a", 0.30000000000000004), BlockEntry("b", density_kgpm3=2650.1)),
        render=(RenderPreset("film", stagger_s=1 / 3, fps=29.97),),
    )
    write_project(project, folder / "project.toml")
    assert read_project(folder / "project.toml") == project


def test_paths_are_relative_to_the_file_also_from_a_neighbouring_folder(folder: Path) -> None:
    (folder / "runs").mkdir()
    write_project(read(folder, FULL), folder / "runs" / "one.toml")
    text = (folder / "runs" / "one.toml").read_text(encoding="utf-8")
    assert 'file = "../picks.csv"' in text
    again = read_project(folder / "runs" / "one.toml")
    assert again.picks is not None
    assert again.picks.resolve() == (folder / "picks.csv").resolve()


def test_the_smallest_project(folder: Path) -> None:
    project = read(folder, "schema = 1\n")
    assert project == Project()
    write_project(project, folder / "project.toml")
    assert read_project(folder / "project.toml") == project


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("schema = 1", "", ["schema is missing", "schema = 1"]),
        ("schema = 1", "schema = 2", ["schema is 2", "update"]),
        ("schema = 1", "schema = true", ["schema is True"]),
        ("data/terrain.ply", "nowhere.ply", ["terrain.file", "nowhere.ply", "relative"]),
        ('file = "picks.csv"', "", ["picks.file is missing"]),
        ('engine = "cycles"', 'engine = "povray"', ["render 1: engine", "povray", "cycles, eevee"]),
        ('up = "z"', 'up = "x"', ["terrain.up", "'x'"]),
        ("1234.5678901234567]", "]", ["terrain.shift", "three numbers"]),
        ("1200000, 1234", "nan, 1234", ["terrain.shift"]),
        ("d1_m = 0.4", 'd1_m = "0.4"', ["block.d1_m", "quotation marks"]),
        ("d2_m = 0.3", "d2_m = -0.3", ["blocks 1: d2_m is -0.3", "above zero"]),
        ("normal_radius_m = 0.5", "normal_radius_m = 0", ["reconstruction.normal_radius_m is 0"]),
        ("drag = true", "drag = 1", ["reconstruction.drag", "true or false"]),
        ("width = 640", "width = 640.5", ["render 1: width", "whole number"]),
        ("[site]", "[[site]]", ["site", "not a section"]),
        ("[[render]]", "[render]", ["render", "[[render]]"]),
        ('name = "B01"', "", ["blocks 1: name is missing"]),
        ('[[videos]]', '[[blocks]]\nname = "B01"\n[[videos]]', ["blocks names 'B01' twice"]),
        ("target = [2600000, 1200000, 1250]", "fov_deg = 200", ["render 1: camera.fov_deg"]),
        (", target = [2600000, 1200000, 1250]", "", ["render 1: camera.target is missing"]),
    ],
)  # fmt: skip
def test_bad_input_names_the_file_the_key_and_what_to_do(folder: Path, old: str, new: str, said: list[str]) -> None:
    assert old in FULL
    with pytest.raises(InputError) as caught:
        read(folder, FULL.replace(old, new, 1))
    for text in ["project.toml", *said]:
        assert text in str(caught.value)
    assert caught.value.advice


def test_a_syntax_error_names_its_row(folder: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(folder, "schema = 1\n\n[site\nname = 3\n")
    assert caught.value.row == 3
    with pytest.raises(InputError) as caught:
        read(folder, 'schema = 1\nname = """open')
    assert caught.value.row == 2


def test_a_file_that_is_missing_or_no_text(folder: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_project(folder / "none.toml")
    (folder / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_project(folder / "binary.toml")


def test_an_unknown_preset_lists_the_known_ones(folder: Path) -> None:
    with pytest.raises(InputError, match="preview"):
        read(folder, FULL).preset("cinema")


def test_a_project_cannot_be_changed_in_place(folder: Path) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        read(folder, FULL).picks = None  # type: ignore[misc]
