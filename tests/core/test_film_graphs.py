# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs in a film: each point and line is at the right place, and there from the right moment on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.graphs import GraphSpec
from rockfall.core.analysis.motion_graphs import motion_courses
from rockfall.core.colours import MEASURED_COLOUR, SPEED_SCALE
from rockfall.core.film.framing import Margins
from rockfall.core.film.graphs import FilmGraphs, beside_graphs, impact_graphs, motion_graphs, text_height
from rockfall.core.impact_models.registry import find_model
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import Reconstruction, reconstruct

SIZE = (1280, 720)
RT = (GraphSpec("rt", "vt1_mps", "vt2_mps", x_limits=(0.0, 20.0), y_limits=(0.0, 20.0), trend="origin"),)


@pytest.fixture(scope="module")
def run() -> Reconstruction:
    """Two blocks down a plane of 30°; "b" starts 100 s later on the common clock."""
    x = np.array([0.0, 5.0, 12.0, 20.0, 26.0])
    place = np.column_stack([x, np.zeros(5), -np.tan(np.radians(30)) * x])
    time_s = np.array([0.0, 0.9, 1.8, 2.9, 3.6])
    return reconstruct(
        make_picks(
            ["a"] * 5 + ["b"] * 5,
            np.r_[time_s, 100 + time_s],
            np.vstack([place, place + np.array([0.0, 4.0, 0.0])]),
            normal=np.tile([0.5, 0.0, np.sqrt(0.75)], (10, 1)),
        )
    )


OFFSETS = {"a": 0.0, "b": 99.5}


def test_a_point_appears_at_its_impact(run: Reconstruction) -> None:
    made = impact_graphs(run.impacts, OFFSETS, SIZE, specs=RT)
    (graph,) = made.graphs
    (dots,) = graph.dots
    known = np.isfinite(run.impacts.vt1) & np.isfinite(run.impacts.vt2)
    assert dots.since_s.tolist() == pytest.approx([0.9, 1.8, 2.9, 1.4, 2.3, 3.4])
    plot = graph.frame.plot
    x = plot.left + run.impacts.vt1[known] / 20 * plot.width
    y = plot.bottom + run.impacts.vt2[known] / 20 * plot.height
    np.testing.assert_allclose(dots.place, np.column_stack([x, y]))
    (fit,) = graph.strokes
    np.testing.assert_allclose(fit.since_s, 3.4)
    slope = np.polyfit(*(fit.ends[:, 0] - [plot.left, plot.bottom]).T, 1)[0] * plot.width / plot.height
    ratio = run.impacts.vt1[known] @ run.impacts.vt2[known] / (run.impacts.vt1[known] @ run.impacts.vt1[known])
    assert slope == pytest.approx(ratio)


def test_axes_without_limits_hold_all_points_but_for_those_beyond_the_usual(run: Reconstruction) -> None:
    impacts = replace(run.impacts, rn=run.impacts.rn * np.where(np.arange(len(run.impacts)) == 1, 50.0, 1.0))
    (graph,) = impact_graphs(impacts, OFFSETS, SIZE, specs=[GraphSpec("rn", "theta1_deg", "rn")]).graphs
    assert graph.frame.y.limits == (0.0, 5.0)
    (dots,) = graph.dots
    assert len(dots.place) == np.count_nonzero(impacts.rn < 5.0)
    assert (dots.place[:, 1] <= graph.frame.plot.top).all()
    for stroke in graph.strokes:
        assert (stroke.ends[:, :, 1] <= graph.frame.plot.top + 1e-6).all()


def test_models_have_their_colours_and_links(run: Reconstruction) -> None:
    predictions = compare(run.impacts, ["noel_2017", "wyllie_2014"])
    (graph,) = impact_graphs(run.impacts, OFFSETS, SIZE, predictions, RT).graphs
    assert [dots.colour for dots in graph.dots] == [
        find_model("noel_2017").colour,
        find_model("wyllie_2014").colour,
        MEASURED_COLOUR,
    ]
    noel, _, measured = graph.dots
    links = graph.strokes[0]
    rows = [int(np.argmin(np.linalg.norm(measured.place - end, axis=1))) for end in links.ends[:, 0]]
    assert len(links.ends) == len(measured.place) < len(noel.place)  # nobody saw how the last impact of a run ended
    assert all(np.linalg.norm(noel.place - end, axis=1).min() < 1e-9 for end in links.ends[:, 1])
    np.testing.assert_allclose(links.since_s, measured.since_s[rows])


