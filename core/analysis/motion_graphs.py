# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion over time as data: speed, heights, energy, and how far each track lies from the motion that was computed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..footage.clock import Clock
from ..reconstruction.block import per_pick
from ..reconstruction.flight import flight_states
from ..reconstruction.refinement.views import PixelObservations, View
from ..reconstruction.track_residuals import track_residuals
from ..reconstruction.trajectory import Reconstruction
from ..terrain.raycast import closest_points, heights_above
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Names, dot, norm

STEP_S = 0.02
"""Between two moments of a segment; it has `FEWEST` of them at least and `MOST` at most."""
FEWEST, MOST = 9, 65


@dataclass(frozen=True)
class Quantity:
    """What a motion graph shows over time."""

    name: str
    title: str
    unit: str

    @property
    def label(self) -> str:
        """For an axis."""
        return f"{self.title} [{self.unit}]"


SPEED = Quantity("speed_mps", "Speed", "m/s")
HEIGHT = Quantity("height_m", "Height above ground", "m")
CLEARANCE = Quantity("clearance_m", "Shortest distance to the ground", "m")
KINETIC = Quantity("kinetic_kj", "Kinetic energy", "kJ")
TOTAL = Quantity("total_kj", "Kinetic energy with rotation", "kJ")
RESIDUAL = Quantity("residual_px", "Residual of the track", "px")
QUANTITIES = (SPEED, HEIGHT, CLEARANCE, KINETIC, TOTAL, RESIDUAL)
USUAL = (SPEED, HEIGHT, KINETIC, RESIDUAL)


@dataclass(frozen=True, eq=False)
class VideoResiduals:
    """A track of one trajectory in one video, against its motion.

    Attributes
    ----------
    video : name.
    video_s, time_s : (p,) of the pictures on the video's clock, and on the common one [s].
    pixel, offset_px : (p, 2) observed, and observed less computed [px]; NaN outside of the marked motion.
    """

    video: str
    video_s: Array
    time_s: Array
    pixel: Array
    offset_px: Array

    @property
    def distance_px(self) -> Array:
        """(p,)."""
        return norm(self.offset_px)


@dataclass(frozen=True, eq=False)
class MotionCourse:
    """One trajectory over time.

    Attributes
    ----------
    trajectory : name.
    time_s : (q,) common clock [s], ascending. An impact has two moments of one time, before and after it; a moment of
        NaN stands in each gap, where nothing is known.
    flight : (q,) number of the segment within the trajectory, −1 in gaps.
    values : quantity → (q,) in its unit; NaN where not known.
    impact, impact_time_s, pick : (m,) number of each impact from 1, its time [s], and its row among the picks.
    leaves_s : (m,) when the block leaves the ground after it, at its take-off or at once [s].
    residuals : of each video in which the block was tracked.
    """

    trajectory: str
    time_s: Array
    flight: Indices
    values: Mapping[str, Array]
    impact: Indices
    impact_time_s: Array
    pick: Indices
    leaves_s: Array
    residuals: tuple[VideoResiduals, ...] = field(default=())

    def has(self, quantity: Quantity) -> bool:
        """Whether there is anything to show."""
        if quantity == RESIDUAL:
            return any(np.isfinite(one.distance_px).any() for one in self.residuals)
        return bool(np.isfinite(self.values[quantity.name]).any())

    def series(self, quantity: Quantity) -> tuple[Array, Array]:
        """Times and values (q,), a NaN in every gap; of the residuals those of all videos, one after the other."""
        if quantity != RESIDUAL:
            return self.time_s, self.values[quantity.name]
        gap = np.full(1, np.nan)
        times = [part for one in self.residuals for part in (one.time_s, gap)]
        values = [part for one in self.residuals for part in (one.distance_px, gap)]
        return (np.concatenate(times), np.concatenate(values)) if times else (gap[:0], gap[:0])

    def at(self, quantity: Quantity, time_s: float) -> float:
        """The value at a time, after the impact where there is one; NaN in gaps, before and after the motion."""
        if quantity == RESIDUAL:
            return self._nearest_residual(time_s)
        i = int(np.searchsorted(np.fmax.accumulate(self.time_s), time_s, side="right")) - 1 if self.time_s.size else -1
        if i > 0 and np.isnan(self.time_s[i]):
            i -= 1
        if i < 0:
            return np.nan
        values = self.values[quantity.name]
        if self.time_s[i] == time_s:
            return float(values[i])
        if i + 1 == self.time_s.size or self.flight[i + 1] != self.flight[i]:
            return np.nan
        share = (time_s - self.time_s[i]) / (self.time_s[i + 1] - self.time_s[i])
        return float((1 - share) * values[i] + share * values[i + 1])

    def _nearest_residual(self, time_s: float) -> float:
        """That of the picture on display: the last one that is not later, if it is not long ago."""
        for one in self.residuals:
            i = int(np.searchsorted(one.time_s, time_s + 1e-9, side="right")) - 1
            usual = float(np.median(np.diff(one.time_s))) if one.time_s.size > 1 else 0.0
            if i >= 0 and time_s - one.time_s[i] <= max(usual, 1e-9):
                return float(one.distance_px[i])
        return np.nan


