# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch: every project its own folder; bad ones are reported, finished ones not done again, half ones not there."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.children import rockfall_command
from rockfall.core.cli import main
from rockfall.core.commands.progress import PrintedProgress
from rockfall.core.errors import InputError
from rockfall.core.exchange.batch import Batch, Outcome, run_batch
from rockfall.core.exchange.job_inputs import digest_of, input_files, input_hashes
from rockfall.core.exchange.sweep import Job, find_jobs
from rockfall.core.georeference import GlobalShift
from rockfall.core.progress import CancelledError
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

MADE_BY = {"rockfall": "1", "numpy": "2"}
WRITES = "import sys, pathlib; pathlib.Path(sys.argv[2], 'copy.txt').write_text(open(sys.argv[1]).read())"
"""A command: the project is copied into the output, after what a test adds."""


@pytest.fixture
def sites(tmp_path: Path) -> Path:
    """Three projects, each a plane on which blocks are released."""
    vertices = np.array([[x, y, -0.6 * x] for y in (0.0, 50.0) for x in (0.0, 50.0)])
    for number, name in enumerate(("east", "north", "west")):
        folder = tmp_path / "sites" / name
        folder.mkdir(parents=True)
        write_ply(
            Surface(vertices, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane"),
            folder / "terrain.ply",
        )
        (folder / "project.toml").write_text(
            f'schema = 1\n[terrain]\nfile = "terrain.ply"\n[simulation]\nmodels = ["noel_2017"]\nseed = {number}\n'
            'record = []\n[simulation.releases]\nfrom = "points"\npoints_m = [[5.0, 20.0]]\nnumber = 5\n'
        )
    return tmp_path / "sites"


def outcomes(out: Path) -> dict[str, dict]:
    content = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return {one["job"]: one for one in content["jobs"]}


def run(batch: Batch, code: str = WRITES, **options) -> dict[str, Outcome]:
    def command(job: Job, draft: Path) -> list[str]:
        return [sys.executable, "-c", code, str(job.project), str(draft)]

    return {one.job: one for one in run_batch(batch, command, **options)}


def batch_of(sites: Path, out: Path) -> Batch:
    return Batch("copy", (), find_jobs(sites), out, MADE_BY)


def test_a_bad_project_is_said_first_and_the_others_are_done(sites, tmp_path, capsys):
    (sites / "north" / "project.toml").write_text("schema = 1\n[terrain\n")
    out = tmp_path / "out"
    arguments = ["batch", str(sites), "simulate", "--number", "3", "--jobs", "2", "--out", str(out)]
    assert main(arguments) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "1 of 3 jobs failed:"
    assert lines[1].startswith("  north: ")
    assert "row 2" in lines[1]
    assert lines[2] == "2 of 3 jobs done."
    found = outcomes(out)
    assert {name: one["state"] for name, one in found.items()} == {"east": "done", "north": "failed", "west": "done"}
    assert not (out / "north").exists()
    for name in ("east", "west"):
        assert len((out / name / "runs.csv").read_text().splitlines()) == 1 + 3
        assert str(out / name) in found[name]["message"]
    (sites / "north" / "project.toml").write_text((sites / "west" / "project.toml").read_text())
    before = (out / "east" / "runs.csv").stat().st_mtime_ns
    assert main(arguments) == 0
    assert {name: one["state"] for name, one in outcomes(out).items()} == {
        "east": "already done", "north": "done", "west": "already done",
    }  # fmt: skip
    assert (out / "east" / "runs.csv").stat().st_mtime_ns == before
    assert (out / "north" / "runs.csv").read_bytes() == (out / "west" / "runs.csv").read_bytes()


def test_what_decides_a_job_is_the_content_of_its_files_its_options_and_the_versions(sites):
    project = sites / "east" / "project.toml"
    zones = sites / "zones.csv"
    zones.write_text("a")

    def digest(*options: str, made_by: dict[str, str] = MADE_BY) -> str:
        return digest_of("simulate", options, input_hashes(input_files(project, options)), made_by)

    first = digest("--zones", str(zones))
    assert set(input_files(project, ["--zones", str(zones)])) == {"project.toml", "terrain.ply", str(zones)}
    assert digest("--zones", str(zones)) == first
    zones.write_text("b")
    changed = {first, digest("--zones", str(zones)), digest(), digest(made_by={"rockfall": "2", "numpy": "2"})}
    with (sites / "east" / "terrain.ply").open("ab") as stream:
        stream.write(b" ")
    assert len(changed | {digest()}) == 5


def test_a_job_with_other_inputs_replaces_its_older_output(sites, tmp_path):
    out = tmp_path / "out"
    assert {one.state for one in run(batch_of(sites, out)).values()} == {"done"}
    (out / "east" / "copy.txt").rename(out / "east" / "mine.txt")  # a folder that is no longer whole
    (sites / "west" / "project.toml").write_text("other")
    done = run(batch_of(sites, out), WRITES.replace("copy", "new"))
    assert {name: one.state for name, one in done.items()} == {
        "east": "done", "north": "already done", "west": "done",
    }  # fmt: skip
    assert sorted(one.name for one in (out / "west").iterdir()) == ["job.json", "new.txt"]
    assert (out / "east" / "mine.txt").exists()


def test_a_job_that_fails_keeps_what_was_made_of_other_inputs_and_says_so(sites, tmp_path):
    out = tmp_path / "out"
    run(batch_of(sites, out))
    (sites / "west" / "project.toml").write_text("other")
    west = run(batch_of(sites, out), "raise SystemExit('rockfall: It is bad.')")["west"]
    assert west.state == "failed"
    assert west.output is None
    assert west.message == "It is bad. The output that is there was made of other inputs."
    assert (out / "west" / "copy.txt").exists()


def test_a_batch_that_is_stopped_keeps_what_is_finished_and_nothing_else(sites, tmp_path):
    out = tmp_path / "out"
    slow = f"{WRITES}; import time; time.sleep(100 * ('north' in sys.argv[1]))"

    def stop_at_the_second(text: str, done: int, total: int) -> None:
        if done == 1 and (out / ".north.part" / "north" / "copy.txt").exists():
            raise CancelledError

    stopped = run(batch_of(sites, out), slow, progress=stop_at_the_second)
    assert [one.state for one in stopped.values()] == ["done", "not run", "not run"]
    assert [one.name for one in out.iterdir()] == ["east"]
    assert [one.state for one in run(batch_of(sites, out)).values()] == ["already done", "done", "done"]


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_batch_that_was_killed_goes_on_and_ends_as_if_it_had_not_been(sites, tmp_path):
    out, whole = tmp_path / "out", tmp_path / "whole"
    slow = f"{WRITES}; import time; time.sleep(100 * ('north' in sys.argv[1]))"
    code = (
        "import sys\nfrom pathlib import Path\nfrom rockfall.core.exchange.sweep import find_jobs\n"
        "from rockfall.core.exchange.batch import Batch, run_batch\n"
        f"slow = 'from rockfall.core.children import end_with_parent; end_with_parent(); ' + {slow!r}\n"
        f"run_batch(Batch('copy', (), find_jobs({str(sites)!r}), Path({str(out)!r}), {MADE_BY!r}), lambda job, draft: "
        "[sys.executable, '-c', slow, str(job.project), str(draft)])\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    half = out / ".north.part" / "north" / "copy.txt"
    while not half.exists():
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (out / "north").exists()
    resumed = run(batch_of(sites, out))
    assert [one.state for one in resumed.values()] == ["already done", "done", "done"]
    run(batch_of(sites, whole))
    for name in resumed:
        assert (out / name / "copy.txt").read_bytes() == (whole / name / "copy.txt").read_bytes()
    assert sorted(one.name for one in out.iterdir()) == sorted(resumed)


def test_a_sweep_is_every_combination_with_the_parameters_of_its_model(sites, tmp_path):
    file = tmp_path / "sweep.toml"
    file.write_text(
        'schema = 1\nprojects = ["sites/*/project.toml"]\n[options]\nmodel = ["noel_2017", "stevens_1998"]\n'
        'diameter = [0.3, "0.3..0.6"]\ndrag = [true, false]\nnumber = 7\n[parameters.stevens_1998]\nrn = [0.3, 0.35]\n'
    )
    jobs = find_jobs(file)
    assert len(jobs) == 3 * 2 * 2 * (1 + 2)
    assert len({job.name for job in jobs}) == len(jobs)
    assert jobs[0] == Job(
        "east,model=noel_2017,diameter=0.3,drag=true",
        sites / "east" / "project.toml",
        ("--model", "noel_2017", "--diameter", "0.3", "--drag", "--number", "7"),
    )
    assert jobs[-1].options == (
        "--model", "stevens_1998", "--diameter", "0.3..0.6", "--number", "7", "--set", "stevens_1998.rn=0.35",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("schema = 1", "projects is missing"),
        ("projects = ['a.toml']", "schema is None"),
        ("schema = 1\nprojects = []", "projects is empty"),
        ("schema = 1\nprojects = ['*/nothing.toml']", "which no file is like"),
        ("schema = 1\nprojects = ['a.toml']\nseeds = [1]", "seeds is not known"),
        ("schema = 1\nprojects = ['a.toml']\n[options]\nseed = []", "options.seed is an empty list"),
        ("schema = 1\nprojects = ['a.toml']\n[options]\nseed = [{}]", "options.seed has {}"),
        ("schema = 1\nprojects = ['a.toml']\nparameters = 3", "are not sections of models"),
        ("schema = 1\nprojects = ['a.toml']\n[options]\nmodel = 'a'\n[parameters.b]\nx = 1", "does not run"),
        ("schema = 1\nprojects = ['x/project.toml', 'y/x.toml']", "would write into the folder x"),
        (f"schema = 1\nprojects = ['a.toml']\n[options]\nseed = {list(range(400))}\nnumber = {list(range(1, 300))}",
         "119600 combinations"),
    ],
)  # fmt: skip
def test_a_bad_sweep_is_refused_with_the_key(tmp_path, text, said):
    (tmp_path / "sweep.toml").write_text(text)
    with pytest.raises(InputError, match=r"sweep\.toml") as caught:
        find_jobs(tmp_path / "sweep.toml")
    assert said in caught.value.problem


def test_wrong_options_are_said_before_anything_runs(sites, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert main(["batch", str(sites), "simulate", "--nmber", "3", "--out", out]) == 2
    assert main(["batch", str(sites), "simulat", "--out", out]) == 1
    assert main(["batch", str(sites), "models", "--out", out]) == 1
    assert main(["batch", str(sites), "simulate"]) == 1
    assert main(["batch", str(tmp_path), "simulate", "--out", out]) == 1
    assert main(["batch", str(sites), "simulate", "--out", str(sites)]) == 1
    assert not (tmp_path / "out").exists()
    said = capsys.readouterr().err
    for words in ("no command 'simulat'", "models makes nothing", "--out is missing", "no project in this folder",
                  "in a project's own folder"):  # fmt: skip
        assert words in said


def test_places_in_the_options_stand_for_the_project(sites, tmp_path):
    """The command line is replaced by a program that writes what it was told."""
    out = tmp_path / "out"
    code = "import sys, pathlib; pathlib.Path(sys.argv[-1], 'told.txt').write_text(' '.join(sys.argv[1:-2]))"
    token = rockfall_command.set((sys.executable, "-c", code))
    try:
        assert main(["batch", str(sites), "terrain", "{folder}/terrain.ply", "--up", "z", "--out", str(out)]) == 0
    finally:
        rockfall_command.reset(token)
    assert (out / "west" / "told.txt").read_text() == f"terrain {sites / 'west'}/terrain.ply --up z"


@pytest.mark.parametrize(
    "damage",
    [
        lambda record, stranger: {**record, "files": [str(stranger)]},
        lambda record, stranger: {**record, "files": ["../../mine.txt"]},
        lambda record, stranger: {**record, "files": 5},
        lambda record, stranger: {**record, "files": [5]},
        lambda record, stranger: {**record, "seconds": "long"},
        lambda record, stranger: {name: value for name, value in record.items() if name != "files"},
        lambda record, stranger: [record],
    ],
)
def test_a_damaged_record_of_a_job_does_it_again_and_removes_nothing_elsewhere(sites, tmp_path, damage):
    out, stranger = tmp_path / "out", tmp_path / "mine.txt"
    stranger.write_text("mine")
    run(batch_of(sites, out))
    record = json.loads((out / "west" / "job.json").read_text())
    (out / "west" / "job.json").write_text(json.dumps(damage(record, stranger)))
    with (sites / "west" / "project.toml").open("a") as project:
        project.write("# other")
    assert run(batch_of(sites, out))["west"].state == "done"
    assert stranger.read_text() == "mine"
    assert run(batch_of(sites, out))["west"].state == "already done"


def test_a_record_or_a_project_that_is_nested_too_deeply_ends_no_batch(sites, tmp_path):
    run(batch_of(sites, tmp_path / "out"))
    (tmp_path / "out" / "west" / "job.json").write_text("[" * 200_000)
    (sites / "east" / "project.toml").write_text("a = " + "[" * 200_000)
    found = run(batch_of(sites, tmp_path / "out"))
    assert {name: one.state for name, one in found.items()} == {
        "east": "done", "north": "already done", "west": "done",
    }  # fmt: skip


def cut_short(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-5])


def changed(file: Path) -> None:
    file.write_bytes(file.read_bytes().replace(b"5", b"6"))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (cut_short, "copy.txt was not as it had been written"),
        (changed, "copy.txt was not as it had been written"),
        (Path.unlink, "copy.txt was missing"),
    ],
)
def test_a_finished_job_whose_files_differ_is_done_again_and_said(sites, tmp_path, damage, said):
    out = tmp_path / "out"
    run(batch_of(sites, out))
    first = (out / "west" / "copy.txt").read_bytes()
    (out / "west" / "notes.txt").write_text("mine")
    damage(out / "west" / "copy.txt")
    found = run(batch_of(sites, out))
    assert {name: one.state for name, one in found.items()} == {
        "east": "already done", "north": "already done", "west": "done",
    }  # fmt: skip
    assert found["west"].message == f"{said}, so it was done again.\n"
    assert (out / "west" / "copy.txt").read_bytes() == first
    assert (out / "west" / "notes.txt").read_text() == "mine"
    assert {one.state for one in run(batch_of(sites, out)).values()} == {"already done"}


