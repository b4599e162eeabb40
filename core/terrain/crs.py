# SPDX-License-Identifier: GPL-3.0-or-later
"""The name of the coordinate reference system, as terrain files state it."""

import re
from collections.abc import Sequence
from pathlib import Path

GEOGRAPHIC_TYPE, PROJECTED_TYPE = 2048, 3072
VERTICAL_TYPE = 4096
MODEL_TYPE, MODEL_GEOGRAPHIC = 1024, 2
USER_DEFINED = 32767


def crs_from_geokeys(keys: Sequence[tuple[int, int]]) -> tuple[str, bool]:
    """("EPSG:2056" or "", whether coordinates are degrees) from GeoTIFF keys (id, value): OGC 19-008r4."""
    values = dict(keys)
    code = values.get(PROJECTED_TYPE, 0)
    geographic = not code and (values.get(MODEL_TYPE) == MODEL_GEOGRAPHIC or GEOGRAPHIC_TYPE in values)
    code = code or values.get(GEOGRAPHIC_TYPE, 0)
    return (f"EPSG:{code}" if 0 < code < USER_DEFINED else ""), geographic


def vertical_from_geokeys(keys: Sequence[tuple[int, int]]) -> str:
    """ "EPSG:5728" of the heights, or "", from GeoTIFF keys (id, value)."""
    code = dict(keys).get(VERTICAL_TYPE, 0)
    return f"EPSG:{code}" if 0 < code < USER_DEFINED else ""


def crs_from_wkt(text: str) -> tuple[str, bool]:
    """("EPSG:2056", else the system's name, whether coordinates are degrees) from well-known text.

    The code of the whole system is the last one at the end of the text; codes inside belong to its parts. A compound
    system is known by its horizontal part.
    """
    text = text.strip().strip("\0").strip()
    match_ = re.match(r'\s*(?:COMPD_CS|COMPOUNDCRS)\s*\[\s*"[^"]*"\s*,', text, re.IGNORECASE)
    if match_:
        text = _balanced(text[match_.end() :])
    geographic = bool(re.match(r"\s*(GEOGCS|GEOGCRS|GEODCRS|GEOGRAPHICCRS)\b", text, re.IGNORECASE))
    code = re.search(r'(?:AUTHORITY|ID)\s*\[\s*"EPSG"\s*,\s*"?(\d+)"?\s*\]\s*\]\s*$', text, re.IGNORECASE)
    name = re.match(r'\s*\w+\s*\[\s*"([^"]*)"', text)
    return (f"EPSG:{code[1]}" if code else name[1] if name else ""), geographic


def crs_beside(path: Path) -> tuple[str, bool]:
    """The system in the ``.prj`` file beside a grid or cloud; ("", False) without one."""
    for sidecar in (path.with_suffix(".prj"), path.with_suffix(".PRJ"), path.with_name(path.name + ".prj")):
        if sidecar.is_file():
            return crs_from_wkt(sidecar.read_text("utf-8", "replace"))
    return "", False


def surely_different(a: str, b: str) -> bool:
    """Whether two names mean different systems: of two codes this is certain, other names may be of the same one."""
    codes = [re.fullmatch(r"\s*EPSG\s*:\s*(\d+)\s*", name, re.IGNORECASE) for name in (a, b)]
    return codes[0] is not None and codes[1] is not None and int(codes[0][1]) != int(codes[1][1])


def _balanced(text: str) -> str:
    """The first bracketed expression of a text."""
    depth = 0
    for i, letter in enumerate(text):
        depth += (letter == "[") - (letter == "]")
        if letter == "]" and depth == 0:
            return text[: i + 1]
    return text
