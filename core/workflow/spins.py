# SPDX-License-Identifier: GPL-3.0-or-later
"""The spin of blocks in flight, from one point of the block that was marked in two pictures or more."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from ..camera.model import SIGMA_PX
from ..camera.path import rays_at
from ..errors import InputError, RockfallError
from ..reconstruction.block import Block
from ..reconstruction.choices import SIGMA_AIM
from ..reconstruction.flight import Flights, flight_states
from ..reconstruction.picks import Picks
from ..reconstruction.refinement.views import View
from ..reconstruction.spin import Spin, measure_spin, rolling_axis
from ..reconstruction.spin_fits import fit_rates
from ..reconstruction.spin_phases import directions, is_direction, nearest, phases, tilted
from ..reconstruction.trajectory import Reconstruction, reconstruct
from ..remarks import Remark
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Names, norm, perpendicular, unit
from .sightings import Sightings

Axis = Literal["rolling", "sight"]
AXES: tuple[Axis, ...] = get_args(Axis)
AXIS_WORDS: dict[Axis, str] = {
    "rolling": "horizontal, across the flight: the block rolls forwards (assumed)",
    "sight": "the line of sight: the point turns in the picture's plane (assumed)",
}
Verdict = Literal["measured", "counted", "ambiguous", "unknown"]
"""One rate fits; several do, and the one that was counted by eye is taken; several do; none is known."""

SIGMA_AXIS = np.radians(15.0)
"""Standard deviation of the assumed axis, in either direction [rad]."""
SIGMA_RADIUS = 0.15
"""Standard deviation of the marked point's distance from the centre, in parts of the radius: blocks are no balls."""
MOST_OF_ROLLING = 1.5
"""Rates up to this many times that of rolling are looked for: little but friction turns a block."""
LEAST_LIMIT = 1.0
"""They are always looked for up to this [turns/s]."""
LARGEST_SIGMA_TURNS = 1 / 8
"""The attitude of a mark that is known worse is not known."""
UNSTEADY = 9.0
"""χ² per degree of freedom above which the marks are not of one steady turn."""


@dataclass(frozen=True, eq=False)
class SpinMarks(Sightings):
    """One point of each block as marked in pictures of one video; in one flight it is the same point.

    Attributes
    ----------
    axis : (m,) of `AXES`, what is assumed of the axis; that of a flight's first mark holds.
    about : (m,) turns per second as counted by eye, negative for backwards; the flight's last one holds, NaN says
        nothing.
    """

    axis: Names
    about: Array


@dataclass(frozen=True, eq=False)
class MarkedVideo:
    """One video with the marks in it."""

    view: View
    marks: SpinMarks


@dataclass(frozen=True, eq=False)
class FlightSpin:
    """What the marks of one flight say.

    Attributes
    ----------
    trajectory : name. flight : its number in the trajectory, from 1, contacts not counted.
    last_pick : index of the pick that ends it. impact : number of its impact, 0 where it is none.
    start_time_s, end_time_s : of the flight [s].
    mark_time_s, direction : (n,) times of the marks that count, (n, 3) unit vectors from the centre to the point then.
    axis : what was assumed.
    spin : None where it is not known.
    verdict : why.
    others : turns per second that fit as well as that of the spin, or all that fit where it is not known; signed.
    energy_j, sigma_energy_j : rotational energy ½Iω² and its standard deviation [J]; NaN where it is not known.
    remarks : on the spin, the gravest first.
    """

    trajectory: str
    flight: int
    last_pick: int
    impact: int
    start_time_s: float
    end_time_s: float
    mark_time_s: Array
    direction: Array
    axis: Axis
    spin: Spin | None
    verdict: Verdict
    others: tuple[float, ...]
    energy_j: float
    sigma_energy_j: float
    remarks: tuple[Remark, ...]

    @property
    def turns_per_s(self) -> float:
        """NaN where it is not known."""
        return np.nan if self.spin is None else self.spin.rate / (2 * np.pi)

    @property
    def sigma_turns_per_s(self) -> float:
        """NaN where it is not known."""
        return np.nan if self.spin is None else self.spin.sigma_rate / (2 * np.pi)


