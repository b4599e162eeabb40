# SPDX-License-Identifier: GPL-3.0-or-later
"""The Stanford PLY format: ascii or binary of either byte order, any number type, polygons, points only."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import AGAIN
from .crs import named_system
from .scan_colours import colour_columns, colours_of
from .source import Source, check_face_indices, triangulated
from .text import even_table, number_table, shown

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float": "f4", "double": "f8", "float32": "f4", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
PLAIN = "Export the mesh without colours, textures and attributes"
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
    points, faces, found = contents
    colours, said = colours_of(found)
    notes = (said,) if said else ()
    if faces is not None:
        faces = check_face_indices(faces, len(points), path)
    return Source(points, faces, system=named_system(crs), notes=notes, colours=colours)


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


def _read_binary(
    data: NDArray[np.uint8], offset: int, elements: list[Element], order: str, path: Path
) -> tuple[NDArray[np.float64], NDArray[Any] | None, NDArray[Any]]:
    """Points, faces, and the numbers of the points' colours (n, 3), without rows where there are none."""
    points, faces, colours = np.empty((0, 3)), None, NO_COLOURS
    for element in elements:
        dtype = row_type(data, offset, element, order)
        end = offset + element.rows * dtype.itemsize
        uniform = end <= data.size
        rows = data[offset:end].view(dtype) if uniform else np.empty(0, dtype)
        uniform = uniform and all((rows[name] == rows[name][0]).all() for name in list_counts(dtype) if len(rows))
        lists: dict[str, list[list[int]]] = {}
        if not uniform:
            if not list_counts(dtype):
                raise _truncated(element, (data.size - offset) // max(dtype.itemsize, 1), path)
            lists, end = _walk(data, offset, element, order, path)
        if element.name == "vertex":
            points = np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=1)
            names = [p.name for p in element.properties if not p.count_type]
            if len(rows) and (three := colour_columns(names)):
                colours = np.stack([rows[names[i]] for i in three], axis=1)
        elif element.name == "face" and element.rows:
            name = next((p.name for p in element.properties if p.name in FACE_LISTS and p.count_type), "")
            if not name:
                raise InputError("The faces have no vertex_indices", file=path, advice="Export the mesh again")
            faces = _fans(rows[name]) if uniform else triangulated(lists[name])
        offset = end
        if offset >= data.size and faces is not None:
            break
    return points, faces, colours


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


def _fans(polygons: NDArray[np.integer]) -> NDArray[np.integer]:
    """(m, k) polygons of equal length as triangles."""
    k = polygons.shape[1]
    if k == 3:
        return polygons
    fan = [polygons[:, [0, i, i + 1]] for i in range(1, k - 1)]
    return np.concatenate(fan).astype(np.int64) if fan else np.empty((0, 3), np.int64)


def _walk(
    data: NDArray[np.uint8], offset: int, element: Element, order: str, path: Path
) -> tuple[dict[str, list[list[int]]], int]:
    """Row by row, for lists of different lengths."""
    buffer = data[offset:].tobytes()
    steps = [(p.name, np.dtype(order + p.type), np.dtype(order + p.count_type) if p.count_type else None)
             for p in element.properties]  # fmt: skip
    lists: dict[str, list[list[int]]] = {p.name: [] for p in element.properties if p.count_type}
    at = 0
    for row in range(element.rows):
        for name, item, count in steps:
            length = 1
            if count is not None:
                if at + count.itemsize > len(buffer):
                    raise _truncated(element, row, path)
                length = int(np.frombuffer(buffer, count, 1, at)[0])
                at += count.itemsize
            if length < 0 or at + length * item.itemsize > len(buffer):
                raise _truncated(element, row, path)
            if count is not None:
                lists[name].append(np.frombuffer(buffer, item, length, at).tolist())
            at += length * item.itemsize
    return lists, offset + at


def _read_ascii(
    text: bytes, header_rows: int, elements: list[Element], path: Path
) -> tuple[NDArray[np.float64], NDArray[Any] | None, NDArray[Any]]:
    numbered = [(row, line) for row, line in enumerate(text.splitlines(), start=header_rows + 1) if line.strip()]
    points, faces, colours = np.empty((0, 3)), None, NO_COLOURS
    at = 0
    for element in elements:
        block = numbered[at : at + element.rows]
        if len(block) < element.rows:
            raise _truncated(element, len(block), path)
        at += element.rows
        rows, lines = [row for row, _ in block], [line for _, line in block]
        if element.name == "vertex":
            if any(p.count_type for p in element.properties):
                raise InputError("The vertices hold lists, which is not supported", file=path, advice=PLAIN)
            names = [p.name for p in element.properties]
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
                colours = _written_colours(element, table)
        elif element.name == "face" and element.rows:
            faces = _ascii_faces(element, lines, rows, path)
    return points, faces, colours


def _written_colours(element: Element, table: NDArray[np.float64]) -> NDArray[Any]:
    """Of an ascii file, whose numbers have the type that its header gives them."""
    three = colour_columns([p.name for p in element.properties])
    if not three:
        return NO_COLOURS
    found = table[:, three]
    whole = all(element.properties[i].type[0] in "iu" for i in three) and (found % 1 == 0).all()
    return found.astype(np.int64) if whole else found


def _ascii_faces(element: Element, lines: list[bytes], rows: list[int], path: Path) -> NDArray[np.int64]:
    names = [p.name for p in element.properties]
    index = next((i for i, p in enumerate(element.properties) if p.name in FACE_LISTS and p.count_type), -1)
    if index < 0:
        raise InputError("The faces have no vertex_indices", file=path, advice="Export the mesh again")
    if any(p.count_type for p in element.properties[:index]):
        raise InputError(f"The list {names[0]} before the vertex indices is not supported", file=path, advice=PLAIN)
    triangles = even_table(lines, len(names) + 3)
    if triangles is not None and (triangles[:, index] == 3).all() and (triangles % 1 == 0).all():
        return triangles[:, index + 1 : index + 4].astype(np.int64)
    polygons = []
    for line, row in zip(lines, rows, strict=True):
        words = line.split()
        try:
            count = int(words[index])
            polygon = [int(word) for word in words[index + 1 : index + 1 + count]]
            if len(polygon) != count:
                raise ValueError
        except (ValueError, IndexError) as error:
            raise InputError(
                f'"{shown(line)}" is no face: a count and as many vertex numbers are needed',
                file=path,
                row=row,
                advice="The file may be truncated: copy or export it again",
            ) from error
        polygons.append(polygon)
    return triangulated(polygons)


def _truncated(element: Element, found: int, path: Path) -> InputError:
    what = {"vertex": "vertices", "face": "faces"}.get(element.name, f'rows of "{element.name}"')
    return InputError(
        f"The file is truncated: its header promises {element.rows} {what}, it holds {found}",
        file=path,
        advice="Copy or export it again",
    )
