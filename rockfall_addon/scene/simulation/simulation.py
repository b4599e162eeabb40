# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated rockfalls in the scene: their blocks beside the real ones, and their paths.

Of each model two objects: a mesh with a vertex for each parabola of the motion, of which geometry nodes make blocks;
and curves, one for each run, with the run's numbers. They hold all that is shown, so that it is saved and undone.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ....core.colours import rounded_top
from ....core.impact_models.registry import find_model
from ....core.simulation.engine import Simulation
from ....core.simulation.parabolas import Parabolas, parabolas_of
from ....core.simulation.results import release_names
from ....core.simulation.trees import Trees
from ....core.vectors import Array
from ..footage import timing
from ..picks import trails, trajectories
from ..storage import materials, store
from . import simulated_nodes, simulated_paths, simulated_trees

COLLECTION = "Simulation"
SINCE, LASTS, RUN, RELEASE = "since_release_s", "lasts_s", "run", "release"
"""Attributes of a parabola beside those that the nodes read."""
FOREVER_S = 1e9
"""How long a block lies where it has stopped."""


@dataclass(frozen=True)
class Origin:
    """When the blocks of a release start in the scene.

    Attributes
    ----------
    trajectory : whose block is measured, empty for a release that nobody has filmed.
    time_s : on the common clock, as long as there is a trajectory.
    """

    trajectory: str = ""
    time_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the scene holds of a simulation, as arrays: it is computed without Blender, and so in the background.

    Attributes
    ----------
    model : its name.
    releases : names of the releases, in the order of their numbers.
    position : (k, 3) starts of the parabolas, local [m].
    attributes : name → type of Blender's attribute and values, of the parabolas.
    paths : see `simulated_paths`.
    """

    model: str
    releases: list[str]
    position: Array
    attributes: dict[str, tuple[str, Array]]
    paths: simulated_paths.Paths


def prepare(simulation: Simulation) -> Prepared:
    """What will be shown of a simulation with recorded moments; nothing of Blender is touched."""
    names = release_names(simulation)
    releases = list(dict.fromkeys(names.tolist()))
    number = {name: place for place, name in enumerate(releases)}
    release = np.array([number[name] for name in names.tolist()])
    parabolas = parabolas_of(simulation)
    attributes = attributes_of(parabolas, release, simulation.releases.axes_m / 2)
    paths = simulated_paths.prepare(simulation, parabolas, release)
    return Prepared(simulation.settings.model, releases, parabolas.position, attributes, paths)


def attributes_of(parabolas: Parabolas, release: Array, half_axes_m: Array) -> dict[str, tuple[str, Array]]:
    """Name → type and values of the attributes that the nodes, `follow` and exports read.

    Parameters
    ----------
    release : (n,) number of the release of each run.
    half_axes_m : (n, 3) of its block [m].
    """
    nowhere = np.full(len(parabolas), np.nan)
    return {
        RUN: ("INT", parabolas.run),
        RELEASE: ("INT", release[parabolas.run]),
        SINCE: ("FLOAT", parabolas.start_s),
        LASTS: ("FLOAT", np.minimum(parabolas.duration_s, FOREVER_S)),
        simulated_nodes.BEGIN: ("FLOAT", nowhere),
        simulated_nodes.END: ("FLOAT", nowhere),
        simulated_nodes.VELOCITY: ("FLOAT_VECTOR", parabolas.velocity),
        simulated_nodes.ACCELERATION: ("FLOAT_VECTOR", parabolas.acceleration),
        simulated_nodes.SPIN: ("FLOAT_VECTOR", parabolas.spin),
        simulated_nodes.TURN: ("QUATERNION", _turns(parabolas)),
        simulated_nodes.HALF_AXES: ("FLOAT_VECTOR", half_axes_m[parabolas.run]),
    }


def show(
    scene: bpy.types.Scene, simulations: Sequence[Simulation], origins: Mapping[str, Origin] | None = None
) -> list[bpy.types.Object]:
    """Show the blocks and paths of these simulations, and of no others; returns the blocks' objects.

    Parameters
    ----------
    simulations : one of each model, with recorded moments.
    origins : release → when its blocks start; the others start with the scene.
    """
    trees = simulations[0].settings.trees if simulations else None
    return show_prepared(scene, [prepare(simulation) for simulation in simulations], origins, trees)


def show_prepared(
    scene: bpy.types.Scene,
    prepared: Sequence[Prepared],
    origins: Mapping[str, Origin] | None = None,
    trees: Trees | None = None,
) -> list[bpy.types.Object]:
    """`show` what was prepared before, and the trees that the blocks met."""
    if not (store.has_role(scene, store.FLIGHTS_ROLE) or blocks_of(scene)):
        _choose_sizes(scene.rockfall, prepared)
    remove(scene)
    if store.KEYED_RATE not in scene:  # nothing is measured: time begins at frame 0
        scene[store.KEYED_RATE] = timing.frame_rate(scene)
        scene.frame_start = 0
        scene.frame_set(0)
    shown = []
    for each in prepared:
        place = store.collection(scene, COLLECTION, find_model(each.model).title)
        begins = [(name, (origins or {}).get(name, Origin())) for name in each.releases]
        blocks, paths = _blocks(each), simulated_paths.make(each.model, each.paths)
        for obj in (blocks, paths):
            obj[store.MODEL] = each.model
            obj[store.RELEASES] = json.dumps([[name, origin.trajectory, origin.time_s] for name, origin in begins])
            store.link(place, obj)
        store.link(place, _pattern(blocks, each.model))
        shown.append(blocks)
    simulated_trees.show(scene, store.collection(scene, COLLECTION), trees)
    follow(scene)
    look(scene)
    return shown


def remove(scene: bpy.types.Scene) -> None:
    """Show no simulated blocks."""
    roles = (
        store.SIMULATED_BLOCKS_ROLE, store.SIMULATED_PATHS_ROLE, store.SIMULATED_PATTERN_ROLE,
        store.SIMULATED_TREES_ROLE,
    )  # fmt: skip
    store.remove_objects([obj for role in roles for obj in store.with_role(scene, role)])
    store.remove_collection(scene, COLLECTION)
    trails.paint_observed(scene)


def blocks_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects of the simulated blocks, one of each model."""
    return store.with_role(scene, store.SIMULATED_BLOCKS_ROLE)


