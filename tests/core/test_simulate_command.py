# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall simulate``: tables that agree with each other, and bad input."""

import csv
import errno
import json
import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.commands.progress import PrintedProgress
from rockfall.core.exchange.tables import read_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

EAST, NORTH = 2_600_000.0, 1_200_000.0


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A slope of 35° that runs out on a plain, in survey coordinates."""
    line = np.arange(0.0, 121.0, 2.0)
    x, y = np.meshgrid(line, line)
    z = 500 - 0.7 * np.minimum(x, 60) + 0.3 * np.sin(x) * np.cos(y / 2)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    path = tmp_path_factory.mktemp("ground") / "slope.ply"
    write_ply(Surface(vertices, faces, GlobalShift(EAST, NORTH, 0.0), "slope"), path)
    return path


@pytest.fixture
def releases(tmp_path: Path) -> Path:
    path = tmp_path / "releases.csv"
    path.write_text(
        "release,x_m,y_m,z_m,diameter_m,number\n"
        f"cliff,{EAST + 10},{NORTH + 40},,0.4,3\n"
        f"ledge,{EAST + 14},{NORTH + 70},495.0,0.6,2\n",
        encoding="utf-8",
    )
    return path


def test_tables_agree_with_each_other(terrain: Path, releases: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "out"
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "noel_2017", "--seed", "3"]
    assert main([*argv, "--out", str(out)]) == 0
    runs = rows_of(out / "runs.csv")
    assert [row["release"] for row in runs] == ["cliff"] * 3 + ["ledge"] * 2
    assert [row["end"] for row in runs] == ["stopped"] * 5
    impacts = read_impacts(out / "impacts.csv")
    counts = np.unique(impacts.extra["run"].astype(int), return_counts=True)[1]
    assert counts.tolist() == [int(row["impacts"]) for row in runs]
    assert abs(impacts.shift.to_survey(impacts.position)[:, 0] - EAST).max() < 121
    samples = rows_of(out / "trajectories.csv")
    for row in runs:
        own = [sample for sample in samples if sample["run"] == row["run"]]
        last = own[-1]
        for name in ("x_m", "y_m", "z_m"):
            assert float(last[name]) == pytest.approx(float(row[name]), abs=1e-5)
        speeds = [np.hypot(np.hypot(float(s["vx_mps"]), float(s["vy_mps"])), float(s["vz_mps"])) for s in own]
        assert max(speeds) <= float(row["v_max_mps"]) + 1e-6
        heights = [float(s["height_m"]) for s in own]
        assert float(row["height_max_m"]) >= max(heights) - 0.1
        fall = float(row["z0_m"]) - float(row["z_m"])
        flat = np.hypot(float(row["x_m"]) - float(row["x0_m"]), float(row["y_m"]) - float(row["y0_m"]))
        assert float(row["energy_line_deg"]) == pytest.approx(np.degrees(np.arctan2(fall, flat)), abs=3e-6)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["models"]["noel_2017"]["ends"] == {"stopped": 5, "left_terrain": 0, "limit": 0}
    assert summary["seed"] == 3
    assert len(summary["inputs"]["terrain"]["sha256"]) == 64
    assert "5 blocks with Noël et al. 2017" in capsys.readouterr().out
    again = tmp_path / "again"
    assert main([*argv, "--threads", "1", "--out", str(again)]) == 0
    for name in ("runs.csv", "impacts.csv", "trajectories.csv"):
        assert (again / name).read_bytes() == (out / name).read_bytes()


def test_what_a_finer_mesh_changes_is_said_and_written(terrain: Path, releases: Path, tmp_path: Path, capsys) -> None:
    """Blocks of 0.4 and 0.6 m on waves of 6 m in steps of 2 m."""
    plain = ["simulate", str(releases), "--terrain", str(terrain), "--model", "noel_2017", "--seed", "3"]
    assert main([*plain, "--out", str(tmp_path / "plain")]) == 0
    said = capsys.readouterr().out
    assert re.search(r"edges of [5-7](\.\d)? diameters", said)
    assert "changes by" not in said
    assert main([*plain, "--check-mesh", "--out", str(tmp_path / "checked")]) == 0
    said = capsys.readouterr().out
    assert "the mean run-out of 5 blocks changes by" in said
    summary = json.loads((tmp_path / "checked" / "summary.json").read_text(encoding="utf-8"))
    assert any("the mean run-out of 5 blocks changes by" in str(one) for one in summary["remarks"])
    assert rows_of(tmp_path / "plain" / "runs.csv") == rows_of(tmp_path / "checked" / "runs.csv")


def test_several_models_get_the_same_blocks(terrain: Path, releases: Path, tmp_path: Path) -> None:
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--seed", "3"]
    for models in (["noel_2017"], ["stevens_1998"], ["noel_2017", "stevens_1998"]):
        assert main([*argv, "--model", *models, "--out", str(tmp_path / "_".join(models))]) == 0
    for table, column in (("runs.csv", "model"), ("impacts.csv", "source"), ("trajectories.csv", "source")):
        alone = [rows_of(tmp_path / name / table) for name in ("noel_2017", "stevens_1998")]
        together = rows_of(tmp_path / "noel_2017_stevens_1998" / table)
        assert together == [*alone[0], *alone[1]]
        assert list(dict.fromkeys(row[column] for row in together)) == ["noel_2017", "stevens_1998"]


def test_parts_of_a_simulation_are_the_whole(terrain: Path, releases: Path, tmp_path: Path, capsys) -> None:
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "stevens_1998", "--seed", "3"]
    for runs, threads in (("1-5", "2"), ("1-1", "1"), ("2-5", "7")):
        assert main([*argv, "--runs", runs, "--threads", threads, "--out", str(tmp_path / runs)]) == 0
    assert json.loads((tmp_path / "2-5" / "summary.json").read_text(encoding="utf-8"))["first_run"] == 2
    assert main([*argv, "--out", str(tmp_path / "all")]) == 0
    for name in ("runs.csv", "impacts.csv", "trajectories.csv"):
        assert (tmp_path / "1-5" / name).read_bytes() == (tmp_path / "all" / name).read_bytes()
        first, rest = ((tmp_path / runs / name).read_bytes() for runs in ("1-1", "2-5"))
        assert first + rest.split(b"\n", 1)[1] == (tmp_path / "all" / name).read_bytes()
    capsys.readouterr()
    assert main([*argv, "--runs", "4-6", "--out", str(tmp_path / "out")]) == 1
    assert "--runs asks for run 6 of 5" in capsys.readouterr().err
    for wrong in ("0-3", "4", "4-3", "4-x"):
        assert main([*argv, "--runs", wrong, "--out", str(tmp_path / "out")]) == 2


def test_without_records_the_greatest_height_is_not_known(terrain: Path, releases: Path, tmp_path: Path) -> None:
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "noel_2017", "--seed", "3"]
    tables = {}
    for record in ("none", "impacts"):
        assert main([*argv, "--record", record, "--out", str(tmp_path / record)]) == 0
        tables[record] = rows_of(tmp_path / record / "runs.csv")
    assert [row["height_max_m"] for row in tables["none"]] == [""] * 5
    assert all(0.2 < float(row["height_max_m"]) < 20 for row in tables["impacts"])
    for row, other in zip(tables["none"], tables["impacts"], strict=True):
        assert row | {"height_max_m": ""} == other | {"height_max_m": ""}


def test_hits_of_a_wall(terrain: Path, releases: Path, tmp_path: Path) -> None:
    corners = np.array([[55.0, 0, 455], [55.0, 118, 455], [55.0, 118, 470], [55.0, 0, 470]])
    wall = tmp_path / "wall.ply"
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    write_ply(Surface(corners, faces, GlobalShift(EAST, NORTH, 0.0), "wall"), wall)
    out = tmp_path / "out"
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "azimi_desvarreux_1977"]
    assert main([*argv, "--structure", f"wall={wall}", "--record", "none", "--out", str(out)]) == 0
    hits, runs = rows_of(out / "hits.csv"), rows_of(out / "runs.csv")
    assert {row["structure"] for row in hits} == {"wall"}
    assert sorted(path.name for path in out.iterdir()) == ["hits.csv", "runs.csv", "summary.json"]
    radius = {row["run"]: float(row["diameter_m"]) / 2 for row in runs}
    for row in hits:
        away = EAST + 55.0 - float(row["x_m"])
        assert radius[row["run"]] - 1e-6 < away < 1.5 * radius[row["run"]]
        speed = float(row["v_mps"])
        mass = float(runs[int(row["run"]) - 1]["mass_kg"])
        assert float(row["kinetic_J"]) == pytest.approx(0.5 * mass * speed**2, rel=1e-6)
        assert float(row["along_m"]) == pytest.approx(float(row["y_m"]) - NORTH, abs=0.3)
        assert 0 < float(row["up_m"]) < 8
        assert row["passes"] == "0"
    assert all(float(row["x_m"]) < EAST + 55 and row["end"] == "structure:wall" for row in runs)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["models"]["azimi_desvarreux_1977"]["ends"] == {
        "stopped": 0, "left_terrain": 0, "limit": 0, "structure:wall": 5,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        (f"{EAST + 500},{NORTH + 40},480,0.4,1", "row 2: There is no terrain|is beside the terrain"),
        (f"{EAST + 500},{NORTH + 40},,0.4,1", "row 2: There is no terrain under this release"),
        (f"{EAST + 10},{NORTH + 40},480,0.4,1", "row 2: This release is 1[0-9]"),
        (f"{EAST + 10},{NORTH + 40},,-1,1", "row 2: The diameter is -1"),
        (f"{EAST + 10},{NORTH + 40},,0.4,0", "row 2: The number of blocks is 0"),
        (f"{EAST + 10},{NORTH + 40},,0.4,1.5", "row 2: The number of blocks is 1.5"),
        (f"{EAST + 10},wide,,0.4,1", "row 2: .*wide"),
        (
            f"{EAST + 10},{NORTH + 40},,0.4,1000000000",
            "1000000000 blocks are too many for this memory",
        ),
    ],
)
def test_bad_releases(terrain: Path, tmp_path: Path, capsys, row: str, problem: str) -> None:
    path = tmp_path / "releases.csv"
    path.write_text(f"x_m,y_m,z_m,diameter_m,number\n{row}\n", encoding="utf-8")
    out = tmp_path / "out"
    argv = ["simulate", str(path), "--terrain", str(terrain), "--model", "noel_2017", "--out", str(out)]
    assert main(argv) == 1
    assert re.search(problem, capsys.readouterr().err)
    assert not out.exists()


def test_bad_structures(terrain: Path, releases: Path, tmp_path: Path, capsys) -> None:
    argv = [
        "simulate",
        str(releases),
        "--terrain",
        str(terrain),
        "--model",
        "noel_2017",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*argv, "--structure", "wall"]) == 1
    assert "--structure wall names no file" in capsys.readouterr().err
    far = tmp_path / "far.ply"
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    write_ply(Surface(corners, np.array([[0, 1, 2]], np.int32), GlobalShift(), "far"), far)
    assert main([*argv, "--structure", f"wall={far}"]) == 1
    assert "stands nowhere near the terrain" in capsys.readouterr().err


def test_a_full_disk_leaves_nothing(terrain: Path, releases: Path, tmp_path: Path, capsys) -> None:
    """A real limit on the size of files, which fails in the middle of a table as a full disk does."""
    resource = pytest.importorskip("resource")
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "noel_2017"]
    out = tmp_path / "new" / "out"
    assert main([*argv, "--out", str(tmp_path / "before")]) == 0
    assert (tmp_path / "before" / "impacts.csv").stat().st_size > 20_000
    capsys.readouterr()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))
    try:
        status = main([*argv, "--out", str(out)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 1
    assert f"cannot be written ({os.strerror(errno.EFBIG)}). Make room" in capsys.readouterr().err
    assert not out.parent.exists()


def test_simulated_impacts_are_read_as_measured_ones_are(terrain: Path, releases: Path, tmp_path: Path) -> None:
    """Compared with the model that made them, a model without chance repeats each of them, to the written decimals."""
    simulated = tmp_path / "simulated"
    argv = ["simulate", str(releases), "--terrain", str(terrain), "--model", "pfeiffer_bowen_1989"]
    assert main([*argv, "--record", "impacts", "--out", str(simulated)]) == 0
    table, compared = simulated / "impacts.csv", tmp_path / "compared"
    chosen = ["--model", "pfeiffer_bowen_1989", "--tables-only", "--spin", "table", "--replicates", "0"]
    assert main(["compare", str(table), *chosen, "--out", str(compared)]) == 0
    impacts, predicted = rows_of(table), rows_of(compared / "predictions.csv")
    assert len(predicted) == len(impacts) > 20
    for name in ("v2x_mps", "v2y_mps", "v2z_mps", "rn", "theta_dev_deg"):
        made, again = (np.sort([float(row[name]) for row in rows]) for rows in (impacts, predicted))
        np.testing.assert_allclose(made, again, atol=1e-3 if name == "theta_dev_deg" else 2e-5)
    fitted = ["--model", "azimi_desvarreux_1977", "--fit", "rn", "--out", str(tmp_path / "fitted")]
    assert main(["calibrate", str(table), *fitted]) == 0
    merged = tmp_path / "merged"
    assert main(["merge", str(table), "--site", "slope", "--out", str(merged)]) == 0
    kept = rows_of(merged / "impacts.csv")
    twice = rows_of(merged / "duplicates.csv") if (merged / "duplicates.csv").exists() else []
    assert len(kept) + len(twice) == len(impacts)
    assert {"run", "structure"} <= set(kept[0])


def test_an_interrupted_simulation_keeps_and_says_what_is_finished(
    terrain: Path, tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "releases.csv"
    path.write_text(f"x_m,y_m,number\n{EAST + 10},{NORTH + 40},300\n", encoding="utf-8")
    argv = ["simulate", str(path), "--terrain", str(terrain), "--model", "noel_2017", "--record", "none"]
    assert main([*argv, "--out", str(tmp_path / "whole")]) == 0

    def told(self: PrintedProgress, text: str, done: int = 0, total: int = 0) -> None:
        if total == 300 and done and not interrupted:
            interrupted.append(done)
            signal.raise_signal(signal.SIGINT)

    interrupted: list[int] = []
    monkeypatch.setattr(PrintedProgress, "__call__", told)
    capsys.readouterr()
    assert main([*argv, "--threads", "1", "--out", str(tmp_path / "cut")]) == 128 + signal.SIGINT
    runs, whole = (rows_of(tmp_path / name / "runs.csv") for name in ("cut", "whole"))
    assert 0 < len(runs) < 300
    assert runs == whole[: len(runs)]
    said = f"Stopped by you: {len(runs)} of 300 blocks with Noël et al. 2017 are finished and kept."
    printed = capsys.readouterr()
    assert said in printed.out
    assert printed.err == f"rockfall: interrupted, what was finished is written in {tmp_path / 'cut'}.\n"
    summary = json.loads((tmp_path / "cut" / "summary.json").read_text(encoding="utf-8"))
    assert (summary["blocks_wanted"], sum(summary["models"]["noel_2017"]["ends"].values())) == (300, len(runs))
