# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terrain file holds, before it is meshed, cleaned and moved: the common ground of all formats."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..vectors import Array


@dataclass(frozen=True, eq=False)
class Source:
    """Contents of a terrain file: a mesh, a grid (`grid_shape` given) or a cloud (neither faces nor shape).

    Attributes
    ----------
    points : (n, 3) as in the file; in a grid row by row, NaN height where there are no data.
    faces : (m, 3) of a mesh.
    grid_shape : (rows, columns) of a grid.
    crs : "EPSG:2056", another name that the file gives, or empty.
    vertical : the system of the heights, likewise.
    geographic : the file says that its coordinates are degrees.
    up : axis that points up by the format's standard.
    turned : y was up, and the points were turned.
    notes : sentences for the summary.
    merged : so many vertices more are in the file, at the places of others.
    colours : (n, 3) sRGB of the points; None when they have none.
    count : of the points in the file, where `points` are only the corners of their box.
    step : (3,) of which the coordinates are multiples by the file's own word, in its unit; None when it says none.
    """

    points: Array
    faces: NDArray[np.int32] | None = None
    grid_shape: tuple[int, int] | None = None
    crs: str = ""
    geographic: bool = False
    up: str = "z"
    turned: bool = False
    notes: tuple[str, ...] = ()
    vertical: str = ""
    merged: int = 0
    colours: NDArray[np.uint8] | None = None
    count: int = 0
    step: Array | None = None

    @property
    def kind(self) -> str:
        """ "mesh", "grid" or "cloud"."""
        return "mesh" if self.faces is not None else "grid" if self.grid_shape is not None else "cloud"


def check_face_indices(faces: NDArray[np.integer], vertex_count: int, path: Path) -> NDArray[np.int32]:
    """The faces as int32, when all of them refer to a vertex.

    Raises
    ------
    InputError : a mesh with no faces, or a face that names a vertex which does not exist.
    """
    if not len(faces):
        raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
    if int(faces.min()) < 0 or int(faces.max()) >= vertex_count:
        wrong = ((faces < 0) | (faces >= vertex_count)).any(axis=1)
        face = int(np.flatnonzero(wrong)[0])
        raise InputError(
            f"Face {face} names the vertices {faces[face].tolist()}, of which only 0 to {vertex_count - 1} exist",
            file=path,
            advice="Export the mesh again: the file is damaged",
        )
    return np.ascontiguousarray(faces, dtype=np.int32)


def check_finite(points: Array, kind: str, path: Path, before: int = 0) -> None:
    """Whether all coordinates (n, 3) are finite; heights of a grid need not be. `before` points came before these.

    Raises
    ------
    InputError : one is not.
    """
    finite = np.isfinite(points[:, :2] if kind == "grid" else points)
    if not finite.all():
        row = int(np.flatnonzero(~finite.all(axis=1))[0])
        what, plural = ("vertex", "vertices") if kind == "mesh" else ("point", "points")
        raise InputError(
            f"The {what} {before + row} (counted from 0) is not finite: {points[row].tolist()}",
            file=path,
            advice=f"Remove {plural} with NaN or infinite coordinates and export again",
        )
