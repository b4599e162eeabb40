# SPDX-License-Identifier: GPL-3.0-or-later
"""The systems of a terrain that its file does not state: the project does, and outputs carry them."""

from pathlib import Path

import pytest
import tifffile
from rockfall.core.errors import InputError
from rockfall.core.exchange.project import read_project, write_project
from rockfall.core.workflow.opening import open_terrain

GRID = "ncols 4\nnrows 3\nxllcorner 988400\nyllcorner 6375600\ncellsize 1\n" + "1500 1501 1502 1503\n" * 3


def project(folder: Path, more: str) -> Path:
    (folder / "terrain.asc").write_text(GRID)
    (folder / "project.toml").write_text(f'schema = 1\n[terrain]\nfile = "terrain.asc"\n{more}')
    return folder / "project.toml"


@pytest.mark.parametrize("shift", ["", "shift = [988000.0, 6375000.0, 1000.0]\n"])
def test_the_project_states_both_systems(tmp_path: Path, shift: str) -> None:
    file = project(tmp_path, f'{shift}crs = "EPSG:2154"\nvertical_datum = "EPSG:5720"\n')
    surface = open_terrain(read_project(file))
    assert surface is not None
    assert (surface.shift.crs, surface.shift.vertical) == ("EPSG:2154", "EPSG:5720")
    write_project(read_project(file), tmp_path / "again.toml")
    again = read_project(tmp_path / "again.toml")
    assert again.terrain is not None
    assert again.terrain.vertical_datum == "EPSG:5720"


def test_neither_is_guessed(tmp_path: Path) -> None:
    surface = open_terrain(read_project(project(tmp_path, "")))
    assert surface is not None
    assert (surface.shift.crs, surface.shift.vertical) == ("", "")


def test_another_system_than_that_of_the_file_is_refused(tmp_path: Path) -> None:
    file = project(tmp_path, 'crs = "EPSG:2056"\n')
    (tmp_path / "terrain.prj").write_text('PROJCS["RGF93 / Lambert-93",AUTHORITY["EPSG","2154"]]')
    with pytest.raises(InputError, match=r"is in EPSG:2154, .*EPSG:2056"):
        open_terrain(read_project(file))


def test_maps_carry_the_system_of_the_heights(tmp_path: Path) -> None:
    """Read back by another library, from what a simulation of the project writes."""
    from rockfall.core import cli

    file = project(
        tmp_path,
        'crs = "EPSG:2154"\nvertical_datum = "EPSG:5720"\n[simulation]\nmodels = ["noel_2017"]\n'
        '[simulation.releases]\nfrom = "points"\npoints_m = [[988405.0, 6375620.0]]\nnumber = 5\n',
    )
    steep = "\n".join(" ".join(f"{1500 - 2 * x}" for x in range(40)) for _ in range(40))
    header = "ncols 40\nnrows 40\nxllcorner 988400\nyllcorner 6375600\ncellsize 1\n"
    (tmp_path / "terrain.asc").write_text(f"{header}{steep}\n")
    assert cli.main(["simulate", str(file), "--cell", "2", "--out", str(tmp_path / "out")]) == 0
    maps = sorted((tmp_path / "out").rglob("*.tif"))
    assert maps
    with tifffile.TiffFile(maps[0]) as tiff:
        keys = tiff.pages[0].geotiff_tags
        described = tiff.pages[0].tags["GDAL_METADATA"].value
    assert int(keys["VerticalGeoKey"] if "VerticalGeoKey" in keys else keys["VerticalCSTypeGeoKey"]) == 5720
    assert "EPSG:5720" in described
