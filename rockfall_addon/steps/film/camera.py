# SPDX-License-Identifier: GPL-3.0-or-later
"""The film's camera: placed by the core, checked against the scene's terrain."""

from math import tan

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ....core.errors import RockfallError
from ....core.exchange.project import CameraPlacement
from ....core.film import graphs
from ....core.film.framing import Margins, Seen, View, downhill_direction, look_at, place_camera
from ....core.terrain.raycast import any_hit
from ....core.terrain.surface import Surface
from ....core.vectors import Array, norm
from ...scene.storage import store
from ...scene.terrain import georeference, terrain
from .motions import Motion

FRAMED_POINTS, WATCHED_POINTS = 2000, 160
BESIDE_LEGEND = Margins(left=0.38, right=0.05, bottom=0.06, top=0.16)
LIFT_M = 0.5  # what is watched is a block above the ground, not a line on it
CONTEXT = 0.12  # of the trajectories' extent: how much slope around them belongs to a picture of the whole


def automatic_view(
    scene: bpy.types.Scene,
    motions: list[Motion],
    aspect: float,
    whole: bool = False,
    others: Array | None = None,
    *,
    beside_graphs: bool = False,
) -> View:
    """A view of all trajectories, or of the whole slope around them.

    others : (n, 3) more points that are to be in the picture.
    beside_graphs : graphs stand at the right.

    Raises
    ------
    RockfallError : there are neither trajectories nor a terrain.
    """
    surface = terrain.surface_of_scene(scene)
    further = np.empty((0, 3)) if others is None else others
    points = np.vstack([*(motion.position for motion in motions), further])
    around = surface.vertices if surface is not None and (whole or not motions) else np.empty((0, 3))
    if len(points) and len(around):
        low, high = points.min(axis=0), points.max(axis=0)
        reach = CONTEXT * float(np.linalg.norm(high - low))
        around = around[((around[:, :2] > low[:2] - reach) & (around[:, :2] < high[:2] + reach)).all(axis=1)]
    framed = np.vstack([_thinned(points, FRAMED_POINTS), _thinned(around, FRAMED_POINTS)])
    if not len(framed):
        raise RockfallError("There is nothing to film: import a terrain or picks first.")
    if motions:
        ends = [np.array([motion.position[i] for motion in motions]) for i in (0, -1)]
        downhill = downhill_direction(*ends)
    else:
        downhill = _steepest_way(around)
    watched = _thinned(points if len(points) else around, WATCHED_POINTS)
    seen = None if surface is None else _visibility(surface, watched)
    margins = BESIDE_LEGEND if len(further) else Margins(0.04, 0.04, 0.04, 0.04) if whole else Margins()
    if beside_graphs:
        margins = graphs.beside_graphs(margins)
    return place_camera(framed, downhill, aspect, seen, margins)


def given_view(scene: bpy.types.Scene, placement: CameraPlacement, aspect: float) -> View:
    """The view of a preset, whose coordinates are those of the survey."""
    shift = georeference.read_shift(scene)
    position, target = (shift.to_local(np.array(place)) for place in (placement.position, placement.target))
    return look_at(position, target, float(np.radians(placement.fov_deg)), aspect)


def add_camera(scene: bpy.types.Scene, view: View, points: Array) -> bpy.types.Object:
    """A camera object for a view, its clipping distances chosen for the given points (n, 3)."""
    camera = bpy.data.cameras.new("Film")
    camera.sensor_fit = "HORIZONTAL"
    camera.lens = camera.sensor_width / (2 * tan(view.fov / 2))
    depth = view.project(points)[:, 2]
    camera.clip_start = max(0.05, float(np.median(depth)) / 200)
    camera.clip_end = 1.3 * float(depth.max()) + 50.0
    obj = bpy.data.objects.new("Film camera", camera)
    axes = np.column_stack([view.right, view.up, -view.forward])
    obj.matrix_world = Matrix.Translation(Vector(view.position)) @ Matrix(axes.tolist()).to_4x4()
    return obj


def scene_points(scene: bpy.types.Scene, motions: list[Motion]) -> Array:
    """(n, 3) what the camera must reach: the trajectories and the corners of the terrain's box."""
    parts = [motion.position for motion in motions]
    for ground in store.with_role(scene, store.TERRAIN_ROLE):
        parts.append(np.array([ground.matrix_world @ Vector(corner) for corner in ground.bound_box]))
    return np.vstack(parts)


def _visibility(surface: Surface, points: Array) -> Seen:
    starts = points + np.array([0.0, 0.0, LIFT_M])

    def seen(position: Array) -> Array:
        rays = position - starts
        return (~any_hit(surface, starts, rays, norm(rays))).astype(float)

    return seen


def _thinned(points: Array, count: int) -> Array:
    return points[:: max(1, -(-len(points) // count))]


def _steepest_way(vertices: Array) -> Array:
    """Horizontal direction in which a terrain falls: down the gradient of the plane through it."""
    away = vertices - vertices.mean(axis=0)
    gradient = np.linalg.lstsq(away[:, :2], away[:, 2], rcond=None)[0]
    return downhill_direction(np.zeros((1, 3)), np.array([[-gradient[0], -gradient[1], 0.0]]))
