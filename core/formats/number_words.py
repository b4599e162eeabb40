# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as programs and people write them: separators between thousands, decimal commas, encodings of text.

Blanks and apostrophes between thousands are nothing else, and are read. Commas and points are decimal marks as well: a
number with them between thousands is refused with its cause, for what one of them means is known of none alone.
"""

import codecs
import re
from pathlib import Path

from ..errors import InputError

GROUP_SIGNS = " \u00a0\u202f'\u2019"
"""Blank, no-break blank, narrow no-break blank, apostrophes: ISO 80000-1, 7.3.1; Switzerland."""
_GROUPED = re.compile(rf"[-+]?\d{{1,3}}(?:([{GROUP_SIGNS}])\d{{3}}(?:\1\d{{3}})*)(?:[.,]\d*)?")
_MARKED = re.compile(
    r"[-+]?\d{1,3}(?:,\d{3})+\.\d*|[-+]?\d{1,3}(?:\.\d{3})+,\d*|[-+]?\d{1,3}(?:(?:,\d{3}){2,}|(?:\.\d{3}){2,})"
)
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
SEPARATOR_LINE = re.compile(rb'\A(?:\xef\xbb\xbf)?"?sep=([,;\t|])"?[ \t]*(?=\r|\n|\Z)', re.IGNORECASE)
"""The first line by which spreadsheets are told what stands between cells."""


def without_groups(cell: str) -> str:
    """A number without blanks and apostrophes between its thousands; anything else as it is.

    >>> without_groups("1 234,56"), without_groups("1'234.5"), without_groups("12 34")
    ('1234,56', '1234.5', '12 34')
    """
    return re.sub(rf"[{GROUP_SIGNS}]", "", cell) if _GROUPED.fullmatch(cell) else cell


def has_thousands_marks(cell: str) -> bool:
    """Whether commas or points can only stand between thousands: 1,234.56, 1.234,56, 1.234.567."""
    return _MARKED.fullmatch(cell) is not None


def why_no_number(cell: str) -> tuple[str, str]:
    """What is written in a cell that is no plain number, and what to do; both empty where it is nothing known.

    >>> why_no_number("1.234,56")[0]
    'has marks between its thousands'
    """
    cell = cell.strip().strip('"')
    if has_thousands_marks(cell) or _GROUPED.fullmatch(cell):
        return "has marks between its thousands", "Export numbers without them"
    if _DECIMAL_COMMA.fullmatch(cell):
        return "has a decimal comma", "Write decimals with a point"
    return "", ""


def as_utf8(data: bytes, path: Path, advice: str) -> bytes:
    """Text in UTF-8, which may have been in UTF-16 with a mark at its beginning.

    Raises
    ------
    InputError : it is not in UTF-16, though its mark says so.
    """
    if not data.startswith(UTF_16):
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeDecodeError as error:
        raise InputError("The text is marked as UTF-16, and is not", file=path, advice=advice) from error


def stated_separator(data: bytes) -> tuple[bytes, bytes]:
    """The sign that a first line like "sep=;" states, empty without one; and the text with that line empty."""
    found = SEPARATOR_LINE.match(data)
    return (found[1], data[found.end() :]) if found else (b"", data)
