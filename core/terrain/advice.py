# SPDX-License-Identifier: GPL-3.0-or-later
"""Traps that only the size and place of the data give away: degrees, millimetres, another axis, another project."""

from pathlib import Path

import numpy as np

from ..errors import InputError
from ..georeference import LARGE_COORDINATE_M, GlobalShift
from ..vectors import Array
from .source import Source

HIGHEST_RELIEF_M = 9_000.0
"""More than any slope on Earth; a file with more is not in metres."""
FAR_M = 100_000.0
MUCH_MORE = 4.0
Y_UP = "The surface faces along y much more than along z: if y points up in this file, read it with Y up."


def refuse_degrees(source: Source, low: Array, high: Array, unit_m: float, path: Path) -> None:
    """Coordinates in degrees cannot be terrain: x and y would be 100 000 times too short.

    Raises
    ------
    InputError : the file says that it is geographic, or looks like it: small x and y, heights far beyond them.
    """
    extent = high - low
    within_globe = np.abs([low[:2], high[:2]]).max(axis=0) <= [180.0, 90.0]
    flat = extent[:2].max()
    looks = bool(within_globe.all()) and 0 < flat < 2 and extent[2] > 20 * flat and unit_m == 1.0
    if source.geographic or looks:
        says = (
            f"The file is in degrees ({source.crs or 'geographic'})"
            if source.geographic
            else "The coordinates look like degrees"
        )
        raise InputError(
            f"{says}: x from {low[0]:.6g} to {high[0]:.6g}, y from {low[1]:.6g} to {high[1]:.6g}",
            file=path,
            advice="Transform it to a projected system in metres (for instance the local UTM zone)",
        )


def faces_along_y(points: Array) -> bool:
    """Whether points (n, 3) lie about a plane that faces along y much more than along z."""
    scatter = points - points.mean(axis=0)
    across = np.abs(np.linalg.eigh(scatter.T @ scatter)[1][:, 0])
    return bool(across[1] > MUCH_MORE * across[2] and across[1] > across[0])


def mesh_faces_along_y(total: Array) -> bool:
    """Whether a mesh of some total vector area (3,) faces along y much more than along z."""
    across = np.abs(total)
    return bool(across[1] > MUCH_MORE * across[2] and across[1] > across[0])


def sentences(low: Array, high: Array, shift: GlobalShift) -> list[str]:
    """Advice on units and place, for the summary."""
    notes = []
    if (high - low)[2] > HIGHEST_RELIEF_M:
        notes.append(
            f"The relief of {(high - low)[2]:,.0f} m suggests another unit: "
            "if the file is in millimetres, read it with 0.001 m per unit."
        )
    far = np.abs((low + high) / 2 - shift.vector).max()
    if far > FAR_M:
        notes.append(f"The terrain is {far / 1000:,.0f} km from the project's origin: check the shift and the system.")
    elif far > LARGE_COORDINATE_M:
        notes.append(f"Local coordinates reach {far:,.0f} m: Blender shows them to about a millimetre at best.")
    return notes
