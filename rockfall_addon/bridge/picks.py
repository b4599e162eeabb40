# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks: one object each, placed on the terrain and keyed at its time.

The doubles are kept as ID properties. An object that was moved by hand wins over them: its place is the pick's.
"""

import uuid

import bpy
import numpy as np
from mathutils import Vector

from ...core.reconstruction.picks import Picks, make_picks
from . import materials, motion, state, timing

MARKER_COLOURS = {  # sRGB, after Okabe & Ito 2008; those in flight are paler than any model's colour
    "impact": (0.95, 0.95, 0.95),
    "release": (0.00, 0.62, 0.45),
    "pass": (0.62, 0.70, 0.78),
    "contact": (0.00, 0.45, 0.70),
    "stop": (0.84, 0.37, 0.00),
}
MARKER_LIFT = 0.15  # of the radius, so that the disc is not swallowed by the rough surface


def show_picks(
    scene: bpy.types.Scene, picks: Picks, normals: np.ndarray, offsets: dict[str, float], radius_m: float
) -> None:
    """Bring the picks' objects in line; a pick that is there already (by trajectory and time) keeps its object and id.

    normals : (n, 3) directions of the discs, NaN rows lie flat.
    offsets : from `timing.display_offsets`.
    """
    there = {(o["rockfall_trajectory"], o["rockfall_time_s"]): o for o in state.with_role(scene, state.PICK_ROLE)}
    rate = timing.frame_rate(scene)
    for i in range(len(picks.time_s)):
        trajectory, kind = str(picks.trajectory[i]), str(picks.kind[i])
        thing = there.pop((trajectory, float(picks.time_s[i])), None)
        if thing is None:
            number = int(np.count_nonzero(picks.trajectory[: i + 1] == picks.trajectory[i]))
            thing = bpy.data.objects.new(f"{trajectory} {number:02d} {kind}", _marker(kind))
            thing["rockfall_id"] = uuid.uuid4().hex
            state.collection(scene, "Trajectories", trajectory).objects.link(thing)
        thing.data = _marker(kind)
        normal = Vector(normals[i]) if np.isfinite(normals[i]).all() else Vector((0.0, 0.0, 1.0))
        thing.rotation_mode = "QUATERNION"
        thing.rotation_quaternion = normal.to_track_quat("Z", "Y")
        thing.scale = (radius_m, radius_m, radius_m)
        thing.location = picks.position[i]
        thing[state.ROLE_KEY] = state.PICK_ROLE
        thing["rockfall_trajectory"] = trajectory
        thing["rockfall_time_s"] = float(picks.time_s[i])
        thing["rockfall_position_m"] = picks.position[i].tolist()
        thing["rockfall_kind"], thing["rockfall_status"] = kind, str(picks.status[i])
        thing["rockfall_row"] = int(picks.row[i])
        for key, value in (
            ("rockfall_normal", picks.normal[i]),
            ("rockfall_angular_velocity_radps", picks.angular_velocity[i]),
            ("rockfall_sigma_time_s", picks.sigma_time_s[i : i + 1]),
            ("rockfall_sigma_position_m", picks.sigma_position_m[i : i + 1]),
        ):
            if np.isfinite(value).all():
                thing[key] = value.tolist()
            elif key in thing:
                del thing[key]
        thing["rockfall_extra"] = {name: str(values[i]) for name, values in picks.extra.items()}
        motion.key_location_once(thing, (float(picks.time_s[i]) - offsets[trajectory]) * rate)
    state.remove_objects(list(there.values()))
    scene["rockfall_picks_source"] = picks.source


def picks_of(scene: bpy.types.Scene) -> Picks:
    """The picks as they stand in the scene: trajectories in the order of their starts."""
    things = state.with_role(scene, state.PICK_ROLE)
    started: dict[str, float] = {}
    for thing in things:
        name, time = thing["rockfall_trajectory"], thing["rockfall_time_s"]
        started[name] = min(time, started.get(name, time))
    things.sort(key=lambda o: (started[o["rockfall_trajectory"]], o["rockfall_trajectory"], o["rockfall_time_s"]))
    names = list(dict.fromkeys(name for o in things for name in o["rockfall_extra"]))
    return make_picks(
        [o["rockfall_trajectory"] for o in things],
        [o["rockfall_time_s"] for o in things],
        [_position(o) for o in things],
        kind=[o["rockfall_kind"] for o in things],
        status=[o["rockfall_status"] for o in things],
        normal=_doubles(things, "rockfall_normal", 3),
        sigma_time_s=_doubles(things, "rockfall_sigma_time_s", 1),
        sigma_position_m=_doubles(things, "rockfall_sigma_position_m", 1),
        angular_velocity=_doubles(things, "rockfall_angular_velocity_radps", 3),
        row=[o["rockfall_row"] for o in things],
        extra={n: np.array([str(o["rockfall_extra"].get(n, "")) for o in things], dtype=np.str_) for n in names},
        source=str(scene.get("rockfall_picks_source", "")),
        shift=state.read_shift(scene),
        sort=True,
    )


def _position(thing: bpy.types.Object) -> np.ndarray:
    stored, place = np.array(thing["rockfall_position_m"]), np.array(thing.location)
    return stored if np.array_equal(stored.astype(np.float32), place.astype(np.float32)) else place


def _doubles(things: list[bpy.types.Object], key: str, width: int) -> np.ndarray:
    rows = [list(o[key]) if key in o else [np.nan] * width for o in things]
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def _marker(kind: str) -> bpy.types.Mesh:
    """A ring with a spot in it, of radius 1, shared by all picks of a kind."""
    name = f"Rockfall {kind}"
    existing = bpy.data.meshes.get(name)
    if existing is not None:
        return existing
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(24)])
    rings = [radius * circle for radius in (1.0, 0.72, 0.30)]
    vertices = np.vstack(rings) + np.array([0.0, 0.0, MARKER_LIFT])
    following = (np.arange(24) + 1) % 24
    ring = np.column_stack([np.arange(24), following, 24 + following, 24 + np.arange(24)])
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], [*ring.tolist(), (48 + np.arange(24)).tolist()])
    colour = mesh.attributes.new("colour", "FLOAT_COLOR", "POINT")
    colour.data.foreach_set(
        "color", np.tile(materials.linear_colour(MARKER_COLOURS[kind]), len(vertices)).astype(np.float32)
    )
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = "colour"
    mesh.materials.append(materials.emission_material("Rockfall marker", "colour"))
    return mesh
