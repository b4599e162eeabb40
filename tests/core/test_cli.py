# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: what it writes, what it says, and how it refuses."""

import os
import subprocess
import sys
from argparse import ArgumentParser
from importlib import import_module

import laspy
import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.commands.options import models_as_asked
from rockfall.core.exchange.tables import read_impacts
from rockfall.core.film.maker import FilmMaker, inside_blender
from rockfall.core.terrain.readers import read_terrain

DIP = np.radians(30)
GOOD = "trajectory,time_s,x_m,y_m,z_m,kind\n" + "".join(
    f"a,{0.8 * i},{2600000 + 5 * i},1200000,{1000 - 5 * i * np.tan(DIP):.3f},{kind}\n"
    for i, kind in enumerate(["release", "impact", "impact", "impact", "stop"])
)


@pytest.fixture
def picks(tmp_path):
    table = tmp_path / "in" / "picks.csv"
    table.parent.mkdir()
    table.write_text(GOOD, encoding="utf-8")
    return table


@pytest.fixture
def terrain(tmp_path):
    """A plane that dips by 30° to the east, as a grid with 2 m cells around the picks."""
    x = np.arange(-20, 42, 2.0) + 1
    rows = "\n".join(" ".join(f"{1000 - value * np.tan(DIP):.4f}" for value in x) for _ in range(20))
    head = f"ncols {x.size}\nnrows 20\nxllcorner 2599980\nyllcorner 1199980\ncellsize 2\nNODATA_value -9999\n"
    path = tmp_path / "plane.asc"
    path.write_text(head + rows + "\n")
    return path


def refused(capsys, out, *argv):
    """Run a command that must be refused, check that nothing is left, return its message."""
    assert main([*map(str, argv), "--out", str(out)]) == 1
    assert not out.exists()
    assert not [path for path in out.parent.iterdir() if path.name.startswith(f".{out.name}")]
    captured = capsys.readouterr()
    assert captured.out == ""
    *progress, message = captured.err.splitlines()
    assert all(line.endswith(" …") for line in progress)
    return message


