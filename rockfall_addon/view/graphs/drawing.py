# SPDX-License-Identifier: GPL-3.0-or-later
"""Areas, lines, points of several shapes, and text, in pixels of a region or in batches that are kept.

Within `onto`, the same calls write a picture file instead, without the graphics card.
"""

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ....core.analysis.axes import Axis
from ....core.analysis.graph_layout import Frame, Rectangle
from ....core.analysis.svg import Svg
from ....core.errors import visible
from .look import FONT, Look, Rgb, Rgba, alpha

SHAPES = ("circle", "diamond", "square", "triangle", "down", "cross", "plus", "hexagon", "star", "ring")
"""By number, as the shader knows them."""
THIN = ("cross", "plus", "ring")
"""Shapes that have no outline: nothing would be left of them."""

VERTEX = """
void main() {
  shade = color;
  diameter = size * scale;
  gl_PointSize = diameter;
  bool seen = all(greaterThanEqual(pos, bounds.xy)) && all(lessThanEqual(pos, bounds.zw));
  gl_Position = seen ? ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
"""
FRAGMENT = """
float away(vec2 p) {  /* from the shape's edge, in parts of the half width; negative inside */
  if (shape == 1) { return (abs(p.x) + abs(p.y)) * 0.7071 - 0.66; }
  if (shape == 2) { return max(abs(p.x), abs(p.y)) - 0.74; }
  if (shape == 3 || shape == 4) {
    vec2 q = vec2(abs(p.x), shape == 3 ? p.y : -p.y);
    return max(q.x * 0.866 - (q.y + 0.1) * 0.5 - 0.42, q.y - 0.66);
  }
  if (shape == 5 || shape == 6) {
    vec2 q = shape == 5 ? abs(mat2(0.7071, 0.7071, -0.7071, 0.7071) * p) : abs(p);
    return max(min(q.x, q.y) - 0.2, max(q.x, q.y) - 0.9);
  }
  if (shape == 7) { vec2 q = abs(p); return max(q.x * 0.866 + q.y * 0.5, q.y) - 0.78; }
  if (shape == 8) {
    float turn = mod(atan(p.x, -p.y) + 0.6283, 1.2566) - 0.6283;
    vec2 q = length(p) * vec2(cos(turn), abs(sin(turn)));
    return (q.x - 0.95) * 0.588 + q.y * 0.809;
  }
  if (shape == 9) { return abs(length(p) - 0.8) - 0.16; }
  return length(p) - 0.82;
}

vec3 linear(vec3 c) {
  return mix(c / 12.92, pow((max(c, 0.0) + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));
}

void main() {
  float reach = away(gl_PointCoord * 2.0 - 1.0) * diameter * 0.5;  /* [px] */
  float cover = clamp(0.5 - reach, 0.0, 1.0);
  if (cover <= 0.0) { discard; }
  float inner = clamp(0.5 - (reach + rim), 0.0, 1.0);
  if (hollow > 0.0) { cover *= 1.0 - clamp(0.5 - (reach + hollow), 0.0, 1.0); }
  vec4 seen = vec4(mix(edge.rgb, shade.rgb, rim > 0.0 ? inner : 1.0), shade.a * cover);
  fragColor = srgbTarget ? vec4(linear(seen.rgb), seen.a) : seen;
}
"""


@functools.cache
def point_shader() -> gpu.types.GPUShader:
    """Points of a shape, cut off at bounds: made once, with the first window."""
    between = gpu.types.GPUStageInterfaceInfo("point_between")
    between.flat("VEC4", "shade")
    between.flat("FLOAT", "diameter")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC4", "bounds")
    info.push_constant("VEC4", "edge")
    info.push_constant("FLOAT", "scale")
    info.push_constant("FLOAT", "rim")
    info.push_constant("FLOAT", "hollow")
    info.push_constant("INT", "shape")
    info.push_constant("BOOL", "srgbTarget")  # Blender sets it: whether the frame buffer takes linear colours
    for place, (kind, name) in enumerate((("VEC2", "pos"), ("VEC4", "color"), ("FLOAT", "size"))):
        info.vertex_in(place, kind, name)
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


def forget() -> None:
    """Nothing of the graphics card is to be held any more."""
    point_shader.cache_clear()


@dataclass
class _Paper:
    """A picture file that is drawn: where batches of the axes in use lie in it, and what is cut off."""

    svg: Svg
    low: np.ndarray
    size: np.ndarray
    clip: Rectangle | None = None

    def pixels(self, places: np.ndarray) -> np.ndarray:
        return self.low + places * self.size


_paper: list[_Paper] = []


@contextmanager
def onto(svg: Svg) -> Iterator[None]:
    """What is drawn goes into a picture file."""
    _paper.append(_Paper(svg, np.zeros(2), np.ones(2)))
    try:
        yield
    finally:
        _paper.pop()


