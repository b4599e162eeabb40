# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture that is drawn on: lines, rings and type with smooth edges and any opacity.

Pixels are counted from the corner of the picture, as the camera does.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np

from ...errors import DependencyError, visible
from ...opencv import opencv
from ...vectors import Array
from .look import INK, PANEL_OPACITY, PAPER, REGULAR, Colour, Look

FINE = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""
FAR = 30_000
"""Places further away than this overflow OpenCV's numbers."""
CENTRE = 0.5
SUBSCRIPT, LOWER = 0.68, 0.2
DIGITS = str.maketrans("₁₂", "12")
SUBSCRIPTED = re.compile(r"\b([RvE])_([NT][12₁₂]?|[12])(?!\w)")
"""Only symbols: names of files have low lines, too."""
LACKING = str.maketrans({"ɴ": "_N", "ᴛ": "_T"})
"""Letters that the typeface has not."""
ROUND = 0.35
"""Radius of a panel's corners, in heights of its type."""

type Anchor = Literal["left", "middle", "right"]
type Picture = np.ndarray
"""(h, w, 3) BGR uint8."""


@dataclass(frozen=True)
class Box:
    """A rectangle of a picture [px]."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """[px]."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """[px]."""
        return self.bottom - self.top

    def grown(self, by: float) -> "Box":
        """With so much more on each side."""
        return Box(self.left - by, self.top - by, self.right + by, self.bottom + by)

    def meets(self, other: "Box") -> bool:
        """Whether they share a place."""
        return (
            self.left < other.right and other.left < self.right and self.top < other.bottom and other.top < self.bottom
        )


@dataclass(frozen=True)
class Written:
    """A text and where it stands."""

    text: str
    box: Box


class Canvas:
    """A picture being drawn on.

    Attributes
    ----------
    picture : (h, w, 3) BGR uint8, changed in place.
    look : sizes for it.
    written : all texts so far.
    """

    def __init__(self, picture: Picture) -> None:
        self.picture = picture
        self.look = Look(picture.shape[1], picture.shape[0])
        self.written: list[Written] = []

    @classmethod
    def copied(cls, other: "Canvas") -> "Canvas":
        """The same picture, to be drawn on further."""
        made = cls(other.picture.copy())
        made.written = list(other.written)
        return made

    def lines(self, paths: Iterable[Array], colour: Colour, width: int, opacity: float = 1.0) -> None:
        """Lines through points, each (n, 2) [px]; they end, and begin again, where a point is NaN.

        All together have the opacity: where they cross, nothing gets darker.
        """
        pieces = [piece for path in paths for piece in _pieces(path)]
        if not pieces:
            return
        box = self._inside(np.concatenate(pieces), width + 2)
        if box is None:
            return
        mask, corner = self._mask(box)
        cv2 = opencv()
        cv2.polylines(mask, [_fixed(piece - corner) for piece in pieces], False, 255, width, cv2.LINE_AA, FINE)
        self._blend(mask, box, colour, opacity)

    def dashes(self, path: Array, colour: Colour, width: int, dash: float, opacity: float = 1.0) -> None:
        """A dashed line through points (n, 2) [px]."""
        self.lines(_dashed(path, dash), colour, width, opacity)

    def area(self, outlines: Sequence[Array], colour: Colour, opacity: float = 1.0) -> None:
        """Polygons, each (n, 2) [px], filled; what lies in two of them is filled once."""
        if not outlines:
            return
        box = self._inside(np.concatenate(outlines), 2)
        if box is None:
            return
        mask, corner = self._mask(box)
        cv2 = opencv()
        for outline in outlines:
            cv2.fillPoly(mask, [_fixed(outline - corner)], 255, cv2.LINE_AA, FINE)
        self._blend(mask, box, colour, opacity)

    def disc(self, place: Array, radius: float, colour: Colour, opacity: float = 1.0) -> None:
        """A filled circle."""
        self.area([_circle(place, radius)], colour, opacity)

    def ring(self, place: Array, radius: float, colour: Colour, width: int, opacity: float = 1.0) -> None:
        """A circle."""
        circle = _circle(place, radius)
        self.lines([np.concatenate([circle, circle[:1]])], colour, width, opacity)

    def shade(self, mask: np.ndarray, left: int, top: int, colour: Colour, opacity: float = 1.0) -> None:
        """A colour where a mask (h, w) of 0…255 says, its corner at (left, top), inside the picture."""
        height, width = mask.shape
        self._blend(mask, (left, top, left + width, top + height), colour, opacity)

    def panel(
        self, box: Box, colour: Colour = INK, opacity: float = PANEL_OPACITY, radius: float | None = None
    ) -> None:
        """A rectangle with round corners, on which text is read on any picture."""
        r = min(ROUND * self.look.body if radius is None else radius, box.width / 2, box.height / 2)
        quarter = np.linspace(0.0, np.pi / 2, 7)
        corners = (
            (box.right - r, box.top + r),
            (box.left + r, box.top + r),
            (box.left + r, box.bottom - r),
            (box.right - r, box.bottom - r),
        )
        outline = [
            np.array(centre) + r * np.column_stack([np.cos(quarter + i * np.pi / 2), -np.sin(quarter + i * np.pi / 2)])
            for i, centre in enumerate(corners)
        ]
        self.area([np.concatenate(outline)], colour, opacity)

    def text(
        self,
        text: str,
        left: float,
        baseline: float,
        size: int,
        colour: Colour = PAPER,
        *,
        weight: int = REGULAR,
        anchor: Anchor = "left",
        opacity: float = 1.0,
    ) -> Box:
        """Type, whose line stands on `baseline`; returns where it stands.

        Parameters
        ----------
        left : of the text, or its middle or right end, as `anchor` says [px].
        """
        pieces, width = _pieces_of(text, size), text_width(text, size, weight)
        start = round(left - {"left": 0.0, "middle": width / 2, "right": width}[anchor])
        line = Box(start, baseline - size, start + width, baseline + 0.25 * size)
        self.written.append(Written(text, line))
        box = self._inside(np.array([[line.left, line.top], [line.right, line.bottom]]), size // 2)
        if not text or opacity <= 0 or box is None:
            return line
        mask, corner = self._mask(box)
        x = start - int(corner[0])
        for piece, high, drop in pieces:
            opencv().putText(mask, piece, (x, round(baseline + drop) - int(corner[1])), 255, _face(), high, weight)
            x += _piece_width(piece, high, weight)
        self._blend(mask, box, colour, opacity)
        return line

    def paste(self, other: "Canvas", left: int, top: int) -> None:
        """Another picture, whole inside this one, with what is written on it."""
        height, width = other.picture.shape[:2]
        self.picture[top : top + height, left : left + width] = other.picture
        for one in other.written:
            box = one.box
            self.written.append(
                Written(one.text, Box(box.left + left, box.top + top, box.right + left, box.bottom + top))
            )

    def _mask(self, box: tuple[int, int, int, int]) -> tuple[np.ndarray, Array]:
        left, top, right, bottom = box
        return np.zeros((bottom - top, right - left), np.uint8), np.array([left, top], dtype=np.float64)

    def _inside(self, points: Array, around: int) -> tuple[int, int, int, int] | None:
        """Left, top, right, bottom of what of the picture lies about some points; None for nothing."""
        low, high = np.floor(points.min(axis=0)) - around, np.ceil(points.max(axis=0)) + around
        size = np.array([self.look.width, self.look.height])
        (left, top), (right, bottom) = np.clip(low, 0, size).astype(int), np.clip(high, 0, size).astype(int)
        return (int(left), int(top), int(right), int(bottom)) if right > left and bottom > top else None

    def _blend(self, mask: np.ndarray, box: tuple[int, int, int, int], colour: Colour, opacity: float) -> None:
        left, top, right, bottom = box
        under = self.picture[top:bottom, left:right]
        share = mask.astype(np.float32)[:, :, None] * np.float32(opacity / 255)
        paint = np.array(colour[::-1], dtype=np.float32) * 255
        under[...] = (under + share * (paint - under) + np.float32(0.5)).astype(np.uint8)


@cache
def _face() -> Any:
    """The typeface that comes with OpenCV 5.

    Raises
    ------
    DependencyError : OpenCV is older and has none.
    """
    cv2 = opencv()
    if not hasattr(cv2, "FontFace"):
        raise DependencyError(
            f"Films are lettered by OpenCV 5, and {cv2.__version__} is installed. "
            "Install it with: pip install --upgrade opencv-python-headless"
        )
    return cv2.FontFace("sans")


def text_width(text: str, size: int, weight: int = REGULAR) -> int:
    """How wide a line of type is [px]."""
    return sum(_piece_width(piece, high, weight) for piece, high, _ in _pieces_of(text, size))


def _pieces_of(text: str, size: int) -> list[tuple[str, int, float]]:
    """A line in pieces, each with its size and how much lower it stands: R_N has its N lower and smaller."""
    text = visible(text).translate(LACKING)
    pieces, at = [], 0
    for found in SUBSCRIPTED.finditer(text):
        pieces += [
            (text[at : found.end(1)], size, 0.0),
            (found[2].translate(DIGITS), round(SUBSCRIPT * size), LOWER * size),
        ]
        at = found.end()
    return [*pieces, (text[at:], size, 0.0)] if text[at:] else pieces


@cache
def _piece_width(text: str, size: int, weight: int) -> int:
    if not text.strip():
        # The space at the end of a line has no width of its own.
        return _piece_width(f"n{text}n", size, weight) - _piece_width("nn", size, weight) if text else 0
    left, _, width, _ = opencv().getTextSize((FAR, FAR), text, (0, 0), _face(), size, weight)
    return int(left + width)


def fitting_size(text: str, size: int, width: float, least: int, weight: int = REGULAR) -> int:
    """The largest type, up to `size` and not below `least`, in which a text is not wider than `width` [px]."""
    while size > least and text_width(text, size, weight) > width:
        size -= 1
    return size


def wrapped(text: str, size: int, width: float, weight: int = REGULAR) -> list[str]:
    """A text in lines not wider than `width` [px], broken between words."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width(longer, size, weight) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _fixed(points: Array) -> np.ndarray:
    """Points from the corner [px] as OpenCV draws them: whole numbers of sixteenths, from the first pixel's centre."""
    return np.round((np.clip(points, -FAR, FAR) - CENTRE) * 2**FINE).astype(np.int32)


def _pieces(path: Array) -> list[Array]:
    """The stretches of two points or more between NaN."""
    known = np.isfinite(path).all(axis=1)
    edges = np.flatnonzero(np.diff(np.r_[False, known, False].astype(np.int8)))
    return [path[i:j] for i, j in zip(edges[::2], edges[1::2], strict=True) if j - i > 1]


def _dashed(path: Array, dash: float) -> list[Array]:
    """Every other stretch of a path, `dash` long."""
    made: list[Array] = []
    for piece in _pieces(path):
        along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(piece, axis=0).T))]
        for start in np.arange(0.0, along[-1], 2 * dash):
            inside = along[(along > start) & (along < start + dash)]
            at = np.r_[start, inside, min(start + dash, along[-1])]
            made.append(np.column_stack([np.interp(at, along, piece[:, 0]), np.interp(at, along, piece[:, 1])]))
    return made


def _circle(place: Array, radius: float) -> Array:
    angle = np.linspace(0.0, 2 * np.pi, max(16, min(90, int(4 * radius))), endpoint=False)
    return np.asarray(place, dtype=np.float64) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
