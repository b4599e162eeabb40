# SPDX-License-Identifier: GPL-3.0-or-later
"""Traps that only the size and place of the data give away: degrees, millimetres, another axis, another project."""

from pathlib import Path

import numpy as np

from ..constants import UNITS_M
from ..errors import InputError
from ..georeference import LARGE_COORDINATE_M, GlobalShift
from ..vectors import Array
from .source import Source

HIGHEST_RELIEF_M = 9_000.0
"""More than any slope on Earth; a file with more is not in metres."""
HIGHEST_M, LOWEST_M = 9_000.0, -500.0
"""Of the ground on the Earth: Mount Everest, and the shore of the Dead Sea."""
NO_PLACE_M = 100_000.0
"""Heights that are all beyond this are another coordinate. Of a relief that cannot be either, the unit is asked for."""
FAR_M = 100_000.0
SWISS_EASTINGS_M, SWISS_NORTHINGS_M = (2.4e6, 2.9e6), (1.0e6, 1.4e6)
"""LV95 (EPSG:2056), with some room about the country."""
EASTINGS_M, NORTHINGS_M = (100_000.0, 900_000.0), (1_500_000.0, 9_400_000.0)
"""UTM away from the equator; eastings beyond 1 500 000 m of other systems come with northings beyond 900 000 m."""
FOOT_M = UNITS_M["ft"]
STEEPEST_DEG, WIDE_M, ACROSS = 60.0, 100.0, 20
FEWEST = 20
"""With fewer points or cells nothing is said of heights."""
APART_M, MOST_APART, BINS = 100.0, 0.2, 2000
"""Points apart from all others: by how much, what share of all at most, and into how many classes heights are put."""
MUCH_MORE = 4.0
Y_UP = "The surface faces along y much more than along z: if y points up in this file, read it with Y up."


def refuse_impossible(source: Source, low: Array, high: Array, unit_m: float | None, path: Path) -> None:
    """Refuse coordinates that are no plane ones with heights on the Earth.

    Parameters
    ----------
    low, high : (3,) of its box [m].
    unit_m : as the user says; None when nothing was said.

    Raises
    ------
    InputError : the file says that it is geographic, or looks like it: small x and y, heights far beyond them; it is
        geocentric; its heights are depths; no place on the Earth has such heights.
    """
    if source.system.kind == "geocentric":
        raise InputError(
            f"The coordinates are geocentric ({source.crs or 'from the centre of the Earth'})",
            file=path,
            advice="Transform them to a projected system in metres (for instance the local UTM zone)",
        )
    if source.system.depths:
        raise InputError(
            f"The heights are depths, which grow downwards ({source.vertical or source.crs})",
            file=path,
            advice="Transform them to heights",
        )
    lowest = min(abs(low[2]), abs(high[2])) if low[2] * high[2] > 0 else 0.0
    if lowest > NO_PLACE_M and high[2] - low[2] <= HIGHEST_RELIEF_M:
        where, _, order = exchanged_axes(low, high).rstrip(".").partition(": ")
        check = "Check the order of x, y and z, whether the first column is a number, and the unit"
        raise InputError(
            f"Heights from {low[2]:,.0f} to {high[2]:,.0f} m are nowhere on the Earth"
            + (f": {where}" if order else ""),
            file=path,
            advice=f"{order[:1].upper()}{order[1:]}" if order else check,
        )
    extent = high - low
    within_globe = np.abs([low[:2], high[:2]]).max(axis=0) <= [180.0, 90.0]
    flat = extent[:2].max()
    looks = bool(within_globe.all()) and 0 < flat < 2 and extent[2] > 20 * flat and unit_m in (None, 1.0)
    geographic = source.system.kind == "geographic"
    if geographic or looks:
        says = (
            f"The file is in degrees ({source.crs or 'geographic'})"
            if geographic
            else "The coordinates look like degrees"
        )
        raise InputError(
            f"{says}: x from {low[0]:.6g} to {high[0]:.6g}, y from {low[1]:.6g} to {high[1]:.6g}",
            file=path,
            advice="Transform it to a projected system in metres (for instance the local UTM zone)",
        )


