# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts of other sites beside the scene's own: tables in files, kept by their path and a checksum."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ....core.errors import InputError, RockfallError
from ....core.exchange.database import digest
from ....core.exchange.tables import read_impacts
from ....core.reconstruction.impact import Impacts

LOOK_AGAIN_S = 2.0
"""A file is looked at no more often than this: graphs are drawn many times a second, and a disk may be far away."""


@dataclass(frozen=True, eq=False)
class OtherSites:
    """One table.

    Attributes
    ----------
    path : of the file.
    impacts : its rows, with a site each; None when it cannot be read.
    sites : names, in the order of first appearance.
    problem : why it is not shown, or that it is another file than the one that was added; empty without.
    """

    path: Path
    impacts: Impacts | None
    sites: tuple[str, ...] = ()
    problem: str = ""


@dataclass(eq=False)
class _File:
    """A file as it was when it was looked at last.

    Attributes
    ----------
    looked : when.
    state : time and size of the file; None without one.
    digest : checksum; empty where it cannot be read.
    table, changed : its rows, and the same for a list that knows the file with another checksum.
    """

    looked: float
    state: tuple[int, int] | None
    digest: str
    table: OtherSites
    changed: OtherSites


_files: dict[Path, _File] = {}


def of_scene(scene: bpy.types.Scene) -> tuple[OtherSites, ...]:
    """The tables that are shown, in the order of the list."""
    settings = scene.rockfall_comparison
    return tuple(of_row(row) for row in settings.databases if row.shown)


def of_row(row: bpy.types.PropertyGroup) -> OtherSites:
    """The table of a row of the list."""
    found = _look(path_of(row))
    return found.table if found.digest in ("", row.digest) else found.changed


def path_of(row: bpy.types.PropertyGroup) -> Path:
    """Where the file is: where it was added from, or else beside the .blend."""
    stored = Path(bpy.path.abspath(row.path))
    beside = Path(bpy.path.abspath("//")) / stored.name if bpy.data.filepath else stored
    return beside if not stored.is_file() and beside.is_file() else stored


def add(scene: bpy.types.Scene, path: Path) -> OtherSites:
    """Add a table to the list, or accept it as it is now.

    Raises
    ------
    RockfallError : it cannot be read, or it has no impacts.
    """
    table = _read(path)
    _files[path] = _File(time.monotonic(), _state(path), digest(path), table, _changed(table))
    rows = scene.rockfall_comparison.databases
    known = next((i for i, row in enumerate(rows) if path_of(row) == path), None)
    row = rows.add() if known is None else rows[known]
    row.path, row.digest, row.shown = str(path), _files[path].digest, True
    scene.rockfall_comparison.database = len(rows) - 1 if known is None else known
    return table


def _look(path: Path) -> _File:
    known, now = _files.get(path), time.monotonic()
    if known is not None and now - known.looked < LOOK_AGAIN_S:
        return known
    state = _state(path)
    if known is not None and known.state == state:
        known.looked = now
        return known
    try:
        table, checksum = _read(path), digest(path)
    except RockfallError as error:
        table, checksum = OtherSites(path, None, problem=str(error)), ""
    _files[path] = _File(now, state, checksum, table, _changed(table))
    return _files[path]


def _changed(table: OtherSites) -> OtherSites:
    text = f"{table.path.name} has changed since it was added: its impacts are those of the new file. Add it again."
    return replace(table, problem=table.problem or text)


def _state(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def _read(path: Path) -> OtherSites:
    if not path.is_file():
        raise InputError("The table of another site is not there", file=path, advice="Put it back, or remove it")
    impacts = read_impacts(path)
    if not len(impacts):
        raise InputError("The table has no impacts", file=path, advice="Choose one that has, or remove it")
    named = np.where(impacts.site == "", path.parent.name or path.stem, impacts.site)
    return OtherSites(path, replace(impacts, site=named), tuple(dict.fromkeys(named.tolist())))
