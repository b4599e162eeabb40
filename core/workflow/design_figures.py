# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a design sheet: the plan, the profile, and what comes to each screen."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis.figures import MEASURED, MUTED, PAGE_IN, STYLE
from ..analysis.whole_run_figures import model_colour
from ..exchange.map_figures import DARKEST, Window, hillshade, map_figure, north_arrow, reached, scale_bar
from ..extras import FIGURES, demand
from ..hazard.maps import LAYERS
from ..hazard.screens import Screen, blocks_at, points_along
from ..impact_models.registry import find_model
from ..reconstruction.sampling import STEP_S, sample_trajectories
from ..simulation.parabolas import parabolas_of, polylines_of
from ..simulation.results import fell_through
from ..vectors import Array
from .design_sheet import ENERGY_LINES_DEG, DesignSheet, ModelDesign

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAPPED = ("Reach_probability", "E_95CI")
"""Maps that a sheet shows."""
SCREEN_INK = "#111418"
CELL_M = 0.5
"""Of the picture of the relief, at least."""
MARGIN = 0.08
PATH_TOLERANCE_M = 0.1


def figures_of(sheet: DesignSheet) -> "Iterator[tuple[str, str, Figure]]":
    """Name, caption and figure, one after the other.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    yield "plan", "Simulated paths in colour, measured ones in black, screens as thick lines.", plan_figure(sheet)
    for one in sheet.models:
        title = find_model(one.settings.model).title
        for name in MAPPED if one.maps is not None else ():
            figure = map_figure_of(sheet, one, name)
            yield f"{name} {one.settings.model}", f"{LAYERS[name].meaning}, with {title}, without barriers.", figure
    yield (
        "profile",
        "Seen from the side, along the mean way of the blocks: the highest and the lowest terrain that they pass over "
        "in grey; usual energy lines dashed.",
        profile_figure(sheet),
    )
    for screen in sheet.screens:
        if any(screen.name in one.values for one in sheet.models):
            yield (
                f"screen {screen.name}",
                f"What comes to {screen.name}: the share of the blocks that is not above a value, of each its "
                "greatest. Marked is the characteristic value with its 95 % interval, where it has one; dashed is the "
                "design value.",
                screen_figure(sheet, screen),
            )


def plan_figure(sheet: DesignSheet) -> "Figure":
    """Relief, paths and screens from above, with scale bar and north arrow."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    low, high = _window(sheet)
    size = high - low
    width = PAGE_IN if size[0] >= size[1] else max(PAGE_IN * size[0] / size[1], 0.55 * PAGE_IN)
    with rc_context(STYLE):
        figure = Figure(figsize=(width, min(width * size[1] / size[0], 1.15 * PAGE_IN)), layout="constrained")
        axes = figure.subplots()
        extent = (low[0], high[0], low[1], high[1])
        shade = hillshade(sheet.ground.terrain, Window(low[0], high[0], low[1], high[1]), CELL_M)
        grey = DARKEST + (1 - DARKEST) * np.nan_to_num(shade, nan=1.0)
        axes.imshow(
            grey, cmap="gray", vmin=0, vmax=1, extent=extent, origin="lower", interpolation="bilinear", zorder=0
        )
        for one in sheet.models:
            lines = _lines(one)
            axes.add_collection(_collection([line[:, :2] for line in lines], _colour(one), 0.4))
        axes.add_collection(_collection([line[:, :2] for line in _measured(sheet)], MEASURED, 1.0, alpha=1.0))
        for screen in sheet.screens:
            axes.plot(*screen.line.T, color="white", linewidth=4.2, solid_capstyle="butt", zorder=5)
            axes.plot(*screen.line.T, color=SCREEN_INK, linewidth=2.4, solid_capstyle="butt", zorder=6)
            axes.annotate(
                screen.name, screen.line[-1], xytext=(4, 4), textcoords="offset points", fontweight="bold", zorder=7,
                bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.2},
            )  # fmt: skip
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[])
        for spine in axes.spines.values():
            spine.set_visible(False)
        scale_bar(axes, float(size[0]))
        north_arrow(axes)
        _legend(axes, sheet)
    return figure


def map_figure_of(sheet: DesignSheet, one: ModelDesign, name: str) -> "Figure":
    """One map, with the screens on it."""
    if one.maps is None:
        raise ValueError("there are no maps")
    terrain, window = sheet.ground.terrain, reached(one.maps)
    shade = hillshade(terrain, window, one.maps.cells.size_m)
    said = find_model(one.settings.model).title
    figure = map_figure(one.maps, name, window, shade, terrain, said=said, releases=one.drawn.releases.position)
    shift = terrain.shift
    for screen in sheet.screens:
        line = screen.line + np.array([shift.x, shift.y])
        figure.axes[0].plot(*line.T, color=SCREEN_INK, linewidth=1.8, solid_capstyle="butt", zorder=6)
    return figure