def of_heights(points: Array) -> list[str]:
    """What speaks against the heights of points (n, 3), or of vertices of a surface [m]; nothing without heights.

    Notes
    -----
    Real terrain has no empty range of heights that is wider than all the rest, and is not steeper than `STEEPEST_DEG`
    on the whole: rock faces are, but not where they are as deep in plan as `WIDE_M`. Heights in feet over metres make
    71° of 41°.
    """
    known = points[np.isfinite(points[:, 2])]
    if len(known) < FEWEST:
        return []
    return [*_apart(known[:, 2]), *_steep(known)]


def _apart(heights: Array) -> list[str]:
    """A few heights that are far away from all others: pits or spikes."""
    low, high = float(heights.min()), float(heights.max())
    if high - low < APART_M:
        return []
    number, edges = np.histogram(heights, BINS, (low, high))
    filled = np.flatnonzero(number)
    gap = int(np.argmax(np.diff(filled)))
    below = int(number[: filled[gap] + 1].sum())
    first, last = (filled[0], filled[gap]), (filled[gap + 1], filled[-1])
    width = float(edges[last[0]] - edges[first[1] + 1])
    most, few = (last, first) if below * 2 < len(heights) else (first, last)
    count = min(below, len(heights) - below)
    rest = float(edges[most[1] + 1] - edges[most[0]])
    if width < max(APART_M, rest) or count > MOST_APART * len(heights):
        return []
    way, what = ("below", "pits") if few is first else ("above", "spikes")
    one = count == 1
    return [
        f"{count:,} point{'' if one else 's'} lie{'s' if one else ''} {width:,.0f} m or more {way} all others, at "
        f"{edges[few[0]]:,.0f} to {edges[few[1] + 1]:,.0f} m. Such {what} are no ground: remove them, or declare their "
        "height as no data."
    ]


def _steep(points: Array) -> list[str]:
    """Slopes of the means in cells, of which there are `ACROSS` along the longer side."""
    low, extent = points[:, :2].min(axis=0), np.ptp(points[:, :2], axis=0)
    if extent.min() < WIDE_M:
        return []
    size = float(extent.max()) / ACROSS
    shape = np.maximum(np.ceil(extent / size).astype(np.int64), 1)
    column, row = np.minimum(((points[:, :2] - low) / size).astype(np.int64), shape - 1).T
    cell, cells = column * shape[1] + row, int(shape.prod())
    count = np.bincount(cell, minlength=cells)
    with np.errstate(invalid="ignore"):
        mean = (np.bincount(cell, points[:, 2], cells) / count).reshape(shape)
    along_x, along_y = (mean[2:, 1:-1] - mean[:-2, 1:-1]), (mean[1:-1, 2:] - mean[1:-1, :-2])
    slope = np.hypot(along_x, along_y) / (2 * size)
    slope = slope[np.isfinite(slope)]
    if len(slope) < FEWEST:
        return []
    median = float(np.degrees(np.arctan(np.median(slope))))
    if median < STEEPEST_DEG:
        return []
    in_feet = np.degrees(np.arctan(np.median(slope) * FOOT_M))
    return [
        f"Half of the terrain is steeper than {median:.0f}° over {extent[0]:,.0f} × {extent[1]:,.0f} m, which hardly "
        f"any slope is: are its heights in feet (then it would be {in_feet:.0f}°), or "
        "exaggerated? Give the unit of its heights."
    ]


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
        if within(1, LOWEST_M, HIGHEST_M) and survey(0):
            advice = "read it with Y up" if high[2] < 0 else "exchange y and z in the file"
            return f"{place}, and y from {low[1]:,.0f} to {high[1]:,.0f} m may be: {advice}."
        if within(0, LOWEST_M, HIGHEST_M) and survey(1):
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
    if not notes and (high - low)[2] <= HIGHEST_RELIEF_M and (high[2] > HIGHEST_M or low[2] < LOWEST_M):
        notes.append(
            f"Heights from {low[2]:,.0f} to {high[2]:,.0f} m are not those of ground on the Earth: check their unit "
            "and the order of the columns."
        )
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
