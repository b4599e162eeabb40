# SPDX-License-Identifier: GPL-3.0-or-later
"""The graphs in print: one figure per model, and all models on one sheet as in Noël et al. 2018, Fig. 8.

Text stays text in SVG and PDF. The two series differ in colour (the paper's red against black), in brightness
and in shape, so that they are told apart without colour too.
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import visible
from ..extras import FIGURES, demand
from ..impact_models.registry import find_model
from ..output import output_file
from ..progress import Progress, silent
from .curves import Curve, number
from .graphs import Graph
from .typefaces import FAMILIES, lettered
from .variables import Variable, find_variable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from PIL.Image import Image

FORMATS = ("png", "svg", "pdf")
DPI = 300
COMPRESSION = 1
"""Of PNG files: much quicker than the usual 6 (of 9), and hardly larger."""
COLUMN_IN, PAGE_IN = 3.54, 7.48
"""Widths of one column (90 mm) and of a page (190 mm)."""
MEASURED, MODELLED, LINK = "#20262e", "#d7301f", "#b4b9c1"
INK, MUTED = "#20262e", "#5b6470"
LISTED = 3
"""Up to so many points beyond the axes are listed, more are counted."""
ROOM = 0.97
"""Notes are no longer than this part of their axes."""
DENSE = 2000
"""Graphs of more impacts are clouds: smaller, fainter points, as a picture within an SVG or PDF, and no links. The
model's points are on top, for they are narrower."""
LEAST_SIZE, LEAST_ALPHA = 0.4, 0.06
"""Of the points of a cloud."""

STYLE: Any = {
    "font.family": list(FAMILIES),
    "font.sans-serif": ["Arial", "Helvetica", "Liberation Sans", "DejaVu Sans"],
    "mathtext.fontset": "dejavusans",
    "font.size": 7.0,
    "axes.labelsize": 7.0,
    "axes.linewidth": 0.5,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.labelpad": 2.5,
    "text.color": INK,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "svg.hashsalt": "rockfall",
}


def model_figure(graphs: Sequence[Graph]) -> "Figure":
    """The graphs of one model, two beside each other.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    return next(_model_figures([graphs]))


def _model_figures(sheet: Iterable[Sequence[Graph]]) -> "Iterator[Figure]":
    """A figure for each model: the same one with other points, for its axes take longest."""
    demand(FIGURES)
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure: Figure | None = None
    drawn: list[Artist] = []
    for graphs in sheet:
        with rc_context(STYLE):
            if figure is None:
                rows = (len(graphs) + 1) // 2
                places = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06)
                figure = Figure(figsize=(PAGE_IN, 0.35 + 2.55 * rows), dpi=DPI, layout=places)
                FigureCanvasAgg(figure)
                axes = figure.subplots(rows, 2, squeeze=False).ravel()
                for each, graph in zip(axes, graphs, strict=False):
                    _set_up(each, graph, size=1.0)
                    _labels(each, graph, x=True, short=False)
                for each in axes[len(graphs) :]:
                    each.set_axis_off()
                _legend(figure, graphs[0])
                _lay_out(figure)
            for artist in drawn:
                artist.remove()
            drawn = [one for each, graph in zip(axes, graphs, strict=False) for one in _draw(each, graph, size=1.0)]
            place: dict[str, Any] = {"transform": figure.transFigure, "ha": "left", "va": "top"}
            drawn.append(axes[0].text(0.012, 0.988, _title(graphs[0]), fontsize=8.5, fontweight="bold", **place))
            for artist in drawn:
                artist.set_animated(True)
        yield figure


def sheet_figure(sheet: Sequence[Sequence[Graph]]) -> "Figure":
    """Models (rows) × graphs (columns) on one page.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with rc_context(STYLE):
        places = ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.02, hspace=0.02, wspace=0.02)
        figure = Figure(figsize=(PAGE_IN, 0.5 + 1.52 * len(sheet)), dpi=DPI, layout=places)
        FigureCanvasAgg(figure)
        grid = figure.subplots(len(sheet), len(sheet[0]), squeeze=False, sharex="col", sharey="col")
        for i, (row, graphs) in enumerate(zip(grid, sheet, strict=True)):
            for each, graph in zip(row, graphs, strict=True):
                _set_up(each, graph, size=0.62)
                _labels(each, graph, x=i == len(sheet) - 1, short=True)
            row[0].set_title(_title(graphs[0]), fontsize=7.5, fontweight="bold", loc="left", pad=7.0)
        _legend(figure, sheet[0][0])
        for each in grid[:-1, 1:].flat:  # which have the places of those in the first column and in the last row
            each.set_in_layout(False)
        _lay_out(figure)
        for row in grid[:-1]:
            side = row[0].get_position()
            for each, last in zip(row[1:], grid[-1, 1:], strict=True):
                below = last.get_position()
                each.set_position((below.x0, side.y0, below.width, side.height))
        for row, graphs in zip(grid, sheet, strict=True):
            for each, graph in zip(row, graphs, strict=True):
                _draw(each, graph, size=0.62)
    return figure


