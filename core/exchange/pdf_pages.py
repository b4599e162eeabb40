# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts, tables and figures, one below the other on pages of A4, as a PDF."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis.figures import INK, MUTED, STYLE
from ..analysis.typefaces import FAMILIES, families_for, lettered, quiet
from ..errors import visible
from ..output import output_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE_PT = (595.3, 841.9)
MARGIN_PT = (51.0, 48.0, 51.0, 54.0)
"""Left, top, right, bottom."""
WIDTH_PT = PAGE_PT[0] - MARGIN_PT[0] - MARGIN_PT[2]
STYLES: dict[str, dict[str, Any]] = {
    "h1": {"fontsize": 16.0, "fontweight": "bold"},
    "h2": {"fontsize": 10.5, "fontweight": "bold"},
    "text": {"fontsize": 8.5},
    "note": {"fontsize": 7.0, "color": MUTED},
    "problem": {"fontsize": 8.5, "fontweight": "bold", "color": "#9b1c1c"},
    "warning": {"fontsize": 8.5, "color": "#8f4a00"},
    "enough": {"fontsize": 8.5, "fontweight": "bold", "color": "#1d6b3a"},
    "not_enough": {"fontsize": 8.5, "fontweight": "bold", "color": "#9b1c1c"},
    "not_known": {"fontsize": 8.5, "fontweight": "bold", "color": "#8f4a00"},
    "head": {"fontsize": 7.0, "fontweight": "bold"},
    "cell": {"fontsize": 7.0},
}
ABOVE = {"h1": 0.0, "h2": 14.0, "note": 3.0}
"""Space above a text [pt]; of others `BETWEEN`."""
BETWEEN, LEADING = 5.0, 1.36
FINE = 20
"""Times as large letters are measured: small ones are fitted to pixels."""
BESIDE_PT, ROW_PT, SHADE, RULE = 9.0, 2.5, "#eef1f4", "#d5dae0"
FIGURE_DPI, TALLEST_PT = 200, 480.0


@dataclass(frozen=True)
class Words:
    """A text of one of the `STYLES`."""

    kind: str
    text: str


@dataclass(frozen=True)
class Rows:
    """A table; the first columns of names, and those of words, begin at the left, numbers end at the right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    names: int = 2
    words: tuple[int, ...] = ()


@dataclass(frozen=True)
class Drawing:
    """A figure, with what is said below it."""

    figure: "Figure"
    caption: str


type Element = Words | Rows | Drawing


@dataclass
class Page:
    """What is on a page, in points from its left and upper edges.

    Attributes
    ----------
    texts : (x, y of the upper edge, alignment, text, style) of lines.
    bars : (x, y, width, height, colour). pictures : (x, y, width, height, figure).
    """

    texts: list[tuple[float, float, str, str, str]] = field(default_factory=list)
    bars: list[tuple[float, float, float, float, str]] = field(default_factory=list)
    pictures: "list[tuple[float, float, float, float, Figure]]" = field(default_factory=list)


type Measure = Callable[[str, str], float]
"""How wide a line of a style is [pt]."""


def write_pdf(elements: Sequence[Element], path: Path, title: str) -> None:
    """Write the pages; below each stands the title and its number.

    Raises
    ------
    OSError : the folder cannot be written.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    title = visible(title)
    with output_file(path) as part, rc_context(STYLE), PdfPages(part, metadata={"Title": title}) as pdf:
        with quiet():
            pages = lay_out(elements, measured_by_font())
        for number, one in enumerate(pages, start=1):
            sheet = Figure(figsize=(PAGE_PT[0] / 72, PAGE_PT[1] / 72))
            one.texts.append((MARGIN_PT[0], PAGE_PT[1] - 34, "left", title, "note"))
            one.texts.append((PAGE_PT[0] - MARGIN_PT[2], PAGE_PT[1] - 34, "right", f"{number} of {len(pages)}", "note"))
            _draw(one, sheet)
            with lettered(sheet):
                pdf.savefig(sheet, dpi=FIGURE_DPI)


