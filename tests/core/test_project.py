# SPDX-License-Identifier: GPL-3.0-or-later
"""project.toml: a round trip, and a clear message for each kind of bad input."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.analysis.completeness import parse_completeness
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.project import (
    BlockEntry,
    CameraPlacement,
    Project,
    ReconstructionSettings,
    RefinementSettings,
    RenderPreset,
    Site,
    TerrainSource,
    VideoEntry,
    read_project,
    write_project,
)
from rockfall.core.exchange.simulation_entry import (
    ReleaseEntry,
    ScreenEntry,
    SimulationEntry,
    StructureEntry,
    ZonesEntry,
)
from rockfall.core.simulation.distributions import Distribution
from rockfall.core.workflow.opening import open_project, open_terrain

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
file = "moved/away.mp4"
camera = "data/camera.toml"
track = "data/track.csv"
offset_s = -3.25
drift = -1e-5
capture_rate_hz = 240
row_time_s = 1.5e-5
operator = "kept"

[[videos]]
name = "right"

[refinement]
free = ["clock", "camera"]
loss = "cauchy"
kept = 1

[reconstruction]
normal_radius_m = 0.5
drag = true
flights = "centres"

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
    (tmp_path / "data" / "camera.toml").touch()
    (tmp_path / "data" / "track.csv").touch()
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
    assert project.terrain.files == (folder / "data" / "terrain.ply",)
    shift = project.terrain.global_shift
    assert shift is not None
    assert (shift.x, shift.y, shift.z, shift.crs) == (2600000.1, 1200000.0, 1234.5678901234567, "EPSG:2056")
    assert project.picks == folder / "picks.csv"
    assert project.block.d1_m == 0.4
    assert project.block_of("B01") == BlockEntry("B01", 0.4, 0.3, 0.35, 2400.0)
    assert project.block_of("B02") == project.block
    assert project.reconstruction == ReconstructionSettings(normal_radius_m=0.5, drag=True, flights="centres")
    left, right = project.videos
    assert left == VideoEntry(
        name="away",
        file=folder / "moved" / "away.mp4",
        camera=folder / "data" / "camera.toml",
        track=folder / "data" / "track.csv",
        offset_s=-3.25,
        drift=-1e-5,
        capture_rate_hz=240.0,
        row_time_s=1.5e-5,
        extra={"operator": "kept"},
    )
    assert right == VideoEntry("right")
    assert project.refinement == RefinementSettings(("clock", "camera"), loss="cauchy", extra={"kept": 1})
    (preset,) = (one for one in project.render if one.name == "preview")
    assert (preset.width, preset.height, preset.engine, preset.stagger_s) == (640, 360, "cycles", 0.0)
    assert preset.camera == CameraPlacement((2600050.25, 1200000.0, 1300.0), (2600000.0, 1200000.0, 1250.0))


def test_unknown_keys_and_sections_survive_reading_and_writing(folder: Path) -> None:
    project = read(folder, FULL)
    assert project.extra["title"] == "kept"
    assert project.extra["picks"] == {"encoding": "kept"}
    assert project.terrain is not None
    assert project.terrain.extra == {"tiles": ["kept"]}
    assert [one.extra for one in project.render if one.name == "preview"] == [{"samples": 16}]
    write_project(project, folder / "again.toml")
    assert read_project(folder / "again.toml") == project


def test_round_trip_of_doubles_is_exact(folder: Path) -> None:
    project = Project(
        site=Site("Ülschen “Süd”", "two\nlines"),
        terrain=TerrainSource((folder / "data" / "terrain.ply",), shift=(0.1 + 0.2, 1e-300, 2_600_000.000_000_1)),
        picks=folder / "picks.csv",
        blocks=(BlockEntry("a", 0.30000000000000004), BlockEntry("b", density_kgpm3=2650.1, shape="box")),
        render=(RenderPreset("film", stagger_s=1 / 3, fps=29.97),),
        videos=(VideoEntry("left", offset_s=0.1 + 0.2, drift=1e-5 / 3, track=folder / "data" / "track.csv"),),
        refinement=RefinementSettings(("drag",), sigma_terrain_m=0.1 + 0.2),
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
        ('name = "Gully"', "name = 12", ["site.name is 12, not a text", "quotation marks"]),
        ('engine = "cycles"', 'engine = "povray"', ["render 1: engine", "povray", "cycles, eevee"]),
        ('up = "z"', 'up = "x"', ["terrain.up", "'x'"]),
        ("1234.5678901234567]", "]", ["terrain.shift", "three numbers"]),
        ("1200000, 1234", "nan, 1234", ["terrain.shift"]),
        ("d1_m = 0.4", 'd1_m = "0.4"', ["block.d1_m", "quotation marks"]),
        ("d2_m = 0.3", 'shape = "round"', ["blocks 1: shape", "ellipsoid", "box"]),
        ("d2_m = 0.3", "d2_m = -0.3", ["blocks 1: d2_m is -0.3", "above zero"]),
        ("normal_radius_m = 0.5", "normal_radius_m = 0", ["reconstruction.normal_radius_m is 0"]),
        ("drag = true", "drag = 1", ["reconstruction.drag", "true or false"]),
        ("width = 640", "width = 640.5", ["render 1: width", "whole number"]),
        ("[site]", "[[site]]", ["site", "not a section"]),
        ("[[render]]", "[render]", ["render", "[[render]]"]),
        ('flights = "centres"', 'flights = "center"', ["reconstruction.flights", "contacts, centres"]),
        ("data/camera.toml", "data/none.toml", ["videos 1: camera", "none.toml", "relative"]),
        ("data/track.csv", "data/none.csv", ["videos 1: track", "none.csv"]),
        ("offset_s = -3.25", 'offset_s = "0:03"', ["videos 1: offset_s", "quotation marks"]),
        ("drift = -1e-5", "drift = 7", ["videos 1: drift is 7", "capture_rate_hz"]),
        ("capture_rate_hz = 240", "capture_rate_hz = 0", ["videos 1: capture_rate_hz", "above zero"]),
        ('name = "right"', "", ["videos 2: name is missing"]),
        ('name = "right"', 'name = ""', ["videos 2: name is empty", "Give a name"]),
        ('name = "right"', 'name = "away"', ["videos names 'away' twice"]),
        ('"camera"]', '"lens"]', ["refinement.free has 'lens'", "camera, clock"]),
        ('free = ["clock", "camera"]', 'free = "clock"', ["refinement.free", '["camera"]']),
        ('loss = "cauchy"', 'loss = "l2"', ["refinement.loss", "huber"]),
        ('name = "B01"', "", ["blocks 1: name is missing"]),
        ('[[render]]', '[[blocks]]\nname = "B01"\n[[render]]', ["blocks names 'B01' twice"]),
        ("target = [2600000, 1200000, 1250]", "fov_deg = 200", ["render 1: camera.fov_deg"]),
        (", target = [2600000, 1200000, 1250]", "", ["render 1: camera.target is missing"]),
    ],
)  # fmt: skip
def test_bad_input_names_the_file_the_key_and_what_to_do(folder: Path, old: str, new: str, said: list[str]) -> None:
    assert old in FULL
    with pytest.raises(InputError) as caught:
        read(folder, FULL.replace(old, new, 1))
    where, message = str(folder / "project.toml"), str(caught.value)
    assert message.startswith(f"{where}: ")
    for text in said:
        assert text in message.removeprefix(where)
    assert caught.value.advice


def test_a_syntax_error_names_its_row(folder: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(folder, "schema = 1\n\n[site\nname = 3\n")
    assert caught.value.row == 3
    with pytest.raises(InputError) as caught:
        read(folder, 'schema = 1\nname = """open')
    assert caught.value.row == 2


