# SPDX-License-Identifier: GPL-3.0-or-later
"""Four linked graphs for a browser (Bokeh): one table of points, so what is selected in one graph is in all.

The axes, the lists of what lies beyond them and the choice of variables work in the browser, by
assets/report/graphs.js; whoever shows another model only replaces columns of the table and the curves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..reconstruction.impact import Impacts
from .comparison import Predictions
from .curves import PAIRS
from .figures import LINK, MEASURED, MODELLED
from .graphs import PAPER_GRAPHS, Graph, GraphSpec, axis_limits, make_graph
from .variables import VARIABLES, Variable, find_variable, known_variables, measured_values, model_values

WEB = Path(__file__).parents[2] / "assets" / "report"
FONT = "Inter, system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
INK, MUTED, GRID, CAUTION = "#20262e", "#5b6470", "#eceef1", "#8f4a00"
SHEET = f"""
:host {{ font-family: {FONT}; font-size: 13px; color: {INK}; }}
.bk-input, .bk-btn {{ font-family: inherit !important; font-size: 13px; border-radius: 6px; }}
select.bk-input {{ padding-top: 3px; padding-bottom: 3px; height: 30px; }}
.bk-input-group > label, .bk-slider-title {{ color: {MUTED}; font-size: 12px; }}
.remark {{ margin-bottom: 6px; }}
.warning, .problem {{ color: {CAUTION}; }}
"""
TOOLTIP = """
<div style="font: 12px/1.5 {font}; color: {ink}">
<b>@trajectory, impact @impact</b>
<table style="border-spacing: 8px 0; margin: 2px -8px 0">
<tr style="color: {muted}"><td></td><td>measured</td><td style="color: {model}">model</td></tr>
{rows}
</table></div>
"""
HOVER_ROWS = ("theta1_deg", "vn1_mps", "vt1_mps", "rn", "rt", "r", "theta_dev_deg")


@dataclass(frozen=True, eq=False)
class LinkedGraphs:
    """The parts of a page.

    Attributes
    ----------
    layout : all graphs, two beside each other.
    source : the table of points; m_<variable> measured, p_<variable> the model's.
    curves : name of a graph → table of its fitted curves.
    selection : says what is selected.
    """

    layout: Any
    source: Any
    curves: Mapping[str, Any]
    selection: Any


def link_graphs(
    impacts: Impacts, predictions: Predictions, model: str, run: int, specs: Sequence[GraphSpec] = PAPER_GRAPHS
) -> LinkedGraphs:
    """The graphs of one model's run; `predictions` holds all models that may be shown, for the limits of the axes."""
    from bokeh.layouts import column, row
    from bokeh.models import ColumnDataSource, CustomJS, Div, InlineStyleSheet

    sheet = InlineStyleSheet(css=SHEET)
    source = ColumnDataSource(
        {**measured_columns(impacts, predictions), **model_columns(impacts, predictions, model, run)},
        name="points",
    )
    fitted = curve_tables(impacts, predictions, model, run, specs)
    curves = {name: ColumnDataSource(table) for name, table in fitted.items()}
    variables = {name: _facts(VARIABLES[name], impacts, predictions) for name in known_variables(impacts)}
    blocks = [_block(spec, variables, source, curves[spec.name], sheet) for spec in specs]
    selection = Div(text="", name="selection", disable_math=True, stylesheets=[sheet], sizing_mode="stretch_width")
    update = CustomJS(
        args={
            "source": source,
            "graphs": [{key: value for key, value in block.items() if key != "top"} for block in blocks],
            "variables": variables,
            "pairs": {" ".join(pair): trend for pair, trend in PAIRS.items()},
            "colours": [MEASURED, MODELLED],
            "selection": selection,
        },
        code=(WEB / "graphs.js").read_text(encoding="utf-8"),
    )
    source.js_on_change("data", update)
    source.selected.js_on_change("indices", update)
    for block in blocks:
        for widget in (block["x"], block["y"]):
            widget.js_on_change("value", update)
        block["log"].js_on_change("active", update)
        block["curves"].js_on_change("data", update)
    cells = [
        column(
            row(*block["top"], sizing_mode="stretch_width", css_classes=["axes"]),
            block["plot"],
            block["note"],
            sizing_mode="stretch_width",
            css_classes=["graph"],
        )
        for block in blocks
    ]
    pairs = [row(*cells[i : i + 2], sizing_mode="stretch_width", spacing=24) for i in range(0, len(cells), 2)]
    return LinkedGraphs(column(*pairs, name="graphs", sizing_mode="stretch_width"), source, curves, selection)


