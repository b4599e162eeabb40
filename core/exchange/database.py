# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts of several sites in one table, each row knowing where it is from."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ..errors import InputError
from ..reading import reader
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, Mask
from .duplicates import Duplicates, find_duplicates
from .selection import joined, rows_of
from .tables import read_impacts
from .unit_checks import check_units

SOURCE = "source"
"""Column of impacts.csv with the number of the source, from 1."""
OnDuplicates = Literal["drop", "keep", "refuse"]
Span = tuple[float, float]
"""Least and greatest; NaN when nowhere defined."""


@dataclass(frozen=True)
class Source:
    """Where rows are from.

    Attributes
    ----------
    file, sha256 : name of the table without its folder, and the digest of its bytes.
    sites : names, in the order of first appearance.
    licence : as the owner states it; "" when not stated.
    impacts : rows taken from it.
    diameter_m, mass_kg, normal_radius_m : spans of the blocks and of the terrain normal's radius.
    doubts : sentences about units that are implausible.
    """

    file: str
    sha256: str
    sites: tuple[str, ...]
    licence: str
    impacts: int
    diameter_m: Span
    mass_kg: Span
    normal_radius_m: Span
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Database:
    """n impacts and their sources.

    Attributes
    ----------
    impacts : the rows.
    source : (n,) index into `sources`.
    sources : where they are from.
    """

    impacts: Impacts
    source: Indices
    sources: tuple[Source, ...]

    def __len__(self) -> int:
        return len(self.impacts)

    def rows(self, rows: Indices | Mask) -> "Database":
        """Some of the rows; all sources stay, with the number of rows that are left of each."""
        source = self.source[rows]
        left = np.bincount(source, minlength=len(self.sources)).tolist()
        sources = tuple(replace(one, impacts=count) for one, count in zip(self.sources, left, strict=True))
        return Database(rows_of(self.impacts, rows), source, sources)


@dataclass(frozen=True, eq=False)
class Merged:
    """A database made of several.

    Attributes
    ----------
    database : without the duplicates, if they were to be dropped.
    duplicates : rows among all that were read.
    everything : all that was read.
    """

    database: Database
    duplicates: Duplicates
    everything: Database


@reader("table of impacts")
def read_source(path: str | Path, site: str = "", licence: str = "") -> Database:
    """Read one table of impacts, with its units checked.

    Parameters
    ----------
    site : for rows that name none.
    licence : of the table.

    Raises
    ------
    InputError : anything that is wrong with the table; units that are surely others; a row without a site.
    """
    path = Path(path)
    impacts = read_impacts(path)
    doubts = check_units(impacts, path)
    sites = np.where(impacts.site == "", site, impacts.site)
    if (sites == "").any():
        raise InputError("There is a row that names no site", file=path, advice="Fill the column site, or give --site")
    extra = {name: cells for name, cells in impacts.extra.items() if name != SOURCE}
    if "run" in extra and SOURCE in impacts.extra:
        extra.setdefault("simulated_with", impacts.extra[SOURCE])
    source = Source(
        path.name,
        digest(path),
        tuple(dict.fromkeys(sites.tolist())),
        licence,
        len(impacts),
        _span(impacts.diameter_m),
        _span(impacts.mass_kg),
        _span(impacts.normal_radius_m),
        tuple(doubts),
    )
    return Database(replace(impacts, site=sites, extra=extra), np.zeros(len(impacts), dtype=np.intp), (source,))


def merge(parts: Sequence[Database], duplicates: OnDuplicates = "drop") -> Merged:
    """One database of several.

    Parameters
    ----------
    duplicates : "drop" all but the first of the same impact, "keep" them all, or "refuse" any.

    Raises
    ------
    InputError : nothing to merge; a duplicate that is refused.
    """
    if duplicates not in get_args(OnDuplicates):
        raise InputError(f"Duplicates cannot be {duplicates!r}", advice=f"Choose {', '.join(get_args(OnDuplicates))}")
    if not parts:
        raise InputError("There are no tables to merge")
    offsets = np.cumsum([0, *(len(part.sources) for part in parts)]).tolist()
    everything = Database(
        joined([part.impacts for part in parts]),
        np.concatenate([part.source + offset for part, offset in zip(parts, offsets, strict=False)]),
        tuple(source for part in parts for source in part.sources),
    )
    found = find_duplicates(everything.impacts)
    if duplicates == "refuse" and len(found):
        raise InputError(
            f"{len(found)} impacts are there twice; the first is {_named(everything, int(found.row[0]))}, "
            f"the same as {_named(everything, int(found.first[0]))}",
            advice="Remove one of the tables, or take --duplicates drop",
        )
    kept: Mask = np.ones(len(everything), dtype=np.bool_)
    if duplicates == "drop":
        kept[found.row] = False
    return Merged(everything.rows(kept) if not kept.all() else everything, found, everything)


def digest(path: str | Path) -> str:
    """SHA-256 of a file."""
    with Path(path).open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _named(database: Database, row: int) -> str:
    impacts, source = database.impacts, database.sources[int(database.source[row])]
    return f"{impacts.site[row]}, {impacts.trajectory[row]}, impact {impacts.impact[row]} in {source.file}"


def _span(values: Array) -> Span:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (np.nan, np.nan)
