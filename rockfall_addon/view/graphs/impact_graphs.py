# SPDX-License-Identifier: GPL-3.0-or-later
"""Graphs of impacts: measured points, those of the models, links between them, fits. Batches are kept.

A graph's points are placed along axes that hold them all; zooming and panning change a matrix, not the batches.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ....core.analysis.axes import Axis, Limits
from ....core.analysis.colouring import model_colours, model_shape
from ....core.analysis.curves import Curve, fit_curve
from ....core.analysis.graph_layout import Frame, in_box, in_lasso, nearest_place
from ....core.analysis.graph_series import (
    Series,
    beyond,
    measured_series,
    model_series,
    pair_links,
    usual_limits,
    whole_limits,
)
from ....core.analysis.graphs import GraphSpec
from ....core.analysis.variable_sigma import measured_interval
from ....core.analysis.variables import VARIABLES
from ....core.impact_models.registry import MODELS
from ....core.vectors import Array, Mask
from ...scene.models import graph_settings
from ...scene.models.comparison import SceneComparison
from .drawing import Lines, Points
from .look import Look, Rgb, mixed, readable
from .point_colours import PointColours
from .selection import Chosen

MANY = 2000
"""With more points they are drawn smaller and less opaque."""
POWER = "\ue000{}\ue001"
"""How an exponent is marked until it is raised."""
RAISED = str.maketrans("0123456789.−", "⁰¹²³⁴⁵⁶⁷⁸⁹·⁻")
MANY_CHOSEN = 400
"""Rings about more points would hide the graph."""
MOST_LINKS = 6000
"""Of more links in a graph, which no eye can follow, only those of selected impacts are drawn."""
OPEN = 10.0
"""How far beyond the axis, in parts of it, the bar of an interval without an end goes."""
REACH = 9.0
"""How far from the mouse a point is still hit, at interface scale 1 [px]."""


@dataclass(eq=False)
class Drawn:
    """The points of one source as they are drawn.

    Attributes
    ----------
    series : what they are.
    colour, shape, hollow : how they look.
    points : batch.
    links : from the measured points, for a model.
    curve : fitted; its batch `line`.
    start : place of its first point among all of the graph.
    made_of : all that the series depends on.
    key : all that the rest depends on.
    """

    series: Series
    colour: Rgb
    shape: str
    hollow: bool
    points: Points
    links: Lines | None
    curve: Curve | None
    line: Lines | None
    start: int
    made_of: object
    key: object


@dataclass(eq=False)
class ImpactGraph:
    """One graph, ready to be drawn.

    Attributes
    ----------
    spec : what it shows; its limits are not used.
    x, y : axes that hold all points, along which `places` count.
    drawn : by source; those of other sites first, then models, the scene's own measured impacts last and on top.
    places : (n, 2) of all points, those of each source together, single precision.
    linked : whether all links are drawn, where they are wanted; else those of selected impacts alone.
    bars : error bars of all measured points; None until they are wanted.
    ring : for a selection, rings about its points, and its links.
    """

    spec: GraphSpec
    x: Axis
    y: Axis
    drawn: list[Drawn]
    places: np.ndarray
    linked: bool = True
    bars: Lines | None = None
    ring: tuple[Chosen, Points, Lines] | None = None
    outside: dict[tuple[Limits, Limits], list[tuple[float, int, int]]] = field(default_factory=dict)

    @property
    def measured(self) -> list[Drawn]:
        return [one for one in self.drawn if not one.series.model]

    def axes(self, spec: GraphSpec) -> tuple[Axis, Axis]:
        """The axes as they are to be shown."""
        x, y = usual_limits(spec, (self.x.limits, self.y.limits))
        return replace(self.x, limits=x), replace(self.y, limits=y)

    def pixels(self, frame: Frame) -> np.ndarray:
        """(n, 2) where the points are in a frame [px]; NaN outside of its axes."""
        corner = frame.to_pixels(np.array([[self.x.limits[0], self.y.limits[0]], [self.x.limits[1], self.y.limits[1]]]))
        spots = (self.places * (corner[1] - corner[0]) + corner[0]).astype(np.float32)
        plot = frame.plot
        with np.errstate(invalid="ignore"):
            inside = (spots[:, 0] >= plot.left) & (spots[:, 0] <= plot.right)
            inside &= (spots[:, 1] >= plot.bottom) & (spots[:, 1] <= plot.top)
        spots[~inside] = np.nan
        return spots

    def hit(self, frame: Frame, x: float, y: float, scale: float) -> tuple[int, int] | None:
        """The point under a pixel: place in `drawn`, and in its series."""
        found = nearest_place(self.pixels(frame), x, y, REACH * scale)
        if found < 0:
            return None
        which = max(i for i, one in enumerate(self.drawn) if one.start <= found)
        return which, found - self.drawn[which].start

    def within(self, frame: Frame, band: Array, lasso: bool) -> Chosen:
        """The impacts with a point in a box (two corners) or an outline (k, 2) [px]."""
        spots = self.pixels(frame)
        inside = in_lasso(spots, band) if lasso else in_box(spots, tuple(band[0]), tuple(band[-1]))
        return frozenset(
            (one.series.source, int(row))
            for one in self.drawn
            for row in one.series.row[inside[one.start : one.start + one.series.row.size]]
        )

    def all_impacts(self) -> Chosen:
        """The measured impacts that have a point."""
        return frozenset(
            (one.series.source, int(row)) for one in self.measured for row in one.series.row[one.series.defined]
        )

    def beyond(self, x: Axis, y: Axis) -> list[tuple[float, int, int]]:
        """Value of y, source and row of each measured point outside of the axes, the greatest first."""
        key = x.limits, y.limits
        if key not in self.outside:
            found = [
                (float(one.series.points[i, 1]), one.series.source, int(one.series.row[i]))
                for one in self.measured
                for i in beyond(one.series, *key)
            ]
            self.outside = {key: sorted(found, reverse=True)}
        return self.outside[key]

    def chosen(self, chosen: Chosen, colour: Rgb) -> tuple[Points, Lines]:
        """Rings about the points of the selected impacts, the models' too, and the links between them; very many are
        drawn as points of the colour."""
        if self.ring is None or self.ring[0] != chosen:
            rows: dict[int, list[int]] = {}
            for source, row in chosen:
                rows.setdefault(source, []).append(row)
            spots, sizes = [np.empty((0, 2), dtype=np.float32)], [np.empty(0)]
            for one in self.drawn:
                of_it = np.isin(one.series.row, rows.get(one.series.source, []))
                spots.append(self.places_of(one)[of_it])
                sizes.append(np.full(int(of_it.sum()), 1.5 if one.series.model else 2.1))
            if len(chosen) > MANY_CHOSEN:
                sizes = [np.full(len(each), 0.6) for each in spots]
            shape = "ring" if len(chosen) <= MANY_CHOSEN else "circle"
            rings = Points(np.concatenate(spots), colour, np.concatenate(sizes), shape)
            linked = rows.get(0, []) if len(chosen) <= MANY_CHOSEN else []
            self.ring = chosen, rings, Lines(self.links_of(np.array(linked, dtype=np.intp)))
        return self.ring[1:]

    def places_of(self, one: Drawn) -> np.ndarray:
        """(n, 2) of the points of one source."""
        return self.places[one.start : one.start + len(one.series.points)]

    def links_of(self, rows: np.ndarray) -> np.ndarray:
        """(k, 2, 2) along the axes: links of some of the scene's own impacts."""
        own = next((one for one in self.measured if one.series.source == 0), None)
        found = [np.empty((0, 2, 2), dtype=np.float32)]
        if own is not None:
            start = dict(zip(own.series.row.tolist(), self.places_of(own), strict=True)) if rows.size else {}
            for one in self.drawn:
                if one.series.model and rows.size:
                    of_it = np.flatnonzero(np.isin(one.series.row, rows))
                    pairs = [(start[int(one.series.row[i])], self.places_of(one)[i]) for i in of_it]
                    found.append(np.array(pairs, dtype=np.float32).reshape(-1, 2, 2))
        return np.concatenate(found)

    def error_bars(self, compared: SceneComparison) -> Lines:
        """Error bars of all measured points."""
        if self.bars is None:
            pieces = [self.bar(compared, one, np.arange(one.series.row.size)) for one in self.measured]
            self.bars = Lines(np.concatenate([np.empty((0, 2, 2)), *pieces]))
        return self.bars

    def bar(self, compared: SceneComparison, one: Drawn, which: np.ndarray) -> Array:
        """(k, 2, 2) along the axes: 95 % intervals of some points of measured impacts."""
        series = one.series
        impacts = compared.impacts if series.source == 0 else compared.others[series.source - 1].impacts
        points, found = series.points[which], []
        for i, (axis, name) in enumerate(((self.x, self.spec.x), (self.y, self.spec.y))):
            beyond = axis.limits[1] + OPEN * (axis.limits[1] - axis.limits[0])
            ends = np.stack([points, points], axis=1)
            ends[:, :, i] = np.minimum(measured_interval(impacts, series.row[which], name), beyond)
            if axis.log:
                ends[:, 0, i] = np.maximum(ends[:, 0, i], axis.limits[0] * 1e-3)
            found.append(np.stack([self.x.places(ends[:, :, 0]), self.y.places(ends[:, :, 1])], axis=2))
        return np.concatenate(found)


