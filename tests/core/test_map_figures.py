# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of maps: the part that they show, the light on the terrain, and what stands on them."""

import numpy as np
import pytest
from rockfall.core.exchange.map_figures import Window, hillshade, map_figure, reached, save_map_figures
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.cells import Cells
from rockfall.core.hazard.maps import Maps
from rockfall.core.terrain.surface import Surface

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 0.0, "EPSG:2056")
CELLS = Cells(0.0, 0.0, 2.0, 50, 40)


@pytest.fixture(scope="module")
def maps() -> Maps:
    probability = np.full(CELLS.shape, np.nan)
    probability[10:15, 20:40] = np.linspace(0.5, 60.0, 20)
    return Maps(CELLS, 12_000, {"Reach_probability": probability, "E_95CI": probability * 5})


def plane(to_east: float, to_north: float) -> Surface:
    places = np.array([[x, y, to_east * x + to_north * y] for y in (0.0, 80.0) for x in (0.0, 100.0)])
    return Surface(places, np.array([[0, 1, 3], [0, 3, 2]], np.int32), SHIFT, "plane")


def test_the_window_is_what_blocks_reach_with_room(maps: Maps) -> None:
    window = reached(maps)
    assert (window.west, window.east, window.south, window.north) == (36.0, 84.0, 16.0, 34.0)
    nothing = Maps(CELLS, 10, {"E_95CI": np.full(CELLS.shape, np.nan)})
    whole = reached(nothing)
    assert (whole.west, whole.east, whole.south, whole.north) == (0.0, 100.0, 0.0, 80.0)


@pytest.mark.parametrize(("to_east", "to_north"), [(0.0, 0.0), (0.5, 0.0), (0.0, -0.7), (-0.4, 0.3)])
def test_the_light_comes_from_the_north_west(to_east: float, to_north: float) -> None:
    """The cosine between a plane's normal and the light, 315° from north and 45° high."""
    normal = np.array([-to_east, -to_north, 1.0]) / np.sqrt(1 + to_east**2 + to_north**2)
    azimuth, altitude = np.radians([315.0, 45.0])
    light = np.array([np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), np.sin(altitude)])
    shade = hillshade(plane(to_east, to_north), Window(10.0, 90.0, 10.0, 70.0), 2.0)
    np.testing.assert_allclose(shade, max(normal @ light, 0.0), atol=1e-6)
    beside = hillshade(plane(to_east, to_north), Window(90.0, 120.0, 10.0, 30.0), 2.0)
    assert np.isnan(beside[:, -5:]).all()
    assert np.isfinite(beside[:, 0]).all()


def test_a_figure_says_what_it_is_conditional_on(maps: Maps) -> None:
    pytest.importorskip("matplotlib", reason="Matplotlib is not installed")
    terrain, window = plane(0.3, 0.2), reached(maps)
    shade = hillshade(terrain, window, 2.0)
    releases = np.array([[70.0, 25.0, 0.0]])
    figure = map_figure(maps, "Reach_probability", window, shade, terrain, said="noel_2017", releases=releases)
    axes = figure.axes[0]
    assert axes.get_title(loc="left") == "Reach probability [%]"
    words = " | ".join(text.get_text() for text in axes.texts)
    for said in (
        "conditional on the release: 12,000 blocks",
        "noel_2017",
        "cells of 2 m",
        "EPSG:2056",
        "N",
        "8 m",
    ):
        assert said in words
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert legend[0].endswith("and more")
    assert legend[-2].startswith("below")
    assert legend[-1] == "release"
    assert axes.get_xlim() == (2_600_036.0, 2_600_084.0)
    (marker,) = axes.lines
    assert marker.get_xydata().tolist() == [[2_600_070.0, 1_200_025.0]]


def test_figures_are_written_of_the_maps_that_are_there(maps: Maps, tmp_path) -> None:
    pytest.importorskip("matplotlib", reason="Matplotlib is not installed")
    files = save_map_figures(maps, plane(0.3, 0.2), tmp_path, ("Reach_probability", "V_95CI"))
    assert [file.name for file in files] == ["Reach_probability.png"]
    assert files[0].read_bytes()[:4] == b"\x89PNG"
