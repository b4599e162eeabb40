# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong in a file is said in words: the guard around readers and commands, and messages that can be read."""

import json
import struct

import numpy as np
import pytest
import tifffile
import trimesh
from rockfall.core import cli
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.exchange.cameras import read_camera, read_pairs
from rockfall.core.exchange.map_shapes import read_polygons
from rockfall.core.exchange.project import read_project
from rockfall.core.exchange.tables import read_picks
from rockfall.core.georeference import GlobalShift
from rockfall.core.plausibility import implausible
from rockfall.core.progress import CancelledError
from rockfall.core.reading import reader
from rockfall.core.reconstruction.block import Block
from rockfall.core.terrain.readers import inspect_terrain, read_terrain

PLANE = "0 0 0\n4 0 1\n0 4 0\n4 4 1\n"


def refusal(read, *arguments) -> str:
    with pytest.raises(InputError) as caught:
        read(*arguments)
    assert str(caught.value).startswith(str(arguments[0]))
    assert caught.value.advice
    assert len(str(caught.value)) < 400
    assert str(caught.value).isprintable()
    return str(caught.value)


class PanicException(BaseException):
    """What the decoder of LAZ raises."""


@pytest.mark.parametrize(
    ("trouble", "said"),
    [
        (ValueError("bad magic"), "The table cannot be read (ValueError: bad magic)"),
        (OverflowError(), "The table cannot be read (OverflowError)"),
        (struct.error("unpack"), "The table cannot be read (error: unpack)"),
        (RecursionError(), "The table is nested too deeply"),
        (MemoryError(), "The table needs more memory than there is"),
        (PermissionError(13, "Permission denied"), "The table cannot be read (Permission denied)"),
        (PanicException("out of range"), "The table cannot be read (PanicException: out of range)"),
        (InputError("The column is empty", row=3), "row 3: The column is empty"),
    ],
)
def test_whatever_happens_in_a_reader_names_the_file_and_what_to_do(tmp_path, trouble, said):
    @reader("table", "Export it again")
    def read(path):
        raise trouble

    assert said in refusal(read, tmp_path / "a.csv")


@pytest.mark.parametrize("passing", [CancelledError, KeyboardInterrupt, RockfallError])
def test_what_is_no_fault_of_the_file_goes_through_a_reader(passing):
    @reader("table")
    def read(path):
        raise passing("stop")

    with pytest.raises(passing, match="stop"):
        read("a.csv")


def test_a_message_is_short_and_shows_what_a_terminal_would_obey():
    said = str(
        InputError(f"'\x1b[31m\x07{'x' * 5000}\u202e' is no number", file="a\x00.csv", row=2, advice="Correct it")
    )
    assert len(said) < 400
    assert said.isprintable()
    assert said.startswith(r"a\x00.csv, row 2: '\x1b[31m\x07xxx")
    assert said.count("…") == 1
    assert said.endswith(r"xxx\u202e' is no number. Correct it.")


def test_a_command_tells_its_own_mistakes_in_words(tmp_path, capsys, monkeypatch):
    def broken(arguments):
        raise KeyError("speed")

    monkeypatch.setattr("rockfall.core.commands.models.run", broken)
    assert cli.main(["models"]) == 1
    said = capsys.readouterr().err
    assert "wrong in Rockfall itself" in said
    assert "KeyError: 'speed', test_reading.py line" in said
    assert said.count("\n") == 1
    monkeypatch.setenv(cli.TRACEBACK, "1")
    with pytest.raises(KeyError):
        cli.main(["models"])


