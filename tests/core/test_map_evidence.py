# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of maps that say little: which they are, and that every output hatches and counts them."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from rockfall.core import cli
from rockfall.core.exchange.map_output import EVIDENCE, write_maps
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.cells import Cells
from rockfall.core.hazard.evidence import FEW, cell_evidence, row_runs
from rockfall.core.hazard.maps import Maps
from rockfall.core.terrain.surface import Surface

SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 0.0, "EPSG:2056")


def half_plane() -> Surface:
    """A level square of 10 m; the maps below are twice as wide."""
    corners = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    return Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), SHIFT, "plane")


def numbered(blocks: dict[tuple[int, int], float]) -> Maps:
    """Maps of 10 × 20 cells of 1 m with so many blocks in (row, column)."""
    values = np.full((10, 20), np.nan)
    for place, number in blocks.items():
        values[place] = number
    return Maps(Cells(0.0, 0.0, 1.0, 20, 10), 100, {"Nr_blocks": values, "E_95CI": 3.0 * values})


MAPS = {(2, 3): FEW - 1, (2, 4): 1, (2, 6): 5, (3, 3): FEW, (9, 9): 99, (4, 15): 50, (5, 15): 2}


def test_few_blocks_and_cells_beyond_the_terrain_are_told_apart() -> None:
    found = cell_evidence(numbered(MAPS), half_plane())
    assert set(zip(*np.nonzero(found.few), strict=True)) == {(2, 3), (2, 4), (2, 6), (5, 15)}
    assert set(zip(*np.nonzero(found.beyond), strict=True)) == {(4, 15), (5, 15)}
    assert found.in_words == (
        "fewer than 20 blocks: 4 of 7 cells",
        "beyond the terrain: 2 of 7 cells",
    )


def test_stretches_along_rows_cover_a_mask_once() -> None:
    rng = np.random.default_rng(8)
    mask = rng.random((30, 41)) < 0.5
    again = np.zeros(mask.shape, int)
    for row, first, end in row_runs(mask):
        assert first == 0 or not mask[row, first - 1]
        again[row, first:end] += 1
    np.testing.assert_array_equal(again, mask)


def test_the_outlines_are_those_cells_in_survey_coordinates(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    written = write_maps(numbered(MAPS), half_plane(), tmp_path, SHIFT)
    assert EVIDENCE in written
    *_, (reasons,) = pyogrio.raw.read(tmp_path / EVIDENCE, layer="evidence", columns=["reason"])
    bounds = pyogrio.read_bounds(tmp_path / EVIDENCE, layer="evidence")[1].T
    found = {
        (reason, *np.round(box - [SHIFT.x, SHIFT.y, SHIFT.x, SHIFT.y], 6).tolist())
        for reason, box in zip(reasons, bounds, strict=True)
    }
    assert found == {
        ("fewer than 20 blocks", 3.0, 2.0, 5.0, 3.0),  # two cells beside each other
        ("fewer than 20 blocks", 6.0, 2.0, 7.0, 3.0),
        ("fewer than 20 blocks", 15.0, 5.0, 16.0, 6.0),
        ("beyond the terrain", 15.0, 4.0, 16.0, 5.0),
        ("beyond the terrain", 15.0, 5.0, 16.0, 6.0),
    }
    with sqlite3.connect(tmp_path / EVIDENCE) as database:
        (style,) = database.execute("SELECT styleQML FROM layer_styles").fetchone()
    assert "LinePatternFill" in style


def test_a_geotiff_says_it_and_maps_of_many_blocks_need_no_outlines(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    write_maps(numbered(MAPS), half_plane(), tmp_path / "few", SHIFT)
    with rasterio.open(tmp_path / "few" / "E_95CI.tif") as file:
        assert file.tags()["EVIDENCE"].startswith("fewer than 20 blocks: 4 of 7 cells; beyond")
    assert EVIDENCE not in write_maps(numbered({(3, 3): FEW, (9, 9): 99}), half_plane(), tmp_path / "many", SHIFT)


def test_a_figure_hatches_and_counts_them() -> None:
    """The hatched area is that of the cells, and the legend has the numbers."""
    pytest.importorskip("matplotlib")
    from matplotlib.patches import PathPatch
    from rockfall.core.exchange.map_figures import BEYOND, HATCH, hillshade, map_figure, reached

    maps, terrain = numbered(MAPS), half_plane()
    window = reached(maps)
    figure = map_figure(maps, "E_95CI", window, hillshade(terrain, window, 1.0), terrain)
    areas = {}
    for patch in figure.axes[0].patches:
        if isinstance(patch, PathPatch):
            sides = [(polygon - polygon[0]).T for polygon in patch.get_path().to_polygons()]
            areas[patch.get_hatch()] = sum(abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2 for x, y in sides)
    assert areas == pytest.approx({HATCH: 4.0, BEYOND: 2.0})  # m², of cells of 1 m²
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "fewer than 20 blocks:\n4 of 7 cells" in labels
    assert "beyond the terrain:\n2 of 7 cells" in labels


def test_maps_with_a_barrier_have_a_folder_of_their_own(tmp_path: Path) -> None:
    """By a map's name the blocks fall as if there were no barrier; with them, fewer come to the cells below."""
    rasterio = pytest.importorskip("rasterio")
    demo = Path(cli.__file__).parents[1] / "assets" / "demo"
    run = ["simulate", str(demo / "project.toml"), "--number", "3", "--cell", "4", "--model", "noel_2017"]
    assert cli.main([*run, "--out", str(tmp_path / "plain")]) == 0
    assert cli.main([*run, "--screen", str(demo / "barriers.csv"), "--out", str(tmp_path / "held")]) == 0

    def blocks(*parts: str) -> np.ndarray:
        with rasterio.open(tmp_path.joinpath(*parts, "Nr_blocks.tif")) as file:
            return np.ma.filled(file.read(1, masked=True), 0.0)

    plain, named, held = blocks("plain", "maps"), blocks("held", "maps"), blocks("held", "maps", "with_barriers")
    np.testing.assert_array_equal(plain, named)
    assert (held <= named).all()
    assert held.sum() < named.sum()
