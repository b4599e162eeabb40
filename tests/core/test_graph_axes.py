# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes, ticks, layout and hits of graphs, against what can be counted by hand."""

import numpy as np
import pytest
from rockfall.core.analysis.axes import Axis, round_step, ticks
from rockfall.core.analysis.graph_layout import Rectangle, frame, in_box, in_lasso, nearest_place, tiles

WIDTH = 6.0


def measure(text: str) -> float:
    return WIDTH * len(text)


def test_places_and_values_are_inverse() -> None:
    for axis in (Axis((-2.0, 6.0)), Axis((0.01, 1000.0), log=True)):
        values = axis.values(np.array([0.0, 0.25, 1.0, 1.5]))
        assert axis.places(values) == pytest.approx([0.0, 0.25, 1.0, 1.5])
    assert Axis((-2.0, 6.0)).values(np.array([0.25]))[0] == 0.0
    assert Axis((0.01, 1000.0), log=True).values(np.array([0.4]))[0] == pytest.approx(1.0)
    assert np.isnan(Axis((1.0, 10.0), log=True).places(np.array([0.0, -3.0]))).all()


def test_zooming_keeps_the_value_under_the_mouse() -> None:
    assert Axis((0.0, 10.0)).zoomed(0.5, 0.2).limits == pytest.approx((1.0, 6.0))
    low, high = Axis((1.0, 100.0), log=True).zoomed(0.5, 0.5).limits
    assert (low, high) == pytest.approx((10**0.5, 10**1.5))
    assert Axis((0.0, 10.0)).panned(0.1).limits == pytest.approx((1.0, 11.0))
    assert Axis((1.0, 10.0), log=True).panned(1.0).limits == pytest.approx((10.0, 100.0))


def test_an_axis_stays_one_that_can_be_drawn() -> None:
    axis, log = Axis((1.0, 2.0)), Axis((1e-29, 1e29), log=True)
    for _ in range(200):
        axis, log = axis.zoomed(0.5, 0.3), log.zoomed(2.0, 0.5)
    assert axis.limits[1] - axis.limits[0] > 1e-5
    assert 0 < log.limits[0] < log.limits[1] < 1e30


def test_ticks_are_round_and_few() -> None:
    found = ticks(Axis((0.0, 5.0)), 6)
    assert found.texts == ("0", "1", "2", "3", "4", "5")
    assert ticks(Axis((0.0, 1.0)), 5).texts == ("0.00", "0.25", "0.50", "0.75", "1.00")
    assert ticks(Axis((0.0, 250_000.0)), 6).texts == ("0", "50k", "100k", "150k", "200k", "250k")
    for low, high in ((0.0, 1.0), (3.0, 3.1), (-17.0, 1234.5), (1e-9, 4e-9)):
        for most in range(2, 12):
            some = ticks(Axis((low, high)), most)
            assert len(some.values) <= most
            assert all(low <= value + 1e-9 * abs(high) and value <= high * (1 + 1e-9) for value in some.values)
            assert len(set(some.texts)) == len(some.texts)


def test_ticks_of_a_logarithmic_axis() -> None:
    found = ticks(Axis((0.1, 100.0), log=True), 5)
    assert found.texts == ("0.1", "1", "10", "100")
    assert 0.2 in [pytest.approx(value) for value in found.minor]
    assert ticks(Axis((1.0, 10.0), log=True), 5).texts == ("1", "2", "5", "10")
    assert len(ticks(Axis((1e-6, 1e9), log=True), 5).values) <= 6
    assert len(ticks(Axis((3.0, 4.0), log=True), 5).values) >= 2, "too short for powers of ten: linear ticks"


@pytest.mark.parametrize(
    ("least", "expected"), [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (2.2, 2.5), (30.0, 50.0), (7e-4, 1e-3)]
)
def test_round_step(least: float, expected: float) -> None:
    assert round_step(least) == pytest.approx(expected)


