# SPDX-License-Identifier: GPL-3.0-or-later
"""Styles of QGIS (.qml): which colours maps, paths and points have there."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ..hazard.classes import Classes
from ..output import write_text
from ..vectors import Array

HEAD = "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
VERSION = "3.34"
OPACITY = 0.8
"""Of maps, so that the hillshade below is seen."""
LIGHT = 0.8
"""Points with no less in each channel have a dark edge: the paper of a map is white."""


def raster_style(classes: Classes, unit: str) -> str:
    """The style of a map in its classes; values of 0 and cells without one are not drawn."""
    tops = [*(f"{limit:.10g}" for limit in classes.limits), "inf"]
    entries = [(f"{0:g}", "#ffffff", 0, "")]
    entries += [
        (top, _hex(colour), 255, f"{label} {unit}".strip())
        for top, colour, label in zip(tops, classes.colours, classes.labels, strict=True)
    ]
    items = "\n".join(
        f'          <item value="{value}" color="{colour}" alpha="{alpha}" label={quoteattr(label)}/>'
        for value, colour, alpha, label in entries
    )
    return f"""{HEAD}<qgis version="{VERSION}" styleCategories="Symbology">
  <pipe>
    <rasterrenderer type="singlebandpseudocolor" band="1" opacity="{OPACITY}" alphaBand="-1" nodataColor=""
        classificationMin="0" classificationMax="{classes.limits[-1]:.10g}">
      <rastershader>
        <colorrampshader colorRampType="DISCRETE" classificationMode="1" clip="0" minimumValue="0"
            maximumValue="{classes.limits[-1]:.10g}">
{items}
        </colorrampshader>
      </rastershader>
    </rasterrenderer>
    <brightnesscontrast brightness="0" contrast="0" gamma="1"/>
    <huesaturation saturation="0" grayscaleMode="0" colorizeOn="0"/>
    <rasterresampler maxOversampling="2"/>
  </pipe>
  <blendMode>0</blendMode>
</qgis>
"""


def write_raster_style(path: str | Path, classes: Classes, unit: str) -> None:
    """Write the style of a map beside it, where QGIS looks for it.

    Raises
    ------
    InputError : the file cannot be written.
    """
    write_text(path, raster_style(classes, unit))


def line_style(colour: Sequence[float], width_mm: float, opacity: float = 1.0) -> str:
    """The style of lines in one colour, sRGB in 0…1."""
    options = {"line_color": _rgba(colour), "line_width": f"{width_mm:g}", "line_width_unit": "MM", "capstyle": "round"}
    return _single_symbol("line", "SimpleLine", options, opacity)


def point_style(colour: Sequence[float], size_mm: float, shape: str = "circle", opacity: float = 1.0) -> str:
    """The style of points in one colour, sRGB in 0…1. shape : one of QGIS's, such as "circle" or "triangle"."""
    light = min(colour) > LIGHT
    options = {
        "name": shape,
        "color": _rgba(colour),
        "size": f"{size_mm:g}",
        "size_unit": "MM",
        "outline_color": "40,40,40,255" if light else "255,255,255,160",
        "outline_width": "0.2" if light else "0.1",
    }
    return _single_symbol("marker", "SimpleMarker", options, opacity)


def polygon_style(column: str, classes: Classes, greatest: float, unit: str) -> str:
    """The style of polygons in the classes of a column; those without a value are not drawn.

    Parameters
    ----------
    greatest : value of the column.
    """
    edges = [0.0, *classes.limits, max(greatest, classes.limits[-1])]
    ranges = "\n".join(
        f'      <range lower="{low:.10g}" upper="{high:.10g}" symbol="{i}" render="true" '
        f"label={quoteattr(f'{label} {unit}'.strip())}/>"
        for i, (low, high, label) in enumerate(zip(edges[:-1], edges[1:], classes.labels, strict=True))
    )
    symbols = "\n".join(
        _symbol(
            "fill", "SimpleFill", {"color": _rgba(colour), "style": "solid", "outline_style": "no"}, OPACITY, str(i)
        )
        for i, colour in enumerate(classes.colours.tolist())
    )
    return f"""{HEAD}<qgis version="{VERSION}" styleCategories="Symbology">
  <renderer-v2 type="graduatedSymbol" attr="{column}" graduatedMethod="GraduatedColor" symbollevels="0" forceraster="0">
    <ranges>
{ranges}
    </ranges>
    <symbols>
{symbols}
    </symbols>
  </renderer-v2>
  <blendMode>0</blendMode>
</qgis>
"""


def hatch_style() -> str:
    """The style of polygons that are hatched in black, so that what lies below is seen."""
    line = _symbol("line", "SimpleLine", {"line_color": "20,20,20,255", "line_width": "0.2"}, 1.0, "@0@0")
    pattern = {"angle": "45", "distance": "1.6", "distance_unit": "MM", "line_width": "0.2", "line_width_unit": "MM"}
    return f"""{HEAD}<qgis version="{VERSION}" styleCategories="Symbology">
  <renderer-v2 type="singleSymbol" symbollevels="0" enableorderby="0" forceraster="0">
    <symbols>
{_symbol("fill", "LinePatternFill", pattern, 1.0, "0", line)}
    </symbols>
  </renderer-v2>
  <blendMode>0</blendMode>
</qgis>
"""


def _single_symbol(kind: str, layer: str, options: Mapping[str, str], opacity: float) -> str:
    return f"""{HEAD}<qgis version="{VERSION}" styleCategories="Symbology">
  <renderer-v2 type="singleSymbol" symbollevels="0" enableorderby="0" forceraster="0">
    <symbols>
{_symbol(kind, layer, options, opacity, "0")}
    </symbols>
  </renderer-v2>
  <blendMode>0</blendMode>
</qgis>
"""


def _symbol(kind: str, layer: str, options: Mapping[str, str], opacity: float, name: str, inner: str = "") -> str:
    """A symbol of one layer. inner : the symbol that this layer repeats, where it does."""
    told = "\n".join(
        f'            <Option type="QString" name="{option}" value="{value}"/>' for option, value in options.items()
    )
    return f"""      <symbol type="{kind}" name="{name}" alpha="{opacity:g}" clip_to_extent="1" force_rhr="0">
        <layer class="{layer}" enabled="1" pass="0" locked="0">
          <Option type="Map">
{told}
          </Option>{f"{chr(10)}{inner}" if inner else ""}
        </layer>
      </symbol>"""


def _hex(colour: Array) -> str:
    return "#" + "".join(f"{round(255 * value):02x}" for value in np.clip(colour, 0.0, 1.0).tolist())


def _rgba(colour: Sequence[float]) -> str:
    return ",".join([*(f"{round(255 * value)}" for value in colour), "255"])
