# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and sizes of the graphs, from the theme and the interface scale."""

from dataclasses import dataclass

import blf
import bpy

Rgb = tuple[float, float, float]
Rgba = tuple[float, float, float, float]

FONT = 0
POINT = 8.0
"""Diameter of a point at interface scale 1 [px]."""


@dataclass(frozen=True)
class Look:
    """How graphs are drawn.

    Attributes
    ----------
    scale : of the interface.
    text : height of the text [px].
    dark : whether the background is dark.
    back, plot : of the editor, and between axes.
    ink, faint, grid : of text and axes, of less important text, of the grid.
    measured : of measured points.
    chosen : of what is selected.
    card : behind text over points.
    """

    scale: float
    text: float
    dark: bool
    back: Rgb
    plot: Rgb
    ink: Rgb
    faint: Rgb
    grid: Rgb
    measured: Rgb
    chosen: Rgb
    card: Rgb

    @property
    def point(self) -> float:
        """Diameter of a point [px]."""
        return POINT * self.scale

    @property
    def line(self) -> float:
        """Width of a thin line [px]."""
        return max(1.0, self.scale)

    def measure(self, words: str) -> float:
        """Width of a text [px]."""
        blf.size(FONT, self.text)
        return float(blf.dimensions(FONT, words)[0])


def look(context: bpy.types.Context) -> Look:
    """For the preferences of a context."""
    preferences = context.preferences
    scale = preferences.system.ui_scale
    theme, text = preferences.themes[0], preferences.ui_styles[0].widget.points * scale
    panel = theme.user_interface.panel_back  # a light theme keeps the node editor dark
    return dressed(scale, text, tuple(panel[:3]), tuple(theme.view_3d.object_active[:3]))


def dressed(scale: float, text: float, back: Rgb, chosen: Rgb = (1.0, 0.63, 0.16)) -> Look:
    """For a background, dark or light; also for pictures that no theme has a say in."""
    dark = luminance(back) < 0.45
    far, near = ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)) if dark else ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    plot = mixed(back, near, 0.55 if dark else 0.85)
    return Look(
        scale=scale,
        text=text,
        dark=dark,
        back=mixed(back, near, 0.35 if dark else 0.5),
        plot=plot,
        ink=mixed(plot, far, 0.88),
        faint=mixed(plot, far, 0.6),
        grid=mixed(plot, far, 0.1),
        measured=far,
        chosen=chosen if dark else (0.90, 0.42, 0.0),
        card=mixed(plot, far, 0.08) if dark else plot,
    )


def luminance(colour: Rgb) -> float:
    """From 0, black, to 1, white, as the eye weighs sRGB."""
    return 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]


def readable(colour: Rgb, look: Look) -> Rgb:
    """A colour, mixed with that of the measured points until it stands out from the background."""
    apart = 0.30 if look.dark else 0.42
    for share in range(10):
        found = mixed(colour, look.measured, share / 10)
        if abs(luminance(found) - luminance(look.plot)) >= apart:
            break
    return found


def mixed(one: Rgb, other: Rgb, share: float) -> Rgb:
    """A colour between two, with a share of the other."""
    red, green, blue = (a + (b - a) * share for a, b in zip(one, other, strict=True))
    return red, green, blue


def alpha(colour: Rgb, value: float = 1.0) -> Rgba:
    """A colour with its opacity."""
    return (*colour, value)
