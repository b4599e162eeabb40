# SPDX-License-Identifier: GPL-3.0-or-later
"""Any terrain file → a `Surface` in local coordinates, with normals out of the ground."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..georeference import GlobalShift
from ..plausibility import GREATEST_M
from ..progress import Progress, silent
from ..reading import reader
from ..vectors import Array
from . import advice, cleaning, clouds, geotiff, gltf, grids, meshes, ply, triangulation, winding
from .cloud import Cloud
from .crs import surely_different
from .ground_filter import filter_ground
from .overhangs import find_overhangs
from .source import Source
from .surface import Surface

READERS: dict[str, Callable[[Path], Source]] = {
    ".ply": ply.read_ply,
    ".obj": meshes.read_obj,
    ".stl": meshes.read_stl,
    ".gltf": gltf.read_gltf,
    ".glb": gltf.read_gltf,
    ".asc": grids.read_ascii_grid,
    ".tif": geotiff.read_geotiff,
    ".tiff": geotiff.read_geotiff,
    ".xyz": clouds.read_xyz,
    ".txt": clouds.read_xyz,
    ".csv": clouds.read_xyz,
}
LAS_EXTENSIONS = (".las", ".laz")
EXTENSIONS = (*READERS, *LAS_EXTENSIONS)
UP_AXES = ("auto", "z", "y")


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


@reader("terrain")
def read_terrain(
    path: str | Path,
    *,
    shift: GlobalShift | None = None,
    up: str = "auto",
    unit_m: float = 1.0,
    max_edge_m: float | None = None,
    ground_only: bool | None = None,
    ground_filter_m: float | None = None,
    progress: Progress = silent,
) -> Surface:
    """Read a mesh, grid or cloud; grids and clouds are meshed.

    Parameters
    ----------
    path : PLY, OBJ, STL, glTF, GLB; ASC, TIF; LAS, LAZ, XYZ, TXT, CSV.
    shift : the project's; one is proposed from the data when None.
    up : axis that points up in the file: "z", "y", or "auto" (y in glTF, as its standard says, else z).
    unit_m : length of the file's unit [m], 0.001 for millimetres.
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
    return _surface(_opened(path, shift, up, unit_m, ground_only, ground_filter_m), max_edge_m, progress)


@reader("terrain")
def read_points(
    path: str | Path,
    *,
    shift: GlobalShift | None = None,
    up: str = "auto",
    unit_m: float = 1.0,
    ground_only: bool | None = None,
    ground_filter_m: float | None = None,
    progress: Progress = silent,
) -> Cloud:
    """Read a cloud as its points, without a surface between them; of a mesh its vertices, of a grid its heights.

    Parameters and errors are those of `read_terrain`.
    """
    path = Path(path)
    progress(f"Reading {path.name}", 0, 1)
    return _cloud(_opened(path, shift, up, unit_m, ground_only, ground_filter_m))


@reader("terrain")
def read_structure(
    path: str | Path,
    *,
    shift: GlobalShift | None = None,
    up: str = "auto",
    unit_m: float = 1.0,
    ground_only: bool | None = None,
    ground_filter_m: float | None = None,
    progress: Progress = silent,
) -> Surface | Cloud:
    """Read a mesh or a grid as a surface, a cloud as its points: a wall has no surface in plan.

    Parameters and errors are those of `read_terrain`.
    """
    path = Path(path)
    progress(f"Reading {path.name}", 0, 2)
    opened = _opened(path, shift, up, unit_m, ground_only, ground_filter_m)
    return _cloud(opened) if opened.source.kind == "cloud" else _surface(opened, None, progress)


@dataclass(frozen=True, eq=False)
class _Opened:
    """A file's contents in local coordinates, and what there is to say of them."""

    path: Path
    source: Source
    shift: GlobalShift
    notes: tuple[str, ...]
    advice: tuple[str, ...]
    left_out: Array


