# SPDX-License-Identifier: GPL-3.0-or-later
"""What the graphs of impacts show: variables and axes of each, colours, filters; kept with the scene."""

import json
import zlib

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatVectorProperty, IntProperty, StringProperty

from ....core.analysis.axes import Limits
from ....core.analysis.columns import Filter
from ....core.analysis.graphs import PAPER_GRAPHS, GraphSpec
from ....core.analysis.variables import VARIABLES
from ..storage import store

MOST_GRAPHS = len(PAPER_GRAPHS)


def redraw() -> None:
    """Draw all graphs again."""
    redraw_of()


def redraw_of(tree: str = "") -> None:
    """Draw the graphs of a type of editor again, empty for all."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "NODE_EDITOR" and tree in ("", area.ui_type):
                area.tag_redraw()


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    redraw()


def _x_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    self.x_fixed = self.x_log = False
    redraw()


def _y_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    self.y_fixed = self.y_log = False
    redraw()


def _scale_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """A logarithmic axis cannot keep limits that are not above zero."""
    if self.x_fixed and self.x_log and self.x_limits[0] <= 0:
        self.x_fixed = False
    if self.y_fixed and self.y_log and self.y_limits[0] <= 0:
        self.y_fixed = False
    redraw()


def _number(name: str) -> int:
    """Of a choice in a file: it stays when others come before it. Buttons hold it in single precision."""
    return zlib.crc32(name.encode()) & 0xFFFFFF


VARIABLE_CHOICES = [
    (name, one.label, f"{one.title}, column {name}", "NONE", _number(name)) for name, one in VARIABLES.items()
]
TREND_CHOICES = [
    ("auto", "Automatic", "The curve that suits the two variables and their axes", "NONE", 0),
    ("none", "No curve", "No curve is fitted", "NONE", 1),
    ("origin", "y = a·x", "A line through the origin", "NONE", 2),
    ("line", "y = a + b·x", "A straight line", "NONE", 3),
    ("power", "y = a·xᵇ", "A power law, fitted to the logarithms (Theil–Sen)", "NONE", 4),
    ("exponential", "y = a·exp(b·x)", "A straight line to the logarithms of y", "NONE", 5),
    ("logarithm", "y = a + b·ln x", "A straight line on the logarithms of x", "NONE", 6),
]


class _Graph:
    """Mix-in: one graph."""

    x_log: BoolProperty(name="Logarithmic", description="Logarithmic x axis", update=_scale_changed)
    y_log: BoolProperty(name="Logarithmic", description="Logarithmic y axis", update=_scale_changed)
    x_fixed: BoolProperty(name="Own limits", description="The x axis has these limits, not those of its points",
                          update=_scale_changed)  # fmt: skip
    y_fixed: BoolProperty(name="Own limits", description="The y axis has these limits, not those of its points",
                          update=_scale_changed)  # fmt: skip
    x_limits: FloatVectorProperty(name="x", description="Limits of the x axis", size=2, default=(0.0, 1.0),
                                  update=_changed)  # fmt: skip
    y_limits: FloatVectorProperty(name="y", description="Limits of the y axis", size=2, default=(0.0, 1.0),
                                  update=_changed)  # fmt: skip


def _graph_class(number: int, spec: GraphSpec) -> type:
    """A property group whose defaults are one of the paper's graphs."""
    properties = {
        "x": EnumProperty(name="x", description="Variable on the x axis", items=VARIABLE_CHOICES, default=spec.x,
                          update=_x_changed),
        "y": EnumProperty(name="y", description="Variable on the y axis", items=VARIABLE_CHOICES, default=spec.y,
                          update=_y_changed),
        "trend": EnumProperty(name="Fit", description="Curve that is fitted to the points", items=TREND_CHOICES,
                              default=spec.trend, update=_changed),
    }  # fmt: skip
    return type(
        f"GraphProperties{number + 1}",
        (_Graph, bpy.types.PropertyGroup),
        {"__annotations__": properties, "__module__": __name__, "__doc__": f"Graph {number + 1}."},
    )


GRAPHS = tuple(_graph_class(number, spec) for number, spec in enumerate(PAPER_GRAPHS))


class GraphFilter(bpy.types.PropertyGroup):
    """What a column must have for an impact to be shown; numbers as text, which keeps every digit."""

    column: StringProperty(name="Column")
    low: StringProperty(name="From", description="Least value; empty for no limit", update=_changed)
    high: StringProperty(name="To", description="Greatest value; empty for no limit", update=_changed)
    texts: StringProperty(
        name="One of", description="Texts that are shown, with commas between; empty for all", update=_changed
    )
    used: BoolProperty(name="Use", description="Hide the impacts that do not pass", default=True, update=_changed)


