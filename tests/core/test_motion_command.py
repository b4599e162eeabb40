# SPDX-License-Identifier: GPL-3.0-or-later
"""`rockfall motion`: tables and figures of a project, against the tables of other commands and by hand."""

import csv
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.analysis.motion_figures import motion_figure, save_motion_figures
from rockfall.core.analysis.motion_graphs import FrameScale, from_start, motion_courses
from rockfall.core.cli import main
from rockfall.core.footage.clock import Clock
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

ASSETS = Path(__file__).parents[2] / "assets"
TWO_CAMERAS, DEMO = ASSETS / "examples" / "two_cameras" / "project.toml", ASSETS / "demo" / "project.toml"
FOOTAGE = ASSETS / "demo" / "footage" / "project.toml"


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_motion_and_residuals_of_what_was_refined(tmp_path: Path) -> None:
    """The residuals are those that the fit leaves, the speeds and energies those of its impacts."""
    runs = ["run_0068", "run_1204"]
    fitted, made = tmp_path / "fitted", tmp_path / "made"
    assert main(["refine", str(TWO_CAMERAS), "--sigma-aim", "0", "--trajectory", *runs, "--out", str(fitted)]) == 0
    assert (
        main(["motion", str(fitted / "project.toml"), "--trajectory", *runs, "--out", str(made), "--tables-only"]) == 0
    )
    left = {(r["trajectory"], r["video"], f"{float(r['time_s']):.5f}"): r for r in table(fitted / "residuals.csv")}
    found = [row for row in table(made / "track_residuals.csv") if row["residual_px"]]
    assert len(found) > 60
    for row in found:
        other = left[row["trajectory"], row["video"], f"{float(row['video_time_s']):.5f}"]
        assert float(row["residual_u_px"]) == pytest.approx(float(other["residual_u_px"]), abs=0.02)
        assert float(row["residual_v_px"]) == pytest.approx(float(other["residual_v_px"]), abs=0.02)
    motion = table(made / "motion.csv")
    compared = 0
    for impact in table(fitted / "impacts.csv"):
        here = [
            r
            for r in motion
            if r["trajectory"] == impact["trajectory"] and r["time_s"] == f"{float(impact['time_s']):.6f}"
        ]
        if len(here) == 2 and impact["kinetic1_J"] and impact["kinetic2_J"]:
            assert [float(row["kinetic_J"]) for row in here] == pytest.approx(
                [float(impact["kinetic1_J"]), float(impact["kinetic2_J"])], abs=1e-5
            )
            compared += 1
    assert compared >= 2
    assert not (made / "figures").exists()


def test_figures_of_a_project_without_videos(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    out = tmp_path / "out"
    assert main(["motion", str(DEMO), "--trajectory", "B01", "B10", "--format", "svg", "--out", str(out)]) == 0
    assert {path.name for path in (out / "figures").iterdir()} == {"motion.svg", "motion_B01.svg", "motion_B10.svg"}
    text = (out / "figures" / "motion_B01.svg").read_text(encoding="utf-8")
    assert "Speed [m/s]" in text
    assert "Residual" not in text  # nothing was tracked
    assert "Frame of" not in text
    assert "B10: up to" in capsys.readouterr().out
    assert not (out / "track_residuals.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([str(DEMO), "--trajectory", "B99"], "There is no trajectory 'B99'. The picks have: B01"),
        ([str(FOOTAGE)], "rockfall refine makes them from the tracks"),
    ],
)
def test_bad_input_is_told_and_leaves_nothing(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["motion", *arguments, "--out", str(tmp_path / "out")]) == 1
    assert said.split(". ")[0] in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_frames_are_those_of_a_jittery_video() -> None:
    """Pictures 10, 11, 12 and 20 of a video that runs eight times slower than it was taken."""
    scale = FrameScale("v", Clock(5.0, rate=1 / 8), np.array([1.0, 1.04, 1.1, 1.5]), np.array([10.0, 11.0, 12.0, 20.0]))
    common = 5.0 + np.array([0.9, 1.0, 1.02, 1.3, 1.6]) / 8
    np.testing.assert_allclose(scale.frames(common), [8.0, 10.0, 10.5, 16.0, 22.0])
    np.testing.assert_allclose(scale.times(scale.frames(common)), common)


def test_figures_have_the_values(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    times = [0.0, 1.0, 2.5]
    picks = make_picks(
        ["a/1"] * 3 + ["A?1"] * 3 + ["lonely"], [*times, *np.add(times, 60.0), 7.0],
        [[0, 0, 0], [5, 0, -3], [15, 0, -9]] * 2 + [[0, 0, 0]],
    )  # fmt: skip
    courses = motion_courses(reconstruct(picks))
    files = save_motion_figures(courses, tmp_path, formats=("svg",))
    assert [file.name for file in files] == ["motion.svg", "motion_a_1.svg", "motion_A_1_2.svg"]
    figure = motion_figure([from_start(one) for one in courses])
    speed = figure.axes[0]
    lines = [line.get_xydata() for line in speed.lines if len(line.get_xydata()) > 2]
    np.testing.assert_allclose(lines[0], lines[1])
    first = lines[0][0]
    assert first.tolist() == pytest.approx([0.0, np.hypot(5.0, -3.0 + 9.81 / 2)])
    empty = motion_figure(courses[2:])
    assert "no motion is known" in [text.get_text() for text in empty.axes[0].texts]
