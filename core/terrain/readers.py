# SPDX-License-Identifier: GPL-3.0-or-later
"""Any terrain file → a `Surface` in local coordinates, with normals out of the ground."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift
from ..progress import Progress, silent
from ..reading import reader, reading
from ..vectors import Array
from . import advice, cleaning, clouds, triangulation, winding
from .cloud import Cloud
from .folds import mesh_folds
from .joining import join
from .opening import (
    LAS_EXTENSIONS,
    HowToRead,
    Opened,
    box_of,
    check_path,
    open_terrain_file,
    open_terrain_files,
    placed,
    read_placed,
)
from .overhangs import find_overhangs
from .scan_colours import colours_at
from .source import Source
from .surface import Surface


@dataclass(frozen=True, eq=False)
class TerrainInfo:
    """What an import dialog needs to know before it reads and meshes a file.

    Attributes
    ----------
    name, kind : of the file; "mesh", "grid" or "cloud".
    minimum, maximum : (3,) box in survey coordinates [m].
    point_count, face_count : as in the file; no faces in grids and clouds.
    crs : as the file states it, empty when unknown.
    shift : proposed.
    summary : sentences, advice included.
    y_up : it looks as if y pointed up.
    units_m, stated_units_m : lengths of the units of x and y and of heights, as it was read, and as the file says [m].
    """

    name: str
    kind: str
    minimum: Array
    maximum: Array
    point_count: int
    face_count: int
    crs: str
    shift: GlobalShift
    summary: tuple[str, ...]
    y_up: bool = False
    units_m: tuple[float, float] = (1.0, 1.0)
    stated_units_m: tuple[float, float] = (1.0, 1.0)


@reader("terrain")
def read_terrain(
    path: str | Path,
    *,
    shift: GlobalShift | None = None,
    up: str = "auto",
    unit_m: float | None = None,
    height_unit_m: float | None = None,
    max_edge_m: float | None = None,
    ground_only: bool | None = None,
    ground_filter_m: float | None = None,
    progress: Progress = silent,
) -> Surface:
    """Read a mesh, grid or cloud; grids and clouds are meshed.

    Parameters
    ----------
    path : PLY, OBJ, STL, glTF, GLB; ASC, TIF; LAS, LAZ, XYZ, TXT, CSV, PTX, E57.
    shift : the project's; one is proposed from the data when None.
    up : axis that points up in the file: "z", "y", or "auto" (y in glTF, as its standard says, else z).
    unit_m, height_unit_m : length of the file's unit [m], 0.001 for millimetres, and of that of its heights; see
        `HowToRead`.
    max_edge_m : longest edge of a meshed cloud, in plan [m]; from the point spacing when None.
    ground_only : use the ground class of LAS and LAZ: None if there is one, True always, False never.
    ground_filter_m : cell of a filter that takes vegetation out of a cloud, whatever its classes say [m]; none when
        None. See `filter_ground`.

    Raises
    ------
    InputError : anything wrong with the file, with what to do about it.
    """
    path = Path(path)
    progress(f"Reading {path.name}", 0, 2)
    how = HowToRead(up, unit_m, ground_only, ground_filter_m, height_unit_m=height_unit_m)
    return _surface(open_terrain_file(path, how, shift, progress), max_edge_m, progress)


def read_tiles(
    paths: Sequence[str | Path],
    how: HowToRead,
    *,
    shift: GlobalShift | None = None,
    max_edge_m: float | None = None,
    progress: Progress = silent,
) -> Surface:
    """Read several files as one surface: clouds are meshed together, meshes and grids are joined as `join` does.

    Parameters
    ----------
    paths : one or more, see `read_terrain`, as the other parameters; the first file proposes the shift when None.

    Raises
    ------
    InputError : anything wrong with a file; the files are in different systems.
    """
    progress(f"Reading {_names(paths)}", 0, 2)
    opened = list(open_terrain_files([Path(path) for path in paths], how, shift, progress))
    surfaces = []
    while opened:
        with reading(opened[0].name, "terrain"):
            surfaces.append(_surface(opened.pop(0), max_edge_m, progress))
    return join(surfaces)


def read_tile_points(
    paths: Sequence[str | Path], how: HowToRead, *, shift: GlobalShift | None = None, progress: Progress = silent
) -> Cloud:
    """Read several files as the points of one cloud; parameters and errors are those of `read_tiles`."""
    progress(f"Reading {_names(paths)}", 0, 1)
    parts = [_cloud(opened) for opened in open_terrain_files([Path(path) for path in paths], how, shift, progress)]
    if len(parts) == 1:
        return parts[0]
    summary = tuple(f"{part.name}: {sentence}" for part in parts for sentence in part.summary)
    return Cloud(np.concatenate([part.points for part in parts]), parts[0].shift, _names(paths), summary)


def _names(paths: Sequence[str | Path]) -> str:
    return ", ".join(Path(path).name for path in paths)


@reader("terrain")
def read_points(
    path: str | Path,
    *,
    shift: GlobalShift | None = None,
    up: str = "auto",
    unit_m: float | None = None,
    height_unit_m: float | None = None,
    ground_only: bool | None = None,
    ground_filter_m: float | None = None,
    progress: Progress = silent,
) -> Cloud:
    """Read a cloud as its points, without a surface between them; of a mesh its vertices, of a grid its heights.

    Parameters and errors are those of `read_terrain`.
    """
    path = Path(path)
    progress(f"Reading {path.name}", 0, 1)
    how = HowToRead(up, unit_m, ground_only, ground_filter_m, height_unit_m=height_unit_m)
    return _cloud(open_terrain_file(path, how, shift, progress))


@reader("terrain")
def read_structure(
    path: str | Path, how: HowToRead | None = None, *, shift: GlobalShift | None = None, progress: Progress = silent
) -> Surface | Cloud:
    """Read a mesh or a grid as a surface, a cloud as its points: a wall has no surface in plan.

    Errors are those of `read_terrain`.
    """
    path = Path(path)
    progress(f"Reading {path.name}", 0, 2)
    opened = open_terrain_file(path, how or HowToRead(), shift, progress)
    return _cloud(opened) if opened.source.kind == "cloud" else _surface(opened, None, progress)


def _cloud(opened: Opened) -> Cloud:
    points = opened.source.points
    there = np.isfinite(points[:, 2])
    notes = [*opened.notes, "Blocks meet the points themselves: there is no surface between them."]
    if not there.all():
        points = points[there]
        notes.append(f"{int((~there).sum()):,} cells without data have no point.")
    return Cloud(points, opened.shift, opened.name, (*notes, *opened.advice))


def _surface(opened: Opened, max_edge_m: float | None, progress: Progress) -> Surface:
    source, name, shift = opened.source, opened.name, opened.shift
    before, after, left_out = opened.notes, opened.advice, opened.left_out
    progress("Meshing" if source.kind != "mesh" else "Orienting faces", 1, 2)
    if source.grid_shape is not None:
        meshed = triangulation.mesh_grid(source.points, source.grid_shape)
    elif source.faces is None:
        meshed = triangulation.mesh_cloud(source.points, max_edge_m)
        overhangs = find_overhangs(source.points)
        if overhangs is not None:
            progress("Meshing overhangs", 1, 2)
            meshed, said = mesh_folds(source.points, meshed, overhangs, max_edge_m)
            before = (overhangs.sentence(shift), said, *before)
    else:
        meshed = triangulation.Meshed(source.points, source.faces, ())
    kind, turned, merged = source.kind, source.turned, source.merged
    points, colours = (source.points, source.colours) if source.colours is not None else (meshed.points, None)
    del source, opened  # their points are as large as what follows
    vertices, faces, done = _cleaned(meshed, kind, merged)
    if colours is not None:
        colours = colours_at(vertices, points, colours)
        done.append("The points have colours.")
    return Surface(vertices, faces, shift, name, (*before, *meshed.notes, *done, *after), left_out, turned, colours)


@reader("terrain")
def inspect_terrain(
    path: str | Path, *, up: str = "auto", unit_m: float | None = None, height_unit_m: float | None = None
) -> TerrainInfo:
    """Box, counts, CRS and proposed shift, without meshing; from the header where it tells (LAS, LAZ).

    Raises
    ------
    InputError : anything wrong with the file, with what to do about it.
    """
    path, how = Path(path), HowToRead(up, unit_m, height_unit_m=height_unit_m)
    if path.suffix.lower() in LAS_EXTENSIONS:
        check_path(path)
        box, count, scales, system, said = clouds.inspect_las(path)
        source = placed(Source(box, system=system, notes=said, count=count, step=scales), how, path)
    else:
        source = read_placed(path, how)
        count = len(source.points) + source.merged
    points = source.points
    heights = np.isfinite(points[:, 2]) if source.kind == "grid" else slice(None)
    low, high = box_of(points[heights], path, count)
    advice.refuse_impossible(source, low, high, unit_m, path)
    shift = GlobalShift.proposed(low, high, source.crs)
    whole = advice.of_heights(points) if len(points) + source.merged == count else []  # of LAS the box alone is read
    notes = (*source.notes, *advice.sentences(low, high, shift), *whole)
    y_up = False
    if source.faces is not None:
        y_up = advice.mesh_faces_along_y(cleaning.examine_faces(points, source.faces)[1])
    elif source.kind == "cloud" and len(points) == count:
        y_up = advice.faces_along_y(points)
    faces = 0 if source.faces is None else len(source.faces)
    return TerrainInfo(
        path.name, source.kind, low, high, count, faces, source.crs, shift, notes, y_up,
        source.units_m, source.stated_units_m,
    )  # fmt: skip


def _cleaned(meshed: triangulation.Meshed, kind: str, already: int) -> tuple[Array, NDArray[np.int32], list[str]]:
    vertices, faces, notes = meshed.points, meshed.faces, []
    if kind == "mesh":
        vertices, faces, merged = cleaning.merge_duplicates(vertices, faces)
        if merged + already:
            notes.append(f"Merged {merged + already:,} vertices that were stored more than once.")
    degenerate, total, (any_up, any_down) = cleaning.examine_faces(vertices, faces)
    if degenerate.any():
        faces = faces[~degenerate]
        notes.append(f"Dropped {int(degenerate.sum()):,} degenerate faces.")
    if not len(faces):
        raise InputError("All faces are degenerate: the points lie on lines", advice="Check the export")
    vertices, faces, loose = cleaning.drop_loose(vertices, faces)
    if loose:
        notes.append(f"Left out {loose:,} points that no triangle uses.")
    if kind != "mesh":
        return vertices, faces, notes
    oriented = winding.orient(vertices, faces, bool(any_up), bool(any_down), float(total[2]))
    if oriented.flipped:
        notes.append(f"Turned {oriented.flipped:,} of {len(faces):,} faces, so that normals point out of the ground.")
    if oriented.contradictions:
        notes.append(f"At {oriented.contradictions:,} edges no winding agrees (a one-sided surface).")
    if oriented.components > 1:
        notes.append(f"The surface has {oriented.components:,} separate pieces.")
    if advice.mesh_faces_along_y(total):
        notes.append(advice.Y_UP)
    return vertices, oriented.faces, notes
