# SPDX-License-Identifier: GPL-3.0-or-later
"""Point clouds: LAS, LAZ and tables of coordinates (XYZ, TXT, CSV)."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..reading import check_promise, reading
from ..vectors import Array
from .crs import CoordinateSystem, geokeys, system_beside, system_from_geokeys, system_from_wkt
from .scan_colours import Colours, colour_columns, colours_of
from .source import Source
from .text import number_table, read_text

DAMAGED = "It is truncated or damaged: copy or export it again"
GROUND_CLASS = 2
"""ASPRS LAS 1.4 R15, table 17."""
LOOKED_AT = 500_000
"""So many points are looked at before a cloud is read."""
LAS_HEADER_BYTES, RECORD_HEADER_BYTES, EXTENDED_HEADER_BYTES = 227, 54, 60
"""ASPRS LAS 1.4 R15, tables 3, 6 and 7."""
COMPRESSED, NOT_KNOWN_YET = 0xC0, 2**64 - 1
"""Bits of the point format, and the place of the table of parts when it was written to a stream: LAZ specification."""
AXIS_NAMES = (
    ("x", "x_m", "easting", "east", "e", "x_coord", "//x"),
    ("y", "y_m", "northing", "north", "n", "y_coord"),
    ("z", "z_m", "height", "elevation", "altitude", "h", "z_coord"),
)


def read_las(path: Path, ground_only: bool | None) -> Source:
    """Read a LAS or LAZ cloud, its ground class (2) when it has one and ``ground_only`` is not False.

    Points classified as noise (7 and 18) are left out.

    Raises
    ------
    InputError : not a LAS file, truncated, fewer points than its header promises; no ground class when it is asked for.
    """
    header, system = _las_header(path)
    points, classes, colours = _las_points(path, header)
    if len(points) != header.point_count:
        raise _truncated(path, header.point_count, len(points))
    ground = classes == GROUND_CLASS
    notes = [f"Cloud of {len(points):,} points."]
    kept = slice(None)
    if ground_only and not ground.any():
        raise InputError(
            f"None of the {len(points)} points is classified as ground (class {GROUND_CLASS})",
            file=path,
            advice="Use all points, or classify the cloud first",
        )
    if ground.any() and ground_only is not False:
        kept = ground
        notes.append(f"Used the {int(ground.sum()):,} points of the ground class ({GROUND_CLASS}).")
    else:
        noise = (classes == 7) | (classes == 18)
        if noise.any():
            kept = ~noise
            notes.append(f"Left out {int(noise.sum()):,} points classified as noise (7, 18).")
        notes.append(
            "Used all classes, as asked."
            if ground.any()
            else "The cloud has no ground class: vegetation and buildings, if any, are part of the surface. "
            "The ground filter leaves them out (--ground-filter; in Blender “Points” in the import dialog)."
        )
    return Source(
        points[kept], system=system, notes=tuple(notes),
        colours=None if colours is None else colours[kept],
    )  # fmt: skip


def inspect_las(path: Path) -> tuple[Array, int, CoordinateSystem, tuple[str, ...]]:
    """Box (2, 3), number of points and coordinate system, from the header alone; and sentences on the points and, from
    the first ones, on their classes.
    """
    header, system = _las_header(path)
    count = int(header.point_count)
    said = (f"Cloud of {count:,} points.", _ground_sentence(path, count))
    return np.array([header.mins, header.maxs]), count, system, said


def _ground_sentence(path: Path, count: int) -> str:
    """How much of a cloud is classified as ground, and what that means for what is read of it."""
    import laspy

    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        some = np.asarray(opened.read_points(LOOKED_AT).classification)
    ground = int((some == GROUND_CLASS).sum())
    if not ground:
        known = "No point" if count <= LOOKED_AT else f"None of the first {LOOKED_AT:,} points"
        said = "vegetation, if there is any, becomes part of the surface; the ground filter takes it out."
        return f"{known} is classified as ground: {said}"
    share = f"{100 * ground / len(some):.0f} %"
    of = f"{ground:,} of them ({share})" if count <= LOOKED_AT else f"Of the first {LOOKED_AT:,}, {share}"
    return f"{of} are classified as ground; only these are used unless others are asked for."


def _las_header(path: Path) -> tuple[Any, CoordinateSystem]:
    import laspy

    size = path.stat().st_size
    if not size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with path.open("rb") as file:
        if file.read(4) != b"LASF":
            raise InputError('Not a LAS file: it does not begin with "LASF"', file=path, advice="Check its extension")
    _check_promises(path, size)
    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        header = opened.header
        if header.are_points_compressed:
            _check_items(header, path)
    needed = header.offset_to_point_data + header.point_count * header.point_format.size
    compressed = header.are_points_compressed
    if compressed:
        check_promise(f"{header.point_count} points", header.point_count * header.point_format.size, size, path, True)
    if compressed and header.point_count:
        # The first eight bytes of the points say where their table of chunks is: behind the end in a truncated file.
        with path.open("rb") as file:
            file.seek(header.offset_to_point_data)
            needed = int.from_bytes(file.read(8).ljust(8, b"\0"), "little", signed=True)
    if needed > size:
        held = (size - header.offset_to_point_data) // header.point_format.size
        raise _truncated(path, header.point_count, None if compressed else max(held, 0))
    if not header.point_count:
        raise InputError("The cloud has no points", file=path, advice="Export it again")
    return header, _las_system(header, path)


def _check_items(header: Any, path: Path) -> None:
    """What the record of LASzip says of a point: the decoder divides by its size, and prints lines of its own."""
    record = header.vlrs.get("LasZipVlr")[0].record_data
    items = int.from_bytes(record[32:34], "little")
    sizes = np.frombuffer(record, "<u2", 3 * items, 34)[1::3]
    if int(sizes.sum()) != header.point_format.size:
        raise InputError(
            f"The file is damaged: it packs points of {sizes.sum()} bytes, and they have {header.point_format.size}",
            file=path,
            advice="Copy or export it again",
        )


def _check_promises(path: Path, size: int) -> None:
    """What the header counts is within the file, before libraries take memory for it: the decoder of LAZ ends the
    whole process when it gets none."""

    def number(at: int, length: int) -> int:
        file.seek(at)
        return int.from_bytes(file.read(length), "little")

    with path.open("rb") as file:
        if size < LAS_HEADER_BYTES:
            raise InputError("The file is truncated within its header", file=path, advice="Copy or export it again")
        records = number(100, 4)
        check_promise(f"{records} records", records * RECORD_HEADER_BYTES, size, path)
        if number(25, 1) >= 4:  # extended records come with version 1.4
            extended = number(243, 4)
            check_promise(f"{extended} extended records", extended * EXTENDED_HEADER_BYTES, size, path)
        if number(104, 1) & COMPRESSED:
            table = number(number(96, 4), 8)
            table = number(size - 8, 8) if table == NOT_KNOWN_YET else table
            chunks = number(table + 4, 4) if table < size else 0
            check_promise(f"{chunks} parts", chunks, size, path)


def _las_system(header: Any, path: Path) -> CoordinateSystem:
    """Of the record with well-known text, else of that with GeoTIFF keys, else of the ``.prj`` beside the file."""
    records = [*header.vlrs, *(header.evlrs or [])]
    for record in records:
        if text := getattr(record, "string", ""):
            return system_from_wkt(text)
    doubles = [float(one.value) for record in records for one in getattr(record, "doubles", ())]
    texts = [text for record in records for text in getattr(record, "strings", ())]
    for record in records:
        if keys := getattr(record, "geo_keys", None):
            entries = [(key.id, key.tiff_tag_location, key.count, key.value_offset) for key in keys]
            return system_from_geokeys(geokeys(entries, doubles, "\0".join(texts)))
    return system_beside(path)


def _las_points(path: Path, header: Any) -> tuple[Array, np.ndarray, Colours | None]:
    import laspy

    points = np.empty((header.point_count, 3))
    classes = np.empty(header.point_count, np.uint8)
    coloured = {"red", "green", "blue"} <= set(header.point_format.dimension_names)
    colours = np.empty((header.point_count if coloured else 0, 3), np.uint16)
    at = 0
    with reading(path, "cloud", DAMAGED), laspy.open(path) as opened:
        for chunk in opened.chunk_iterator(2_000_000):
            part = slice(at, at + len(chunk))
            for axis, name in enumerate("XYZ"):
                points[part, axis] = np.asarray(chunk[name]) * header.scales[axis] + header.offsets[axis]
            classes[part] = np.asarray(chunk.classification)
            if coloured:
                for channel, name in enumerate(("red", "green", "blue")):
                    colours[part, channel] = np.asarray(chunk[name])
            at += len(chunk)
    return points[:at], classes[:at], colours_of(colours[:at])[0]


def _truncated(path: Path, promised: int, held: int | None) -> InputError:
    found = "the file ends before they do" if held is None else f"it holds {held}"
    return InputError(
        f"The file is truncated: its header promises {promised} points, {found}",
        file=path,
        advice="Copy or export it again",
    )


def read_xyz(path: Path) -> Source:
    """Read a table of coordinates: blanks, commas, semicolons or tabs between columns, a header row or none.

    With a header the columns x, y, z (or easting, northing, elevation) are used, and red, green, blue (or r, g, b)
    where there are such; else the first three, and the last three of six or more if they are whole and 255 at most.

    Raises
    ------
    InputError : a row without three numbers, with its row.
    """
    text = read_text(path)
    if _has_decimal_commas(text):
        text = text.replace(b",", b".")
    lines = re.sub(rb"[,;\t]", b" ", text).split(b"\n")
    original = text.split(b"\n")
    rows = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith((b"#", b"//"))]
    columns, three = [0, 1, 2], [-3, -2, -1]
    if rows and re.match(rb'[\s"]*[A-Za-z_]', lines[rows[0]]) and not re.match(rb"\s*(nan|inf)", lines[rows[0]], re.I):
        names = _column_names(original[rows[0]])
        columns, three = _named_columns(names, path, rows[0] + 1), colour_columns(names)
        rows = rows[1:]
    elif rows and len(lines[rows[0]].split()) == 1 and len(rows) > 1 and len(lines[rows[1]].split()) >= 3:
        rows = rows[1:]  # some programs begin with the number of points
    table = number_table([lines[i] for i in rows], [i + 1 for i in rows], path, "Coordinates")
    if not len(table):
        raise InputError("The table has no points", file=path, advice="Export it again")
    if table.shape[1] <= max(columns):
        raise InputError(
            f"{table.shape[1]} columns, where x, y and z are needed",
            file=path,
            row=rows[0] + 1,
            advice="Export x, y and z",
        )
    notes = [f"Cloud of {len(table):,} points."]
    found = table[:, three] if three and table.shape[1] > max(three) else table[:, :0]
    if three and three[0] < 0:  # without a header they have to look like colours
        found = found if table.shape[1] >= 6 and _look_like_colours(found) else table[:, :0]
    colours, said = colours_of(found)
    notes += [said] if said else []
    return Source(
        np.ascontiguousarray(table[:, columns]), system=system_beside(path), notes=tuple(notes), colours=colours
    )


def _look_like_colours(found: Array) -> bool:
    """Whole numbers from 0 to 255, not a normal or a class."""
    return bool(((found >= 0) & (found <= 255) & (found % 1 == 0)).all()) and float(found.max()) > 1


def _has_decimal_commas(text: bytes) -> bool:
    """Commas inside of numbers that semicolons, tabs or blanks separate, and no points."""
    number = rb"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?"
    row = rb"^[ \t]*%s(?:(?:[ \t]*;[ \t]*|[ \t]+)%s)+[ \t;]*$" % (number, number)
    beginning = text[:4096].rpartition(b"\n")[0] or text
    rows = re.findall(row, beginning, re.MULTILINE)
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
