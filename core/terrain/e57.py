# SPDX-License-Identifier: GPL-3.0-or-later
"""Scans in E57 (ASTM E2807), read by an optional library."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DependencyError, InputError
from ..extras import E57, install_command, is_there
from ..reading import check_promise
from ..vectors import Array
from .crs import system_beside, system_from_wkt
from .scan_colours import Colours, colours_of, joined_colours
from .source import Source

SIGNATURE = b"ASTM-E57"
COLOURS = ("Red", "Green", "Blue")


def read_e57(path: Path) -> Source:
    """Read all scans of an E57 file, each put in its place by its pose; points marked as invalid are left out.

    Raises
    ------
    InputError : not an E57 file, damaged, without points.
    DependencyError : the library is missing.
    """
    size = path.stat().st_size
    if not size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with path.open("rb") as file:
        if file.read(len(SIGNATURE)) != SIGNATURE:
            raise InputError(f'Not an E57 file: it does not begin with "{SIGNATURE.decode()}"', file=path)
    if not is_there(E57):
        raise DependencyError(
            f"{path}: E57 files need {E57[2]}, which is not here. With Python, install it: {install_command(E57)}. "
            "Blender's extension does not bring it: convert the file to LAZ (CloudCompare does), or to PLY with "
            "`rockfall terrain`, and import that."
        )
    import pye57

    opened = pye57.E57(str(path))
    try:
        counts = [opened.get_header(i).point_count for i in range(opened.scan_count)]
        check_promise(f"{sum(counts):,} points", sum(counts), size, path)
        scans_of = [_scan(opened, i) for i in range(len(counts)) if counts[i]]
        system = _system(opened)
    finally:
        opened.close()
    points = np.concatenate([points for points, _ in scans_of]) if scans_of else np.empty((0, 3))
    if not len(points):
        raise InputError("The file has no points", file=path, advice="Export its scans with their points")
    scans = "a scan" if len(counts) == 1 else f"{len(counts)} scans"
    note = f"Cloud of {len(points):,} points in {scans}."
    if invalid := sum(counts) - len(points):
        note += f" Left out {invalid:,} that the scanner marked as invalid."
    colours, said = joined_colours([(found, f"scan {i}") for i, (_, found) in enumerate(scans_of, start=1)])
    known = system_from_wkt(system) if system else system_beside(path)
    notes = (note, said) if said else (note,)
    return Source(points, system=known, notes=notes, colours=colours)


def _scan(opened: Any, number: int) -> tuple[Array, Colours | None]:
    """Points of a scan, and their colours."""
    coloured = {f"color{name}" for name in COLOURS} <= set(opened.get_header(number).point_fields)
    found = opened.read_scan(number, ignore_missing_fields=True, colors=coloured)
    points = np.stack([np.asarray(found[f"cartesian{axis}"], dtype=np.float64) for axis in "XYZ"], axis=1)
    numbers = [np.asarray(found[f"color{name}"]) for name in COLOURS] if coloured else []
    return points, colours_of(np.stack(numbers, axis=1))[0] if coloured else None


def _system(opened: Any) -> str:
    """The coordinate reference system in WKT, empty where the file says nothing."""
    if not opened.root.isDefined("coordinateMetadata"):
        return ""
    return str(opened.root["coordinateMetadata"].value()).strip()
