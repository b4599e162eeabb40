# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks that start as real ones were measured: at their releases, or just after their impacts."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError
from ..reconstruction.block import Block
from ..reconstruction.impact import TAKE_OFF, Impacts
from ..reconstruction.placement import FAR_IN_THE_AIR_M, FAR_M
from ..reconstruction.trajectory import Reconstruction
from ..remarks import Remark
from ..terrain.cloud import Cloud, local_planes, nearest_points
from ..terrain.raycast import closest_points
from ..vectors import Array, Indices, Mask, Names, cross
from .block_shapes import volumes
from .blocks import Blocks, draw_blocks
from .ground import Ground
from .release import Releases, make_releases, standing_on
from .release_sources import check_number, check_size

StartSpin = Literal["rolling", "zero"]
START_SPINS: tuple[StartSpin, ...] = ("rolling", "zero")


@dataclass(frozen=True, eq=False)
class _Start:
    """Where and how k measured blocks start.

    Attributes
    ----------
    name : (k,). position, velocity, spin : (k, 3); NaN where the spin is not known.
    reach : (k,) how far from the terrain it may be [m]; what may be further than `FAR_M` may start in the air.
    """

    name: Names
    position: Array
    velocity: Array
    spin: Array
    reach: Array


def from_impacts(
    ground: Ground,
    impacts: Impacts,
    blocks: Blocks | None = None,
    number: int = 1,
    seed: int = 0,
    *,
    spin: StartSpin = "rolling",
) -> Releases:
    """Blocks that leave each measured impact, `number` times, with its velocity v2.

    Parameters
    ----------
    impacts : those without a position or v2 are left out, which a remark counts; so are those that do not
        leave the ground.
    blocks : None takes the measured diameters and masses, as spheres.
    spin : where ω2 is not known: that of rolling, ω = (n × v2)/r, or none.

    Raises
    ------
    InputError : no impact can be used; without `blocks`, an impact without diameter or mass; one far from the terrain;
        a take-off whose place is no number.

    Notes
    -----
    ω2 is known where the spin at the next impact of the same trajectory was measured, since free flight keeps it. The
    block touches the terrain at the point that is nearest to the measured one. Releases have the names of trajectory
    and impact. Where the table says that a block takes off elsewhere, it starts there.
    """
    known = _known(impacts.position) & _known(impacts.v2) & ~impacts.flags["into_ground"]
    rows = np.flatnonzero(known)
    check_number(number, max(rows.size, 1))
    if not rows.size:
        raise InputError(
            "No impact has a position and a velocity after it",
            advice="Give a table of impacts as `rockfall reconstruct` writes it",
        )
    name = np.array(
        [f"{trajectory} {impact}" for trajectory, impact in zip(impacts.trajectory, impacts.impact, strict=True)]
    )
    position = ground.shift.to_local(_take_off_places(impacts)[rows])
    start = _Start(name[rows], position, impacts.v2[rows], _spin_after(impacts)[rows], np.full(rows.size, FAR_M))
    sizes = None
    if blocks is None:
        diameter, mass = impacts.diameter_m[rows], impacts.mass_kg[rows]
        for i in np.flatnonzero(~(np.isfinite(diameter) & np.isfinite(mass)))[:1].tolist():
            raise InputError(
                f"The impact {start.name[i]} has no diameter and mass", advice="Say what falls, with a diameter"
            )
        axes = np.repeat(diameter[:, None], 3, axis=1)
        shape = np.full(rows.size, "sphere")
        sizes = axes, shape, mass / volumes(shape, axes)
    releases = _released(ground, start, sizes, blocks, number, seed, spin)
    missing = len(impacts) - rows.size
    if not missing:
        return releases
    text = f"{missing} of {len(impacts)} impacts are left out: they have no velocity that leaves the ground."
    return releases.with_remarks(Remark(text, "note", "releases"))


