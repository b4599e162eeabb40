# SPDX-License-Identifier: GPL-3.0-or-later
"""What the graphs of a page know: the table of points, its variables, and the columns that colour and filter it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..colours import scale_colours
from ..errors import visible
from ..reconstruction.impact import Impacts, fall_numbers
from ..vectors import Array
from .colouring import ONE_MODEL, Rgb, colour_by, group_colour, model_colours
from .columns import column_titles, find_column
from .comparison import Predictions
from .graphs import PAPER_GRAPHS, axis_limits
from .line_fits import student
from .variables import VARIABLES, Variable, known_variables, measured_values, model_values

LOOKS: Mapping[str, Mapping[str, str]] = {
    "light": {
        "ink": "#20262e",
        "muted": "#5b6470",
        "grid": "#eceef1",
        "axis": "#aab1ba",
        "paper": "#ffffff",
        "measured": "#20262e",
        "link": "#b4b9c1",
    },
    "dark": {
        "ink": "#e3e6ea",
        "muted": "#9aa4b1",
        "grid": "#2a3038",
        "axis": "#4d5662",
        "paper": "#16191d",
        "measured": "#f2f4f6",
        "link": "#565f6b",
    },
}
"""Colours of what the browser draws on its canvases; those of the page around them stand in page.css."""
GROUP_COLOURS, SCALE_COLOURS, STUDENTS = 60, 64, 200


def hex_colour(colour: Rgb | Array) -> str:
    """An sRGB colour as a page writes it."""
    red, green, blue = (round(255 * float(part)) for part in colour)
    return f"#{red:02x}{green:02x}{blue:02x}"


def looks() -> dict[str, dict[str, str]]:
    """Scheme → colours of the canvases; that of a model shown alone among them."""
    return {scheme: {**colours, "model": hex_colour(ONE_MODEL)} for scheme, colours in LOOKS.items()}


def palettes() -> dict[str, list[str]]:
    """Colours of groups by scheme, and of the scale of numbers."""
    scale = scale_colours(np.linspace(0.0, 1.0, SCALE_COLOURS), 0.0, 1.0)
    groups = {name: [hex_colour(group_colour(i, name == "dark")) for i in range(GROUP_COLOURS)] for name in LOOKS}
    return {**groups, "scale": [hex_colour(one) for one in scale]}


def students() -> list[float]:
    """Factors of a standard error for an interval (95 %), by degrees of freedom from 1."""
    return [student(freedom) for freedom in range(1, STUDENTS + 1)]


def hues(models: tuple[str, ...]) -> dict[str, str]:
    """Model → its colour beside others."""
    return {name: hex_colour(colour) for name, colour in model_colours(models, with_blocks=True).items()}


def measured_columns(impacts: Impacts, predictions: Predictions) -> dict[str, Any]:
    """Names, measured values (m_…) and further columns (c_…) of the compared impacts."""
    row = predictions.row
    columns: dict[str, Any] = {
        "trajectory": list(map(visible, predictions.trajectory.tolist())),
        "impact": predictions.impact.tolist(),
        "fall": fall_numbers(impacts)[row].astype(np.int32),
    }
    for name in known_variables(impacts):
        columns[f"m_{name}"] = measured_values(impacts, row, name).astype(np.float32)
    for name in column_titles([impacts]):
        if name not in VARIABLES:
            column = find_column(impacts, name)
            values = list(map(visible, column.texts[row].tolist())) if column.texts is not None else column.numbers
            columns[f"c_{name}"] = values if isinstance(values, list) or values is None else _single(values[row])
    return columns


def model_columns(impacts: Impacts, predictions: Predictions, model: str, run: int, place: int) -> dict[str, Any]:
    """Values (p<place>_…) of one model and run, of the variables that models change."""
    which = predictions.index(model)
    return {
        f"p{place}_{name}": _single(model_values(impacts, predictions, which, run, name))
        for name in known_variables(impacts)
        if VARIABLES[name].restituted
    }


def chosen_columns(impacts: Impacts, predictions: Predictions) -> list[dict[str, Any]]:
    """The columns that the points can be coloured and filtered by: those with two different values or more.

    Names, titles and keys in the table of points; the groups of texts, or the ends of the scale of numbers.
    """
    found: list[dict[str, Any]] = []
    for name, title in column_titles([impacts]).items():
        column = find_column(impacts, name)
        key = f"m_{name}" if name in VARIABLES else f"c_{name}"
        if column.texts is not None:
            groups = list(dict.fromkeys(map(visible, column.texts[predictions.row].tolist())))
            if len(groups) > 1:
                found.append({"name": name, "title": title, "key": key, "groups": groups})
        elif column.numbers is not None:
            values = column.numbers[predictions.row]
            if np.unique(values[np.isfinite(values)]).size > 1:
                ends = colour_by([replace(column, numbers=values)], dark=False).ends
                found.append({"name": name, "title": title, "key": key, "ends": list(ends or (0.0, 1.0))})
    return found


def variable_facts(impacts: Impacts, predictions: Predictions) -> dict[str, dict[str, Any]]:
    """Variable → what the browser must know of it."""
    return {name: _facts(VARIABLES[name], impacts, predictions) for name in known_variables(impacts)}


def symbol_html(variable: Variable) -> str:
    """The symbol with its index set low."""
    letter, _, index = variable.tex.strip("$").replace(r"\theta", "θ").replace("|", "").partition("_")
    index = index.strip("{}")
    text = f"<i>{letter}</i>" + (f"<sub>{index}</sub>" if index else "")
    return f"|{text}|" if "|" in variable.tex else text


def _facts(variable: Variable, impacts: Impacts, predictions: Predictions) -> dict[str, Any]:
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


def _single(values: Array) -> Any:
    """In single precision, which is enough for a screen and half as much to send."""
    return values.astype(np.float32)
