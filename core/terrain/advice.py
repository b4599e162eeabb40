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
HEIGHTS_M = (-500.0, 9_000.0)
"""Of land: the Dead Sea lies at −430 m, Mount Everest at 8 849 m."""
SWISS_EASTINGS_M, SWISS_NORTHINGS_M = (2.4e6, 2.9e6), (1.0e6, 1.4e6)
"""LV95 (EPSG:2056), with some room about the country."""
EASTINGS_M, NORTHINGS_M = (100_000.0, 900_000.0), (1_500_000.0, 9_400_000.0)
"""UTM away from the equator; eastings beyond 1 500 000 m of other systems come with northings beyond 900 000 m."""
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


def exchanged_axes(low: Array, high: Array) -> str:
    """What to say of a box in survey coordinates whose axes seem to be exchanged; empty where they do not.

    Heights are never as large as survey coordinates; eastings and northings are told apart where their systems do.
    """

    def within(axis: int, least: float, most: float) -> bool:
        return bool(low[axis] >= least and high[axis] <= most)

    def survey(axis: int) -> bool:
        return bool(low[axis] > LARGE_COORDINATE_M or high[axis] < -LARGE_COORDINATE_M)

    if survey(2) and (survey(0) or survey(1)):
        place = f"z from {low[2]:,.0f} to {high[2]:,.0f} m is no height"
        if within(1, *HEIGHTS_M) and survey(0):
            advice = "read it with Y up" if high[2] < 0 else "exchange y and z in the file"
            return f"{place}, and y from {low[1]:,.0f} to {high[1]:,.0f} m may be: {advice}."
        if within(0, *HEIGHTS_M) and survey(1):
            return f"{place}, and x from {low[0]:,.0f} to {high[0]:,.0f} m may be: bring them into the order x, y, z."
        return f"{place}: check which columns or axes are x, y and z."
    swiss = within(0, *SWISS_NORTHINGS_M) and within(1, *SWISS_EASTINGS_M)
    if swiss or (within(0, *NORTHINGS_M) and within(1, *EASTINGS_M)):
        return (
            f"x from {low[0]:,.0f} to {high[0]:,.0f} m looks like a northing, and y from {low[1]:,.0f} to "
            f"{high[1]:,.0f} m like an easting: if they are exchanged, the terrain is a mirror image. "
            "Exchange x and y in the file."
        )
    return ""


def sentences(low: Array, high: Array, shift: GlobalShift) -> list[str]:
    """Advice on units, axes and place, for the summary."""
    notes = list(filter(None, [exchanged_axes(low, high)]))
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
