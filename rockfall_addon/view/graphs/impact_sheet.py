# SPDX-License-Identifier: GPL-3.0-or-later
"""The editor of impact graphs as it is drawn: legend, graphs beside each other, the card under the mouse; what is kept.

What a graph is made of is in `impact_graphs`; here is when it is made again, and where it lies.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import bpy
import numpy as np

from ....core.analysis.columns import passing
from ....core.analysis.graph_layout import Frame, Rectangle, frame, tiles
from ....core.analysis.variable_sigma import measured_interval
from ....core.analysis.variables import VARIABLES, known_variables, measured_values
from ....core.reconstruction.impact import Impacts
from ....core.reconstruction.intervals import undetermined
from ....core.vectors import Mask
from ...scene.models import comparison, comparison_scores, graph_settings
from . import drawing, empty, legend, selection
from .axes import draw_axes
from .editor import Canvas
from .impact_graphs import MANY, Drawn, ImpactGraph, build, curve_text, specs_key, symbol
from .look import Look, alpha, mixed
from .point_colours import PointColours, find_colours

NO_ENDS = np.full(2, np.nan)
LINE = 1.35
"""From one line of text to the next, in heights of the text."""
FULL_HEIGHT = 16
"""A graph of so many heights of the text has room for the fits of several models."""


class Hit(NamedTuple):
    """A point under the mouse: its source and row, the series in the graph and its place there."""

    source: int
    row: int
    series: int
    place: int


@dataclass(eq=False)
class _Kept:
    """What was made for a scene, and what for."""

    rows_key: object = None
    rows: list[Mask] = field(default_factory=list)
    colours_key: object = None
    colours: PointColours = field(default_factory=lambda: PointColours(None, {}))
    graphs: dict[int, tuple[object, ImpactGraph]] = field(default_factory=dict)


_scenes: dict[int, _Kept] = {}


def forget() -> None:
    """Another file was opened, or the graphics card is left."""
    _scenes.clear()


def draw(context: bpy.types.Context, canvas: Canvas) -> None:
    """Draw all graphs of a scene, or what to do when there is nothing to be drawn."""
    scene, look = context.scene, canvas.look
    compared = comparison.comparison_of(scene)
    said = empty.nothing(scene, compared, rows_of(scene, compared))
    if said is not None:
        empty.draw(canvas, said)
        return
    graphs = {number: graph_of(scene, number, compared, look) for number in graph_settings.shown(scene)}
    room = canvas.room.shrunk(0.5 * look.text)
    if scene.rockfall_graphs.legend:
        taken = legend.draw(
            room, look, compared, next(iter(graphs.values())), _kept(scene).colours, scene.rockfall_graphs.links
        )
        room = Rectangle(room.left, room.bottom, room.width, max(room.height - taken, 1.0))
    chosen = selection.selected(context)
    if canvas.hit is not None and not _is_there(canvas.hit, graphs.get(canvas.graph)):
        canvas.hit = None
    for tile, (number, graph) in zip(tiles(room, len(graphs), 0.6 * look.text, look.text), graphs.items(), strict=True):
        _draw_graph(scene, canvas, number, graph, tile, compared, chosen)
    if canvas.hit is not None and canvas.graph in graphs and canvas.pointer is not None:
        _draw_card(canvas, graphs[canvas.graph], canvas.hit, compared)


def point(context: bpy.types.Context, canvas: Canvas) -> Hit | None:
    """The point under the mouse."""
    graph, seen = drawn_graph(context.scene, canvas.graph), canvas.frames.get(canvas.graph)
    if graph is None or seen is None or canvas.pointer is None:
        return None
    found = graph.hit(seen, *canvas.pointer, canvas.look.scale)
    if found is None:
        return None
    series = graph.drawn[found[0]].series
    return Hit(series.source, int(series.row[found[1]]), *found)


def drawn_graph(scene: bpy.types.Scene, number: int) -> ImpactGraph | None:
    """A graph as it was drawn last."""
    return _kept(scene).graphs.get(number, (None, None))[1]


def graph_of(scene: bpy.types.Scene, number: int, compared: comparison.SceneComparison, look: Look) -> ImpactGraph:
    """A graph with its batches; made again when something that it shows has changed."""
    kept, settings = _kept(scene), scene.rockfall_graphs
    rows = rows_of(scene, compared)
    tables = _tables(compared)
    colours_key = tables, settings.colour_by, look.dark
    if kept.colours_key != colours_key:
        kept.colours = find_colours(tables, settings.colour_by, look.dark)
        kept.colours_key = colours_key
    key = compared.version, kept.rows_key, colours_key, look.measured, look.plot, specs_key(scene, number)
    known, before = kept.graphs.get(number, (None, None))
    if known != key:
        spec = graph_settings.spec_of(graph_settings.graph(scene, number), number)
        kept.graphs[number] = key, build(scene, spec, compared, rows, kept.rows_key, kept.colours, look, before)
    return kept.graphs[number][1]


def rows_of(scene: bpy.types.Scene, compared: comparison.SceneComparison) -> list[Mask]:
    """Of the scene's own impacts, and of each other table, those that pass the filters."""
    kept, filters = _kept(scene), graph_settings.filters_of(scene)
    tables = _tables(compared)
    if kept.rows_key != (tables, len(compared.others), filters):
        kept.rows = [
            passing(tables[source], filters) if source in tables else np.zeros(0, dtype=np.bool_)
            for source in range(1 + len(compared.others))
        ]
        kept.rows_key = tables, len(compared.others), filters
    return kept.rows


