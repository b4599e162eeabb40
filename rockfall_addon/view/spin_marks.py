# SPDX-License-Identifier: GPL-3.0-or-later
"""Over the footage: the marked point of a block in this picture and in the others, and where its spin takes it."""

import bpy
import numpy as np

from ...core.camera.model import Camera, project
from ...core.reconstruction.spin_phases import turned
from ...core.vectors import Array
from ..scene.footage import clocks, pictures
from ..scene.picks import spins
from .drawn import Drawing, Line, Mark, Path

COLOUR = (1.0, 0.45, 0.85)
SIZE = 6.0


def add(
    found: Drawing,
    scene: bpy.types.Scene,
    camera: bpy.types.Object,
    lens: Camera,
    name: str,
    path: Path,
    video_s: float,
) -> None:
    """The marks of the flight that is shown, about the block as it is in this picture.

    A mark of this picture is joined with the block's centre like the hand of a clock; the others are small. A ring is
    where the point should be now by the measured spin.
    """
    marks, clock = spins.marks_in(camera, name), clocks.clock_of(camera)
    times = clock.to_common(marks.time_s)
    moment = pictures.common_time(camera, video_s)
    here = np.abs(marks.time_s - video_s) < 1e-6
    flights = [one for _, one in spins.of_trajectory(scene, name) if one.start_s <= moment <= one.end_s]
    first, last = (flights[0].start_s, flights[0].end_s) if flights else (moment, moment)
    centre = project(lens, _at(path, moment)[None])[0]
    if not np.isfinite(centre).all():
        return
    for i in np.flatnonzero(here | ((times >= first) & (times <= last))).tolist():
        if here[i]:
            pixel = marks.pixel[i]
            colour = np.broadcast_to([*COLOUR, 1.0], (1, 2, 4))
            found.lines.append(Line(np.array([[centre, pixel]]), colour, 2.0))
            found.marks.append(Mark(pixel, "diamond", (*COLOUR, 1.0), SIZE, ""))
        else:
            then = project(pictures.posed(camera, float(marks.time_s[i])), _at(path, float(times[i]))[None])[0]
            pixel = marks.pixel[i] - then + centre
            if np.isfinite(pixel).all():
                found.dots.append((pixel[None], np.array([[*COLOUR, 0.8]]), SIZE))
    for one in flights:
        if one.is_known and np.isfinite(one.point).all():
            way = turned(one.point, one.omega / one.rate, np.array([one.rate * (moment - one.point_s) / (2 * np.pi)]))[
                0
            ]
            place = _at(path, moment)
            if way @ (lens.position - place) > 0:  # on the side that is seen
                found.marks.append(
                    Mark(project(lens, (place + path.radius_m * way)[None])[0], "ring", (*COLOUR, 0.9), SIZE)
                )


def _at(path: Path, time_s: float) -> Array:
    """(3,) the block's centre at a common time."""
    return np.array([np.interp(time_s, path.time_s, path.position[:, i]) for i in range(3)])
