# SPDX-License-Identifier: GPL-3.0-or-later
"""What a terrain file holds, before it is meshed, cleaned and moved: the common ground of all formats."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..constants import UNITS_M
from ..errors import InputError
from ..vectors import Array
from .crs import UNKNOWN, CoordinateSystem

UNIT_NAMES = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters", "[m]"), UNITS_M["m"]),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "international feet"), UNITS_M["ft"]),
    **dict.fromkeys(
        ("us-ft", "ftus", "usft", "us survey foot", "us survey feet", "us_survey_foot", "foot_us", "survey foot"),
        UNITS_M["us-ft"],
    ),
    **{name: UNITS_M[name] for name in ("mm", "cm", "km")},
    "millimetre": UNITS_M["mm"],
    "centimetre": UNITS_M["cm"],
    "decimetre": 0.1,
    "dm": 0.1,
    "kilometre": UNITS_M["km"],
}
"""Names of units of a band, in lower case → their lengths [m]."""


@dataclass(frozen=True, eq=False)
class Source:
    """Contents of a terrain file: a mesh, a grid (`grid_shape` given) or a cloud (neither faces nor shape).

    Attributes
    ----------
    points : (n, 3) as in the file; in a grid row by row, NaN height where there are no data.
    faces : (m, 3) of a mesh.
    grid_shape : (rows, columns) of a grid.
    system : of the coordinates, as far as the file says it.
    up : axis that points up by the format's standard.
    turned : y was up, and the points were turned.
    notes : sentences for the summary.
    merged : so many vertices more are in the file, at the places of others.
    colours : (n, 3) sRGB of the points; None when they have none.
    count : of the points in the file, where `points` are only the corners of their box.
    step : (3,) of which the coordinates are multiples by the file's own word, in its unit; None when it says none.
    units_m, stated_units_m : lengths of the units of x and y and of heights with which the points became metres, and
        those that the file itself says.
    """

    points: Array
    faces: NDArray[np.int32] | None = None
    grid_shape: tuple[int, int] | None = None
    system: CoordinateSystem = UNKNOWN
    up: str = "z"
    turned: bool = False
    notes: tuple[str, ...] = ()
    merged: int = 0
    colours: NDArray[np.uint8] | None = None
    count: int = 0
    step: Array | None = None
    units_m: tuple[float, float] = (1.0, 1.0)
    stated_units_m: tuple[float, float] = (1.0, 1.0)

    @property
    def crs(self) -> str:
        """ "EPSG:2056", another name that the file gives, or empty."""
        return self.system.name

    @property
    def vertical(self) -> str:
        """The system of the heights, likewise."""
        return self.system.vertical

    @property
    def kind(self) -> str:
        """ "mesh", "grid" or "cloud"."""
        return "mesh" if self.faces is not None else "grid" if self.grid_shape is not None else "cloud"


def unit_of_band(name: str, path: Path) -> float | None:
    """The length of a unit [m] that a grid names for its numbers; None when it names none.

    Raises
    ------
    InputError : it is no unit of length: the grid has something else than heights.
    """
    if not name:
        return None
    if name.lower() not in UNIT_NAMES:
        raise InputError(
            f'The grid is in "{name[:40]}", which is no unit of heights that is known',
            file=path,
            advice="Choose the elevation model, or export it in metres",
        )
    return UNIT_NAMES[name.lower()]


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