def variables_of(scene: bpy.types.Scene) -> list[str]:
    """The variables that one of the tables has anything of, in the order of menus."""
    known = {name for table in _tables(comparison.comparison_of(scene)).values() for name in known_variables(table)}
    return [name for name in VARIABLES if name in known or not known]


def _kept(scene: bpy.types.Scene) -> _Kept:
    if scene.session_uid not in _scenes:
        for gone in _scenes.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _scenes[gone]
        _scenes[scene.session_uid] = _Kept()
    return _scenes[scene.session_uid]


def _tables(compared: comparison.SceneComparison) -> dict[int, Impacts]:
    """Source → its impacts."""
    found = {i + 1: one.impacts for i, one in enumerate(compared.others) if one.impacts is not None}
    return found if compared.impacts is None else {0: compared.impacts, **found}


def _is_there(hit: Hit, graph: ImpactGraph | None) -> bool:
    """Whether what was under the mouse is still in the graph, which may have been made again since."""
    if graph is None or hit.series >= len(graph.drawn):
        return False
    series = graph.drawn[hit.series].series
    return series.source == hit.source and hit.place < series.row.size and int(series.row[hit.place]) == hit.row


def _draw_graph(
    scene: bpy.types.Scene,
    canvas: Canvas,
    number: int,
    graph: ImpactGraph,
    tile: Rectangle,
    compared: comparison.SceneComparison,
    chosen: selection.Chosen,
) -> None:
    look, settings = canvas.look, scene.rockfall_graphs
    x, y = graph.axes(graph_settings.spec_of(graph_settings.graph(scene, number), number))
    fits = [one for one in graph.measured if one.curve is not None]
    models = [one for one in graph.drawn if one.series.model]
    lines = 1 + (bool(fits and models) and tile.height > FULL_HEIGHT * look.text)
    seen = frame(tile, x, y, look.text, look.measure, (lines * LINE + 0.4) * look.text)
    canvas.frames[number] = seen
    pointed = canvas.part if canvas.graph == number else ""
    draw_axes(seen, look, pointed)
    with drawing.in_axes(seen, graph.x, graph.y) as bounds:
        for one in graph.drawn:
            if one.series.source > 0:
                _draw_points(one, look, bounds)
        with drawing.clipped(seen.plot):
            for one in graph.drawn:
                if one.links is not None:
                    one.links.draw(alpha(look.faint, 0.35), look.line)
            if settings.error_bars == "ALWAYS":
                graph.error_bars(compared).draw(alpha(look.faint, 0.8), look.line)
            for one in graph.drawn:
                if one.line is not None:
                    one.line.draw(alpha(mixed(one.colour, look.plot, 0.15)), 1.6 * look.scale)
        for one in graph.drawn:
            if one.series.source == 0:
                _draw_points(one, look, bounds)
        if chosen:
            rings, links = graph.chosen(chosen, look.chosen)
            with drawing.clipped(seen.plot):
                links.draw(alpha(look.chosen, 0.7), look.line)
            rings.draw(look.point, bounds)
        if pointed and canvas.hit is not None:
            _draw_pointed(canvas, graph, compared, seen.plot, bounds)
    _draw_fits(canvas, graph, fits, seen, lines)
    if lines > 1 or not fits:
        _draw_scores(canvas, graph, models, seen, compared, rows_of(scene, compared)[0])
    said = empty.in_graph(graph, compared)
    if said:
        empty.draw_in_plot(seen.plot, look, said)


