# SPDX-License-Identifier: GPL-3.0-or-later
"""Linked graphs for a browser (Bokeh): one table of points, so what is selected in one graph is in all.

Axes, fits, scores, colours, filters and the models that are shown work in the browser, by assets/report/graphs.js;
whoever shows other parameters only replaces columns of the table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from ..impact_models.registry import find_model
from ..reconstruction.impact import Impacts
from .colouring import model_shape
from .comparison import Predictions
from .curves import PAIRS
from .graphs import PAPER_GRAPHS, GraphSpec
from .linked_columns import (
    LOOKS,
    chosen_columns,
    hues,
    looks,
    measured_columns,
    model_columns,
    palettes,
    students,
    symbol_html,
    variable_facts,
)
from .variables import VARIABLES

WEB = Path(__file__).parents[2] / "assets" / "report"
FONT = "Inter, system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
SHEET = f"""
:host {{ font-family: {FONT}; font-size: 13px; color: var(--ink); }}
.bk-input, .bk-btn {{ font-family: inherit !important; font-size: 13px; border-radius: 6px; }}
.bk-input, .choices__inner, .choices__list--dropdown, .choices__input {{
  background-color: var(--field) !important; color: var(--ink) !important; border-color: var(--line) !important;
}}
.choices__item--selectable.is-highlighted, .bk-btn-default:hover {{ background-color: var(--hover) !important; }}
.bk-btn-default {{ background-color: var(--field); color: var(--ink); border-color: var(--line); }}
.bk-btn-default.bk-active {{ background-color: var(--hover); border-color: var(--muted); }}
.bk-spin-btn {{ background-color: var(--field) !important; }}
select.bk-input {{
  padding-top: 3px; padding-bottom: 3px; height: 30px; text-overflow: ellipsis;
  background-image: url("data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 8 8'%3E\
%3Cpath d='M1 2.5L4 6L7 2.5' fill='none' stroke='%23808890' stroke-width='1.2'/%3E%3C/svg%3E") !important;
}}
.bk-input-group > label, .bk-slider-title {{ color: var(--muted); font-size: 12px; }}
.remark {{ margin-bottom: 6px; }}
.warning, .problem {{ color: var(--caution); }}
.fit, .score, .beyond {{ overflow-wrap: anywhere; padding-left: 20px; }}
.fit svg {{
  width: 14px; height: 14px; margin: 0 6px 0 -20px; stroke-width: 0; overflow: visible; vertical-align: -2px;
}}
.score, .beyond {{ color: var(--muted); }}
"""
UPDATE = "update"
"""Name of the only callback, whose text stands in the page: a text that is compiled later needs a page that allows to
run any text (`unsafe-eval`)."""
UPDATE_NEEDS = (
    "source", "passing", "graphs", "variables", "pairs", "models", "columns", "palettes", "looks", "students", "begin",
    "edited", "other", "selection",
)  # fmt: skip
TOOLTIP = """
<div style="font: 12px/1.5 {font}; color: {ink}">
<b>@trajectory, impact @impact</b>
<table style="border-spacing: 8px 0; margin: 2px -8px 0">
<tr style="color: {muted}"><td></td><td>measured</td><td style="color: {colour}">{title}</td></tr>
{rows}
</table></div>
"""
HOVER_ROWS = ("theta1_deg", "vn1_mps", "vt1_mps", "rn", "rt", "r", "theta_dev_deg")
MARKS = {
    "diamond": ("diamond", "M0 -6L5 0L0 6L-5 0Z"),
    "square": ("square", "M-4 -4H4V4H-4Z"),
    "triangle": ("triangle", "M0 -5L5 4H-5Z"),
    "down": ("inverted_triangle", "M0 5L5 -4H-5Z"),
    "cross": ("x", "M-4 -4L4 4M-4 4L4 -4"),
    "plus": ("plus", "M-1.5 -5H1.5V-1.5H5V1.5H1.5V5H-1.5V1.5H-5V-1.5H-1.5Z"),
    "hexagon": ("hex", "M-5 0L-2.5 -4.3H2.5L5 0L2.5 4.3H-2.5Z"),
    "star": ("star", "M0 -6L1.5 -2L5.7 -1.9L2.4 .8L3.5 4.9L0 2.5L-3.5 4.9L-2.4 .8L-5.7 -1.9L-1.5 -2Z"),
}
"""Shape of a model → the browser's marker, and its outline in the list of models."""