@dataclass(frozen=True, eq=False)
class MeasuredSpins:
    """The spins of all flights with marks, and remarks on marks that belong to none."""

    flights: tuple[FlightSpin, ...]
    remarks: tuple[Remark, ...]


@dataclass(frozen=True, eq=False)
class _Marks:
    """m marks of all videos; origin, ray : (m, 3). right, down : (m, 3) of the picture.

    aside : (m, 4, 3) rays a standard deviation to either side, in u and in v.
    step_s : (m,) between two pictures of the video [s]; NaN where the frames do not tell it.
    """

    trajectory: Names
    time_s: Array
    origin: Array
    ray: Array
    aside: Array
    right: Array
    down: Array
    axis: Names
    about: Array
    step_s: Array


def measure_spins(made: Reconstruction, videos: Sequence[MarkedVideo], surface: Surface | None = None) -> MeasuredSpins:
    """Angular velocities of the flights in which one point of the block was marked.

    Parameters
    ----------
    surface : the terrain of the reconstruction.

    Raises
    ------
    InputError : an axis that is not of `AXES`.

    Notes
    -----
    Free flight keeps the angular velocity of a ball. A mark's ray meets the block, a ball of its mean radius about the
    centre of its flight; the angle of that point about the assumed axis is its phase. The steady rate is the weighted
    regression of the phases. Its standard deviation has the clicks, and what all marks of a flight share: the centre,
    the point's distance from it (`SIGMA_RADIUS`) and the axis (`SIGMA_AXIS`). Between two marks whole turns are not
    seen: all rates up to `MOST_OF_ROLLING` times rolling are tried, and where several fit there is no result until a
    rate was counted by eye.
    """
    marks = _joined(made, videos)
    if marks is None:
        return MeasuredSpins((), ())
    flights = _centre_flights(made, surface)
    owner = _owners(flights, marks)
    spins = [
        _measure(made, flights, int(k), _some(marks, np.flatnonzero(owner == k))) for k in np.unique(owner[owner >= 0])
    ]
    return MeasuredSpins(tuple(spins), _homeless(marks, owner))


def with_spins(picks: Picks, spins: MeasuredSpins) -> Picks:
    """The picks with the angular velocities that were measured; the other ones keep theirs."""
    omega = picks.angular_velocity.copy()
    for one in spins.flights:
        if one.spin is not None:
            omega[one.last_pick] = one.spin.angular_velocity
    return replace(picks, angular_velocity=omega)


