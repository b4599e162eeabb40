# SPDX-License-Identifier: GPL-3.0-or-later
"""Flight curves: polylines with times and colours, which geometry nodes make tubes of."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ....core.colours import MEASURED_COLOUR, rounded_top, scale_colours, srgb_to_linear
from ....core.reconstruction.flight import Flights
from ....core.vectors import Array
from ..storage import materials, store

SAMPLE_STEP_S = 0.02
MANY_FLIGHTS, COARSE_STEP_S = 2000, 0.1
"""Of so many flights the memory is spared: between ticks they differ from their parabola by a centimetre."""
SAME_MOMENT_S = 1e-4
BELOW_COLOUR = (1.0, 0.0, 0.0)
STALE_COLOUR = (0.45, 0.45, 0.45)
BELOW_ATTRIBUTE, DOUBT_ATTRIBUTE = "below_terrain", "doubt"
DOUBTFUL_SIGMA = 0.2
"""Relative standard deviation of the speed that counts as full doubt."""


@dataclass(frozen=True, eq=False)
class Lines:
    """The flights of a trail, one after the other.

    Attributes
    ----------
    count : (k,) points of each flight.
    time_s : (points,) display times [s].
    position : (points, 3) [m].
    speed : (points,) [m/s].
    """

    count: Array
    time_s: Array
    position: Array
    speed: Array


@dataclass(frozen=True, eq=False)
class Marks:
    """What else is known of the points of a trail, by attribute: (points,) values; none by default."""

    below: Array = field(default_factory=lambda: np.zeros(0, dtype=bool))
    doubt: Array = field(default_factory=lambda: np.zeros(0))
    tick: Array = field(default_factory=lambda: np.zeros(0, dtype=bool))


def are_many(flights: Flights) -> bool:
    """Whether there are so many flights that renders have tubes of them, and the 3-D view only lines."""
    return len(flights.start_time_s) > MANY_FLIGHTS


def moments(start_s: float, end_s: float, step_s: float = SAMPLE_STEP_S) -> Array:
    """Times at which a flight is sampled, its ends among them."""
    return np.linspace(start_s, end_s, max(2, int(np.ceil((end_s - start_s) / step_s)) + 1))


def parts(duration_s: Array, step_s: Array | float) -> tuple[Array, Array]:
    """Flights cut into equal parts of at most a step: (k,) how many points each has, (points,) times since its start.

    duration_s : (k,), step_s : (k,) or one; all above zero.
    """
    count = np.maximum(2, np.ceil(duration_s / step_s).astype(np.intp) + 1)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return count, number * np.repeat(duration_s / (count - 1), count)


def moments_with_ticks(
    start_s: float, end_s: float, offset_s: float, rate: float, step_s: float = SAMPLE_STEP_S
) -> tuple[Array, Array]:
    """`moments` and those of the scene's frames, which are ticks: (m,) [s] on the clock, (m,) bool."""
    even = moments(start_s, end_s, step_s)
    first, last = np.ceil((start_s - offset_s) * rate), np.floor((end_s - offset_s) * rate)
    frames = offset_s + np.arange(first, last + 1) / rate
    frames = frames[(frames > start_s + SAME_MOMENT_S) & (frames < end_s - SAME_MOMENT_S)]
    if not frames.size:
        return even, np.zeros(len(even), dtype=bool)
    after = np.searchsorted(frames, even)
    gap = np.minimum(
        np.abs(even - frames[np.minimum(after, len(frames) - 1)]), np.abs(even - frames[np.maximum(after - 1, 0)])
    )
    kept = even[gap > SAME_MOMENT_S]
    times = np.concatenate([kept, frames])
    order = np.argsort(times, kind="stable")
    return times[order], (np.arange(len(times)) >= len(kept))[order]


def trail(
    name: str,
    role: str,
    lines: Lines,
    marks: Marks | None = None,
    obj: bpy.types.Object | None = None,
) -> bpy.types.Object:
    """An object of the flights, new or brought in line; `paint` gives it its colours, `set_trails` its thickness."""
    time, place, speed = lines.time_s, lines.position, lines.speed
    last = np.cumsum(lines.count) - 1
    first = np.setdiff1d(np.arange(len(time)), last)
    edges = np.column_stack([first, first + 1]).astype(np.int32).ravel()
    if obj is None:
        obj = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        obj[store.ROLE] = role
    mesh = obj.data
    if len(mesh.vertices) != len(time) or len(mesh.edges) != len(first) or len(mesh.polygons):
        mesh.clear_geometry()
        mesh.vertices.add(len(time))
        mesh.edges.add(len(first))
    mesh.vertices.foreach_set("co", place.astype(np.float32).ravel())
    mesh.edges.foreach_set("vertices", edges)
    marks = marks or Marks()
    for attribute, values in (
        (materials.TIME_ATTRIBUTE, time),
        (materials.SPEED_ATTRIBUTE, speed),
        (BELOW_ATTRIBUTE, marks.below),
        (DOUBT_ATTRIBUTE, marks.doubt),
        (materials.TICK_ATTRIBUTE, marks.tick),
    ):
        if len(values):
            _write(mesh, attribute, values)
    if materials.SPEED_COLOUR not in mesh.attributes:
        mesh.attributes.new(materials.SPEED_COLOUR, "FLOAT_COLOR", "POINT")
        mesh.attributes.active_color_name = mesh.attributes.default_color_name = materials.SPEED_COLOUR
    mesh.update()
    modifier = obj.modifiers.get("Trail") or obj.modifiers.new("Trail", "NODES")
    if modifier.node_group is None:
        modifier.node_group = materials.trail_group()
    return obj


