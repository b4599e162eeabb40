# SPDX-License-Identifier: GPL-3.0-or-later
"""rockfall simulate --cell: maps beside the same tables, whatever is recorded."""

import csv
from pathlib import Path

import numpy as np
import pytest
import tifffile
from rockfall.core.cli import main
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.maps import LAYERS
from rockfall.core.simulation.engine import RECORDED, Records, Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

EAST, NORTH = 2_600_000.0, 1_200_000.0


def slope() -> Surface:
    line = np.arange(0.0, 61.0)
    x, y = np.meshgrid(line, line)
    z = 500 - 0.7 * np.minimum(x, 40) + 0.2 * np.sin(x) * np.cos(y / 2)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    faces = np.concatenate([lower, upper]).astype(np.int32)
    return Surface(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces, GlobalShift(EAST, NORTH, 0.0), "slope")


@pytest.fixture(scope="module")
def argv(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("site")
    write_ply(slope(), folder / "slope.ply")
    releases = f"x_m,y_m,diameter_m,number\n{EAST + 5},{NORTH + 30},0.4,60\n"
    (folder / "releases.csv").write_text(releases, encoding="utf-8")
    return ["simulate", str(folder / "releases.csv"), "--terrain", str(folder / "slope.ply"), "--model", "noel_2017"]


def values(folder: Path, name: str) -> np.ndarray:
    found = tifffile.imread(folder / f"{name}.tif", key=0)
    return np.where(found == -9999, np.nan, found)


def test_maps_beside_the_same_tables_whatever_is_recorded(argv: list[str], tmp_path: Path, capsys) -> None:
    for name, more in (
        ("tables", []),
        ("maps", ["--cell", "2"]),
        ("few", ["--cell", "2", "--record", "none", "--threads", "1"]),
    ):
        assert main([*argv, *more, "--out", str(tmp_path / name)]) == 0
    for table in ("runs.csv", "impacts.csv", "trajectories.csv"):
        assert (tmp_path / "maps" / table).read_bytes() == (tmp_path / "tables" / table).read_bytes()
    assert not (tmp_path / "tables" / "maps").exists()
    for name in LAYERS:
        first, second = (values(tmp_path / out / "maps", name) for out in ("maps", "few"))
        np.testing.assert_array_equal(first, second)
        assert first.shape == (30, 30)
    with (tmp_path / "maps" / "runs.csv").open(encoding="utf-8") as file:
        stopped = sum(row["end"] == "stopped" for row in csv.DictReader(file))
    assert np.nansum(values(tmp_path / "maps" / "maps", "Nr_deposited")) == stopped > 0
    assert np.nanmax(values(tmp_path / "maps" / "maps", "Reach_probability")) == 100
    assert "Maps of 60 blocks with Noël et al. 2017" in capsys.readouterr().out


def test_several_models_have_a_folder_each(argv: list[str], tmp_path: Path) -> None:
    models = [*argv, "--model", "stevens_1998"]
    assert main([*models, "--cell", "5", "--record", "none", "--out", str(tmp_path / "out")]) == 0
    for model in ("noel_2017", "stevens_1998"):
        assert (tmp_path / "out" / "maps" / model / "E_95CI.tif").exists()


@pytest.mark.parametrize(("cell", "problem"), [("0.001", "no cells for maps"), ("nan", "cell"), ("0", "cell")])
def test_cells_that_cannot_be(argv: list[str], tmp_path: Path, capsys, cell: str, problem: str) -> None:
    try:
        code = main([*argv, "--cell", cell, "--out", str(tmp_path / "out")])
    except SystemExit as left:
        code = int(left.code or 0)
    assert code in (1, 2)
    assert problem in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_less_of_a_record_is_what_is_simulated_with_less() -> None:
    ground = make_ground(slope())
    places = np.column_stack([np.full(40, 5.0), np.linspace(20, 40, 40), np.full(40, 500.0)])
    releases = make_releases(places, diameter_m=0.5)
    whole = simulate(ground, releases, Settings("noel_2017"))
    for record in RECORDED:
        less, alone = whole.with_records(record), simulate(ground, releases, Settings("noel_2017"), record=record)
        for name in Records.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(less.records, name), getattr(alone.records, name), err_msg=name)
        assert less.recorded == record
