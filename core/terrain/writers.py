# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface, or a cloud, back into a file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..output import output_stream
from ..vectors import Array
from .cloud import Cloud
from .surface import Surface


def write_ply(
    terrain: Surface | Cloud, path: str | Path, face_values: Mapping[str, NDArray[np.integer]] | None = None
) -> None:
    """Write a binary PLY in survey coordinates, double precision and colours if there are any: nothing is lost.

    A cloud has no faces there.

    Parameters
    ----------
    face_values : name → (m,) whole numbers, attributes of the faces.
    """
    attributes = face_values or {}
    is_cloud = isinstance(terrain, Cloud)
    colours = None if isinstance(terrain, Cloud) else terrain.colours
    points = terrain.points if isinstance(terrain, Cloud) else terrain.vertices
    corners = np.empty((0, 3), np.int32) if isinstance(terrain, Cloud) else terrain.faces
    of_faces = [
        f"element face {len(corners)}",
        "property list uchar int vertex_indices",
        *(f"property int {name}" for name in attributes),
    ]
    header = "\n".join(
        [
            "ply",
            "format binary_little_endian 1.0",
            *([f"comment crs {terrain.shift.crs}"] if terrain.shift.crs else []),
            f"element vertex {len(points)}",
            *(f"property double {axis}" for axis in "xyz"),
            *(f"property uchar {name}" for name in (() if colours is None else ("red", "green", "blue"))),
            *([] if is_cloud else of_faces),
            "end_header\n",
        ]
    )
    more = [(name, "<i4") for name in attributes]
    faces = np.empty(len(corners), np.dtype([("count", "u1"), ("vertices", "<i4", 3), *more]))
    faces["count"], faces["vertices"] = 3, corners
    for name, values in attributes.items():
        faces[name] = values
    with output_stream(path, binary=True) as file:
        file.write(header.encode("ascii", "replace"))
        file.write(_vertex_rows(terrain.shift.to_survey(points), colours))
        file.write(faces.tobytes())


def _vertex_rows(points: Array, colours: NDArray[np.uint8] | None) -> bytes:
    if colours is None:
        return points.astype("<f8").tobytes()
    rows = np.empty(len(points), np.dtype([("place", "<f8", 3), ("colour", "u1", 3)]))
    rows["place"], rows["colour"] = points, colours
    return rows.tobytes()
