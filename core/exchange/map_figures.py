# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps as figures: over the hillshade of the terrain, with legend, scale bar and north arrow."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..analysis.figures import FORMATS, INK, MUTED, PAGE_IN, STYLE, save_named
from ..colours import rounded_top
from ..extras import FIGURES, demand
from ..hazard.classes import classes_of
from ..hazard.evidence import cell_evidence, entered, outlines, row_runs
from ..hazard.maps import LAYERS, Maps
from ..progress import Progress, silent
from ..terrain.cloud import Cloud, heights_above_points
from ..terrain.raycast import heights_above
from ..terrain.surface import Surface
from ..vectors import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

DRAWN = ("Reach_probability", "E_95CI", "Ph_95CI", "V_95CI", "Nr_deposited")
"""Maps of which there are figures, where none are named."""
LEGEND_IN = 1.65
ROOM = 0.08
"""Around what blocks reach, as a part of its size."""
SHADE_PIXELS = 900
"""Of the hillshade along its longer side, at most."""
DARKEST = 0.45
"""Of the hillshade, so that colours are told apart upon it."""
OPACITY = 0.82
HATCH, BEYOND = "/////", "\\\\\\\\\\"
"""Over cells of few blocks, and over those beyond the terrain; see `Evidence`."""
WEST_NORTH = np.array([-0.5, 0.5, np.sqrt(0.5)])
"""The light: from the north-west, 45° high, where maps have it."""


@dataclass(frozen=True, eq=False)
class Window:
    """A part of the map plane, local [m]."""

    west: float
    east: float
    south: float
    north: float