@pytest.mark.parametrize(
    ("trouble", "said"),
    [
        (OSError(5, "Input/output error", "a.csv"), "a.csv: The system refuses a file (Input/output error)"),
        (MemoryError(), "This needs more memory than there is"),
    ],
)
def test_a_command_tells_the_troubles_of_the_system_in_words(capsys, monkeypatch, trouble, said):
    def broken(arguments):
        raise trouble

    monkeypatch.setattr("rockfall.core.commands.models.run", broken)
    assert cli.main(["models"]) == 1
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("element vertex 4\nproperty float x\nproperty float x\nproperty float y\nproperty float z\n", "x twice"),
        ("element vertex 4\nproperty list uchar float x\nproperty float y\nproperty float z\n", "no vertices with"),
        ("element fog 4000000000\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n", "fog"),
        (
            "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 1\nproperty list float int vertex_indices\n",
            "a count that is no whole number",
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_a_ply_header_that_makes_no_sense_is_refused(tmp_path, header, said, order):
    path = tmp_path / "a.ply"
    numbers = np.array(PLANE.split(), "<f4").tobytes() + struct.pack("<f3i", np.nan, 0, 1, 2)
    body = PLANE.encode() + b"nan 0 1 2\n" if order == "ascii" else numbers
    path.write_bytes(f"ply\nformat {order} 1.0\n{header}end_header\n".encode() + body)
    assert said in refusal(read_terrain, path)


def test_an_ascii_grid_without_a_number_of_columns_is_refused(tmp_path):
    path = tmp_path / "a.asc"
    for number in ("nan", "inf", "-3", "2.5", "1e400"):
        path.write_text(f"ncols {number}\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 2\n1 2 3\n4 5 6\n")
        assert "ncols is" in refusal(read_terrain, path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"count": 10**15}, "promises 1000000000000000 rows"),
        ({"count": -5}, "has -5 rows"),
        ({"bufferView": 77}, "cannot be read (IndexError"),
        ({"componentType": 3}, "cannot be read (KeyError: 3)"),
        ({"count": "many"}, "cannot be read (ValueError"),
    ],
)
def test_damaged_accessors_of_a_gltf_are_refused(tmp_path, change, said):
    parts = trimesh.creation.box().export(file_type="gltf")
    document = json.loads(parts.pop("model.gltf"))
    for name, data in parts.items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(document))
    assert len(read_terrain(path).faces) == 12
    document["accessors"][0] |= change
    path.write_text(json.dumps(document))
    assert said in refusal(read_terrain, path)


def test_a_las_header_that_promises_more_records_than_the_file_has_bytes_is_refused(tmp_path):
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    las.x, las.y, las.z = np.random.default_rng(0).uniform(0, 50, (3, 100))
    path = tmp_path / "a.las"
    las.write(path)
    data = bytearray(path.read_bytes())
    data[100:104] = b"\xff" * 4
    path.write_bytes(data)
    assert "promises 4294967295 records" in refusal(read_terrain, path)
    assert "promises 4294967295 records" in refusal(inspect_terrain, path)


def test_a_laz_that_promises_more_parts_than_it_has_bytes_is_refused(tmp_path):
    """Its decoder takes memory for them at once, and ends the process when there is none."""
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    las.x, las.y, las.z = np.random.default_rng(0).uniform(0, 50, (3, 100))
    path = tmp_path / "a.laz"
    las.write(path)
    data = bytearray(path.read_bytes())
    points = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[points : points + 8], "little")
    data[table + 4 : table + 8] = b"\xff" * 4
    path.write_bytes(data)
    assert "promises 4294967295 parts" in refusal(read_terrain, path)


def test_a_small_tiff_of_a_huge_grid_is_refused_before_memory_is_taken(tmp_path):
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.zeros((64, 64), np.float32), compression="deflate", rowsperstrip=64)
    with tifffile.TiffFile(path, mode="r+") as tiff:
        for name in ("ImageWidth", "ImageLength", "RowsPerStrip"):
            tiff.pages.first.tags[name].overwrite(16_000)
    assert "its header promises 16000 × 16000 heights" in refusal(read_terrain, path)