def symbol(name: str) -> str:
    """Of a variable: its symbol, or its name in words."""
    return VARIABLES[name].symbol or VARIABLES[name].title


def axis_of(name: str, limits: Limits, log: bool) -> Axis:
    """The axis of a variable."""
    variable = VARIABLES[name]
    return Axis(limits, log, variable.label, f"{symbol(name)} [{variable.unit or '–'}]")


def curve_text(curve: Curve, spec: GraphSpec, full: bool = True) -> str:
    """Equation and numbers of a fit."""
    slope = VARIABLES["rt"].symbol if (spec.x, spec.y) == ("vt1_mps", "vt2_mps") else ""
    text = curve.text(symbol(spec.y), symbol(spec.x), slope, POWER, full)
    before, _, rest = text.partition(POWER[0])
    exponent, _, after = rest.partition(POWER[-1])
    return f"{before}{exponent.translate(RAISED)}{after}"


@dataclass(frozen=True, eq=False)
class Source:
    """Points that are to be drawn, and how.

    Attributes
    ----------
    series, colour, shape, hollow : as in `Drawn`.
    shades : (n, 3) colours of the single points; None for the colour of the source.
    made_of : what the points come from, compared by identity, and what is shown of that.
    """

    series: Series
    colour: Rgb
    shape: str
    hollow: bool
    shades: Array | None
    made_of: object


