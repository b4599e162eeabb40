# SPDX-License-Identifier: GPL-3.0-or-later
"""Where free flights meet the terrain, compiled: chord after chord of the path, until one enters the ground."""

import numpy as np

from ..compiled import kernel
from ..terrain.kernels import STACK_SIZE, nearest_hit
from .drag_kernels import MOTION, SHARES, _advance

FIRST_STEP_S = 0.001
ON_SURFACE_M = 1e-6
"""Nearer to the terrain than this is on it; a ray goes on so far behind a face that it has passed."""


@kernel
def fly_to_ground(  # type: ignore[no-untyped-def]
    tree, face_of, normals, lowest, launches, gravity, clearing, steps, inside, duration, face, left, start, stop
):
    """For the flights from `start` to `stop`: `duration`, `face` and `left` of their landings, and `inside`.

    Parameters
    ----------
    tree, face_of, normals, lowest : of the terrain: index, faces behind the index's triangles, their normals (m, 3),
        least elevation.
    launches : (n, 7) position, velocity, drag_per_m.
    steps : longest chord, and time after which a flight is given up [s].
    inside : (n,) whether it starts in the ground; then whether it ended there.
    duration : (n,) approximate time of the landing, or of the last touch near the start [s]; NaN when a flight with
        drag cannot be integrated.
    face : (n,) that is met then; −1 for none.
    """
    stack, work = np.empty(STACK_SIZE, np.int64), np.empty((len(SHARES) + 1, MOTION))
    here, there, origin, way, place = np.empty(MOTION), np.empty(MOTION), np.empty(3), np.empty(3), np.empty(3)
    longest, limit = steps
    for f in range(start, stop):
        here[:] = launches[f, :MOTION]
        drag, time, landed = launches[f, MOTION], 0.0, False
        duration[f], face[f] = 0.0, -1
        while not landed:
            step = min(longest, max(time, FIRST_STEP_S), limit - time)
            there[:] = here
            if drag > 0.0:
                there[:3] = 0.0
                _advance(there, step, drag, gravity, work)
                there[:3] += here[:3]
                if np.isnan(there[0]):
                    duration[f] = np.nan
                    break
            else:
                there[:3] += step * here[3:]
                there[2] -= 0.5 * gravity * step * step
                there[5] -= gravity * step
            chord = _distance(there, here)
            origin[:] = here[:3]
            while not landed:
                way[:] = there[:3] - origin
                length = np.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
                if length <= ON_SURFACE_M:
                    break
                way /= length
                reached, struck = nearest_hit(tree, stack, origin, way, length)
                if struck < 0:
                    break
                place[:] = origin + reached * way
                normal = normals[face_of[struck]]
                enters = way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2] < 0.0
                inside[f] = enters
                if enters:
                    duration[f] = time + step * _distance(place, here) / chord
                    face[f] = face_of[struck]
                    landed = _distance(place, launches[f]) > clearing[f]
                origin[:] = place + ON_SURFACE_M * way
            time += step
            if landed:
                break
            if (there[2] < lowest and there[5] < 0.0) or time >= limit:
                if not inside[f]:
                    left[f], face[f], duration[f] = True, -1, time
                break
            here[:] = there


@kernel
def _distance(a, b):  # type: ignore[no-untyped-def]
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
