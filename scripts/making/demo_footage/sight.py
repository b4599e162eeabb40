# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be seen of the terrain, and where the survey targets stand."""

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray

from . import shot

Array = NDArray[np.float64]

TARGET_DIAMETER_M = 0.40
TARGETS = 14


def terrain_tree(take: shot.Shot) -> BVHTree:
    """The terrain for ray casting."""
    return BVHTree.FromPolygons(take.local(take.site.vertices).tolist(), take.site.faces.tolist())


def is_clear(tree: BVHTree, eye: Array, point: Array, margin: float) -> bool:
    """Whether nothing of the terrain lies between the eye and a point, but for the last ``margin`` metres."""
    way = point - eye
    length = float(np.linalg.norm(way))
    return tree.ray_cast(Vector(eye), Vector(way / length), length - margin)[0] is None


def choose_targets(take: shot.Shot, tree: BVHTree) -> Array:
    """Centres (n, 3) of the survey targets: on the rock, in sight, off the run, spread over the reference frame."""
    position, rotation = (one[0] for one in shot.camera_path(take, np.zeros(1)))
    path = shot.block_centre(take, np.arange(0.0, shot.FRAMES / shot.FPS, 0.05))
    radius = TARGET_DIAMETER_M / 2.0
    places, pixels = [], []
    for u in np.arange(70.0, shot.WIDTH - 69.0, 19.0):
        for v in np.arange(60.0, shot.HEIGHT - 59.0, 19.0):
            ray = rotation.T @ np.array([u - shot.WIDTH / 2.0, v - shot.HEIGHT / 2.0, shot.FOCAL_PX])
            hit, normal, _, _ = tree.ray_cast(Vector(position), Vector(ray / np.linalg.norm(ray)))
            if hit is None:
                continue
            centre = np.array(hit) + (radius - 0.03) * np.array(normal)
            rim = [centre + radius * 1.3 * (np.cos(a) * rotation[0] + np.sin(a) * rotation[1]) for a in range(7)]
            if not all(is_clear(tree, position, point, 0.0) for point in rim):
                continue
            if np.linalg.norm(path - centre, axis=1).min() > 2.0:
                places.append(centre)
                pixels.append([u / shot.WIDTH, v / shot.WIDTH])
    spread = np.column_stack([pixels, 0.012 * (np.array(places) - position) @ rotation[2]])
    chosen = [int(np.argmin(spread[:, 0] + spread[:, 1]))]
    while len(chosen) < TARGETS:
        gap = np.min(np.linalg.norm(spread[:, None] - spread[None, chosen], axis=2), axis=1)
        chosen.append(int(np.argmax(gap)))
    return np.array([places[i] for i in sorted(chosen, key=lambda i: (round(3 * pixels[i][1]), pixels[i][0]))])
