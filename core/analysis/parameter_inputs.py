# SPDX-License-Identifier: GPL-3.0-or-later
"""Sliders, fields and menus for the parameters of an impact model, made from its specifications (Bokeh)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..impact_models.machinery.parameters import ParameterSpec, Value
from ..impact_models.machinery.sliders import slider_range
from .linked_columns import LOOKS
from .linked_graphs import SHEET

Changed = Callable[[str, Value], None]
"""Called with the parameter's name and its new value."""

Refused = Callable[[str], None]
"""Called with what is wrong with a value; what is shown is again what it was."""


@dataclass(frozen=True, eq=False)
class ParameterInputs:
    """The inputs of one model.

    Attributes
    ----------
    layout : all of them.
    show : shows values without reporting them as changes.
    """

    layout: Any
    show: Callable[[Mapping[str, Value]], None]


def parameter_inputs(
    model: ImpactModel, values: Mapping[str, Value], changed: Changed, refused: Refused
) -> ParameterInputs:
    """Inputs that show `values` and report what is changed, if it is within its range.

    The inputs keep to the range by themselves: anything else did not come from them.
    """
    from bokeh.layouts import column

    quiet = [False]  # while values are shown, not entered

    known = dict(values)

    def report(spec: ParameterSpec, entered: object) -> None:
        if quiet[0] or entered is None:
            return
        try:
            value = spec.checked(entered, model.name)
        except InputError as error:
            show({spec.name: known[spec.name]})
            refused(str(error))
            return
        show({spec.name: value})
        changed(spec.name, value)

    parts = {
        spec.name: _input(spec, values[spec.name], f"{model.name}.{spec.name}", report) for spec in model.parameters
    }

    def show(values: Mapping[str, Value]) -> None:
        known.update(values)
        quiet[0] = True
        try:
            for name, value in values.items():
                parts[name][1](value)
        finally:
            quiet[0] = False

    layout = column(*(part for part, _ in parts.values()), sizing_mode="stretch_width", spacing=4)
    return ParameterInputs(layout, show)


def _input(
    spec: ParameterSpec, value: Value, name: str, report: Callable[[ParameterSpec, object], None]
) -> tuple[Any, Callable[[Value], None]]:
    from bokeh.layouts import column, row
    from bokeh.models import Div, InlineStyleSheet, Select, Slider, Spinner

    sheet = InlineStyleSheet(css=SHEET)
    label = Div(text=_label(spec), stylesheets=[sheet], sizing_mode="stretch_width", styles={"margin-bottom": "-6px"})
    if spec.choices:
        menu = Select(
            value=str(value),
            options=list(spec.choices),
            name=name,
            stylesheets=[sheet],
            sizing_mode="stretch_width",
        )
        menu.on_change("value", lambda _attribute, _old, new: report(spec, new))
        return column(label, menu, sizing_mode="stretch_width"), lambda new: menu.update(value=str(new))

    start, end, step = slider_range(spec)
    slider = Slider(
        start=start,
        end=end,
        step=step,
        value=min(max(float(value), start), end),
        show_value=False,
        name=name,
        stylesheets=[sheet],
        sizing_mode="stretch_width",
        bar_color=LOOKS["light"]["muted"],
    )
    field = Spinner(
        value=float(value),
        low=spec.minimum,
        high=spec.maximum,
        step=step,
        width=88,
        format="0.[000]",
        name=f"{name}.field",
        stylesheets=[sheet],
    )

    def show(new: Value) -> None:
        field.value = float(new)
        slider.value = min(max(float(new), start), end)

    def moved(_attribute: str, _old: Any, new: Any) -> None:
        report(spec, round(new, 12) if isinstance(new, (int, float)) else new)

    slider.on_change("value", moved)
    field.on_change("value", moved)
    return column(label, row(slider, field, sizing_mode="stretch_width"), sizing_mode="stretch_width"), show


def _label(spec: ParameterSpec) -> str:
    notes = [spec.description, f"Range {spec.range_text}", f"Default {spec.default}", f"Source: {spec.source or '–'}"]
    if not spec.verified:
        notes.append("Not checked against the primary text")
    unit = f" [{escape(spec.unit)}]" if spec.unit else ""
    letter, _, index = escape(spec.symbol).partition("_")
    low = f"<sub>{index}</sub>" if index else ""
    symbol = f' <i style="color:var(--muted)">{letter}{low}</i>' if letter else ""
    hint = escape(". ".join(note for note in notes if note), quote=True)
    return f'<span title="{hint}">{spec.name}{symbol}{unit}</span>'
