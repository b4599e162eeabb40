# SPDX-License-Identifier: GPL-3.0-or-later
"""The spin of blocks in flight, from one point of the block that was marked in two pictures or more."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import RockfallError
from ..reconstruction.block import Block
from ..reconstruction.choices import SIGMA_AIM
from ..reconstruction.flight import Flights, flight_states
from ..reconstruction.flight_spins import FlightSpin
from ..reconstruction.picks import Picks
from ..reconstruction.spin import rolling_axis
from ..reconstruction.spin_marks import Axis, MarkedVideo, Marks, joined, some
from ..reconstruction.spin_phases import directions, is_direction, phases
from ..reconstruction.spin_rates import MarksOnBlock, counted, judged
from ..reconstruction.trajectory import Reconstruction, reconstruct
from ..remarks import Remark
from ..terrain.surface import Surface
from ..vectors import Array, Indices, norm, unit


@dataclass(frozen=True, eq=False)
class MeasuredSpins:
    """The spins of all flights with marks, and remarks on marks that belong to none."""

    flights: tuple[FlightSpin, ...]
    remarks: tuple[Remark, ...]


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
    marks = joined(videos, made.picks.shift)
    if marks is None:
        return MeasuredSpins((), ())
    flights = _centre_flights(made, surface)
    owner = _owners(flights, marks)
    spins = [
        _measure(made, flights, int(k), some(marks, np.flatnonzero(owner == k))) for k in np.unique(owner[owner >= 0])
    ]
    return MeasuredSpins(tuple(spins), _homeless(marks, owner))


def with_spins(picks: Picks, spins: MeasuredSpins) -> Picks:
    """The picks with the angular velocities that were measured; the other ones keep theirs."""
    omega = picks.angular_velocity.copy()
    for one in spins.flights:
        if one.spin is not None:
            omega[one.last_pick] = one.spin.angular_velocity
    return replace(picks, angular_velocity=omega)


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


def _owners(flights: Flights, marks: Marks) -> Indices:
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


def _homeless(marks: Marks, owner: Indices) -> tuple[Remark, ...]:
    """What there is to say about marks that are in no flight."""
    remarks = []
    for code, where in ((-1, "in no flight"), (-2, "where the block rolls or slides, and its spin is not steady")):
        for name in dict.fromkeys(marks.trajectory[owner == code].tolist()):
            times = marks.time_s[(owner == code) & (marks.trajectory == name)]
            lie = "is" if times.size == 1 else "and later are"
            text = (
                f"{name}: {counted(times.size)} at {times[0]:.3f} s {lie} {where}. Mark the point between two impacts."
            )
            remarks.append(Remark(text, "advice", name))
    return tuple(remarks)


def _measure(made: Reconstruction, flights: Flights, k: int, marks: Marks) -> FlightSpin:
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
        marks, centre = some(marks, np.flatnonzero(seen)), centre[seen]
    direction = directions(marks.origin, marks.ray, centre, block.radius_m)
    found = MarksOnBlock(block, marks, centre, direction, axis, _sigma_centre(made, flights, k, block))
    speed = max(float(norm(flights.start_velocity[k])), float(norm(flights.end_velocity[k])))
    spin, verdict, others, more = judged(found, name, speed)
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
    return int(made.impacts.impact[(own == pick) | (made.picks.leaves_at[own] == pick)].sum())


def _axis(kind: Axis, marks: Marks, velocity: Array) -> Array:
    """(3,) the assumed axis, about which a block that rolls forwards turns in the positive sense."""
    forwards = rolling_axis(velocity)
    if kind == "rolling":
        return forwards
    sight: Array = unit(marks.ray.mean(axis=0))
    return -sight if is_direction(forwards) and float(sight @ forwards) < 0 else sight


def _sigma_centre(made: Reconstruction, flights: Flights, k: int, block: Block) -> float:
    """Standard deviation of a coordinate of the centre in flight k [m], from the picks at its ends."""
    ends = made.picks.sigma_position_m[[flights.first_pick[k], flights.last_pick[k]]]
    return float(np.sqrt((ends**2).mean())) if np.isfinite(ends).all() else SIGMA_AIM * block.diameter_m
