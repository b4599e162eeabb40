# SPDX-License-Identifier: GPL-3.0-or-later
"""Any terrain file → what it holds, in local coordinates with z up; several clouds → one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..georeference import GlobalShift, z_up
from ..plausibility import GREATEST_M
from ..progress import Progress, silent
from ..reading import reader
from ..vectors import Array, Mask
from . import advice, clouds, e57, geotiff, gltf, grids, meshes, ply, point_tables, ptx
from .coordinate_step import coarse_sentence, spacing_in_box, spacing_of, stored_step
from .crs import CoordinateSystem, metric_name, named_system, surely_different, unit_words
from .ground_filter import filter_ground
from .scan_colours import joined_colours
from .source import Source, check_finite

READERS: dict[str, Callable[[Path], Source]] = {
    ".ply": ply.read_ply,
    ".obj": meshes.read_obj,
    ".stl": meshes.read_stl,
    ".gltf": gltf.read_gltf,
    ".glb": gltf.read_gltf,
    ".asc": grids.read_ascii_grid,
    ".tif": geotiff.read_geotiff,
    ".tiff": geotiff.read_geotiff,
    ".xyz": point_tables.read_xyz,
    ".txt": point_tables.read_xyz,
    ".csv": point_tables.read_xyz,
    ".ptx": ptx.read_ptx,
    ".e57": e57.read_e57,
}
LAS_EXTENSIONS = (".las", ".laz")
EXTENSIONS = (*READERS, *LAS_EXTENSIONS)
UP_AXES = ("auto", "z", "y")


@dataclass(frozen=True)
class HowToRead:
    """What a user says of a file.

    Attributes
    ----------
    up : axis that points up in the file: "z", "y", or "auto" (y in glTF, as its standard says, else z).
    unit_m : length of the file's unit [m], 0.001 for millimetres; None: as the file's coordinate system says, else a
        metre.
    ground_only : use the ground class of LAS and LAZ: None if there is one, True always, False never.
    ground_filter_m : cell of a filter that takes vegetation out of a cloud, whatever its classes say [m]; none when
        None. See `filter_ground`.
    crs, vertical : coordinate system, and that of the heights, where the file does not state them; their units count.
    height_unit_m : length of the unit of the heights where it is another one; None: as `unit_m`, or as the file says.
    """

    up: str = "auto"
    unit_m: float | None = None
    ground_only: bool | None = None
    ground_filter_m: float | None = None
    crs: str = ""
    vertical: str = ""
    height_unit_m: float | None = None


AS_IT_IS = HowToRead()
"""Nothing is said of the file."""


@dataclass(frozen=True, eq=False)
class Opened:
    """What is in a file, or in several clouds, in local coordinates; and what there is to say of it.

    Attributes
    ----------
    name : of the file, for people.
    source : its contents; of a grid without data NaN heights.
    shift : from local to survey coordinates.
    notes : sentences on what was done.
    advice : sentences that come after those on the meshing.
    left_out : (k, 3) points that the ground filter left out.
    """

    name: str
    source: Source
    shift: GlobalShift
    notes: tuple[str, ...]
    advice: tuple[str, ...]
    left_out: Array


def open_terrain_file(path: Path, how: HowToRead, shift: GlobalShift | None, progress: Progress = silent) -> Opened:
    """Read a file and put it into local coordinates; a shift is proposed from the data when None.

    Raises
    ------
    InputError : anything wrong with the file, with what to do about it.
    """
    return _localised(read_placed(path, how), path, path.name, how, shift, progress)


def open_terrain_files(
    paths: Sequence[Path], how: HowToRead, shift: GlobalShift | None, progress: Progress = silent
) -> tuple[Opened, ...]:
    """The same of several files, in one shift; all clouds among them become one, as if they had been one file.

    So the ground filter and the meshing reach across the borders of tiles, where no gap is left.

    Raises
    ------
    InputError : anything wrong with a file; the files are in different systems.
    """
    sources = [_read_one(path, how) for path in paths]
    cloudy = [i for i, source in enumerate(sources) if source.kind == "cloud"]
    parts = [(paths[i], paths[i].name, sources[i]) for i in range(len(paths)) if len(cloudy) < 2 or i not in cloudy]
    if len(cloudy) > 1:
        parts.insert(0, _one_cloud([paths[i] for i in cloudy], [sources[i] for i in cloudy]))
    del sources
    opened: list[Opened] = []
    while parts:
        path, name, source = parts.pop(0)
        opened.append(_localised(source, path, name, how, opened[0].shift if opened else shift, progress))
    return tuple(opened)


@reader("terrain")
def _read_one(path: Path, how: HowToRead) -> Source:
    return read_placed(path, how)


def _one_cloud(paths: Sequence[Path], sources: Sequence[Source]) -> tuple[Path, str, Source]:
    system = sources[0].system
    for path, source in zip(paths, sources, strict=True):
        if surely_different(source.crs, system.name):
            raise _two_systems(source.crs, f"the files before it in {system.name}", path)
        system = system.filled(source.system)
    notes = [f"{path.name}: {note}" for path, source in zip(paths, sources, strict=True) for note in source.notes]
    notes.append(f"The {len(paths)} clouds are read as one.")
    points = np.concatenate([source.points for source in sources])
    colours, said = joined_colours([(source.colours, path.name) for path, source in zip(paths, sources, strict=True)])
    notes += [said] if said else []
    turned = any(source.turned for source in sources)
    name = ", ".join(path.name for path in paths)
    return (
        paths[0],
        name,
        Source(
            points,
            system=system,
            turned=turned,
            notes=tuple(notes),
            colours=colours,
        ),
    )


def _localised(
    source: Source, path: Path, name: str, how: HowToRead, shift: GlobalShift | None, progress: Progress
) -> Opened:
    """A placed source in local coordinates; errors name the path."""
    points, notes, colours = source.points, list(source.notes), source.colours
    left_out = points[:0]
    if how.ground_filter_m is not None:
        ground, filtered = _ground(source, points, how.ground_filter_m, path, progress)
        points, left_out = points[ground], points[~ground]
        colours = None if colours is None else colours[ground]
        notes += filtered
    heights = np.isfinite(points[:, 2]) if source.kind == "grid" else slice(None)
    low, high = box_of(points[heights], path)
    advice.refuse_impossible(source, low, high, how.unit_m, path)
    for theirs, stated in ((source.crs, how.crs), (source.vertical, how.vertical)):
        if surely_different(theirs, stated):
            raise _two_systems(theirs, f"and {stated} is stated", path)
    shift = _shift(shift, low, high, metric_name(how.crs) or source.crs, path)
    vertical = named_system("", how.vertical).metric().vertical or source.vertical
    if vertical and not shift.vertical:
        shift = replace(shift, vertical=vertical)
    said = [*advice.sentences(low, high, shift), *advice.of_heights(points)]
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
    source = replace(source, points=points - shift.vector, colours=colours)
    return Opened(name, source, shift, tuple(notes), tuple(said), left_out)


def _ground(
    source: Source, points: Array, cell_m: float, path: Path, progress: Progress
) -> tuple[Mask, tuple[str, ...]]:
    """Which points are on the ground, and what to say of it."""
    if source.kind != "cloud":
        raise InputError(
            f"This is a {source.kind}, and the ground filter works on clouds", file=path, advice="Read it without"
        )
    try:
        found = filter_ground(points, cell_m, progress=progress)
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error
    return found.ground, found.notes


def check_path(path: Path) -> None:
    """Refuse what is no file of a known format.

    Raises
    ------
    InputError : a folder, no such file, an extension that is no terrain format.
    """
    if path.is_dir():
        raise InputError("This is a folder", file=path, advice="Choose a terrain file in it")
    if not path.is_file():
        raise InputError("There is no such file", file=path, advice="Check the path")
    if path.suffix.lower() not in EXTENSIONS:
        raise InputError(
            f'"{path.suffix}" is no terrain format', file=path, advice=f"Supported are {', '.join(EXTENSIONS)}"
        )


def read_placed(path: Path, how: HowToRead) -> Source:
    """Read a file; its points in metres with z up, and finite, in survey coordinates.

    Raises
    ------
    InputError : anything wrong with the file, with what to do about it.
    """
    check_path(path)
    extension, ground_only = path.suffix.lower(), how.ground_only if how.ground_filter_m is None else False
    if extension in LAS_EXTENSIONS:
        return placed(clouds.read_las(path, ground_only), how, path)
    if ground_only:
        raise InputError("Only LAS and LAZ files have a ground class", file=path, advice="Read it without ground_only")
    return placed(READERS[extension](path), how, path)


def placed(source: Source, how: HowToRead, path: Path) -> Source:
    """The contents of a file in metres with z up, checked to be finite, and what to say of that.

    Raises
    ------
    InputError : an axis or a unit that there is not, a coordinate that cannot be.
    """
    up = how.up
    if up not in UP_AXES:
        raise InputError(f'The up axis "{up}" is unknown', file=path, advice=f"Choose one of {', '.join(UP_AXES)}")
    for unit in (how.unit_m, how.height_unit_m):
        if unit is not None and not (np.isfinite(unit) and unit > 0):
            raise InputError(f"The unit of {unit} m is no length", file=path, advice="Give 0.001 for millimetres")
    y_up = up == "y" or (up == "auto" and source.up == "y")
    system = source.system.filled(named_system(how.crs, how.vertical))
    flat, height, said = units(system, how)
    stated = units(system, replace(how, unit_m=None, height_unit_m=None))[:2]
    points = source.points
    if source.kind == "grid" and np.isinf(points[:, 2]).any():
        points = np.column_stack([points[:, :2], np.where(np.isinf(points[:, 2]), np.nan, points[:, 2])])
    check_finite(points, source.kind, path)
    lengths = np.array([flat, height, flat] if y_up else [flat, flat, height])
    if (flat, height) != (1.0, 1.0):
        points = points * lengths
    reach = float(np.abs(points[np.isfinite(points).all(axis=1)]).max(initial=0.0))
    if reach >= GREATEST_M:
        raise InputError(
            f"A coordinate of {reach:g} m is beyond every survey (1e9 m)",
            file=path,
            advice="The file is damaged or in another unit: export it again, or give the length of its unit",
        )
    notes, turned = list(source.notes), False
    steps = stored_step(source.points, source.step, source.kind) * lengths
    if source.faces is not None:
        notes.append(f"Mesh of {len(points) + source.merged:,} vertices and {len(source.faces):,} faces.")
    if y_up:
        points, turned, steps = z_up(points), True, steps[[0, 2, 1]]
        notes.append(
            "Turned from Y up to Z up" + (", as the format's standard says." if up == "auto" else ", as asked.")
        )
    there = points[np.isfinite(points[:, 2])] if source.kind == "grid" else points
    coarse = coarse_sentence(steps, spacing_in_box(there, source.count) if source.count else spacing_of(there))
    return replace(
        source,
        points=np.ascontiguousarray(points),
        system=system.metric(),
        up="z",
        turned=turned,
        notes=(*notes, *said, *([coarse] if coarse else [])),
        units_m=(flat, height),
        stated_units_m=stated,
    )


def units(system: CoordinateSystem, how: HowToRead) -> tuple[float, float, tuple[str, ...]]:
    """Length of the unit of x and y, and of that of the heights [m], as asked, as the file says, else a metre; and
    sentences on them.
    """
    if how.unit_m is not None:
        flat, height = how.unit_m, how.unit_m if how.height_unit_m is None else how.height_unit_m
        said = []
        if (flat, height) != (1.0, 1.0):
            both = f"{flat:g}" if flat == height else f"{flat:g}, heights by {height:g},"
            said.append(f"Multiplied by {both} to metres, as asked.")
        if system.unit_m not in (None, flat):
            said.append(f"The file's system is in {unit_words(system.unit_m or 1.0)}: what was asked goes before it.")
        return flat, height, tuple(said)
    flat = 1.0 if system.unit_m is None else system.unit_m
    says = f", as {system.name} says" if system.name else ", as the file says"
    said = [f"Coordinates are in {unit_words(flat)}{says}: multiplied by {flat:.10g} to metres."] if flat != 1.0 else []
    if how.height_unit_m is not None:
        height, says = how.height_unit_m, ", as asked"
    elif system.height_unit_m is not None:
        height, says = system.height_unit_m, f", as {system.vertical or 'the file'} says"
    elif flat != 1.0:
        said.append(
            f"Nothing says the unit of its heights: they are taken in {unit_words(flat)}, too. Give their unit if they "
            "are in another one (--height-unit m)."
        )
        return flat, flat, tuple(said)
    else:
        height = 1.0
    if (flat, height) != (1.0, 1.0):
        multiplied = "" if height == 1.0 else f": multiplied by {height:.10g} to metres"
        said.append(f"Heights are in {unit_words(height)}{says}{multiplied}.")
    return flat, height, tuple(said)


def box_of(points: Array, path: Path, count: int | None = None) -> tuple[Array, Array]:
    """Lowest and highest coordinates, (3,) each.

    Raises
    ------
    InputError : fewer points than a surface needs.
    """
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
        raise _two_systems(crs, f"the project in {given.crs}", path)
    return replace(given, crs=metric_name(given.crs) or crs)


def _two_systems(crs: str, other: str, path: Path) -> InputError:
    return InputError(f"The file is in {crs}, {other}", file=path, advice="Transform one into the other's system")