def _draw_points(one: Drawn, look: Look, bounds: tuple[float, float, float, float]) -> None:
    """The points of one source, outlined unless they are very many."""
    rim = 0.0 if len(one.series.points) > MANY else 0.8 * look.scale
    hollow = 1.6 * look.scale if one.hollow and len(one.series.points) <= MANY else 0.0
    one.points.draw(look.point * (1.15 if one.series.model else 1.0), bounds, look.plot, rim, hollow)


def _draw_pointed(
    canvas: Canvas,
    graph: ImpactGraph,
    compared: comparison.SceneComparison,
    plot: Rectangle,
    bounds: tuple[float, float, float, float],
) -> None:
    """The point under the mouse, its error bars, and all other points of the same impact."""
    hit, look = canvas.hit, canvas.look
    one = graph.drawn[hit.series]
    with drawing.clipped(plot):
        if not one.series.model and bpy.context.scene.rockfall_graphs.error_bars != "NEVER":
            drawing.Lines(graph.bar(compared, one, np.array([hit.place]))).draw(alpha(look.ink), look.line)
        if hit.source == 0:
            drawing.Lines(graph.links_of(np.array([hit.row]))).draw(alpha(look.ink, 0.8), look.line)
    same = [
        graph.places_of(each)[each.series.row == hit.row] for each in graph.drawn if each.series.source == hit.source
    ]
    drawing.Points(np.concatenate(same), look.ink, 2.0, "ring").draw(look.point, bounds)


def _draw_fits(canvas: Canvas, graph: ImpactGraph, fits: list[Drawn], seen: Frame, lines: int) -> None:
    """Above the plot: the fit of the measured points to the left, what lies beyond the axes to the right."""
    look, plot = canvas.look, seen.plot
    top, room = plot.top + (0.45 + (lines - 1) * LINE) * look.text, plot.width
    outside = graph.beyond(seen.x, seen.y)
    if outside:
        words = _beyond_text(outside, look, 0.5 * room)
        room -= drawing.text(plot.right, top, words, look.text, look.faint, (1.0, 0.0)) + look.text
    for one in fits:
        drawing.text(plot.left, top, _fitting(_fit_texts(one, graph), look, room), look.text, one.colour)


def _draw_scores(
    canvas: Canvas,
    graph: ImpactGraph,
    models: list[Drawn],
    seen: Frame,
    compared: comparison.SceneComparison,
    kept: Mask,
) -> None:
    """Directly above the plot: of each model its fit, where fits are drawn, and how near it comes."""
    look, plot = canvas.look, seen.plot
    x, right = plot.left, plot.right
    if graph.beyond(seen.x, seen.y) and not any(one.curve is not None for one in graph.measured):
        right -= 0.5 * plot.width  # of the same line
    said = [_said(one, graph, compared, kept, alone=len(models) == 1, first=one is models[0]) for one in models]
    for level in range(max(map(len, said), default=0)):  # all in the same way, the longest that has room
        words = [texts[min(level, len(texts) - 1)] for texts in said]
        if sum(look.measure(each) + look.text for each in words if each) <= right - x + look.text:
            break
    for one, each in zip(models, words, strict=True) if said else ():
        if each and x + look.measure(each) <= right:
            x += drawing.text(x, plot.top + 0.45 * look.text, each, look.text, one.colour) + look.text


def _said(
    one: Drawn, graph: ImpactGraph, compared: comparison.SceneComparison, kept: Mask, *, alone: bool, first: bool
) -> list[str]:
    """What can be said of a model, the longest first: its fit where there is one, and its score.

    first : of the line, so that it says what the numbers of the others are.
    """
    fits = [""] if one.curve is None else _fit_texts(one, graph)[0 if alone else 2 :]
    score = _score_text(one, graph, compared, kept)
    if not score:
        return fits
    bare = score if first else score.removeprefix("RMSE ").removesuffix(" filtered")
    return [*(f"{text}, {score}" if text else score for text in fits), bare]


