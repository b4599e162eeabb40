# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of whole runs: what was observed in black, what each model makes of the same releases in its colour."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extras import FIGURES, demand
from ..impact_models.registry import find_model
from ..simulation.ground import Ground
from ..vectors import Array, norm
from .figures import FORMATS, MEASURED, MUTED, PAGE_IN, STYLE, save_named
from .paths import Paths
from .run_measures import AT_SECTIONS, OF_RUNS, Quantity
from .sections import Axis
from .whole_runs import Compared, WholeRuns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLANES = 48
"""Across the axis, at which the simulated runs are looked at for their envelopes."""
FEWEST_DRAWN = 20
MOST_IN_ENVELOPE = 1500
"""So many runs of a model show its envelope."""
ON_A_FLIGHT = 9
LIGHTEST = 0.62
"""Relative luminance of the lightest line on white."""
ENVELOPE = (0.05, 0.25, 0.5, 0.75, 0.95)


def save_whole_run_figures(
    comparison: WholeRuns, ground: Ground, folder: str | Path, formats: Sequence[str] = FORMATS[:1]
) -> tuple[Path, ...]:
    """Write profiles, sections and whole_runs into a folder; returns the files.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    return save_named(_figures(comparison, ground), folder, formats)


def _figures(comparison: WholeRuns, ground: Ground) -> "Iterator[tuple[str, Figure]]":
    if comparison.observed.impact_piece.size:
        yield "profiles", profile_figure(comparison, ground)
    if comparison.sections:
        yield "sections", section_figure(comparison)
    yield "whole_runs", run_figure(comparison)


def profile_figure(comparison: WholeRuns, ground: Ground) -> "Figure":
    """Speed and height against the distance along the axis, one row for each model."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    models = tuple(comparison.simulated)
    observed = _observed_lines(comparison, ground)
    envelopes = {model: _envelope(comparison.simulated[model], comparison.axis, ground, observed) for model in models}
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 0.55 + 1.35 * len(models)), layout="constrained")
        grid = figure.subplots(len(models), 2, squeeze=False, sharex=True, sharey="col")
        for row, model in zip(grid, models, strict=True):
            colour, envelope = model_colour(model), envelopes[model]
            for axes, quantiles, lines in zip(row, (envelope.speed, envelope.height), observed.lines, strict=True):
                for (low, high), shade in (((0, 4), 0.22), ((1, 3), 0.33)):
                    axes.fill_between(
                        envelope.x, quantiles[:, low], quantiles[:, high], color=colour, alpha=shade, linewidth=0
                    )
                axes.plot(envelope.x, quantiles[:, 2], color=colour, linewidth=1.6)
                for x, y in lines:
                    axes.plot(x, y, color=MEASURED, linewidth=0.55, alpha=0.85)
                axes.set_ylim(0, None)
            row[0].set_title(find_model(model).title, fontsize=7.5, fontweight="bold", loc="left", pad=4.0)
            row[0].set_ylabel("speed [m/s]")
            row[1].set_ylabel("height [m]")
        tops = [np.nanmax([np.nanmax(getattr(one, name)[:, 4], initial=0) for one in envelopes.values()]) for name in
                ("speed", "height")]  # fmt: skip
        for axes, top, lines in zip(grid[0], tops, observed.lines, strict=True):
            seen = max((float(np.nanmax(y)) for _, y in lines), default=0.0)
            axes.set_ylim(0, 1.05 * max(top, seen))
        for axes in grid[-1]:
            axes.set_xlabel("distance along the mean direction [m]")
            axes.set_xlim(*observed.reach)
        _legend(figure, [("observed", {"color": MEASURED, "linewidth": 0.8}), *_bands()])
        return figure


def section_figure(comparison: WholeRuns) -> "Figure":
    """Cumulative curves at each section (rows) of what blocks do there (columns)."""
    quantities = [quantity for quantity in AT_SECTIONS if quantity.tested]
    names = [section.name for section in comparison.sections]
    return _curves(comparison, [[(name, quantity) for quantity in quantities] for name in names], names)


def run_figure(comparison: WholeRuns) -> "Figure":
    """Cumulative curves of what concerns whole runs."""
    cells: list[tuple[str, Quantity]] = [("", quantity) for quantity in OF_RUNS]
    model = next(iter(comparison.simulated))
    cells = [cell for cell in cells if comparison.find(model, "", cell[1].name).n]
    return _curves(comparison, [cells[i : i + 3] for i in range(0, len(cells), 3)], None)


def _curves(
    comparison: WholeRuns, rows: Sequence[Sequence[tuple[str, Quantity]]], titles: Sequence[str] | None
) -> "Figure":
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    models = tuple(comparison.simulated)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 0.75 + 1.75 * len(rows)), layout="constrained")
        grid = figure.subplots(len(rows), max(len(row) for row in rows), squeeze=False, sharey=True)
        for i, (axes_row, row) in enumerate(zip(grid, rows, strict=True)):
            for axes, (section, quantity) in zip(axes_row, row, strict=False):
                _curve(axes, [comparison.find(model, section, quantity.name) for model in models])
                axes.set_xlabel(f"{quantity.title} [{quantity.unit}]")
            for axes in axes_row[len(row) :]:
                axes.set_axis_off()
            axes_row[0].set_ylabel("share of the blocks below")
            if titles is not None:
                axes_row[0].set_title(titles[i], fontsize=7.5, fontweight="bold", loc="left", pad=6.0)
        lines = [(find_model(model).title, {"color": model_colour(model), "linewidth": 1.4}) for model in models]
        observed = {"color": MEASURED, "linewidth": 1.0, "marker": "o", "markersize": 2.4}
        _legend(figure, [("observed", observed), *lines])
        return figure