def measured_by_font() -> Measure:
    """Widths of lines in the fonts of the pages."""
    from matplotlib.backends.backend_agg import RendererAgg
    from matplotlib.font_manager import FontProperties

    renderer = RendererAgg(10, 10, 72 * FINE)
    fonts = {kind: FontProperties(size=style["fontsize"], weight=style.get("fontweight", "normal"))
             for kind, style in STYLES.items()}  # fmt: skip

    def width(text: str, kind: str) -> float:
        fonts[kind].set_family([*FAMILIES, *families_for(text)])
        return float(renderer.get_text_width_height_descent(text, fonts[kind], ismath=False)[0]) / FINE

    return width


def lay_out(elements: Sequence[Element], measure: Measure) -> list[Page]:
    """Where everything goes: what does not fit begins the next page, tables with their heads again."""
    pages, y = [Page()], MARGIN_PT[1]
    bottom = PAGE_PT[1] - MARGIN_PT[3]
    for place, element in enumerate(elements):
        if isinstance(element, Words):
            lines = _wrapped(element.text, element.kind, WIDTH_PT, measure)
            height = _line(element.kind)
            needed = height * len(lines)
            if element.kind == "h2":  # it does not stand alone at the bottom
                needed += _least(elements[place + 1], measure) if place + 1 < len(elements) else 0.0
            if y > MARGIN_PT[1]:
                y += ABOVE.get(element.kind, BETWEEN)
                if y + min(needed, bottom - MARGIN_PT[1]) > bottom:
                    pages, y = [*pages, Page()], MARGIN_PT[1]
            for line in lines:
                if y + height > bottom:
                    pages, y = [*pages, Page()], MARGIN_PT[1]
                pages[-1].texts.append((MARGIN_PT[0], y, "left", line, element.kind))
                y += height
        elif isinstance(element, Rows):
            y = _place_rows(element, pages, y + BETWEEN, bottom, measure)
        else:
            y = _place_drawing(element, pages, y + 2 * BETWEEN, bottom, measure)
    return pages


def _place_rows(table: Rows, pages: list[Page], y: float, bottom: float, measure: Measure) -> float:
    widths = _columns(table, measure)
    left = [MARGIN_PT[0] + sum(widths[:i]) + BESIDE_PT * i for i in range(len(widths))]
    whole = sum(widths) + BESIDE_PT * (len(widths) - 1)

    def put(row: Sequence[str], kind: str) -> None:
        nonlocal y
        cells = [_wrapped(cell, kind, width, measure) for cell, width in zip(row, widths, strict=True)]
        height = max(map(len, cells)) * _line(kind) + 2 * ROW_PT
        if y + height > bottom and (kind == "cell" or y > MARGIN_PT[1]):
            pages.append(Page())
            y = MARGIN_PT[1]
            if kind == "cell" and any(table.head):
                put(table.head, "head")
        page = pages[-1]
        if kind == "head":
            page.bars.append((MARGIN_PT[0] - 2, y, whole + 4, height, SHADE))
        for i, lines in enumerate(cells):
            at_left = i < table.names or i in table.words
            x = left[i] if at_left else left[i] + widths[i]
            for k, line in enumerate(lines):
                page.texts.append((x, y + ROW_PT + k * _line(kind), "left" if at_left else "right", line, kind))
        y += height
        page.bars.append((MARGIN_PT[0] - 2, y, whole + 4, 0.4, RULE))

    if any(table.head):
        put(table.head, "head")
    for row in table.rows:
        put(row, "cell")
    return y


