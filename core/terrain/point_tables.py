# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of coordinates: XYZ, TXT, CSV."""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..formats.number_words import has_thousands_marks, stated_separator, why_no_number, without_groups
from ..vectors import Array
from .comments import comment_sentences
from .crs import system_beside
from .scan_colours import colour_columns, colours_of
from .source import Source
from .text import number_table, read_text, shown

AXIS_NAMES = (
    ("x", "x_m", "easting", "east", "e", "x_coord", "//x"),
    ("y", "y_m", "northing", "north", "n", "y_coord"),
    ("z", "z_m", "height", "elevation", "altitude", "h", "z_coord"),
)
FIRST_ROWS, FEWEST_NUMBERED = 200, 10
"""Rows by which the way that a table is written is told; and of points that a counting column takes."""
NO_BLANKS, BLANKS = "\u00a0|\u202f|'|\u2019", " |"
BETWEEN_GROUPS, BETWEEN_GROUPS_OF_CELLS = (
    re.compile(f"(?<=\\d)(?:{signs})(?=\\d{{3}}(?!\\d))".encode()) for signs in (NO_BLANKS, BLANKS + NO_BLANKS)
)
"""Signs between thousands, where blanks stand between columns and where something else does."""
COMMENTS = (b"#", b"//")


def read_xyz(path: Path) -> Source:
    """Read a table of coordinates: blanks, commas, semicolons or tabs between columns, a header row or none.

    With a header the columns x, y, z (or easting, northing, elevation) are used, and red, green, blue (or r, g, b)
    where there are such; else the first three, and the last three of six or more if they are whole and 255 at most. A
    first column that counts the rows is no coordinate. Decimal commas are read where they cannot stand between columns,
    blanks and apostrophes between thousands where they cannot either.

    Raises
    ------
    InputError : a row without three numbers, commas or points between thousands, names of points; with its row.
    """
    sign, text = stated_separator(read_text(path))
    text = _plainly_written(text, sign, path)
    lines = re.sub(rb"[,;|\t]" if sign == b"|" else rb"[,;\t]", b" ", text).split(b"\n")
    original = text.split(b"\n")
    rows = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(COMMENTS)]
    columns, three, notes = [0, 1, 2], [-3, -2, -1], []
    has_names = False
    if rows and re.match(rb'[\s"]*[A-Za-z_]', lines[rows[0]]) and not re.match(rb"\s*(nan|inf)", lines[rows[0]], re.I):
        names = _column_names(original[rows[0]])
        _refuse_point_names(lines[rows[0]], path, rows[0] + 1)
        columns, three = _named_columns(names, path, rows[0] + 1), colour_columns(names)
        rows, has_names = rows[1:], True
    elif rows and len(lines[rows[0]].split()) == 1 and len(rows) > 1 and len(lines[rows[1]].split()) >= 3:
        rows = rows[1:]  # some programs begin with the number of points
    try:
        table = number_table([lines[i] for i in rows], [i + 1 for i in rows], path, "Coordinates")
    except InputError as error:
        raise _with_cause(error, original) from error
    if not len(table):
        raise InputError("The table has no points", file=path, advice="Export it again")
    if not has_names and _counts(table):
        columns = [1, 2, 3]
        notes.append(
            f"The first column counts the points ({table[0, 0]:.0f} to {table[-1, 0]:.0f}): "
            "x, y and z are those behind it."
        )
    if table.shape[1] <= max(columns):
        raise InputError(
            f"{table.shape[1]} columns, where x, y and z are needed",
            file=path,
            row=rows[0] + 1,
            advice="Export x, y and z",
        )
    notes = [f"Cloud of {len(table):,} points.", *notes]
    found = table[:, three] if three and table.shape[1] > max(three) else table[:, :0]
    if three and three[0] < 0:  # without a header they have to look like colours
        enough = table.shape[1] >= 3 + len(columns) + columns[0]
        found = found if enough and _look_like_colours(found) else table[:, :0]
    colours, said = colours_of(found)
    notes += [said] if said else []
    comments = [line.lstrip(b"#/ ") for line in original[:FIRST_ROWS] if line.lstrip().startswith(COMMENTS)]
    notes += comment_sentences(line.decode("utf-8", "replace") for line in comments)
    return Source(
        np.ascontiguousarray(table[:, columns]), system=system_beside(path), notes=tuple(notes), colours=colours
    )


def _counts(table: Array) -> bool:
    """Whether the first of four or more columns is 1, 2, 3 … or 7, 8, 10 …, some left out: no surface has such x."""
    if table.shape[1] < 4 or len(table) < FEWEST_NUMBERED:
        return False
    first = table[:, 0]
    return bool((first % 1 == 0).all() and (np.diff(first) >= 1).all() and np.ptp(first) < 2 * len(first))


