# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of the faces of the mesh as files: cliffs and overhangs have no cell of their own in plan.

faces.gpkg has each face that a block touches as a polygon in space, faces.csv the middle of each with the same numbers.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..georeference import GlobalShift
from ..hazard.classes import classes_in
from ..hazard.evidence import FEW, face_evidence
from ..hazard.face_tally import FACE_LAYERS, FaceMaps
from ..vectors import cross, norm
from .geopackage import FeatureLayer, write_geopackage
from .map_output import CONDITIONAL
from .qgis_styles import hatch_style, polygon_style
from .tables import write_columns

SHOWN = "Reach_probability"
"""The column whose classes are shown when the file is opened."""
GEOPACKAGE, TABLE = "faces.gpkg", "faces.csv"


def write_face_maps(
    maps: FaceMaps, folder: Path, shift: GlobalShift, about: Mapping[str, str] | None = None
) -> list[str]:
    """Write faces.gpkg and faces.csv; returns their names.

    Parameters
    ----------
    folder : is made where it is not there.
    about : what the GeoPackage shall say, beside what its numbers mean: the model, the seed.

    Raises
    ------
    InputError : a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    corners = maps.corners
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.maximum(norm(normal), np.finfo(float).tiny)
    columns: dict[str, NDArray[Any]] = {
        "face": maps.faces,
        "of": maps.of,
        "area_m2": twice / 2,
        "dip_deg": np.degrees(np.arccos(np.clip(normal[:, 2] / twice, -1, 1))),
        **maps.layers,
    }
    said = {"blocks": str(maps.blocks), "conditional": CONDITIONAL, **(about or {})}
    said |= {name: f"{layer.meaning}{f' [{layer.unit}]' if layer.unit else ''}" for name, layer in FACE_LAYERS.items()}
    rings = corners[:, [0, 1, 2, 0]].reshape(-1, 3)
    reach = maps.layers[SHOWN]
    style = polygon_style(SHOWN, classes_in("%", reach), float(reach.max(initial=0.0)), "%")
    layer = FeatureLayer(
        "faces", "Faces of the mesh that blocks touch, and what happens there", rings,
        np.arange(len(corners) + 1) * 4, columns, style, closed=True,
    )  # fmt: skip
    evidence, layers = face_evidence(maps), [layer]
    if evidence.in_words:
        said["evidence"] = "; ".join(evidence.in_words)
        rows = np.flatnonzero(evidence.weak)
        outlines = corners[rows][:, [0, 1, 2, 0]].reshape(-1, 3)
        text = f"Faces that fewer than {FEW} blocks touch: their values say little"
        numbers = {"face": maps.faces[rows], "Nr_blocks": columns["Nr_blocks"][rows]}
        first = np.arange(len(rows) + 1) * 4
        layers.append(FeatureLayer("evidence", text, outlines, first, numbers, hatch_style(), closed=True))
    write_geopackage(folder / GEOPACKAGE, layers, shift, said)
    places = dict(zip(("x_m", "y_m", "z_m"), shift.to_survey(corners.mean(axis=1)).T, strict=True))
    write_columns(folder / TABLE, {"face": columns["face"], "of": columns["of"], **places, **columns})
    return [GEOPACKAGE, TABLE]