def _opened(
    path: Path,
    shift: GlobalShift | None,
    up: str,
    unit_m: float,
    ground_only: bool | None,
    ground_filter_m: float | None,
) -> _Opened:
    source = _read(path, ground_only if ground_filter_m is None else False)
    points = _placed(source, up, unit_m, path)
    notes = list(source.notes)
    left_out = points[:0]
    if ground_filter_m is not None:
        points, left_out, filtered = _ground(source, points, ground_filter_m, path)
        notes += filtered
    if source.faces is not None:
        notes.append(f"Mesh of {len(points):,} vertices and {len(source.faces):,} faces.")
    notes += _said_placement(source, up, unit_m)
    heights = np.isfinite(points[:, 2]) if source.kind == "grid" else slice(None)
    low, high = _box(points[heights], path)
    advice.refuse_degrees(source, low, high, unit_m, path)
    shift = _shift(shift, low, high, source.crs, path)
    said = [*advice.sentences(low, high, shift)]
    if source.kind == "cloud" and advice.faces_along_y(points):
        said.append(advice.Y_UP)
    if shift.vector.any():
        said.append(f"Shifted by ({shift.x:.0f}, {shift.y:.0f}, {shift.z:.0f}) m from survey to local coordinates.")
    if source.crs and source.crs != shift.crs:
        said.append(f"The file names its system {source.crs}: check that this is the same as the project's.")
    said.append(
        f"Coordinate reference system {shift.crs}." if shift.crs else "The coordinate reference system is unknown."
    )
    left_out = left_out - shift.vector
    return _Opened(path, replace(source, points=points - shift.vector), shift, tuple(notes), tuple(said), left_out)


def _ground(source: Source, points: Array, cell_m: float, path: Path) -> tuple[Array, Array, tuple[str, ...]]:
    """The points on the ground, those left out, and what to say of it."""
    if source.kind != "cloud":
        raise InputError(
            f"This is a {source.kind}, and the ground filter works on clouds", file=path, advice="Read it without"
        )
    try:
        found = filter_ground(points, cell_m)
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error
    return points[found.ground], points[~found.ground], found.notes


def _cloud(opened: _Opened) -> Cloud:
    points = opened.source.points
    points = points[np.isfinite(points[:, 2])]
    note = "Blocks meet the points themselves: there is no surface between them."
    return Cloud(points, opened.shift, opened.path.name, (*opened.notes, note, *opened.advice))


def _surface(opened: _Opened, max_edge_m: float | None, progress: Progress) -> Surface:
    source, path, shift = opened.source, opened.path, opened.shift
    before, after, left_out = opened.notes, opened.advice, opened.left_out
    progress("Meshing" if source.kind != "mesh" else "Orienting faces", 1, 2)
    if source.grid_shape is not None:
        meshed = triangulation.mesh_grid(source.points, source.grid_shape)
    elif source.faces is None:
        meshed = triangulation.mesh_cloud(source.points, max_edge_m)
        overhangs = find_overhangs(source.points)
        before = before if overhangs is None else (overhangs.sentence(shift), *before)
    else:
        meshed = triangulation.Meshed(source.points, source.faces, ())
    kind = source.kind
    del source, opened  # their points are as large as what follows
    vertices, faces, done = _cleaned(meshed, kind)
    return Surface(vertices, faces, shift, path.name, (*before, *meshed.notes, *done, *after), left_out)


@reader("terrain")
def inspect_terrain(path: str | Path, *, up: str = "auto", unit_m: float = 1.0) -> TerrainInfo:
    """Box, counts, CRS and proposed shift, without meshing; from the header alone where it tells (LAS, LAZ).

    Raises
    ------
    InputError : anything wrong with the file, with what to do about it.
    """
    path = Path(path)
    if path.suffix.lower() in LAS_EXTENSIONS:
        _check_path(path)
        box, count, crs, geographic = clouds.inspect_las(path)
        source = Source(box, crs=crs, geographic=geographic, notes=(f"Cloud of {count:,} points.",))
    else:
        source = _read(path, None)
        count = len(source.points)
    points = _placed(source, up, unit_m, path)
    heights = np.isfinite(points[:, 2]) if source.kind == "grid" else slice(None)
    low, high = _box(points[heights], path, count)
    advice.refuse_degrees(source, low, high, unit_m, path)
    shift = GlobalShift.proposed(low, high, source.crs)
    notes = (*source.notes, *_said_placement(source, up, unit_m), *advice.sentences(low, high, shift))
    faces = 0 if source.faces is None else len(source.faces)
    return TerrainInfo(path.name, source.kind, low, high, count, faces, source.crs, shift, notes)


def _check_path(path: Path) -> None:
    if path.is_dir():
        raise InputError("This is a folder", file=path, advice="Choose a terrain file in it")
    if not path.is_file():
        raise InputError("There is no such file", file=path, advice="Check the path")
    if path.suffix.lower() not in EXTENSIONS:
        raise InputError(
            f'"{path.suffix}" is no terrain format', file=path, advice=f"Supported are {', '.join(EXTENSIONS)}"
        )


def _read(path: Path, ground_only: bool | None) -> Source:
    _check_path(path)
    extension = path.suffix.lower()
    if extension in LAS_EXTENSIONS:
        return clouds.read_las(path, ground_only)
    if ground_only:
        raise InputError("Only LAS and LAZ files have a ground class", file=path, advice="Read it without ground_only")
    return READERS[extension](path)


