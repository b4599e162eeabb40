# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as SVG, read back by an XML parser and by eye coordinates."""

from xml.etree import ElementTree

import numpy as np
import pytest
from rockfall.core.analysis.graph_layout import Rectangle
from rockfall.core.analysis.svg import Svg

NS = "{http://www.w3.org/2000/svg}"


def read(svg: Svg) -> ElementTree.Element:
    return ElementTree.fromstring(svg.document())


def test_places_count_from_the_lower_left_corner() -> None:
    svg = Svg(200, 100)
    svg.area(Rectangle(10, 20, 30, 40), (1.0, 0.5, 0.0))
    svg.lines(np.array([[[0, 0], [10, 5]], [[10, 5], [20, 0]], [[50, 50], [60, 60]]]), (0, 0, 0, 0.25), 1.5)
    area, line = read(svg).find(f"{NS}rect"), read(svg).find(f"{NS}path")
    assert [area.get(name) for name in ("x", "y", "width", "height", "fill")] == ["10", "40", "30", "40", "#ff8000"]
    assert line.get("d") == "M0 100L10 95L20 100M50 50L60 40"
    assert (line.get("stroke-opacity"), line.get("stroke-width")) == ("0.25", "1.5")


def test_what_is_cut_off_is_cut_off_at_its_rectangle() -> None:
    svg = Svg(100, 100)
    for area in (Rectangle(5, 5, 10, 10), Rectangle(5, 5, 10, 10), Rectangle(1, 1, 2, 2)):
        svg.lines(np.zeros((1, 2, 2)), (0, 0, 0), 1.0, area)
    root = read(svg)
    assert [path.get("clip-path") for path in root.iter(f"{NS}path")] == ["url(#clip0)", "url(#clip0)", "url(#clip1)"]
    assert [clip.get("id") for clip in root.iter(f"{NS}clipPath")] == ["clip0", "clip1"]
    assert root.find(f"{NS}defs/{NS}clipPath/{NS}rect").get("y") == "85"


def test_words_are_escaped_anchored_and_turned() -> None:
    svg = Svg(100, 100)
    svg.text(10, 20, "a < b & c", 10, (0, 0, 0), (0.5, 0.5))
    svg.text(10, 20, "up", 10, (0, 0, 0), (1.0, 0.0), upright=True)
    svg.text(10, 20, "R_N [–]", 10, (0, 0, 0), (0.0, 1.0))
    level, up, below = read(svg).iter(f"{NS}text")
    assert (level.text, level.get("text-anchor"), level.get("y")) == ("a < b & c", "middle", "83.6")
    assert up.get("transform") == "translate(10 80) rotate(-90)"
    assert below.get("y") == "87.2"
    with pytest.raises(ValueError, match=r"not at 0\.3"):
        svg.text(0, 0, "no", 10, (0, 0, 0), (0.3, 0.0))


@pytest.mark.parametrize(
    "shape", ["circle", "diamond", "square", "triangle", "down", "cross", "plus", "hexagon", "star", "ring"]
)
def test_each_shape_is_centred_and_as_large_as_asked(shape: str) -> None:
    svg = Svg(100, 100)
    svg.point(50, 40, shape, 10, (0, 0, 1), (1, 1, 1), 1.0)
    path = read(svg).find(f"{NS}path")
    if shape in ("circle", "ring"):
        assert path.get("d").startswith("M41.8 60a8.2 8.2")
    else:
        places = np.array([p.split() for p in path.get("d").strip("MZ").replace("M", "L").split("L")], dtype=float)
        assert np.abs(places - (50, 60)).max() <= 10.5
        assert np.abs(places - (50, 60)).max() >= 6.0
        assert np.allclose(places[:, 0].mean(), 50, atol=0.1)
    hollow = shape in ("cross", "plus", "ring")
    assert (path.get("fill") == "none") == hollow
    assert (path.get("stroke") == "#0000ff") == hollow
