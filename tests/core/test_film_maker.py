# SPDX-License-Identifier: GPL-3.0-or-later
"""Engines that crash, processes that fail: told in words, and nothing is left behind."""

import sys
from pathlib import Path

import pytest
from rockfall.core import cli
from rockfall.core.blender_process import run_job
from rockfall.core.errors import DependencyError, RockfallError
from rockfall.core.film import maker as maker_module
from rockfall.core.film.engines import MEASURED, PASSED, choose_engine, probe, probe_script
from rockfall.core.film.job import AS_SET_UP, FilmJob
from rockfall.core.film.maker import OTHER_ENGINE, FilmMaker, film_maker, inside_blender
from rockfall.core.progress import CancelledError

KILL_YOURSELF = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"]
ANSWER = "print('chatter'); print('{} {}')"


def says(kind: str) -> list[str]:
    return [sys.executable, "-c", ANSWER.format(PASSED, kind)]


def test_probe_script_is_python_for_each_engine() -> None:
    for engine in ("workbench", "eevee", "cycles"):
        compile(probe_script(engine), engine, "exec")


def test_auto_takes_workbench_on_a_graphics_card_only() -> None:
    assert choose_engine("auto", says("NVIDIA")) == "workbench"
    assert choose_engine("auto", says("SOFTWARE")) == MEASURED
    assert choose_engine(MEASURED, KILL_YOURSELF) == MEASURED


def test_a_probe_that_crashes_or_hangs_means_cycles() -> None:
    assert choose_engine("auto", KILL_YOURSELF) == "cycles"
    assert choose_engine("auto", [sys.executable, "-c", "import time; time.sleep(60)"], limit_s=0.3) == "cycles"
    assert choose_engine("auto", ["/no/such/program"]) == "cycles"
    assert not probe([sys.executable, "-c", "print('not our words')"]).works


def test_an_engine_that_is_asked_for_must_work() -> None:
    assert choose_engine("cycles", KILL_YOURSELF) == "cycles"
    assert choose_engine("eevee", says("SOFTWARE")) == "eevee"
    with pytest.raises(DependencyError, match=r"workbench does not work on this machine.*--engine cycles"):
        choose_engine("workbench", KILL_YOURSELF)


def test_the_probe_gets_the_script() -> None:
    command = [
        sys.executable,
        "-c",
        "import sys; assert 'BLENDER_WORKBENCH' in sys.argv[1]; " + ANSWER.format(PASSED, "X"),
        "{probe}",
    ]
    assert choose_engine("auto", command) == "workbench"


def test_the_progress_of_a_process_is_reported() -> None:
    seen = []
    script = (
        "print('error of an add-on'); print('progress bar'); print('rockfall progress 0 9 Simulating a model'); "
        "print('rockfall progress 2 2 Rendering'); print('rockfall remark 3 blocks stopped.')"
    )
    remarks = run_job([sys.executable, "-c", script], "x.mp4", lambda *said: seen.append(said), "")
    assert remarks == ("3 blocks stopped.",)
    assert list(dict.fromkeys(seen)) == [("Starting Blender", 0, 0), ("Simulating a model", 0, 9), ("Rendering", 2, 2)]


def test_a_process_that_says_nothing_is_ended_when_a_person_wants_it() -> None:
    asked, script = [], "import time; print('rockfall progress 1 9 Rendering', flush=True); time.sleep(600)"

    def stop(*said: object) -> None:
        asked.append(said)
        if asked.count(("Rendering", 1, 9)) == 2:
            raise CancelledError

    with pytest.raises(CancelledError):
        run_job([sys.executable, "-c", script], "x.mp4", stop, "")


def test_what_a_process_says_is_wrong_is_our_error() -> None:
    script = "import sys; print('rockfall error The project names no picks.'); sys.exit(1)"
    with pytest.raises(RockfallError, match=r"^The project names no picks\.$"):
        run_job([sys.executable, "-c", script], "x.mp4", lambda *_: None, OTHER_ENGINE)


def test_a_crash_is_told_with_its_last_words() -> None:
    script = "import os, signal; os.write(2, b'deep trouble'); os.kill(os.getpid(), signal.SIGSEGV)"
    with pytest.raises(RockfallError, match=r"while it made x\.mp4 \(status -11\)\. It said: deep trouble\. Try"):
        run_job([sys.executable, "-c", script], "x.mp4", lambda *_: None, OTHER_ENGINE)


def test_without_blender_the_advice_is_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maker_module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r"pip install rockfall\[blender\]"):
        film_maker()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "project.toml").write_text("schema = 1\n", encoding="utf-8")
    return tmp_path / "project.toml"


@pytest.mark.parametrize("failure", [RockfallError("Bad luck."), KeyboardInterrupt()])
def test_a_film_that_fails_leaves_nothing(
    project: Path, failure: BaseException, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def make(job: FilmJob, report: object) -> None:
        job.out.write_bytes(b"half a film")
        raise failure

    monkeypatch.setattr(maker_module, "require_blender_libraries", lambda: None)
    token = inside_blender.set(FilmMaker(make, tuple(KILL_YOURSELF)))
    try:
        status = cli.main(
            ["render", str(project), "--preset", "preview", "--out", str(project.parent / "new" / "film")]
        )
    finally:
        inside_blender.reset(token)
    assert status == (1 if isinstance(failure, RockfallError) else 130)
    assert sorted(path.name for path in project.parent.iterdir()) == ["project.toml"]


def test_a_film_that_succeeds_is_moved_into_place(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    jobs = []

    def make(job: FilmJob, report: object) -> tuple[str, ...]:
        jobs.append(job)
        job.out.write_bytes(b"a film")
        return ()

    monkeypatch.setattr(maker_module, "require_blender_libraries", lambda: None)
    out = project.parent / "film"
    token = inside_blender.set(FilmMaker(make, tuple(KILL_YOURSELF)))
    try:
        assert cli.main(["render", str(project), "--preset", "hd", "--out", str(out), "--frames", "5-9"]) == 0
        assert cli.main(["render", str(project), "--preset", "blue", "--out", str(out)]) == 1
    finally:
        inside_blender.reset(token)
    assert (out / "rockfall.mp4").read_bytes() == b"a film"
    (job,) = jobs
    assert (job.kind, job.engine, job.preset, job.frames) == ("film", "cycles", "hd", (5, 9))
    printed = capsys.readouterr()
    assert "1920×1080, rendered with Cycles" in printed.out
    assert f"{project}: There is no render preset 'blue'" in printed.err


def test_a_blend_is_rendered_as_it_says(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jobs, blend, out = [], project.with_suffix(".blend"), project.parent / "film"
    token = inside_blender.set(FilmMaker(lambda job, _: (jobs.append(job), job.out.write_bytes(b"film"), ())[-1], ()))
    try:
        assert cli.main(["render", str(blend), "--out", str(out)]) == 1
        blend.write_bytes(b"")
        assert cli.main(["render", str(blend), "--out", str(out), "--preset", "hd"]) == 1
        assert cli.main(["render", str(blend), "--out", str(out), "--frames", "5-9"]) == 0
    finally:
        inside_blender.reset(token)
    said = capsys.readouterr().err
    assert "There is no such file" in said
    assert "--preset is of a project; a .blend has its own film" in said
    assert [(job.kind, job.source, job.engine, job.frames) for job in jobs] == [("film", blend, AS_SET_UP, (5, 9))]
    assert (out / "rockfall.mp4").read_bytes() == b"film"
