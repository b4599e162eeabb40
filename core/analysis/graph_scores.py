# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a graph's model points are from the measured points that they are linked to: the scores beside a graph."""

from dataclasses import dataclass

import numpy as np

from ..vectors import Array, Indices
from .curves import number
from .graphs import Graph
from .scores import rmse_interval
from .variables import find_variable


@dataclass(frozen=True)
class GraphScore:
    """Model − measured along one axis of a graph, over the impacts that have both points.

    Attributes
    ----------
    variable : on the axis, whose unit all numbers have.
    n, falls : impacts, and the falls that they belong to.
    bias, rmse, median_error : mean, root mean square and median size of the differences.
    rmse_low, rmse_high : 95 % interval of the root mean square, by falls; NaN with fewer than two.
    """

    variable: str
    n: int
    falls: int
    bias: float
    rmse: float
    rmse_low: float
    rmse_high: float
    median_error: float

    def text(self) -> str:
        """For people, with the interval."""
        if not self.n:
            return "no impact has both points"
        unit = find_variable(self.variable).unit
        unit = unit if unit in ("", "°") else f" {unit}"
        interval = f" ({number(self.rmse_low)}–{number(self.rmse_high)})" if np.isfinite(self.rmse_low) else ""
        bias = f"{'+' if self.bias > 0 else ''}{number(self.bias)}"
        return (
            f"RMSE {number(self.rmse)}{interval}{unit}, bias {bias}{unit}, "
            f"median error {number(self.median_error)}{unit}, n = {self.n}"
        )


def graph_scores(graph: Graph, fall: Indices) -> tuple[GraphScore, ...]:
    """Of the ordinate, and of the abscissa where the model has a value of its own for it; none without a model.

    Points that the axes cut off count.

    Parameters
    ----------
    fall : (n,) number of the fall of each row of the table of impacts, from `fall_numbers`.
    """
    if not graph.model:
        return ()
    linked = graph.linked
    of = fall[graph.row[linked]]
    axes = [(1, graph.spec.y)]
    if find_variable(graph.spec.x).restituted and graph.spec.x != graph.spec.y:
        axes.append((0, graph.spec.x))
    return tuple(_score(name, (graph.modelled - graph.measured)[linked, axis], of) for axis, name in axes)


def _score(variable: str, error: Array, fall: Indices) -> GraphScore:
    if not error.size:
        return GraphScore(variable, 0, 0, *[float("nan")] * 5)
    rmse = float(np.sqrt(np.mean(error**2)))
    low, high, falls = rmse_interval(error**2, fall)
    return GraphScore(
        variable,
        error.size,
        falls,
        float(error.mean()),
        rmse,
        rmse * low,
        rmse * high,
        float(np.median(np.abs(error))),
    )