def from_reconstruction(
    ground: Ground,
    reconstruction: Reconstruction,
    blocks: Blocks | None = None,
    number: int = 1,
    seed: int = 0,
    *,
    spin: StartSpin = "rolling",
) -> Releases:
    """Blocks that start as each trajectory begins, `number` times: at its release, else just after its first impact.

    Parameters
    ----------
    blocks : None takes the block of each trajectory.
    spin : of a block that starts with an impact; see `from_impacts`. A release has none, unless it was measured there
        or in its flight, which keeps it.

    Raises
    ------
    InputError : no trajectory begins with a flight; see `from_impacts`.

    Notes
    -----
    A release that was marked on the terrain touches it, one that was marked in the air starts there. After an impact
    with a take-off, blocks start at the take-off. Releases have the names of the trajectories.
    """
    picks, flights, impacts = reconstruction.picks, reconstruction.flights, reconstruction.impacts
    names, position, velocity, omega, reach = [], [], [], [], []
    after, leaving = _spin_after(impacts), _leaving(reconstruction)
    begun_later = 0
    for trajectory, release, impact in _beginnings(reconstruction):
        names.append(trajectory)
        if release >= 0:
            position.append(picks.position[release])
            velocity.append(flights.start_velocity[reconstruction.restituted_flight[release]])
            turning = picks.angular_velocity[[release, flights.last_pick[reconstruction.restituted_flight[release]]]]
            omega.append(np.nan_to_num(turning[0] if np.isfinite(turning[0]).all() else turning[1]))
            reach.append(FAR_IN_THE_AIR_M)
        else:
            position.append(ground.shift.to_local(picks.shift.to_survey(picks.position[leaving[impact]])))
            velocity.append(impacts.v2[impact])
            omega.append(after[impact])
            reach.append(FAR_M)
            begun_later += 1
    if not names:
        raise InputError(
            "No trajectory begins with a release or an impact whose velocity is known",
            advice="Reconstruct trajectories with flights first",
        )
    check_number(number, len(names))
    start = _Start(np.array(names), np.array(position), np.array(velocity), np.array(omega), np.array(reach))
    sizes = None
    if blocks is None:
        of = reconstruction.block
        each = [of if isinstance(of, Block) else of[name] for name in names]
        axes = np.array([(one.d1, one.d2, one.d3) for one in each])
        even: Mask = np.asarray((axes == axes[:, :1]).all(axis=1))
        solid = np.array([one.shape for one in each])
        shape = np.where(even, np.where(solid == "box", "cube", "sphere"), solid)
        sizes = axes, shape, np.array([one.density for one in each])
    releases = _released(ground, start, sizes, blocks, number, seed, spin)
    remarks = []
    if begun_later:
        text = _first_impacts(begun_later, len(names))
        remarks.append(Remark(text, "note", "releases"))
    left = len(picks.group_starts) - len(names)
    if left:
        which = "One trajectory is" if left == 1 else f"{left} trajectories are"
        text = f"{which} left out: no velocity is known of a release or an impact."
        remarks.append(Remark(text, "advice", "releases"))
    return releases.with_remarks(*remarks)


def _first_impacts(begun_later: int, count: int) -> str:
    """Where blocks start whose trajectory was first seen at an impact."""
    if begun_later == count:
        who = "The trajectory begins" if count == 1 else "All trajectories begin"
    else:
        who = f"{begun_later} of {count} trajectories begin{'s' * (begun_later == 1)}"
    return f"{who} with an impact instead of a release: the simulated blocks start just after it."


def start_times(reconstruction: Reconstruction) -> dict[str, float]:
    """Trajectory → when its blocks of `from_reconstruction` start, on the common clock [s]."""
    time_s, leaving = reconstruction.picks.time_s, _leaving(reconstruction)
    return {
        trajectory: float(time_s[release if release >= 0 else leaving[impact]])
        for trajectory, release, impact in _beginnings(reconstruction)
    }


def _number(cell: str) -> float:
    try:
        return float(cell or "nan")
    except ValueError:
        raise InputError(
            f"The place of a take-off is no number: {cell}", advice=f"Correct {', '.join(TAKE_OFF[:3])}"
        ) from None


def _take_off_places(impacts: Impacts) -> Array:
    """(n, 3) where blocks leave the ground, survey coordinates [m]: at the impact, but for those with a take-off."""
    landing = impacts.shift.to_survey(impacts.position)
    names = TAKE_OFF[:3]
    if not all(name in impacts.extra for name in names):
        return landing
    place = np.array([[_number(cell) for cell in impacts.extra[name].tolist()] for name in names]).T
    return np.where(np.isfinite(place).all(axis=1)[:, None], place, landing)


def _leaving(reconstruction: Reconstruction) -> Indices:
    """(n,) the pick at which the block leaves the ground, of each impact."""
    picks = reconstruction.picks
    return picks.leaves_at[picks.kind == "impact"]