@dataclass(frozen=True, eq=False)
class LinkedGraphs:
    """The parts of a page.

    Attributes
    ----------
    graphs : name → a graph with its menus and notes.
    source : the table of points; m_<variable> measured, p<i>_<variable> of the i-th model.
    selection : says what is selected.
    """

    graphs: Mapping[str, Any]
    source: Any
    selection: Any


def link_graphs(
    impacts: Impacts,
    predictions: Predictions,
    run: int,
    shown: Sequence[str],
    specs: Sequence[GraphSpec] = PAPER_GRAPHS,
    edited: Any = None,
    other_run: int | None = None,
) -> LinkedGraphs:
    """The graphs of a run of some models.

    Parameters
    ----------
    shown : models that are shown at first, of those of `predictions`.
    edited : a menu of models; the one chosen there is always shown.
    other_run : that the reader can have instead.
    """
    from bokeh.layouts import column, row
    from bokeh.models import BooleanFilter, CDSView, ColumnDataSource, CustomJS, Div, InlineStyleSheet

    sheet = InlineStyleSheet(css=SHEET)
    models = list(enumerate(predictions.models))

    def of_run(number: int) -> dict[str, Any]:
        tables = [model_columns(impacts, predictions, name, number, i) for i, name in models]
        return {name: values for table in tables for name, values in table.items()}

    source = ColumnDataSource({**measured_columns(impacts, predictions), **of_run(run)}, name="points")
    passing = BooleanFilter(syncable=False)
    view = CDSView(filter=passing)
    variables = variable_facts(impacts, predictions)
    blocks = [_block(spec, variables, source, view, predictions.models, sheet) for spec in specs]
    selection = Div(text="", name="selection", disable_math=True, stylesheets=[sheet], sizing_mode="stretch_width")
    colours = hues(predictions.models)
    update = CustomJS(
        args={
            "source": source,
            "passing": passing,
            "graphs": [{key: value for key, value in block.items() if key != "top"} for block in blocks],
            "variables": variables,
            "pairs": {" ".join(pair): trend for pair, trend in PAIRS.items()},
            "models": [_described(name, colours[name]) for name in predictions.models],
            "columns": [{**one, "mappers": _mappers(one)} for one in chosen_columns(impacts, predictions)],
            "palettes": palettes(),
            "looks": looks(),
            "students": students(),
            "begin": list(shown),
            "edited": edited,
            "other": None if other_run is None else of_run(other_run),
            "selection": selection,
        },
        code=UPDATE,
    )
    source.js_on_change("data", update)
    source.selected.js_on_change("indices", update)
    if edited is not None:
        edited.js_on_change("value", update)
    for block in blocks:
        for widget in (block["x"], block["y"]):
            widget.js_on_change("value", update)
        block["log"].js_on_change("active", update)
    graphs = {
        spec.name: column(
            row(*block["top"], sizing_mode="stretch_width", css_classes=["axes"]),
            block["plot"],
            block["note"],
            sizing_mode="stretch_width",
            css_classes=["graph"],
            name=f"{spec.name}_graph",
        )
        for spec, block in zip(specs, blocks, strict=True)
    }
    return LinkedGraphs(graphs, source, selection)


def update_script() -> str:
    """What the page does when data, menus or the selection change, as JavaScript; see assets/report/page.html."""
    code = "\n".join((WEB / name).read_text(encoding="utf-8") for name in ("fits.js", "graphs.js"))
    return f"({{ {', '.join(UPDATE_NEEDS)} }}) => {{\n{code}\n}}"


def _described(name: str, colour: str) -> dict[str, str]:
    """What the browser must know of a model."""
    shape = model_shape(name)
    stroke = ' style="stroke-width:2"' if shape == "cross" else ""
    mark = f'<path d="{MARKS[shape][1]}"{stroke}/>'
    return {"name": name, "title": find_model(name).title, "colour": colour, "mark": mark}


def _mappers(column: Mapping[str, Any]) -> dict[str, Any]:
    """Scheme → colours of a column's values."""
    from bokeh.models import CategoricalColorMapper, LinearColorMapper

    known = palettes()
    if "groups" in column:
        groups = column["groups"]
        return {
            scheme: CategoricalColorMapper(
                factors=groups, palette=[known[scheme][i % len(known[scheme])] for i in range(len(groups))]
            )
            for scheme in LOOKS
        }
    low, high = column["ends"]
    one = LinearColorMapper(palette=known["scale"], low=low, high=high, nan_color="#808080")
    return dict.fromkeys(LOOKS, one)