def _plainly_written(text: bytes, sign: bytes, path: Path) -> bytes:
    """The text without quotes, decimal commas and signs between thousands, as its first rows tell them.

    Parameters
    ----------
    sign : that stands between columns, where the file states it.

    Raises
    ------
    InputError : commas or points between thousands, or what may be decimal commas or between columns.
    """
    beginning = text.split(b"\n", FIRST_ROWS)[:FIRST_ROWS]
    rows = [(i, line) for i, line in enumerate(beginning, start=1) if re.match(rb'[\s"]*[-+.\d]', line)]
    if not rows:
        return text
    sample = b"\n".join(line for _, line in rows)
    sign = sign or next((each for each in (b";", b"\t") if each in rows[-1][1]), b"")
    for row, line in rows:
        _refuse_thousands(line, sign, path, row)
    decimal = _has_decimal_commas(sample, sign)
    by = sign or (b"," if not decimal and b"," in rows[-1][1] else b"")
    cells = [cell.strip().strip(b'"') for _, line in rows for cell in (line.split(by) if by else line.split())]
    if any(without_groups(cell := each.decode("utf-8", "replace")) != cell for each in cells):
        text = (BETWEEN_GROUPS_OF_CELLS if by else BETWEEN_GROUPS).sub(b"", text)
    if b'"' in sample:
        text = text.replace(b'"', b"")
    return text.replace(b",", b".") if decimal else text


def _refuse_thousands(line: bytes, sign: bytes, path: Path, row: int) -> None:
    """Commas, points or blanks between thousands that cannot be told from other marks."""
    text = line.decode("utf-8", "replace")
    cells = [
        cell.strip().strip('"') for cell in (text.split(sign.decode()) if sign else re.findall(r'"[^"]*"|\S+', text))
    ]
    found = next((cell for cell in cells if has_thousands_marks(cell)), "")
    quoted = re.search(r'"([-+]?\d+,\d+)"', text) if sign not in (b";", b"\t") else None
    if found or quoted:
        word = found or (quoted[1] if quoted else "")
        why, advice = why_no_number(word)
        raise InputError(f'"{word[:60]}" {why}', file=path, row=row, advice=advice)
    words = text.replace(",", " ").split()
    if (
        not sign
        and not _has_groups_between(text.split(","))
        and any(re.fullmatch(r"[-+]?\d{1,3}", a) and re.fullmatch(r"0\d\d(\.\d*)?", b) for a, b in pairwise(words[:3]))
    ):
        raise InputError(
            f'"{shown(line)}" looks as if blanks or commas stood between thousands as between columns',
            file=path,
            row=row,
            advice="Export numbers without them",
        )


def _has_groups_between(cells: list[str]) -> bool:
    """Whether cells are numbers, some of them with blanks between thousands."""
    cells = [cell.strip().strip('"') for cell in cells]
    plain = [without_groups(cell) for cell in cells]
    return len(cells) >= 3 and plain != cells and all(re.fullmatch(r"[-+]?\d*\.?\d*", cell) for cell in plain)


def _refuse_point_names(line: bytes, path: Path, row: int) -> None:
    words = line.split()
    numbers = [word for word in words[1:] if re.fullmatch(rb"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?", word)]
    if len(words) >= 4 and len(numbers) == len(words) - 1:
        raise InputError(
            f'The first column holds names of points ("{shown(words[0])}")',
            file=path,
            row=row,
            advice="Give the table a header that names the columns x, y, z",
        )


def _with_cause(error: InputError, lines: list[bytes]) -> InputError:
    """The same error with what is written in its row, where that is known."""
    line = lines[error.row - 1].decode("utf-8", "replace") if error.row else ""
    for cell in re.split(r"[;\t]", line) if re.search(r"[;\t]", line) else line.split():
        why, advice = why_no_number(cell)
        if why:
            return InputError(f'"{cell.strip()[:60]}" {why}', file=error.file, row=error.row, advice=advice)
    return error


def _look_like_colours(found: Array) -> bool:
    """Whole numbers from 0 to 255, not a normal or a class."""
    return bool(((found >= 0) & (found <= 255) & (found % 1 == 0)).all()) and float(found.max()) > 1


def _has_decimal_commas(sample: bytes, sign: bytes) -> bool:
    """Commas inside of numbers that semicolons, tabs or blanks separate, and no points."""
    if sign == b",":
        return False
    group = f"(?:(?:{BLANKS + NO_BLANKS if sign else NO_BLANKS})\\d{{3}})*".encode()
    number = rb'"?[-+]?\d+%s(?:,\d+)?(?:[eE][-+]?\d+)?"?' % group
    between = rb"[ ]*[;\t|][ ]*" if sign else rb"[ \t]+"
    row = rb"^[ \t]*%s(?:%s%s)+[ \t;]*$" % (number, between, number)
    rows = re.findall(row, sample, re.MULTILINE)
    return b"." not in b"".join(rows) and any(b"," in found for found in rows)


def _column_names(line: bytes) -> list[str]:
    text = line.decode("utf-8", "replace").lower()
    return [name.strip(' "') for name in (re.split(r"[,;\t]", text) if re.search(r"[,;\t]", text) else text.split())]


def _named_columns(names: list[str], path: Path, row: int) -> list[int]:
    found = [next((names.index(n) for n in accepted if n in names), -1) for accepted in AXIS_NAMES]
    if min(found) < 0:
        raise InputError(
            f'The header "{" ".join(names)[:80].strip()}" names no x, y and z',
            file=path,
            row=row,
            advice="Name the columns x, y, z",
        )
    return found