def test_tiles_fill_the_room_without_overlap() -> None:
    for width, height in ((800.0, 600.0), (300.0, 900.0), (1500.0, 250.0)):
        room = Rectangle(10.0, 20.0, width, height)
        for count in (1, 2, 3, 4):
            found = tiles(room, count)
            assert len(found) == count
            assert all(room.left - 1e-9 <= one.left and one.right <= room.right + 1e-9 for one in found)
            assert all(room.bottom - 1e-9 <= one.bottom and one.top <= room.top + 1e-9 for one in found)
            for i, one in enumerate(found):
                for other in found[i + 1 :]:
                    assert (
                        one.right <= other.left + 1e-9
                        or other.right <= one.left + 1e-9
                        or (one.bottom >= other.top - 1e-9 or other.bottom >= one.top - 1e-9)
                    )
    shapes = {size: tiles(Rectangle(0, 0, *size), 4) for size in ((800, 600), (300, 900), (1500, 250))}
    assert [len({one.left for one in found}) for found in shapes.values()] == [2, 1, 4]


def test_frame_leaves_room_for_its_numbers() -> None:
    tile = Rectangle(0.0, 0.0, 200.0, 130.0)
    found = frame(tile, Axis((0.0, 90.0)), Axis((0.0, 12_345.0)), 11.0, measure, 20.0)
    assert found.plot.left >= max(measure(text) for text in found.y_ticks.texts) + 11.0
    assert found.plot.top <= tile.top - 20.0 + 1e-9
    assert found.plot.right + measure(found.x_ticks.texts[-1]) / 2 <= tile.right
    wide = sum(measure(text) for text in found.x_ticks.texts)
    assert wide < found.plot.width, "the numbers do not touch"
    points = np.array([[0.0, 0.0], [90.0, 12_345.0], [45.0, 1000.0]])
    pixels = found.to_pixels(points)
    assert pixels[0] == pytest.approx([found.plot.left, found.plot.bottom])
    assert pixels[1] == pytest.approx([found.plot.right, found.plot.top])
    assert found.to_data(pixels) == pytest.approx(points)


def test_parts_of_a_graph() -> None:
    found = frame(Rectangle(0.0, 0.0, 300.0, 200.0), Axis((0.0, 1.0)), Axis((0.0, 1.0)), 11.0, measure, 20.0)
    middle = (found.plot.left + found.plot.right) / 2, (found.plot.bottom + found.plot.top) / 2
    assert found.part_at(*middle) == "plot"
    assert found.part_at(middle[0], 3.0) == "x"
    assert found.part_at(3.0, middle[1]) == "y"
    assert found.part_at(middle[0], 195.0) == "title"
    assert found.part_at(400.0, 100.0) == ""


def test_nearest_place_takes_the_uppermost_within_reach() -> None:
    places = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 0.0], [np.nan, np.nan]])
    assert nearest_place(places, 1.0, 1.0, 5.0) == 0
    assert nearest_place(places, 9.0, 0.0, 5.0) == 2
    assert nearest_place(places, 5.0, 30.0, 5.0) == -1
    assert nearest_place(np.empty((0, 2)), 0.0, 0.0, 5.0) == -1


def test_box_and_lasso() -> None:
    places = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [np.nan, 1.0]])
    assert in_box(places, (4.0, 2.0), (0.0, 0.0)).tolist() == [True, True, False, False]
    horseshoe = np.array([[0, 0], [4, 0], [4, 4], [2, 4], [2, 0.5], [0, 0.5]], dtype=float)
    assert in_lasso(places, horseshoe).tolist() == [False, True, True, False]
    assert not in_lasso(places, horseshoe[:2]).any()


def test_lasso_agrees_with_a_circle() -> None:
    places = np.random.default_rng(1).uniform(-2, 2, (5000, 2))
    turn = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    inside = in_lasso(places, np.stack([np.cos(turn), np.sin(turn)], axis=1))
    away = np.hypot(*places.T)
    clear = np.abs(away - 1) > 1e-3
    assert (inside[clear] == (away < 1)[clear]).all()
