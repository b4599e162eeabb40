# SPDX-License-Identifier: GPL-3.0-or-later
"""A saved .blend in the place of a project. A process that stands for Blender writes the demo's project here; what the
real one writes is tested in tests/blender."""

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import rockfall
from rockfall.core import cli
from rockfall.core.blender_process import inside_blender
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import read_project, write_project
from rockfall.core.exchange.saved_blend import is_project, keep_files, saved_blends
from rockfall.core.exchange.sweep import find_jobs

DEMO = Path(rockfall.__file__).parent / "assets" / "demo"
STANDS_FOR_BLENDER = """
import json, shutil, sys
from pathlib import Path
job = json.loads(sys.argv[1])
folder = Path(job["folder"])
with open({count!r}, "a") as stream:
    stream.write(job["blend"] + "\\n")
shutil.copytree({demo!r}, folder)
print("rockfall remark Trajectory 'X' is left out.")
"""


@pytest.fixture
def calls(tmp_path: Path) -> Iterator[Path]:
    """A file with a line for each time that Blender is started."""
    file = tmp_path / "calls"
    file.write_text("")
    script = STANDS_FOR_BLENDER.format(count=str(file), demo=str(DEMO))
    token = inside_blender.set((sys.executable, "-c", script))
    yield file
    inside_blender.reset(token)


@pytest.fixture
def blend(tmp_path: Path) -> Path:
    file = tmp_path / "a slope.BLEND"
    file.write_bytes(b"BLENDER")
    return file


def test_a_command_reads_a_blend_as_its_project(
    calls: Path, blend: Path, tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    for source, out in ((blend, "of_blend"), (DEMO / "project.toml", "of_project")):
        assert cli.main(["reconstruct", str(source), "--out", str(tmp_path / out)]) == 0
    said = capsys.readouterr().out
    assert "a slope.BLEND: Trajectory 'X' is left out." in said.splitlines()
    tables = [(tmp_path / out / "impacts.csv").read_bytes() for out in ("of_blend", "of_project")]
    assert tables[0] == tables[1]
    assert calls.read_text().splitlines() == [str(blend)]
    assert list(temporary.iterdir()) == []


def test_a_command_that_reads_it_twice_starts_blender_once(calls: Path, blend: Path, tmp_path: Path) -> None:
    assert cli.main(["web", str(blend), "--out", str(tmp_path / "page")]) == 0
    assert len(calls.read_text().splitlines()) == 1


def test_the_record_of_a_simulation_names_the_blend(calls: Path, blend: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert cli.main(["simulate", str(blend), "--number", "1", "--model", "noel_2017", "--out", str(out)]) == 0
    assert json.loads((out / "summary.json").read_text())["inputs"]["project"]["file"] == blend.name


def test_files_of_a_blend_stay_with_a_project_that_names_them(calls: Path, blend: Path, tmp_path: Path) -> None:
    """What Blender wrote is gone when the command ends; other files keep their places."""
    out = tmp_path / "out"
    out.mkdir()
    with saved_blends(print):
        project = read_project(blend)
        write_project(keep_files(project, blend, out), out / "project.toml")
    again = read_project(out / "project.toml")
    assert again.picks is not None
    assert again.terrain is not None
    assert again.picks.read_bytes() == (DEMO / "picks.csv").read_bytes()
    assert [file.parent.name for file in (again.picks, *again.terrain.files)] == [blend.name] * 2
    untouched = read_project(DEMO / "project.toml")
    assert keep_files(untouched, DEMO / "project.toml", out) is untouched


@pytest.mark.parametrize(
    ("script", "match"),
    [
        ("print('rockfall error It holds nothing.'); raise SystemExit(1)", r"It holds nothing\."),
        ("pass", r"Blender has written no project of this file\. Open it in Blender"),
        ("import os; os._exit(7)", r"Blender stopped .*status 7.*Open it in Blender and save it again"),
    ],
)
def test_what_is_wrong_with_a_blend_is_said(
    blend: Path, tmp_path: Path, capsys: pytest.CaptureFixture, script: str, match: str
) -> None:
    token = inside_blender.set((sys.executable, "-c", script))
    try:
        assert cli.main(["motion", str(blend), "--out", str(tmp_path / "out")]) == 1
    finally:
        inside_blender.reset(token)
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith(f"rockfall: {blend}: ")
    assert re.search(match, said.removeprefix(f"rockfall: {blend}: "))
    assert not (tmp_path / "out").exists()


def test_outside_of_a_command_a_blend_is_refused(blend: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"Export the project"):
        read_project(blend)
    with saved_blends(print), pytest.raises(InputError, match="There is no such file"):
        read_project(tmp_path / "none.blend")


def test_projects_are_known_by_their_endings(blend: Path) -> None:
    assert [is_project(name) for name in ("a.toml", blend, "picks.csv", "a.blend1")] == [True, True, False, False]
    (blend.parent / "b.toml").write_text("schema = 1")
    assert [job.name for job in find_jobs(blend.parent)] == ["a slope", "b"]