def test_a_file_that_is_missing_or_no_text(folder: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_project(folder / "none.toml")
    (folder / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_project(folder / "binary.toml")


def test_a_project_without_picks_is_not_reconstructed() -> None:
    with pytest.raises(RockfallError, match=r"names no table of picks. Add \[picks\]"):
        open_project(Project())


def test_a_project_cannot_be_changed_in_place(folder: Path) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        read(folder, FULL).picks = None  # type: ignore[misc]


SIMULATED = """
schema = 1
[simulation]
models = ["noel_2017", "stevens_1998"]
seed = 3
observed = "impacts.csv"
rolling = "coulomb"
friction = 0.4
drag = true
record = []
kept = 1
[simulation.releases]
from = "polygon"
points_m = [[2600010.25, 1200040.0], [2600030.0, 1200040.0, 512.5], [2600030.0, 1200060.0]]
number = 1000
shape = "box"
proportions = [3.0, 2.0, 1.0]
diameter_m = "lognormal:0.5,0.2"
density_kgpm3 = 2500
kept = 2
[simulation.zones]
file = "soil.csv"
attribute = "soil"
kept = 4
[[simulation.structures]]
name = "fence"
file = "fence.ply"
kept = 3
[[simulation.screens]]
name = "road"
points_m = [[2600060.0, 1200030.0], [2600062.0, 1200070.0]]
height_m = 4
capacity_kJ = 1000
kept = 5
[[simulation.screens]]
file = "screens.geojson"
"""


def test_a_simulation_round_trips(tmp_path: Path) -> None:
    path, again = tmp_path / "project.toml", tmp_path / "again.toml"
    for name in ("fence.ply", "impacts.csv", "soil.csv", "screens.geojson"):
        (tmp_path / name).touch()
    path.write_text(SIMULATED, encoding="utf-8")
    project = read_project(path)
    assert project.simulation == SimulationEntry(
        models=("noel_2017", "stevens_1998"),
        releases=ReleaseEntry(
            source="polygon",
            points_m=((2600010.25, 1200040.0), (2600030.0, 1200040.0, 512.5), (2600030.0, 1200060.0)),
            number=1000,
            shape="box",
            diameter=Distribution("lognormal", 0.5, 0.2),
            proportions=(3.0, 2.0, 1.0),
            density=Distribution("fixed", 2500.0),
            extra={"kept": 2},
        ),
        structures=(StructureEntry("fence", tmp_path / "fence.ply", {"kept": 3}),),
        screens=(
            ScreenEntry("road", None, ((2600060.0, 1200030.0), (2600062.0, 1200070.0)), 4.0, 1000.0, {"kept": 5}),
            ScreenEntry(file=tmp_path / "screens.geojson"),
        ),
        zones=ZonesEntry(tmp_path / "soil.csv", "soil", {"kept": 4}),
        rolling="coulomb",
        friction=0.4,
        drag=True,
        observed=tmp_path / "impacts.csv",
        seed=3,
        record=(),
        extra={"kept": 1},
    )
    write_project(project, again)
    assert read_project(again) == project
    for source in (
        ReleaseEntry(),
        ReleaseEntry("table", file=tmp_path / "fence.ply"),
        ReleaseEntry("steep", steeper_than_deg=61.5, diameter=Distribution("uniform", 0.1 + 0.2, 0.6)),
        ReleaseEntry("measured", trajectory="B01", time_s=-3.25),
    ):
        project = Project(simulation=SimulationEntry(releases=source))
        write_project(project, again)
        assert read_project(again) == project


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"stevens_1998"', '"stevens"', "simulation.models has 'stevens', which is no impact model"),
        ("seed = 3", "seed = -1", "simulation.seed is -1"),
        ('"coulomb"', '"sliding"', "simulation.rolling is 'sliding'"),
        ("record = []", 'record = ["films"]', "simulation.record has 'films'"),
        ('"polygon"', '"air"', "simulation.releases.from is 'air'"),
        ('"polygon"', '"table"', "simulation.releases.file is missing"),
        (", [2600030.0, 1200060.0]", "", "simulation.releases.points_m has 2 points"),
        ("[2600030.0, 1200060.0]", "[2600030.0]", "simulation.releases.points_m is not a list of points"),
        ("number = 1000", "number = 0", "simulation.releases.number is 0"),
        ('"lognormal:0.5,0.2"', "-0.5", "simulation.releases.diameter_m is -0.5"),
        ('"lognormal:0.5,0.2"', '"weibull:0.5,0.2"', "There is no law 'weibull'"),
        ('"lognormal:0.5,0.2"', "true", "simulation.releases.diameter_m is True, no number and no law"),
        ("kept = 2", "steeper_than_deg = 180", "simulation.releases.steeper_than_deg is 180"),
        ('"soil.csv"', '"sand.csv"', "simulation.zones.file names a file that is not there"),
        ('"fence.ply"', '"wall.ply"', "structures 1: file names a file that is not there"),
        ("kept = 3", '[[simulation.structures]]\nname = "fence"\nfile = "fence.ply"', "names 'fence' twice"),
        (", [2600062.0, 1200070.0]", "", "screens 1: points_m has 1 points"),
        ("height_m = 4\n", "", "screens 1: height_m is missing"),
        ('file = "screens', 'height_m = 2\nfile = "screens', "screens 2: height_m is given beside file"),
    ],
)
def test_bad_simulations_are_located(tmp_path: Path, old: str, new: str, problem: str) -> None:
    path = tmp_path / "project.toml"
    for name in ("fence.ply", "impacts.csv", "soil.csv", "screens.geojson"):
        (tmp_path / name).touch()
    assert SIMULATED.count(old) == 1
    path.write_text(SIMULATED.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_project(path)
    assert problem in error.value.problem
    assert error.value.file == path


def test_the_terrain_may_be_of_several_files(tmp_path: Path) -> None:
    """Two halves of a slope in one project: one surface, and the list comes back as it was."""
    for name, x in (("west", 0), ("east", 2)):
        rows = [f"v {x + i} {j} {-i - x}" for i in (0, 2) for j in (0, 2)] + ["f 1 3 4", "f 1 4 2"]
        (tmp_path / f"{name}.obj").write_text("\n".join(rows) + "\n")
    (tmp_path / "picks.csv").touch()
    project = read(tmp_path, 'schema = 1\n[terrain]\nfile = ["west.obj", "east.obj"]\n')
    surface = open_terrain(project)
    assert surface is not None
    assert len(surface.faces) == 4
    assert np.ptp(surface.vertices[:, 0]) == 4.0
    write_project(project, tmp_path / "again.toml")
    assert read_project(tmp_path / "again.toml") == project
    assert "file = [" in (tmp_path / "again.toml").read_text()


@pytest.mark.parametrize(
    ("files", "problem"),
    [("[]", "names no file"), ('["west.obj", ""]', "names no file"), ('["gone.obj"]', "not there"), ("[3]", "is")],
)
def test_a_list_of_files_that_is_none_is_refused(tmp_path: Path, files: str, problem: str) -> None:
    (tmp_path / "west.obj").touch()
    with pytest.raises(InputError, match=problem):
        read(tmp_path, f"schema = 1\n[terrain]\nfile = {files}\n")


def test_a_table_in_the_place_of_a_project_is_named(tmp_path):
    (tmp_path / "picks.csv").write_text("trajectory,time_s\n")
    with pytest.raises(InputError, match=r"This is a \.csv file, and a project is needed"):
        read_project(tmp_path / "picks.csv")


@pytest.mark.parametrize("text", ["complete", "longest:80", "longest", "unknown"])
def test_the_completeness_of_the_record_is_kept(tmp_path: Path, text: str) -> None:
    (tmp_path / "picks.csv").write_text("trajectory\n", encoding="utf-8")
    stated = Project(picks=tmp_path / "picks.csv", completeness=parse_completeness(text))
    write_project(stated, tmp_path / "project.toml")
    assert f'completeness = "{text}"' in (tmp_path / "project.toml").read_text(encoding="utf-8")
    assert read_project(tmp_path / "project.toml").completeness == stated.completeness


def test_a_completeness_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "picks.csv").write_text("trajectory\n", encoding="utf-8")
    (tmp_path / "project.toml").write_text(
        'schema = 1\n[picks]\nfile = "picks.csv"\ncompleteness = "all"\n', encoding="utf-8"
    )
    with pytest.raises(InputError, match=r"picks.*completeness is 'all'.*Write complete, longest:N"):
        read_project(tmp_path / "project.toml")
