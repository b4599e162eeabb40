# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories: a reconstruction ↔ what the scene shows of it.

Of each trajectory: its picks, one polyline of its flights with colours, its block, keyed on the parabolas, and the
numbers of its impacts. What is there already is brought in line, not made anew.
"""

from collections.abc import Collection, Container, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.colours import MEASURED_COLOUR
from ....core.reconstruction.block import Block
from ....core.reconstruction.flight import flight_states
from ....core.reconstruction.trajectory import Reconstruction
from ....core.terrain.raycast import heights_above
from ....core.terrain.surface import Surface
from ....core.vectors import Array, Indices, Names, norm
from ..footage import timing
from ..storage import materials, store
from . import block_keys, impact_marks, impact_numbers, impact_rows, keyframes, picks, trails

BELOW_RADII = 0.2
"""A point of a flight that is deeper under the terrain than this part of the block's radius is shown as below it."""
BOUNCES_HIGHER = 1.0
"""An R above this deserves doubt: no impact makes a block quicker."""

SAME_TIME_S = 1e-9
"""A key of the block is that of the pick at this time; with drag there are keys between them."""

Parts = Mapping[tuple[str, str], bpy.types.Object]


@dataclass(frozen=True, eq=False)
class Rows:
    """Where a trajectory is.

    Attributes
    ----------
    flights, picks : (k,) rows in the reconstruction.
    folder : the collection of what is shown of it.
    doubt : (k,) doubt about its flights.
    like : an action that a new block copies, see `keyframes.write_location_keys`.
    """

    flights: Indices
    picks: Indices
    folder: bpy.types.Collection
    doubt: Array
    like: bpy.types.Action | None = None


def rows_of(names: Names) -> dict[str, Indices]:
    """Name → its rows in (n,) names, in the order of first appearance."""
    found: dict[str, list[int]] = {}
    for row, name in enumerate(names.tolist()):
        found.setdefault(name, []).append(row)
    return {name: np.array(rows) for name, rows in found.items()}


type Steps = Generator[tuple[str, int, int]]
"""Work on the scene that can pause, with its progress: what it does, done, total."""


def show_reconstruction(scene: bpy.types.Scene, result: Reconstruction, surface: Surface | None = None) -> Steps:
    """Bring the scene's picks, flights, blocks and impact table in line with a reconstruction.

    surface : the terrain, to tell what passes below it.

    Yields
    ------
    Its progress; to stop there leaves half of the trajectories.
    """
    settings = scene.rockfall
    timing.follow_frame_rate(scene)
    scene[store.KEYED_RATE] = timing.frame_rate(scene)
    first = not store.has_role(scene, store.FLIGHTS_ROLE)
    if first:
        _choose_sizes(settings, result)
    offsets = timing.offsets_of(scene, result.picks)
    radius_m = settings.marker_radius_m
    objects = yield from picks.show_picks(scene, result.picks, normals_of(result), offsets, radius_m)
    timing.keep_offsets(scene, offsets)
    store_results(objects, result)
    parts, flown = parts_of(scene), rows_of(result.flights.trajectory)
    picked, folders = rows_of(result.picks.trajectory), store.collections(scene, "Trajectories", flown)
    store.remove_objects([obj for (_, name), obj in parts.items() if name not in flown])
    doubt, last, like = _doubt(result, np.arange(len(result.flights.start_time_s))), 1.0, None
    for number, name in enumerate(name for name in offsets if name in flown):
        yield "Showing trajectories", number, len(flown)
        rows = Rows(flown[name], picked[name], folders[name], doubt[flown[name]], like)
        show_trajectory(scene, name, result, objects, offsets[name], surface, parts, rows=rows)
        last = max(last, float(result.flights.end_time_s[rows.flights].max()) - offsets[name])
        if len(flown) > keyframes.MANY_ACTIONS and like is None:
            block = next(obj for obj in folders[name].objects if obj.get(store.ROLE) == store.BLOCK_ROLE)
            like = keyframes.to_be_copied(block, keyframes.OF_MANY_BLOCKS)
    trails.set_tops(scene)
    trails.paint_observed(scene)
    impact_rows.fill(scene)
    scene.frame_start = 0
    end = int(np.ceil((last + 1.0) * timing.frame_rate(scene)))
    filmed = store.has_role(scene, store.CAMERA_ROLE)  # a video may go on after the last pick
    scene.frame_end = max(end, scene.frame_end) if filmed else end
    if first and not filmed:
        scene.frame_set(0)