def _curve(axes: "Axes", parts: Sequence[Compared]) -> None:
    """The cumulative curves of one quantity."""
    from matplotlib.ticker import MaxNLocator

    observed = np.sort(parts[0].observed[np.isfinite(parts[0].observed)])
    drawn = [one for one in parts if one.simulated.size >= FEWEST_DRAWN]
    spans = [np.quantile(one.simulated, [0.01, 0.99]) for one in drawn]
    for one in drawn:
        values = np.sort(one.simulated)
        share = (np.arange(values.size) + 0.5) / values.size
        axes.plot(values, share, color=model_colour(one.model), linewidth=1.3, zorder=2)
    if observed.size:
        share = np.arange(observed.size + 1) / observed.size
        axes.plot(np.repeat(observed, 2), np.repeat(share, 2)[1:-1], color=MEASURED, linewidth=0.9, zorder=3)
        axes.plot(
            observed, (share[1:] + share[:-1]) / 2, "o", color=MEASURED, markersize=2.4, markeredgewidth=0, zorder=4
        )
    else:
        axes.text(0.5, 0.5, "none observed", transform=axes.transAxes, ha="center", color=MUTED, fontsize=6.5)
    ends = np.concatenate([*spans, observed]) if spans or observed.size else np.array([0.0, 1.0])
    room = 0.04 * max(float(np.ptp(ends)), 1e-6)
    axes.set_xlim(float(ends.min()) - room, float(ends.max()) + room)
    axes.set_ylim(-0.02, 1.02)
    axes.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.grid(visible=True, color="#e6e8eb", linewidth=0.4)
    axes.set_axisbelow(True)


@dataclass(frozen=True, eq=False)
class _Observed:
    """Lines of speed and of height along the axis, and how far they reach."""

    lines: tuple[list[tuple[Array, Array]], list[tuple[Array, Array]]]
    reach: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Envelope:
    """(p,) places along the axis, and (p, 5) quantiles there."""

    x: Array
    speed: Array
    height: Array


def _observed_lines(comparison: WholeRuns, ground: Ground) -> _Observed:
    paths = comparison.observed
    piece = np.repeat(np.arange(paths.run.size), ON_A_FLIGHT)
    part = np.tile(np.linspace(0.0, 1.0, ON_A_FLIGHT), paths.run.size)
    place, velocity = paths.states(piece, part * paths.duration_s[piece])
    along, speed, height = comparison.axis.along(place), norm(velocity), ground.heights_above(place)
    first = paths.first_piece * ON_A_FLIGHT
    speeds, heights = [], []
    for low, high in pairwise(first.tolist()):
        speeds.append((along[low:high], speed[low:high]))
        heights.append((along[low:high], np.maximum(height[low:high], 0.0)))
    room = 0.02 * float(np.ptp(along))
    return _Observed((speeds, heights), (float(along.min()) - room, float(along.max()) + room))


def _envelope(paths: Paths, axis: Axis, ground: Ground, observed: _Observed) -> _Envelope:
    """Quantiles of the first passages of planes across the axis."""
    if len(paths) > MOST_IN_ENVELOPE:
        paths = paths.take(np.unique(np.linspace(0, len(paths) - 1, MOST_IN_ENVELOPE).astype(np.intp)))
    start, end = axis.along(paths.start), axis.along(paths.end)
    x = np.linspace(*observed.reach, PLANES)
    speed, height = np.full((PLANES, len(ENVELOPE)), np.nan), np.full((PLANES, len(ENVELOPE)), np.nan)
    for i, plane in enumerate(x.tolist()):
        piece = np.flatnonzero((start <= plane) & (end > plane))
        _, nearest = np.unique(paths.run[piece], return_index=True)
        piece = piece[nearest]
        if piece.size < FEWEST_DRAWN:
            continue
        share = (plane - start[piece]) / (end[piece] - start[piece])
        place, velocity = paths.states(piece, paths.when_across(piece, share))
        speed[i] = np.quantile(norm(velocity), ENVELOPE)
        above = ground.heights_above(place)
        height[i] = np.nanquantile(np.maximum(above, 0.0), ENVELOPE)
    return _Envelope(x, speed, height)


def model_colour(model: str) -> tuple[float, float, float]:
    """The model's colour, dark enough for a line on white."""
    colour = np.array(find_model(model).colour)
    light = float(colour @ [0.2126, 0.7152, 0.0722])
    red, green, blue = (colour * min(1.0, LIGHTEST / light)).tolist()
    return red, green, blue


def _bands() -> list[tuple[str, dict[str, Any]]]:
    return [
        ("simulated: median", {"color": MUTED, "linewidth": 1.6}),
        ("25–75 %", {"color": MUTED, "linewidth": 5.0, "alpha": 0.5}),
        ("5–95 %", {"color": MUTED, "linewidth": 5.0, "alpha": 0.22}),
    ]


def _legend(figure: "Figure", entries: Sequence[tuple[str, dict[str, Any]]]) -> None:
    from matplotlib.lines import Line2D

    figure.legend(
        handles=[Line2D([], [], label=label, **style) for label, style in entries],
        loc="outside upper right",
        ncols=4,
        frameon=False,
        fontsize=6.5,
        handletextpad=0.5,
        columnspacing=1.4,
        borderaxespad=0.2,
    )