@dataclass(frozen=True, eq=False)
class FrameScale:
    """Numbers of a video's pictures along the common time.

    Attributes
    ----------
    video : name.
    clock : of the video.
    video_s, frame : (f,) video time [s], ascending, and number of some of its pictures.
    """

    video: str
    clock: Clock
    video_s: Array
    frame: Array

    def frames(self, time_s: Array) -> Array:
        """Frame numbers, with their fractions, at common times [s]; beyond the pictures the usual rate goes on."""
        at = np.asarray(self.clock.to_video(np.asarray(time_s, dtype=np.float64)))
        found = np.interp(at, self.video_s, self.frame)
        rate = self._rate_hz
        found = np.where(at < self.video_s[0], self.frame[0] + rate * (at - self.video_s[0]), found)
        return np.asarray(np.where(at > self.video_s[-1], self.frame[-1] + rate * (at - self.video_s[-1]), found))

    def times(self, frame: Array) -> Array:
        """The inverse of `frames`."""
        wanted, rate = np.asarray(frame, dtype=np.float64), self._rate_hz
        at = np.interp(wanted, self.frame, self.video_s)
        at = np.where(wanted < self.frame[0], self.video_s[0] + (wanted - self.frame[0]) / rate, at)
        at = np.where(wanted > self.frame[-1], self.video_s[-1] + (wanted - self.frame[-1]) / rate, at)
        return np.asarray(self.clock.to_common(at))

    @property
    def _rate_hz(self) -> float:
        return float((self.frame[-1] - self.frame[0]) / (self.video_s[-1] - self.video_s[0]))


def motion_courses(
    reconstruction: Reconstruction,
    surface: Surface | None = None,
    views: Sequence[View] = (),
    observations: PixelObservations | None = None,
    quantities: Sequence[Quantity] = USUAL,
) -> tuple[MotionCourse, ...]:
    """All trajectories of a reconstruction over time, in its order.

    Parameters
    ----------
    surface : terrain, in the frame of the reconstruction; without one, and beside it, there are no heights.
    views, observations : the videos in which blocks were tracked, and where; of no other trajectories than these.
    quantities : which are computed; the others are NaN.

    Notes
    -----
    Heights are those of the block's underside: vertical above the terrain below it, or the shortest distance from it.
    Where the flights join the marked contact points, these are the underside; where they join the block's centre, it is
    a radius from it. Nothing turns a block in flight: each segment has the spin with which it ends.
    """
    picks, flights, block = reconstruction.picks, reconstruction.flights, reconstruction.block
    which, time_s = _moments(reconstruction)
    position, velocity = flight_states(flights, which, time_s)
    rests = np.r_[which[1:] == which[:-1], False] & (np.r_[np.diff(time_s), 1.0] == 0)
    velocity[1:][rests[:-1]] = 0.0
    first = flights.first_pick[which]

    def of_block(kind: str) -> Array:
        return per_pick(picks, block, lambda one: float(getattr(one, kind)))[first]

    below = of_block("radius_m") if reconstruction.ends == "centres" else np.zeros(which.size)
    unknown = np.full(which.size, np.nan)
    kinetic = 0.5e-3 * of_block("mass_kg") * dot(velocity, velocity)
    spin = picks.angular_velocity[flights.last_pick[which]]
    over = surface if surface is not None and which.size else None
    values = {
        SPEED.name: norm(velocity),
        HEIGHT.name: unknown if over is None or HEIGHT not in quantities else heights_above(over, position) - below,
        CLEARANCE.name: unknown
        if over is None or CLEARANCE not in quantities
        else _signed_distance(over, position) - below,
        KINETIC.name: kinetic,
        TOTAL.name: kinetic + 0.5e-3 * of_block("inertia_kgm2") * dot(spin, spin),
    }
    seen = _seen(reconstruction, surface, views, observations) if RESIDUAL in quantities else {}
    return tuple(
        _course(reconstruction, name, which, time_s, values, seen.get(name, ())) for name in _names(picks.trajectory)
    )


