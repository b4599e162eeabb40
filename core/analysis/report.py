# SPDX-License-Identifier: GPL-3.0-or-later
"""One page with everything of a comparison: linked graphs, scores, provenance. It needs no network and no server."""

import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..errors import visible
from ..extras import PAGES, demand
from ..impact_models.registry import find_model
from ..output import write_text
from ..reconstruction.impact import Impacts
from .comparison import Predictions, thinned
from .linked_columns import symbol_html
from .linked_graphs import WEB, link_graphs, update_script
from .scores import Score
from .variables import VARIABLES

SHOWN = ("rn", "rt", "r", "theta_dev_deg")
MOST_SHOWN = 3000
"""Impacts that a page's graphs show: more make it slow, and too large to be sent."""
COMPONENTS = ("bokeh", "bokeh-widgets")
"""Of Bokeh's scripts, those that the graphs and their menus need."""
PARTS = {"bias": "bias", "rmse": "RMSE", "energy_distance": "distance"}
DECIMALS = {"theta_dev_deg": 1}


def write_report(
    impacts: Impacts,
    predictions: Predictions,
    scores: Sequence[Score],
    path: str | Path,
    origin: str = "",
    title: str = "",
) -> None:
    """Write the page.

    Parameters
    ----------
    origin : name of the table of impacts, for the summary and the provenance.
    title : the heading; "" for the usual one.

    Raises
    ------
    DependencyError : Bokeh is not installed.
    """
    demand(PAGES)
    from bokeh.document import Document

    first = _nearest_model(scores) or predictions.models[0]
    run = min(1, predictions.replicates)
    total = predictions
    predictions = thinned(predictions, MOST_SHOWN)
    linked = link_graphs(impacts, predictions, run, [first], other_run=0 if run else None)
    document = Document()
    title, origin = visible(title), visible(origin)
    document.title = title or f"Rockfall: {origin or 'impact models'}"
    with document.models.freeze():  # what belongs to the page is looked up once, not with each root
        for root in (*linked.graphs.values(), linked.selection):
            document.add_root(root)
    document.template_variables.update(
        heading=title or "Impact models against measured impacts",
        summary=summary(total, len(impacts), origin) + fewer_sentence(total, predictions),
        after=score_table(by_model(scores)) + provenance(predictions, origin),
        live=False,
        **frame(linked.graphs),
    )
    write_text(path, _standing_alone(document, dict(document.template_variables)))


def _standing_alone(document: Any, variables: dict[str, Any]) -> str:
    """A document as a page of its own, as Bokeh's `file_html` makes it, which goes through all models many times."""
    from bokeh.embed.bundle import bundle_for_objs_and_resources
    from bokeh.embed.elements import html_page_for_render_items
    from bokeh.embed.util import standalone_docs_json_and_render_items
    from bokeh.resources import Resources

    described, places = standalone_docs_json_and_render_items(document)
    scripts = bundle_for_objs_and_resources(None, Resources(mode="inline", components=list(COMPONENTS)))
    return html_page_for_render_items(scripts, described, places, document.title, template(), variables)


def template() -> str:
    """The page's frame, for a file and for a server alike."""
    text = (WEB / "page.html").read_text(encoding="utf-8")
    return text.split("{% extends base %}", 1)[1]


def frame(graphs: Mapping[str, Any]) -> dict[str, Any]:
    """What the frame needs besides its text."""
    return {
        "style": (WEB / "page.css").read_text(encoding="utf-8"),
        "graphs": [graph.name for graph in graphs.values()],
        "update": update_script(),
    }


def summary(predictions: Predictions, total: int, origin: str = "", chance: bool = True) -> str:
    """One sentence on what is compared; with the number of replicates, if `chance`."""
    drawn = f", and {predictions.replicates} replicates" if chance and predictions.replicates else ""
    columns = (predictions.site, predictions.trajectory, *predictions.runs.values())
    runs = len(set(zip(*(column.tolist() for column in columns), strict=True)))
    of = f" of {origin}" if origin else ""
    models = len(predictions.models)
    return (
        f"{predictions.row.size} of {total} impacts{of}, {runs} trajectories; "
        f"{models} model{'s' if models > 1 else ''} with the measured incident velocities imposed{drawn}."
    )


