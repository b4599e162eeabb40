# SPDX-License-Identifier: GPL-3.0-or-later
"""The Stanford PLY format: ascii or binary of either byte order, any number type, polygons, points only."""

import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import AGAIN
from .comments import comment_sentences
from .coordinate_step import single_precision_step
from .crs import named_system
from .polygons import triangles_of
from .scan_colours import colour_columns, colours_of
from .source import Source, check_face_indices, check_finite
from .text import even_table, number_table, shown

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float": "f4", "double": "f8", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
CODES = {
    "i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip
"""The same types, as `struct` names them."""
NO_COLOURS: NDArray[Any] = np.empty((0, 3))
FACE_LISTS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Property:
    """One property; ``count_type`` is empty unless it is a list."""

    name: str
    type: str
    count_type: str = ""


@dataclass(frozen=True)
class Element:
    """One element of the header, its rows and properties."""

    name: str
    rows: int
    properties: tuple[Property, ...]


@dataclass(frozen=True, eq=False)
class Contents:
    """Of the elements that matter.

    Attributes
    ----------
    points : (n, 3).
    corners : vertices of all faces, one face after the other, and how many each has; None without faces.
    colours : (n, 3) numbers of the points' colours, without rows where there are none.
    """

    points: NDArray[np.float64]
    corners: tuple[NDArray[Any], NDArray[np.int64]] | None
    colours: NDArray[Any]


def read_ply(path: Path) -> Source:
    """Read a PLY mesh, or a cloud when it has no faces.

    Raises
    ------
    InputError : not a PLY file, a header that makes no sense, a truncated file, a face without a vertex.
    """
    data = np.memmap(path, dtype=np.uint8, mode="r") if path.stat().st_size else np.empty(0, np.uint8)
    order, elements, start, header_rows, crs = read_header(data, path)
    if order:
        contents = _read_binary(data, start, elements, order, path)
    else:
        contents = _read_ascii(data[start:].tobytes(), header_rows, elements, path)
    colours, said = colours_of(contents.colours)
    notes = [*_left_out(elements, contents), *([said] if said else []), *comment_sentences(_comments(data[:start]))]
    faces = None
    if contents.corners is not None:
        corners, counts = contents.corners
        if not (counts > 2).any():
            raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
        _check_corners(corners, counts, len(contents.points), path)
        check_finite(contents.points, "mesh", path)
        made = triangles_of(contents.points, corners, counts)
        faces, notes = check_face_indices(made.faces, len(contents.points), path), [*made.notes, *notes]
    step = _step(elements, contents.points, bool(order))
    return Source(contents.points, faces, system=named_system(crs), notes=tuple(notes), colours=colours, step=step)


def _step(elements: Sequence[Element], points: NDArray[np.float64], binary: bool) -> NDArray[np.float64] | None:
    """(3,) of which the coordinates are multiples by their types; None where their numbers have to tell."""
    vertex = next(e for e in elements if e.name == "vertex")
    types = [next(p.type for p in vertex.properties if p.name == axis) for axis in "xyz"]
    if "f8" in types or not (binary or all(t[0] in "iu" for t in types)):
        return None
    single = single_precision_step(points)
    return np.where([t[0] in "iu" for t in types], 1.0, single)


def _comments(header: NDArray[np.uint8]) -> list[str]:
    lines = header.tobytes().decode("ascii", "replace").splitlines()
    return [line.split(maxsplit=1)[1] for line in lines if re.match(r"(comment|obj_info)\s+\S", line)]


def _check_corners(corners: NDArray[Any], counts: NDArray[np.int64], vertex_count: int, path: Path) -> None:
    wrong = (corners < 0) | (corners >= vertex_count)
    if wrong.any():
        ends = np.cumsum(counts)
        face = int(np.searchsorted(ends, np.argmax(wrong), side="right"))
        raise InputError(
            f"Face {face} names the vertices {corners[ends[face] - counts[face] : ends[face]].tolist()}, "
            f"of which only 0 to {vertex_count - 1} exist",
            file=path,
            advice="Export the mesh again: the file is damaged",
        )


def _left_out(elements: Sequence[Element], contents: Contents) -> list[str]:
    """What to say of elements that are no vertices and no faces, and of faces that are none."""
    others = [f"{e.name} ({e.rows:,})" for e in elements if e.name not in ("vertex", "face") and e.rows]
    said = [f"Left out elements that are no vertices and no faces: {', '.join(others)}."] if others else []
    few = 0 if contents.corners is None else int((contents.corners[1] < 3).sum())
    return [*said, f"Left out {few:,} faces with fewer than three corners."] if few else said


def read_header(data: NDArray[np.uint8], path: Path) -> tuple[str, list[Element], int, int, str]:
    """Byte order ("" when ascii), elements, offset of the data, rows of the header, coordinate reference system."""
    if not data.size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    beginning = data[: 1 << 16].tobytes()
    if not beginning.startswith((b"ply\n", b"ply\r")):
        raise InputError('Not a PLY file: it does not begin with "ply"', file=path, advice="Check its extension")
    end = beginning.find(b"end_header")
    line_end = beginning.find(b"\n", end)
    if end < 0 or line_end < 0:
        raise InputError(
            "The PLY header has no end", file=path, advice="The file is truncated: copy or export it again"
        )
    lines = beginning[:end].decode("ascii", "replace").splitlines()
    order, elements, crs = None, [], ""
    for row, line in enumerate(lines, start=1):
        words = line.split()
        try:
            match words:
                case ["format", name, *_]:
                    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[name]
                case ["element", name, count]:
                    elements.append(Element(name, int(count), ()))
                    if int(count) < 0:
                        raise ValueError
                case ["property", "list", count_type, item_type, name]:
                    new = Property(name, TYPES[item_type], TYPES[count_type])
                    elements[-1] = Element(elements[-1].name, elements[-1].rows, (*elements[-1].properties, new))
                case ["property", item_type, name]:
                    new = Property(name, TYPES[item_type])
                    elements[-1] = Element(elements[-1].name, elements[-1].rows, (*elements[-1].properties, new))
                case ["comment", "crs", *name]:  # as `write_ply` leaves it
                    crs = " ".join(name)
                case [] | ["ply"] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    raise ValueError
        except (KeyError, ValueError, IndexError) as error:
            raise InputError(
                f'"{line.strip()[:60]}" is no PLY header line', file=path, row=row, advice=AGAIN
            ) from error
    if order is None:
        raise InputError("The PLY header names no format", file=path, advice="Export the file again")
    for element in elements:
        _check_element(element, path)
    vertex = next((e for e in elements if e.name == "vertex"), None)
    if vertex is None or not {"x", "y", "z"} <= {p.name for p in vertex.properties if not p.count_type}:
        raise InputError("The PLY file has no vertices with x, y and z", file=path, advice="Export a mesh or a cloud")
    return order, elements, line_end + 1, len(lines) + 1, crs


def _check_element(element: Element, path: Path) -> None:
    names = [p.name for p in element.properties]
    twice = next((name for name in names if names.count(name) > 1), "")
    if twice:
        raise InputError(f"The {element.name} has the property {twice} twice", file=path, advice="Export it again")
    if element.rows and not names:
        raise InputError(f'The element "{element.name}" has rows without properties', file=path, advice=AGAIN)
    for p in element.properties:
        if p.count_type.startswith("f"):
            raise InputError(f"The list {p.name} has a count that is no whole number", file=path, advice=AGAIN)


def _read_binary(data: NDArray[np.uint8], offset: int, elements: list[Element], order: str, path: Path) -> Contents:
    points, corners, colours = np.empty((0, 3)), None, NO_COLOURS
    for element in elements:
        dtype = row_type(data, offset, element, order)
        end = offset + element.rows * dtype.itemsize
        uniform = end <= data.size
        rows = data[offset:end].view(dtype) if uniform else np.empty(0, dtype)
        uniform = uniform and all((rows[name] == rows[name][0]).all() for name in list_counts(dtype) if len(rows))
        values: Mapping[str, Any] = {p.name: rows[p.name] for p in element.properties}
        if not uniform:
            if not list_counts(dtype):
                raise _truncated(element, (data.size - offset) // max(dtype.itemsize, 1), path)
            values, end = walked(data, offset, element, order, path)
        if element.name == "vertex":
            points = np.stack([np.asarray(values[axis], dtype=np.float64) for axis in "xyz"], axis=1)
            names = [p.name for p in element.properties if not p.count_type]
            if element.rows and (three := colour_columns(names)):
                types = [next(p.type for p in element.properties if p.name == names[i]) for i in three]
                colours = np.stack([np.asarray(values[names[i]], t) for i, t in zip(three, types, strict=True)], axis=1)
        elif element.name == "face" and element.rows:
            corners = _corners(values[_face_list(element, path)], path)
        offset = end
        if offset >= data.size and corners is not None:
            break
    return Contents(points, corners, colours)


def _face_list(element: Element, path: Path) -> str:
    name = next((p.name for p in element.properties if p.name in FACE_LISTS and p.count_type), "")
    if not name:
        raise InputError("The faces have no vertex_indices", file=path, advice="Export the mesh again")
    return name


def _corners(polygons: Any, path: Path) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Vertices of polygons (k, c) of equal length, or of lists, one after the other; and how many each has."""
    if isinstance(polygons, np.ndarray):
        flat, counts = np.ascontiguousarray(polygons).reshape(-1), np.full(len(polygons), polygons.shape[1])
    else:
        counts = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
        flat = np.array([vertex for polygon in polygons for vertex in polygon])
    if flat.dtype.kind == "f" and (flat % 1 != 0).any():
        raise InputError("A face names a vertex by a number that is not whole", file=path, advice=AGAIN)
    return flat, counts


def row_type(data: NDArray[np.uint8], offset: int, element: Element, order: str) -> np.dtype:
    """The type of a row if all lists are as long as in the first row, as they nearly always are."""
    fields: list[tuple] = []
    for p in element.properties:
        if not p.count_type:
            fields.append((p.name, order + p.type))
            continue
        at = offset + np.dtype(fields).itemsize
        count = np.dtype(order + p.count_type)
        bytes_ = data[at : at + count.itemsize].tobytes()
        length = int(np.frombuffer(bytes_, count)[0]) if element.rows and len(bytes_) == count.itemsize else 0
        fields += [(f"count {p.name}", count), (p.name, order + p.type, (max(min(length, 1 << 16), 0),))]
    return np.dtype(fields)


def list_counts(dtype: np.dtype) -> list[str]:
    return [name for name in dtype.names or () if name.startswith("count ")]


def walked(
    data: NDArray[np.uint8], offset: int, element: Element, order: str, path: Path
) -> tuple[dict[str, list[Any]], int]:
    """Row by row, for lists of different lengths: the values of each property, and the offset behind them."""
    buffer = data[offset:].tobytes()
    steps = [(p.name, struct.Struct(order + CODES[p.type]),
              struct.Struct(order + CODES[p.count_type]) if p.count_type else None, np.dtype(order + p.type))
             for p in element.properties]  # fmt: skip
    values: dict[str, list[Any]] = {p.name: [] for p in element.properties}
    at = 0
    for row in range(element.rows):
        try:
            for name, item, count, dtype in steps:
                if count is None:
                    values[name].append(item.unpack_from(buffer, at)[0])
                    at += item.size
                    continue
                length = count.unpack_from(buffer, at)[0]
                at += count.size
                if length < 0:
                    raise _truncated(element, row, path)
                values[name].append(np.frombuffer(buffer, dtype, length, at).tolist() if length else [])
                at += length * item.size
        except (struct.error, ValueError) as error:
            raise _truncated(element, row, path) from error
    return values, offset + at


def _read_ascii(text: bytes, header_rows: int, elements: list[Element], path: Path) -> Contents:
    numbered = [(row, line) for row, line in enumerate(text.splitlines(), start=header_rows + 1) if line.strip()]
    points, corners, colours = np.empty((0, 3)), None, NO_COLOURS
    at = 0
    for element in elements:
        block = numbered[at : at + element.rows]
        if len(block) < element.rows:
            raise _truncated(element, len(block), path)
        at += element.rows
        rows, lines = [row for row, _ in block], [line for _, line in block]
        if element.name == "vertex":
            singles = [p for p in element.properties if not p.count_type]
            if len(singles) < len(element.properties):
                lines = _without_lists(element, lines, rows, path)
            names = [p.name for p in singles]
            table = number_table(lines, rows, path, f"{len(names)} coordinates and properties")
            if len(lines) and table.shape[1] != len(names):
                raise InputError(
                    f"{table.shape[1]} values, where the header promises {len(names)}",
                    file=path,
                    row=rows[0],
                    advice=AGAIN,
                )
            if len(lines):
                points = table[:, [names.index(axis) for axis in "xyz"]]
                colours = _written_colours(singles, table)
        elif element.name == "face" and element.rows:
            corners = _ascii_faces(element, lines, rows, path)
    return Contents(points, corners, colours)


def _written_colours(properties: Sequence[Property], table: NDArray[np.float64]) -> NDArray[Any]:
    """Of an ascii file, whose numbers have the type that its header gives them."""
    three = colour_columns([p.name for p in properties])
    if not three:
        return NO_COLOURS
    found = table[:, three]
    whole = all(properties[i].type[0] in "iu" for i in three) and (found % 1 == 0).all()
    return found.astype(np.int64) if whole else found


def _split(element: Element, line: bytes) -> tuple[list[bytes], dict[str, list[bytes]]]:
    """The words of a row that are no list, and those of each list.

    Raises
    ------
    ValueError, IndexError : the row does not have what the header promises.
    """
    words, at = line.split(), 0
    singles: list[bytes] = []
    lists: dict[str, list[bytes]] = {}
    for p in element.properties:
        if not p.count_type:
            singles.append(words[at])
            at += 1
            continue
        count = int(words[at])
        lists[p.name] = words[at + 1 : at + 1 + count]
        if count < 0 or len(lists[p.name]) != count:
            raise ValueError
        at += 1 + count
    return singles + words[at:], lists


def _without_lists(element: Element, lines: list[bytes], rows: list[int], path: Path) -> list[bytes]:
    found = []
    for line, row in zip(lines, rows, strict=True):
        try:
            found.append(b" ".join(_split(element, line)[0]))
        except (ValueError, IndexError) as error:
            raise InputError(
                f'"{shown(line)}" has not the numbers and lists that the header promises',
                file=path,
                row=row,
                advice="The file may be truncated: copy or export it again",
            ) from error
    return found


def _ascii_faces(
    element: Element, lines: list[bytes], rows: list[int], path: Path
) -> tuple[NDArray[Any], NDArray[np.int64]]:
    name = _face_list(element, path)
    names = [p.name for p in element.properties]
    index = names.index(name)
    if sum(bool(p.count_type) for p in element.properties) == 1:
        triangles = even_table(lines, len(names) + 3)
        if triangles is not None and (triangles[:, index] == 3).all() and (triangles % 1 == 0).all():
            return _corners(triangles[:, index + 1 : index + 4].astype(np.int64), path)
    polygons = []
    for line, row in zip(lines, rows, strict=True):
        try:
            singles, lists = _split(element, line)
            if len(singles) + len(lists) != len(names):
                raise ValueError
            polygons.append([int(word) for word in lists[name]])
        except (ValueError, IndexError) as error:
            raise InputError(
                f'"{shown(line)}" is no face: a count and as many vertex numbers are needed',
                file=path,
                row=row,
                advice="The file may be truncated: copy or export it again",
            ) from error
    return _corners(polygons, path)


def _truncated(element: Element, found: int, path: Path) -> InputError:
    what = {"vertex": "vertices", "face": "faces"}.get(element.name, f'rows of "{element.name}"')
    return InputError(
        f"The file is truncated: its header promises {element.rows} {what}, it holds {found}",
        file=path,
        advice="Copy or export it again",
    )
