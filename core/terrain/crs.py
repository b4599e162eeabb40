# SPDX-License-Identifier: GPL-3.0-or-later
"""Coordinate reference systems, as files state them: their names, and the units of coordinates and of heights."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

from ..constants import UNITS_M
from . import epsg_units

GEOGRAPHIC_TYPE, PROJECTED_TYPE, PROJECTED_CITATION = 2048, 3072, 3073
LINEAR_UNIT, LINEAR_UNIT_SIZE = 3076, 3077
VERTICAL_TYPE, VERTICAL_UNIT = 4096, 4099
MODEL_TYPE, CITATION, MODEL_GEOGRAPHIC, MODEL_GEOCENTRIC = 1024, 1026, 2, 3
DOUBLES, TEXTS = 34736, 34737
"""Tags of a GeoTIFF, and record numbers of LAS, with the values of keys that are no short integers."""
USER_DEFINED = 32767
ESRI_TEXT = "ESRI PE String = "
"""Before the well-known text that Esri's programs put into a citation."""
IN_METRES = " in metres"
"""After the name of a system in other units whose coordinates are here in metres."""
SAME = 1e-9
"""Relative difference of two lengths that are the same unit, written with more or fewer digits."""

MOST_LETTERS = 1_000_000
"""Of a file beside another one."""

type Kind = Literal["plane", "geographic", "geocentric"]
type Node = tuple[str, list["Node | str"]]


@dataclass(frozen=True)
class CoordinateSystem:
    """What a file says of its coordinates.

    Attributes
    ----------
    name : "EPSG:2056", another name, or empty.
    vertical : the system of the heights, likewise.
    kind : "plane" for projected and local systems and where nothing is said, "geographic" for degrees, "geocentric".
    unit_m : length of the unit of x and y [m]; None when nothing says it.
    height_unit_m : that of the heights, likewise.
    depths : the heights are depths, and grow downwards.
    """

    name: str = ""
    vertical: str = ""
    kind: Kind = "plane"
    unit_m: float | None = None
    height_unit_m: float | None = None
    depths: bool = False

    def filled(self, other: "CoordinateSystem") -> "CoordinateSystem":
        """With what another one says where this one says nothing; their names are not compared."""
        flat, height = (other if not self.name else self), (other if not self.vertical else self)
        return CoordinateSystem(
            self.name or other.name,
            self.vertical or other.vertical,
            flat.kind if self.kind == "plane" else self.kind,
            self.unit_m if self.unit_m is not None else flat.unit_m,
            self.height_unit_m if self.height_unit_m is not None else height.height_unit_m,
            height.depths or self.depths,
        )

    def with_height_unit(self, length_m: float | None) -> "CoordinateSystem":
        """With the unit that the heights themselves state, which goes before their system's; None changes nothing."""
        return self if length_m is None else replace(self, height_unit_m=length_m)

    def metric(self) -> "CoordinateSystem":
        """The system of the same coordinates in metres, which has no code of its own where the unit is another."""
        return replace(
            self,
            name=_in_metres(self.name, named_system(self.name).unit_m, self.unit_m),
            vertical=_in_metres(self.vertical, named_system("", self.vertical).height_unit_m, self.height_unit_m),
            unit_m=1.0,
            height_unit_m=1.0,
        )


UNKNOWN = CoordinateSystem()
"""Nothing is said."""


def named_system(name: str, vertical: str = "") -> CoordinateSystem:
    """What is known of a system by its name.

    Parameters
    ----------
    name : "EPSG:2229", of a compound system also "EPSG:32611+6360"; of other names nothing is known.
    vertical : the system of the heights, which goes before the part of a compound name.

    Examples
    --------
    >>> named_system("EPSG:2229").unit_m
    0.3048006096012192
    """
    flat, upright = _parts(name), _parts(vertical)
    if flat and flat[1] and not vertical:
        name, vertical = f"EPSG:{flat[0]}", f"EPSG:{flat[1]}"
        upright = (flat[1], 0, False)
    unit: float | None = None
    height: float | None = None
    kind: Kind = "plane"
    depths = False
    if flat:
        lists = _lists()
        unit = 1.0 if flat[2] else lists["horizontal"].get(flat[0], 1.0)
        height = 1.0 if flat[2] else lists["vertical"].get(flat[0])
        kind = "geographic" if flat[0] in lists["geographic"] else kind
        kind = "geocentric" if flat[0] in lists["geocentric"] else kind
        depths = flat[0] in lists["depths"]
    if upright:
        height = 1.0 if upright[2] else _lists()["vertical"].get(upright[0], 1.0)
        depths = upright[0] in _lists()["depths"]
    return CoordinateSystem(name, vertical, kind, unit, height, depths)


