# SPDX-License-Identifier: GPL-3.0-or-later
"""The measured impacts as a model meets them: incident states, and which impact hands its spin on to which."""

from collections import Counter
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ..constants import ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..impact_models.machinery.base import Incident
from ..reconstruction.impact import REFUSED, Impacts, fall_numbers
from ..vectors import Array, Indices, Mask, cross, dot, unit

Spin = Literal["rolling", "zero", "table"]
SPINS: tuple[Spin, ...] = get_args(Spin)

REASONS = (
    "no incident velocity",
    "no terrain normal",
    "departing from the ground",
    f"the flag {', '.join(REFUSED[:-1])} or {REFUSED[-1]}",
    "no measured angular velocity",
)


@dataclass(frozen=True, eq=False)
class Courses:
    """m impacts whose incident state is known, grouped by trajectory and in time order.

    Attributes
    ----------
    row : (m,) rows of the table of impacts.
    incident : their states; the angular velocity is that of an impact which follows none.
    follows : (m,) the impact, earlier in this order, whose spin after it is the incident spin here; −1 for none.
    first : (t + 1,) first impact of each of the t trajectories, and m.
    skipped : (row, reason) of the other impacts.
    spin : where the first incident spin comes from.
    radius_m : of all blocks [m]; None: half the table's diameters.
    """

    row: Indices
    incident: Incident
    follows: Indices
    first: Indices
    skipped: tuple[tuple[int, str], ...]
    spin: Spin
    radius_m: float | None

    def __len__(self) -> int:
        return self.row.size


def find_courses(impacts: Impacts, spin: Spin = "rolling", radius_m: float | None = None) -> Courses:
    """The impacts that models can be asked about, and how the spin goes from one to the next.

    Parameters
    ----------
    spin : "rolling": a block without a known spin rolls, ω = (n × v_T)/r with the velocity after the impact before, or
        else with its incident velocity; "zero": it does not spin; "table": every impact has its measured spin.
    radius_m : of the block [m]; None takes half the table's diameter.

    Raises
    ------
    InputError : a normal of length zero, no radius, or no impact is left; with the trajectory and what to do.

    Notes
    -----
    Noël et al. 2018, § 5.1: the spin before an impact is what the model computed for the preceding one. A chain is cut
    where the flight between two impacts is not known. A missing mass is that of a sphere of rock.
    """
    if spin not in SPINS:
        raise InputError(f"There is no spin {spin!r}", advice=f"Choose one of {', '.join(SPINS)}")
    if not len(impacts):
        raise InputError("The table has no impacts")
    order, same = _in_time(impacts)
    v1, v2 = impacts.v1[order], impacts.v2[order]
    normal = _unit_normals(impacts)[order]
    flagged = impacts.refused[order]
    reasons = _reasons(v1, normal, flagged, impacts.angular_velocity[order] if spin == "table" else None)
    used = reasons < 0
    skipped = tuple((int(row), REASONS[reason]) for row, reason in zip(order[~used], reasons[~used], strict=True))
    if not used.any():
        counts = Counter(reason for _, reason in skipped)
        raise InputError(
            "No impact can be compared: " + ", ".join(f"{number} with {reason}" for reason, number in counts.items()),
            advice="An impact needs v1, a normal out of the ground, and v1 into the ground"
            + (", and omega1x_radps … for --spin table" if spin == "table" else ""),
        )
    radius = _radii(impacts, order, used, radius_m)
    linked = same & np.r_[False, np.isfinite(v2[:-1]).all(axis=1)] & ~_cut(impacts, order)
    chained = used & linked & np.r_[False, used[:-1]] & (spin != "table")

    omega = np.zeros((order.size, 3))
    if spin == "table":
        omega = impacts.angular_velocity[order]
    elif spin == "rolling":
        after = np.r_[normal[:1], normal[:-1]], np.r_[v2[:1], v2[:-1]]
        known = linked & np.isfinite(after[0]).all(axis=1)
        omega = np.where(known[:, None], _rolling(*after, radius), _rolling(normal, v1, radius))

    mass, sphere = impacts.mass_kg[order], 4 / 3 * np.pi * radius**3 * ROCK_DENSITY_KGPM3
    place = np.cumsum(used) - 1
    group = np.cumsum(~same)[used]
    return Courses(
        row=order[used],
        incident=Incident(
            v1[used], normal[used], omega[used], radius[used], np.where(np.isfinite(mass), mass, sphere)[used]
        ),
        follows=np.where(chained, place - 1, -1)[used],
        first=np.r_[0, np.flatnonzero(np.diff(group)) + 1, group.size],
        skipped=skipped,
        spin=spin,
        radius_m=radius_m,
    )


def _in_time(impacts: Impacts) -> tuple[Indices, Mask]:
    """The rows grouped by fall and in time order; whether a row is of the fall of the one before."""
    code = fall_numbers(impacts)
    order = np.lexsort((impacts.impact, impacts.time_s, code))
    return order, np.r_[False, np.diff(code[order]) == 0]


def _unit_normals(impacts: Impacts) -> Array:
    length2 = dot(impacts.normal, impacts.normal)
    flat = np.flatnonzero(length2 == 0.0)
    if flat.size:
        raise InputError(
            f"The normal of impact {impacts.impact[flat[0]]} has the length zero",
            trajectory=str(impacts.trajectory[flat[0]]),
            advice="Give the normal out of the ground, or leave nx, ny, nz empty",
        )
    return unit(impacts.normal)


def _reasons(v1: Array, normal: Array, flagged: Mask, omega: Array | None) -> Indices:
    """(n,) index into `REASONS` of what forbids a comparison, −1 for none; the first that holds."""
    holds = [~np.isfinite(v1).all(axis=1), ~np.isfinite(normal).all(axis=1), ~(dot(v1, normal) < 0.0), flagged]
    if omega is not None:
        holds.append(~np.isfinite(omega).all(axis=1))
    return np.select(holds, list(range(len(holds))), -1).astype(np.intp)


def _radii(impacts: Impacts, order: Indices, used: Mask, radius_m: float | None) -> Array:
    radius = impacts.diameter_m[order] / 2 if radius_m is None else np.full(order.size, float(radius_m))
    wrong = np.flatnonzero(used & ~(np.isfinite(radius) & (radius > 0)))
    if wrong.size:
        row = order[wrong[0]]
        raise InputError(
            f"The radius of the block is not known at impact {impacts.impact[row]}"
            if not np.isfinite(radius[wrong[0]])
            else f"The radius of the block is {radius[wrong[0]]:g} m at impact {impacts.impact[row]}",
            trajectory=str(impacts.trajectory[row]),
            advice="Give diameter_m in the table, or a radius above zero for all blocks (--radius)",
        )
    return radius


def _cut(impacts: Impacts, order: Indices) -> Mask:
    """(n,) whether the chain may be cut between a row and the one before although both velocities are known."""
    number = impacts.impact[order]
    missing = np.r_[False, (np.diff(number) != 1) & (number[1:] > 0) & (number[:-1] > 0)]
    between = impacts.flags["gap"][order] & np.isfinite(impacts.v1[order, 0]) & np.isfinite(impacts.v2[order, 0])
    return missing | between | np.r_[False, between[:-1]]


def _rolling(normal: Array, velocity: Array, radius: Array) -> Array:
    return cross(normal, velocity) / radius[:, None]