@pytest.mark.skipif(os.name == "nt", reason="links")
def test_a_job_that_is_done_again_removes_nothing_behind_a_link(sites, tmp_path):
    out, photos = tmp_path / "out", tmp_path / "photos"
    deep = WRITES.replace("copy.txt", "deep/copy.txt").replace("pathlib.Path(sys", "pathlib.Path(sys")
    deep = f"import os, sys; os.mkdir(os.path.join(sys.argv[2], 'deep')); {deep}"
    run(batch_of(sites, out), deep)
    (out / "west" / "deep").rename(photos)
    (out / "west" / "deep").symlink_to(photos)
    (sites / "west" / "project.toml").write_text("other")
    west = run(batch_of(sites, out), deep)["west"]
    assert west.state == "failed"
    assert "A link is in the output" in west.message
    assert [one.name for one in photos.iterdir()] == ["copy.txt"]


@pytest.mark.skipif(os.name == "nt", reason="signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_batch_that_is_interrupted_has_the_status_of_the_signal(sites, tmp_path, monkeypatch, capsys, name):
    number, sent = getattr(signal, name), []

    def told(self, text: str, done: int = 0, total: int = 0) -> None:
        if done and not sent:
            sent.append(signal.raise_signal(number))

    monkeypatch.setattr(PrintedProgress, "__call__", told)
    out = tmp_path / "out"
    assert main(["batch", str(sites), "simulate", "--number", "1", "--out", str(out)]) == 128 + number
    assert "jobs are finished; the same command goes on with the others" in capsys.readouterr().err
    assert sum(one["state"] == "not run" for one in outcomes(out).values()) >= 1