def measured_columns(impacts: Impacts, predictions: Predictions) -> dict[str, Any]:
    """Names and measured values of the compared impacts."""
    columns: dict[str, Any] = {
        "trajectory": predictions.trajectory.tolist(),
        "impact": predictions.impact.tolist(),
    }
    for name in known_variables(impacts):
        columns[f"m_{name}"] = measured_values(impacts, predictions.row, name).astype(np.float32)
    return columns


def model_columns(impacts: Impacts, predictions: Predictions, model: str, run: int) -> dict[str, Any]:
    """Values of one model and run, of the variables that models change."""
    which = predictions.index(model)
    return {
        f"p_{name}": model_values(impacts, predictions, which, run, name).astype(np.float32)
        for name in known_variables(impacts)
        if VARIABLES[name].restituted
    }


def curve_tables(
    impacts: Impacts, predictions: Predictions, model: str, run: int, specs: Sequence[GraphSpec] = PAPER_GRAPHS
) -> dict[str, dict[str, list[Any]]]:
    """Name of a graph → its fitted curves, for a model's run."""
    return {spec.name: _curves(make_graph(impacts, spec, predictions, model, run)) for spec in specs}


def symbol_html(variable: Variable) -> str:
    """The symbol with its index set low."""
    letter, _, index = variable.tex.strip("$").replace(r"\theta", "θ").replace("|", "").partition("_")
    index = index.strip("{}")
    text = f"<i>{letter}</i>" + (f"<sub>{index}</sub>" if index else "")
    return f"|{text}|" if "|" in variable.tex else text


def _curves(graph: Graph) -> dict[str, list[Any]]:
    y, x = (symbol_html(find_variable(name)) for name in (graph.spec.y, graph.spec.x))
    slope = "<i>R</i><sub>T</sub>" if (graph.spec.x, graph.spec.y) == ("vt1_mps", "vt2_mps") else ""
    table: dict[str, list[Any]] = {"xs": [], "ys": [], "colour": [], "text": []}
    for curve, colour in ((graph.measured_curve, MEASURED), (graph.modelled_curve, MODELLED)):
        if curve is not None:
            table["xs"].append(curve.x)
            table["ys"].append(curve.y)
            table["colour"].append(colour)
            table["text"].append(curve.text(y, x, slope, "<sup>{}</sup>"))
    return table


def _facts(variable: Variable, impacts: Impacts, predictions: Predictions) -> dict[str, Any]:
    """What the browser must know of a variable."""
    values = [measured_values(impacts, predictions.row, variable.name)]
    if variable.restituted:
        for which in range(len(predictions.models)):
            for run in range(min(predictions.replicates, 1) + 1):
                values.append(model_values(impacts, predictions, which, run, variable.name))
    together = np.concatenate(values)
    fixed = next((spec.y_limits for spec in PAPER_GRAPHS if spec.y == variable.name and spec.y_limits), None)
    return {
        "label": variable.label,
        "symbol": symbol_html(variable) if variable.symbol else variable.title,
        "unit": variable.unit,
        "restituted": variable.restituted,
        "linear": list(fixed or axis_limits(together)),
        "log": list(axis_limits(together, log=True)),
    }


