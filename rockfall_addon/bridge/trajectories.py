# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories: a reconstruction ↔ what the scene shows of it.

Of each trajectory: its picks, one polyline of its flights coloured by speed, and its block, keyed on the parabolas.
"""

import bpy
import numpy as np

from ...core.colours import OBSERVED_COLOUR, rounded_top
from ...core.reconstruction.block import Block
from ...core.reconstruction.flight import Flights, flight_states
from ...core.reconstruction.trajectory import Reconstruction
from . import materials, motion, picks, state, timing, trails

RESULT_KEY = "rockfall_result"


def show_reconstruction(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Bring the scene's picks, flights and blocks in line with a reconstruction."""
    settings = scene.rockfall
    first = not state.with_role(scene, state.FLIGHTS_ROLE)
    if first:
        _choose_sizes(settings, result)
    offsets = timing.display_offsets(result.picks, settings.playback == "REAL", settings.stagger_s)
    scene[state.KEYED_RATE_KEY] = timing.frame_rate(scene)
    picks.show_picks(scene, result.picks, _normals(result), offsets, settings.marker_radius_m)
    _store_results(scene, result)
    state.remove_objects(state.with_role(scene, state.FLIGHTS_ROLE) + state.with_role(scene, state.BLOCK_ROLE))
    speeds = np.linalg.norm(np.vstack([result.flights.start_velocity, result.flights.end_velocity]), axis=1)
    settings.speed_top_mps = rounded_top(float(speeds.max(initial=0.0)))
    last = 1.0
    for name, offset in offsets.items():
        which = np.flatnonzero(result.flights.trajectory == name)
        if len(which):
            _show_flights(scene, name, result.flights, which, offset)
            _show_block(scene, name, result, which, offset)
            last = max(last, float(result.flights.end_time_s[which].max()) - offset)
    trails.paint_observed(scene)
    trails.set_trails(scene)
    scene.frame_start = 0
    scene.frame_end = int(np.ceil((last + 1.0) * timing.frame_rate(scene)))
    if first:
        scene.frame_set(0)


def _choose_sizes(settings: bpy.types.PropertyGroup, result: Reconstruction) -> None:
    """Sizes at which markers, trails and blocks are seen when the whole slope is; to be changed at will."""
    extent = float(np.ptp(result.picks.position, axis=0).max(initial=0.0))
    blocks = [result.block] if isinstance(result.block, Block) else list(result.block.values())
    radius = float(np.mean([block.radius_m for block in blocks]))
    settings.marker_radius_m = max(radius, 0.006 * extent)
    settings.trail_radius_m = max(0.2 * radius, 0.0025 * extent)
    settings.block_scale = max(1.0, round(0.008 * extent / radius * 2) / 2)


def _show_flights(scene: bpy.types.Scene, name: str, flights: Flights, which: np.ndarray, offset: float) -> None:
    pieces = []
    for index in which:
        clock = trails.moments(flights.start_time_s[index], flights.end_time_s[index])
        position, velocity = flight_states(flights, np.full(len(clock), index), clock)
        pieces.append((clock - offset, position, np.linalg.norm(velocity, axis=1)))
    thing = trails.trail(f"{name} flights", state.FLIGHTS_ROLE, pieces)
    thing["rockfall_trajectory"] = name
    state.collection(scene, "Trajectories", name).objects.link(thing)


def _show_block(scene: bpy.types.Scene, name: str, result: Reconstruction, which: np.ndarray, offset: float) -> None:
    block = result.block if isinstance(result.block, Block) else result.block[name]
    scale = scene.rockfall.block_scale
    diameters = np.array([block.d1, block.d2, block.d3]) * scale
    thing = bpy.data.objects.new(f"{name} block", block_mesh())
    thing[state.ROLE_KEY], thing["rockfall_trajectory"] = state.BLOCK_ROLE, name
    thing.scale = diameters / 2
    state.collection(scene, "Trajectories", name).objects.link(thing)
    thing.delta_location.z = (scale - 1) * block.radius_m  # an enlarged block must not sink into the slope
    keys = motion.motion_keys(result.flights, which)
    keys.time_s[:] -= offset
    motion.write_location_keys(thing, keys, timing.frame_rate(scene))


def _impact_rows(result: Reconstruction) -> dict[tuple[str, float], int]:
    """Row of the impact at (trajectory, time)."""
    names, times = result.impacts.trajectory.tolist(), result.impacts.time_s.tolist()
    return {key: i for i, key in enumerate(zip(names, times, strict=True))}


def _normals(result: Reconstruction) -> np.ndarray:
    """(n, 3) normals of the picks, those of the impacts as they were fitted to the terrain."""
    normals = result.picks.normal.copy()
    rows = _impact_rows(result)
    for i, key in enumerate(zip(result.picks.trajectory.tolist(), result.picks.time_s.tolist(), strict=True)):
        if key in rows:
            normals[i] = result.impacts.normal[rows[key]]
    return normals


def _store_results(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Write each impact's numbers into its object, where panels and exports find them."""
    impacts, flags = result.impacts, result.impacts.flag_text()
    of_pick = _impact_rows(result)
    for thing in state.with_role(scene, state.PICK_ROLE):
        i = of_pick.get((thing["rockfall_trajectory"], thing["rockfall_time_s"]))
        if i is None or thing["rockfall_kind"] != "impact":
            thing.pop(RESULT_KEY, None)
            continue
        values = {
            "incident_mps": impacts.v1[i],
            "restituted_mps": impacts.v2[i],
            "rn": impacts.rn[i],
            "rt": impacts.rt[i],
            "r": impacts.r[i],
            "theta1_deg": np.degrees(impacts.theta1[i]),
            "theta_dev_deg": np.degrees(impacts.theta_dev[i]),
            "normal_spread_deg": np.degrees(impacts.normal_spread[i]),
        }
        thing[RESULT_KEY] = {key: np.atleast_1d(value).tolist() for key, value in values.items()} | {
            "number": int(impacts.impact[i]),
            "flags": flags[i],
        }


def block_mesh(name: str = "Rockfall block", colour: tuple[float, float, float] = OBSERVED_COLOUR) -> bpy.types.Mesh:
    """An angular block of radius 1 (convex hull of seeded directions), shared by all blocks of one colour."""
    existing = bpy.data.meshes.get(name)
    if existing is not None:
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
    colours = np.tile(materials.linear_colour(colour), len(mesh.vertices)).astype(np.float32)
    mesh.attributes.new("colour", "FLOAT_COLOR", "POINT").data.foreach_set("color", colours)
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = "colour"
    mesh.materials.append(materials.shaded_material("Rockfall block", "colour"))
    return mesh
