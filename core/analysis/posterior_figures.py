# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a back-analysis: each parameter before and after, pairs of them, and what the model gives with them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extras import FIGURES, demand
from ..vectors import Array
from .figures import FORMATS, MEASURED, MUTED, PAGE_IN, STYLE, save_named
from .likelihood_free import weighted_quantiles
from .posterior_checks import PosteriorEstimate, PredictiveCheck
from .priors import Prior
from .whole_run_figures import model_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 40
CELLS = 30
IN_A_ROW = 3
LEVELS = (0.5, 0.95)


@dataclass(frozen=True, eq=False)
class PosteriorPicture:
    """What is drawn.

    Attributes
    ----------
    model : its name. priors : k of them.
    values, weight : (m, k), (m,) draws.
    estimates, checks : see there.
    means : (S, Q) mean over the runs of each quantity, simulated with posterior draws.
    """

    model: str
    priors: tuple[Prior, ...]
    values: Array
    weight: Array
    estimates: tuple[PosteriorEstimate, ...]
    checks: tuple[PredictiveCheck, ...]
    means: Array


def save_posterior_figures(
    picture: PosteriorPicture, folder: str | Path, formats: Sequence[str] = FORMATS[:1]
) -> tuple[Path, ...]:
    """Write parameters, pairs and predictive into a folder; returns the files.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    return save_named(_figures(picture), folder, formats)


def _figures(picture: PosteriorPicture) -> "Iterator[tuple[str, Figure]]":
    yield "parameters", parameter_figure(picture)
    if len(picture.priors) > 1:
        yield "pairs", pair_figure(picture)
    yield "predictive", predictive_figure(picture)


def parameter_figure(picture: PosteriorPicture) -> "Figure":
    """Each parameter: the prior in grey, the posterior in the model's colour, median, intervals, default."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    rows = -(-len(picture.priors) // IN_A_ROW)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 0.55 + 1.9 * rows), layout="constrained")
        grid = figure.subplots(rows, IN_A_ROW, squeeze=False)
        for axes in grid.flat[len(picture.priors) :]:
            axes.set_axis_off()
        for j, axes in enumerate(grid.flat[: len(picture.priors)]):
            _draw_parameter(axes, picture, j)
        colour = model_colour(picture.model)
        _legend(
            figure,
            [
                ("before (prior)", {"color": MUTED, "linewidth": 5.0, "alpha": 0.35}),
                ("after (posterior)", {"color": colour, "linewidth": 5.0, "alpha": 0.45}),
                ("median, 50 %, 95 %", {"color": colour, "linewidth": 1.6, "marker": "o", "markersize": 3.5}),
                ("as it was set", {"color": MEASURED, "linewidth": 0.9, "linestyle": (0, (3, 2))}),
            ],
        )
        return figure


def _draw_parameter(axes: "Axes", picture: PosteriorPicture, j: int) -> None:
    prior, one, colour = picture.priors[j], picture.estimates[j], model_colour(picture.model)
    even = prior.values((np.arange(4000) + 0.5) / 4000)
    edges = np.linspace(even.min(), even.max(), BINS + 1)
    before, _ = np.histogram(even, edges, density=True)
    after, _ = np.histogram(picture.values[:, j], edges, weights=picture.weight, density=True)
    axes.stairs(before, edges, color=MUTED, fill=True, alpha=0.35, linewidth=0)
    axes.stairs(after, edges, color=colour, fill=True, alpha=0.45, linewidth=0)
    top = 1.25 * max(float(after.max()), float(before.max()))
    at = 0.93 * top
    axes.plot([one.low, one.high], [at, at], color=colour, linewidth=1.0, solid_capstyle="butt")
    axes.plot([one.half_low, one.half_high], [at, at], color=colour, linewidth=3.0, solid_capstyle="butt")
    axes.plot(one.median, at, "o", color=colour, markersize=3.5)
    if edges[0] <= prior.default <= edges[-1]:
        axes.axvline(prior.default, color=MEASURED, linewidth=0.9, linestyle=(0, (3, 2)))
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0, top)
    axes.set_yticks([])
    axes.set_xlabel(f"{prior.name} [{prior.unit}]" if prior.unit else prior.name)
    axes.set_title(f"{one.median:.3g} ({one.low:.3g} … {one.high:.3g})", fontsize=7.5, loc="left", pad=4.0)


