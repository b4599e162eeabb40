# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers that a PLY file has beside its coordinates, of vertices or of faces: zones, classes, soil types."""

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import reader
from ..vectors import Array
from .opening import AS_IT_IS, HowToRead, placed
from .ply import FACE_LISTS, Element, list_counts, read_header, read_ply, row_type, walked
from .text import number_table


@dataclass(frozen=True, eq=False)
class PlyAttribute:
    """One number at each vertex or face.

    Attributes
    ----------
    places : (k, 3) of the vertices, or the middles of the faces, in metres with z up, in survey coordinates.
    values : (k,).
    of_faces : else of vertices.
    """

    places: Array
    values: Array
    of_faces: bool


def read_ply_attributes(paths: Sequence[str | Path], name: str, how: HowToRead) -> PlyAttribute:
    """The attribute of a name in several files as one.

    Raises
    ------
    InputError : see `read_ply_attribute`; one file has it of its faces, another of its vertices.
    """
    parts = [read_ply_attribute(path, name, how) for path in paths]
    for path, part in zip(paths, parts, strict=True):
        if part.of_faces != parts[0].of_faces:
            of, other = ("faces", "vertices") if part.of_faces else ("vertices", "faces")
            raise InputError(
                f"The attribute {name!r} is of {of} here, of {other} in {paths[0]}",
                file=path,
                advice="Export the tiles in the same way",
            )
    places, values = (np.concatenate([getattr(part, what) for part in parts]) for what in ("places", "values"))
    return PlyAttribute(places, values, parts[0].of_faces)


@reader("terrain")
def read_ply_attribute(path: str | Path, name: str, how: HowToRead = AS_IT_IS) -> PlyAttribute:
    """The attribute of a name; of the faces where both have it.

    Raises
    ------
    InputError : see `read_ply`; there is no such attribute, with the nearest; its faces are not all triangles.
    """
    path = Path(path)
    if path.suffix.lower() != ".ply":
        raise InputError("Only PLY files have attributes", file=path, advice="Export the terrain as PLY")
    source = placed(read_ply(path), how, path)
    data = np.memmap(path, dtype=np.uint8, mode="r")
    order, elements, start, header_rows, _ = read_header(data, path)
    for element in sorted(elements, key=lambda one: one.name != "face"):
        if element.name not in ("vertex", "face") or name not in _numbers_of(element):
            continue
        before = elements[: elements.index(element)]
        if order:
            values = _binary_values(data, start, before, element, order, name, path)
        else:
            values = _ascii_values(data[start:].tobytes(), header_rows, before, element, name, path)
        places = source.points
        if element.name == "face":
            if source.faces is None or len(source.faces) != len(values):
                raise _not_triangles(path)
            places = source.points[source.faces].mean(axis=1)
        return PlyAttribute(places, np.asarray(values, dtype=np.float64), element.name == "face")
    known = sorted({one for element in elements for one in _numbers_of(element)} - set("xyz"))
    near = get_close_matches(name, known, n=1, cutoff=0.5)
    raise InputError(
        f"The file has no attribute {name!r}",
        file=path,
        advice=f"Did you mean {near[0]}? It has {', '.join(known)}" if near else f"It has {', '.join(known) or 'none'}",
    )


def _numbers_of(element: Element) -> list[str]:
    return [p.name for p in element.properties if not p.count_type and p.name not in FACE_LISTS]


def _binary_values(
    data: NDArray[np.uint8], start: int, before: list[Element], element: Element, order: str, name: str, path: Path
) -> Array:
    offset = start
    for one in (*before, element):
        dtype = row_type(data, offset, one, order)
        end = offset + one.rows * dtype.itemsize
        rows = data[offset:end].view(dtype) if end <= data.size else np.empty(0, dtype)
        if end > data.size or any((rows[count] != rows[count][:1]).any() for count in list_counts(dtype)):
            if one.name == "face":
                raise _not_triangles(path)
            values, offset = walked(data, offset, one, order, path)
            if one is element:
                return np.asarray(values[name], dtype=np.float64)
            continue
        offset = end
    return rows[name].astype(np.float64)


def _ascii_values(
    text: bytes, header_rows: int, before: list[Element], element: Element, name: str, path: Path
) -> Array:
    numbered = [(row, line) for row, line in enumerate(text.splitlines(), start=header_rows + 1) if line.strip()]
    first = sum(one.rows for one in before)
    block = numbered[first : first + element.rows]
    lines = [line.split() for _, line in block]
    column = 0
    for p in element.properties:
        if p.name == name:
            break
        column += 1
        if p.count_type:
            counts = {line[column - 1] for line in lines}
            if len(counts) > 1:
                raise _not_triangles(path)
            column += int(counts.pop()) if counts else 0
    cells = [b"".join(line[column : column + 1]) for line in lines]
    return number_table(cells, [row for row, _ in block], path, f"numbers of {name}")[:, 0]


def _not_triangles(path: Path) -> InputError:
    return InputError("The faces are not all triangles", file=path, advice="Triangulate the mesh first")
