# SPDX-License-Identifier: GPL-3.0-or-later
"""Predicted flights: the block that leaves a measured impact as a model says, flown to where it lands.

The comparison of Noël et al. 2018, § 5, flight by flight: same impact, same incident velocity, and then the model's
restituted velocity instead of the measured one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..constants import GRAVITY_MPS2
from ..errors import InputError
from ..georeference import GlobalShift
from ..reconstruction.drag import Drag
from ..reconstruction.impact import Impacts
from ..reconstruction.landing import LIMIT_S, STEP_S, Launches, find_landings, greatest_heights
from ..terrain.surface import Surface
from ..vectors import Array, Indices, Mask, Names, norm
from .comparison import Predictions

DEFAULT_CLEARING_M = 0.1
"""Where the radius of the block is not known."""


@dataclass(frozen=True, eq=False)
class PredictedFlights:
    """n flights, the rows of predicted_flights.csv; positions local.

    Attributes
    ----------
    model : (n,) names.
    replicate : (n,) 0 for the model's mean.
    site, trajectory, impact : (n,) the impact that the block leaves.
    time_s : (n,) of that impact [s].
    launches : the starts: position, the model's v2, drag.
    duration_s : (n,) of the flight to the terrain [s].
    landing, landing_velocity : (n, 3) [m], [m/s].
    height_m : (n,) greatest height above the terrain, vertically [m].
    into_ground, left_terrain : (n,) see `Landings`.
    measured_duration_s, measured_height_m : (n,) of the real flight; NaN where the next impact is not known.
    measured_landing : (n, 3) the next measured impact [m].
    shift : of the local frame.
    runs : column → (n,) which run of a simulation the impact is of, as in `Impacts.runs`.
    """

    model: Names
    replicate: Indices
    site: Names
    trajectory: Names
    impact: Indices
    time_s: Array
    launches: Launches
    duration_s: Array
    landing: Array
    landing_velocity: Array
    height_m: Array
    into_ground: Mask
    left_terrain: Mask
    measured_duration_s: Array
    measured_landing: Array
    measured_height_m: Array
    shift: GlobalShift = field(default_factory=GlobalShift)
    runs: Mapping[str, Names] = field(default_factory=dict)

    def __len__(self) -> int:
        return self.time_s.size

    @property
    def models(self) -> tuple[str, ...]:
        """The models there are, in order of first appearance."""
        return tuple(dict.fromkeys(self.model.tolist()))

    @property
    def length_m(self) -> Array:
        """(n,) straight distance from the impact to the landing [m]."""
        return norm(self.landing - self.launches.position)

    @property
    def duration_difference_s(self) -> Array:
        """(n,) predicted − measured [s]."""
        return self.duration_s - self.measured_duration_s

    @property
    def length_difference_m(self) -> Array:
        """(n,) predicted − measured [m]."""
        return self.length_m - norm(self.measured_landing - self.launches.position)

    @property
    def height_difference_m(self) -> Array:
        """(n,) predicted − measured [m]."""
        return self.height_m - self.measured_height_m

    @property
    def landing_offset_m(self) -> Array:
        """(n,) distance between the landing and the measured one [m]; NaN where it left the terrain."""
        return np.where(self.left_terrain, np.nan, norm(self.landing - self.measured_landing))

    def states(self, which: Indices, time_s: Array) -> tuple[Array, Array]:
        """Exact positions and velocities (q, 3) of the flights `which` (q,) at times (q,) on the common clock [s].

        Outside the flight the motion is continued.
        """
        return self.launches.states(which, np.asarray(time_s, dtype=np.float64) - self.time_s[which])


@dataclass(frozen=True)
class LandingScore:
    """How far the flights of one model's mean land from the real blocks.

    Attributes
    ----------
    n : flights with both landings.
    median_offset_m, p90_offset_m : distance between the landings [m].
    median_length_difference_m, median_duration_difference_s, median_height_difference_m : predicted − measured.
    into_ground, left_terrain : how many of the model's flights.
    """

    model: str
    n: int
    median_offset_m: float
    p90_offset_m: float
    median_length_difference_m: float
    median_duration_difference_s: float
    median_height_difference_m: float
    into_ground: int
    left_terrain: int


def fly_predictions(
    impacts: Impacts,
    predictions: Predictions,
    surface: Surface,
    *,
    gravity_mps2: float = GRAVITY_MPS2,
    drag: Drag | None = None,
    runs: Sequence[int] | None = (0,),
    beside: bool = True,
    step_s: float = STEP_S,
    limit_s: float = LIMIT_S,
) -> PredictedFlights:
    """Fly every predicted impact to the terrain, all at once.

    Parameters
    ----------
    impacts : the measured ones that `predictions` is of, in the terrain's frame or any other.
    drag : of air; None for parabolas.
    runs : which of the predictions' runs, 0 being the mean; None for all.
    beside : whether to find what the real flights are compared by: their durations, landings and heights, and the
        heights of the predicted ones. These are NaN without, which is quick.
    step_s, limit_s : see `find_landings`.

    Raises
    ------
    InputError : an impact has no position, or no block to compute the drag of.

    Notes
    -----
    A velocity into the ground gives a flight of no length. The real flight ends at the next impact of the table, where
    the chain is not cut between them.
    """
    runs = range(1 + predictions.replicates) if runs is None else runs
    position = surface.shift.to_local(impacts.shift.to_survey(impacts.position))
    row, kinds = predictions.row, len(predictions.models) * len(runs)
    _check_positions(impacts, row)
    drag_per_m = np.zeros(len(impacts)) if drag is None else _drag_per_m(impacts, row, drag)
    rows = np.tile(row, kinds)
    v2 = np.ascontiguousarray(predictions.v2[:, list(runs)].reshape(-1, 3))
    launches = Launches(position[rows], v2, drag_per_m[rows], gravity_mps2)
    into = predictions.into_ground[:, list(runs)].ravel()
    clearing = np.where(np.isfinite(impacts.diameter_m), impacts.diameter_m / 2, DEFAULT_CLEARING_M)[rows]

    duration, landing, velocity = np.zeros(rows.size), launches.position.copy(), v2.copy()
    left, height = np.zeros(rows.size, dtype=np.bool_), np.full(rows.size, 0.0 if beside else np.nan)
    free = np.flatnonzero(~into)
    flown = Launches(launches.position[free], v2[free], launches.drag_per_m[free], gravity_mps2)
    ends = find_landings(flown, surface, clearing[free], step_s=step_s, limit_s=limit_s)
    duration[free], landing[free], velocity[free] = ends.duration_s, ends.position, ends.velocity
    into[free], left[free] = ends.into_ground, ends.left_terrain
    measured_duration, measured_height = np.full(len(impacts), np.nan), np.full(len(impacts), np.nan)
    measured_landing = np.full((len(impacts), 3), np.nan)
    if beside:
        height[free] = greatest_heights(flown, ends.duration_s, surface)
        measured_duration, follower = _measured_flights(impacts)
        real = Launches(position[row], np.nan_to_num(impacts.v2[row]), drag_per_m[row], gravity_mps2)
        measured_height[row] = greatest_heights(real, measured_duration[row], surface)
        measured_landing = np.where((follower >= 0)[:, None], position[follower], np.nan)
    return PredictedFlights(
        model=np.repeat(np.array(predictions.models), len(runs) * row.size),
        replicate=np.tile(np.repeat(np.array(runs, dtype=np.intp), row.size), len(predictions.models)),
        site=impacts.site[rows],
        trajectory=impacts.trajectory[rows],
        impact=impacts.impact[rows],
        time_s=impacts.time_s[rows],
        launches=launches,
        duration_s=duration,
        landing=landing,
        landing_velocity=velocity,
        height_m=height,
        into_ground=into,
        left_terrain=left,
        measured_duration_s=measured_duration[rows],
        measured_landing=measured_landing[rows],
        measured_height_m=measured_height[rows],
        shift=surface.shift,
        runs={name: column[rows] for name, column in impacts.runs.items()},
    )


def select(flights: PredictedFlights, which: Indices | Mask) -> PredictedFlights:
    """Some of the flights."""
    start = flights.launches
    arrays: dict[str, Any] = {
        name: value[which] for name, value in vars(flights).items() if isinstance(value, np.ndarray)
    }
    launches = Launches(start.position[which], start.velocity[which], start.drag_per_m[which], start.gravity_mps2)
    runs = {name: column[which] for name, column in flights.runs.items()}
    return replace(flights, launches=launches, runs=runs, **arrays)


def score_landings(flights: PredictedFlights) -> tuple[LandingScore, ...]:
    """The flights of each model's mean against the real ones."""
    scores = []
    for model in flights.models:
        own = select(flights, (flights.model == model) & (flights.replicate == 0))
        both = np.isfinite(own.landing_offset_m)
        values = (own.landing_offset_m, own.length_difference_m, own.duration_difference_s, own.height_difference_m)
        offset, length, duration, height = (_median(each[both]) for each in values)
        p90 = float(np.quantile(own.landing_offset_m[both], 0.9)) if both.any() else np.nan
        lost = int(own.into_ground.sum()), int(own.left_terrain.sum())
        scores.append(LandingScore(model, int(both.sum()), offset, p90, length, duration, height, *lost))
    return tuple(scores)