def _beginnings(reconstruction: Reconstruction) -> Iterator[tuple[str, int, int]]:
    """Each trajectory that begins with a flight: its name, and the pick of its release or the row of its impact.

    The other one is −1.
    """
    picks, flights, impacts = reconstruction.picks, reconstruction.flights, reconstruction.impacts
    starts = picks.group_starts
    for i, trajectory in zip(starts.tolist(), picks.trajectory[starts].tolist(), strict=True):
        flight = int(reconstruction.restituted_flight[i])
        if picks.kind[i] == "release" and flight >= 0 and not flights.is_contact[flight]:
            yield trajectory, i, -1
            continue
        own = np.flatnonzero((impacts.trajectory == trajectory) & _known(impacts.v2))
        own = own[~impacts.flags["into_ground"][own]]
        if own.size:
            yield trajectory, -1, int(own[0])


def _known(values: Array) -> Mask:
    return np.asarray(np.isfinite(values).all(axis=1))


def _spin_after(impacts: Impacts) -> Array:
    """(n, 3) spin after each impact: that before the next one of the trajectory, NaN where it is not known."""
    after = np.full(impacts.angular_velocity.shape, np.nan)
    order = np.lexsort((impacts.impact, impacts.trajectory, impacts.site))
    same = (impacts.trajectory[order[1:]] == impacts.trajectory[order[:-1]]) & (
        impacts.site[order[1:]] == impacts.site[order[:-1]]
    )
    follows = same & (impacts.impact[order[1:]] == impacts.impact[order[:-1]] + 1)
    after[order[:-1][follows]] = impacts.angular_velocity[order[1:][follows]]
    return after


def _released(
    ground: Ground,
    start: _Start,
    sizes: tuple[Array, Names, Array] | None,
    blocks: Blocks | None,
    number: int,
    seed: int,
    spin: StartSpin,
) -> Releases:
    """The blocks: of `sizes` (diameters, shape, density of each start), or drawn from `blocks`."""
    which = np.repeat(np.arange(len(start.name)), number)
    if blocks is not None:
        axes, density = draw_blocks(blocks, which.size, seed)
        shape = np.full(which.size, blocks.shape)
    elif sizes is not None:
        axes, shape, density = sizes[0][which], sizes[1][which], sizes[2][which]
    diameter = axes.mean(axis=1)
    check_size(ground, diameter)
    distance, foot, normal = _feet(ground, start.position)
    for i in np.flatnonzero(distance > start.reach)[:1].tolist():
        raise InputError(
            f"The start {start.name[i]} is {distance[i]:.1f} m from the terrain",
            advice="Give the terrain on which it was measured",
        )
    centre = start.position[which]
    lies: Mask = distance[which] <= np.where(start.reach[which] > FAR_M, diameter, np.inf)
    placed, fits = standing_on(ground, foot[which][lies], normal[which][lies], diameter[lies])
    for i in np.flatnonzero(~fits)[:1].tolist():
        raise InputError(
            f"A block of {diameter[lies][i]:.3g} m is too large for the ground at {start.name[which[lies][i]]}",
            advice="Give smaller blocks",
        )
    centre[lies] = placed
    velocity, omega = start.velocity[which], start.spin[which]
    rolling = cross(normal[which], velocity) / (diameter / 2)[:, None]
    omega = np.where(_known(omega)[:, None], omega, rolling if spin == "rolling" else 0.0)
    return make_releases(
        centre,
        name=start.name[which],
        velocity=velocity,
        angular_velocity=omega,
        shape=shape,
        axes_m=axes,
        density_kgpm3=density,
        place=which,
    )


def _feet(ground: Ground, places: Array) -> tuple[Array, Array, Array]:
    """(n,) distance of places (n, 3) from the terrain, (n, 3) where it is nearest, (n, 3) its normal there."""
    terrain = ground.terrain
    if isinstance(terrain, Cloud):
        distance, point = nearest_points(terrain, places)
        foot = terrain.points[point]
        normal = local_planes(terrain, foot)[0]
        return distance, foot, np.where(np.isfinite(normal), normal, (0.0, 0.0, 1.0))
    nearest = closest_points(terrain, places)
    return nearest.distance, nearest.point, terrain.face_normals[nearest.face]
