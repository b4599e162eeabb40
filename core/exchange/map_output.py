# SPDX-License-Identifier: GPL-3.0-or-later
"""All files of maps in one folder: GeoTIFF, styles of QGIS, outlines of what says little, figures."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..extras import FIGURES, is_there
from ..georeference import GlobalShift
from ..hazard.classes import classes_of
from ..hazard.evidence import FEW, Evidence, cell_evidence, outlines, row_runs
from ..hazard.maps import LAYERS, Maps
from ..progress import Progress, silent
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface
from ..vectors import Array
from .geopackage import FeatureLayer, write_geopackage
from .geotiff_maps import write_map
from .map_figures import save_map_figures
from .qgis_styles import hatch_style, write_raster_style

EVIDENCE = "evidence.gpkg"
CONDITIONAL = "conditional on the release of the blocks; not a frequency in time"


def write_maps(
    maps: Maps,
    terrain: Surface | Cloud,
    folder: Path,
    shift: GlobalShift,
    about: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Write NAME.tif and its style NAME.qml for each map; returns the names of the files.

    A GeoTIFF cannot be hatched: where cells rest on few blocks or are beyond the terrain, evidence.gpkg has their
    outlines, hatched, to be laid over any of the maps.

    Parameters
    ----------
    terrain : that the blocks fell on.
    folder : is made where it is not there.
    about : what the metadata of each file shall say, beside what they mean: the model, the seed.

    Raises
    ------
    InputError : a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    evidence = cell_evidence(maps, terrain)
    said = {"BLOCKS": str(maps.blocks), "CONDITIONAL": CONDITIONAL, **(about or {})}
    said |= {"EVIDENCE": "; ".join(evidence.in_words)} if evidence.in_words else {}
    written = []
    for done, (name, values) in enumerate(maps.layers.items()):
        progress("Writing the maps", done, len(maps.layers))
        write_map(folder / f"{name}.tif", maps.cells, values, LAYERS[name], shift, said)
        write_raster_style(folder / f"{name}.qml", classes_of(name, values), LAYERS[name].unit)
        written += [f"{name}.tif", f"{name}.qml"]
    if evidence.in_words:
        write_geopackage(folder / EVIDENCE, [_outlines(maps, evidence)], shift, said)
        written.append(EVIDENCE)
    return written


def _outlines(maps: Maps, evidence: Evidence) -> FeatureLayer:
    """The cells that say little, as rectangles along rows."""
    parts, reasons = [], []
    for reason, mask in ((f"fewer than {FEW} blocks", evidence.few), ("beyond the terrain", evidence.beyond)):
        parts.append(row_runs(mask))
        reasons += [reason] * len(parts[-1])
    plan = outlines(maps.cells, np.concatenate(parts)).reshape(-1, 2)
    points = np.column_stack([plan, np.zeros(len(plan))])
    return FeatureLayer(
        "evidence", "Cells whose values say little: few blocks enter them, or the terrain ends before", points,
        np.arange(len(reasons) + 1) * 5, {"reason": np.array(reasons)}, hatch_style(), closed=True,
    )  # fmt: skip


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
