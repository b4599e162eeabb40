# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of what graphs of impacts show."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..vectors import Array, Indices, Names
from .tables import Columns, write_columns


@dataclass(frozen=True, eq=False)
class GraphPoints:
    """The n points of one series in one graph.

    Attributes
    ----------
    graph : its number, from 1.
    series : "measured", or the model's title.
    site, trajectory, impact : (n,) of which impact each point is.
    x, y : variables.
    points : (n, 2) in their units; NaN where not defined.
    """

    graph: int
    series: str
    site: Names
    trajectory: Names
    impact: Indices
    x: str
    y: str
    points: Array


def write_graph_points(series: Sequence[GraphPoints], path: str | Path) -> None:
    """Write a row for each point of each graph, that has both values."""
    columns: Columns = {
        name: []
        for name in ("graph", "series", "site", "trajectory", "impact", "x_variable", "x", "y_variable", "y")
    }  # fmt: skip
    for one in series:
        kept = np.flatnonzero(np.isfinite(one.points).all(axis=1))
        rows = {
            "graph": [str(one.graph)] * kept.size,
            "series": [one.series] * kept.size,
            "site": one.site[kept].tolist(),
            "trajectory": one.trajectory[kept].tolist(),
            "impact": [str(number) for number in one.impact[kept].tolist()],
            "x_variable": [one.x] * kept.size,
            "x": [repr(value) for value in one.points[kept, 0].tolist()],
            "y_variable": [one.y] * kept.size,
            "y": [repr(value) for value in one.points[kept, 1].tolist()],
        }
        for name, cells in rows.items():
            columns[name] = [*columns[name], *cells]
    write_columns(path, columns)
