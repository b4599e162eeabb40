# SPDX-License-Identifier: GPL-3.0-or-later
"""Impacts: apparent coefficients of restitution, angles and flags (Noël et al. 2018, eq. 7–10)."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np

from ..georeference import GlobalShift
from ..vectors import Array, Indices, Mask, Names, cross, dot, norm, numbered

FLAGS = (
    "first",
    "last",
    "departing",
    "into_ground",
    "below_terrain",
    "gap",
    "contact",
    "doubtful",
    "shattered",
    "discarded",
)
"""In the order in which they are written. The last four say why a part is undefined, or repeat the pick's status."""

REFUSED = ("departing", "into_ground", "below_terrain", "discarded")
"""Flags of impacts that count nowhere, neither in comparisons, fits, statistics and medians nor as rebounds that are
drawn: no impact at all, none that is to count, or one whose velocities a wrong pick or normal made. Where a part is
undefined, as at the first and the last impact, there are no coefficients, and nothing to count."""

DeviationForm = Literal["signed", "as_printed"]
RUN = ("run", "source", "simulated_with", "seed")
"""Further columns of a table with simulated blocks: the run, its model, in a database simulated_with, and its seed."""
TAKE_OFF = ("x2_m", "y2_m", "z2_m", "time2_s")
"""Further columns of impacts whose contact is no point: where and when the block leaves the ground [m, s]."""

