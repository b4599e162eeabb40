# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated blocks in a film: who they are, and thin paths behind them; the measured flights are white beside them."""

import bpy
import numpy as np

from ....core.colours import MEASURED_COLOUR
from ....core.film.engines import IDENTIFIERS
from ....core.film.simulated import Group, group_name, path_opacity
from ....core.impact_models.registry import find_model
from ....core.simulation.engine import ENDS, LEFT_TERRAIN, STOPPED
from ....core.vectors import Array
from ...scene.picks import trails
from ...scene.simulation import simulated_paths, simulation
from ...scene.storage import materials, store
from . import presence
from .motions import Motion

PATH_PART = 0.35
"""Width of a simulated path, as a part of that of a measured one."""
OPAQUE_PART = 0.5
"""In Workbench, which lets nothing through, paths are thinner by this."""
OUTER = 0.02
"""Part of the simulated paths' points that may be outside of the picture on each side."""
SIDES = 3
"""Of the tube of a path, which is hardly wider than a pixel."""
GROUP = "Rockfall film paths"


def groups_of(scene: bpy.types.Scene) -> list[Group]:
    """The simulated blocks of each model, as they end in the scene's time; none where they are not to be seen."""
    groups = []
    for obj in _seen(scene):
        lines = simulated_paths.lines_of(obj)
        end, begin = lines.figures["end"].astype(np.intp), _begins(scene, obj, lines)
        groups.append(
            Group(
                name=group_name(find_model(lines.model)),
                colour=find_model(lines.model).colour,
                end_s=begin + lines.figures["time_s"],
                stopped=(end == ENDS.index(STOPPED)) | (end >= len(ENDS)),  # on the ground, or held by a structure
                left=int(np.count_nonzero(end == ENDS.index(LEFT_TERRAIN))),
            )
        )
    return groups


def measured(scene: bpy.types.Scene, motions: list[Motion]) -> Group:
    """The measured blocks; of one that was lost from sight nobody knows whether it stopped."""
    resting = presence.resting(scene)
    stopped = np.array([motion.name in resting for motion in motions], dtype=bool)
    ends = np.array([float(motion.time_s[-1]) for motion in motions])
    return Group("measured", MEASURED_COLOUR, ends, stopped, lost=int(np.count_nonzero(~stopped)))


def points_of(scene: bpy.types.Scene) -> Array:
    """(n, 3) along the simulated paths, without the few that go farthest aside, up or down."""
    points = np.vstack(
        [np.empty((0, 3)), *(simulated_paths.lines_of(obj).position for obj in simulation.paths_of(scene))]
    )
    if not len(points):
        return points
    low, high = np.quantile(points, (OUTER, 1 - OUTER), axis=0)
    return points[((points >= low) & (points <= high)).all(axis=1)]


def make_paths(scene: bpy.types.Scene, radius_m: float, *, until_now: bool) -> list[bpy.types.Object]:
    """Thin paths of the simulated blocks of each model, whole or up to the scene's time."""
    made: list[bpy.types.Object] = []
    if not scene.rockfall_simulation.show_paths:
        return made
    if scene.render.engine == IDENTIFIERS["workbench"]:
        radius_m *= OPAQUE_PART
    opacity = path_opacity(sum(len(obj.data.curves) for obj in simulation.paths_of(scene)))
    for obj in simulation.paths_of(scene):
        lines = simulated_paths.lines_of(obj)
        time = np.repeat(_begins(scene, obj, lines), np.diff(lines.first)) + _since_release(obj)
        flights = trails.Lines(np.diff(lines.first), time, lines.position, lines.speed_mps)
        path = trails.trail(f"Film paths {lines.model}", store.MODEL_FLIGHTS_ROLE, flights)
        trails.paint(path.data, np.array(find_model(lines.model).colour))
        modifier = path.modifiers["Trail"]
        modifier.node_group = _thin_trails(modifier.node_group, opacity)
        materials.set_input(modifier, "Radius", radius_m)
        materials.set_input(modifier, "Up to now", until_now)
        made.append(path)
    return made


def _seen(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects of the paths of all models, unless neither paths nor blocks are to be seen."""
    settings = scene.rockfall_simulation
    return simulation.paths_of(scene) if settings.show_blocks or settings.show_paths else []


def _begins(scene: bpy.types.Scene, obj: bpy.types.Object, lines: simulated_paths.Lines) -> Array:
    """(n,) display time at which each block starts [s]."""
    return simulation.release_begins(scene, obj)[lines.figures["release"].astype(np.intp)]


def _since_release(obj: bpy.types.Object) -> Array:
    """(m,) times of the points [s]."""
    values = np.empty(len(obj.data.points), dtype=np.float32)
    obj.data.attributes[simulated_paths.TIME].data.foreach_get("value", values)
    return values.astype(np.float64)


def _thin_trails(group: bpy.types.GeometryNodeTree, opacity: float) -> bpy.types.GeometryNodeTree:
    """The group of the flights' trails, with fewer sides and a material that others are seen through."""
    material = materials.path_material(opacity)
    existing = bpy.data.node_groups.get((GROUP, None))
    if existing is not None:
        return existing
    thin = group.copy()
    thin.name = GROUP
    for node in thin.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            node.inputs["Material"].default_value = material
        elif node.bl_idname == "GeometryNodeCurvePrimitiveCircle":
            node.inputs["Resolution"].default_value = SIDES
    return thin