def parts_of(scene: bpy.types.Scene, trajectories: Collection[str] | None = None) -> Parts:
    """(role, trajectory) → the object that shows its flights, or its block. A copy that somebody made is not ours.

    trajectories : None for all.
    """
    found: dict[tuple[str, str], bpy.types.Object] = {}
    with store.looking(scene):
        shown = list(_shown(scene, trajectories))
    for role, obj in shown:
        name = obj.get(store.TRAJECTORY)
        if name is None:
            continue
        other = found.setdefault((role, name), obj)
        if other != obj:
            older, newer = sorted((other, obj), key=lambda each: each.session_uid)
            found[role, name] = older
            del newer[store.ROLE]
            store.look_again()
    return found


def _shown(scene: bpy.types.Scene, trajectories: Collection[str] | None) -> Iterator[tuple[str, bpy.types.Object]]:
    names = (None,) if trajectories is None else trajectories
    for role in (store.FLIGHTS_ROLE, store.BLOCK_ROLE):
        for name in names:
            yield from ((role, obj) for obj in store.of_role(scene, role, name))


def show_trajectory(
    scene: bpy.types.Scene,
    name: str,
    result: Reconstruction,
    objects: Sequence[bpy.types.Object],
    offset: float,
    surface: Surface | None,
    parts: Parts,
    *,
    rows: Rows | None = None,
    held: bool = False,
) -> bpy.types.Object | None:
    """Bring the flights and the block of one trajectory in line; without a flight there are none.

    objects : the object of each of the reconstruction's picks.
    rows : where the trajectory is in the reconstruction and the scene; looked up without.
    held : a person holds picks or keys; keys of the block that the person holds are left alone.

    Returns
    -------
    The object of the flights, which is still to be painted.
    """
    if rows is None:
        which, mine = (np.flatnonzero(each == name) for each in (result.flights.trajectory, result.picks.trajectory))
        rows = Rows(which, mine, store.collection(scene, "Trajectories", name), _doubt(result, which))
    trail, block = (parts.get((role, name)) for role in (store.FLIGHTS_ROLE, store.BLOCK_ROLE))
    if not rows.flights.size:
        store.remove_objects([obj for obj in (trail, block) if obj is not None])
        return None
    _show_block(scene, name, result, objects, rows, offset, block, held)
    return _show_flights(scene, name, result, rows, offset, surface, trail)


def flights_of(scene: bpy.types.Scene, name: str) -> list[bpy.types.Object]:
    """What is shown of the flights of a trajectory; nothing before it has any."""
    return [obj for obj in store.with_role(scene, store.FLIGHTS_ROLE) if obj.get(store.TRAJECTORY) == name]


def _choose_sizes(settings: bpy.types.PropertyGroup, result: Reconstruction) -> None:
    """Sizes at which markers, trails and blocks are seen when the whole slope is; to be changed at will."""
    extent = float(np.ptp(result.picks.position, axis=0).max(initial=0.0))
    blocks = [result.block] if isinstance(result.block, Block) else list(result.block.values())
    radius = float(np.mean([block.radius_m for block in blocks]))
    settings.marker_radius_m = max(radius, 0.006 * extent)
    settings.trail_radius_m = 0.2 * radius  # the 3-D view draws lines of constant width besides
    settings.block_scale = 1.0  # and a ring about small blocks


def _block_of(result: Reconstruction, name: str) -> Block:
    return result.block if isinstance(result.block, Block) else result.block[name]