CACHED_ROWS = 4096
"""Rows whose intermediate results stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class Apparent:
    """What eq. 7–10 make of n pairs of velocities, without judgement; all (n,).

    Attributes
    ----------
    vn1, vt1, vn2, vt2 : norms of the normal and tangential parts [m/s].
    rn, rt, r : apparent coefficients of restitution [-], eq. 7, 8; NaN where the incident part is zero.
    theta1 : incident angle to the ground [rad], eq. 9.
    theta_dev : deviation angle [rad], 0…π, eq. 10.
    approach, escape : v1·n and v2·n [m/s]; an impact has approach < 0.
    """

    vn1: Array
    vt1: Array
    vn2: Array
    vt2: Array
    rn: Array
    rt: Array
    r: Array
    theta1: Array
    theta_dev: Array
    approach: Array
    escape: Array


def apparent(v1: Array, v2: Array, normal: Array, eq10: DeviationForm = "signed") -> Apparent:
    """Apparent coefficients and angles of impacts.

    Parameters
    ----------
    v1, v2 : (n, 3) incident and restituted velocity [m/s].
    normal : (n, 3) unit, out of the ground; NaN rows leave only r and theta_dev.
    eq10 : "signed", or "as_printed" to replicate the paper.

    Notes
    -----
    θ1 is atan2(|v1·n|, |v1×n|): the paper's arc sine (eq. 9) is the same angle but badly conditioned near 0°.
    θ_dev is atan2(|v1×v2|, v1·v2), 0…180°, as the paper's text says; eq. 10 as printed has |v1·v2| and ends at 90°.
    The norms are blind to the sense of the velocities, which `approach` and `escape` keep.
    """
    columns = np.empty((len(fields(Apparent)), len(v1)))
    for start in range(0, len(v1), CACHED_ROWS):
        rows = slice(start, start + CACHED_ROWS)
        _apparent(v1[rows], v2[rows], normal[rows], eq10, columns[:, rows])
    return Apparent(*columns)


def _apparent(v1: Array, v2: Array, normal: Array, eq10: DeviationForm, columns: Array) -> None:
    """Fill the rows of `columns`, which are the fields of `Apparent`."""
    vn1, vt1, vn2, vt2, rn, rt, r, theta1, theta_dev, approach, escape = columns
    approach[:], escape[:] = dot(v1, normal), dot(v2, normal)
    np.abs(approach, out=vn1)
    np.abs(escape, out=vn2)
    vt1[:] = norm(v1 - approach[:, None] * normal)
    vt2[:] = norm(v2 - escape[:, None] * normal)
    for after, before, ratio in ((vn2, vn1, rn), (vt2, vt1, rt), (norm(v2), norm(v1), r)):
        ratio[:] = np.nan
        np.divide(after, before, out=ratio, where=before > 0)
    np.arctan2(vn1, vt1, out=theta1)
    along = dot(v1, v2)
    np.arctan2(norm(cross(v1, v2)), np.abs(along) if eq10 == "as_printed" else along, out=theta_dev)


@dataclass(frozen=True, eq=False)
class Impacts:
    """n impacts, the rows of impacts.csv; angles in radians, positions local.

    Attributes
    ----------
    site, trajectory : (n,) names.
    impact : (n,) number within the trajectory, from 1.
    time_s : (n,) [s].
    position : (n, 3) of the pick, local [m].
    normal : (n, 3) unit, out of the ground; NaN where unknown.
    normal_radius_m : (n,) radius over which the terrain normal was fitted [m]; NaN where the normal was given.
    normal_spread : (n,) root mean square angle between the terrain's faces there and the fitted plane [rad]; NaN where
        the normal was given.
    v1, v2 : (n, 3) incident and restituted velocity [m/s]; NaN where undefined.
    vn1, vt1, vn2, vt2 : (n,) norms of their normal and tangential parts [m/s].
    rn, rt, r : (n,) apparent coefficients of restitution [-]; NaN for a departing "impact".
    theta1, theta_dev : (n,) incident and deviation angle [rad]; NaN for a departing "impact".
    diameter_m, mass_kg : (n,) of the block.
    flags : name → (n,) mask, for each of `FLAGS`.
    angular_velocity : (n, 3) just before the impact [rad/s]; NaN where not measured.
    kinetic1_j, kinetic2_j : (n,) translational energy ½mv² before and after [J].
    rotational1_j, rotational2_j : (n,) ½Iω² before and after [J]; NaN where the spin is not known.
    bounce_height_m : (n,) greatest height above the terrain, vertically, of the flight that follows [m]; NaN without
        terrain.
    chord_height_m : (n,) greatest distance of the flight that follows from the straight line between its ends, at right
        angles to it, in its vertical plane [m].
    sigma : column → standard deviation of that column, same shape; empty when no pick has one.
    intervals : name → (n, 2) ends of the 95 % interval, see `intervals.impact_intervals`; empty likewise.
    extra : further columns of a table that was read, as text.
    shift : of the local frame.
    """

    site: Names
    trajectory: Names
    impact: Indices
    time_s: Array
    position: Array
    normal: Array
    normal_radius_m: Array
    normal_spread: Array
    v1: Array
    v2: Array
    vn1: Array
    vt1: Array
    vn2: Array
    vt2: Array
    rn: Array
    rt: Array
    r: Array
    theta1: Array
    theta_dev: Array
    diameter_m: Array
    mass_kg: Array
    flags: Mapping[str, Mask]
    angular_velocity: Array
    kinetic1_j: Array
    kinetic2_j: Array
    rotational1_j: Array
    rotational2_j: Array
    bounce_height_m: Array
    chord_height_m: Array
    sigma: Mapping[str, Array] = field(default_factory=dict)
    intervals: Mapping[str, Array] = field(default_factory=dict)
    extra: Mapping[str, Names] = field(default_factory=dict)
    shift: GlobalShift = field(default_factory=GlobalShift)

    def __len__(self) -> int:
        return self.time_s.size

    @property
    def complete(self) -> Mask:
        """(n,) impacts whose R_N, R_T, R, θ1 and θ_dev are all defined."""
        return np.isfinite(self.rn) & np.isfinite(self.rt) & np.isfinite(self.r)

    @property
    def refused(self) -> Mask:
        """(n,) impacts with a flag of `REFUSED`."""
        return np.asarray(np.any([self.flags[name] for name in REFUSED], axis=0))

    @property
    def runs(self) -> dict[str, Names]:
        """Columns of `RUN` as far as there are; empty texts for blocks without a run, none in a table without runs."""
        if "run" not in self.extra:
            return {}
        simulated = self.extra["run"] != ""
        return {name: np.where(simulated, self.extra[name], "") for name in RUN if name in self.extra}

    @property
    def falls(self) -> tuple[Names, ...]:
        """Columns (n,) whose values together say of which fall an impact is: site and trajectory, then `runs`."""
        return (self.site, self.trajectory, *self.runs.values())

    def flag_text(self) -> list[str]:
        """(n,) the flags as they are written, joined by ";"."""
        marked = np.array([self.flags[name] for name in FLAGS])
        code = (1 << np.arange(len(FLAGS))) @ marked  # there are few different ones
        different, which = np.unique(code, return_inverse=True)
        texts = [";".join(name for i, name in enumerate(FLAGS) if one >> i & 1) for one in different.tolist()]
        return [texts[i] for i in which.tolist()]


def fall_numbers(impacts: Impacts) -> Indices:
    """(n,) number of the fall that each impact belongs to."""
    return numbered(*impacts.falls)[1]


JUDGED = ("rn", "rt", "r", "theta1", "theta_dev")
"""What a block that does not come nearer has none of."""


def make_impacts(
    values: Apparent,
    v1: Array,
    v2: Array,
    normal: Array,
    *,
    site: str,
    trajectory: Names,
    impact: Indices,
    time_s: Array,
    position: Array,
    diameter_m: Array,
    mass_kg: Array,
    angular_velocity: Array,
    rotational1_j: Array,
    rotational2_j: Array,
    flags: Mapping[str, Mask] | None = None,
    normal_radius_m: Array | None = None,
    normal_spread: Array | None = None,
    bounce_height_m: Array | None = None,
    chord_height_m: Array | None = None,
    sigma: Mapping[str, Array] | None = None,
    intervals: Mapping[str, Array] | None = None,
    extra: Mapping[str, Names] | None = None,
    shift: GlobalShift,
) -> Impacts:
    """The rows of impacts with these velocities, measured or simulated.

    Parameters
    ----------
    values : `apparent` of the velocities.
    flags : without "departing" and "into_ground", which follow from the velocities; those left out are not set.
    Others : see `Impacts`; None is unknown everywhere.

    Notes
    -----
    A departing block has neither coefficients nor angles, nor their deviations and intervals.
    """
    n = time_s.size
    nothing, never = np.full(n, np.nan), np.zeros(n, np.bool_)
    departing = values.approach >= 0
    follow = {"departing": departing, "into_ground": values.escape < 0}
    known, ends = dict(sigma or {}), dict(intervals or {})
    leaving = np.flatnonzero(departing)
    uncertain = (*(known[name] for name in JUDGED if known), *ends.values())
    for column in (*(getattr(values, name) for name in JUDGED), *uncertain):
        column[leaving] = np.nan
    return Impacts(
        site=np.full(n, site),
        trajectory=trajectory,
        impact=impact,
        time_s=time_s,
        position=position,
        normal=normal,
        normal_radius_m=nothing if normal_radius_m is None else normal_radius_m,
        normal_spread=nothing if normal_spread is None else normal_spread,
        v1=v1,
        v2=v2,
        vn1=values.vn1,
        vt1=values.vt1,
        vn2=values.vn2,
        vt2=values.vt2,
        rn=values.rn,
        rt=values.rt,
        r=values.r,
        theta1=values.theta1,
        theta_dev=values.theta_dev,
        diameter_m=diameter_m,
        mass_kg=mass_kg,
        flags={name: {**(flags or {}), **follow}.get(name, never) for name in FLAGS},
        angular_velocity=angular_velocity,
        kinetic1_j=0.5 * mass_kg * dot(v1, v1),
        kinetic2_j=0.5 * mass_kg * dot(v2, v2),
        rotational1_j=rotational1_j,
        rotational2_j=rotational2_j,
        bounce_height_m=nothing if bounce_height_m is None else bounce_height_m,
        chord_height_m=nothing if chord_height_m is None else chord_height_m,
        sigma=known,
        intervals=ends,
        extra=extra or {},
        shift=shift,
    )
