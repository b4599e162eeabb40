# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of areas, lines, points and words as SVG, without any library: text stays text."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, pi, sin
from xml.sax.saxutils import escape

from ..errors import visible
from ..vectors import Array
from .graph_layout import Rectangle

FONTS = "Inter, Arial, Helvetica, 'Liberation Sans', 'DejaVu Sans', sans-serif"
CAPITALS = 0.72
"""Height of a capital letter, in parts of the text's height."""

Colour = Sequence[float]
"""Red, green and blue from 0 to 1, and perhaps the opacity."""


@dataclass
class Svg:
    """A picture that is added to, from the back to the front. Places are pixels from the lower left corner, y up.

    Attributes
    ----------
    width, height : of the picture [px].
    """

    width: float
    height: float
    _parts: list[str] = field(default_factory=list)
    _clips: dict[Rectangle, str] = field(default_factory=dict)

    def area(self, area: Rectangle, colour: Colour) -> None:
        """A rectangle."""
        self._parts.append(
            f'<rect x="{_n(area.left)}" y="{_n(self.height - area.top)}" width="{_n(area.width)}" '
            f'height="{_n(area.height)}" {_paint("fill", colour)}/>'
        )

    def lines(self, ends: Array, colour: Colour, width: float, clip: Rectangle | None = None) -> None:
        """Segments (k, 2, 2); those that follow each other become one line."""
        pieces, last = [], None
        for (x0, y0), (x1, y1) in ends.tolist():
            if (x0, y0) != last:
                pieces.append(f"M{_n(x0)} {_n(self.height - y0)}")
            pieces.append(f"L{_n(x1)} {_n(self.height - y1)}")
            last = (x1, y1)
        if pieces:
            self._parts.append(
                f'<path d="{"".join(pieces)}" fill="none" {_paint("stroke", colour)} stroke-width="{_n(width)}" '
                f'stroke-linejoin="round"{self._clipped(clip)}/>'
            )

    def point(
        self, x: float, y: float, shape: str, radius: float, colour: Colour, edge: Colour | None = None,
        edge_width: float = 0.0, hollow: float = 0.0,
    ) -> None:  # fmt: skip
        """A point of a shape of `SHAPES`; with an outline `edge`, or hollow with a line of this width."""
        path = _shape(shape, x, self.height - y, radius)
        line = {"cross": 0.4 * radius, "plus": 0.4 * radius, "ring": 0.3 * radius}.get(shape, hollow)
        if line:
            self._parts.append(f'<path d="{path}" fill="none" {_paint("stroke", colour)} stroke-width="{_n(line)}"/>')
            return
        around = f' {_paint("stroke", edge)} stroke-width="{_n(edge_width)}"' if edge is not None and edge_width else ""
        self._parts.append(f'<path d="{path}" {_paint("fill", colour)}{around}/>')

    def text(
        self, x: float, y: float, words: str, size: float, colour: Colour, anchor: tuple[float, float],
        upright: bool = False,
    ) -> None:  # fmt: skip
        """Words; `anchor`, from 0 to 1 along and across them, lies at the place. `upright` is read from below."""
        where = {0.0: "start", 0.5: "middle", 1.0: "end"}.get(anchor[0])
        if where is None:
            raise ValueError(f"Words begin, are centred or end at a place, not at {anchor[0]}")
        down = anchor[1] * CAPITALS * size
        place = f'x="{_n(x)}" y="{_n(self.height - y + down)}"'
        if upright:
            place = f'transform="translate({_n(x + down)} {_n(self.height - y)}) rotate(-90)"'
        look = f'font-size="{_n(size)}" text-anchor="{where}" {_paint("fill", colour)}'
        self._parts.append(f"<text {place} {look}>{escape(visible(words))}</text>")

    def document(self) -> str:
        """The file's text."""
        clips = "".join(
            f'<clipPath id="{name}"><rect x="{_n(a.left)}" y="{_n(self.height - a.top)}" width="{_n(a.width)}" '
            f'height="{_n(a.height)}"/></clipPath>'
            for a, name in self._clips.items()
        )
        size = f'width="{_n(self.width)}" height="{_n(self.height)}" viewBox="0 0 {_n(self.width)} {_n(self.height)}"'
        return (
            f'<?xml version="1.0" encoding="UTF-8"?>\n<svg xmlns="http://www.w3.org/2000/svg" {size} '
            f'font-family="{FONTS}">\n<defs>{clips}</defs>\n' + "\n".join(self._parts) + "\n</svg>\n"
        )

    def _clipped(self, area: Rectangle | None) -> str:
        if area is None:
            return ""
        return f' clip-path="url(#{self._clips.setdefault(area, f"clip{len(self._clips)}")})"'


def _n(value: float) -> str:
    """A number to a hundredth of a pixel."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _paint(what: str, colour: Colour) -> str:
    red, green, blue = (round(255 * min(max(part, 0.0), 1.0)) for part in colour[:3])
    opacity = f' {what}-opacity="{_n(colour[3])}"' if len(colour) > 3 and colour[3] < 1 else ""
    return f'{what}="#{red:02x}{green:02x}{blue:02x}"{opacity}'


def _shape(shape: str, x: float, y: float, radius: float) -> str:
    """The outline of a shape, or the two strokes of a cross."""
    if shape in ("circle", "ring"):
        r = 0.82 * radius
        return f"M{_n(x - r)} {_n(y)}a{_n(r)} {_n(r)} 0 1 0 {_n(2 * r)} 0a{_n(r)} {_n(r)} 0 1 0 {_n(-2 * r)} 0Z"
    if shape in ("cross", "plus"):
        r = 0.64 * radius if shape == "cross" else 0.9 * radius
        ways = ((r, r), (r, -r)) if shape == "cross" else ((r, 0.0), (0.0, r))
        return "".join(f"M{_n(x - a)} {_n(y - b)}L{_n(x + a)} {_n(y + b)}" for a, b in ways)
    if shape == "star":
        turns = [(0.95 if i % 2 == 0 else 0.42, -pi / 2 + i * pi / 5) for i in range(10)]
    else:
        corners, reach, first = {
            "diamond": (4, 0.93, 0.0),
            "square": (4, 1.05, pi / 4),
            "triangle": (3, 0.9, -pi / 2),
            "down": (3, 0.9, pi / 2),
            "hexagon": (6, 0.9, 0.0),
        }[shape]
        turns = [(reach, first + 2 * pi * i / corners) for i in range(corners)]
    places = [f"{_n(x + reach * radius * cos(turn))} {_n(y + reach * radius * sin(turn))}" for reach, turn in turns]
    return f"M{'L'.join(places)}Z"