def _place_drawing(drawing: Drawing, pages: list[Page], y: float, bottom: float, measure: Measure) -> float:
    wide, high = (72 * float(inches) for inches in drawing.figure.get_size_inches())
    scale = min(WIDTH_PT / wide, TALLEST_PT / high, 1.0)
    wide, high = scale * wide, scale * high
    caption = _wrapped(drawing.caption, "note", WIDTH_PT, measure)
    if y + high + BETWEEN + len(caption) * _line("note") > bottom:
        pages.append(Page())
        y = MARGIN_PT[1]
    pages[-1].pictures.append((MARGIN_PT[0], y, wide, high, drawing.figure))
    y += high + BETWEEN
    for line in caption:
        pages[-1].texts.append((MARGIN_PT[0], y, "left", line, "note"))
        y += _line("note")
    return y


def _columns(table: Rows, measure: Measure) -> list[float]:
    """Widths that all cells fit in, where words must be broken the wide ones first."""
    natural, least = [], []
    for i, head in enumerate(table.head):
        cells = [(head, "head"), *((row[i], "cell") for row in table.rows)]
        natural.append(max(measure(text, kind) for text, kind in cells) + 1.0)
        least.append(max(measure(word, kind) for text, kind in cells for word in text.split() or [""]) + 1.0)
    room = WIDTH_PT - BESIDE_PT * (len(natural) - 1)
    if sum(natural) <= room:
        return natural
    if sum(least) >= room:
        return [width * room / sum(least) for width in least]
    part = (room - sum(least)) / (sum(natural) - sum(least))
    return [a + part * (b - a) for a, b in zip(least, natural, strict=True)]


def _wrapped(text: str, kind: str, width: float, measure: Measure) -> list[str]:
    """Lines no wider than that; words that are wider are cut."""
    lines = list[str]()
    for word in visible(text).split():
        pieces = list(_pieces(word, kind, width, measure))
        longer = f"{lines[-1]} {word}" if lines else word
        if len(pieces) == 1 and lines and measure(longer, kind) <= width:
            lines[-1] = longer
        else:
            lines += pieces
    return lines or [""]


def _pieces(word: str, kind: str, width: float, measure: Measure) -> Iterator[str]:
    while len(word) > 1 and measure(word, kind) > width:
        fits = next((n for n in range(len(word) - 1, 1, -1) if measure(word[:n], kind) <= width), 1)
        yield word[:fits]
        word = word[fits:]
    yield word


def _least(element: Element, measure: Measure) -> float:
    """The height of the first part of what follows a heading."""
    if isinstance(element, Words):
        return BETWEEN + _line(element.kind) * len(_wrapped(element.text, element.kind, WIDTH_PT, measure))
    if isinstance(element, Rows):
        return 2 * (_line("cell") * 3 + 2 * ROW_PT)
    return min(72 * float(element.figure.get_size_inches()[1]), TALLEST_PT)


def _line(kind: str) -> float:
    return LEADING * float(STYLES[kind]["fontsize"])


def _draw(page: Page, sheet: "Figure") -> None:
    from matplotlib.patches import Rectangle

    wide, high = PAGE_PT
    for x, y, width, height, colour in page.bars:
        bar = Rectangle((x / wide, 1 - (y + height) / high), width / wide, height / high, color=colour, linewidth=0)
        sheet.add_artist(bar)
    for x, y, width, height, figure in page.pictures:
        axes = sheet.add_axes((x / wide, 1 - (y + height) / high, width / wide, height / high))
        axes.imshow(_pixels(figure), aspect="auto", interpolation="antialiased")
        axes.set_axis_off()
    for x, y, side, text, kind in page.texts:
        style = {"color": INK, **STYLES[kind]}
        sheet.text(x / wide, 1 - y / high, text, ha=side, va="top", parse_math=False, **style)


def _pixels(figure: "Figure") -> Any:
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    dpi = figure.dpi
    figure.set_dpi(FIGURE_DPI)
    canvas = FigureCanvasAgg(figure)
    with lettered(figure):
        canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba()).copy()
    figure.set_dpi(dpi)
    return pixels