def paint(mesh: bpy.types.Mesh, colours: Array) -> None:
    """Colour a trail: (3,) or (n, 3) sRGB."""
    values = np.ones((len(mesh.vertices), 4), dtype=np.float32)
    values[:, :3] = srgb_to_linear(np.asarray(colours))
    mesh.attributes[materials.SPEED_COLOUR].data.foreach_set("color", values.ravel())
    mesh.update()


def paint_observed(
    scene: bpy.types.Scene, objects: Sequence[bpy.types.Object] | None = None, *, plain: bool = False
) -> None:
    """Colour the measured flights as the scene's settings say; all in the blocks' colour beside those of models.

    What passes below the terrain is red in any case, flights that are not up to date are grey.

    objects : None for all.
    plain : in the blocks' colour in any case.
    """
    plain = plain or are_plain(scene)
    for obj in store.with_role(scene, store.FLIGHTS_ROLE) if objects is None else objects:
        mesh = obj.data
        if materials.SPEED_COLOUR not in mesh.attributes or materials.SPEED_ATTRIBUTE not in mesh.attributes:
            continue
        if obj.get(store.STALE):
            paint(mesh, np.array(STALE_COLOUR))
        else:
            number = len(mesh.vertices)
            colours = np.tile(MEASURED_COLOUR, (number, 1)) if plain else _colours(scene.rockfall, obj)
            if BELOW_ATTRIBUTE in mesh.attributes:
                colours[_read(mesh, BELOW_ATTRIBUTE).astype(bool)] = BELOW_COLOUR
            paint(mesh, colours)


def are_plain(scene: bpy.types.Scene) -> bool:
    """Whether measured flights have the colour of their blocks, because there are those of models beside them."""
    return store.has_role(scene, store.MODEL_FLIGHTS_ROLE) or beside_models(scene)


def beside_models(scene: bpy.types.Scene) -> bool:
    """Whether simulated paths are shown in the colours of their models, so that colours do not mean speeds."""
    settings = scene.rockfall_simulation
    coloured = settings.show_paths and settings.colour_by == "MODEL"
    return coloured and store.has_role(scene, store.SIMULATED_PATHS_ROLE)


def set_tops(scene: bpy.types.Scene) -> bool:
    """Set the ends of the colour scales to what is shown; True when they changed."""
    settings, speeds, energies = scene.rockfall, [0.0], [0.0]
    for obj in store.with_role(scene, store.FLIGHTS_ROLE):
        top = float(obj.get(store.TOP_SPEED, 0.0))
        speeds.append(top)
        energies.append(0.5 * float(obj.get(store.MASS, 0.0)) * top**2 / 1000)
    tops = rounded_top(max(speeds)), rounded_top(max(energies))
    before = settings.speed_top_mps, settings.energy_top_kj
    settings.speed_top_mps, settings.energy_top_kj = tops
    return before != (settings.speed_top_mps, settings.energy_top_kj)


def set_trails(scene: bpy.types.Scene) -> None:
    """Apply the trails' radius, their ticks, and whether they end at the current time."""
    settings = scene.rockfall
    for obj in store.with_role(scene, store.FLIGHTS_ROLE) + store.with_role(scene, store.MODEL_FLIGHTS_ROLE):
        set_trail(settings, obj)


def set_trail(settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> None:
    """`set_trails` for one of them."""
    modifier = obj.modifiers.get("Trail")
    if modifier is not None and modifier.node_group is not None:
        materials.set_input(modifier, "Radius", settings.trail_radius_m)
        materials.set_input(modifier, "Up to now", settings.trail_until_now)
        if "Ticks" in modifier.node_group.interface.items_tree:
            materials.set_input(modifier, "Ticks", settings.show_ticks)
        obj.update_tag()


def _colours(settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> Array:
    """(n, 3) sRGB of the points of a trail, by speed, energy or doubt."""
    mesh = obj.data
    if settings.colour_by == "DOUBT" and DOUBT_ATTRIBUTE in mesh.attributes:
        return scale_colours(_read(mesh, DOUBT_ATTRIBUTE), 0.0, 1.0)
    speed = _read(mesh, materials.SPEED_ATTRIBUTE)
    if settings.colour_by == "ENERGY" and store.MASS in obj:
        return scale_colours(0.5 * float(obj[store.MASS]) * speed**2 / 1000, 0.0, settings.energy_top_kj)
    return scale_colours(speed, 0.0, settings.speed_top_mps)


def _write(mesh: bpy.types.Mesh, name: str, values: Array) -> None:
    boolean = values.dtype == np.bool_
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, "BOOLEAN" if boolean else "FLOAT", "POINT")
    attribute.data.foreach_set("value", values if boolean else values.astype(np.float32))


def _read(mesh: bpy.types.Mesh, name: str) -> Array:
    attribute = mesh.attributes[name]
    values = np.empty(len(mesh.vertices), dtype=bool if attribute.data_type == "BOOLEAN" else np.float32)
    attribute.data.foreach_get("value", values)
    return values
