# SPDX-License-Identifier: GPL-3.0-or-later
"""Make `core/terrain/epsg_units.py`: the EPSG codes of systems that are not in metres, from PROJ's database.

    .venv/bin/python scripts/making/epsg_units.py

The database is the one that rasterio brings. Run it again when EPSG has new systems.
"""

import sqlite3
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from textwrap import wrap

import rasterio

TARGET = Path(__file__).parents[2] / "core" / "terrain" / "epsg_units.py"
AXES = """
SELECT DISTINCT crs.code, unit.conv_factor, axis.orientation FROM {table} AS crs
JOIN axis ON axis.coordinate_system_auth_name = crs.coordinate_system_auth_name
    AND axis.coordinate_system_code = crs.coordinate_system_code
JOIN unit_of_measure AS unit ON unit.auth_name = axis.uom_auth_name AND unit.code = axis.uom_code
WHERE crs.auth_name = 'EPSG' AND axis.coordinate_system_order <= {axes}
"""
TEMPLATE = '''# SPDX-License-Identifier: GPL-3.0-or-later
"""EPSG codes of coordinate systems that are not in metres. Made by `scripts/making/epsg_units.py`; not edited by hand.

Source: the EPSG dataset {version} of IOGP (epsg.org), in the database of PROJ. A compound system is in the lists of its
horizontal and of its vertical part.
"""

from collections.abc import Mapping

HORIZONTAL: Mapping[float, str] = {horizontal}
"""Length of the unit of x and y [m] → codes of projected systems and of compound ones."""

VERTICAL: Mapping[float, str] = {vertical}
"""Length of the unit of heights [m] → codes of vertical systems and of compound ones."""

DEPTHS = {depths}
"""Vertical systems whose numbers grow downwards, and compound ones with them."""

GEOGRAPHIC = {geographic}
"""Systems of longitudes and latitudes, and compound ones with them."""

GEOCENTRIC = {geocentric}
"""Systems whose origin is the centre of the Earth."""

LENGTHS: Mapping[int, float] = {lengths}
"""Code of a unit of length → its length [m]."""
'''


def ranges(codes: Iterable[int]) -> str:
    """ "2222-2224 2229": numbers as ranges."""
    found: list[list[int]] = []
    for code in sorted(set(codes)):
        if found and code == found[-1][1] + 1:
            found[-1][1] = code
        else:
            found.append([code, code])
    return " ".join(f"{first}-{last}" if last > first else f"{first}" for first, last in found)


def literal(text: str, indent: int) -> str:
    """A string of many words as a Python expression of several lines."""
    lines = wrap(text, 108 - indent)
    if len(lines) < 2:
        return f'"{text}"'
    margin = " " * (indent + 4)
    body = "\n".join(f'{margin}"{line}{"" if line == lines[-1] else " "}"' for line in lines)
    return f"(\n{body}\n{' ' * indent})"


def table(codes: dict[float, set[int]]) -> str:
    """A dictionary as Python source."""
    rows = [f"    {unit!r}: {literal(ranges(codes[unit]), 4)},\n" for unit in sorted(codes)]
    return f"{{\n{''.join(rows)}}}"


def main() -> None:
    """Write the module."""
    file = Path(rasterio.__file__).parent / "proj_data" / "proj.db"
    with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as database:
        ask = database.execute
        (version,) = ask("SELECT value FROM metadata WHERE key = 'EPSG.VERSION'").fetchone()
        plane = {code: unit for code, unit, _ in ask(AXES.format(table="projected_crs", axes=2))}
        upright = {code: (unit, way) for code, unit, way in ask(AXES.format(table="vertical_crs", axes=1))}
        types = dict(ask("SELECT code, type FROM geodetic_crs WHERE auth_name = 'EPSG'"))
        lengths = dict(
            ask("SELECT code, conv_factor FROM unit_of_measure WHERE auth_name = 'EPSG' AND type = 'length'")
        )
        query = "SELECT code, horiz_crs_code, vertical_crs_code FROM compound_crs WHERE auth_name = 'EPSG'"
        compound = [tuple(map(int, row)) for row in ask(query)]
    horizontal: dict[float, set[int]] = defaultdict(set)
    vertical: dict[float, set[int]] = defaultdict(set)
    depths = {code for code, (_, way) in upright.items() if way == "down"}
    geographic = {code for code, type_ in types.items() if type_ != "geocentric"}
    for code, flat, height in [*((c, c, 0) for c in plane), *((c, 0, c) for c in upright), *compound]:
        if plane.get(flat, 1.0) != 1.0:
            horizontal[plane[flat]].add(code)
        unit, way = upright.get(height, (1.0, "up"))
        if unit != 1.0:
            vertical[unit].add(code)
        if way == "down":
            depths.add(code)
        if types.get(flat, "geocentric") != "geocentric":
            geographic.add(code)
    unlike = [code for code, flat, height in compound if plane.get(flat, 1.0) != 1.0 and upright[height][0] == 1.0]
    assert not unlike, f"{unlike}: heights in metres over feet, which the lists cannot say"
    TARGET.write_text(
        TEMPLATE.format(
            version=version,
            horizontal=table(horizontal),
            vertical=table(vertical),
            depths=literal(ranges(depths), 0),
            geographic=literal(ranges(geographic), 0),
            lengths=f"{{{', '.join(f'{int(code)}: {lengths[code]!r}' for code in sorted(lengths))}}}",
            geocentric=literal(ranges(code for code, type_ in types.items() if type_ == "geocentric"), 0),
        ),
        encoding="utf-8",
    )


if __name__ == "__main__":
    main()