def save_map_figures(
    maps: Maps,
    terrain: Surface | Cloud,
    folder: str | Path,
    names: Sequence[str] = DRAWN,
    *,
    said: str = "",
    releases: Array | None = None,
    formats: Sequence[str] = FORMATS[:1],
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write a figure of each named map that is there into a folder; returns the files.

    Parameters
    ----------
    said : what stands below each title beside the number of blocks, such as the model.
    releases : (n, 2 or more) where the blocks start, local [m].

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    window = reached(maps)
    shade = hillshade(terrain, window, maps.cells.size_m)
    chosen = [name for name in names if name in maps.layers]

    def figures() -> "Iterator[tuple[str, Figure]]":
        for name in chosen:
            yield name, map_figure(maps, name, window, shade, terrain, said=said, releases=releases)

    return save_named(figures(), folder, formats, progress, len(chosen))


def reached(maps: Maps) -> Window:
    """The part of the map that blocks reach, with some room around it; all of it when they reach nothing."""
    cells = maps.cells
    passed = entered(maps)
    rows, columns = np.flatnonzero(passed.any(axis=1)), np.flatnonzero(passed.any(axis=0))
    if not rows.size:
        rows, columns = np.array([0, cells.rows - 1]), np.array([0, cells.columns - 1])
    low, high = np.array([columns[0], rows[0]]), np.array([columns[-1], rows[-1]]) + 1
    room = max(ROOM * float((high - low).max()), 2.0)
    low = np.maximum(low - room, 0.0)
    high = np.minimum(high + room, [cells.columns, cells.rows])
    west, south = (np.array([cells.x0_m, cells.y0_m]) + cells.size_m * low).tolist()
    east, north = (np.array([cells.x0_m, cells.y0_m]) + cells.size_m * high).tolist()
    return Window(west, east, south, north)


def hillshade(terrain: Surface | Cloud, window: Window, cell_m: float) -> Array:
    """(rows, columns) brightness of the terrain, 0 … 1, the first row in the south; NaN beside it."""
    wide, high = window.east - window.west, window.north - window.south
    spacing = terrain.mean_spacing_m if isinstance(terrain, Surface) else terrain.spacing_m
    step = max(max(wide, high) / SHADE_PIXELS, min(cell_m, spacing))
    x = np.arange(window.west + step / 2, window.east, step)
    y = np.arange(window.south + step / 2, window.north, step)
    top = float(terrain.bounds[1, 2]) + 1.0
    grid = np.stack([*np.meshgrid(x, y), np.full((y.size, x.size), top)], axis=-1)
    places = grid.reshape(-1, 3)
    above = heights_above(terrain, places) if isinstance(terrain, Surface) else heights_above_points(terrain, places)
    height = top - above.reshape(grid.shape[:2])
    if min(height.shape) < 2:
        return np.where(np.isnan(height), np.nan, 1.0)
    to_north, to_east = np.gradient(height, step)
    light = (WEST_NORTH[2] - to_east * WEST_NORTH[0] - to_north * WEST_NORTH[1]) / np.sqrt(1 + to_east**2 + to_north**2)
    shade: Array = np.clip(light, 0.0, 1.0)
    return shade


def map_figure(
    maps: Maps,
    name: str,
    window: Window,
    shade: Array,
    terrain: Surface | Cloud,
    *,
    said: str = "",
    releases: Array | None = None,
) -> "Figure":
    """One map over the hillshade of a window.

    Raises
    ------
    KeyError : there is no such map.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    layer, values, cells, shift = LAYERS[name], maps.layers[name], maps.cells, terrain.shift
    classes = classes_of(name, values)
    wide, high = window.east - window.west, window.north - window.south
    width = PAGE_IN - LEGEND_IN - 0.75
    tall = min(width * high / wide, 7.5)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, max(tall, 2.6) + 0.95), layout="constrained")
        axes = figure.add_subplot()
        extent = np.array([window.west, window.east, window.south, window.north]) + np.repeat([shift.x, shift.y], 2)
        grey = DARKEST + (1 - DARKEST) * shade
        picture = np.stack([*(np.nan_to_num(grey, nan=1.0),) * 3, np.isfinite(grey)], axis=-1)
        axes.imshow(picture, origin="lower", extent=extent.tolist(), interpolation="bilinear", zorder=1)
        west, south = cells.x0_m + shift.x, cells.y0_m + shift.y
        whole = (west, west + cells.columns * cells.size_m, south, south + cells.rows * cells.size_m)
        coloured = classes.colours_of(values)
        coloured[..., 3] *= OPACITY
        axes.imshow(coloured, origin="lower", extent=whole, interpolation="nearest", zorder=2)
        evidence = cell_evidence(maps, terrain)
        masks = [(mask, hatch) for mask, hatch in ((evidence.few, HATCH), (evidence.beyond, BEYOND)) if mask.any()]
        weak = []
        for (mask, hatch), words in zip(masks, evidence.in_words, strict=True):
            axes.add_patch(_hatching(mask, maps, np.array([shift.x, shift.y]), hatch))
            weak.append(Patch(facecolor="white", edgecolor=INK, linewidth=0.3, hatch=hatch, label=_broken(words)))
        drawn: list[Any] = []
        if releases is not None:
            drawn = axes.plot(
                releases[:, 0] + shift.x, releases[:, 1] + shift.y, "^", color="white", markeredgecolor=INK,
                markersize=3.2, markeredgewidth=0.5, zorder=3, linestyle="",
                label="release",
            )  # fmt: skip
        axes.set_xlim(extent[0], extent[1])
        axes.set_ylim(extent[2], extent[3])
        axes.set_aspect("equal")
        _ticks(axes)
        scale_bar(axes, wide)
        north_arrow(axes)
        unit = f" [{layer.unit}]" if layer.unit else ""
        axes.set_title(f"{layer.title}{unit}", fontsize=8.5, fontweight="bold", loc="left", pad=16.0)
        under = f"conditional on the release: {maps.blocks:,} blocks"
        parts = [under, *([said] if said else []), f"cells of {cells.size_m:g} m"]
        axes.annotate(
            "  ·  ".join(parts), (0.0, 1.0), xytext=(0, 5), xycoords="axes fraction", textcoords="offset points",
            fontsize=6.5, color=MUTED,
        )  # fmt: skip
        rows = zip(classes.labels, classes.colours, strict=True)
        patches = [Patch(facecolor=colour, edgecolor=INK, linewidth=0.3, label=label) for label, colour in rows]
        handles = [*patches[::-1], *weak, *drawn]
        legend = axes.legend(
            handles=handles, title=layer.unit or layer.title, loc="upper left", bbox_to_anchor=(1.02, 1.0),
            frameon=False, fontsize=6.5, title_fontsize=7.0, borderaxespad=0.0, handlelength=1.5, handleheight=1.1,
            alignment="left",
        )  # fmt: skip
        legend.set_in_layout(True)
        axes.annotate(
            shift.crs or "coordinate system unknown", (1.0, 0.0), xytext=(8, 0), xycoords="axes fraction",
            textcoords="offset points", fontsize=6.0, color=MUTED,
        )  # fmt: skip
        return figure


def _hatching(mask: NDArray[np.bool_], maps: Maps, moved: Array, hatch: str) -> "PathPatch":
    """Over some cells. moved : from local to the axes' coordinates (2,)."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    around = outlines(maps.cells, row_runs(mask)) + moved
    codes = np.tile([Outline.MOVETO, *[Outline.LINETO] * 3, Outline.CLOSEPOLY], len(around))
    outline = Outline(around.reshape(-1, 2), codes if len(codes) else None)
    return PathPatch(outline, facecolor="none", edgecolor=INK, linewidth=0.0, hatch=hatch, zorder=2.5)


def _broken(words: str) -> str:
    """In two lines, so that a legend stays narrow."""
    return words.replace(": ", ":\n", 1)


def _ticks(axes: "Axes") -> None:
    """Few survey coordinates, in full."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    whole = FuncFormatter(lambda value, _: f"{value:,.0f}")
    for axis, count in ((axes.xaxis, 4), (axes.yaxis, 4)):
        axis.set_major_locator(MaxNLocator(count, steps=[1, 2, 5, 10], integer=True))
        axis.set_major_formatter(whole)
        axis.set_tick_params(labelsize=6.0, labelcolor=MUTED)
    for label in axes.get_yticklabels():
        label.set_rotation(90)
        label.set_verticalalignment("center")
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)


def scale_bar(axes: "Axes", wide: float) -> None:
    """A bar of a length that reads well, about a fifth of the width, in the lower left corner."""
    from matplotlib.patches import Rectangle

    length = rounded_top(wide / 5 * 0.7)
    left, bottom = axes.get_xlim()[0], axes.get_ylim()[0]
    x, y = left + 0.03 * wide, bottom + 0.035 * wide
    thick = 0.009 * wide
    box = Rectangle((x - 0.015 * wide, y - 0.018 * wide), length + 0.03 * wide, 0.062 * wide, facecolor="white",
                    alpha=0.75, linewidth=0, zorder=4)  # fmt: skip
    axes.add_patch(box)
    for part, colour in ((0.0, INK), (0.5, "white")):
        axes.add_patch(Rectangle((x + part * length, y), length / 2, thick, facecolor=colour, edgecolor=INK,
                                 linewidth=0.5, zorder=5))  # fmt: skip
    digits = max(0, ceil(-log10(length)) + 1) if length < 1 else 0
    words = f"{length:.{digits}f} m" if length < 1000 else f"{length / 1000:g} km"
    axes.text(x + length / 2, y + 2 * thick, words, ha="center", va="bottom", fontsize=6.0, zorder=5)


def north_arrow(axes: "Axes") -> None:
    """In the upper right corner; y is north."""
    axes.annotate(
        "N", xy=(0.962, 0.975), xytext=(0.962, 0.885), xycoords="axes fraction", ha="center", va="center", fontsize=7.0,
        fontweight="bold", zorder=5,
        arrowprops={"arrowstyle": "-|>,head_width=0.28,head_length=0.55", "color": INK, "linewidth": 1.0},
        bbox={"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
    )  # fmt: skip