def follow(scene: bpy.types.Scene) -> None:
    """Bring what is shown in line with the scene's playback and the size at which it draws blocks."""
    for obj in blocks_of(scene):
        materials.set_input(obj.modifiers["Blocks"], simulated_nodes.SIZE, scene.rockfall.block_scale)
        obj.update_tag()
        mesh = obj.data
        begin = release_begins(scene, obj)[_read(mesh, RELEASE, np.int32)] + _read(mesh, SINCE)
        if np.array_equal(begin.astype(np.float32), _read(mesh, simulated_nodes.BEGIN)):
            continue
        _write(mesh, simulated_nodes.BEGIN, "FLOAT", begin)
        _write(mesh, simulated_nodes.END, "FLOAT", begin + _read(mesh, LASTS))
        mesh.update()
    if blocks_of(scene):
        scene.frame_end = max(scene.frame_end, int(np.ceil((last_moment(scene) + 1.0) * timing.frame_rate(scene))))


def look(scene: bpy.types.Scene) -> None:
    """Show blocks and paths as the scene's settings say."""
    settings, tops = scene.rockfall_simulation, scale_tops(scene)
    for obj in blocks_of(scene):
        obj.hide_viewport = obj.hide_render = not settings.show_blocks
    for obj in paths_of(scene):
        obj.hide_render = not settings.show_paths
        lines = simulated_paths.lines_of(obj)
        simulated_paths.paint(obj, simulated_paths.colours_of(lines, settings.colour_by, *tops), path_radius(scene))
    simulated_trees.look(scene)
    trails.paint_observed(scene)


def paths_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects of the simulated paths, one of each model."""
    return store.with_role(scene, store.SIMULATED_PATHS_ROLE)


def model_of(obj: bpy.types.Object) -> str:
    """The model of simulated blocks or paths."""
    return str(obj[store.MODEL])


def selected_paths(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The paths among which the selected run is."""
    settings = scene.rockfall_simulation
    found = next((obj for obj in paths_of(scene) if model_of(obj) == settings.run_model), None)
    return found if found is not None and 1 <= settings.run <= len(found.data.curves) else None


def selected_line(scene: bpy.types.Scene) -> Array | None:
    """(k, 3) the path of the selected run, local [m]; None where none is selected or it is not drawn."""
    obj = selected_paths(scene)
    points = None if obj is None else simulated_paths.line_of(obj, scene.rockfall_simulation.run - 1)
    return points if points is not None and len(points) > 1 else None


def selected_run(scene: bpy.types.Scene) -> list[tuple[str, str]] | None:
    """Names and values of the selected run, for people; None where none is selected."""
    obj = selected_paths(scene)
    if obj is None:
        return None
    run = scene.rockfall_simulation.run - 1
    value = {name: float(simulated_paths.figure(obj, name)[run]) for name in simulated_paths.FIGURES}
    release = store.read_json(obj, store.RELEASES, [])[int(value["release"])][0]
    rows = [
        ("Model", find_model(model_of(obj)).title),
        ("Run", f"{run + 1} of {len(obj.data.curves)}"),
        ("Release", release),
        ("End", simulated_paths.ends_of(obj)[int(value["end"])]),
        ("Run-out in plan", f"{value['away_m']:.1f} m"),
        ("Drop", f"{value['drop_m']:.1f} m"),
        ("Length, duration", f"{value['length_m']:.1f} m, {value['time_s']:.1f} s"),
        ("Impacts", f"{value['impacts']:.0f}"),
        ("Greatest speed", f"{value['v_max_mps']:.1f} m/s"),
        ("Greatest energy", f"{value['kinetic_max_kj']:.3g} kJ"),
        ("Greatest height", f"{value['height_max_m']:.1f} m" if np.isfinite(value["height_max_m"]) else "no flight"),
        ("Block", f"{value['diameter_m']:.2f} m, {value['mass_kg']:.0f} kg"),
    ]
    return (
        rows
        if value["drop_m"] <= 0 or value["away_m"] == 0
        else [*rows[:6], ("Energy line", f"{np.degrees(np.arctan2(value['drop_m'], value['away_m'])):.1f}°"), *rows[6:]]
    )


