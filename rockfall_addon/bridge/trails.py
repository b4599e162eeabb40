# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight curves: polylines with times and colours, which geometry nodes make tubes of."""

from collections.abc import Sequence

import bpy
import numpy as np

from ...core.colours import OBSERVED_COLOUR, scale_colours, srgb_to_linear
from ...core.vectors import Array
from . import materials, state

SAMPLE_STEP_S = 0.02

Piece = tuple[Array, Array, Array]
"""Of one flight: (m,) display times [s], (m, 3) positions [m], (m,) speeds [m/s]."""


def moments(start_s: float, end_s: float) -> Array:
    """Times at which a flight is sampled, its ends among them."""
    return np.linspace(start_s, end_s, max(2, int(np.ceil((end_s - start_s) / SAMPLE_STEP_S)) + 1))


def trail(name: str, role: str, pieces: Sequence[Piece]) -> bpy.types.Object:
    """An object of the flights; `paint` gives it its colours, `set_trails` its thickness."""
    counts = np.array([len(time) for time, _, _ in pieces])
    time, place, speed = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    last = np.cumsum(counts) - 1
    first = np.setdiff1d(np.arange(len(time)), last)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(time))
    mesh.vertices.foreach_set("co", place.astype(np.float32).ravel())
    mesh.edges.add(len(first))
    mesh.edges.foreach_set("vertices", np.column_stack([first, first + 1]).astype(np.int32).ravel())
    for attribute, values in ((materials.TIME_ATTRIBUTE, time), (materials.SPEED_ATTRIBUTE, speed)):
        mesh.attributes.new(attribute, "FLOAT", "POINT").data.foreach_set("value", values.astype(np.float32))
    mesh.attributes.new(materials.SPEED_COLOUR, "FLOAT_COLOR", "POINT")
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = materials.SPEED_COLOUR
    mesh.update()
    thing = bpy.data.objects.new(name, mesh)
    thing[state.ROLE_KEY] = role
    thing.modifiers.new("Trail", "NODES").node_group = materials.trail_group()
    return thing


def paint(mesh: bpy.types.Mesh, colours: Array) -> None:
    """Colour a trail: (3,) or (n, 3) sRGB."""
    values = np.ones((len(mesh.vertices), 4), dtype=np.float32)
    values[:, :3] = srgb_to_linear(np.asarray(colours))
    mesh.attributes[materials.SPEED_COLOUR].data.foreach_set("color", values.ravel())
    mesh.update()


def paint_observed(scene: bpy.types.Scene) -> None:
    """Colour the real flights by speed, or all in the real blocks' colour while models are shown beside them."""
    models_shown = bool(state.with_role(scene, state.TWIN_FLIGHTS_ROLE))
    for thing in state.with_role(scene, state.FLIGHTS_ROLE):
        speed = np.empty(len(thing.data.vertices), dtype=np.float32)
        thing.data.attributes[materials.SPEED_ATTRIBUTE].data.foreach_get("value", speed)
        by_speed = scale_colours(speed, 0.0, scene.rockfall.speed_top_mps)
        paint(thing.data, np.array(OBSERVED_COLOUR) if models_shown else by_speed)


def set_trails(scene: bpy.types.Scene) -> None:
    """Apply the trails' radius and whether they end at the current time."""
    for thing in state.with_role(scene, state.FLIGHTS_ROLE) + state.with_role(scene, state.TWIN_FLIGHTS_ROLE):
        modifier = thing.modifiers.get("Trail")
        if modifier is not None:
            materials.set_input(modifier, "Radius", scene.rockfall.trail_radius_m)
            materials.set_input(modifier, "Up to now", scene.rockfall.trail_until_now)
            thing.update_tag()
