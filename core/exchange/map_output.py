# SPDX-License-Identifier: GPL-3.0-or-later
"""All files of maps in one folder: GeoTIFF, styles of QGIS, figures."""

from collections.abc import Mapping
from pathlib import Path

from ..extras import FIGURES, is_there
from ..georeference import GlobalShift
from ..hazard.classes import classes_of
from ..hazard.maps import LAYERS, Maps
from ..progress import Progress, silent
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface
from ..vectors import Array
from ..workflow.map_figures import save_map_figures
from .geotiff_maps import write_map
from .qgis_styles import write_raster_style

CONDITIONAL = "conditional on the release of the blocks; not a frequency in time"


def write_maps(
    maps: Maps,
    folder: Path,
    shift: GlobalShift,
    about: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Write NAME.tif and its style NAME.qml for each map; returns the names of the files.

    Parameters
    ----------
    folder : is made where it is not there.
    about : what the metadata of each file shall say, beside what they mean: the model, the seed.

    Raises
    ------
    InputError : a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    said = {"BLOCKS": str(maps.blocks), "CONDITIONAL": CONDITIONAL, **(about or {})}
    written = []
    for done, (name, values) in enumerate(maps.layers.items()):
        progress("Writing the maps", done, len(maps.layers))
        write_map(folder / f"{name}.tif", maps.cells, values, LAYERS[name], shift, said)
        write_raster_style(folder / f"{name}.qml", classes_of(name, values), LAYERS[name].unit)
        written += [f"{name}.tif", f"{name}.qml"]
    return written


def draw_maps(
    maps: Maps,
    terrain: Surface | Cloud,
    folder: Path,
    *,
    said: str = "",
    releases: Array | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Write the figures of the maps; returns the names of the files: none where Matplotlib is not installed.

    See `save_map_figures`.
    """
    if not is_there(FIGURES):
        return []
    figures = save_map_figures(maps, terrain, folder, said=said, releases=releases, progress=progress)
    return [figure.name for figure in figures]
