# SPDX-License-Identifier: GPL-3.0-or-later
"""The paths of simulated blocks: curves, one for each run, with the run's numbers and with colours.

In the 3-D view they are drawn as lines (steps/simulation/overlay); a render shows the curves themselves.
"""

import json
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.colours import scale_colours, srgb_to_linear
from ....core.impact_models.registry import find_model
from ....core.simulation.engine import Simulation
from ....core.simulation.parabolas import Parabolas, polylines_of
from ....core.simulation.results import run_figures
from ....core.vectors import Array
from ....core.workflow.simulation import END_WORDS
from ..storage import materials, store

LINE_TOLERANCE_M = 0.05
"""Lines are nowhere farther from the paths."""
MOST_POINTS = 2_000_000
"""Of more runs than this gives, every second, third … has its path drawn."""
TIME, SPEED, COLOUR = "since_release_s", "speed_mps", "colour"
"""Attributes of the points."""
FIGURES = (
    "run", "release", "end", "time_s", "length_m", "impacts", "v_max_mps", "kinetic_max_kj", "height_max_m",
    "diameter_m", "mass_kg", "drop_m", "away_m",
)  # fmt: skip
"""Attributes of the curves: numbers of a run."""


@dataclass(frozen=True, eq=False)
class Lines:
    """What is drawn of one model's paths.

    Attributes
    ----------
    model : its name.
    first : (n + 1,) where the points of each curve begin.
    position : (m, 3) local [m].
    speed_mps : (m,).
    figures : name → (n,), see `FIGURES`.
    """

    model: str
    first: Array
    position: Array
    speed_mps: Array
    figures: dict[str, Array]


@dataclass(frozen=True, eq=False)
class Paths:
    """The curves of n runs, as arrays.

    Attributes
    ----------
    sizes : (n,) how many of the m points each has, at least one.
    position, time_s, speed_mps : (m, 3) local [m], (m,) since the release, (m,).
    figures : name → (n,), see `FIGURES`.
    ends : the ways to end, by their number.
    """

    sizes: Array
    position: Array
    time_s: Array
    speed_mps: Array
    figures: dict[str, Array]
    ends: tuple[str, ...]


def prepare(simulation: Simulation, parabolas: Parabolas, release: Array) -> Paths:
    """The curves of all runs, without Blender. release : (n,) number of the release of each run."""
    n = len(simulation)
    lines = polylines_of(parabolas, LINE_TOLERANCE_M)
    every = int(np.ceil(lines.run.size / MOST_POINTS))
    drawn = np.flatnonzero(lines.run % every == 0) if every > 1 else slice(None)
    found = np.bincount(lines.run[drawn], minlength=n)
    sizes = np.maximum(found, 1)  # a block that never moves, or whose path is left out, keeps its numbers
    alone = np.repeat(found == 0, sizes)
    position, time, speed = np.zeros((alone.size, 3)), np.zeros(alone.size), np.zeros(alone.size)
    position[~alone], time[~alone], speed[~alone] = lines.position[drawn], lines.time_s[drawn], lines.speed_mps[drawn]
    position[alone] = simulation.position[found == 0]
    return Paths(sizes, position, time, speed, _figures(simulation, release), simulation.ends)


def make(model: str, paths: Paths) -> bpy.types.Object:
    """The object of a model's paths; `paint` gives it its colours."""
    curves = bpy.data.hair_curves.new(f"{model} simulated paths")
    curves.add_curves(paths.sizes.tolist())
    curves.attributes["position"].data.foreach_set("vector", paths.position.astype(np.float32).ravel())
    for name, values in ((TIME, paths.time_s), (SPEED, paths.speed_mps), ("radius", np.zeros(len(paths.position)))):
        _write(curves, name, "POINT", values)
    for name, values in paths.figures.items():
        _write(curves, name, "CURVE", values)
    curves.attributes.new(COLOUR, "FLOAT_COLOR", "POINT")
    curves.materials.append(materials.emission_material("Rockfall simulated path", COLOUR))
    obj = bpy.data.objects.new(curves.name, curves)
    obj[store.ROLE], obj[store.ENDS] = store.SIMULATED_PATHS_ROLE, json.dumps(paths.ends)
    obj.hide_select = obj.hide_viewport = True
    return obj