def build(
    scene: bpy.types.Scene,
    spec: GraphSpec,
    compared: SceneComparison,
    kept: list[Mask],
    filters: object,
    colours: PointColours,
    look: Look,
    before: ImpactGraph | None = None,
) -> ImpactGraph:
    """The graph of what is compared.

    kept, filters : of the scene's own impacts, and of each other table, those that pass the filters.
    before : the graph as it was; what has not changed of it stays, so that a slider moves the points of its model only.
    """
    settings = scene.rockfall_graphs
    known = [] if before is None else before.drawn
    sources = _sources(spec, compared, kept, filters, colours, look, known)
    whole = whole_limits([one.series for one in sources], (spec.x_log, spec.y_log))
    x, y = axis_of(spec.x, whole[0], spec.x_log), axis_of(spec.y, whole[1], spec.y_log)
    own = next((one.series for one in sources if not one.series.model and one.series.source == 0), None)
    few = sum(len(one.series.points) for one in sources if one.series.model) <= MOST_LINKS
    found, pieces, start = [], [np.empty((0, 2), dtype=np.float32)], 0
    for one in sources:
        how = spec.fitted, settings.links and few, settings.fits, one.colour, one.shape, one.hollow
        key = (one.made_of, x, y, *how)
        same = next((each for each in known if each.key == key), None)
        if same is not None and before is not None:
            found.append(replace(same, start=start))
            pieces.append(before.places[same.start : same.start + len(same.series.points)])
        else:
            places = np.stack([x.places(one.series.points[:, 0]), y.places(one.series.points[:, 1])], axis=1)
            pieces.append(places.astype(np.float32))
            found.append(_drawn(one, own, places, x, y, spec, settings, start, few, key))
        start += len(one.series.points)
    return ImpactGraph(spec, x, y, found, np.concatenate(pieces), few)