def _measured_flights(impacts: Impacts) -> tuple[Array, Indices]:
    """(n,) duration of the real flight from each impact to the next [s], and the next one's row; NaN and −1 without."""
    n = len(impacts)
    duration, follower = np.full(n, np.nan), np.full(n, -1, dtype=np.intp)
    keys = zip(*(column.tolist() for column in impacts.falls), impacts.impact.tolist(), strict=True)
    place = {key: i for i, key in enumerate(keys)}
    known1, known2 = (np.isfinite(norm(values)) for values in (impacts.v1, impacts.v2))
    gap = impacts.flags["gap"]
    for (*fall, number), i in place.items():
        j = place.get((*fall, number + 1), -1)
        if j >= 0 and known2[i] and known1[j] and not gap[i] and not gap[j]:
            duration[i], follower[i] = impacts.time_s[j] - impacts.time_s[i], j
    return duration, follower


def _check_positions(impacts: Impacts, row: Indices) -> None:
    missing = row[np.isnan(norm(impacts.position[row]))]
    if missing.size:
        raise InputError(
            f"The position of impact {impacts.impact[missing[0]]} is not known",
            trajectory=str(impacts.trajectory[missing[0]]),
            advice="Give x_m, y_m, z_m in the table: the flights start there",
        )


def _drag_per_m(impacts: Impacts, row: Indices, drag: Drag) -> Array:
    """(n,) as `Drag.per_metre`, from diameter and mass."""
    result = drag.of_size(impacts.diameter_m, impacts.mass_kg)
    unknown = row[np.isnan(result[row])]
    if unknown.size:
        raise InputError(
            f"Diameter and mass of the block are not known at impact {impacts.impact[unknown[0]]}",
            trajectory=str(impacts.trajectory[unknown[0]]),
            advice="Give diameter_m and mass_kg in the table, or fly without drag",
        )
    return result


def _median(values: Array) -> float:
    return float(np.median(values)) if values.size else np.nan