def profile_figure(sheet: DesignSheet) -> "Figure":
    """Height against the distance along the mean way of the blocks."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    origin, along = _axis(sheet)
    shift = sheet.ground.shift.z
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 3.0), layout="constrained")
        axes = figure.subplots()
        everything = [line for one in sheet.models for line in _lines(one)]
        s, below, above = _terrain_along(sheet, everything, origin, along)
        axes.fill_between(s, below + shift, above + shift, color="#c9ced5", linewidth=0, zorder=1)
        for one in sheet.models:
            lines = [np.column_stack([(line[:, :2] - origin) @ along, line[:, 2] + shift]) for line in _lines(one)]
            axes.add_collection(_collection(lines, _colour(one), 0.35))
        lines = [np.column_stack([(line[:, :2] - origin) @ along, line[:, 2] + shift]) for line in _measured(sheet)]
        axes.add_collection(_collection(lines, MEASURED, 0.8, alpha=1.0))
        for screen in sheet.screens:
            place, foot = _foot(sheet, screen, origin, along)
            top = screen.height_m if np.isfinite(screen.height_m) else 0.05 * float(np.ptp(above))
            axes.plot([place, place], [foot + shift, foot + shift + top], color=SCREEN_INK, linewidth=2.2, zorder=6)
            axes.annotate(
                screen.name, (place, foot + shift + top), xytext=(0, 3), textcoords="offset points", ha="center",
                fontweight="bold", zorder=7,
            )  # fmt: skip
        _energy_lines(axes, sheet, origin, along, float(s.max()), float(below.min()) + shift)
        axes.set(xlabel="distance along the mean way of the blocks [m]", ylabel="height [m]")
        axes.set_aspect("equal")
        axes.autoscale_view()
        _legend(axes, sheet)
    return figure


def screen_figure(sheet: DesignSheet, screen: Screen) -> "Figure":
    """Cumulative curves of speed, energy and height at a screen, and where along it the hits are."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    place = sheet.screens.index(screen)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 2.1), layout="constrained")
        speed, energy, height, along = figure.subplots(1, 4)
        for one in sheet.models:
            if screen.name not in one.values:
                continue
            values, colour = one.values[screen.name], _colour(one)
            hits = one.tally.hits
            each = blocks_at(hits.take(hits.reaches & (hits.screen == place)))
            for axes, data, known, design, factor in (
                (speed, each.speed_mps, values.speed_mps, values.design_speed_mps, 1.0),
                (energy, each.energy_j, values.energy_j, values.design_energy_j, 1e-3),
                (height, each.up_m[np.isfinite(each.up_m)], values.height_m, values.design_height_m, 1.0),
            ):
                ordered = np.sort(data) * factor
                axes.step(ordered, 100 * np.arange(1, ordered.size + 1) / ordered.size, color=colour, linewidth=1.2)
                ends = [v * factor for v in (known.low, known.high) if np.isfinite(v)]
                if len(ends) == 2:
                    axes.plot(
                        ends, [100 * known.share] * 2, color=colour, linewidth=4, alpha=0.45, solid_capstyle="butt"
                    )
                axes.plot(known.value * factor, 100 * known.share, "o", color=colour, markersize=3.2)
                if np.isfinite(design):
                    axes.axvline(design * factor, color=colour, linewidth=0.8, linestyle=(0, (4, 2)))
            figures = one.tally.figures(with_barriers=True)[place]
            edges = np.linspace(0, screen.length_m, figures.along.size + 1)
            along.stairs(100 * figures.along / max(figures.hits, 1), edges, color=colour, linewidth=1.0)
        for axes, label in (
            (speed, "speed [m/s]"),
            (energy, "kinetic energy [kJ]"),
            (height, "height of the centre [m]"),
        ):
            axes.set(xlabel=label, ylim=(0, 101), xlim=(0, None))
        if screen.capacity_j is not None:
            energy.axvline(screen.capacity_j / 1000, color=SCREEN_INK, linewidth=1.4)
            height.axvline(screen.height_m, color=SCREEN_INK, linewidth=1.4)
        speed.set_ylabel("blocks that are not above [%]")
        along.set(xlabel=f"place along {screen.name} [m]", ylabel="hits [%]", xlim=(0, screen.length_m), ylim=(0, None))
    return figure


def _colour(one: ModelDesign) -> tuple[float, float, float]:
    return model_colour(one.settings.model)