def test_reconstruct_writes_both_tables_and_a_summary(picks, tmp_path, capsys):
    assert main(["reconstruct", str(picks), "--site", "plane", "--out", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["impacts.csv", "trajectories.csv"]
    impacts = read_impacts(tmp_path / "out" / "impacts.csv")
    assert impacts.flag_text() == ["", "", "last;contact"]
    assert impacts.site.tolist() == ["plane"] * 3
    said = capsys.readouterr().out
    assert (
        "5 picks of 1 trajectory: 3 flights, 1 contact segment, 3 impacts, 2 with R, 0 with all coefficients." in said
    )
    assert "without a terrain normal" in said


def test_reconstruct_takes_the_terrains_normals(picks, terrain, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["reconstruct", str(picks), "--terrain", str(terrain), "--normal-radius", "3", "--out", str(out)]) == 0
    impacts = read_impacts(out / "impacts.csv")
    np.testing.assert_allclose(impacts.normal, np.tile([np.sin(DIP), 0, np.cos(DIP)], (3, 1)), atol=1e-4)
    np.testing.assert_array_equal(impacts.normal_radius_m, 3)
    np.testing.assert_allclose(impacts.bounce_height_m[:2], 9.81 * 0.8**2 / 8, rtol=2e-3)
    assert impacts.complete.tolist() == [True, True, False]
    assert "R_N" in capsys.readouterr().out


def test_options_reach_the_reconstruction(picks, tmp_path):
    out = tmp_path / "out"
    block = ["--diameters", "0.3", "0.4", "0.5", "--mass", "80"]
    assert main(["reconstruct", str(picks), "--gravity", "1.62", *block, "--step", "0.4", "--out", str(out)]) == 0
    moon = read_impacts(out / "impacts.csv")
    np.testing.assert_allclose(moon.mass_kg, 80)
    np.testing.assert_allclose(moon.diameter_m, 0.4)
    np.testing.assert_allclose(moon.v2[0, 2], -5 * np.tan(DIP) / 0.8 + 1.62 * 0.4, atol=1e-3)
    assert len((out / "trajectories.csv").read_text().splitlines()) == 1 + 4 * 3 + 1
    assert main(["reconstruct", str(picks), "--drag", "--out", str(out)]) == 0
    drag = read_impacts(out / "impacts.csv")
    assert main(["reconstruct", str(picks), "--out", str(out)]) == 0
    free = read_impacts(out / "impacts.csv")
    assert np.linalg.norm(drag.v1[0]) < np.linalg.norm(free.v1[0])
    assert np.linalg.norm(drag.v1[0]) == pytest.approx(np.linalg.norm(free.v1[0]), rel=0.01)


def test_terrain_becomes_a_ply_that_reads_the_same(terrain, tmp_path, capsys):
    assert main(["terrain", str(terrain), "--no-picture", "--out", str(tmp_path / "one")]) == 0
    said = capsys.readouterr().out
    assert "Written: terrain.ply in" in said
    assert [path.name for path in (tmp_path / "one").iterdir()] == ["terrain.ply"], "no picture was asked for"
    assert main(["terrain", str(tmp_path / "one" / "terrain.ply"), "--no-picture", "--out", str(tmp_path / "two")]) == 0
    one, two = ((tmp_path / name / "terrain.ply").read_bytes() for name in ("one", "two"))
    assert one == two


def test_tiles_become_one_surface(tmp_path, capsys):
    row = "1 2 3 4 5\n" * 3
    for name, x in (("west", 2_600_000), ("east", 2_600_008)):
        text = f"ncols 5\nnrows 3\nxllcenter {x}\nyllcenter 1200000\ncellsize 2\n"
        (tmp_path / f"{name}.asc").write_text(text + (row if name == "west" else row.replace("1", "5", 1)))
    tiles = [str(tmp_path / f"{name}.asc") for name in ("west", "east")]
    assert main(["terrain", *tiles, "--no-picture", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "west.asc: Grid of 5 × 3 heights" in said
    assert "2 tiles are one surface of 32 faces." in said
    surface = read_terrain(tmp_path / "out" / "terrain.ply")
    survey = surface.shift.to_survey(surface.vertices)
    np.testing.assert_allclose([survey[:, 0].min(), survey[:, 0].max()], [2_600_000, 2_600_016], atol=1e-6)


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1), ("mm", 1e-3), ("ft", 0.3048), ("us-ft", 1200 / 3937), ("0.5", 0.5)]
)
def test_a_terrain_in_another_unit_is_measured_in_metres(terrain, tmp_path, unit, metres):
    assert main(["terrain", str(terrain), "--unit", unit, "--no-picture", "--out", str(tmp_path / "out")]) == 0
    found, plain = read_terrain(tmp_path / "out" / "terrain.ply"), read_terrain(terrain)
    survey = [one.shift.to_survey(one.vertices) for one in (found, plain)]
    np.testing.assert_allclose(survey[0].min(axis=0), metres * survey[1].min(axis=0), rtol=1e-9)
    np.testing.assert_allclose(survey[0].max(axis=0), metres * survey[1].max(axis=0), rtol=1e-9)


def test_how_a_terrain_is_read_is_a_matter_of_options(tmp_path, capsys):
    rng = np.random.default_rng(3)
    cloud = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    cloud.x, cloud.y = np.concatenate([rng.uniform(0, 20, (300, 2)), rng.uniform(30, 50, (300, 2))]).T
    cloud.z = 0.5 * np.asarray(cloud.x)
    cloud.classification = np.where(np.arange(600) % 3, 2, 5)
    cloud.write(str(tmp_path / "cloud.las"))

    def said(name, *options):
        assert main(["terrain", str(tmp_path / name), *options, "--no-picture", "--out", str(tmp_path / "out")]) == 0
        return capsys.readouterr().out

    assert "the 400 points of the ground class" in said("cloud.las")
    faces = len(read_terrain(tmp_path / "out" / "terrain.ply").faces)
    assert "the 400 points of the ground class" in said("cloud.las", "--ground-only")
    assert "all classes, as asked" in said("cloud.las", "--all-points")
    assert not (tmp_path / "out" / "left_out.ply").exists()
    assert "Ground filter (cloth of 2 m): kept the 600 of 600" in said("cloud.las", "--ground-filter", "2")
    said("cloud.las", "--max-edge", "4")
    cut = read_terrain(tmp_path / "out" / "terrain.ply")
    assert len(cut.faces) < faces
    corners = cut.vertices[cut.faces]
    assert np.linalg.norm((corners - np.roll(corners, 1, axis=1))[:, :, :2], axis=2).max() <= 4
    (tmp_path / "upright.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 9 9 1\nf 1 2 3\nf 2 4 3\n")
    assert "Turned from Y up to Z up, as asked" in said("upright.obj", "--up", "y")


def test_a_picture_of_the_terrain_is_made_unless_it_is_not_wanted(terrain, tmp_path, capsys, monkeypatch):
    def make(job, progress):
        assert (job.kind, job.source.name, job.title) == ("terrain", "terrain.ply", "plane.asc")
        job.out.write_bytes(b"a picture")
        return ()

    monkeypatch.setattr("rockfall.core.film.maker.require_blender_libraries", lambda: None)
    token = inside_blender.set(FilmMaker(make, ("/no/such/program",)))
    try:
        assert main(["terrain", str(terrain), "--out", str(tmp_path / "with")]) == 0
        assert main(["terrain", str(terrain), "--no-picture", "--out", str(tmp_path / "without")]) == 0
    finally:
        inside_blender.reset(token)
    assert sorted(path.name for path in (tmp_path / "with").iterdir()) == ["terrain.ply", "terrain.png"]
    assert [path.name for path in (tmp_path / "without").iterdir()] == ["terrain.ply"]
    said = capsys.readouterr().out
    assert "Written: terrain.ply, terrain.png in" in said
    assert "Written: terrain.ply in" in said


BAD = {
    "empty": ("", "empty"),
    "column": (GOOD.replace("time_s", "time"), "row 1: The required column time_s is missing"),
    "non-number": (GOOD.replace("a,0.8,", "a,soon,"), "row 3, trajectory a: 'soon' in column time_s is not a number"),
    "same time": (GOOD.replace("a,0.8,", "a,0.0,"), "row 3, trajectory a: Two picks at one time"),
    "unsorted": (GOOD.replace("a,0.8,", "a,9,"), "row 4, trajectory a: The times are not sorted"),
    "nan": (GOOD.replace("2600005", "nan"), "row 3, trajectory a: 'nan' in column x_m is not finite"),
    "kind": (GOOD.replace("stop", "stopp"), "row 6, trajectory a: Unknown kind 'stopp'. Did you mean stop?"),
    "cells": (GOOD.replace("a,0.8,", "a,"), "row 3: The row has 5 cells"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_picks_are_refused_and_nothing_is_written(picks, tmp_path, capsys, case):
    text, message = BAD[case]
    picks.write_text(text, encoding="utf-8")
    said = refused(capsys, tmp_path / "out", "reconstruct", picks)
    assert said.startswith(f"rockfall: {picks}")
    assert message in said


def test_a_missing_picks_file_is_refused(tmp_path, capsys):
    assert "no such file" in refused(capsys, tmp_path / "out", "reconstruct", tmp_path / "none.csv")


def test_a_binary_file_is_refused(picks, tmp_path, capsys):
    picks.write_bytes(bytes(range(256)))
    assert "binary file" in refused(capsys, tmp_path / "out", "reconstruct", picks)


def test_bad_terrain_is_refused(picks, tmp_path, capsys):
    broken = tmp_path / "broken.ply"
    broken.write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 100\nproperty float x\n")
    said = refused(capsys, tmp_path / "out", "reconstruct", picks, "--terrain", broken)
    assert "broken.ply" in said
    said = refused(capsys, tmp_path / "out", "terrain", tmp_path / "none.laz")
    assert "none.laz" in said


def test_a_pick_50_m_off_the_terrain_is_refused(picks, terrain, tmp_path, capsys):
    rows = GOOD.splitlines()
    cells = rows[3].split(",")
    cells[4] = str(float(cells[4]) + 50)
    picks.write_text("\n".join([*rows[:3], ",".join(cells), *rows[4:]]), encoding="utf-8")
    said = refused(capsys, tmp_path / "out", "reconstruct", picks, "--terrain", terrain)
    assert "row 4, trajectory a: The pick is 43.3 m from the terrain" in said


def test_picks_in_other_coordinates_are_refused(picks, terrain, tmp_path, capsys):
    picks.write_text(GOOD.replace("26000", "6000"), encoding="utf-8")
    said = refused(capsys, tmp_path / "out", "reconstruct", picks, "--terrain", terrain)
    assert "do not overlap" in said
    assert "terrain x 2599981.0…" in said


def test_a_refusal_spares_what_is_in_the_folder(picks, tmp_path):
    out = tmp_path / "out"
    assert main(["reconstruct", str(picks), "--out", str(out)]) == 0
    before = (out / "impacts.csv").read_bytes()
    picks.write_text(GOOD.replace("stop", "stopp"), encoding="utf-8")
    assert main(["reconstruct", str(picks), "--out", str(out)]) == 1
    assert (out / "impacts.csv").read_bytes() == before
    assert len(list(out.iterdir())) == 2


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ([], "required: COMMAND"),
        (["fly"], "invalid choice: 'fly'"),
        (["reconstruct"], "required: PICKS, --out"),
        (["reconstruct", "picks.csv"], "required: --out"),
        (["reconstruct", "picks.csv", "--out", "o", "--gravity", "heavy"], "--gravity: invalid"),
        (["reconstruct", "picks.csv", "--out", "o", "--gravity", "-9.81"], "-9.81 is not a number of zero or more"),
        (["reconstruct", "picks.csv", "--out", "o", "--diameter", "-1"], "--diameter: -1 is not a number above zero"),
        (["reconstruct", "picks.csv", "--out", "o", "--density", "2600", "--mass", "80"], "--mass: not allowed with"),
        (["terrain", "mesh.ply", "--out", "o", "--unit", "furlong"], "furlong is neither m, mm, cm, km, ft, us-ft nor"),
    ],
)  # fmt: skip
def test_wrong_usage_exits_with_2(argv, said, capsys):
    assert main(argv) == 2
    message = capsys.readouterr().err
    assert message.startswith("usage: rockfall")
    assert said in message


def test_help_names_the_commands_and_exits_with_0(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    for name in ("demo", "reconstruct", "terrain", "render"):
        assert name in said
    assert main(["reconstruct", "--help"]) == 0
    assert "--normal-radius" in capsys.readouterr().out


def test_an_interruption_exits_with_130_and_leaves_nothing(picks, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("rockfall.core.reconstruction.trajectory.reconstruct", interrupted)
    assert main(["reconstruct", str(picks), "--out", str(tmp_path / "out")]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_help_imports_no_numerical_library():
    code = (
        "import sys; from rockfall.core.cli import main; main(['--help']); "
        "assert not {'numpy', 'scipy', 'numba', 'trimesh'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.skipif(os.name == "nt", reason="a shell there has no such status")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    "argv",
    [["models"], ["models", "noel_2017"], ["--help"], ["compare", "--help"], ["reconstruct"]],
)
def test_a_pipe_that_is_closed_ends_a_command_quietly(argv, unbuffered, picks, tmp_path):
    """As of other tools in ``command | head -1``: status 141 in a shell, no complaint, and the output is whole."""
    files = [str(picks), "--out", str(tmp_path / "out")] if argv == ["reconstruct"] else []
    read, write = os.pipe()
    os.close(read)  # before anything is written
    with os.fdopen(write, "wb") as closed:
        command = [sys.executable, "-m", "rockfall.core.cli", *argv, *files]
        environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        ended = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, check=False, env=environment)
    swallowed = unbuffered and "--help" in argv  # by argparse
    assert (ended.returncode, ended.stderr) == (0 if swallowed else 141, b"")
    assert (tmp_path / "out" / "impacts.csv").exists() == bool(files)


@pytest.mark.skipif(os.name == "nt", reason="no shell with pipefail")
def test_the_first_line_of_a_long_output():
    command = f"set -o pipefail; '{sys.executable}' -m rockfall.core.cli models | head -1"
    ended = subprocess.run(["bash", "-c", command], capture_output=True, check=False)
    assert ended.stdout.split() == [b"parameter", b"default", b"range"]
    assert ended.returncode in (0, 141)  # 0 when all was in the pipe before it was closed
    assert ended.stderr == b""


@pytest.mark.parametrize("name", ["compare", "explore", "simulate", "compare_runs", "render"])
def test_models_are_named_alike_in_every_command(name, tmp_path) -> None:
    parser = ArgumentParser()
    import_module(f"rockfall.core.commands.{name}").add_arguments(parser)
    out = [] if name == "explore" else ["--out", str(tmp_path)]
    two, again = ["--model", "noel_2017", "wylie"], ["--model", "wyllie_2014", "--model", "noel_2017"]
    assert parser.parse_args(["file", *two, *out]).model == ["noel_2017", "wylie"]
    assert models_as_asked(parser.parse_args(["file", *again, *out]).model) == ("wyllie_2014", "noel_2017")
    assert models_as_asked(parser.parse_args(["file", *out]).model, ("noel_2017",)) == ("noel_2017",)


def test_a_file_after_the_models_is_not_taken_for_one(terrain, tmp_path, capsys) -> None:
    argv = ["simulate", "--terrain", str(terrain), "--model", "noel_2017", "starts.csv"]
    assert "starts.csv for a model. Write the file before --model" in refused(capsys, tmp_path / "out", *argv)


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are counted as Linux tells them")
@pytest.mark.parametrize(("asked", "threads"), [(None, "1"), ("2", "2")])
def test_linear_algebra_has_one_thread_unless_more_are_asked_for(asked, threads) -> None:
    code = (
        "import os; from rockfall.core.cli import main; main(['models']); import numpy; "
        "print(len(os.listdir('/proc/self/task')), os.environ['OPENBLAS_NUM_THREADS'])"
    )
    name = "OPENBLAS_NUM_THREADS"
    environment = {key: value for key, value in os.environ.items() if key != name} | ({name: asked} if asked else {})
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    count, told = done.stdout.splitlines()[-1].split()
    assert told == threads
    assert asked or count == "1"


def test_a_process_that_ends_looks_for_no_garbage_once_more() -> None:
    """What is frozen is left alone by the collection at Python's end; in another program, as Blender, nothing is."""
    for module, frozen in (("start", True), ("cli", False)):
        code = (
            f"import gc, sys; from rockfall.core.{module} import main; sys.argv = ['rockfall', 'models']; main(); "
            "print(gc.get_freeze_count())"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert (int(done.stdout.splitlines()[-1]) > 1000) == frozen