def lines_of(obj: bpy.types.Object) -> Lines:
    """What an object of paths holds."""
    curves = obj.data
    position = np.empty(3 * len(curves.points), dtype=np.float32)
    curves.attributes["position"].data.foreach_get("vector", position)
    first = np.empty(len(curves.curves) + 1, dtype=np.int32)
    curves.curve_offset_data.foreach_get("value", first)
    figures = {name: _read(curves, name, len(curves.curves)) for name in FIGURES}
    return Lines(obj[store.MODEL], first, position.reshape(-1, 3), _read(curves, SPEED, len(curves.points)), figures)


def figure(obj: bpy.types.Object, name: str) -> Array:
    """(n,) one of `FIGURES` of an object's runs."""
    return _read(obj.data, name, len(obj.data.curves))


def line_of(obj: bpy.types.Object, run: int) -> Array:
    """(k, 3) the points of one run, local [m]."""
    curve = obj.data.curves[run]
    start, count = curve.first_point_index, curve.points_length
    return np.array([obj.data.points[i].position[:] for i in range(start, start + count)])


def ends_of(obj: bpy.types.Object) -> list[str]:
    """How runs end, in words, by their number."""
    return [
        END_WORDS.get(name, name.replace("structure:", "held by ")) for name in store.read_json(obj, store.ENDS, [])
    ]


def colours_of(lines: Lines, colour_by: str, speed_top_mps: float, energy_top_kj: float) -> Array:
    """(m, 3) sRGB of the points, by SPEED, ENERGY or MODEL."""
    if colour_by == "MODEL":
        return np.broadcast_to(np.array(find_model(lines.model).colour), (len(lines.position), 3))
    if colour_by == "SPEED":
        return scale_colours(lines.speed_mps, 0.0, speed_top_mps)
    mass = np.repeat(lines.figures["mass_kg"], np.diff(lines.first))
    return scale_colours(0.5 * mass * lines.speed_mps**2 / 1000, 0.0, energy_top_kj)


def paint(obj: bpy.types.Object, colours: Array, radius_m: float) -> None:
    """Give the curves their colours (m, 3) sRGB and their thickness, for renders."""
    values = np.ones((len(colours), 4), dtype=np.float32)
    values[:, :3] = srgb_to_linear(colours)
    obj.data.attributes[COLOUR].data.foreach_set("color", values.ravel())
    _write(obj.data, "radius", "POINT", np.full(len(colours), radius_m))
    obj.data.update_tag()


def _figures(simulation: Simulation, release: Array) -> dict[str, Array]:
    releases, greatest = simulation.releases, run_figures(simulation)
    way = simulation.position - releases.position
    return {
        "run": np.arange(len(simulation)),
        "release": release,
        "end": simulation.end,
        "time_s": simulation.time_s,
        "length_m": simulation.length_m,
        "impacts": simulation.impacts,
        "v_max_mps": simulation.v_max_mps,
        "kinetic_max_kj": greatest.kinetic_max_j / 1000,
        "height_max_m": greatest.height_max_m,
        "diameter_m": releases.diameter_m,
        "mass_kg": releases.mass_kg,
        "drop_m": -way[:, 2],
        "away_m": np.hypot(way[:, 0], way[:, 1]),
    }


def _write(curves: bpy.types.Curves, name: str, domain: str, values: Array) -> None:
    attribute = curves.attributes.get(name) or curves.attributes.new(name, "FLOAT", domain)
    attribute.data.foreach_set("value", np.ascontiguousarray(values, dtype=np.float32))


def _read(curves: bpy.types.Curves, name: str, count: int) -> Array:
    values = np.empty(count, dtype=np.float32)
    curves.attributes[name].data.foreach_get("value", values)
    return values
