# SPDX-License-Identifier: GPL-3.0-or-later
"""What the editor says when there is nothing to draw, and what to do next."""

from dataclasses import dataclass

import bpy
import numpy as np

from ....core.analysis.graph_layout import Rectangle
from ....core.analysis.variables import VARIABLES
from ....core.vectors import Mask
from ...scene import next_step
from ...scene.models.comparison import SceneComparison
from ...scene.storage import store
from ..wrapping import broken
from . import drawing
from .editor import Canvas, button
from .impact_graphs import ImpactGraph
from .look import Look, alpha

BUTTONS = {
    "rockfall.load_footage_demo": "Load Footage Demo",
    "rockfall.load_demo": "Load Demo",
    "rockfall.import_terrain": "Import Terrain",
    "rockfall.open_project": "Open Project",
    "rockfall.add_video": "Add Video",
    "rockfall.import_picks": "Import Picks",
    "rockfall.propose_impacts": "Propose Impacts",
    "rockfall.clear_graph_filters": "Clear Filters",
}
"""Operators that can be offered, with their texts."""
LINE = 1.5


@dataclass(frozen=True)
class Said:
    """A headline, a sentence, and operators that help."""

    title: str
    sentence: str
    operators: tuple[str, ...] = ()


def nothing(scene: bpy.types.Scene, compared: SceneComparison, kept: list[Mask]) -> Said | None:
    """Why there is no impact at all to be drawn; None when there is one."""
    if any(mask.any() for mask in kept):
        return None
    if any(len(mask) for mask in kept):
        return Said(
            "All impacts are hidden",
            f"The filters hide all {sum(map(len, kept))} impacts. Clear them, or widen them in the sidebar (N).",
            ("rockfall.clear_graph_filters",),
        )
    if compared.problems:
        return Said("There are no impacts to show", " ".join(compared.problems))
    if store.has_role(scene, store.PICK_ROLE):
        return Said(
            "There are no impacts yet",
            "Picks alone have no velocities: it takes two picks of one block for a flight, and three for an impact "
            "with a flight before and after it. Pick the next impacts in step 4.",
        )
    step = next_step.next_step(scene)
    return Said("There are no impacts yet", step.sentence, tuple(one for one in step.actions if one in BUTTONS))


def in_graph(graph: ImpactGraph, compared: SceneComparison) -> str:
    """Why a graph has no measured point; empty when it has one."""
    if any(one.series.defined.any() for one in graph.measured):
        return ""
    spec, count = graph.spec, sum(one.series.row.size for one in graph.measured)
    lacking = [name for name in dict.fromkeys((spec.x, spec.y)) if not _any(graph, name)]
    words = " and no ".join(VARIABLES[name].title.lower() for name in lacking or (spec.y,))
    many = "The only impact shown has" if count == 1 else f"None of the {count} impacts shown has"
    many = many if count == 1 or not lacking else f"The {count} impacts shown have"
    no = "no " if lacking else "both "
    if not lacking:
        return f"{many} {no}values: choose another variable by a click on the axis."
    return f"{many} {no}{words}. {_unused(graph, compared) or _reason(lacking[0])}"


def draw(canvas: Canvas, said: Said) -> None:
    """In the middle of the editor."""
    look, room = canvas.look, canvas.room
    lines = broken(said.sentence, min(0.86 * room.width, 42 * look.text), look.measure)
    rows = -(-len(said.operators) // 2) if said.operators else 0
    height = (1.8 + LINE * len(lines) + 2.8 * rows + 0.6) * look.text
    y = room.bottom + (room.height + height) / 2 - look.text
    middle = room.left + room.width / 2
    drawing.text(middle, y, said.title, 1.25 * look.text, look.ink, (0.5, 0.5))
    y -= 2.0 * look.text
    for line in lines:
        drawing.text(middle, y, line, look.text, look.faint, (0.5, 0.5))
        y -= LINE * look.text
    y -= 1.8 * look.text
    for start in range(0, len(said.operators), 2):
        row = said.operators[start : start + 2]
        widths = [look.measure(BUTTONS[one]) + 2.4 * look.text for one in row]
        x = middle - (sum(widths) + 0.8 * look.text * (len(row) - 1)) / 2
        for one in row:
            x += button(canvas, round(x), round(y), BUTTONS[one], one).width + 0.8 * look.text
        y -= 2.8 * look.text


def draw_in_plot(plot: Rectangle, look: Look, sentence: str) -> None:
    """In the middle of a graph."""
    lines = broken(sentence, 0.9 * plot.width, look.measure)
    y = plot.bottom + (plot.height + LINE * look.text * (len(lines) - 1)) / 2
    for line in lines:
        wide = look.measure(line) + look.text
        back = Rectangle(plot.left + (plot.width - wide) / 2, y - 0.75 * look.text, wide, LINE * look.text)
        drawing.fill(back, alpha(look.plot, 0.85))
        drawing.text(plot.left + plot.width / 2, y, line, look.text, look.faint, (0.5, 0.5))
        y -= LINE * look.text


def _any(graph: ImpactGraph, name: str) -> bool:
    column = 0 if name == graph.spec.x else 1
    return any(bool(np.isfinite(one.series.points[:, column]).any()) for one in graph.measured)


def _unused(graph: ImpactGraph, compared: SceneComparison) -> str:
    """That all of the scene's impacts that are shown were put aside; empty when that is not so."""
    rows = next((one.series.row for one in graph.measured if one.series.source == 0), np.empty(0, dtype=np.intp))
    if compared.impacts is None or not rows.size:
        return ""
    flags = compared.impacts.flags
    aside = (flags["discarded"] | flags["shattered"])[rows]
    if not aside.all():
        return ""
    return "All are discarded or shattered: nothing is computed across them. Change the status of some picks."


def _reason(name: str) -> str:
    if name in ("rn", "rt", "r", "theta1_deg", "theta_dev_deg") or name.startswith("v"):
        return "First, last and departing impacts have none: an impact needs a flight before and after it."
    if name.startswith(("rotational", "omega")):
        return "It needs the spin of the block, which is not measured here."
    if name.startswith("scar"):
        return "It is a column of tables of scars; this one has none."
    if name in ("slope_deg", "normal_spread_deg", "bounce_height_m"):
        return "It needs a terrain."
    return "Choose another variable by a click on the axis."
