# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of partial factors: those that are shipped, and a person's own, as TOML.

title = "Our office"
share = 0.95                 # of the blocks that do not exceed the characteristic values
clearance_m = 0.5            # least free height above the design height

[[factor]]
symbol = "γ_Tr"
on = "speed"                 # mass, energy, height, capacity
value = 1.02
meaning = "reliability of the simulation"
source = "where it is from"
verified = true              # false: compared with no standard, which stands beside each number that it is in
"""

from difflib import get_close_matches
from math import nan
from pathlib import Path
from typing import cast

from ..errors import InputError
from ..hazard.design import ON, Factor, On, PartialFactors
from ..reading import reader
from .toml_text import TomlTable, read_toml

SHIPPED = Path(__file__).parents[2] / "assets" / "partial_factors"
USUAL = "uni_11211_4_literature"


def shipped_names() -> tuple[str, ...]:
    """Names of the tables that are there."""
    return tuple(sorted(file.stem for file in SHIPPED.glob("*.toml")))


def open_factors(name: str) -> PartialFactors:
    """A shipped table by its name, or a file.

    Raises
    ------
    InputError : neither; a table that is wrong.
    """
    names = shipped_names()
    if name in names:
        return read_factors(SHIPPED / f"{name}.toml")
    if not name.lower().endswith(".toml"):
        near = get_close_matches(name, names, n=1, cutoff=0.5)
        raise InputError(
            f"There are no partial factors {name!r}" + (f"; did you mean {near[0]}?" if near else ""),
            advice=f"There are {', '.join(names)}; or give a TOML file of your own",
        )
    return read_factors(name)


@reader("table of partial factors")
def read_factors(path: str | Path) -> PartialFactors:
    """A table of partial factors.

    Raises
    ------
    InputError : no such file, a value of a wrong type, with its key.
    """
    path = Path(path)
    table = TomlTable(read_toml(path, "table of partial factors"), "", path)
    factors = tuple(_factor(one) for one in table.tables("factor"))
    share = table.number("share", 0.95)
    if not share < 1:
        raise table.wrong("share", f"is {share:g}", "Give a number between 0 and 1")
    found = PartialFactors(
        table.text("title", path.stem),
        table.text("note", ""),
        share,
        table.number("clearance_m", 0.0, zero_allowed=True),
        factors,
    )
    unknown = sorted(table.rest())
    if unknown:
        raise table.wrong(unknown[0], "is not known here", "title, note, share, clearance_m and [[factor]] are")
    return found


def _factor(table: TomlTable) -> Factor:
    factor = Factor(
        table.text("symbol"),
        cast(On, table.choice("on", ON, ON[0])) if table.has("on") else cast(On, ""),
        table.number("value", 1.0) if table.has("value") else nan,
        table.text("meaning", ""),
        table.text("source", ""),
        table.flag("verified", True),
    )
    if not factor.on:
        raise table.wrong("on", "is missing", f"Give one of {', '.join(ON)}")
    unknown = sorted(table.rest())
    if unknown:
        raise table.wrong(unknown[0], "is not known here", "symbol, on, value, meaning, source and verified are")
    return factor