def from_start(course: MotionCourse) -> MotionCourse:
    """The same with times that count from its first moment."""
    start = float(course.time_s[0]) if course.time_s.size else 0.0
    return delayed(course, -start)


def delayed(course: MotionCourse, by_s: float) -> MotionCourse:
    """The same, so much later."""
    return replace(
        course,
        time_s=course.time_s + by_s,
        impact_time_s=course.impact_time_s + by_s,
        leaves_s=course.leaves_s + by_s,
        residuals=tuple(replace(one, time_s=one.time_s + by_s) for one in course.residuals),
    )


def time_limits(courses: Sequence[MotionCourse]) -> tuple[float, float]:
    """From the first to the last moment [s]; 0 to 1 when there is none."""
    times = np.concatenate([np.zeros(0), *(part for one in courses for part in (one.time_s, one.impact_time_s))])
    times = times[np.isfinite(times)]
    if not times.size:
        return 0.0, 1.0
    low, high = float(times.min()), float(times.max())
    return (low, high) if low < high else (low - 0.5, high + 0.5)


def shown_quantities(courses: Sequence[MotionCourse], asked: Sequence[Quantity] = USUAL) -> tuple[Quantity, ...]:
    """Those of which there is something to show."""
    return tuple(quantity for quantity in asked if any(course.has(quantity) for course in courses))


def _moments(reconstruction: Reconstruction) -> tuple[Indices, Array]:
    """(q,) segment and time [s] of each moment; a stop has two, the second one at rest."""
    flights = reconstruction.flights
    stops = reconstruction.picks.kind[flights.last_pick] == "stop"
    size = np.clip(np.ceil(flights.duration_s / STEP_S).astype(np.intp) + 1, FEWEST, MOST)
    whole = size + stops
    which = np.repeat(np.arange(len(flights)), whole)
    within = np.arange(which.size) - np.repeat(np.cumsum(whole) - whole, whole)
    share = np.minimum(within / (size - 1)[which], 1.0)
    start, end = flights.start_time_s[which], flights.end_time_s[which]
    return which, np.where(share >= 1.0, end, start + share * (end - start))


def _signed_distance(surface: Surface, position: Array) -> Array:
    """(q,) shortest distance from the terrain, negative below it; NaN beside it."""
    return np.sign(heights_above(surface, position)) * closest_points(surface, position).distance


def _course(
    reconstruction: Reconstruction,
    name: str,
    which: Indices,
    time_s: Array,
    values: Mapping[str, Array],
    residuals: tuple[VideoResiduals, ...],
) -> MotionCourse:
    picks, flights, impacts = reconstruction.picks, reconstruction.flights, reconstruction.impacts
    own = np.flatnonzero(flights.trajectory == name)
    rows = slice(*np.searchsorted(which, [own[0], own[-1] + 1]).tolist()) if own.size else slice(0, 0)
    flight, chain = which[rows], flights.chain[which[rows]]
    gaps = np.flatnonzero(chain[1:] != chain[:-1]) + 1
    mine = impacts.trajectory == name
    pick = np.flatnonzero((picks.trajectory == name) & (picks.kind == "impact"))
    return MotionCourse(
        trajectory=name,
        time_s=np.insert(time_s[rows], gaps, np.nan),
        flight=np.insert(flight - (own[0] if own.size else 0), gaps, -1),
        values={key: np.insert(column[rows], gaps, np.nan) for key, column in values.items()},
        impact=impacts.impact[mine],
        impact_time_s=impacts.time_s[mine],
        pick=pick,
        leaves_s=picks.time_s[picks.leaves_at[pick]],
        residuals=residuals,
    )


def _seen(
    reconstruction: Reconstruction,
    surface: Surface | None,
    views: Sequence[View],
    observations: PixelObservations | None,
) -> dict[str, tuple[VideoResiduals, ...]]:
    """Trajectory → what was tracked of it, video by video."""
    if observations is None or not len(observations):
        return {}
    offset = track_residuals(reconstruction, surface, views, observations)
    found: dict[str, tuple[VideoResiduals, ...]] = {}
    for name in _names(observations.trajectory):
        for number, view in enumerate(views):
            rows = np.flatnonzero((observations.trajectory == name) & (observations.view == number))
            rows = rows[np.argsort(observations.time_s[rows], kind="stable")]
            if rows.size:
                video_s, pixel = observations.time_s[rows], observations.pixel[rows]
                one = VideoResiduals(view.name, video_s, view.exposed_at(video_s, pixel), pixel, offset[rows])
                found[name] = (*found.get(name, ()), one)
    return found


def _names(trajectory: Names) -> list[str]:
    return list(dict.fromkeys(trajectory.tolist()))
