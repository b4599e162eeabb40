# SPDX-License-Identifier: GPL-3.0-or-later
"""The reconstruction: picks → chains → flights → impacts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..constants import GRAVITY_MPS2
from ..errors import RockfallError
from ..remarks import Remark
from ..vectors import Indices
from .block import Block, per_pick
from .choices import FlightEnds
from .clearance import Clearance
from .drag import Drag
from .flight import Flights
from .impact import DeviationForm, Impacts
from .impact_rows import find_impacts
from .motion import solve_motion
from .picks import Picks
from .placement import check_placement

if TYPE_CHECKING:
    from ..terrain.surface import Surface


DENSEST_GPCM3 = 23.0
"""No substance is denser than osmium, with 22.6 g/cm³."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What was made of the picks.

    Attributes
    ----------
    picks : n picks, in the terrain's frame when there is one.
    flights : k motion segments.
    impacts : the rows of impacts.csv.
    clearance : heights of the segments.
    incident_flight, restituted_flight : (n,) index of the segment that ends or starts at a pick, −1 without one.
    block : of all trajectories, or by trajectory name.
    gravity_mps2 : [m/s²].
    drag : None without.
    ends : what the flights join.
    remarks : on what deserves a look, about its trajectory.
    """

    picks: Picks
    flights: Flights
    impacts: Impacts
    clearance: Clearance
    incident_flight: Indices
    restituted_flight: Indices
    block: Block | Mapping[str, Block]
    gravity_mps2: float
    drag: Drag | None
    ends: FlightEnds
    remarks: tuple[Remark, ...]


def reconstruct(
    picks: Picks,
    *,
    surface: "Surface | None" = None,
    block: Block | Mapping[str, Block] | None = None,
    gravity_mps2: float = GRAVITY_MPS2,
    drag: Drag | None = None,
    normal_radius_m: float | None = None,
    site: str = "",
    eq10: DeviationForm = "signed",
    flights: FlightEnds = "contacts",
) -> Reconstruction:
    """Reconstruct the motion and the impacts from timed picks (Noël et al. 2018, eq. 1–10).

    Parameters
    ----------
    picks : from `make_picks` or `read_picks`.
    surface : terrain; gives normals where the picks have none, heights, and the check that the picks lie on it.
    block : one for all, or one per trajectory name; None is the default `Block`.
    drag : None for free flight in a vacuum.
    normal_radius_m : of the sphere in which the terrain normal is fitted; None takes the default for the block.
    site : name written to the table.
    eq10 : see `apparent`.
    flights : whether they join the marked contact points, as in the paper, or the block's centre at each contact, a
        radius out along the terrain normal. Refined picks are meant with centres.

    Raises
    ------
    InputError : the picks lie off the terrain, or in other coordinates.
    RockfallError : a parameter out of range, a trajectory without a block, a flight that drag makes impossible.

    Notes
    -----
    Which picks are joined is told in `find_segments`. Only flights define the velocity at an impact: one that begins or
    ends a contact segment has that part undefined (flag `contact` beside `first` or `last`), since the mean velocity
    of rolling is not the velocity just after an impact. A `release` is no impact; it starts at rest or not, with the
    velocity of eq. 5. Without a normal, velocities, R and θ_dev are still given. For a departing "impact"
    (v1·n ≥ 0) the coefficients and angles are empty.
    """
    if not (np.isfinite(gravity_mps2) and gravity_mps2 >= 0):
        raise RockfallError(f"Gravity must be a number of zero or more [m/s²], not {gravity_mps2}.")
    if normal_radius_m is not None and not (np.isfinite(normal_radius_m) and normal_radius_m > 0):
        raise RockfallError(f"The normal's radius must be a positive number [m], not {normal_radius_m}.")
    block = block if block is not None else Block()
    remarks: tuple[Remark, ...] = ()
    if surface is not None:
        picks = picks.in_shift(surface.shift)
        remarks = check_placement(picks, surface, per_pick(picks, block, lambda one: one.diameter_m))

    motion = solve_motion(picks, block, gravity_mps2, drag, surface, normal_radius_m, flights)
    return Reconstruction(
        picks=picks,
        flights=motion.flights,
        impacts=find_impacts(motion, site=site, eq10=eq10),
        clearance=motion.clearance,
        incident_flight=motion.incident,
        restituted_flight=motion.restituted,
        block=block,
        gravity_mps2=gravity_mps2,
        drag=drag,
        ends=flights,
        remarks=remarks + _lonely(picks) + _in_grams(picks, block),
    )


def _in_grams(picks: Picks, block: Block | Mapping[str, Block]) -> tuple[Remark, ...]:
    """Densities that are those of rock if their unit is g/cm³."""
    starts, remarks = picks.group_starts, []
    density = per_pick(picks, block, lambda one: one.density)[starts]
    for value in np.unique(density[density < DENSEST_GPCM3]).tolist():
        names = picks.trajectory[starts[density == value]].tolist()
        which = f"{names[0]} and {len(names) - 1} more" if len(names) > 1 else names[0]
        text = (
            f"Trajectory {which}: a block of {value:g} kg/m³, which no rock has. "
            f"In g/cm³? Then give {1000 * value:g} kg/m³."
        )
        remarks.append(Remark(text, "warning", names[0]))
    return tuple(remarks)


def _lonely(picks: Picks) -> tuple[Remark, ...]:
    starts = picks.group_starts
    remarks = []
    for i in starts[np.diff(np.r_[starts, len(picks)]) == 1]:
        row = f" (row {picks.row[i]})" if picks.row[i] else ""
        text = f"Trajectory {picks.trajectory[i]} has a single pick{row}: no flight can be computed."
        remarks.append(Remark(text, "advice", str(picks.trajectory[i])))
    return tuple(remarks)
