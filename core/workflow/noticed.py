# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody notices who looks over one's shoulder: tracks off the motion, trees in a scan, impossible sizes."""

from collections.abc import Iterable, Iterator

import numpy as np

from ..analysis.motion_graphs import MotionCourse, VideoResiduals
from ..camera.model import Camera, project, rays
from ..constants import GRAVITY_MPS2
from ..footage.background import BackgroundMotion, stabilise
from ..reconstruction.block import per_pick
from ..reconstruction.trajectory import Reconstruction
from ..remarks import Remark
from ..terrain.advice import HIGHEST_RELIEF_M
from ..terrain.surface import Surface
from ..vectors import Array, norm

OFF_PX = 10.0
"""A track further than this from the motion is not explained by the click of a pick."""
IN_A_ROW = 4
"""Pictures one after the other: fewer may be a slip of the tracker."""
LARGEST_GAIN = 3.0
"""Times the energy of a fall from the first pick: beyond it not even badly timed picks explain the speed."""
FASTEST_MPS = 150.0
"""No rockfall is this fast: that of a fall of 1 100 m in a vacuum."""
FEWEST_FLIGHTS = 3
STILL_PX = 0.5
"""Pictures that lie less apart are of a camera that stood still, as far as a few pictures tell."""
GLANCE_PX = 6.0
"""A first look at reduced pictures is not much more exact than this."""
TREMBLE_PX = 2.0
"""A background that moves further than this is not that of a tripod in the wind."""
BEYOND_S = 1.0
"""A block that is followed for longer than this after its last pick may well have hit the ground again."""
FAR_M = 1e6
WIDEST_M = 100.0
"""No scan of a slope has its points this far apart."""
FEWEST_OF_A_SCAN = 1000
"""With fewer triangles a terrain may be a plane that was drawn."""
STANDS_OUT_M = 1.0
"""No single point of the ground stands this far above or below all that surround it, but leaves and branches do."""
MOST_STANDING_OUT = 0.02
"""Of the vertices. Forested tiles with all their points have 0.1, bare ones with steps and boulders 0.003 at most."""


def standing_out(surface: Surface) -> float:
    """Share of the vertices that are higher or lower than all their neighbours by `STANDS_OUT_M`, 0…1."""
    height = surface.vertices[:, 2]
    highest, lowest = np.full(len(height), -np.inf), np.full(len(height), np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)):
        np.maximum.at(highest, surface.faces[:, i], height[surface.faces[:, j]])
        np.minimum.at(lowest, surface.faces[:, i], height[surface.faces[:, j]])
    out = np.maximum(height - highest, lowest - height)
    return float((np.isfinite(out) & (out > STANDS_OUT_M)).mean()) if len(height) else 0.0


def vegetated(share: float, name: str) -> tuple[Remark, ...]:
    """A warning on a terrain of which such a share stands out, as `standing_out` gives it."""
    if share <= MOST_STANDING_OUT:
        return ()
    text = (
        f"{name} looks like trees and bushes, not ground: {100 * share:.0f} % of its points stand out by more than "
        f"{STANDS_OUT_M:g} m. Read it again with the ground filter."
    )
    return (Remark(text, "warning", "vegetation"),)


def impossible_scan(extent: Array, triangles: int, name: str) -> tuple[Remark, ...]:
    """A warning on a terrain of some extent (3,) [m] that cannot be a slope in metres: too high, or far too coarse."""
    apart = float(np.sqrt(2 * extent[0] * extent[1] / max(triangles, 1)))
    if extent[2] > HIGHEST_RELIEF_M:
        why = f"is {extent[2]:,.0f} m high, more than any slope"
    elif triangles >= FEWEST_OF_A_SCAN and apart > WIDEST_M:
        why = f"has its points {apart:,.0f} m apart, which is no scan of a slope"
    else:
        return ()
    text = f"{name} {why}: is its file in another unit? Read it again with the right one, 0.001 m for millimetres."
    return (Remark(text, "warning", "scale"),)


def tracks_off_the_motion(courses: Iterable[MotionCourse]) -> tuple[Remark, ...]:
    """A warning for each track that leaves the computed motion for several pictures, about its trajectory."""
    return tuple(
        remark for course in courses for residuals in course.residuals for remark in _off(course.trajectory, residuals)
    )


def tracked_beyond(trajectory: str, last_pick_s: float, until_s: float, moved_px: float) -> tuple[Remark, ...]:
    """A note where a block was followed for long after its last pick, and moved on before the background [px]."""
    if until_s - last_pick_s < BEYOND_S or not moved_px > OFF_PX:
        return ()
    text = (
        f"{trajectory} is tracked until {until_s:.2f} s, but its last pick is at {last_pick_s:.2f} s: "
        "pick what follows, or where it stops. Or refine what there is."
    )
    return (Remark(text, "note", trajectory),)


def moved_on(first: Camera, first_px: Array, last: Camera, last_px: Array) -> float:
    """How far a pixel moves between two pictures of a camera that turns, before what is far away [px]."""
    _, direction = rays(last, last_px[None])
    return float(norm(project(first, first.position + FAR_M * direction) - first_px)[0])