def test_filters_hide_impacts_and_the_film_says_so(run: Reconstruction) -> None:
    predictions, shown = compare(run.impacts, ["noel_2017"]), np.flatnonzero(run.impacts.trajectory == "b")
    made = impact_graphs(run.impacts, OFFSETS, SIZE, predictions, RT, shown)
    assert made.note == f"Graphs: {shown.size} of {len(run.impacts)} impacts (filtered)"
    whole = impact_graphs(run.impacts, OFFSETS, SIZE, predictions, RT)
    assert whole.note == ""
    model, measured = made.graphs[0].dots
    assert measured.since_s.tolist() == pytest.approx([1.4, 2.3, 3.4])
    assert len(model.place) == len(whole.graphs[0].dots[0].place) // 2


def test_a_line_grows_with_the_time_in_the_colours_of_the_speed(run: Reconstruction) -> None:
    made = motion_graphs(motion_courses(run), OFFSETS, SIZE, speed_top_mps=10.0)
    assert made.cursor_s == pytest.approx((0.0, 4.1))
    speed, energy = made.graphs  # without a terrain there is no height
    assert [graph.title for graph in made.graphs] == ["Speed [m/s]", "Kinetic energy [kJ]"]
    assert [graph.shows_x for graph in made.graphs] == [False, True]
    (line,) = speed.strokes
    assert (line.since_s.min(), line.since_s.max()) == pytest.approx((0.0, 4.1), abs=0.05)
    plot = speed.frame.plot
    np.testing.assert_allclose(line.ends[:, 1, 0], plot.left + line.since_s / 4.1 * plot.width, atol=1e-6)
    fast = (line.ends[:, 1, 1] - plot.bottom) / plot.height * speed.frame.y.limits[1] > 10.0
    assert fast.any()
    np.testing.assert_allclose(line.colour[fast], np.tile(SPEED_SCALE[-1], (fast.sum(), 1)))
    assert not np.allclose(line.colour[~fast][0], SPEED_SCALE[-1])
    (plain,) = motion_graphs(motion_courses(run), OFFSETS, SIZE, (1.0, 1.0, 1.0)).graphs[1].strokes
    assert (plain.colour == 1.0).all()
    assert energy.frame.plot.top < speed.frame.plot.bottom


@pytest.mark.parametrize("size", [(640, 360), (1280, 720), (1920, 1080), (720, 1280)])
def test_graphs_are_within_the_picture_and_legible(run: Reconstruction, size: tuple[int, int]) -> None:
    for made in (impact_graphs(run.impacts, OFFSETS, size), motion_graphs(motion_courses(run), OFFSETS, size)):
        assert made.room.left > 0.5 * size[0]
        assert made.room.right <= size[0]
        assert made.room.top < size[1]
        for graph in made.graphs:
            plot = graph.frame.plot
            assert made.room.left < plot.left < plot.right < made.room.right
            assert made.room.bottom < plot.bottom < plot.top < made.room.top
            assert len(graph.frame.y_ticks.values) >= 2
    assert text_height(size) >= 11.0


def test_the_slope_leaves_room_for_them() -> None:
    assert beside_graphs(Margins()).right > 0.37
    assert beside_graphs(Margins(left=0.38)).left < 0.38


def test_a_trajectory_without_flights_has_nothing_to_show() -> None:
    alone = reconstruct(make_picks(["a"], [3.0], [[0.0, 0.0, 0.0]]))
    made: FilmGraphs = motion_graphs(motion_courses(alone), {"a": 0.0}, SIZE)
    assert made.graphs == ()
    assert made.cursor_s is None
    (graph, *_) = impact_graphs(alone.impacts, {"a": 0.0}, SIZE).graphs
    assert len(graph.dots[0].place) == 0


def test_graphs_are_refused_in_a_picture_of_all_moments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from rockfall.core.cli import main

    assert main(["render", str(tmp_path / "project.toml"), "--graphs", "motion", "--slope"]) != 0
    assert "--graphs follow the time" in capsys.readouterr().err