def test_coordinates_beyond_every_survey_are_refused(tmp_path):
    path = tmp_path / "a.xyz"
    path.write_text(PLANE + "1e300 0 0\n")
    assert "A coordinate of 1e+300 m is beyond every survey" in refusal(read_terrain, path)
    path = tmp_path / "picks.csv"
    path.write_text("trajectory,time_s,x_m,y_m,z_m\nA,0,1e300,0,0\nA,1,1,0,0\n")
    assert "row 2, trajectory A: x_m is 1e+300, beyond what can be" in refusal(read_picks, path)
    path = tmp_path / "pairs.csv"
    path.write_text("u_px,v_px,x_m,y_m,z_m\n1e308,2,1,0,0\n")
    assert "u_px is 1e+308, beyond what can be" in refusal(read_pairs, path)
    path = tmp_path / "a.geojson"
    path.write_text('{"type": "Polygon", "coordinates": [[[0, 0], [1e12, 0], [0, 1]]]}')
    assert "beyond every survey" in refusal(read_polygons, path, GlobalShift())


@pytest.mark.parametrize(
    ("name", "value", "good"),
    [
        ("x_m", 2.6e6, True), ("x_m", 1e9, True), ("x_m", 1.1e9, False), ("fy", 2e9, False), ("fy", 1400.0, True),
        ("air_density_kgpm3", 1.2, True), ("air_density_kgpm3", 1e9, False), ("density_kgpm3", 2650.0, True),
        ("density_kgpm3", 1e-300, False), ("d1_m", 0.005, True), ("d1_m", 1e7, False), ("anything", 1e300, True),
        ("sigma_x_m", 1e20, True), ("sigma_x_m", 1e200, False),
    ],
)  # fmt: skip
def test_what_a_number_can_be_is_known_by_its_name(name, value, good):
    assert (implausible(name, value) == "") == good


def test_projects_and_cameras_that_cannot_be_are_refused_at_the_door(tmp_path):
    project = tmp_path / "project.toml"
    for line, said in (
        ("[reconstruction]\nair_density_kgpm3 = 1e9", "air_density_kgpm3 is 1e+09, beyond what can be"),
        ("[block]\ndensity_kgpm3 = 1e300", "density_kgpm3 is 1e+300"),
        (f"[block]\nd1_m = {'9' * 400}", "d1_m is 999"),
        (f"[block]\nd1_m = {'9' * 5000}", "cannot be read"),
        (f"x = {'[' * 100_000}", "nested too deeply"),
    ):
        project.write_text(f"schema = 1\n{line}\n")
        assert said in refusal(read_project, project)
    camera = tmp_path / "camera.toml"
    camera.write_text("width = 100\nheight = 50\nfx = 80.0\nfy = 2e9\ncx = 50\ncy = 25\nposition = [0, 0, 0]\n")
    assert "fy is 2e+09, beyond what can be" in refusal(read_camera, camera)


def test_a_nested_geojson_is_refused(tmp_path):
    path = tmp_path / "a.geojson"
    path.write_text('{"type": "Polygon", "coordinates": ' + "[" * 100_000)
    assert "nested too deeply" in refusal(read_polygons, path, GlobalShift())


def test_blocks_air_and_times_that_cannot_be_are_refused(tmp_path, capsys):
    with pytest.raises(RockfallError, match=r"block's d1 is 1e\+300, beyond what can be"):
        Block(1e300, 1.0, 1.0)
    path = tmp_path / "picks.csv"
    path.write_text("trajectory,time_s,x_m,y_m,z_m\nA,0,0,0,0\nA,1,1,0,0\n")
    assert cli.main(["reconstruct", str(path), "--drag", "--air-density", "1e9", "--out", str(tmp_path / "out")]) == 1
    assert "density of the air is 1e+09, beyond what can be" in capsys.readouterr().err
    path.write_text("trajectory,time_s,x_m,y_m,z_m\nA,0,0,0,0\nA,1e9,1,0,0\n")
    assert "The trajectory lasts for 1e+09 s, longer than any fall" in refusal(read_picks, path)