class _Shared:
    """Mix-in: what all graphs share."""

    count: IntProperty(name="Graphs", description="How many graphs are shown", default=4, min=1, max=MOST_GRAPHS,
                       update=_changed)  # fmt: skip
    maximised: IntProperty(description="The graph that is shown alone; 0 for all", min=0, max=MOST_GRAPHS,
                           update=_changed)  # fmt: skip
    error_bars: EnumProperty(
        name="Error bars", description="95 % intervals of the measured impacts",
        items=[
            ("NEVER", "Never", "No error bars"),
            ("POINTED", "Under the mouse", "Of the point under the mouse"),
            ("ALWAYS", "Always", "Of all measured points"),
        ],
        default="POINTED", update=_changed,
    )  # fmt: skip
    links: BoolProperty(
        name="Links", description="Lines from each measured impact to what the models make of it; of very many, those "
        "of the selected impacts and of the one under the mouse", default=True, update=_changed,
    )  # fmt: skip
    fits: BoolProperty(name="Fits", description="Fitted curves, with equation and R²", default=True,
                       update=_changed)  # fmt: skip
    legend: BoolProperty(name="Legend", description="What the colours and shapes mean", default=True,
                         update=_changed)  # fmt: skip
    colour_by: StringProperty(name="Colour by", description="Column that colours the measured points; empty for none",
                              update=_changed)  # fmt: skip
    drag_selects: EnumProperty(
        name="Drag", description="What dragging the mouse in a graph does",
        items=[
            ("BOX", "Box Select", "Select the impacts in a box", "SELECT_SET", 0),
            ("LASSO", "Lasso Select", "Select the impacts in a free outline", "GP_SELECT_STROKES", 1),
        ],
        default="BOX",
    )  # fmt: skip
    filters: CollectionProperty(type=GraphFilter)


GraphSettings = type(
    "GraphSettings",
    (_Shared, bpy.types.PropertyGroup),
    {
        "__annotations__": {f"graph_{i + 1}": bpy.props.PointerProperty(type=cls) for i, cls in enumerate(GRAPHS)},
        "__module__": __name__,
        "__doc__": "The graphs of impacts of a scene.",
    },
)
CLASSES = (*GRAPHS, GraphFilter, GraphSettings)


def register() -> None:
    bpy.types.Scene.rockfall_graphs = bpy.props.PointerProperty(type=GraphSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_graphs


def graph(scene: bpy.types.Scene, number: int) -> bpy.types.PropertyGroup:
    """The properties of a graph; the first is 0."""
    return getattr(scene.rockfall_graphs, f"graph_{number + 1}")


def shown(scene: bpy.types.Scene) -> tuple[int, ...]:
    """The numbers of the graphs that are shown."""
    settings = scene.rockfall_graphs
    if 0 < settings.maximised <= settings.count:
        return (settings.maximised - 1,)
    return tuple(range(settings.count))


def spec_of(graph: bpy.types.PropertyGroup, number: int = 0) -> GraphSpec:
    """A graph as the core knows it."""
    return GraphSpec(
        f"graph_{number + 1}",
        graph.x,
        graph.y,
        graph.x_log,
        graph.y_log,
        _limits(graph.x_limits, graph.x_log) if graph.x_fixed else None,
        _limits(graph.y_limits, graph.y_log) if graph.y_fixed else None,
        graph.trend,
    )


def set_limits(scene: bpy.types.Scene, number: int, x: Limits | None, y: Limits | None) -> None:
    """Give the axes of a graph limits; None leaves those that an axis has."""
    one = graph(scene, number)
    if x is not None:
        one.x_limits, one.x_fixed = x, True
    if y is not None:
        one.y_limits, one.y_fixed = y, True


def reset(scene: bpy.types.Scene, number: int) -> None:
    """Give the axes of a graph the limits that suit their points."""
    one = graph(scene, number)
    one.x_fixed = one.y_fixed = False


def filters_of(scene: bpy.types.Scene) -> tuple[Filter, ...]:
    """The filters that are used; a limit that is no number is none."""
    return tuple(
        Filter(
            one.column,
            _number_in(one.low, -float("inf")),
            _number_in(one.high, float("inf")),
            frozenset(filter(None, (text.strip() for text in one.texts.split(",")))),
        )
        for one in scene.rockfall_graphs.filters
        if one.used and one.column
    )


def chosen_elsewhere(scene: bpy.types.Scene) -> frozenset[tuple[str, int]]:
    """The selected impacts of other sites: file and row."""
    return frozenset(
        (path, row) for path, rows in store.read_json(scene, store.GRAPH_CHOSEN, {}).items() for row in rows
    )


def choose_elsewhere(scene: bpy.types.Scene, chosen: frozenset[tuple[str, int]]) -> None:
    """Select impacts of other sites, which are no objects."""
    rows: dict[str, list[int]] = {}
    for path, row in sorted(chosen):
        rows.setdefault(path, []).append(row)
    if rows:
        scene[store.GRAPH_CHOSEN] = json.dumps(rows)
    elif store.GRAPH_CHOSEN in scene:
        del scene[store.GRAPH_CHOSEN]


def _limits(values: bpy.types.bpy_prop_array, log: bool) -> Limits | None:
    """What was typed, if an axis can have it."""
    low, high = (store.double(value) for value in values)
    return (low, high) if low < high and (low > 0 or not log) else None


def _number_in(text: str, otherwise: float) -> float:
    try:
        return float(text)
    except ValueError:
        return otherwise
