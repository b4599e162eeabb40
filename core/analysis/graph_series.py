# SPDX-License-Identifier: GPL-3.0-or-later
"""The points of a graph by their source: the impacts that were measured here or elsewhere, and those of each model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, Mask
from .axes import Limits
from .comparison import Predictions
from .graphs import GraphSpec, axis_limits
from .variables import measured_values, model_values

USUAL_LIMITS = {"rn": (0.0, 5.0)}
"""Of an axis whose farthest values would press the others together (Noël et al. 2018 cut R_N at 5)."""


@dataclass(frozen=True, eq=False)
class Series:
    """Points of one source.

    Attributes
    ----------
    title : in words.
    model : name; "" for measured impacts.
    source : 0 for the scene's own impacts, or those of the first table, i for the i-th further table.
    row : (n,) of the table of impacts of that source.
    points : (n, 2); NaN where undefined.
    """

    title: str
    model: str
    source: int
    row: Indices
    points: Array

    @cached_property
    def defined(self) -> Mask:
        """(n,) points that have a place."""
        return np.asarray(np.isfinite(self.points).all(axis=1))

    @cached_property
    def corners(self) -> Array:
        """(2, 2) the least and the greatest of the points that have a place; (0, 2) without one."""
        points = self.points[self.defined]
        return np.stack([points.min(axis=0), points.max(axis=0)]) if len(points) else points


def measured_series(impacts: Impacts, x: str, y: str, row: Indices, title: str = "", source: int = 0) -> Series:
    """The measured points of some rows of a table."""
    points = np.stack([measured_values(impacts, row, name) for name in (x, y)], axis=1)
    return Series(title, "", source, row, points)


def model_series(
    impacts: Impacts,
    predictions: Predictions,
    model: str,
    runs: Sequence[int],
    x: str,
    y: str,
    kept: Mask,
    title: str = "",
) -> Series:
    """The points of some runs of a model, one run after the other.

    kept : (n,) rows of `impacts` that are shown.
    """
    which, shown = predictions.index(model), np.flatnonzero(kept[predictions.row])
    columns = [
        [model_values(impacts, predictions, which, run, name)[shown] for name in (x, y)]
        for run in runs
        if run <= predictions.replicates
    ]
    points = np.concatenate([np.stack(pair, axis=1) for pair in columns]) if columns else np.empty((0, 2))
    return Series(title, model, 0, np.tile(predictions.row[shown], len(columns)), points)


def pair_links(measured: Series, model: Series) -> Array:
    """(k, 2, 2) from each measured point to those of the model that belong to it."""
    where = np.full(1 + max((int(one.row.max()) for one in (measured, model) if one.row.size), default=0), -1)
    where[measured.row] = np.arange(measured.row.size)
    partner = where[model.row]
    links = np.stack([measured.points[partner], model.points], axis=1)[partner >= 0]
    return np.asarray(links[np.isfinite(links).all(axis=(1, 2))])


def whole_limits(series: Sequence[Series], log: tuple[bool, bool]) -> tuple[Limits, Limits]:
    """Round limits of both axes that hold all points."""
    points = np.concatenate([np.empty((0, 2)), *(_corners(one, log) for one in series)])
    return axis_limits(points[:, 0], log[0]), axis_limits(points[:, 1], log[1])


def _corners(series: Series, log: tuple[bool, bool]) -> Array:
    """`Series.corners` of the points that have a place on such axes."""
    if not any(log):
        return series.corners
    seen = ((series.points > 0) | ~np.array(log)).all(axis=1)
    return replace(series, row=series.row[seen], points=series.points[seen]).corners


def usual_limits(spec: GraphSpec, whole: tuple[Limits, Limits]) -> tuple[Limits, Limits]:
    """Those of the spec where it has some; else a variable's usual ones where points lie beyond; else the whole."""
    found = []
    for name, log, given, limits in (
        (spec.x, spec.x_log, spec.x_limits, whole[0]),
        (spec.y, spec.y_log, spec.y_limits, whole[1]),
    ):
        usual = USUAL_LIMITS.get(name)
        cut = usual is not None and not log and limits[1] > usual[1]
        found.append(given if given is not None else usual if usual is not None and cut else limits)
    return found[0], found[1]


def beyond(series: Series, x: Limits, y: Limits) -> Indices:
    """(k,) the points of a series that lie outside of the axes, those with the greatest y first."""
    points = series.points
    with np.errstate(invalid="ignore"):
        inside = (points[:, 0] >= x[0]) & (points[:, 0] <= x[1]) & (points[:, 1] >= y[0]) & (points[:, 1] <= y[1])
    found = np.flatnonzero(series.defined & ~inside)
    return np.asarray(found[np.lexsort((-points[found, 0], -points[found, 1]))], dtype=np.intp)
