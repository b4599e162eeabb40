# SPDX-License-Identifier: GPL-3.0-or-later
"""A database as a Frictionless Data Package: impacts.csv, and datapackage.json that says what is in it.

https://specs.frictionlessdata.io: any program that knows the standard can read and validate it. What the standard does
not have (units, the digest and the blocks of a source) are further properties, which it allows.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ..errors import InputError
from ..output import write_text
from ..reading import reader, reading
from ..vectors import numbered
from .database import SOURCE, Database, Source, Span, digest
from .impact_fields import field_of
from .tables import read_impacts, write_impacts

DESCRIPTOR, TABLE = "datapackage.json", "impacts.csv"
SPANS = ("diameter_m", "mass_kg", "normal_radius_m")


def write_package(database: Database, folder: str | Path, title: str = "Measured rockfall impacts") -> None:
    """Write impacts.csv and datapackage.json."""
    folder = Path(folder)
    impacts = database.impacts
    numbers = (database.source + 1).astype(np.str_)
    write_impacts(replace(impacts, extra={**impacts.extra, SOURCE: numbers}), folder / TABLE)
    with (folder / TABLE).open(encoding="utf-8") as stream:
        columns = stream.readline().rstrip("\n").split(",")
    licences = dict.fromkeys(source.licence for source in database.sources if source.licence)
    content = {
        "profile": "tabular-data-package",
        "name": "rockfall-impacts",
        "title": title,
        "licenses": [{"name": licence} for licence in licences],
        "sources": [_source(source) for source in database.sources],
        "resources": [
            {
                "profile": "tabular-data-resource",
                "name": "impacts",
                "path": TABLE,
                "format": "csv",
                "mediatype": "text/csv",
                "encoding": "utf-8",
                "bytes": (folder / TABLE).stat().st_size,
                "hash": f"sha256:{digest(folder / TABLE)}",
                "schema": {
                    "fields": [_field(name) for name in columns],
                    "missingValues": [""],
                    **_primary_key(database),
                },
            }
        ],
    }
    if not licences:
        del content["licenses"]  # the standard has no empty list
    text = json.dumps(content, ensure_ascii=False, indent=2)
    write_text(folder / DESCRIPTOR, text + "\n")


@reader("package")
def read_package(path: str | Path) -> Database:
    """Read a package that `write_package` wrote, from its folder or its datapackage.json.

    Raises
    ------
    InputError : no such file, no package of ours, a table that was changed since, anything wrong with the table.
    """
    path = Path(path)
    path = path / DESCRIPTOR if path.is_dir() else path
    with reading(path, "JSON of the package", "Write the package again"):
        content = json.loads(path.read_text(encoding="utf-8"))
    try:
        resource = content["resources"][0]
        table, expected = PurePosixPath(resource["path"]), str(resource["hash"])
        sources = tuple(_read_source(source) for source in content["sources"])
    except (KeyError, IndexError, TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"This is no package of impacts with its sources ({error!r})", file=path, advice="Make it by rockfall merge"
        ) from error
    if table.is_absolute() or ".." in table.parts:
        raise InputError(
            f"The table {table} is outside the package", file=path, advice="Put it beside datapackage.json"
        )
    file = path.parent / table
    impacts = read_impacts(file)
    if f"sha256:{digest(file)}" != expected:
        raise InputError(
            "The table was changed since its package was written",
            file=file,
            advice="Merge it again, so that the package says what it is",
        )
    cells = impacts.extra.get(SOURCE, np.zeros(len(impacts), dtype="U1"))
    named = {str(i): i - 1 for i in range(1, len(sources) + 1)}
    values, code = numbered(cells)
    unknown = [str(value) for (value,) in values if value not in named]
    if unknown:
        raise InputError(
            f"A row has the source {unknown[0]!r}, of {len(sources)}", file=file, advice="Write the package again"
        )
    source = np.array([named[str(value)] for (value,) in values], dtype=np.intp)[code]
    extra = {name: column for name, column in impacts.extra.items() if name != SOURCE}
    return Database(replace(impacts, extra=extra), source, sources)


def _primary_key(database: Database) -> dict[str, list[str]]:
    impacts = database.impacts
    key = ("site", "trajectory", *impacts.runs, "impact")
    unique = len(numbered(*impacts.falls, impacts.impact)[0]) == len(database)
    return {"primaryKey": list(key)} if unique else {}


def _field(name: str) -> dict[str, Any]:
    field = field_of(name)
    limits = {"minimum": field.minimum, "maximum": field.maximum}
    constraints: dict[str, Any] = {key: value for key, value in limits.items() if value == value}
    if field.required:
        constraints["required"] = True
    entry: dict[str, Any] = {"name": name, "type": field.kind, "description": field.description}
    entry |= {"unit": field.unit} if field.unit else {}
    return entry | ({"constraints": constraints} if constraints else {})


def _source(source: Source) -> dict[str, Any]:
    entry = asdict(source)
    for name in SPANS:
        entry[name] = [None if value != value else value for value in entry[name]]
    return {"title": ", ".join(source.sites) or source.file, "path": entry.pop("file"), **entry}


def _read_source(entry: dict[str, Any]) -> Source:
    spans: dict[str, Span] = {}
    for name in SPANS:
        low, high = (np.nan if value is None else float(value) for value in entry[name])
        spans[name] = low, high
    return Source(
        file=str(entry["path"]),
        sha256=str(entry["sha256"]),
        sites=tuple(map(str, entry["sites"])),
        licence=str(entry["licence"]),
        impacts=int(entry["impacts"]),
        doubts=tuple(map(str, entry["doubts"])),
        **spans,
    )
