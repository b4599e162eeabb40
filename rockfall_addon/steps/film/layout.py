# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written where in the picture: title, time, fastest block, colour legend, notes, and the backdrop."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import bpy
import numpy as np

from ....core.colours import SPEED_SCALE, scale_colours, srgb_to_linear
from ....core.film.simulated import LegendEntry
from ....core.vectors import Array
from ...scene.storage import materials
from . import captions

EDGE = 0.055
LEGEND_STEPS = 48
COUNT_SIZE = 0.9
"""Of the letters that count blocks, as a part of those of their names."""
BACKDROP = ((0.075, 0.085, 0.10), (0.175, 0.205, 0.24))  # slate, below and above
CREDIT = "made with Rockfall"


@dataclass(frozen=True, eq=False)
class Words:
    """What the captions say.

    Attributes
    ----------
    title, subtitle, note : may be empty; the note may have several lines.
    legend : whose blocks have which colour, where there is no scale of speeds.
    speed_top_mps : at the upper end of the legend; None without a legend.
    time_s, fastest_mps : (n,) the numbers for each moment, `rate` of them for a second; None to say none.
    """

    title: str
    subtitle: str = ""
    note: str = ""
    speed_top_mps: float | None = None
    legend: tuple[LegendEntry, ...] = ()
    time_s: Array | None = None
    fastest_mps: Array | None = None
    rate: float = 1.0


def lay_out(words: Words, aspect: float, height_px: int) -> list[bpy.types.Object]:
    """The objects of all captions, around the origin, in shares of the picture's height."""
    small = 0.045 * min(1.0, (360 / height_px) ** 0.25)  # a large picture needs no large letters
    large = 1.55 * small
    left, right, low, high = -aspect / 2 + EDGE, aspect / 2 - EDGE, -0.5 + EDGE, 0.5 - EDGE
    make = partial(captions.caption, weight=_weight(height_px))
    room = 0.62 * aspect / (0.58 * max(len(words.title), 1))  # a letter is about 0.58 of its height wide
    title = min(large, room)
    objects = [make("Film title", words.title, (left, high - 0.75 * large), title)]
    remarks = [(f"Film note{f' {i + 1}' if i else ''}", text) for i, text in enumerate(words.note.split("\n"))]
    for i, (name, text) in enumerate((("Film subtitle", words.subtitle), *remarks)):
        line = high - 0.75 * large - 1.45 * small * (i + 1)
        objects.append(make(name, text, (left, line), small, colour=captions.GREY))
    if words.time_s is not None:
        time = make(
            "Film time", "", (right, high - 0.75 * large), large, align="RIGHT", values=words.time_s, rate=words.rate,
            unit=" s",
        )  # fmt: skip
        objects.append(time)
    if words.fastest_mps is not None:
        fastest = make(
            "Film fastest block", "fastest block  ", (right, high - 0.75 * large - 1.45 * small), small, align="RIGHT",
            values=words.fastest_mps, rate=words.rate, unit=" m/s",
        )  # fmt: skip
        objects.append(fastest)
    if words.speed_top_mps is not None:
        objects += _scale(make, words.speed_top_mps, left, low, small)
    objects += _legend(make, words, left, low, small)
    objects.append(make("Film credit", CREDIT, (right, low), small, align="RIGHT", colour=captions.GREY))
    return objects


def backdrop(aspect: float) -> bpy.types.Object:
    """A sheet behind everything, one unit high, dark below and lighter above."""
    levels = np.linspace(-0.5, 0.5, 9)
    mesh = bpy.data.meshes.new("Film backdrop")
    corners = [(side * aspect / 2, level, 0.0) for level in levels for side in (-1, 1)]
    mesh.from_pydata(corners, [], [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(levels) - 1)])
    part = (np.repeat(levels, 2) + 0.5)[:, None] ** 0.8
    low, high = (np.array(colour) for colour in BACKDROP)
    captions.mark_colour(mesh, _opaque(srgb_to_linear(low + part * (high - low))))
    return _shown("Film backdrop", mesh)


def _weight(height_px: int) -> float:
    return min(1.0, (360 / height_px) ** 0.8)


def _scale(
    make: Callable[..., bpy.types.Object], top_mps: float, left: float, low: float, size: float
) -> list[bpy.types.Object]:
    width, height, bottom = 11.0 * size, 0.5 * size, low + 1.15 * size
    across = np.linspace(0.0, 1.0, LEGEND_STEPS + 1)
    corners = [(left + part * width, bottom + up * height, 0.0) for part in across for up in (0, 1)]
    mesh = bpy.data.meshes.new("Film legend")
    mesh.from_pydata(corners, [], [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(LEGEND_STEPS)])
    captions.mark_colour(
        mesh, _opaque(srgb_to_linear(np.repeat(scale_colours(across, 0.0, 1.0, SPEED_SCALE), 2, axis=0)))
    )
    title = make("Film legend title", "Block speed [m/s]", (left, bottom + height + 0.5 * size), size)
    marks = [
        make(
            f"Film legend {part:g}", f"{top_mps * part:g}", (left + part * width, low), 0.9 * size,
            align=align, colour=captions.GREY,
        )
        for part, align in ((0.0, "LEFT"), (0.5, "CENTER"), (1.0, "RIGHT"))
    ]  # fmt: skip
    return [_shown("Film legend", mesh), title, *marks]


def _legend(
    make: Callable[..., bpy.types.Object], words: Words, left: float, low: float, size: float
) -> list[bpy.types.Object]:
    """A swatch, a name and what there is to count for each, the first on top."""
    objects, bottom, side = [], low, 0.8 * size
    for entry in reversed(words.legend):
        beside = left + 2.1 * side
        if entry.counts is not None:
            counted = make(
                f"Film count {entry.name}", entry.text, (beside, bottom), COUNT_SIZE * size,
                colour=captions.BRIGHT_GREY, values=entry.counts, rate=words.rate, decimals=0, unit=entry.unit,
            )  # fmt: skip
            objects.append(counted)
            bottom += 1.2 * size
        mesh = bpy.data.meshes.new("Film legend entry")
        corners = [
            (left, bottom),
            (left + 1.6 * side, bottom),
            (left + 1.6 * side, bottom + side),
            (left, bottom + side),
        ]
        mesh.from_pydata([(*corner, 0.0) for corner in corners], [], [(0, 1, 2, 3)])
        captions.mark_colour(mesh, _opaque(srgb_to_linear(np.tile(entry.colour, (4, 1)))))
        name = make(f"Film source {entry.name}", entry.name, (beside, bottom), size)
        objects += [_shown(f"Film swatch {entry.name}", mesh), name]
        bottom += 1.5 * size
    return objects


def _shown(name: str, mesh: bpy.types.Mesh) -> bpy.types.Object:
    mesh.materials.append(materials.emission_material("Rockfall caption", captions.COLOUR_ATTRIBUTE))
    return bpy.data.objects.new(name, mesh)


def _opaque(linear: Array) -> Array:
    return np.column_stack([linear, np.ones(len(linear))])
