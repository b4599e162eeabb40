# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in Wavefront OBJ and STL."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import AGAIN
from ..vectors import Array
from .cleaning import merge_duplicates
from .scan_colours import colours_of
from .source import Source, check_face_indices, check_finite
from .text import NumberRows, all_numbers, line_at, line_blocks, shown
from .textures import texture_colours

BLANK, NEWLINE = 32, 10
NO_VERTEX = np.iinfo(np.int32).max
BLOCK_TRIANGLES = 1 << 16
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_obj(path: Path) -> Source:
    """Read the vertices and faces of a Wavefront OBJ, and its colours: those that follow the coordinates of the
    vertices, or those of its texture.

    Raises
    ------
    InputError : no vertices or faces, something that is not a number, a vertex that does not exist; with its row.
    """
    vertices, corners = NumberRows(path, "Coordinates"), _Corners(path)
    before, vertex_row, library = 0, 0, b""
    for lines in line_blocks(path):
        library = library or next((line[7:].strip() for line in lines if line.startswith(b"mtllib ")), b"")
        vertex_rows = [i for i, line in enumerate(lines) if line.startswith((b"v ", b"v\t"))]
        face_rows = [i for i, line in enumerate(lines) if line.startswith((b"f ", b"f\t"))]
        vertices.add([lines[i][2:] for i in vertex_rows], [before + i + 1 for i in vertex_rows])
        if vertex_rows and not vertex_row:
            vertex_row = before + vertex_rows[0] + 1
        if face_rows:
            corners.add(
                [lines[i] for i in face_rows], np.array(face_rows), np.array(vertex_rows, dtype=np.intp), before
            )
        corners.vertices += len(vertex_rows)
        before += len(lines)
    if not vertex_row:
        raise InputError("The OBJ file has no vertices", file=path, advice="Check its extension or export it again")
    if not corners.faces:
        raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
    points = vertices.table()
    if points.shape[1] < 3:
        raise InputError(f"{points.shape[1]} coordinates, where 3 are needed", file=path, row=vertex_row)
    colours, said = colours_of(points[:, -3:]) if points.shape[1] in (6, 7) else (None, "")
    points, faces = np.ascontiguousarray(points[:, :3]), corners.triangles()
    if colours is None and not said and library:
        colours, said = texture_colours(path, library.decode("utf-8", "replace"), points)
    return Source(points, faces, notes=(said,) if said else (), colours=colours)


class _Corners:
    """The faces of a Wavefront OBJ, which come in blocks of lines: polygons as fans of triangles.

    Attributes
    ----------
    vertices : how many there were before the block.
    faces : (k, 3) of each block; −1 for a vertex before the first.
    rows : (k,) of each block, in the file.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.vertices = path, 0
        self.faces: list[NDArray[np.int32]] = []
        self.rows: list[NDArray[np.int32]] = []

    def add(self, lines: list[bytes], face_rows: NDArray[np.intp], vertex_rows: NDArray[np.intp], before: int) -> None:
        """Faces of a block that begins `before` rows after the file's first one; rows are those in the block."""

        def wrong(face: int, problem: str) -> InputError:
            return InputError(problem, file=self.path, row=before + int(face_rows[face]) + 1, advice=AGAIN)

        text = re.sub(rb"/\S*", b"", b"\n".join(line[2:] for line in lines))
        number = _whole_numbers(text)
        if number is None:
            face = next(i for i, line in enumerate(text.split(b"\n")) if _whole_numbers(line) is None)
            raise wrong(face, f'"{shown(lines[face])}" is no face')
        code = np.frombuffer(text, np.uint8)
        begins = np.flatnonzero((code > BLANK) & np.r_[True, code[:-1] <= BLANK])
        corners = np.diff(np.searchsorted(begins, [0, *np.flatnonzero(code == NEWLINE).tolist(), code.size]))
        if (corners < 3).any():
            raise wrong(int(np.argmax(corners < 3)), "A face needs three vertices")
        # Numbers count from 1; negative ones count back from the last vertex before the face.
        counted = (self.vertices + np.searchsorted(vertex_rows, face_rows)).repeat(corners)
        vertex = np.where(number > 0, number - 1, np.where(number < 0, counted + number, -1))
        vertex = np.clip(vertex, -1, NO_VERTEX).astype(np.int32)
        triangles = corners - 2
        first = np.repeat(np.cumsum(corners) - corners, triangles)
        turn = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
        self.faces.append(vertex[first[:, None] + np.stack([0 * turn, turn + 1, turn + 2], axis=1)])
        self.rows.append((before + 1 + face_rows).astype(np.int32).repeat(triangles))

    def triangles(self) -> NDArray[np.int32]:
        """(m, 3) all of them.

        Raises
        ------
        InputError : one names a vertex that there is not.
        """
        for faces, rows in zip(self.faces, self.rows, strict=True):
            outside = ((faces < 0) | (faces >= self.vertices)).any(axis=1)
            if outside.any():
                row = int(rows[np.argmax(outside)])
                raise InputError(
                    f'"{shown(line_at(self.path, row))}" names a vertex that does not exist',
                    file=self.path,
                    row=row,
                    advice=f"The file has {self.vertices} vertices: export it again",
                )
        return np.concatenate(self.faces)