def save_figures(
    sheet: Sequence[Sequence[Graph]],
    folder: str | Path,
    formats: Sequence[str] = FORMATS[:1],
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write the sheet (all_models) and one figure per model into a folder; returns the files.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)

    def figures() -> "Iterator[tuple[str, Figure]]":  # one at a time: clouds fill the memory
        yield "all_models", sheet_figure(sheet)
        yield from zip((graphs[0].model for graphs in sheet), _model_figures(sheet), strict=True)

    return save_named(figures(), folder, formats, progress, 1 + len(sheet))


def save_named(
    figures: "Iterable[tuple[str, Figure]]",
    folder: str | Path,
    formats: Sequence[str] = FORMATS[:1],
    progress: Progress = silent,
    total: int = 0,
) -> tuple[Path, ...]:
    """Write (name, figure) pairs into a folder, each in all formats; returns the files. `total`: how many there are.

    A figure that follows itself may have changed in its animated artists only.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    painter = _Painter()
    with ThreadPoolExecutor(1) as pool:  # packs a picture while the next figure is drawn
        packed: Future[None] | None = None
        for done, (name, figure) in enumerate(figures, start=1):
            for kind in formats:
                written.append(folder / f"{name}.{kind}")
                if kind != "png":
                    save_figure(figure, written[-1])
                    continue
                picture = painter.paint(figure)
                if packed is not None:
                    packed.result()
                packed = pool.submit(_save_picture, picture, written[-1])
            progress("Drawing the figures", done, total)
        if packed is not None:
            packed.result()
    return tuple(written)


def save_figure(figure: "Figure", path: str | Path) -> None:
    """Write one figure; the file's ending says the format. The same figure makes the same file."""
    from matplotlib import rc_context

    show_names(figure)
    if Path(path).suffix == ".png":
        _save_picture(_Painter().paint(figure), Path(path))
        return
    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(Path(path).suffix, {})
    with rc_context(STYLE), lettered(figure), output_file(path) as draft:
        figure.savefig(draft, dpi=DPI, facecolor="white", metadata=undated)


def show_names(figure: "Figure") -> None:
    """Take out of all words of a figure what hides, or turns their letters round."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if (seen := visible(text.get_text())) != text.get_text():
            text.set_text(seen)


class _Painter:
    """Draws figures as pictures, each once, where Matplotlib's own way to a PNG file draws twice; what stays behind the
    animated artists of one that follows itself is not drawn again."""

    def __init__(self) -> None:
        self._figure: Figure | None = None
        self._behind: Any = None

    def paint(self, figure: "Figure") -> "Image":
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image

        show_names(figure)
        with rc_context(STYLE), lettered(figure):
            canvas = figure.canvas if isinstance(figure.canvas, FigureCanvasAgg) else FigureCanvasAgg(figure)
            moving = [one for axes in figure.axes for one in axes.get_children() if one.get_animated()]
            moving.sort(key=lambda artist: artist.zorder)
            if figure is not self._figure:
                figure.set_dpi(DPI)
                canvas.draw()
                self._figure, self._behind = figure, canvas.copy_from_bbox(figure.bbox) if moving else None
            elif moving:
                canvas.restore_region(self._behind)
            for artist in moving:
                figure.draw_artist(artist)
            picture = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba(), "raw", "RGBA", 0, 1)
            return picture.convert("RGB")  # which has no place for transparency


def _save_picture(picture: "Image", path: Path) -> None:
    with output_file(path) as draft:
        picture.save(draft, format="png", dpi=(DPI, DPI), compress_level=COMPRESSION)


def _lay_out(figure: "Figure") -> None:
    """Fix the places of the axes, which takes as long as to draw the figure; what is drawn in them comes later."""
    layout = figure.get_layout_engine()
    if layout is not None:
        with lettered(figure):
            layout.execute(figure)
    figure.set_layout_engine(None)


def _set_up(axes: "Axes", graph: Graph, size: float) -> None:
    """Scales, ticks and limits."""
    from matplotlib.ticker import MaxNLocator

    axes.set_xscale("log" if graph.spec.x_log else "linear")
    axes.set_yscale("log" if graph.spec.y_log else "linear")
    if not graph.spec.y_log:
        axes.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    if not graph.spec.x_log:
        axes.xaxis.set_major_locator(MaxNLocator(7 if size == 1.0 else 5, steps=[1, 2, 5, 10]))
    axes.set_xlim(graph.x_limits)
    axes.set_ylim(graph.y_limits)


def _draw(axes: "Axes", graph: Graph, size: float) -> "list[Artist]":
    """Points, curves and notes of a graph."""
    from matplotlib.collections import LineCollection

    drawn: list[Artist] = []
    dense = _is_dense(graph)
    if not dense:
        links = LineCollection(list(graph.links), colors=LINK, linewidths=0.6 * size, zorder=1)
        drawn.append(axes.add_collection(links, autolim=False))
    part = DENSE / max(graph.row.size, DENSE)
    scale = size**0.5 * max(part**0.25, LEAST_SIZE)
    opacity = max(0.85 * part**0.7, LEAST_ALPHA)
    if dense:
        from .drawn_clouds import PointCloud

        drawn += [
            axes.add_artist(PointCloud(graph.measured, "circle", 3.3 * scale, MEASURED, opacity, zorder=2)),
            axes.add_artist(PointCloud(graph.modelled, "diamond", 3.5 * scale, MODELLED, opacity, zorder=3)),
        ]
    else:
        common: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0, "alpha": opacity}
        drawn += axes.plot(*graph.modelled.T, marker="D", markersize=3.5 * scale, color=MODELLED, zorder=2, **common)
        drawn += axes.plot(*graph.measured.T, marker="o", markersize=3.3 * scale, color=MEASURED, zorder=3, **common)
    notes: list[tuple[tuple[str, ...], str]] = []
    for curve, colour in ((graph.measured_curve, MEASURED), (graph.modelled_curve, MODELLED)):
        if curve is not None:
            drawn += axes.plot(curve.x, curve.y, color="white", linewidth=1.9 * size, zorder=4)
            drawn += axes.plot(curve.x, curve.y, color=colour, linewidth=1.2 * size, zorder=5)
            notes.append(((curve_text(curve, graph, full=size == 1.0),), colour))
    notes += [(forms, MUTED) for forms in beyond_lines(graph)]
    font = 6.0 if size == 1.0 else 5.0
    rising = graph.spec.fitted == "origin"  # which leaves the upper left corner free
    for i, (forms, colour) in enumerate(notes):
        note = axes.annotate(
            forms[0],
            (0.02 if rising else 1.0, 1.0),
            (0.0, (font + 1.8) * (0.35 - i)),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="left" if rising else "right",
            va="top",
            color=colour,
            fontsize=font,
            zorder=6,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )
        shorten(note, forms, axes)
        drawn.append(note)
    return drawn


def shorten(note: "Annotation", forms: Sequence[str], axes: "Axes") -> None:
    """Let a note have the first of several forms, the longest first, that is no wider than its axes; else the last."""
    for form in forms[:-1]:
        note.set_text(form)
        if note.get_window_extent().width <= ROOM * axes.get_window_extent().width:
            return
    note.set_text(forms[-1])


def curve_text(curve: Curve, graph: Graph, full: bool = True) -> str:
    """Equation and R² of a graph's curve, in TeX; if `full` with rank correlation and number of points."""
    slope = r"$R_T$" if (graph.spec.x, graph.spec.y) == ("vt1_mps", "vt2_mps") else ""
    y, x = (variable.tex or variable.title for variable in map(find_variable, (graph.spec.y, graph.spec.x)))
    return curve.text(y, x, slope, "$^{{{}}}$", full)