def _block(
    spec: GraphSpec, variables: Mapping[str, Any], source: Any, view: Any, models: Sequence[str], sheet: Any
) -> dict[str, Any]:
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
        outline_line_color=None,
        output_backend="canvas",
        name=spec.name,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.axis.minor_tick_line_color = None
    for axis in plot.axis:
        axis.axis_label_text_font = axis.major_label_text_font = FONT
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size, axis.major_label_text_font_size = "13px", "12px"
    common: dict[str, Any] = {"source": source, "view": view, "nonselection_alpha": 0.1, "selection_alpha": 1.0}
    shown = []
    for i, name in enumerate(models):
        x, y = (f"p{i}_{axis}" if VARIABLES[axis].restituted else f"m_{axis}" for axis in (spec.x, spec.y))
        links = plot.segment(x0=f"m_{spec.x}", y0=f"m_{spec.y}", x1=x, y1=y, line_width=1.0, **common)
        shape = model_shape(name)
        points = plot.scatter(
            x, y, marker=MARKS[shape][0], size=9, line_width=2.0 if shape == "cross" else 0.0, alpha=0.8, **common
        )
        tooltip = _tooltip(i, escape(find_model(name).title))
        plot.add_tools(HoverTool(tooltips=tooltip, renderers=[points], point_policy="snap_to_data", visible=False))
        shown.append({"points": _looks(points), "links": _looks(links), "renderers": [points, links]})
    measured = plot.scatter(f"m_{spec.x}", f"m_{spec.y}", size=6.5, line_color=None, alpha=0.8, **common)
    plot.add_tools(HoverTool(tooltips=_tooltip(), renderers=[measured], point_policy="snap_to_data", visible=False))
    lines = ColumnDataSource({"xs": [], "ys": [], "colour": []}, name=f"{spec.name}_lines", syncable=False)
    plot.multi_line("xs", "ys", source=lines, line_color="colour", line_width=1.8)

    names = [(name, VARIABLES[name].label) for name in variables]
    menus: dict[str, Any] = {"options": names, "stylesheets": [sheet], "sizing_mode": "stretch_width"}
    y_menu = Select(value=spec.y, name=f"{spec.name}_y", **menus)
    x_menu = Select(value=spec.x, name=f"{spec.name}_x", **menus)
    active = [i for i, log in enumerate((spec.x_log, spec.y_log)) if log]
    log = CheckboxButtonGroup(
        labels=["log x", "log y"], active=active, width=96, name=f"{spec.name}_log", stylesheets=[sheet]
    )
    against = Div(text="against", stylesheets=[sheet], styles={"color": "var(--muted)", "line-height": "30px"})
    return {
        "plot": plot,
        "measured": _looks(measured),
        "models": shown,
        "lines": lines,
        "x": x_menu,
        "y": y_menu,
        "log": log,
        "note": Div(
            text="", name=f"{spec.name}_note", disable_math=True, stylesheets=[sheet], sizing_mode="stretch_width"
        ),
        "scales": [[LinearScale(), LogScale()], [LinearScale(), LogScale()]],
        "tickers": [[BasicTicker(), LogTicker()], [BasicTicker(), LogTicker()]],
        "top": (y_menu, against, x_menu, log),
    }


def _looks(renderer: Any) -> list[Any]:
    """The glyphs with which a renderer draws its points, selected or not."""
    return [renderer.glyph, renderer.selection_glyph, renderer.nonselection_glyph]


def _tooltip(place: int | None = None, title: str = "") -> str:
    """Values of the impact under the pointer, and beside them those of a model."""
    rows = []
    for name in HOVER_ROWS:
        variable = VARIABLES[name]
        unit = f" {variable.unit}" if variable.unit else ""
        model = f"@p{place}_{name}{{0.00}}{unit}" if variable.restituted and place is not None else ""
        rows.append(f"<tr><td>{symbol_html(variable)}</td><td>@m_{name}{{0.00}}{unit}</td><td>{model}</td></tr>")
    light = looks()["light"]
    return TOOLTIP.format(
        font=FONT.replace('"', "'"),
        ink=light["ink"],
        muted=light["muted"],
        colour=light["model"],
        title=title,
        rows="\n".join(rows),
    )
