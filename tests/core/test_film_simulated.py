# SPDX-License-Identifier: GPL-3.0-or-later
"""Films with simulated blocks as far as they are numbers and words: how long, how many, the legend, refusals."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core import cli
from rockfall.core.colours import MEASURED_COLOUR, srgb_to_linear
from rockfall.core.errors import InputError
from rockfall.core.film import maker as maker_module
from rockfall.core.film.job import FilmJob
from rockfall.core.film.maker import FilmMaker, inside_blender
from rockfall.core.film.simulated import (
    LONGEST_WAIT_S,
    MOST_BLOCKS,
    Group,
    check_number,
    group_name,
    last_moment,
    legend,
    path_opacity,
)
from rockfall.core.film.wording import simulated_lines
from rockfall.core.impact_models.registry import MODELS

REAL = Group("measured", MEASURED_COLOUR, np.array([4.0, 6.0, 5.0]), np.array([True, False, True]), lost=1)


def model(end_s: list[float], stopped: list[bool], left: int = 0) -> Group:
    return Group("A model", (0.1, 0.2, 0.3), np.array(end_s), np.array(stopped), left)


def test_the_film_waits_for_the_last_block_but_not_for_ever() -> None:
    assert last_moment(6.0, []) == 6.0
    assert last_moment(6.0, [model([3.0, 2.0], [True, True])]) == 6.0
    assert last_moment(6.0, [model([9.5, 2.0], [True, True]), model([7.0], [True])]) == 9.5
    assert last_moment(6.0, [model([5000.0], [True])]) == 6.0 + LONGEST_WAIT_S


def test_the_legend_counts_the_blocks_that_have_stopped_by_each_moment() -> None:
    moments = np.array([0.0, 3.999, 4.0, 5.5, 9.0])
    measured, simulated = legend(REAL, [model([5.5, 1.0, 8.0, 9.0], [True, True, False, True], left=1)], moments, 9.0)
    assert (measured.name, measured.text, measured.unit) == ("measured", "3 blocks, 1 goes out of sight, ", " stopped")
    assert measured.counts is not None
    assert simulated.counts is not None
    assert measured.counts.tolist() == [0, 0, 1, 2, 2]
    assert simulated.counts.tolist() == [0, 1, 1, 2, 3]
    assert (simulated.name, simulated.text) == ("A model", "simulated: 4 blocks, 1 leaves the terrain, ")


def test_the_legend_accounts_for_every_block() -> None:
    """Those that never stop in the film are told by what became of them; together they are all."""
    group = model([5.0, 70.0, 2.0, 3.0, 4.0], [True, True, False, False, False], left=2)
    (_, entry) = legend(REAL, [group], np.array([60.0]), 60.0)
    assert entry.text == "simulated: 5 blocks, 2 leave the terrain, 1 is cut off, 1 moves on, "
    assert entry.counts is not None
    assert entry.counts.tolist() == [1]  # 2 + 1 + 1 + 1 = 5


def test_one_block_and_one_model_are_told_as_one() -> None:
    (entry, _) = legend(Group("x", (0, 0, 0), np.ones(1), np.ones(1, bool)), [model([1.0], [True])], np.ones(1), 1.0)
    assert entry.text == "1 block, "
    assert simulated_lines(1, 1)[0] == "1 measured block (white), and simulated ones by a model"
    assert simulated_lines(15, 2)[0] == "15 measured blocks (white), and simulated ones by 2 models"


def test_a_model_without_chance_is_told() -> None:
    assert group_name(MODELS["azimi_desvarreux_1977"]) == f"{MODELS['azimi_desvarreux_1977'].title}, without chance"
    assert group_name(MODELS["noel_2017"]) == MODELS["noel_2017"].title


def test_paths_get_fainter_as_they_get_more() -> None:
    opacity = [path_opacity(n) for n in (1, 15, 300, 600, 10_000)]
    assert opacity == sorted(opacity, reverse=True)
    assert opacity[0] < 1
    assert opacity[-1] > 0.02


def test_measured_blocks_have_a_colour_of_their_own() -> None:
    """By luminance, which every colour vision sees."""
    weights = np.array([0.2126, 0.7152, 0.0722])
    white = float(weights @ srgb_to_linear(np.array(MEASURED_COLOUR)))
    for each in MODELS.values():
        assert white - float(weights @ srgb_to_linear(np.array(each.colour))) > 0.15, each.name


@pytest.mark.parametrize(
    ("number", "message"), [(0, "none to show. Give --number 1"), (MOST_BLOCKS, rf"up to {MOST_BLOCKS}. Give --number")]
)
def test_numbers_that_cannot_be_shown(number: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_number(number, 2, 15)
    check_number(MOST_BLOCKS // 30, 2, 15)


def test_the_job_travels_whole() -> None:
    job = FilmJob("film", Path("p.toml"), Path("f.mp4"), simulate=("noel_2017", "stevens_1998"), number=7, seed=3)
    assert FilmJob.from_json(job.to_json()) == job


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "project.toml").write_text('schema = 1\n[terrain]\nfile = "t.ply"\n', encoding="utf-8")
    (tmp_path / "t.ply").write_bytes(b"ply")
    return tmp_path / "project.toml"


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch):
    """What Blender is asked to make, which is made at once."""
    asked = []

    def make(job: FilmJob, report: object) -> tuple[str, ...]:
        asked.append(job)
        job.out.write_bytes(b"a film")
        return ("2 of 9 blocks were cut off.",)

    monkeypatch.setattr(maker_module, "require_blender_libraries", lambda: None)
    token = inside_blender.set(FilmMaker(make, ("/no/such/program",)))
    yield asked
    inside_blender.reset(token)


def test_the_command_asks_for_simulated_blocks(
    project: Path, jobs: list[FilmJob], capsys: pytest.CaptureFixture
) -> None:
    out = str(project.parent / "film")
    asked = ["--simulate", "noel_2017", "--simulate", "stevens_1998", "--simulate", "noel_2017"]
    assert cli.main(["render", str(project), *asked, "--set", "noel_2017.rt=0.5", "--out", out]) == 0
    assert cli.main(["render", str(project), *asked[:2], "--number", "5", "--seed", "9", "--slope", "--out", out]) == 0
    first, second = jobs
    assert capsys.readouterr().out.startswith("2 of 9 blocks were cut off.")
    assert (first.kind, first.simulate, first.number, first.seed) == ("film", ("noel_2017", "stevens_1998"), 20, 0)
    assert {name: float(value) for name, value in first.parameters["noel_2017"].items()} == {"rt": 0.5}
    assert (second.kind, second.simulate, second.number, second.seed) == ("slope", ("noel_2017",), 5, 9)
    assert (project.parent / "film" / "slope.png").is_file()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--simulate", "noel_2071"], "There is no impact model 'noel_2071'. Did you mean noel_2017?"),
        (["--simulate", "noel_2017", "--number", "0"], "Give --number 1 or more"),
        (["--simulate", "noel_2017", "--number", "1000000"], f"up to {MOST_BLOCKS}"),
        (["--simulate", "noel_2017", "--model", "noel_2017"], "two kinds of blocks"),
        (["--number", "3"], "Add --simulate and a model"),
        (["--simulate", "noel_2017", "--set", "noel_2017.rtt=1"], "rtt"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_made(
    project: Path, jobs: list[FilmJob], options: list[str], message: str, capsys: pytest.CaptureFixture
) -> None:
    assert cli.main(["render", str(project), *options, "--out", str(project.parent / "film")]) == 1
    assert message in capsys.readouterr().err
    assert not jobs
    assert not (project.parent / "film").exists()


def test_a_project_without_terrain_has_nowhere_to_fall(
    project: Path, jobs: list[FilmJob], capsys: pytest.CaptureFixture
) -> None:
    project.write_text("schema = 1\n", encoding="utf-8")
    assert cli.main(["render", str(project), "--simulate", "noel_2017", "--out", str(project.parent / "film")]) == 1
    error = capsys.readouterr().err
    assert "fall on a terrain, and the project names none" in error
    assert "project.toml" in error
    assert not jobs