def path_radius(scene: bpy.types.Scene) -> float:
    """Half the thickness of the paths in a render [m]."""
    return 0.5 * scene.rockfall.trail_radius_m


def scale_tops(scene: bpy.types.Scene) -> tuple[float, float]:
    """The upper ends of the scales of speed [m/s] and energy [kJ]: of the simulated paths."""
    speed, energy = [0.0], [0.0]
    for obj in paths_of(scene):
        for name, values in (("v_max_mps", speed), ("kinetic_max_kj", energy)):
            values.append(float(simulated_paths.figure(obj, name).max(initial=0.0)))
    return rounded_top(max(speed)), rounded_top(max(energy))


def release_begins(scene: bpy.types.Scene, obj: bpy.types.Object) -> Array:
    """(r,) display time at which the blocks of each release start [s]."""
    offsets = timing.kept_offsets(scene)
    rows = store.read_json(obj, store.RELEASES, [])
    return np.array([time_s - offsets[name] if name in offsets else 0.0 for _, name, time_s in rows])


def last_moment(scene: bpy.types.Scene) -> float:
    """Display time at which the last simulated block has ended [s]."""
    last = 0.0
    for obj in blocks_of(scene):
        begin, lasts = _read(obj.data, simulated_nodes.BEGIN), _read(obj.data, LASTS)
        last = max(last, float(np.where(lasts < FOREVER_S, begin + lasts, begin).max(initial=0.0)))
    return last


def _choose_sizes(settings: bpy.types.PropertyGroup, prepared: Sequence[Prepared]) -> None:
    """Sizes at which blocks and paths are seen when the whole slope is; to be changed at will."""
    extent = float(max(np.ptp(each.position, axis=0).max(initial=0.0) for each in prepared))
    radius = float(np.mean([each.paths.figures["diameter_m"].mean() / 2 for each in prepared]))
    settings.block_scale = max(1.0, round(0.008 * extent / radius * 2) / 2)
    settings.trail_radius_m = max(0.1 * radius, 0.001 * extent)


def _blocks(prepared: Prepared) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(f"{prepared.model} simulated blocks")
    mesh.vertices.add(len(prepared.position))
    mesh.attributes["position"].data.foreach_set("vector", prepared.position.astype(np.float32).ravel())
    for name, (kind, values) in prepared.attributes.items():
        _write(mesh, name, kind, values)
    obj = bpy.data.objects.new(mesh.name, mesh)
    obj[store.ROLE] = store.SIMULATED_BLOCKS_ROLE
    obj.hide_select = True
    modifier = obj.modifiers.new("Blocks", "NODES")
    modifier.node_group = simulated_nodes.blocks_group()
    return obj


def _pattern(blocks: bpy.types.Object, model: str) -> bpy.types.Object:
    """The block that is shown at every place; it is not seen itself."""
    mesh = trajectories.block_mesh(f"Rockfall twin {model}", find_model(model).colour)
    obj = bpy.data.objects.new(f"{model} simulated block", mesh)
    obj[store.ROLE], obj[store.MODEL] = store.SIMULATED_PATTERN_ROLE, model
    obj.hide_viewport = obj.hide_render = True
    materials.set_input(blocks.modifiers["Blocks"], simulated_nodes.BLOCK, obj)
    return obj


def _turns(parabolas: Parabolas) -> Array:
    """(k, 4) how the blocks are turned at the start of each piece, from any turn on: w, x, y, z."""
    from scipy.spatial.transform import Rotation

    k = len(parabolas)
    turn = np.zeros((k, 4))
    first = np.searchsorted(parabolas.run, parabolas.run)
    number = np.arange(k) - first
    turn[number == 0] = Rotation.random(np.count_nonzero(number == 0), rng=0).as_quat()
    order = np.argsort(number, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(number[order])) + 1)[1:]:
        before = rows - 1
        step = Rotation.from_rotvec(parabolas.spin[before] * parabolas.duration_s[before, None])
        turn[rows] = (step * Rotation.from_quat(turn[before])).as_quat()
    return np.roll(turn, 1, axis=1)


def _write(mesh: bpy.types.Mesh, name: str, kind: str, values: Array) -> None:
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, kind, "POINT")
    field = "vector" if kind == "FLOAT_VECTOR" else "value"
    attribute.data.foreach_set(field, np.ascontiguousarray(values, np.int32 if kind == "INT" else np.float32).ravel())


def _read(mesh: bpy.types.Mesh, name: str, kind: type = np.float32) -> Array:
    values = np.empty(len(mesh.vertices), dtype=kind)
    mesh.attributes[name].data.foreach_get("value", values)
    return values