def _drawn(
    one: Source,
    own: Series | None,
    places: Array,
    x: Axis,
    y: Axis,
    spec: GraphSpec,
    settings: bpy.types.PropertyGroup,
    start: int,
    few: bool,
    key: object,
) -> Drawn:
    """Batches of one source.

    few : whether there are so few links that all of them are drawn.
    """
    series = one.series
    opacity = min(1.0, max(0.45, (MANY / max(len(places), 1)) ** 0.25))
    shades = np.ones((len(places), 4))
    shades[:, :3], shades[:, 3] = (one.colour if one.shades is None else one.shades), opacity
    links, curve, line = None, None, None
    if series.model and own is not None and settings.links and few:
        pairs = pair_links(own, series)
        links = Lines(np.stack([x.places(pairs[:, :, 0]), y.places(pairs[:, :, 1])], axis=2))
    if settings.fits and series.source == 0:
        curve = fit_curve(spec.fitted, series.points[series.defined], x.limits, y.limits, interval=False)
    if curve is not None and curve.is_fitted:
        line = Lines(np.stack([x.places(curve.x), y.places(curve.y)], axis=1))
    points = Points(places, shades, opacity, one.shape)
    return Drawn(series, one.colour, one.shape, one.hollow, points, links, curve, line, start, one.made_of, key)


def _sources(
    spec: GraphSpec,
    compared: SceneComparison,
    kept: list[Mask],
    filters: object,
    colours: PointColours,
    look: Look,
    known: list[Drawn],
) -> list[Source]:
    """What is to be drawn; what is on top comes last.

    known : what was drawn before, whose series are used again where nothing of them has changed.
    """
    found: list[Source] = []
    shown = spec.x, spec.y, filters, compared.runs

    def series_of(made_of: object, make: Callable[..., Series], *given: object) -> Series:
        same = next((one.series for one in known if one.made_of == made_of), None)
        return make(*given) if same is None else same

    impacts, several = compared.impacts, len(compared.predictions) > 1
    hues = model_colours(compared.models, with_blocks=bool(compared.in_view))
    for i, other in enumerate(compared.others):
        if other.impacts is not None:
            rows = np.flatnonzero(kept[i + 1])
            title = ", ".join(other.sites[:3]) or other.path.name
            made_of = other.impacts, i, title, colours, shown
            series = series_of(made_of, measured_series, other.impacts, spec.x, spec.y, rows, title, i + 1)
            grey = mixed(look.plot, look.measured, 0.6)
            found.append(Source(series, grey, "circle", True, colours.of(i + 1, rows), made_of))
    if impacts is not None:
        for which, predictions in compared.predictions.items():
            for model, predicted in predictions.items():
                title = f"{MODELS[model].title}{f', {which}' if several else ''}"
                made_of = impacts, predicted, title, shown
                given = impacts, predicted, model, compared.runs, spec.x, spec.y, kept[0], title
                series = series_of(made_of, model_series, *given)
                hollow = several and which == "B"
                colour = readable(hues[model], look)
                found.append(Source(series, colour, model_shape(model), hollow, None, made_of))
        rows, made_of = np.flatnonzero(kept[0]), (impacts, colours, shown)
        series = series_of(made_of, measured_series, impacts, spec.x, spec.y, rows, "measured")
        found.append(Source(series, look.measured, "circle", False, colours.of(0, rows), made_of))
    return found


def specs_key(scene: bpy.types.Scene, number: int) -> tuple[object, ...]:
    """All that the batches of a graph depend on, of its settings."""
    graph, settings = graph_settings.graph(scene, number), scene.rockfall_graphs
    return graph.x, graph.y, graph.x_log, graph.y_log, graph.trend, settings.links, settings.fits
