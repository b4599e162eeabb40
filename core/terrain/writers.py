# SPDX-License-Identifier: GPL-3.0-or-later
"""The surface back into a file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..output import output_stream
from .surface import Surface


def write_ply(surface: Surface, path: str | Path, face_values: Mapping[str, NDArray[np.integer]] | None = None) -> None:
    """Write a binary PLY in survey coordinates, double precision: nothing is lost.

    Parameters
    ----------
    face_values : name → (m,) whole numbers, attributes of the faces.
    """
    attributes = face_values or {}
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            *([f"comment crs {surface.shift.crs}"] if surface.shift.crs else []),
            f"element vertex {len(surface.vertices)}",
            *(f"property double {axis}" for axis in "xyz"),
            f"element face {len(surface.faces)}",
            "property list uchar int vertex_indices",
            *(f"property int {name}" for name in attributes),
            "end_header\n",
        ]
    )
    more = [(name, "<i4") for name in attributes]
    faces = np.empty(len(surface.faces), np.dtype([("count", "u1"), ("vertices", "<i4", 3), *more]))
    faces["count"], faces["vertices"] = 3, surface.faces
    for name, values in attributes.items():
        faces[name] = values
    with output_stream(path, binary=True) as file:
        file.write(header.encode("ascii", "replace"))
        file.write(surface.shift.to_survey(surface.vertices).astype("<f8").tobytes())
        file.write(faces.tobytes())
