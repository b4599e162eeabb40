# SPDX-License-Identifier: GPL-3.0-or-later
"""Where blocks come from: points, lines, areas, everything that is steep. Each gives blocks that touch the terrain.

A block lies against the face that it comes from, along that face's normal: on a wall beside it, under an overhang below
it. Where the ground is too narrow for it, it is moved on until it touches and is nowhere in the ground. Places, sizes
and densities are functions of the seed and of the run alone: one more block changes no other.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..reconstruction.placement import FAR_M
from ..remarks import Remark
from ..terrain.cloud import Cloud, local_planes
from ..terrain.misplaced import unit_hint
from ..terrain.raycast import cast_rays, closest_points
from ..terrain.surface import face_cross_products
from ..vectors import Array, Indices, Mask, Names, norm, unit
from .blocks import Blocks, draw_blocks
from .coverage import check_areas, check_lines, parts_on
from .ground import Ground
from .memory import check_blocks
from .polygons import Polygon
from .release import Releases, make_releases, placed_on, standing_on, stated_places

ATTEMPTS = 64
"""So many places are drawn for a block before it is taken as too large for all."""


def on_points(
    ground: Ground,
    points: Array,
    blocks: Blocks,
    number: int = 1,
    seed: int = 0,
    names: Names | None = None,
) -> Releases:
    """Blocks at points (k, 3) of the terrain, local [m], `number` at each.

    Raises
    ------
    InputError : a point beside the terrain, or further from it than `FAR_M`; a block that is too large for its place.

    Notes
    -----
    A point is put on the nearest terrain; without z (NaN) it is the highest terrain there, and a block that is wider
    than a slot lies over it. On a terrain of points, blocks are put down from above.
    """
    check_number(number, len(points))
    which = np.repeat(np.arange(len(points)), number)
    name = np.full(len(points), "") if names is None else names
    return replace(_fixed(ground, points[which], name[which], blocks, seed), place=stated_places(points)[which])


def on_line(
    ground: Ground,
    lines: Sequence[Array],
    blocks: Blocks,
    number: int,
    seed: int = 0,
    *,
    evenly: bool = False,
    names: Sequence[str] = (),
) -> Releases:
    """`number` blocks along lines, each (k, 3) local [m].

    Parameters
    ----------
    evenly : each in the middle of its part of the whole length; else anywhere, all places alike.
    names : of the lines, for the releases.

    Raises
    ------
    InputError : a line of one point, or without length, wholly outside of the terrain or far from it; see `on_points`.

    Notes
    -----
    Blocks start where there is terrain below the line; a part outside of it has none, which is said.
    Lengths are those of the line as it is drawn, in plan where it has no heights (NaN).
    """
    check_number(number)
    names = names or [""] * len(lines)
    parts: list[Array] = []
    owner = list[int]()
    for i, line in enumerate(lines):
        what = f"The line {names[i]}" if names[i] else "The line"
        if not np.isfinite(line[:, :2]).all():
            raise InputError(f"{what} has a coordinate that is not finite", advice="Correct it")
        if len(line) < 2 or not np.nan_to_num(np.ptp(line, axis=0)).any():
            raise InputError(f"{what} has no length", advice="Give at least two different points")
    if not lines:
        raise InputError("There is no line to release blocks from", advice="Give at least one")
    outside = check_lines(ground.terrain, lines, names, "line of releases", "no block starts there")
    for i, line in enumerate(lines):
        on = parts_on(ground.terrain, line) if outside else [line]
        parts += on
        owner += [i] * sum(len(part) - 1 for part in on)
    start, end = np.concatenate([part[:-1] for part in parts]), np.concatenate([part[1:] for part in parts])
    way = end - start
    cumulated = np.cumsum(norm(np.where(np.isnan(way), 0.0, way)))
    part = (np.arange(number) + 0.5) / number if evenly else _uniform(seed, number, 1, 0)[:, 0]
    at, within = _chosen(cumulated, part)
    points = start[at] + within[:, None] * way[at]
    named = np.array(names, dtype=np.str_)[np.array(owner)[at]]
    return _fixed(ground, points, named, blocks, seed).with_remarks(*outside)


def in_polygon(
    ground: Ground,
    polygons: Sequence[Polygon],
    blocks: Blocks,
    number: int,
    seed: int = 0,
    *,
    steeper_than: float | None = None,
) -> Releases:
    """`number` blocks on the terrain within polygons in plan, as many on each square metre of the terrain itself.

    Parameters
    ----------
    steeper_than : only on faces that dip more than this [rad].

    Raises
    ------
    InputError : a polygon wholly outside of the terrain; no terrain within, or none so steep; a block that is
        too large for all places; an impossible angle.
    """
    check_number(number)
    outside = check_areas(ground.terrain, polygons, "release area", "no block starts there")
    pieces, areas, normals, which = _pieces(ground, polygons)
    if steeper_than is not None:
        steep = _steeper(normals, steeper_than)
        pieces, areas, normals, which = pieces[steep], areas[steep], normals[steep], which[steep]
    if not len(pieces):
        steep_too = "" if steeper_than is None else f" that is steeper than {np.degrees(steeper_than):g}°"
        raise InputError(
            f"There is no terrain within the polygon{steep_too}",
            advice=unit_hint(np.concatenate([ring for one in polygons for ring in one.rings]), ground.terrain)
            or ("Check its coordinates" if steeper_than is None else "Give a smaller angle, or another polygon"),
        )
    name = np.array([polygon.name for polygon in polygons], dtype=np.str_)[which]
    return _anywhere(ground, pieces, areas, normals, name, blocks, number, seed).with_remarks(*outside)


def steeper_than(ground: Ground, angle: float, blocks: Blocks, number: int, seed: int = 0) -> Releases:
    """`number` blocks on all terrain that dips more than an angle [rad], as many on each square metre of it.

    Raises
    ------
    InputError : nothing is so steep; an impossible angle; a block that is too large for all places.

    Notes
    -----
    90° is a vertical wall, more is an overhang; a cloud of points has none, see `local_planes`.
    """
    check_number(number)
    pieces, areas, normals, _ = _pieces(ground)
    steep = _steeper(normals, angle)
    if not steep.any():
        raise InputError(
            f"No terrain is steeper than {np.degrees(angle):g}°",
            advice=f"Give a smaller angle; the steepest is {np.degrees(np.arccos(normals[:, 2].min())):.1f}°",
        )
    name = np.full(int(steep.sum()), "")
    return _anywhere(ground, pieces[steep], areas[steep], normals[steep], name, blocks, number, seed)


def check_number(number: int, places: int = 1) -> None:
    """Raises `InputError` for no blocks, and for more than fit into the memory."""
    if number < 1:
        raise InputError(f"{number} blocks cannot be released", advice="Release at least one")
    check_blocks(number * places)


def check_size(ground: Ground, diameter_m: Array) -> None:
    """Raises `InputError` for a block that is larger than the terrain is wide."""
    low, high = ground.terrain.bounds
    size, largest = float((high - low)[:2].max()), float(diameter_m.max())
    if largest > size:
        raise InputError(
            f"A block of {largest:g} m is larger than the terrain, which is {size:.3g} m wide",
            advice="Check the unit of the diameter and of the terrain",
        )


def _steeper(normals: Array, angle: float) -> Mask:
    if not (np.isfinite(angle) and 0 <= angle < np.pi):
        raise InputError(
            f"{np.degrees(angle):g}° is no angle of a slope", advice="Give one from 0 to 180: 90 is vertical"
        )
    steep: Mask = normals[:, 2] < np.cos(angle)
    return steep


def _pieces(ground: Ground, polygons: Sequence[Polygon] | None = None) -> tuple[Array, Array, Array, Indices]:
    """The terrain, or what is of it within polygons.

    Returns
    -------
    pieces : (p, 3, 3) corners of triangles, or (p, 1, 3) points. areas : (p,) [m²]. normals : (p, 3).
    which : (p,) polygon.
    """
    terrain = ground.terrain
    if isinstance(terrain, Cloud):
        places = [terrain.points] if polygons is None else []
        for polygon in polygons or ():
            places.append(terrain.points[polygon.contains(terrain.points[:, :2])])
        points = np.concatenate(places) if places else np.empty((0, 3))
        which = np.repeat(np.arange(len(places)), [len(part) for part in places])
        normals, areas = local_planes(terrain, points)
        good = np.isfinite(areas)
        if len(points) and not good.any():
            raise InputError("The points are too few to know how steep the terrain is", advice="Give a denser cloud")
        return points[good, None], areas[good], normals[good], which[good]
    normals = terrain.face_normals
    good = np.isfinite(normals[:, 0])
    corners, normals = terrain.vertices[terrain.faces[good]], normals[good]
    which, sources = np.zeros(len(corners), np.intp), np.arange(len(corners))
    if polygons is not None:
        parts = [polygon.clipped(corners) for polygon in polygons]
        which = np.repeat(np.arange(len(parts)), [len(part) for part, _ in parts])
        sources = np.concatenate([sources[:0], *(source for _, source in parts)])
        corners = np.concatenate([corners[:0], *(part for part, _ in parts)])
    apart = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    areas = 0.5 * norm(face_cross_products(corners.reshape(-1, 3), apart))
    return corners, areas, normals[sources], which


def _on_terrain(ground: Ground, points: Array) -> tuple[Array, Indices]:
    """Places (n, 3) on the terrain, and the faces (n,) that they are on."""
    terrain = ground.surface
    given = np.isfinite(points[:, 2])
    place, face = np.empty(points.shape), np.empty(len(points), np.intp)
    if given.any():
        nearest = closest_points(terrain, points[given])
        place[given], face[given] = nearest.point, nearest.face
        far = np.zeros(len(points))
        far[given] = nearest.distance
        for i in np.flatnonzero(far > FAR_M)[:1].tolist():
            raise InputError(
                f"{_place_text(ground, points[i])} is {far[i]:.1f} m from the terrain",
                advice=unit_hint(points, terrain)
                or "Correct its coordinates, or leave out the height to take the terrain's",
            )
    if not given.all():
        above = np.column_stack([points[~given, :2], np.full(int((~given).sum()), terrain.bounds[1, 2] + 1.0)])
        hits = cast_rays(terrain, above, (0.0, 0.0, -1.0))
        place[~given], face[~given] = hits.point, hits.face
        for i in np.flatnonzero(np.isnan(place[:, 2]))[:1].tolist():
            raise _no_terrain(ground, points[i])
    return place, face


def _no_terrain(ground: Ground, point: Array) -> InputError:
    return InputError(
        f"There is no terrain at {_place_text(ground, point)}",
        advice=unit_hint(point[None], ground.terrain)
        or "Correct the coordinates, or give a terrain that reaches so far",
    )


def _place_text(ground: Ground, point: Array) -> str:
    x, y, z = ground.shift.to_survey(point)
    return f"{x:.2f}, {y:.2f}" + ("" if np.isnan(z) else f", {z:.2f}")


def _uniform(seed: int, number: int, columns: int, attempt: int) -> Array:
    """(n, columns) uniform numbers of the places of runs."""
    from .chance_kernels import PLACE, fill_runs

    u = np.empty((number, columns))
    fill_runs(seed, np.arange(len(u)), PLACE + attempt, u)
    return u


def _chosen(cumulated: Array, part: Array) -> tuple[Indices, Array]:
    """Which piece a part 0…1 of all lengths or areas is in, and how far into it, 0…1."""
    value = part * cumulated[-1]
    at = np.minimum(np.searchsorted(cumulated, value, side="right"), len(cumulated) - 1)
    size = np.diff(cumulated, prepend=0.0)[at]
    return at, 1.0 - (cumulated[at] - value) / np.where(size > 0, size, 1.0)


def _anywhere(
    ground: Ground,
    pieces: Array,
    areas: Array,
    normals: Array,
    name: Names,
    blocks: Blocks,
    number: int,
    seed: int,
) -> Releases:
    """Blocks on pieces of the terrain, all areas alike; a place that is too narrow for its block is drawn again."""
    axes, density = draw_blocks(blocks, number, seed)
    diameter = axes.mean(axis=1)
    check_size(ground, diameter)
    cumulated = np.cumsum(areas)
    centre, chosen = np.empty((number, 3)), np.empty(number, np.intp)
    left = np.arange(number)
    drawn_again = 0
    for attempt in range(ATTEMPTS):
        u = _uniform(seed, number, 3, attempt)[left]
        at, _ = _chosen(cumulated, u[:, 0])
        root = np.sqrt(u[:, 1])
        weights = np.column_stack([1 - root, root * (1 - u[:, 2]), root * u[:, 2]])
        points = np.einsum("ij,ijk->ik", weights, pieces[at]) if pieces.shape[1] == 3 else pieces[at, 0]
        centre[left], fits = standing_on(ground, points, normals[at], diameter[left])
        chosen[left] = at
        left = left[~fits]
        if not left.size:
            break
        drawn_again += left.size
    if left.size:
        raise InputError(
            f"A block of {diameter[left].max():.3g} m finds no place that is wide enough for it",
            advice="Give smaller blocks, or a larger area",
        )
    remarks: tuple[Remark, ...] = ()
    if drawn_again:
        text = f"{drawn_again} places were too narrow for their block and were drawn again."
        remarks = (Remark(text, "note", "releases"),)
    return _made(centre, name[chosen], blocks, axes, density, remarks)


def _fixed(ground: Ground, points: Array, name: Names, blocks: Blocks, seed: int) -> Releases:
    """Blocks at places that are given."""
    axes, density = draw_blocks(blocks, len(points), seed)
    diameter = axes.mean(axis=1)
    check_size(ground, diameter)
    if isinstance(ground.terrain, Cloud):
        centre = placed_on(ground, points[:, :2], diameter)
        for i in np.flatnonzero(np.isnan(centre[:, 2]))[:1].tolist():
            raise _no_terrain(ground, points[i])
        return _made(centre, name, blocks, axes, density, ())
    terrain = ground.surface
    place, face = _on_terrain(ground, points)
    centre, fits = standing_on(ground, place, terrain.face_normals[face], diameter)
    if not fits.all():  # in a corner, where the normal of one face is in the other
        rounded = unit(terrain.vertex_normals[terrain.faces[face[~fits]]].sum(axis=1))
        centre[~fits], fits[~fits] = standing_on(ground, place[~fits], rounded, diameter[~fits])
    bridged = np.flatnonzero(~fits & np.isnan(points[:, 2]))
    if bridged.size:  # a slot that is narrower than the block, which lies over it
        centre[bridged] = placed_on(ground, place[bridged, :2], diameter[bridged])
        fits[bridged] = True
    for i in np.flatnonzero(~fits)[:1].tolist():
        raise InputError(
            f"A block of {diameter[i]:.3g} m is too large for the ground at {_place_text(ground, place[i])}",
            advice="Give smaller blocks, or another place",
        )
    return _made(centre, name, blocks, axes, density, ())


def _made(
    centre: Array, name: Names, blocks: Blocks, axes: Array, density: Array, remarks: tuple[Remark, ...]
) -> Releases:
    made = make_releases(centre, name=name, shape=blocks.shape, axes_m=axes, density_kgpm3=density)
    return made.with_remarks(*remarks)
