# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in Wavefront OBJ and STL."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import AGAIN
from ..vectors import Array
from .cleaning import merge_duplicates
from .comments import comment_sentences
from .coordinate_step import single_precision_step
from .polygons import Triangles, triangles_of
from .scan_colours import colours_of
from .source import Source, check_face_indices, check_finite
from .text import NumberRows, all_numbers, line_at, line_blocks, shown
from .textures import texture_colours

LEFT_OUT = {
    b"l": "lines", b"p": "points", b"curv": "curves", b"curv2": "curves on surfaces", b"surf": "free-form surfaces",
}  # fmt: skip
"""Elements of a Wavefront OBJ that are no faces, by the word that they begin with."""
BLANK, NEWLINE, FIRST_ROWS = 32, 10, 200
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
    before, vertex_row, library, others, comments = 0, 0, b"", Counter[bytes](), list[str]()
    for lines in _whole_lines(line_blocks(path)):
        library = library or next((line[7:].strip() for line in lines if line.startswith(b"mtllib ")), b"")
        if not before:
            comments = [line[1:].decode("utf-8", "replace") for line in lines[:FIRST_ROWS] if line.startswith(b"#")]
        others.update(
            line[: line.find(b" ")] for line in lines if line.startswith(tuple(b"%s " % key for key in LEFT_OUT))
        )
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
    if not corners.found:
        raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
    points = vertices.table()
    if points.shape[1] < 3:
        raise InputError(f"{points.shape[1]} coordinates, where 3 are needed", file=path, row=vertex_row)
    colours, said = colours_of(points[:, -3:]) if points.shape[1] in (6, 7) else (None, "")
    left = ", ".join(f"{LEFT_OUT[key]} ({many:,})" for key, many in sorted(others.items()))
    notes = [f"Left out what is no face: {left}."] if left else []
    if points.shape[1] == 4 and (points[:, 3] != 1.0).any():
        many = int((points[:, 3] != 1.0).sum())
        notes.append(f"{many:,} vertices have a fourth number, the weight in a curve: it moves no corner of a face.")
    points = np.ascontiguousarray(points[:, :3])
    made = corners.triangles(points)
    notes += [*made.notes, *comment_sentences(comments)]
    if colours is None and not said and library:
        colours, said = texture_colours(path, library.decode("utf-8", "replace"), points)
    notes += [said] if said else []
    return Source(points, made.faces, notes=tuple(notes), colours=colours)


def _whole_lines(blocks: Iterable[list[bytes]]) -> Iterator[list[bytes]]:
    """Lines that end in a backslash go on in the next one; empty lines follow, so that rows keep their numbers."""
    kept: list[bytes] = []
    for block in blocks:
        lines = [*kept, *block]
        going_on = [i for i, line in enumerate(lines) if line.endswith(b"\\")]
        end = len(lines)
        while end and lines[end - 1].endswith(b"\\"):
            end -= 1
        kept = lines[end:]
        for i in reversed(going_on):
            if i < end:
                lines[i : i + 2] = [lines[i][:-1] + b" " + lines[i + 1], b""]
        yield lines[:end]
    if kept:
        yield [b" ".join(line[:-1] for line in kept), *[b""] * (len(kept) - 1)]


class _Corners:
    """The faces of a Wavefront OBJ, which come in blocks of lines.

    Attributes
    ----------
    vertices : how many there were before the block.
    found : faces there are.
    numbers : (sum of counts,) vertices of the faces of each block; −1 for a vertex before the first.
    counts : (k,) corners of each face of each block.
    rows : (k,) of each face, in the file.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.vertices, self.found = path, 0, 0
        self.numbers: list[NDArray[np.int32]] = []
        self.counts: list[NDArray[np.int32]] = []
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
        self.numbers.append(np.clip(vertex, -1, NO_VERTEX).astype(np.int32))
        self.counts.append(corners.astype(np.int32))
        self.rows.append((before + 1 + face_rows).astype(np.int32))
        self.found += len(corners)

    def triangles(self, points: Array) -> Triangles:
        """All of them, of vertices (n, 3); polygons are cut. Afterwards there are none.

        Raises
        ------
        InputError : one names a vertex that there is not.
        """
        for numbers, counts, rows in zip(self.numbers, self.counts, self.rows, strict=True):
            outside = (numbers < 0) | (numbers >= self.vertices)
            if outside.any():
                row = int(rows[np.searchsorted(np.cumsum(counts), np.argmax(outside), side="right")])
                raise InputError(
                    f'"{shown(line_at(self.path, row))}" names a vertex that does not exist',
                    file=self.path,
                    row=row,
                    advice=f"The file has {self.vertices} vertices: export it again",
                )
        numbers, counts = np.concatenate(self.numbers), np.concatenate(self.counts)
        self.numbers, self.counts, self.rows = [], [], []
        check_finite(points, "mesh", self.path)
        return triangles_of(points, numbers, counts)


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
    is_binary = size == 84 + promised * STL_TRIANGLE.itemsize
    if is_binary:
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
    step = single_precision_step(points) if is_binary else None
    return Source(
        points, check_face_indices(faces, len(points), path), notes=_unit_words(beginning), merged=merged, step=step
    )


def _unit_words(beginning: bytes) -> tuple[str, ...]:
    """What to say where the first bytes name a unit: STL has none by its standard, and programs write one there."""
    header = beginning[:80].split(b"\n")[0].decode("ascii", "replace")
    found = re.search(r"\bunits?\s*[:=]?\s*([A-Za-z]{1,12})\b", header, re.IGNORECASE)
    if found is None:
        return ()
    return (f'The header names a unit, "{found[0]}"; STL has none, and lengths are taken as asked: check the unit.',)


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
