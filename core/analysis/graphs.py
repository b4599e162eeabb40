# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs as data: points, links, limits, what lies beyond them, what is under the pointer. Nothing is drawn here.

Blender's graph editor, the printed figures and the web page draw the same graphs. A selection is a set of rows of the
table of impacts, so one selection serves all graphs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..errors import InputError
from ..reconstruction.impact import Impacts
from ..vectors import Array, Indices, Mask
from .comparison import Predictions
from .curves import Curve, Trend, fit_curve, trend_of
from .variables import find_variable, measured_values, model_values

Limits = tuple[float, float]
Series = Literal["measured", "model"]
Selection = frozenset[int]
"""Rows of the table of impacts."""

REACH = 0.03
"""How far from the pointer a point is still hit, as a part of the axes' length."""
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True)
class GraphSpec:
    """What a graph shows.

    Attributes
    ----------
    name : short, for files and widgets.
    x, y : variables.
    x_log, y_log : logarithmic axes.
    x_limits, y_limits : of the axes; None takes them from the points.
    trend : the kind of curve that is fitted to the points; "auto" for the one that suits the variables and axes.
    """

    name: str
    x: str
    y: str
    x_log: bool = False
    y_log: bool = False
    x_limits: Limits | None = None
    y_limits: Limits | None = None
    trend: Trend = "auto"

    def __post_init__(self) -> None:
        find_variable(self.x)
        find_variable(self.y)
        for limits, log in ((self.x_limits, self.x_log), (self.y_limits, self.y_log)):
            if limits is not None and not (np.isfinite(limits).all() and limits[0] < limits[1]):
                raise InputError(f"An axis cannot go from {limits[0]:g} to {limits[1]:g}", advice="Swap the limits")
            if limits is not None and log and limits[0] <= 0:
                raise InputError(f"A logarithmic axis cannot start at {limits[0]:g}", advice="Start it above zero")

    @property
    def fitted(self) -> Trend:
        """The kind of curve, where "auto" is resolved."""
        return trend_of(self.x, self.y, self.x_log, self.y_log) if self.trend == "auto" else self.trend


PAPER_GRAPHS = (
    GraphSpec("rn_theta1", "theta1_deg", "rn", y_limits=(0.0, 5.0)),
    GraphSpec("rn_vn1", "vn1_mps", "rn", y_limits=(0.0, 5.0)),
    GraphSpec("vt2_vt1", "vt1_mps", "vt2_mps"),
    GraphSpec("r_theta_dev", "theta_dev_deg", "r"),
)
"""The graphs of Noël et al. 2018, Fig. 8, whose R_N axis ends at 5; what lies beyond is listed."""


@dataclass(frozen=True)
class Beyond:
    """A point that its graph's axes cut off."""

    row: int
    series: Series
    x: float
    y: float


@dataclass(frozen=True)
class Hit:
    """The point under the pointer; `distance` in parts of the axes' length."""

    row: int
    series: Series
    distance: float


@dataclass(frozen=True, eq=False)
class Graph:
    """One graph of m impacts.

    Attributes
    ----------
    spec : what it shows.
    model : name; "" when only what was measured is shown.
    run : of the model; 0 is its mean.
    row : (m,) rows of the table of impacts.
    measured, modelled : (m, 2) x and y in the variables' units; NaN where undefined.
    x_limits, y_limits : of the axes.
    measured_curve, modelled_curve : the fitted trends; None where none is wanted or there are no points. That of the
        model has no interval.
    """

    spec: GraphSpec
    model: str
    run: int
    row: Indices
    measured: Array
    modelled: Array
    x_limits: Limits
    y_limits: Limits
    measured_curve: Curve | None
    modelled_curve: Curve | None

    @property
    def series(self) -> tuple[tuple[Series, Array], ...]:
        """Names and points."""
        return ("measured", self.measured), ("model", self.modelled)

    @property
    def linked(self) -> Mask:
        """(m,) impacts that have both points."""
        return _finite(self.measured) & _finite(self.modelled)

    @property
    def links(self) -> Array:
        """(k, 2, 2) from the measured to the model's point, for the `linked` impacts."""
        return np.stack([self.measured[self.linked], self.modelled[self.linked]], axis=1)

    @property
    def beyond(self) -> tuple[Beyond, ...]:
        """The points outside the axes, the farthest first."""
        found = [
            Beyond(int(self.row[i]), name, float(points[i, 0]), float(points[i, 1]))
            for name, points in self.series
            for i in np.flatnonzero(_finite(points) & ~self.inside(points))
        ]
        return tuple(sorted(found, key=lambda point: (-point.y, -point.x)))

    def placed(self, points: Array) -> Array:
        """(m, 2) → the same on axes from 0 to 1; NaN where a logarithmic axis has no place."""
        axes = zip((self.x_limits, self.y_limits), (self.spec.x_log, self.spec.y_log), strict=True)
        return np.stack([_placed(points[:, i], limits, log) for i, (limits, log) in enumerate(axes)], axis=1)

    def inside(self, points: Array) -> Mask:
        """(m,) whether points are within the axes."""
        place = self.placed(points)
        return np.asarray(((place >= 0.0) & (place <= 1.0)).all(axis=1))


def make_graph(
    impacts: Impacts,
    spec: GraphSpec,
    predictions: Predictions | None = None,
    model: str = "",
    run: int = 0,
    row: Indices | None = None,
) -> Graph:
    """The graph of measured impacts, and of one model's run on them.

    Parameters
    ----------
    predictions, model : None and "" for the measured impacts alone.
    run : 0 for the model's mean, else the replicate.
    row : (m,) the impacts that are shown, of those that the model was asked about; None for all.

    Raises
    ------
    InputError : the model was not compared, or has no such run.
    """
    return _with_curves(_unfitted(impacts, spec, predictions, model, run, row))