class Points:
    """A kept batch of points.

    Parameters
    ----------
    places : (n, 2); rows with NaN are left out.
    colour : (n, 3 or 4), or one colour.
    size : (n,) or one, in parts of the usual diameter.
    shape : one of `SHAPES`.
    """

    def __init__(
        self,
        places: np.ndarray,
        colour: np.ndarray | Sequence[float],
        size: np.ndarray | float = 1.0,
        shape: str = "circle",
    ) -> None:
        kept = np.isfinite(places).all(axis=1)
        self.count = int(kept.sum())
        self.shape = SHAPES.index(shape)
        colours = np.ones((len(places), 4), dtype=np.float32)
        colour = np.asarray(colour, dtype=np.float32)
        colours[:, : colour.shape[-1]] = colour
        self.values = {
            "pos": np.ascontiguousarray(places[kept], dtype=np.float32),
            "color": np.ascontiguousarray(colours[kept]),
            "size": np.ascontiguousarray(np.broadcast_to(np.float32(size), len(places))[kept], dtype=np.float32),
        }

    @functools.cached_property
    def batch(self) -> gpu.types.GPUBatch:
        """Made when it is first drawn."""
        return batch_for_shader(point_shader(), "POINTS", self.values)

    def draw(
        self,
        diameter: float,
        bounds: tuple[float, float, float, float],
        edge: Rgb = (0.0, 0.0, 0.0),
        rim: float = 0.0,
        hollow: float = 0.0,
    ) -> None:
        """Draw those whose centre is within `bounds` (least x and y, greatest x and y), in the batch's units.

        edge, rim : colour and width of their outline [px].
        hollow : width of the line along their shape [px]; 0 for full ones.
        """
        if not self.count:
            return
        if _paper:
            self._write(_paper[-1], diameter, bounds, edge, rim, hollow)
            return
        shader = point_shader()
        shader.bind()
        shader.uniform_float("bounds", bounds)
        shader.uniform_float("edge", alpha(edge))
        shader.uniform_float("scale", diameter)
        thin = SHAPES[self.shape] in THIN
        shader.uniform_float("rim", 0.0 if thin else rim)
        shader.uniform_float("hollow", 0.0 if thin else hollow)
        shader.uniform_int("shape", self.shape)
        gpu.state.blend_set("ALPHA")
        gpu.state.program_point_size_set(True)
        self.batch.draw(shader)
        gpu.state.program_point_size_set(False)

    def _write(
        self,
        paper: _Paper,
        diameter: float,
        bounds: tuple[float, float, float, float],
        edge: Rgb,
        rim: float,
        hollow: float,
    ) -> None:
        places, shape = self.values["pos"], SHAPES[self.shape]
        seen = ((places >= bounds[:2]) & (places <= bounds[2:])).all(axis=1)
        rows = zip(
            paper.pixels(places[seen]).tolist(),
            self.values["color"][seen].tolist(),
            (0.5 * diameter * self.values["size"][seen]).tolist(),
            strict=True,
        )
        for (x, y), colour, radius in rows:
            paper.svg.point(x, y, shape, radius, colour, edge, 0.6 * rim, hollow)


class Lines:
    """A kept batch of segments (k, 2, 2), or of a line (k, 2) through points."""

    def __init__(self, places: np.ndarray) -> None:
        places = np.asarray(places, dtype=np.float64)
        if places.ndim == 2:
            places = np.stack([places[:-1], places[1:]], axis=1)
        places = places[np.isfinite(places).all(axis=(1, 2))]
        self.places = places.astype(np.float32)

    @functools.cached_property
    def batch(self) -> gpu.types.GPUBatch:
        """Made when it is first drawn."""
        flat = np.zeros((2 * len(self.places), 3), dtype=np.float32)
        flat[:, :2] = self.places.reshape(-1, 2)
        return batch_for_shader(_line_shader(), "LINES", {"pos": flat})

    def draw(self, colour: Rgba, width: float, *, thin: bool = False) -> None:
        """thin : one pixel wide on the screen and not smoothed, which is many times quicker."""
        if not len(self.places):
            return
        if _paper:
            paper = _paper[-1]
            paper.svg.lines(paper.pixels(self.places), colour, width, paper.clip)
            return
        shader = gpu.shader.from_builtin("UNIFORM_COLOR") if thin else _line_shader()
        shader.bind()
        if not thin:
            shader.uniform_float("lineWidth", width)
            shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("color", colour)
        gpu.state.blend_set("ALPHA")
        self.batch.draw(shader)


def fill(area: Rectangle, colour: Rgb | Rgba) -> None:
    """A rectangle in one colour."""
    if _paper:
        _paper[-1].svg.area(area, colour)
        return
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.bind()
    shader.uniform_float("color", colour if len(colour) == 4 else alpha(colour))
    gpu.state.blend_set("ALPHA")
    batch_for_shader(shader, "TRI_STRIP", {"pos": _corners(area)}).draw(shader)


def outline(area: Rectangle, colour: Rgba, width: float) -> None:
    """The border of a rectangle."""
    a, b, c, d = _corners(area)
    lines(np.array([(a, b), (b, d), (d, c), (c, a)]), colour, width)


def lines(places: np.ndarray, colour: Rgba, width: float) -> None:
    """Segments (k, 2, 2), or a line (k, 2) through points, in pixels."""
    Lines(places).draw(colour, width)