def _placed(source: Source, up: str, unit_m: float, path: Path) -> Array:
    """Points in metres with z up, checked to be finite."""
    if up not in UP_AXES:
        raise InputError(f'The up axis "{up}" is unknown', file=path, advice=f"Choose one of {', '.join(UP_AXES)}")
    if not (np.isfinite(unit_m) and unit_m > 0):
        raise InputError(f"The unit of {unit_m} m is no length", file=path, advice="Give 0.001 for millimetres")
    points = source.points
    finite = np.isfinite(points)
    if source.kind == "grid":
        finite = finite[:, :2]
        if np.isinf(points[:, 2]).any():
            points = np.where(np.isinf(points), np.nan, points)
    if not finite.all():
        row = int(np.flatnonzero(~finite.all(axis=1))[0])
        what, plural = ("vertex", "vertices") if source.kind == "mesh" else ("point", "points")
        raise InputError(
            f"The {what} {row} (counted from 0) is not finite: {points[row].tolist()}",
            file=path,
            advice=f"Remove {plural} with NaN or infinite coordinates and export again",
        )
    if unit_m != 1.0:
        points = points * unit_m
    reach = float(np.abs(points[np.isfinite(points).all(axis=1)]).max(initial=0.0))
    if reach >= GREATEST_M:
        raise InputError(
            f"A coordinate of {reach:g} m is beyond every survey (1e9 m)",
            file=path,
            advice="The file is damaged or in another unit: export it again, or give the length of its unit",
        )
    if up == "y" or (up == "auto" and source.up == "y"):
        points = np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1)
    return np.ascontiguousarray(points)


def _said_placement(source: Source, up: str, unit_m: float) -> list[str]:
    notes = []
    if up == "y" or (up == "auto" and source.up == "y"):
        notes.append(
            "Turned from Y up to Z up" + (", as the format's standard says." if up == "auto" else ", as asked.")
        )
    if unit_m != 1.0:
        notes.append(f"Multiplied by {unit_m:g} to metres, as asked.")
    return notes


def _box(points: Array, path: Path, count: int | None = None) -> tuple[Array, Array]:
    count = len(points) if count is None or not len(points) else count
    if count < 3:
        raise InputError(
            f"The file has {count} points, where a surface needs 3", file=path, advice="Check that it is complete"
        )
    return points.min(axis=0), points.max(axis=0)


def _shift(given: GlobalShift | None, low: Array, high: Array, crs: str, path: Path) -> GlobalShift:
    if given is None:
        return GlobalShift.proposed(low, high, crs)
    if surely_different(crs, given.crs):
        raise InputError(
            f"The file is in {crs}, the project in {given.crs}",
            file=path,
            advice="Transform one into the other's system",
        )
    return given if given.crs or not crs else GlobalShift(given.x, given.y, given.z, crs)


def _cleaned(meshed: triangulation.Meshed, kind: str) -> tuple[Array, NDArray[np.int32], list[str]]:
    vertices, faces, notes = meshed.points, meshed.faces, []
    if kind == "mesh":
        vertices, faces, merged = cleaning.merge_duplicates(vertices, faces)
        if merged:
            notes.append(f"Merged {merged:,} vertices that were stored more than once.")
    degenerate, total, (any_up, any_down) = cleaning.examine_faces(vertices, faces)
    if degenerate.any():
        faces = faces[~degenerate]
        notes.append(f"Dropped {int(degenerate.sum()):,} degenerate faces.")
    if not len(faces):
        raise InputError("All faces are degenerate: the points lie on lines", advice="Check the export")
    vertices, faces, loose = cleaning.drop_loose(vertices, faces)
    if loose:
        notes.append(f"Left out {loose:,} points that no triangle uses.")
    oriented = winding.orient(vertices, faces, bool(any_up), bool(any_down), float(total[2]))
    if oriented.flipped:
        notes.append(f"Turned {oriented.flipped:,} of {len(faces):,} faces, so that normals point out of the ground.")
    if oriented.contradictions:
        notes.append(f"At {oriented.contradictions:,} edges no winding agrees (a one-sided surface).")
    if oriented.components > 1:
        notes.append(f"The surface has {oriented.components:,} separate pieces.")
    if kind == "mesh" and abs(total[1]) > advice.MUCH_MORE * abs(total[2]) and abs(total[1]) > abs(total[0]):
        notes.append(advice.Y_UP)
    return vertices, oriented.faces, notes