def make_sheet(
    impacts: Impacts, predictions: Predictions, specs: Sequence[GraphSpec] = PAPER_GRAPHS, run: int | None = None
) -> tuple[tuple[Graph, ...], ...]:
    """Models × graphs; the graphs of a column share their limits.

    Parameters
    ----------
    run : None for one draw per impact (the first replicate) when there are replicates, else the mean.
    """
    run = min(1, predictions.replicates) if run is None else run
    columns = []
    for spec in specs:
        graphs = [_unfitted(impacts, spec, predictions, model, run) for model in predictions.models]
        x = min(graph.x_limits[0] for graph in graphs), max(graph.x_limits[1] for graph in graphs)
        y = min(graph.y_limits[0] for graph in graphs), max(graph.y_limits[1] for graph in graphs)
        graphs = [replace(graph, x_limits=x, y_limits=y) for graph in graphs]
        measured = _curve(graphs[0], graphs[0].measured, interval=True) if graphs else None
        columns.append(
            [
                replace(graph, measured_curve=measured, modelled_curve=_curve(graph, graph.modelled, interval=False))
                for graph in graphs
            ]
        )
    return tuple(zip(*columns, strict=True))


def nearest(graph: Graph, x: float, y: float, *, reach: float = REACH, aspect: float = 1.0) -> Hit | None:
    """The visible point nearest to a place, in distances along the axes; None when none is within `reach`.

    Parameters
    ----------
    x, y : in the variables' units.
    reach : in parts of the y axis' length.
    aspect : the drawn width of the graph divided by its height.
    """
    pointer = graph.placed(np.array([[x, y]]))[0]
    best: Hit | None = None
    for name, points in graph.series:
        place = graph.placed(points)
        distance = np.hypot((place[:, 0] - pointer[0]) * aspect, place[:, 1] - pointer[1])
        distance = np.where(graph.inside(points) & np.isfinite(distance), distance, np.inf)
        i = int(np.argmin(distance)) if distance.size else -1
        if i >= 0 and distance[i] <= (best.distance if best else reach):
            best = Hit(int(graph.row[i]), name, float(distance[i]))
    return best


def in_box(graph: Graph, x: Limits, y: Limits) -> Selection:
    """The impacts with a visible point, measured or the model's, in a box; its corners in any order."""
    low, high = np.sort(np.array([x, y]), axis=1).T
    chosen = np.zeros(graph.row.size, dtype=np.bool_)
    for _, points in graph.series:
        chosen |= graph.inside(points) & ((points >= low) & (points <= high)).all(axis=1)
    return frozenset(graph.row[chosen].tolist())


def axis_limits(values: Array, log: bool = False) -> Limits:
    """Round limits that hold all values; a linear axis starts at zero unless values are negative or far from it."""
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    if not values.size:
        return (0.1, 10.0) if log else (0.0, 1.0)
    low, high = float(values.min()), float(values.max())
    if log:
        bottom, top = float(10 ** np.floor(np.log10(low))), float(10 ** np.ceil(np.log10(high)))
        return (bottom, top) if bottom < top else (bottom / 10, top * 10)
    if 0.0 <= low <= high / 2:
        low = 0.0
    step = _round_step((high - low) or abs(high) or 1.0)
    bottom, top = float(np.floor(low / step) * step), float(np.ceil(high / step - 1e-9) * step)
    return (bottom, top) if bottom < top else (bottom - step, top + step)


def _round_step(span: float) -> float:
    power = float(10.0 ** np.floor(np.log10(span / 5)))
    return next(step * power for step in ROUND_STEPS if step * power >= span / 10 * (1 - 1e-9))


def _placed(values: Array, limits: Limits, log: bool) -> Array:
    if log:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.log(np.where(values > 0, values, np.nan))
        limits = (float(np.log(limits[0])), float(np.log(limits[1])))
    return (values - limits[0]) / (limits[1] - limits[0])


def _unfitted(
    impacts: Impacts,
    spec: GraphSpec,
    predictions: Predictions | None,
    model: str,
    run: int,
    row: Indices | None = None,
) -> Graph:
    """The graph without curves."""
    asked = np.arange(len(impacts)) if predictions is None else predictions.row
    among = np.ones(asked.size, dtype=np.bool_) if row is None else np.isin(asked, row)
    row = asked[among]
    measured = np.stack([measured_values(impacts, row, name) for name in (spec.x, spec.y)], axis=1)
    modelled = np.full_like(measured, np.nan)
    if predictions is not None and model:
        if not 0 <= run <= predictions.replicates:
            raise InputError(f"There is no replicate {run}", advice=f"There are {predictions.replicates}")
        which = predictions.index(model)
        columns = [model_values(impacts, predictions, which, run, name)[among] for name in (spec.x, spec.y)]
        modelled = np.stack(columns, axis=1)
    points = np.concatenate([measured, modelled])
    points = points[_finite(points)]
    limits = (
        spec.x_limits or axis_limits(points[:, 0], spec.x_log),
        spec.y_limits or axis_limits(points[:, 1], spec.y_log),
    )
    return Graph(spec, model, run, row, measured, modelled, *limits, None, None)


def _with_curves(graph: Graph) -> Graph:
    measured = _curve(graph, graph.measured, interval=True)
    return replace(graph, measured_curve=measured, modelled_curve=_curve(graph, graph.modelled, interval=False))


def _curve(graph: Graph, points: Array, interval: bool) -> Curve | None:
    points = points[_finite(points)]
    return fit_curve(graph.spec.fitted, points, graph.x_limits, graph.y_limits, interval=interval)


def _finite(points: Array) -> Mask:
    return np.asarray(np.isfinite(points).all(axis=1))