def _joined(made: Reconstruction, videos: Sequence[MarkedVideo]) -> _Marks | None:
    parts = []
    for video in videos:
        marks, view = video.marks, video.view.in_shift(made.picks.shift)
        unknown = sorted(set(marks.axis.tolist()) - set(AXES))
        if unknown:
            raise InputError(f"Unknown axis of spin {unknown[0]!r}", advice=f"Use one of {', '.join(AXES)}")
        if not len(marks):
            continue
        sigma = np.where(np.isfinite(marks.sigma_px), marks.sigma_px, SIGMA_PX)
        origin, ray = rays_at(view.path, marks.pixel, marks.time_s)
        aside = [
            rays_at(view.path, marks.pixel + sigma[:, None] * way, marks.time_s)[1]
            for way in np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        ]
        turn, time = view.path.poses_at(marks.time_s)[1], view.exposed_at(marks.time_s, marks.pixel)
        parts.append(
            (
                marks.trajectory, time, origin, ray, np.stack(aside, axis=1),
                turn[:, 0], turn[:, 1], marks.axis, marks.about,
                np.full(len(marks), _step(marks, view)),
            )
        )  # fmt: skip
    if not parts:
        return None
    found = _Marks(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return _some(found, np.argsort(found.time_s, kind="stable"))


def _step(marks: SpinMarks, view: View) -> float:
    """Time between two pictures of a video on the common clock [s]; NaN where two marks with frames do not tell it."""
    known = np.flatnonzero(marks.frame >= 0)
    frame, time = marks.frame[known], view.clock.to_common(marks.time_s[known])
    return float(np.ptp(time) / np.ptp(frame)) if known.size and np.ptp(frame) else np.nan


def _some(marks: _Marks, rows: Indices) -> _Marks:
    return _Marks(*(column[rows] for column in vars(marks).values()))


def _centre_flights(made: Reconstruction, surface: Surface | None) -> Flights:
    """The flights of the blocks' centres; those of their contacts where no normal tells the centre."""
    if made.ends == "centres":
        return made.flights
    try:
        return reconstruct(
            made.picks,
            surface=surface,
            block=made.block,
            gravity_mps2=made.gravity_mps2,
            drag=made.drag,
            flights="centres",
        ).flights
    except RockfallError:
        return made.flights


def _owners(flights: Flights, marks: _Marks) -> Indices:
    """(m,) the flight of each mark; −1 for one that is in none, −2 for one while the block rolls or slides."""
    owner = np.full(marks.time_s.size, -1, dtype=np.intp)
    for contact, number in ((True, None), (False, 1)):
        for k in np.flatnonzero(flights.is_contact == contact).tolist():
            inside = (
                (marks.trajectory == flights.trajectory[k])
                & (marks.time_s >= flights.start_time_s[k])
                & (marks.time_s <= flights.end_time_s[k])
            )
            owner[inside] = -2 if number is None else k
    return owner


def _homeless(marks: _Marks, owner: Indices) -> tuple[Remark, ...]:
    """What there is to say about marks that are in no flight."""
    remarks = []
    for code, where in ((-1, "in no flight"), (-2, "where the block rolls or slides, and its spin is not steady")):
        for name in dict.fromkeys(marks.trajectory[owner == code].tolist()):
            times = marks.time_s[(owner == code) & (marks.trajectory == name)]
            lie = "is" if times.size == 1 else "and later are"
            text = (
                f"{name}: {_counted(times.size)} at {times[0]:.3f} s {lie} {where}. Mark the point between two impacts."
            )
            remarks.append(Remark(text, "advice", name))
    return tuple(remarks)


def _measure(made: Reconstruction, flights: Flights, k: int, marks: _Marks) -> FlightSpin:
    """The spin in flight k."""
    name = str(flights.trajectory[k])
    block = made.block if isinstance(made.block, Block) else made.block[name]
    same = (flights.trajectory == name) & ~flights.is_contact
    velocity = flight_states(flights, np.array([k]), np.array([marks.time_s.mean()]))[1][0]
    kind: Axis = "sight" if str(marks.axis[0]) == "sight" else "rolling"
    remarks: list[Remark] = []
    axis = _axis(kind, marks, velocity)
    if not is_direction(axis):
        kind, axis = "sight", _axis("sight", marks, velocity)
        remarks.append(Remark("The block falls straight down: the line of sight is taken as the axis.", "note", name))
    centre = flight_states(flights, np.full(marks.time_s.size, k), marks.time_s)[0]
    seen = np.isfinite(phases(directions(marks.origin, marks.ray, centre, block.radius_m), axis))
    if not seen.all():
        text = "A mark lies on the axis and tells no angle: mark a point farther from it, or assume the other axis."
        remarks.append(Remark(text, "advice", name))
        marks, centre = _some(marks, np.flatnonzero(seen)), centre[seen]
    direction = directions(marks.origin, marks.ray, centre, block.radius_m)
    found = _Found(made, block, marks, centre, direction, axis, _sigma_centre(made, flights, k, block))
    speed = max(float(norm(flights.start_velocity[k])), float(norm(flights.end_velocity[k])))
    spin, verdict, others, more = _judged(found, name, speed)
    energy, sigma_energy = np.nan, np.nan
    if spin is not None:
        energy = 0.5 * block.inertia_kgm2 * spin.rate**2
        sigma_energy = block.inertia_kgm2 * abs(spin.rate) * spin.sigma_rate
    return FlightSpin(
        trajectory=name,
        flight=int(np.flatnonzero(np.flatnonzero(same) == k)[0]) + 1,
        last_pick=int(flights.last_pick[k]),
        impact=_impact_number(made, int(flights.last_pick[k])),
        start_time_s=float(flights.start_time_s[k]),
        end_time_s=float(flights.end_time_s[k]),
        mark_time_s=marks.time_s,
        direction=direction,
        axis=kind,
        spin=spin,
        verdict=verdict,
        others=others,
        energy_j=energy,
        sigma_energy_j=sigma_energy,
        remarks=(*more, *remarks),
    )


def _impact_number(made: Reconstruction, pick: int) -> int:
    own = np.flatnonzero(made.picks.kind == "impact")
    return int(made.impacts.impact[own == pick].sum())


def _axis(kind: Axis, marks: _Marks, velocity: Array) -> Array:
    """(3,) the assumed axis, about which a block that rolls forwards turns in the positive sense."""
    forwards = rolling_axis(velocity)
    if kind == "rolling":
        return forwards
    sight: Array = unit(marks.ray.mean(axis=0))
    return -sight if is_direction(forwards) and float(sight @ forwards) < 0 else sight


@dataclass(frozen=True, eq=False)
class _Found:
    """The marks of one flight on their block: centre, direction (m, 3), unit axis, σ of a coordinate of the centre."""

    made: Reconstruction
    block: Block
    marks: _Marks
    centre: Array
    direction: Array
    axis: Array
    sigma_centre_m: float

    @property
    def phase(self) -> Array:
        """(m,) [turns]."""
        return phases(self.direction, self.axis)

    @property
    def sigma_turns(self) -> Array:
        """(m,) standard deviation of the phases from that of the clicks."""
        squares = np.zeros(self.phase.size)
        for way in (0, 2):
            there, back = (self._phase(ray=self.marks.aside[:, way + side]) for side in (0, 1))
            squares += ((there - back) / 2) ** 2
        return np.maximum(np.sqrt(squares), 1e-6)

    @property
    def shared(self) -> list[tuple[Array, Array]]:
        """The phases with an error that all marks share, a standard deviation to either side of each kind."""
        radius, off = self.block.radius_m, self.sigma_centre_m
        ways = self.marks.right[0], self.marks.down[0]
        tilt = tilted(self.axis, SIGMA_AXIS)
        return [
            (self._phase(radius=radius * (1 + SIGMA_RADIUS)), self._phase(radius=radius * (1 - SIGMA_RADIUS))),
            *(
                (self._phase(centre=self.centre + off * way), self._phase(centre=self.centre - off * way))
                for way in ways
            ),
            (self._phase(axis=tilt[0]), self._phase(axis=tilt[1])),
            (self._phase(axis=tilt[2]), self._phase(axis=tilt[3])),
        ]

    def _phase(
        self,
        *,
        ray: Array | None = None,
        centre: Array | None = None,
        radius: float | None = None,
        axis: Array | None = None,
    ) -> Array:
        """(m,) the phases with something else, nearest to those without."""
        direction = directions(
            self.marks.origin,
            self.marks.ray if ray is None else ray,
            self.centre if centre is None else centre,
            self.block.radius_m if radius is None else radius,
        )
        other = phases(direction, self.axis) if axis is None else _about(direction, axis, self.axis)
        return nearest(np.where(np.isfinite(other), other, self.phase), self.phase)


def _about(direction: Array, axis: Array, usual: Array) -> Array:
    """The phases about a tilted axis, from the same start as about the usual one."""
    start = perpendicular(usual)[0]
    return phases(direction, axis) - phases(start[None], axis)


def _sigma_centre(made: Reconstruction, flights: Flights, k: int, block: Block) -> float:
    """Standard deviation of a coordinate of the centre in flight k [m], from the picks at its ends."""
    ends = made.picks.sigma_position_m[[flights.first_pick[k], flights.last_pick[k]]]
    return float(np.sqrt((ends**2).mean())) if np.isfinite(ends).all() else SIGMA_AIM * block.diameter_m


def _judged(
    found: _Found, name: str, speed_mps: float
) -> tuple[Spin | None, Verdict, tuple[float, ...], tuple[Remark, ...]]:
    """The spin, why it is known or not, the other turns per second that fit, and what there is to say."""
    time, count = found.marks.time_s, found.marks.time_s.size
    if np.unique(time).size < 2:
        text = f"{_counted(count)}: mark the same point of the block again in another picture of this flight."
        return None, "unknown", (), (Remark(text, "advice", name),)
    sigma = found.sigma_turns
    worst = float(np.median(sigma))
    if worst > LARGEST_SIGMA_TURNS:
        text = (
            "The block is too small in the picture: the clicks leave the angle of the marks open to "
            f"± {360 * worst:.0f}°. Click more finely (Click ±), or mark a film that shows it larger."
        )
        return None, "unknown", (), (Remark(text, "warning", name),)
    rolling = speed_mps / (2 * np.pi * found.block.radius_m)
    limit = max(MOST_OF_ROLLING * rolling, LEAST_LIMIT)
    fits = fit_rates(time, found.phase, sigma, limit)
    about = found.marks.about[np.isfinite(found.marks.about)]
    chosen = int(np.argmin(np.abs(fits.rate - about[-1]))) if about.size else 0
    others = tuple(float(rate) for i, rate in enumerate(fits.rate.tolist()) if i != chosen)
    if others and not about.size:
        others = tuple(fits.rate.tolist())
        gap = float(np.diff(np.unique(time)).min())
        rates = _listed(fits.rate.tolist())
        step = np.r_[found.marks.step_s, np.inf]
        text = (
            f"Marks {gap:.3f} s apart do not tell the whole turns between them: {rates} turns/s fit alike (rolling at "
            f"{speed_mps:.1f} m/s would be {rolling:.1f}). {_what_to_do(float(np.nanmin(step)), 1 / (2 * limit))}"
        )
        return None, "ambiguous", others, (Remark(text, "warning", name),)
    turns = fits.turns[chosen]
    spin = measure_spin(time, turns, sigma_turns=sigma, axis=found.axis)
    remarks = []
    variance = spin.sigma_rate**2
    for there, back in found.shared:
        ends = [measure_spin(time, turns + way - found.phase, sigma_turns=sigma).rate for way in (there, back)]
        variance += max(abs(end - spin.rate) for end in ends) ** 2
    beyond = float(fits.chi_square[chosen]) / max(count - 2, 1)
    if count > 2 and beyond > 1:
        variance += (beyond - 1) * spin.sigma_rate**2
    if count > 2 and beyond > UNSTEADY:
        off = 360 * float(np.sqrt((spin.residual_turns**2).mean()))
        text = f"The marks lie {off:.0f}° off a steady turn: is it the same point, and the right axis?"
        remarks.append(Remark(text, "warning", name))
    if others:
        text = f"{_listed(others)} turns/s fit alike; what was counted by eye decides."
        remarks.append(Remark(text, "note", name))
    rate = np.sqrt(variance)
    spin = replace(spin, sigma_rate=float(rate), sigma_angular_velocity=rate * np.abs(spin.axis))
    return spin, "counted" if others else "measured", others, tuple(remarks)


def _what_to_do(step_s: float, needed_s: float) -> str:
    """Where marks are too far apart in time; step_s : between two pictures of the film, inf where it is not known."""
    if np.isfinite(step_s) and step_s > needed_s:
        return f"Pictures {step_s:.3f} s apart cannot tell it: give the turns/s that were counted by eye."
    return f"Mark the point in pictures less than {needed_s:.3f} s apart, or give the turns/s that were counted by eye."


def _counted(marks: int) -> str:
    return "1 mark" if marks == 1 else f"{marks} marks"


def _listed(rates: Sequence[float]) -> str:
    """At most six rates, from the slowest on."""
    texts = [f"{round(rate, 1) + 0.0:.1f}" for rate in sorted(rates, key=abs)]  # no -0.0
    return ", ".join(texts[:6]) + (f" and {len(texts) - 6} more" if len(texts) > 6 else "")