def turn_deg(motion: BackgroundMotion, camera: Camera) -> float:
    """Largest angle by which the middle of the picture turns away from that of the reference frame [°]."""
    shift = _shift(motion, camera)
    return float(np.degrees(np.arctan(norm(shift / (camera.fx, camera.fy)).max())))


def no_tripod(motion: BackgroundMotion, camera: Camera, video: str) -> tuple[Remark, ...]:
    """A warning on a camera that is taken for a tripod, and whose background moves."""
    if motion.still or norm(_shift(motion, camera)).max() <= TREMBLE_PX:
        return ()
    text = (
        f"The background of {video} moves by {turn_deg(motion, camera):.1f}°, but its camera counts as a tripod: "
        "choose Hand-held in step 3 and follow the background."
    )
    return (Remark(text, "warning", "background"),)


def moves_at_a_glance(moved_px: float, video: str) -> tuple[Remark, ...]:
    """A warning on a camera whose pictures lie apart, as `glance` says; nothing where it does not know."""
    if not moved_px > GLANCE_PX:
        return ()
    text = (
        f"The background of {video} moves by {moved_px:.0f} px in the course of the video: if it was held by hand, "
        "choose Hand-held in step 3 before you mark pairs."
    )
    return (Remark(text, "warning", "background"),)


def impossible_sizes(reconstruction: Reconstruction) -> tuple[Remark, ...]:
    """A warning for each trajectory whose lengths, times and block cannot belong together.

    Notes
    -----
    A fall of the height h gives 2 g h to the square of a speed, and no more. The block is held against the distances
    between impacts. Where lengths and times do not belong together, parabolas do not follow the slope: most of them are
    in the ground.
    """
    flights, picks = reconstruction.flights, reconstruction.picks
    diameter = per_pick(picks, reconstruction.block, lambda one: one.diameter_m)
    remarks = []
    for name in dict.fromkeys(flights.trajectory.tolist()):
        own = np.flatnonzero((flights.trajectory == name) & (flights.kind == "flight"))
        if own.size < FEWEST_FLIGHTS:
            continue
        hop = float(np.median(norm(flights.end_position[own] - flights.start_position[own])))
        size = float(diameter[flights.first_pick[own[0]]])
        if size > hop:
            text = (
                f"Trajectory {name}: its block ({size:.3g} m) is larger than the usual distance between its impacts "
                f"({hop:.3g} m). Check the block's diameter and the unit of the terrain."
            )
            remarks.append(Remark(text, "warning", name))
            continue
        first, later = own[0], norm(flights.end_velocity[own[1:]])
        drop = flights.start_position[first, 2] - flights.end_position[own[1:], 2]
        most = norm(flights.start_velocity[first]) ** 2 + 2 * GRAVITY_MPS2 * np.maximum(drop, 0.0)
        gain, speed = float(np.median(later**2 / np.maximum(most, 1e-12))), float(np.median(later))
        if gain > LARGEST_GAIN or speed > FASTEST_MPS:
            why = f"{gain:.0f} times the energy of a fall from its first pick" if gain > LARGEST_GAIN else "no rockfall"
            text = (
                f"Trajectory {name}: its speeds (typically {speed:.3g} m/s) are those of {why}. "
                "Check the unit of the terrain, and the capture rate of the video."
            )
            remarks.append(Remark(text, "warning", name))
            continue
        under = reconstruction.clearance.below_terrain_m[own]
        deep = int(np.count_nonzero(under > size / 2))
        if 2 * deep > own.size:
            text = (
                f"Trajectory {name}: {deep} of its {own.size} flights pass under the terrain, up to "
                f"{np.nanmax(under):.2g} m deep. Check the times of its picks, and the unit of the terrain."
            )
            remarks.append(Remark(text, "warning", name))
    return tuple(remarks)


def _shift(motion: BackgroundMotion, camera: Camera) -> Array:
    """(f, 2) of the middle of the picture from its place in the reference frame [px]."""
    middle = np.tile([camera.width / 2, camera.height / 2], (len(motion.frames), 1))
    return stabilise(motion, motion.frames, middle) - middle


def _off(name: str, residuals: VideoResiduals) -> Iterator[Remark]:
    distance = residuals.distance_px
    known = np.flatnonzero(np.isfinite(distance))
    off = distance[known] > OFF_PX
    edges = np.flatnonzero(np.diff(np.r_[False, off, False].astype(np.int8)))
    runs = [known[begin:end] for begin, end in edges.reshape(-1, 2) if end - begin >= IN_A_ROW]
    if not runs:
        return
    worst = max(runs, key=lambda run: float(distance[run].max()))
    at = worst[int(np.argmax(distance[worst]))]
    text = (
        f"{name}: the track in {residuals.video} lies up to {distance[at]:.0f} px off the flights, at "
        f"{residuals.time_s[at]:.2f} s. Pick the impact that is missing there, or correct the picks beside it."
    )
    yield Remark(text, "warning", name)
