# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in Wavefront OBJ and STL."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading import AGAIN
from ..vectors import Array
from .source import Source, check_face_indices
from .text import all_numbers, number_table, read_text, shown

BLANK, NEWLINE = 32, 10
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_obj(path: Path) -> Source:
    """Read the vertices and faces of a Wavefront OBJ; materials, normals and texture coordinates are not needed.

    Raises
    ------
    InputError : no vertices or faces, something that is not a number, a vertex that does not exist; with its row.
    """
    lines = read_text(path).split(b"\n")
    vertex_rows = [i for i, line in enumerate(lines) if line.startswith((b"v ", b"v\t"))]
    face_rows = [i for i, line in enumerate(lines) if line.startswith((b"f ", b"f\t"))]
    if not vertex_rows:
        raise InputError("The OBJ file has no vertices", file=path, advice="Check its extension or export it again")
    if not face_rows:
        raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
    points = number_table([lines[i][2:] for i in vertex_rows], [i + 1 for i in vertex_rows], path, "Coordinates")
    if points.shape[1] < 3:
        raise InputError(f"{points.shape[1]} coordinates, where 3 are needed", file=path, row=vertex_rows[0] + 1)
    faces = _obj_faces([lines[i] for i in face_rows], np.array(face_rows), np.array(vertex_rows), path)
    return Source(np.ascontiguousarray(points[:, :3]), faces)


def _obj_faces(
    lines: list[bytes], face_rows: NDArray[np.intp], vertex_rows: NDArray[np.intp], path: Path
) -> NDArray[np.int32]:
    """(m, 3) polygons of any number of corners as fans of triangles; corners are counted from the front or back."""

    def wrong(face: int, problem: str, advice: str) -> InputError:
        return InputError(problem, file=path, row=int(face_rows[face]) + 1, advice=advice)

    text = re.sub(rb"/\S*", b"", b"\n".join(line[2:] for line in lines))
    number = _whole_numbers(text)
    if number is None:
        face = next(i for i, line in enumerate(text.split(b"\n")) if _whole_numbers(line) is None)
        raise wrong(face, f'"{shown(lines[face])}" is no face', AGAIN)
    code = np.frombuffer(text, np.uint8)
    begins = np.flatnonzero((code > BLANK) & np.r_[True, code[:-1] <= BLANK])
    corners = np.diff(np.searchsorted(begins, [0, *np.flatnonzero(code == NEWLINE).tolist(), code.size]))
    if (corners < 3).any():
        raise wrong(int(np.argmax(corners < 3)), "A face needs three vertices", AGAIN)
    # Numbers count from 1; negative ones count back from the last vertex before the face.
    of_face = np.repeat(np.arange(len(lines)), corners)
    vertex = np.where(number > 0, number - 1, np.searchsorted(vertex_rows, face_rows)[of_face] + number)
    outside = (vertex < 0) | (vertex >= len(vertex_rows)) | (number == 0)
    if outside.any():
        face = int(of_face[np.argmax(outside)])
        advice = f"The file has {len(vertex_rows)} vertices: export it again"
        raise wrong(face, f'"{shown(lines[face])}" names a vertex that does not exist', advice)
    triangles = corners - 2
    first = np.repeat(np.cumsum(corners) - corners, triangles)
    turn = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return vertex[first[:, None] + np.stack([0 * turn, turn + 1, turn + 2], axis=1)].astype(np.int32)


def _whole_numbers(text: bytes) -> Array | None:
    number = all_numbers(text)
    return number if number is not None and (np.isfinite(number) & (number == np.rint(number))).all() else None


def read_stl(path: Path) -> Source:
    """Read a binary or ascii STL; a soup of triangles, whose corners are merged later.

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
        corners = np.fromfile(path, STL_TRIANGLE, offset=84)["corners"].astype(np.float64)
    elif beginning.lstrip().startswith(b"solid") and b"\0" not in beginning:
        lines = read_text(path).split(b"\n")
        rows = [i for i, line in enumerate(lines) if line.lstrip().startswith(b"vertex")]
        table = number_table([lines[i].strip()[6:] for i in rows], [i + 1 for i in rows], path, "Three coordinates")
        if len(rows) % 3 or not any(line.lstrip().startswith(b"endsolid") for line in lines[-5:]):
            raise InputError(
                "The file is truncated: its solid has no end", file=path, row=len(lines), advice="Export it again"
            )
        if len(rows) and table.shape[1] != 3:
            raise InputError("A corner needs three coordinates", file=path, row=rows[0] + 1)
        corners = table.reshape(-1, 3, 3)
    elif promised >= 0 and size > 84:
        raise InputError(
            f"The file is truncated or not STL: its header promises {promised} triangles, "
            f"it holds {(size - 84) // STL_TRIANGLE.itemsize}",
            file=path,
            advice="Copy or export it again",
        )
    else:
        raise InputError("Not an STL file", file=path, advice="Check its extension or export it again")
    points = corners.reshape(-1, 3)
    return Source(points, check_face_indices(np.arange(len(points)).reshape(-1, 3), len(points), path))
