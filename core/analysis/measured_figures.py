# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of measured impacts alone, as Noël et al. 2018, Fig. 4–7, or of their groups in colours and shapes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extras import FIGURES, demand
from ..reconstruction.impact import Impacts
from .curves import number
from .figures import (
    COLUMN_IN,
    FORMATS,
    INK,
    MEASURED,
    MUTED,
    PAGE_IN,
    STYLE,
    beyond_lines,
    curve_text,
    save_named,
    shorten,
)
from .graphs import PAPER_GRAPHS, Graph, GraphSpec, make_graph
from .group_statistics import Grouping
from .statistics import FEWEST_FOR_LAW, usable
from .variables import find_variable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""Of groups: after Okabe & Ito 2008, distinct with any colour vision; the shapes tell them apart in grey."""
OTHERS, OTHERS_MARKER = "#b4b9c1", "."
MOST_EQUATIONS = 4
"""With more groups their equations do not fit into a graph; they are in the table."""
MOST_VECTORS = 4000
"""More points than these are a picture within the vector graphics."""


@dataclass(frozen=True, eq=False)
class Series:
    """The points of one group in one graph."""

    name: str
    graph: Graph
    colour: str
    marker: str


def save_measured_figures(
    impacts: Impacts,
    folder: str | Path,
    specs: Sequence[GraphSpec] = (),
    grouping: Grouping | None = None,
    formats: Sequence[str] = FORMATS[:1],
) -> tuple[Path, ...]:
    """Write the sheet `measured` with the paper's graphs, and a figure of each of `specs`.

    Parameters
    ----------
    grouping : the same again with each group in its colour, in files that end in _groups; None for no groups.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    return save_named(_figures(impacts, specs, grouping), folder, formats)


def _figures(impacts: Impacts, specs: Sequence[GraphSpec], grouping: Grouping | None) -> "Iterator[tuple[str, Figure]]":
    every = {spec.name: spec for spec in specs}
    for suffix, groups in (("", None), ("_groups", grouping)):
        if suffix and groups is None:
            continue
        yield f"measured{suffix}", measured_figure(impacts, PAPER_GRAPHS, groups)
        for name, spec in every.items():
            yield f"{name}{suffix}", measured_figure(impacts, [spec], groups)


