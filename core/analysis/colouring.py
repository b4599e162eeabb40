# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of points by a column of their tables, and of the models in graphs."""

import colorsys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..colours import scale_colours
from ..impact_models.registry import COMPARED, MODELS
from ..vectors import Array
from .columns import Column

Rgb = tuple[float, float, float]

ONE_MODEL: Rgb = (0.843, 0.188, 0.122)
"""Of a model that is shown alone beside the measured points (Noël et al. 2018: in red)."""
MODEL_SHAPES = ("diamond", "square", "triangle", "down", "cross", "plus", "hexagon", "star")
"""A shape for each model, those first that are compared by default, for those who see no hues."""
GOLDEN = 0.381966
OUTER = 0.02
"""Share of the values at either end of a scale that have the colour of the end."""


@dataclass(frozen=True, eq=False)
class Colouring:
    """Colours of the points of several tables by one column.

    Attributes
    ----------
    title : of the column.
    colours : of each table (n, 3) sRGB.
    groups : text → colour, for a column of texts.
    ends : values at the ends of the scale, for a column of numbers.
    """

    title: str
    colours: tuple[Array, ...]
    groups: tuple[tuple[str, Rgb], ...] = ()
    ends: tuple[float, float] | None = None


def colour_by(columns: Sequence[Column], dark: bool) -> Colouring:
    """Colours by one column of several tables: a scale for numbers, a hue each for texts.

    dark : the background.
    """
    if all(column.numbers is not None for column in columns):
        values = np.concatenate([column.numbers for column in columns if column.numbers is not None])
        values = values[np.isfinite(values)]
        low, high = np.quantile(values, [OUTER, 1 - OUTER]).tolist() if values.size else (0.0, 1.0)
        colours = tuple(scale_colours(c.numbers, low, high) for c in columns if c.numbers is not None)
        return Colouring(columns[0].title, colours, ends=(low, high))
    texts = [column.labels for column in columns]
    groups = dict.fromkeys(text for some in texts for text in some.tolist())
    hues = {text: group_colour(i, dark) for i, text in enumerate(groups)}
    colours = tuple(np.array([hues[text] for text in some.tolist()]).reshape(-1, 3) for some in texts)
    return Colouring(columns[0].title, colours, tuple(hues.items()))


def group_colour(number: int, dark: bool) -> Rgb:
    """A colour for the i-th group: hues far apart, in two strengths, that stand out from the background."""
    hue = (0.58 + number * GOLDEN) % 1.0
    light = (0.68, 0.52)[number // 3 % 2] if dark else (0.42, 0.30)[number // 3 % 2]
    return colorsys.hls_to_rgb(hue, light, 0.75)


def model_colours(models: Sequence[str], *, with_blocks: bool = False) -> dict[str, Rgb]:
    """Model → colour in a graph: red for one alone, else a hue each, that of its blocks in the 3-D view.

    with_blocks : such blocks are shown, so one alone has the hue of its own, too: there, red is below the terrain.
    """
    if len(models) == 1 and not with_blocks:
        return {models[0]: ONE_MODEL}
    return {name: (MODELS[name].colour[0], MODELS[name].colour[1], MODELS[name].colour[2]) for name in models}


def model_shape(model: str) -> str:
    """The shape of a model's points, the same in all graphs."""
    order = [*COMPARED, *(name for name in MODELS if name not in COMPARED)]
    return MODEL_SHAPES[order.index(model) % len(MODEL_SHAPES)]
