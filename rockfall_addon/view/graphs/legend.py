# SPDX-License-Identifier: GPL-3.0-or-later
"""What the colours and shapes of the graphs mean, in one or two lines above them."""

import numpy as np

from ....core.analysis.graph_layout import Rectangle
from ....core.analysis.graph_series import Series
from ....core.colours import SPEED_SCALE
from ....core.impact_models.registry import MODELS
from ...scene.models.comparison import SceneComparison
from . import drawing
from .impact_graphs import ImpactGraph
from .look import Look, Rgb
from .point_colours import PointColours

STEP = 1.7
LINES, LINES_OF_TALL = 2, 4
TALL = 45
"""Height of a room that has place for more lines, in heights of the text."""
UNIT = (-1e9, -1e9, 1e9, 1e9)

Entry = tuple[str, Rgb, str, bool]
"""Text, colour, shape, hollow."""


def draw(
    room: Rectangle, look: Look, compared: SceneComparison, graph: ImpactGraph, colours: PointColours, links: bool
) -> float:
    """Draw the legend at the top of a room; the height that it takes [px].

    links : whether they are wanted; of very many, only some are drawn.
    """
    own = next((one for one in graph.drawn if not one.series.model and one.series.source == 0), None)
    entries: list[Entry] = []
    for one in ([own] if own else []) + [each for each in graph.drawn if each is not own]:
        count = f" ({_count(one.series, compared)})" if not one.series.model else ""
        entries.append((f"{one.series.title}{count}", one.colour, one.shape, one.hollow))
    if compared.impacts is not None and not compared.models:
        entries.append(("no model: choose some in the sidebar (N)", look.faint, "", False))
    if compared.waiting:
        which = MODELS[compared.waiting[0]].title if len(compared.waiting) == 1 else f"{len(compared.waiting)} models"
        entries.append((f"preparing {which} …", look.faint, "", False))
    if links and not graph.linked:
        entries.append(("links: of selected impacts only", look.faint, "", False))
    if colours.colouring is not None:
        entries.append((f"   {colours.colouring.title.split(' [')[0]}:", look.faint, "", False))
        entries += [(text or "empty", colour, "circle", False) for text, colour in colours.colouring.groups]
    most = LINES_OF_TALL if room.height > TALL * look.text else LINES
    bar = colours.colouring.ends if colours.colouring is not None else None
    lines = _lines(entries, look, room.width - look.text, most, 0.0 if bar is None else _bar_width(bar, look))
    top = room.top - 0.5 * STEP * look.text
    for i, line in enumerate(lines):
        x = room.left + look.text
        for text, colour, shape, hollow in line:
            x = _entry(x, top - i * STEP * look.text, text, colour, shape, hollow, look)
        if bar is not None and line[-1:] == entries[-1:]:
            _bar(x, top - i * STEP * look.text, bar, room.left + room.width, look)
    return len(lines) * STEP * look.text


def _count(series: Series, compared: SceneComparison) -> str:
    """How many points of a source have a place in the graph; with filters, how many impacts do not pass them."""
    table = compared.impacts if series.source == 0 else compared.others[series.source - 1].impacts
    shown, there = int(series.defined.sum()), 0 if table is None else len(table)
    return f"{shown}, {there - series.row.size} filtered out" if series.row.size < there else str(shown)


def _lines(entries: list[Entry], look: Look, width: float, most: int, after: float) -> list[list[Entry]]:
    """Entries line by line, with this room after the last one; those without room are counted."""
    lines: list[list[Entry]] = [[]]
    used, more = 0.0, look.measure("+ 100 more")
    for number, entry in enumerate(entries):
        wide = look.measure(entry[0]) + (2.4 if entry[2] else 1.2) * look.text
        wide += after if number == len(entries) - 1 else 0.0
        ends = len(lines) == most and number < len(entries) - 1  # then what is left must be counted
        if lines[-1] and used + wide + (more if ends else 0) > width:
            if len(lines) == most:
                left = len(entries) - number
                words = (f"+ {left} more", f"+ {left}")[used + more > width]
                lines[-1].append((words, look.faint, "", False))
                break
            lines.append([])
            used = 0.0
        lines[-1].append(entry)
        used += wide
    return lines


def _entry(x: float, y: float, text: str, colour: Rgb, shape: str, hollow: bool, look: Look) -> float:
    if shape:
        spot = drawing.Points(np.array([[x + 0.5 * look.text, y]]), colour, 1.2, shape)
        spot.draw(look.point, UNIT, look.back, 0.0, 1.6 * look.scale if hollow else 0.0)
        x += 1.2 * look.text
    return x + drawing.text(x, y, text, look.text, look.ink if shape else look.faint, (0.0, 0.5)) + 1.2 * look.text


def _bar_ends(ends: tuple[float, float]) -> tuple[str, str]:
    low, high = (f"{value:.3g}".replace("-", "−") for value in ends)
    return low, high


def _bar_width(ends: tuple[float, float], look: Look) -> float:
    low, high = _bar_ends(ends)
    return look.measure(low) + look.measure(high) + 8 * look.text


def _bar(x: float, y: float, ends: tuple[float, float], right: float, look: Look) -> None:
    """The scale between its ends, shorter where there is less room."""
    low, high = _bar_ends(ends)
    whole = max(min(7 * look.text, right - x - _bar_width(ends, look) + 7 * look.text), look.text)
    x += drawing.text(x, y, low, look.text, look.ink, (0.0, 0.5)) + 0.5 * look.text
    width = whole / len(SPEED_SCALE)
    for i, colour in enumerate(SPEED_SCALE):
        part = Rectangle(x + i * width, y - 0.4 * look.text, width + 1, 0.8 * look.text)
        drawing.fill(part, (float(colour[0]), float(colour[1]), float(colour[2])))
    drawing.text(x + whole + 0.5 * look.text, y, high, look.text, look.ink, (0.0, 0.5))