def beyond_lines(graph: Graph) -> list[tuple[str, ...]]:
    """What the axes cut off, for the corner of a graph: a few points, or their number and the farthest; each line in
    several forms, the longest first."""
    x, y = find_variable(graph.spec.x), find_variable(graph.spec.y)
    lines = []
    for series, word in (("measured", "measured"), ("model", "model")):
        points = [point for point in graph.beyond if point.series == series]
        if not points:
            continue
        many = "1 point" if len(points) == 1 else f"{len(points)} points"
        forms = [f"Beyond, {word}: {many}, {y.tex} up to {number(points[0].y)}", f"Beyond, {word}: {many}"]
        if len(points) <= LISTED:
            listed = "; ".join(f"{point.y:.3g} at {point.x:.3g}{x.unit if x.unit == '°' else ''}" for point in points)
            forms.insert(0, f"Beyond, {word}: {y.tex} {listed}")
        lines.append(tuple(forms))
    return lines


def _labels(axes: "Axes", graph: Graph, *, x: bool, short: bool) -> None:
    def text(variable: Variable) -> str:
        return f"{variable.tex or variable.title} [{variable.unit or '–'}]" if short else variable.tex_label

    axes.set_ylabel(text(find_variable(graph.spec.y)))
    if x:
        axes.set_xlabel(find_variable(graph.spec.x).tex_label)


def _is_dense(graph: Graph) -> bool:
    return graph.row.size > DENSE


def _title(graph: Graph) -> str:
    return find_model(graph.model).title if graph.model else "Measured impacts"


def _legend(figure: "Figure", graph: Graph) -> None:
    from matplotlib.lines import Line2D

    common: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0}
    kind = "model, one draw per impact" if graph.run else "model, mean"
    handles = [
        Line2D([], [], marker="o", markersize=3.6, color=MEASURED, label="measured", **common),
        Line2D([], [], marker="D", markersize=3.4, color=MODELLED, label=kind, **common),
        Line2D([], [], linestyle="none", label=f"more than {DENSE} impacts: no links")
        if _is_dense(graph)
        else Line2D([], [], color=LINK, linewidth=0.9, label="same impact"),
    ]
    figure.legend(
        handles=handles,
        loc="outside upper right",
        ncols=3,
        frameon=False,
        fontsize=6.5,
        handletextpad=0.3,
        columnspacing=1.4,
        borderaxespad=0.2,
    )