def pair_figure(picture: PosteriorPicture) -> "Figure":
    """Pairs of parameters: where half of the posterior is, and where 95 % of it."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    k = len(picture.priors)
    with rc_context(STYLE):
        size = min(PAGE_IN / (k - 1), 2.6)
        figure = Figure(figsize=(size * (k - 1), 0.35 + size * (k - 1)), layout="constrained")
        grid = figure.subplots(k - 1, k - 1, squeeze=False, sharex="col", sharey="row")
        for row in range(1, k):
            for column in range(k - 1):
                axes = grid[row - 1, column]
                if column >= row:
                    axes.set_axis_off()
                    continue
                _draw_pair(axes, picture, column, row)
                if row == k - 1:
                    axes.set_xlabel(picture.priors[column].name)
                if column == 0:
                    axes.set_ylabel(picture.priors[row].name)
        colour = model_colour(picture.model)
        _legend(
            figure,
            [
                ("50 %", {"color": colour, "linewidth": 5.0, "alpha": 0.65}),
                ("95 %", {"color": colour, "linewidth": 5.0, "alpha": 0.35}),
                ("as it was set", {"color": MEASURED, "linestyle": "none", "marker": "+", "markersize": 6}),
            ],
        )
        return figure


def _draw_pair(axes: "Axes", picture: PosteriorPicture, x: int, y: int) -> None:
    from scipy.ndimage import gaussian_filter

    colour = model_colour(picture.model)
    limits = [[float(end) for end in picture.priors[i].values(np.array([0.0, 1.0]))] for i in (x, y)]
    ends = [_span(picture.values[:, i], picture.weight, *limits[which]) for which, i in enumerate((x, y))]
    density, xs, ys = np.histogram2d(
        picture.values[:, x], picture.values[:, y], bins=CELLS, range=ends, weights=picture.weight
    )
    density = gaussian_filter(density, 1.2, mode="nearest")
    ordered = np.sort(density.ravel())[::-1]
    share = np.cumsum(ordered) / ordered.sum()
    heights = sorted(float(ordered[np.searchsorted(share, level)]) for level in LEVELS)
    middle = [(edges[1:] + edges[:-1]) / 2 for edges in (xs, ys)]
    if heights[0] < heights[1]:
        axes.contourf(*middle, density.T, levels=[*heights, np.inf], colors=[colour, colour], alpha=0.35)
        axes.contourf(*middle, density.T, levels=[heights[1], np.inf], colors=[colour], alpha=0.35)
    axes.plot(picture.priors[x].default, picture.priors[y].default, "+", color=MEASURED, markersize=6, clip_on=True)
    axes.set_xlim(*ends[0])
    axes.set_ylim(*ends[1])


def _span(values: Array, weight: Array, low: float, high: float) -> tuple[float, float]:
    """Where the draws are, with room, within the range."""
    first, last = weighted_quantiles(values, weight, np.array([0.002, 0.998])).tolist()
    room = max(0.25 * (last - first), 0.02 * (high - low))
    return max(low, first - room), min(high, last + room)


def predictive_figure(picture: PosteriorPicture) -> "Figure":
    """Each quantity, a mean over the runs: simulated with posterior draws, and observed."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [i for i, one in enumerate(picture.checks) if np.isfinite(one.observed) and np.isfinite(one.median)]
    rows = -(-len(shown) // IN_A_ROW)
    colour = model_colour(picture.model)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 0.5 + 1.15 * rows), layout="constrained")
        grid = figure.subplots(rows, IN_A_ROW, squeeze=False)
        for axes in grid.flat[len(shown) :]:
            axes.set_axis_off()
        for axes, i in zip(grid.flat, shown, strict=False):
            one, values = picture.checks[i], picture.means[np.isfinite(picture.means[:, i]), i]
            axes.hist(values, bins=BINS, color=colour, alpha=0.45, linewidth=0)
            axes.axvline(one.observed, color=MEASURED, linewidth=1.4)
            low, high = np.quantile(values, [0.003, 0.997]).tolist()
            ends = min(low, one.observed), max(high, one.observed)
            room = 0.06 * max(ends[1] - ends[0], 1e-9)
            axes.set_xlim(ends[0] - room, ends[1] + room)
            axes.set_yticks([])
            axes.set_xlabel(f"[{one.unit}]" if one.unit else "")
            heading = one.title if one.fits else f"{one.title}: not reproduced"
            axes.set_title(
                _in_lines(heading), fontsize=6.5, fontweight="normal" if one.fits else "bold", loc="left", pad=3.0
            )
        _legend(
            figure,
            [
                ("simulated with the posterior", {"color": colour, "linewidth": 5.0, "alpha": 0.45}),
                ("observed, mean over the runs", {"color": MEASURED, "linewidth": 1.4}),
            ],
        )
        return figure


def _in_lines(text: str) -> str:
    """Long titles in two lines."""
    import textwrap

    return "\n".join(textwrap.wrap(text, 44))


def _legend(figure: "Figure", entries: Sequence[tuple[str, dict[str, Any]]]) -> None:
    from matplotlib.lines import Line2D

    figure.legend(
        handles=[Line2D([], [], label=label, **style) for label, style in entries],
        loc="outside upper right", ncols=4, frameon=False, fontsize=6.5, handletextpad=0.5, columnspacing=1.4,
        borderaxespad=0.2,
    )  # fmt: skip