def measured_figure(impacts: Impacts, specs: Sequence[GraphSpec], grouping: Grouping | None = None) -> "Figure":
    """Graphs of the measured impacts, two beside each other; one alone has the width of a column.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    alone = len(specs) == 1
    rows = (len(specs) + 1) // 2
    with rc_context(STYLE):
        size = (COLUMN_IN, 2.75) if alone else (PAGE_IN, 0.35 + 2.55 * rows)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, 1 if alone else 2, squeeze=False).ravel()
        series: list[Series] = []
        for each, spec in zip(axes, specs, strict=False):
            series = _series(impacts, spec, grouping)
            _draw(each, series)
        for each in axes[len(specs) :]:
            each.set_axis_off()
        if grouping is not None:
            _legend(figure, series, grouping.column, columns=3 if alone else 6)
        elif not alone:
            figure.suptitle("Measured impacts", fontsize=8.5, fontweight="bold", x=0.012, ha="left")
        return figure


def _series(impacts: Impacts, spec: GraphSpec, grouping: Grouping | None) -> list[Series]:
    """All points in black; or the largest groups each in its colour, the others together in grey and behind."""
    used = usable(impacts)
    whole = make_graph(impacts, spec, row=np.flatnonzero(used))
    if grouping is None:
        return [Series("measured", whole, MEASURED, "o")]
    names, group = grouping.names, grouping.number
    counts = np.bincount(group[used & (group >= 0)], minlength=len(names))
    largest = sorted(np.argsort(-counts, kind="stable")[: len(COLOURS)].tolist())
    fixed = {"x_limits": whole.x_limits, "y_limits": whole.y_limits, "x_log": spec.x_log, "y_log": spec.y_log}
    same = GraphSpec(spec.name, spec.x, spec.y, trend=spec.trend, **fixed)  # type: ignore[arg-type]
    series = []
    bare = GraphSpec(spec.name, spec.x, spec.y, trend="none", **fixed)  # type: ignore[arg-type]
    rest = used & ~np.isin(group, largest)
    if rest.any():
        series.append(Series("others", make_graph(impacts, bare, row=np.flatnonzero(rest)), OTHERS, OTHERS_MARKER))
    for place, i in enumerate(largest):
        if counts[i]:
            shown = same if counts[i] >= FEWEST_FOR_LAW else bare
            graph = make_graph(impacts, shown, row=np.flatnonzero(used & (group == i)))
            series.append(Series(names[i], graph, COLOURS[place], MARKERS[place]))
    return series


def _draw(axes: "Axes", series: Sequence[Series]) -> None:
    graph = series[0].graph
    spec, points = graph.spec, sum(one.graph.row.size for one in series)
    axes.set_xscale("log" if spec.x_log else "linear")
    axes.set_yscale("log" if spec.y_log else "linear")
    axes.set_xlim(graph.x_limits)
    axes.set_ylim(graph.y_limits)
    if spec.y == "rn" and graph.y_limits[0] < 1.0 < graph.y_limits[1]:
        axes.axhline(1.0, color=MUTED, linewidth=0.5, linestyle=(0, (4, 3)), zorder=1)
    if points > MOST_VECTORS:
        _crowd(axes, series)
    else:
        common: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0, "markersize": 3.3, "alpha": 0.85}
        for one in series:
            axes.plot(*one.graph.measured.T, marker=one.marker, color=one.colour, zorder=3, **common)
    notes = []
    for one in series:
        curve = one.graph.measured_curve
        if curve is None:
            continue
        if curve.is_fitted:
            axes.plot(curve.x, curve.y, color="white", linewidth=1.9, zorder=4)
            axes.plot(curve.x, curve.y, color=one.colour, linewidth=1.2, zorder=5)
        text = curve_text(curve, one.graph)
        notes.append((text if len(series) == 1 else f"{one.name}: {text}", one.colour))
        if len(series) == 1 and curve.is_fitted:
            what = "exponent" if curve.trend in ("power", "exponential") else "slope"
            notes.append((f"95 % of the {what}: {number(curve.fit.low)} to {number(curve.fit.high)}", MUTED))
    if len(notes) > MOST_EQUATIONS:
        notes = []
    beyond = [forms for one in series for forms in beyond_lines(one.graph)]
    _write_above(axes, [*(((text,), colour) for text, colour in notes), *((forms, MUTED) for forms in beyond[:1])])
    x, y = find_variable(spec.x), find_variable(spec.y)
    axes.set_xlabel(x.tex_label)
    axes.set_ylabel(y.tex_label)


def _crowd(axes: "Axes", series: Sequence[Series]) -> None:
    """Very many points as small dots, the groups mixed so that none hides the others."""
    from matplotlib.colors import to_rgb

    points = np.concatenate([one.graph.measured for one in series])
    colours = np.repeat([to_rgb(one.colour) for one in series], [one.graph.row.size for one in series], axis=0)
    order = np.random.default_rng(0).permutation(len(points))
    x, y = points[order].T
    axes.scatter(x, y, s=1.5, c=colours[order], alpha=0.3, linewidths=0, rasterized=True, zorder=3)


def _write_above(axes: "Axes", notes: Sequence[tuple[tuple[str, ...], str]]) -> None:
    """Lines of text above a graph, where they hide no point; each in several forms, the longest first."""
    for i, (forms, colour) in enumerate(reversed(notes)):
        note = axes.annotate(
            forms[0],
            (1.0, 1.0),
            (0.0, 2.5 + 7.8 * i),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="right",
            va="bottom",
            color=colour,
            fontsize=6.0,
        )
        shorten(note, forms, axes)


def _legend(figure: "Figure", series: Sequence[Series], title: str, columns: int) -> None:
    from matplotlib.lines import Line2D

    common: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0, "markersize": 4.0}
    handles = [
        Line2D([], [], marker=one.marker, color=one.colour, label=f"{one.name} ({one.graph.row.size})", **common)
        for one in sorted(series, key=lambda one: one.colour == OTHERS)
    ]
    figure.legend(
        handles=handles,
        loc="outside upper left",
        ncols=columns,
        frameon=False,
        title=title,
        alignment="left",
        title_fontproperties={"size": 7.5, "weight": "bold"},
        fontsize=6.5,
        labelcolor=INK,
        handletextpad=0.2,
        columnspacing=1.2,
    )