def _fit_texts(one: Drawn, graph: ImpactGraph) -> list[str]:
    """What can be said of a fit, the longest first."""
    curve = one.curve
    r2 = f"R² {curve.fit.r2:.2f}".replace("-", "−") if curve.is_fitted else ""
    rank = f", ρ {curve.rank:.2f}".replace("-", "−") if np.isfinite(curve.rank) and r2 else ""
    return [curve_text(curve, graph.spec), curve_text(curve, graph.spec, full=False), f"{r2}{rank}", r2, ""]


def _score_text(one: Drawn, graph: ImpactGraph, compared: comparison.SceneComparison, kept: Mask) -> str:
    """How near a model comes to the impacts that pass the filters: without any, as `rockfall compare` has it."""
    which = "B" if one.hollow or "A" not in compared.predictions else "A"
    some = not kept.all()
    error = comparison_scores.rmse_of(compared, which, one.series.model, graph.spec.y, kept if some else None)
    return f"RMSE {error:.2f}{' filtered' if some else ''}" if np.isfinite(error) else ""


def _fitting(texts: list[str], look: Look, room: float) -> str:
    """The longest text that has room."""
    return next((text for text in texts if look.measure(text) <= room), "")


def _beyond_text(outside: list[tuple[float, int, int]], look: Look, room: float) -> str:
    """As many of the values beyond the axes as there is room for, the largest first."""
    values = [f"{value:.3g}".replace("-", "−") for value, _, _ in outside]
    for count in range(len(values), 0, -1):
        if count > 12:
            continue
        more = f" + {len(values) - count}" if count < len(values) else ""
        words = f"beyond: {', '.join(values[:count])}{more}"
        if look.measure(words) <= room:
            return words
    return f"{len(values)} beyond"


def _draw_card(canvas: Canvas, graph: ImpactGraph, hit: Hit, compared: comparison.SceneComparison) -> None:
    """What is known of the impact under the mouse."""
    impacts, drawn = _tables(compared)[hit.source], graph.drawn[hit.series]
    name = f"{impacts.trajectory[hit.row]}, impact {impacts.impact[hit.row]}"
    first = name if hit.source == 0 else f"{impacts.site[hit.row]}: {name}"
    flags = impacts.flag_text()[hit.row] if len(impacts) < 20_000 else ""
    last = [f"Flags: {flags.replace(';', ', ').replace('_', ' ')}"] if flags else []
    for short in (False, True):
        rows = [first, *_card_values(impacts, drawn, graph, hit, short), *last]
        if max(canvas.look.measure(row) for row in rows) < canvas.room.width - 2 * canvas.look.text:
            break
    drawing.card(canvas.pointer, rows, canvas.look, canvas.room)


def _card_values(impacts: Impacts, drawn: Drawn, graph: ImpactGraph, hit: Hit, short: bool) -> list[str]:
    """The values of an impact with their errors, and what a model makes of it.

    short : symbols in place of words.
    """
    found, row = [], np.array([hit.row])
    for axis, name in ((1, graph.spec.y), (0, graph.spec.x)):
        variable = VARIABLES[name]
        words = symbol(name) if short else variable.title
        value, ends = float(measured_values(impacts, row, name)[0]), measured_interval(impacts, row, name)[0]
        attribute = name.removesuffix("_deg")
        if attribute in impacts.intervals and undetermined(attribute, impacts.intervals[attribute][row])[0]:
            found.append(f"{words}: {_quantity(value, NO_ENDS, variable.unit)} (undetermined)")
        else:
            found.append(f"{words}: {_quantity(value, ends, variable.unit)}")
        if drawn.series.model and variable.restituted:
            model = float(drawn.series.points[hit.place, axis])
            found.append(f"    {drawn.series.title}: {_quantity(model, NO_ENDS, variable.unit)}")
    return found


def _quantity(value: float, ends: np.ndarray, unit: str) -> str:
    """A number for people, with its 95 % interval (2,) and unit."""
    if not np.isfinite(value):
        return "not defined"
    space = "" if unit in ("", "°") else " "
    low, high = ends
    if low < high:
        width = 2 * max(value - low, 1e-9) if np.isinf(high) else high - low
        digits = max(0, 1 - int(np.floor(np.log10(width / 4))))
        upper = "or more" if np.isinf(high) else f"to {high:.{digits}f}"
        return f"{value:.{digits}f}{space}{unit} ({low:.{digits}f} {upper})".replace("-", "−")
    text = f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{text}{space}{unit}".replace("-", "−")