def _whole_numbers(text: bytes) -> Array | None:
    number = all_numbers(text)
    return number if number is not None and (np.isfinite(number) & (number == np.rint(number))).all() else None


def read_stl(path: Path) -> Source:
    """Read a binary or ascii STL: a soup of triangles, whose corners are merged some at a time.

    Raises
    ------
    InputError : truncated, no faces, a corner that is not three numbers.
    """
    size = path.stat().st_size
    if not size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with path.open("rb") as file:
        beginning = file.read(84)
    promised = int.from_bytes(beginning[80:84], "little") if len(beginning) == 84 else -1
    # A binary header may begin with "solid" too: the size is what tells.
    if size == 84 + promised * STL_TRIANGLE.itemsize:
        corners: Iterator[Array] = (
            np.fromfile(path, STL_TRIANGLE, BLOCK_TRIANGLES, offset=84 + start * STL_TRIANGLE.itemsize)["corners"]
            for start in range(0, promised, BLOCK_TRIANGLES)
        )
    elif beginning.lstrip().startswith(b"solid") and b"\0" not in beginning:
        written = _written_corners(path)
        corners = (written[i : i + BLOCK_TRIANGLES] for i in range(0, len(written), BLOCK_TRIANGLES))
    elif promised >= 0 and size > 84:
        raise InputError(
            f"The file is truncated or not STL: its header promises {promised} triangles, "
            f"it holds {(size - 84) // STL_TRIANGLE.itemsize}",
            file=path,
            advice="Copy or export it again",
        )
    else:
        raise InputError("Not an STL file", file=path, advice="Check its extension or export it again")
    points, faces, merged = _merged(corners, path)
    return Source(points, check_face_indices(faces, len(points), path), merged=merged)


def _merged(corners: Iterable[Array], path: Path) -> tuple[Array, NDArray[np.int32], int]:
    """Vertices and faces of triangles (m, 3, 3) that come some at a time, and how many vertices fewer there are.

    Those of one part and those of the next are merged later, with what other formats store more than once.

    Raises
    ------
    InputError : a coordinate that is not finite.
    """
    vertices, faces, before, seen = [np.empty((0, 3))], [np.empty((0, 3), np.int32)], 0, 0
    for part in corners:
        soup = part.reshape(-1, 3).astype(np.float64)
        check_finite(soup, "mesh", path, seen)
        seen += len(soup)
        kept, numbers, _ = merge_duplicates(soup, np.arange(len(soup), dtype=np.int32).reshape(-1, 3))
        vertices.append(kept)
        faces.append(numbers + np.int32(before))
        before += len(kept)
    return np.concatenate(vertices), np.concatenate(faces), seen - before


def _written_corners(path: Path) -> Array:
    """(m, 3, 3) of an ascii STL."""
    found, before, vertices, row = NumberRows(path, "Three coordinates"), 0, 0, 0
    last: list[bytes] = []
    for lines in line_blocks(path):
        rows = [i for i, line in enumerate(lines) if line.lstrip().startswith(b"vertex")]
        found.add([lines[i].strip()[6:] for i in rows], [before + i + 1 for i in rows])
        if rows and not row:
            row = before + rows[0] + 1
        vertices, before, last = vertices + len(rows), before + len(lines), [*last, *lines][-5:]
    if vertices % 3 or not any(line.lstrip().startswith(b"endsolid") for line in last):
        raise InputError("The file is truncated: its solid has no end", file=path, row=before, advice="Export it again")
    table = found.table()
    if vertices and table.shape[1] != 3:
        raise InputError("A corner needs three coordinates", file=path, row=row)
    return table.reshape(-1, 3, 3)