def _show_flights(
    scene: bpy.types.Scene,
    name: str,
    result: Reconstruction,
    rows: Rows,
    offset: float,
    surface: Surface | None,
    obj: bpy.types.Object | None,
) -> bpy.types.Object:
    flights, which, rate = result.flights, rows.flights, timing.frame_rate(scene)
    step_s = trails.COARSE_STEP_S if trails.are_many(flights) else trails.SAMPLE_STEP_S
    sampled = [
        trails.moments_with_ticks(float(flights.start_time_s[i]), float(flights.end_time_s[i]), offset, rate, step_s)
        for i in which
    ]
    counts = np.array([len(clock) for clock, _ in sampled])
    clock = np.concatenate([clock for clock, _ in sampled])
    position, velocity = flight_states(flights, np.repeat(which, counts), clock)
    lines = trails.Lines(counts, clock - offset, position, norm(velocity))
    marks = trails.Marks(
        below=_below(result, name, position, surface),
        doubt=np.repeat(rows.doubt, counts),
        tick=np.concatenate([tick for _, tick in sampled]),
    )
    new = obj is None
    bare = new or "Trail" not in obj.modifiers or obj.modifiers["Trail"].node_group is None
    obj = trails.trail(f"{name} flights", store.FLIGHTS_ROLE, lines, marks, obj)
    obj[store.TRAJECTORY] = name
    solid = _block_of(result, name)
    obj[store.MASS], obj[store.BLOCK_SHOWN] = solid.mass_kg, repr(solid)
    ends = np.vstack([flights.start_velocity[which], flights.end_velocity[which]])
    obj[store.TOP_SPEED] = float(norm(ends).max(initial=0.0))
    obj.pop(store.STALE, None)
    if new:
        store.link(rows.folder, obj)
    if bare:
        trails.set_trail(scene.rockfall, obj)
        if trails.are_many(flights):  # the lines of the view are enough
            obj.modifiers["Trail"].show_viewport = False
    return obj


def _below(result: Reconstruction, name: str, position: Array, surface: Surface | None) -> Array:
    """(n,) whether points of a trajectory's flights are below the terrain."""
    if surface is None:
        return np.zeros(len(position), dtype=bool)
    radius = _block_of(result, name).radius_m
    underside = radius if result.ends == "centres" else 0.0
    with np.errstate(invalid="ignore"):
        return heights_above(surface, position) - underside < -BELOW_RADII * radius


def _doubt(result: Reconstruction, which: np.ndarray) -> Array:
    """(k,) doubt about flights, 0…1: the relative standard deviation of their speed, and 1 for what is flagged."""
    flights, impacts = result.flights, result.impacts
    lands = np.flatnonzero(result.picks.kind == "impact")
    leaves = result.picks.leaves_at[lands]
    doubt = np.zeros(which.size)
    for ends, at, velocity, name in (
        (flights.first_pick, leaves, impacts.v2, "v2"), (flights.last_pick, lands, impacts.v1, "v1"),
    ):  # fmt: skip
        row_of = np.full(len(result.picks), -1)
        row_of[at] = np.arange(len(impacts))
        row = row_of[ends[which]]
        known = row >= 0
        if name in impacts.sigma:
            relative = impact_numbers.speed_sigma(velocity, impacts.sigma[name]) / norm(velocity)
            doubt[known] = np.fmax(doubt[known], relative[row[known]] / trails.DOUBTFUL_SIGMA)
        flagged = impacts.flags["doubtful"].copy()
        if name == "v2":
            flagged |= impacts.flags["into_ground"] | (impacts.r > BOUNCES_HIGHER)
        else:
            flagged |= impacts.flags["departing"]
        doubt[known] = np.where(flagged[row[known]], 1.0, doubt[known])
    radius = np.array([_block_of(result, str(flights.trajectory[i])).radius_m for i in which])
    return np.clip(np.where(result.clearance.below_terrain_m[which] > radius, 1.0, doubt), 0.0, 1.0)