def metric_name(name: str) -> str:
    """The name of a system whose coordinates are here in metres: "EPSG:2056", but "EPSG:2229 in metres"."""
    return named_system(name).metric().name


def system_from_geokeys(keys: Mapping[int, float | str]) -> CoordinateSystem:
    """From GeoTIFF keys (OGC 19-008r4), as `geokeys` gives them.

    A unit that is stated goes before that of the code, as in GDAL.
    """

    def number(key: int) -> int:
        value = keys.get(key, 0)
        return 0 if isinstance(value, str) else int(value)

    code, geographic = number(PROJECTED_TYPE), number(GEOGRAPHIC_TYPE)
    if not code and (number(MODEL_TYPE) == MODEL_GEOGRAPHIC or geographic):
        kind: Kind = "geographic"
        code = geographic
    else:
        kind = "plane"
    kind = "geocentric" if number(MODEL_TYPE) == MODEL_GEOCENTRIC else kind
    vertical = number(VERTICAL_TYPE)
    known = named_system(*(f"EPSG:{one}" if 0 < one < USER_DEFINED else "" for one in (code, vertical)))
    for citation in (PROJECTED_CITATION, CITATION):
        text = str(keys.get(citation, ""))
        if not known.name and text.startswith(ESRI_TEXT):
            known = replace(system_from_wkt(text.removeprefix(ESRI_TEXT)), vertical=known.vertical)
    unit, height = (_exact(epsg_units.LENGTHS.get(number(key), 0.0)) or None for key in (LINEAR_UNIT, VERTICAL_UNIT))
    size = keys.get(LINEAR_UNIT_SIZE)
    if number(LINEAR_UNIT) == USER_DEFINED and isinstance(size, float) and size > 0:
        unit = _exact(size)
    return replace(
        known,
        kind=kind if known.kind == "plane" else known.kind,
        unit_m=known.unit_m if unit is None else unit,
        height_unit_m=known.height_unit_m if height is None else height,
    )


def geokeys(
    entries: Sequence[tuple[int, int, int, int]], doubles: Sequence[float] = (), texts: str = ""
) -> dict[int, float | str]:
    """Key → its value.

    Parameters
    ----------
    entries : key, tag where the value is (0: here), number of values, value or place in the tag.
    doubles, texts : the two tags.
    """
    found: dict[int, float | str] = {}
    for key, tag, count, value in entries:
        if not tag:
            found[key] = value
        elif tag == DOUBLES and value < len(doubles):
            found[key] = float(doubles[value])
        elif tag == TEXTS:
            found[key] = texts[value : value + count].rstrip("|\0")
    return found


def system_from_wkt(text: str) -> CoordinateSystem:
    """From well-known text of any kind: OGC 01-009, ISO 19162, GDAL's and Esri's.

    The name is "EPSG:…" when the system itself has a code; codes of its parts, as of its ellipsoid, are not it.
    """
    flat: Node | None = None
    upright: Node | None = None
    for node in _components(_parsed(text)):
        if node[0] in UPRIGHT:
            upright = upright or node
        elif node[0] in FLAT:
            flat = flat or node
    known = named_system("" if flat is None else _name(flat), "" if upright is None else _name(upright))
    kind, unit, height, depths = known.kind, None, None, known.depths
    if flat is not None:
        cartesian = any(key == "CS" and said[:1] == ["Cartesian"] for key, said in _children(flat))
        if flat[0] in GEODETIC:
            kind = "geocentric" if flat[0] in GEOCENTRIC or cartesian else "geographic"
        unit = _unit(flat)
    if upright is not None:
        height = _unit(upright)
        depths = depths or _is_depth(upright)
    return CoordinateSystem(
        known.name,
        known.vertical,
        kind,
        known.unit_m if unit is None or kind == "geographic" else unit,
        known.height_unit_m if height is None else height,
        depths,
    )


def system_beside(path: Path) -> CoordinateSystem:
    """The system in the ``.prj`` file beside a file, as far as there is one."""
    for sidecar in (path.with_suffix(".prj"), path.with_suffix(".PRJ"), path.with_name(path.name + ".prj")):
        if sidecar.is_file():
            with sidecar.open(encoding="utf-8-sig", errors="replace") as file:
                return system_from_wkt(file.read(MOST_LETTERS))
    return UNKNOWN


def surely_different(a: str, b: str) -> bool:
    """Whether two names mean different systems: of two codes this is certain, other names may be of the same one."""
    codes = [_parts(name) for name in (a, b)]
    return codes[0] is not None and codes[1] is not None and codes[0][0] != codes[1][0]


def unit_words(length_m: float) -> str:
    """A unit of length in words, of several: "metres", "US survey feet", "units of 0.201168 m"."""
    words = {"m": "metres", "mm": "millimetres", "cm": "centimetres", "km": "kilometres", "ft": "feet"}
    words["us-ft"] = "US survey feet"
    name = next((name for name, length in UNITS_M.items() if abs(length_m - length) <= SAME * length), "")
    return words.get(name, f"units of {length_m:.10g} m")