def shortened(words: str, size: float, width: float) -> str:
    """The beginning of words that are wider than a width [px], with …, else all of them."""
    blf.size(FONT, size)
    if blf.dimensions(FONT, words)[0] <= width:
        return words
    while words and blf.dimensions(FONT, f"{words}…")[0] > width:
        words = words[:-1]
    return f"{words.rstrip()}…"


def text(
    x: float,
    y: float,
    words: str,
    size: float,
    colour: Rgb,
    anchor: tuple[float, float] = (0.0, 0.0),
    *,
    upright: bool = False,
) -> float:
    """Words at a pixel; their width.

    anchor : the place within the words that lies there, from 0 to 1 along and across them.
    upright : read from below.
    """
    words = visible(words)
    blf.size(FONT, size)
    width, height = float(blf.dimensions(FONT, words)[0]), 0.72 * size
    if _paper:
        _paper[-1].svg.text(x, y, words, size, colour, anchor, upright)
        return width
    along, across = anchor[0] * width, anchor[1] * height
    if upright:
        blf.enable(FONT, blf.ROTATION)
        blf.rotation(FONT, np.pi / 2)
        blf.position(FONT, round(x + across), round(y - along), 0)
    else:
        blf.position(FONT, round(x - along), round(y - across), 0)
    blf.color(FONT, *colour, 1.0)
    blf.draw(FONT, words)
    if upright:
        blf.disable(FONT, blf.ROTATION)
    gpu.state.blend_set("ALPHA")  # blf leaves it at NONE
    return width


LEAST_TEXT = 0.6
"""Of the usual size: in a card for which a view is too narrow."""


def card(place: tuple[float, float], rows: Sequence[str], look: Look, within: Rectangle) -> None:
    """Lines of text in a box beside a pixel, where there is room; the first line is the title.

    In a narrow view the text is smaller; where it would be too small to be read, there is none.
    """
    wanted = max(look.measure(row) for row in rows) + 1.4 * look.text
    size = look.text * min(1.0, within.width / wanted)
    if size < LEAST_TEXT * look.text:
        return
    pad, step, width = 0.7 * size, 1.35 * size, wanted * size / look.text
    height = step * len(rows) + pad
    away = 1.2 * look.point
    left = place[0] + away if place[0] + away + width <= within.right else place[0] - away - width
    bottom = place[1] + away if place[1] + away + height <= within.top else place[1] - away - height
    left = max(min(left, within.right - width), within.left)
    bottom = max(min(bottom, within.top - height), within.bottom)
    area = Rectangle(round(left), round(bottom), round(width), round(height))
    fill(area, alpha(look.card, 0.95))
    outline(area, alpha(look.faint, 0.6), look.line)
    for i, row in enumerate(rows):
        text(area.left + pad, area.top - pad / 2 - (i + 0.8) * step, row, size, look.ink if i else look.chosen)


@contextmanager
def clipped(area: Rectangle) -> Iterator[None]:
    """Draw within a rectangle only."""
    if _paper:
        paper, whole = _paper[-1], _paper[-1].clip
        paper.clip = area
        try:
            yield
        finally:
            paper.clip = whole
        return
    before = gpu.state.scissor_get()
    left, bottom, _, _ = gpu.state.viewport_get()
    gpu.state.scissor_set(round(left + area.left), round(bottom + area.bottom), round(area.width), round(area.height))
    gpu.state.scissor_test_set(True)
    try:
        yield
    finally:
        gpu.state.scissor_set(*before)
        gpu.state.scissor_test_set(False)


@contextmanager
def in_axes(frame: Frame, x: Axis, y: Axis) -> Iterator[tuple[float, float, float, float]]:
    """Draw what was placed along the axes `x` and `y` (from 0 to 1) where the frame shows it now.

    Gives the bounds of what is seen, in the same units, for `Points.draw`.
    """
    low, high = frame.x.places(np.array(x.limits)), frame.y.places(np.array(y.limits))
    wide, tall = low[1] - low[0], high[1] - high[0]
    plot = frame.plot
    bounds = -low[0] / wide, -high[0] / tall, (1 - low[0]) / wide, (1 - high[0]) / tall
    if _paper:
        paper = _paper[-1]
        before = paper.low, paper.size
        paper.low = np.array([plot.left + low[0] * plot.width, plot.bottom + high[0] * plot.height])
        paper.size = np.array([wide * plot.width, tall * plot.height])
        try:
            yield bounds
        finally:
            paper.low, paper.size = before
        return
    matrix = Matrix.Translation((plot.left + low[0] * plot.width, plot.bottom + high[0] * plot.height, 0.0))
    matrix @= Matrix.Diagonal((wide * plot.width, tall * plot.height, 1.0, 1.0))
    with gpu.matrix.push_pop():
        gpu.matrix.multiply_matrix(matrix)
        yield bounds


@functools.cache
def _line_shader() -> gpu.types.GPUShader:
    return gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")


def _corners(area: Rectangle) -> list[tuple[float, float]]:
    return [(area.left, area.bottom), (area.right, area.bottom), (area.left, area.top), (area.right, area.top)]