def _lines(one: ModelDesign) -> list[Array]:
    """Paths of the drawn runs; those that fell through a hole of the terrain are none."""
    paths = polylines_of(parabolas_of(one.drawn), PATH_TOLERANCE_M)
    begin = np.searchsorted(paths.run, np.arange(len(one.drawn) + 1))
    lost = fell_through(one.drawn)
    return [paths.position[a:b] for a, b, gone in zip(begin[:-1], begin[1:], lost, strict=True) if b > a and not gone]


def _measured(sheet: DesignSheet) -> list[Array]:
    if sheet.measured is None:
        return []
    samples = sample_trajectories(sheet.measured, STEP_S)
    names = samples.trajectory
    begin = np.flatnonzero(np.r_[True, names[1:] != names[:-1]])
    return np.split(samples.position, begin[1:])


def _collection(lines: list[Array], colour: Any, width: float, alpha: float = 0.55) -> Any:
    from matplotlib.collections import LineCollection

    return LineCollection(lines, colors=[colour], linewidths=width, alpha=alpha, rasterized=len(lines) > 50, zorder=3)


def _window(sheet: DesignSheet) -> tuple[Array, Array]:
    """(2,) corners of what paths and screens cover, with a margin, within the terrain."""
    parts = [screen.line for screen in sheet.screens]
    parts += [one.drawn.records.position[:, :2] for one in sheet.models]
    places = np.vstack(parts)
    low, high = places.min(axis=0), places.max(axis=0)
    margin = MARGIN * float((high - low).max())
    least, most = sheet.ground.terrain.bounds
    return np.maximum(low - margin, least[:2]), np.minimum(high + margin, most[:2])


def _axis(sheet: DesignSheet) -> tuple[Array, Array]:
    """(2,) mean place of release, (2,) direction to the mean end, in plan."""
    starts = np.vstack([one.drawn.releases.position[:, :2] for one in sheet.models])
    ends = np.vstack([one.drawn.position[:, :2] for one in sheet.models])
    way = ends.mean(axis=0) - starts.mean(axis=0)
    length = float(np.hypot(*way))
    return starts.mean(axis=0), way / length if length > 0 else np.array([1.0, 0.0])


def _terrain_along(sheet: DesignSheet, lines: list[Array], origin: Array, along: Array) -> tuple[Array, Array, Array]:
    """Distances (s,), and the lowest and the highest terrain (s,) below the paths there."""
    places = np.vstack(lines)
    height = sheet.ground.heights_above(places)
    known = np.isfinite(height)
    s, z = ((places[:, :2] - origin) @ along)[known], (places[:, 2] - height)[known]
    edges = np.linspace(s.min(), s.max(), 160)
    part = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, edges.size - 2)
    low, high = np.full(edges.size - 1, np.inf), np.full(edges.size - 1, -np.inf)
    np.minimum.at(low, part, z)
    np.maximum.at(high, part, z)
    there = np.isfinite(low)
    return ((edges[:-1] + edges[1:]) / 2)[there], low[there], high[there]


def _foot(sheet: DesignSheet, screen: Screen, origin: Array, along: Array) -> tuple[float, float]:
    """Where a screen stands along the axis, and the mean height of the terrain there."""
    places = points_along(screen, screen.length_m / 50)
    top = sheet.ground.terrain.bounds[1][2] + 1.0
    z = top - sheet.ground.heights_above(np.column_stack([places, np.full(len(places), top)]))
    return float(((places - origin) @ along).mean()), float(np.nanmean(z))


def _energy_lines(axes: "Axes", sheet: DesignSheet, origin: Array, along: Array, end: float, bottom: float) -> None:
    """From the highest release, down to the terrain's lowest place."""
    starts = np.vstack([one.drawn.releases.position for one in sheet.models])
    top = starts[int(np.argmax(starts[:, 2]))]
    first, z = float((top[:2] - origin) @ along), float(top[2]) + sheet.ground.shift.z
    for angle in ENERGY_LINES_DEG:
        slope = np.tan(np.radians(angle))
        stop = min(end, first + (z - bottom) / slope)
        low = z - (stop - first) * slope
        axes.plot([first, stop], [z, low], color=MUTED, linewidth=0.7, linestyle=(0, (5, 3)), zorder=2)
        axes.annotate(f"{angle:g}°", (stop, low), xytext=(2, 0), textcoords="offset points", color=MUTED, fontsize=6)


def _legend(axes: "Axes", sheet: DesignSheet) -> None:
    from matplotlib.lines import Line2D

    entries = [
        Line2D([], [], color=_colour(one), linewidth=1.6, label=f"simulated, {find_model(one.settings.model).title}")
        for one in sheet.models
    ]
    if sheet.measured is not None:
        entries.append(Line2D([], [], color=MEASURED, linewidth=1.6, label="measured"))
    axes.legend(handles=entries, loc="best", frameon=True, framealpha=0.9, edgecolor="none", fontsize=6.5)