GEOCENTRIC = {"GEOCCS"}
GEODETIC = GEOCENTRIC | {"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS"}
FLAT = GEODETIC | {"PROJCS", "PROJCRS", "PROJECTEDCRS", "DERIVEDPROJCRS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS"}
UPRIGHT = {"VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS"}
"""Words with which systems of coordinates and of heights begin in well-known text."""
TOKEN = re.compile(r'"((?:[^"]|"")*)"|([A-Za-z_][\w.]*)|([-+]?[\d.][\w.+-]*)|([\[(])|([\])])')
"""Of well-known text: a text, a word, a number, the beginning and the end of a list."""


def _parsed(text: str) -> list[Node]:
    """All bracketed expressions of a text, without recursion; what is not closed ends with it."""
    top: list[Node | str] = []
    open_: list[list[Node | str]] = [top]
    for match in TOKEN.finditer(text):
        quoted, word, number, begin, end = match.groups()
        here = open_[-1]
        if begin:
            last = here.pop() if here and isinstance(here[-1], str) else ""
            node: Node = (str(last).upper(), [])
            here.append(node)
            open_.append(node[1])
        elif end:
            if len(open_) > 1:
                open_.pop()
        else:
            here.append(quoted.replace('""', '"') if quoted is not None else word or number)
    return [node for node in top if not isinstance(node, str)]


def _children(node: Node) -> list[Node]:
    return [child for child in node[1] if not isinstance(child, str)]


def _components(nodes: list[Node]) -> Iterator[Node]:
    """The single systems of compound ones, and of those that are bound to a transformation."""
    waiting = list(reversed(nodes))
    while waiting:
        node = waiting.pop()
        if node[0] in ("COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "SOURCECRS"):
            waiting += reversed(_children(node))
        else:
            yield node


def _name(node: Node) -> str:
    for key, said in _children(node):
        if key in ("AUTHORITY", "ID") and len(said) > 1 and isinstance(said[0], str) and said[0].upper() == "EPSG":
            return f"EPSG:{said[1]}"
    return next((said for said in node[1] if isinstance(said, str)), "")


def _unit(node: Node) -> float | None:
    """Of a system, in its own unit or that of its first axis."""
    own = _children(node)
    axes = [child for key, said in own if key == "AXIS" for child in _children((key, said))]
    for key, said in [*own, *axes]:
        if key in ("UNIT", "LENGTHUNIT") and len(said) > 1:
            try:
                length = float(str(said[1]))
            except ValueError:
                continue
            if length > 0:
                return _exact(length)
    return None


def _is_depth(node: Node) -> bool:
    """Whether an axis points down, in words or as Esri's programs write it."""
    for key, said in _children(node):
        words = [one.upper() for one in said if isinstance(one, str)]
        if key == "AXIS" and "DOWN" in words:
            return True
        if key == "PARAMETER" and words[:1] == ["DIRECTION"] and words[1:2] and words[1].startswith("-"):
            return True
    return False


def _parts(name: str) -> tuple[int, int, bool] | None:
    """2229, 0, True of "EPSG:2229 in metres": code, the heights' code or 0, whether in metres; None of other names."""
    found = re.fullmatch(rf"\s*EPSG\s*:\s*(\d{{1,9}})(?:\+(\d{{1,9}}))?({IN_METRES})?\s*", name, re.IGNORECASE)
    return (int(found[1]), int(found[2] or 0), bool(found[3])) if found else None


def _in_metres(name: str, of_name: float | None, of_file: float | None) -> str:
    unit = of_name if of_name is not None else of_file
    return f"{name}{IN_METRES}" if name and unit not in (None, 1.0) and not name.endswith(IN_METRES) else name


def _exact(length_m: float) -> float:
    """With all its digits where it is a known unit."""
    return next((one for one in UNITS_M.values() if abs(length_m - one) <= SAME * one), length_m)


@cache
def _lists() -> dict[str, dict[int, float]]:
    """The lists of `epsg_units` as code → length of the unit [m]."""
    found: dict[str, dict[int, float]] = {}
    for name, lists in (
        ("horizontal", epsg_units.HORIZONTAL),
        ("vertical", epsg_units.VERTICAL),
        ("depths", {1.0: epsg_units.DEPTHS}),
        ("geographic", {1.0: epsg_units.GEOGRAPHIC}),
        ("geocentric", {1.0: epsg_units.GEOCENTRIC}),
    ):
        found[name] = {}
        for unit, words in lists.items():
            for word in words.split():
                first, _, last = word.partition("-")
                found[name].update(dict.fromkeys(range(int(first), int(last or first) + 1), _exact(unit)))
    return found
