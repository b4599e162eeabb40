# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of the faces of the mesh as files: cliffs and overhangs have no cell of their own in plan.

faces.gpkg has each face that a block touches as a polygon in space, faces.csv the middle of each with the same numbers.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..hazard.face_tally import FACE_LAYERS, FaceTally
from ..simulation.ground import TERRAIN, Ground
from ..vectors import Array, Indices, norm
from .geopackage import FeatureLayer, write_geopackage
from .map_output import CONDITIONAL
from .tables import write_columns

GEOPACKAGE, TABLE = "faces.gpkg", "faces.csv"


def touched_faces(tally: FaceTally, ground: Ground) -> tuple[Indices, dict[str, Array]]:
    """The numbers (t,) of the triangles of a ground that blocks touch, and the layers (t,) there."""
    layers = tally.layers()
    triangles = len(ground.faces)
    touched = np.flatnonzero(layers["Nr_contacts"][:triangles] > 0)
    return touched, {name: values[:triangles][touched] for name, values in layers.items()}


def write_face_maps(
    tally: FaceTally, ground: Ground, folder: Path, about: Mapping[str, str] | None = None
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
    faces, layers = touched_faces(tally, ground)
    corners = ground.vertices[ground.faces[faces]]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = norm(cross) / 2
    middle = ground.shift.to_survey(corners.mean(axis=1))
    names = np.array(["terrain", *ground.structures])
    columns: dict[str, NDArray[Any]] = {
        "face": faces,
        "of": names[np.where(ground.owner[faces] == TERRAIN, 0, ground.owner[faces])],
        "area_m2": area,
        "dip_deg": np.degrees(np.arccos(np.clip(cross[:, 2] / (2 * area), -1, 1))),
        **layers,
    }
    said = {"blocks": str(tally.blocks), "conditional": CONDITIONAL, **(about or {})}
    said |= {name: f"{layer.meaning}{f' [{layer.unit}]' if layer.unit else ''}" for name, layer in FACE_LAYERS.items()}
    rings = corners[:, [0, 1, 2, 0]].reshape(-1, 3)
    layer = FeatureLayer(
        "faces", "Faces of the mesh that blocks touch, and what happens there", rings,
        np.arange(len(faces) + 1) * 4, columns, closed=True,
    )  # fmt: skip
    write_geopackage(folder / GEOPACKAGE, [layer], ground.shift, said)
    places = dict(zip(("x_m", "y_m", "z_m"), middle.T, strict=True))
    write_columns(folder / TABLE, {"face": columns["face"], "of": columns["of"], **places, **columns})
    return [GEOPACKAGE, TABLE]