def _show_block(
    scene: bpy.types.Scene,
    name: str,
    result: Reconstruction,
    objects: Sequence[bpy.types.Object],
    rows: Rows,
    offset: float,
    block: bpy.types.Object | None,
    held: bool,
) -> None:
    solid, scale = _block_of(result, name), scene.rockfall.block_scale
    if block is None:
        block = bpy.data.objects.new(f"{name} block", block_mesh())
        block[store.ROLE], block[store.TRAJECTORY] = store.BLOCK_ROLE, name
        store.link(rows.folder, block)
        held = False  # nobody holds keys that there are not yet
    block.scale = np.array([solid.d1, solid.d2, solid.d3]) * scale / 2
    block.delta_location.z = (scale - 1) * solid.radius_m  # an enlarged block must not sink into the slope
    if held and block_keys.edits_of(block):
        return
    keys, mine = keyframes.motion_keys(result.flights, rows.flights), rows.picks
    away = np.abs(keys.time_s[:, None] - result.picks.time_s[mine])
    of = [objects[mine[i]] if gap < SAME_TIME_S else None for i, gap in zip(away.argmin(1), away.min(1), strict=True)]
    keys.time_s[:] -= offset
    if keyframes.write_location_keys(block, keys, timing.keyed_rate(scene), in_place=held, like=rows.like):
        block_keys.remember(block, of)
        if not held:
            keyframes.action_of(block)[store.WRITTEN] = max(int(objects[i].get(store.WRITTEN, 0)) for i in mine)


def normals_of(result: Reconstruction) -> np.ndarray:
    """(n, 3) normals of the picks, those of the impacts as they were fitted to the terrain."""
    normals = result.picks.normal.copy()
    normals[result.picks.kind == "impact"] = result.impacts.normal
    return normals


def store_results(
    objects: Sequence[bpy.types.Object], result: Reconstruction, but: Container[bpy.types.Object] = ()
) -> None:
    """Write each impact's numbers into its object, where panels and exports find them.

    objects : the object of each of the reconstruction's picks.
    but : objects that are left alone: another scene writes them.
    """
    rows, flags = impact_numbers.table(result.impacts), result.impacts.flag_text()
    impact_marks.results_written(set(result.picks.trajectory.tolist()))
    i = 0
    for obj, kind in zip(objects, result.picks.kind.tolist(), strict=True):
        if obj not in but:
            if kind == "impact":
                obj[store.RESULT], obj[store.FLAGS] = rows[i], flags[i]
            else:
                obj.pop(store.RESULT, None)
                obj.pop(store.FLAGS, None)
        i += kind == "impact"


def block_mesh(name: str = "Rockfall block", colour: tuple[float, float, float] = MEASURED_COLOUR) -> bpy.types.Mesh:
    """An angular block of radius 1 (convex hull of seeded directions), shared by all blocks of one colour.

    One from a file of an earlier version may have another colour: it gets this one.
    """
    existing = bpy.data.meshes.get((name, None))
    if existing is not None:
        _colour_block(existing, colour)
        return existing
    import bmesh

    random = np.random.default_rng(7)
    directions = random.normal(size=(28, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    corners = directions * random.uniform(0.88, 1.0, (28, 1))
    shape = bmesh.new()
    for corner in corners:
        shape.verts.new(corner)
    bmesh.ops.convex_hull(shape, input=shape.verts)
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    mesh.attributes.new("colour", "FLOAT_COLOR", "POINT")
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = "colour"
    _colour_block(mesh, colour)
    mesh.materials.append(materials.shaded_material("Rockfall block", "colour"))
    return mesh


def _colour_block(mesh: bpy.types.Mesh, colour: tuple[float, float, float]) -> None:
    colours = mesh.attributes["colour"].data
    wanted = np.tile(materials.linear_colour(colour), len(colours)).astype(np.float32)
    there = np.empty_like(wanted)
    colours.foreach_get("color", there)
    if not np.array_equal(there, wanted):
        colours.foreach_set("color", wanted)