def fewer_sentence(all_of_them: Predictions, shown: Predictions) -> str:
    """That graphs show fewer impacts than there are; "" where they show all."""
    fewer = shown.row.size < all_of_them.row.size
    return f" The graphs, their fits and scores show {shown.row.size} of them, evenly spaced." if fewer else ""


def score_table(scores: Mapping[str, Sequence[Score]], title: str = "Scores") -> str:
    """Bias, root mean square error and energy distance, as HTML; the least of a column stands out.

    Parameters
    ----------
    scores : heading of a row → the scores of one model.
    """
    rows = {label: {score.quantity: score for score in these} for label, these in scores.items()}
    best = {
        (quantity, part): min((abs(getattr(row[quantity], part)) for row in rows.values()), default=0.0)
        for quantity in SHOWN
        for part in PARTS
    }
    groups = "".join(
        f'<th class="group" colspan="3">{symbol_html(VARIABLES[name])} [{VARIABLES[name].unit or "–"}]</th>'
        for name in SHOWN
    )
    names = "".join(f"<th>{name}</th>" for _ in SHOWN for name in PARTS.values())
    lines = []
    for label, row in rows.items():
        cells = []
        for quantity, part in best:
            value = getattr(row[quantity], part)
            digits = 2 if part == "energy_distance" else DECIMALS.get(quantity, 2)
            text = "–" if value != value else f"{value:{'+' if part == 'bias' else ''}.{digits}f}".replace("-", "−")
            mark = " class=best" if len(rows) > 1 and abs(value) == best[quantity, part] else ""
            interval = _interval(row[quantity]) if part == "rmse" else ""
            cells.append(f"<td{mark}{interval}>{text}</td>")
        lines.append(f"<tr><td>{escape(label)}</td>{''.join(cells)}</tr>")
    return (
        f'<h2>{escape(title)}</h2><div class="scroll"><table>'
        f"<thead><tr><th></th>{groups}</tr><tr><th>model</th>{names}</tr></thead>"
        f"<tbody>{''.join(lines)}</tbody></table></div>"
        '<p class="note">Bias and root mean square error of model − measured. Distance: energy distance between the '
        "two clouds of points in the plane of the graph, 0 for the same cloud; it counts the scatter too.</p>"
    )


def _interval(score: Score) -> str:
    """That of the root mean square error, shown under the pointer."""
    if score.rmse_low != score.rmse_low:
        return ""
    return f' title="{score.rmse_low:.3g}–{score.rmse_high:.3g} (95 %, by falls)"'


def by_model(scores: Sequence[Score]) -> dict[str, list[Score]]:
    """Title of each model → its scores."""
    rows: dict[str, list[Score]] = {}
    for score in scores:
        rows.setdefault(find_model(score.model).title, []).append(score)
    return rows


def provenance(predictions: Predictions, origin: str = "") -> str:
    """Versions, seed and all parameters, as HTML."""
    package = import_module((__package__ or "").partition(".core")[0])
    lines = {
        "Rockfall": str(package.__version__),
        "Python, NumPy, Bokeh": f"{platform.python_version()}, {version('numpy')}, {version('bokeh')}",
        "Written": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "Impacts": origin or "–",
        "Spin before the first impact": predictions.spin or "–",
        "Replicates, seed": f"{predictions.replicates}, {predictions.seed}",
    }
    facts = "".join(f"<tr><td>{escape(name)}</td><td>{escape(text)}</td></tr>" for name, text in lines.items())
    rows = "".join(_settings_row(model, settings) for model, settings in predictions.settings.items())
    return (
        f"<details><summary>Provenance</summary><table>{facts}</table>"
        f"<h2>Parameters</h2><table>{rows}</table></details>"
    )


def _settings_row(model: str, settings: Mapping[str, Any]) -> str:
    found = find_model(model)
    values = ", ".join(
        f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}" for name, value in settings.items()
    )
    return (
        f"<tr><td title='{escape(found.reference, quote=True)}'>{escape(found.title)}</td>"
        f"<td style='text-align:left; white-space:normal'>{escape(values)}</td></tr>"
    )


def _nearest_model(scores: Sequence[Score]) -> str:
    """The model whose clouds are nearest to the measured ones, over all graphs."""
    total: dict[str, float] = {}
    for score in scores:
        if score.quantity in SHOWN and score.n:
            total[score.model] = total.get(score.model, 0.0) + score.energy_distance
    return min(total, key=lambda name: total[name]) if total else ""