def _block(spec: GraphSpec, variables: Mapping[str, Any], source: Any, curves: Any, sheet: Any) -> dict[str, Any]:
    """One graph with its controls."""
    from bokeh.models import (
        BasicTicker,
        CheckboxButtonGroup,
        ColumnDataSource,
        Div,
        HoverTool,
        LinearScale,
        LogScale,
        LogTicker,
        Range1d,
        Select,
    )
    from bokeh.plotting import figure

    plot = figure(
        height=300,
        sizing_mode="stretch_width",
        x_range=Range1d(*variables[spec.x]["linear"]),
        y_range=Range1d(*variables[spec.y]["linear"]),
        x_axis_label=variables[spec.x]["label"],
        y_axis_label=variables[spec.y]["label"],
        tools="box_select,lasso_select,tap,pan,wheel_zoom,reset,save",
        active_drag="box_select",
        active_scroll=None,
        toolbar_location="above",
        background_fill_color="white",
        border_fill_color="white",
        outline_line_color=None,
        output_backend="canvas",
        name=spec.name,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.grid.grid_line_color = GRID
    plot.axis.axis_line_color = "#aab1ba"
    plot.axis.major_tick_line_color = "#aab1ba"
    plot.axis.minor_tick_line_color = None
    for axis in plot.axis:
        axis.axis_label_text_font = axis.major_label_text_font = FONT
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size, axis.major_label_text_font_size = "13px", "12px"
        axis.axis_label_text_color, axis.major_label_text_color = INK, MUTED
    faded = {"nonselection_alpha": 0.1, "selection_alpha": 1.0}
    model_x, model_y = (f"{'p' if VARIABLES[name].restituted else 'm'}_{name}" for name in (spec.x, spec.y))
    links = plot.segment(
        x0=f"m_{spec.x}",
        y0=f"m_{spec.y}",
        x1=model_x,
        y1=model_y,
        source=source,
        line_color=LINK,
        line_width=1.0,
        **faded,
    )
    modelled = plot.scatter(
        model_x,
        model_y,
        source=source,
        marker="diamond",
        size=9,
        color=MODELLED,
        line_color=None,
        alpha=0.8,
        **faded,
    )
    measured = plot.scatter(
        f"m_{spec.x}", f"m_{spec.y}", source=source, size=6.5, color=MEASURED, line_color=None, alpha=0.8, **faded
    )
    fitted = plot.multi_line("xs", "ys", source=curves, line_color="colour", line_width=1.8)
    own = ColumnDataSource({"xs": [], "ys": [], "colour": []}, syncable=False)
    own_fitted = plot.multi_line("xs", "ys", source=own, line_color="colour", line_width=1.8, visible=False)
    plot.add_tools(HoverTool(tooltips=_tooltip(), renderers=[measured, modelled], point_policy="snap_to_data"))

    names = [(name, VARIABLES[name].label) for name in variables]
    common: dict[str, Any] = {"options": names, "stylesheets": [sheet], "sizing_mode": "stretch_width"}
    y, x = Select(value=spec.y, name=f"{spec.name}_y", **common), Select(value=spec.x, name=f"{spec.name}_x", **common)
    active = [i for i, log in enumerate((spec.x_log, spec.y_log)) if log]
    log = CheckboxButtonGroup(
        labels=["log x", "log y"], active=active, width=96, name=f"{spec.name}_log", stylesheets=[sheet]
    )
    against = Div(text="against", stylesheets=[sheet], styles={"color": MUTED, "line-height": "30px"})
    return {
        "plot": plot,
        "links": _looks(links),
        "measured": _looks(measured),
        "modelled": _looks(modelled),
        "fitted": fitted,
        "own": own,
        "ownFitted": own_fitted,
        "curves": curves,
        "default": [spec.x, spec.y],
        "x": x,
        "y": y,
        "log": log,
        "note": Div(
            text="", name=f"{spec.name}_note", disable_math=True, stylesheets=[sheet], sizing_mode="stretch_width"
        ),
        "scales": [[LinearScale(), LogScale()], [LinearScale(), LogScale()]],
        "tickers": [[BasicTicker(), LogTicker()], [BasicTicker(), LogTicker()]],
        "top": (y, against, x, log),
    }


def _looks(renderer: Any) -> list[Any]:
    """The glyphs with which a renderer draws its points, selected or not."""
    return [renderer.glyph, renderer.selection_glyph, renderer.nonselection_glyph]


def _tooltip() -> str:
    rows = []
    for name in HOVER_ROWS:
        variable = VARIABLES[name]
        unit = f" {variable.unit}" if variable.unit else ""
        model = f"@p_{name}{{0.00}}{unit}" if variable.restituted else ""
        rows.append(f"<tr><td>{symbol_html(variable)}</td><td>@m_{name}{{0.00}}{unit}</td><td>{model}</td></tr>")
    return TOOLTIP.format(font=FONT.replace('"', "'"), ink=INK, muted=MUTED, model=MODELLED, rows="\n".join(rows))
