# SPDX-License-Identifier: GPL-3.0-or-later
"""A web page of a site and its blocks: one file that needs no network, to be opened, sent, or embedded."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, visible
from ..exchange.toml_text import read_toml
from ..film.composed.blocks import sun_direction
from ..film.composed.falls import Fall
from ..film.composed.ground import lit_ground
from ..film.composed.scenery import HEAD_M, HEAD_RADIUS, PERSON, PERSON_M
from ..film.composed.solids import solid
from ..film.framing import downhill_direction, place_camera
from ..film.simulated import path_opacity
from ..progress import Progress, silent
from ..terrain.decimation import decimate
from ..terrain.raycast import any_hit, cast_rays
from ..terrain.scan_colours import colours_at
from ..terrain.surface import Surface
from ..vectors import Array, Mask, norm, unit
from ..versions import versions
from .packing import Packing, in_reading_order, quantise
from .show import CREDITS, DOI, Show

ASSETS = Path(__file__).resolve().parents[2] / "assets" / "page"
MOST_BYTES = 10_000_000
MOST_FACES = 250_000
"""Triangles that a phone turns without stuttering."""
LEAST_FACES = 2_000
MEASURED_STEP_S, SIMULATED_STEP_S = 1 / 60, 0.1
"""Between the rows of a path: the cubic between them is a free flight in any case."""
KEPT_M = 5e-4
COARSER = 0.6
SUN_LEFT_DEG, SUN_UP_DEG = 60.0, 45.0
"""Where the sun stands: so far to the left of whoever looks at the slope first, which shows its relief."""
ASPECT = 1.6
SEEN_POINTS = 150
LIFT_M = 0.5
ASIDE_M = 2.5
"""From the end of the paths to the person who stands there."""
LEAST_OPACITY = 0.15


@dataclass(frozen=True)
class Page:
    """A page, and what is in it.

    Attributes
    ----------
    text : the file.
    faces : triangles of its terrain.
    blocks : how many move in it.
    """

    text: str
    faces: int
    blocks: int

    @property
    def size_bytes(self) -> int:
        """As a file in UTF-8."""
        return len(self.text.encode("utf-8"))


@lru_cache
def page_texts() -> Mapping[str, Mapping[str, str]]:
    """Language → key → what the page says."""
    return read_toml(ASSETS / "texts.toml", "texts of the page")


def check_language(language: str) -> str:
    """The language.

    Raises
    ------
    InputError : the page does not speak it; the message names the nearest.
    """
    known = list(page_texts())
    if language not in known:
        near = get_close_matches(language.lower(), known, n=1, cutoff=0.4)
        hint = f"Did you mean {near[0]}? " if near else ""
        raise InputError(f"The page does not speak {language!r}", advice=f"{hint}It speaks {', '.join(known)}")
    return language


def make_page(show: Show, language: str = "en", most_bytes: int = MOST_BYTES, progress: Progress = silent) -> Page:
    """Make the page of a show; its terrain is as fine as the size of the file allows.

    Raises
    ------
    InputError : the language is not known; the paths of so many blocks do not fit.
    """
    check_language(language)
    faces = MOST_FACES
    while True:
        progress("Making the page", 0, 0)
        page = _page(show, language, faces)
        if page.size_bytes <= most_bytes:
            return page
        if show.surface is None or faces <= LEAST_FACES:
            raise InputError(
                f"The page of {len(show.falls)} blocks would have {page.size_bytes / 1e6:.1f} MB, "
                f"and {most_bytes / 1e6:.0f} MB are the most",
                advice="Show fewer simulated blocks: --number",
            )
        faces = max(int(COARSER * min(faces, len(show.surface.faces))), LEAST_FACES)


def _page(show: Show, language: str, most_faces: int) -> Page:
    packing, view = Packing(), _view(show)
    sun = _sun(view)
    groups = list(dict.fromkeys(fall.group for fall in show.falls))
    falls = [thinned(fall, SIMULATED_STEP_S if fall.group else MEASURED_STEP_S) for fall in show.falls]
    terrain = _terrain(show, most_faces, sun, packing)
    blocks = _blocks(falls, groups, show, packing)
    body = solid("rock", np.ones(3))
    packing.add("solid", body.vertices[body.faces].reshape(-1, 3), "float32")
    extra = show.site.extra
    content = {
        "title": show.site.name,
        "subtitle": show.site.description,
        "credits": str(extra.get(CREDITS, "")),
        "doi": str(extra.get(DOI, "")).removeprefix("https://doi.org/").removeprefix("doi:"),
        "version": versions()["rockfall"],
        "language": language,
        "texts": page_texts(),
        "duration": show.duration_s,
        "together": show.together,
        "origin": {"x": show.origin.x, "y": show.origin.y, "z": show.origin.z, "crs": show.origin.crs},
        "sun": sun.tolist(),
        "groups": [_group(name, [fall for fall in falls if fall.group == name]) for name in groups],
        "blocks": blocks,
        "terrain": terrain,
        "view": view,
        "person": _person(show),
        "tables": packing.tables,
    }
    parts = {
        "title": escape(visible(show.site.name)),
        "language": language,
        "no_script": escape(page_texts()[language]["no_script"]),
        "style": _asset("page.css"),
        "show": visible(json.dumps(content, ensure_ascii=False, separators=(",", ":"))).replace("<", "\\u003c"),
        "tables": packing.text(),
        "licence": _asset("LICENSE-three.txt").strip(),
        "library": _asset("three.min.js").strip(),
        "viewer": _asset("viewer.js"),
    }
    pieces = _asset("page.html").replace("}}", "{{").split("{{")
    text = "".join(parts[piece] if i % 2 else piece for i, piece in enumerate(pieces))
    return Page(text, 0 if terrain is None else int(terrain["faces"]), len(falls))


def thinned(fall: Fall, step_s: float) -> Fall:
    """A fall with rows about a step apart, which gives all places to `KEPT_M`.

    Rows at which its motion changes stay: impacts, ends, gaps, another spin, and where the cubic between the others
    would not pass through them, as on the ground.
    """
    time = fall.time_s
    jump = np.r_[True, (np.diff(time) <= 0) | (np.diff(fall.chain) != 0)]
    kept = jump | np.r_[jump[1:], True]
    if fall.spin is not None:
        kept |= np.r_[False, np.any(np.nan_to_num(np.diff(fall.spin, axis=0)) != 0, axis=1)]
    last = -np.inf
    for i in range(time.size):
        if kept[i] or time[i] - last >= step_s * (1 - 1e-6):
            kept[i], last = True, time[i]
    few = _rows(fall, kept)
    rows = np.flatnonzero(kept)
    for i in np.flatnonzero(~kept).tolist():
        place = few.state(float(time[i]))
        if place is None or np.abs(place[0] - fall.position[i]).max() > KEPT_M:
            before = int(np.searchsorted(rows, i))
            kept[rows[before - 1] : rows[min(before, rows.size - 1)]] = True
    return _rows(fall, kept)


def _rows(fall: Fall, kept: Mask) -> Fall:
    return replace(
        fall,
        time_s=fall.time_s[kept],
        position=fall.position[kept],
        velocity=fall.velocity[kept],
        chain=fall.chain[kept],
        spin=None if fall.spin is None else fall.spin[kept],
    )


def _blocks(falls: list[Fall], groups: list[str], show: Show, packing: Packing) -> list[dict[str, Any]]:
    ends = np.cumsum([fall.time_s.size for fall in falls])
    packing.add("time", np.concatenate([fall.time_s for fall in falls]), "float32")
    packing.add("place", np.concatenate([fall.position for fall in falls]), "float32")
    packing.add("velocity", np.concatenate([fall.velocity for fall in falls]), "float32")
    packing.add("spin", np.concatenate([fall._turning for fall in falls]), "float32")
    packing.add("chain", np.concatenate([fall.chain - fall.chain[0] for fall in falls]) % 256, "uint8")
    return [
        {
            "name": fall.name,
            "label": fall.name.partition(",")[0],
            "group": groups.index(fall.group),
            "rows": [int(end) - fall.time_s.size, int(end)],
            "size": [round(float(d), 4) for d in fall.diameters_m],
            "mass": float(f"{fall.mass_kg:.4g}"),
            "rests": fall.name in show.rests,
        }
        for fall, end in zip(falls, ends, strict=True)
    ]


def _group(name: str, falls: list[Fall]) -> dict[str, Any]:
    title, comma, _ = name.partition(", without chance")
    colour = "#" + "".join(f"{round(255 * part):02x}" for part in falls[0].colour)
    opacity = max(path_opacity(len(falls)), LEAST_OPACITY)
    return {
        "title": title,
        "random": not comma,
        "measured": not name,
        "colour": colour,
        "opacity": round(opacity, 3),
        "count": len(falls),
    }


def _terrain(show: Show, most_faces: int, sun: Array, packing: Packing) -> dict[str, Any] | None:
    surface = show.surface
    if surface is None or not len(surface.faces):
        return None
    coarse = decimate(surface.vertices, surface.faces, most_faces)
    used, faces = np.unique(coarse.faces, return_inverse=True)
    vertices = coarse.vertices[used]
    scanned = None if surface.colours is None else colours_at(vertices, surface.vertices, surface.colours)
    mesh = Surface(vertices, faces.reshape(-1, 3).astype(np.int32), surface.shift, surface.name, colours=scanned)
    colours = lit_ground(mesh, sun, show.photographs).colours
    places = quantise(mesh.vertices)
    packing.add("vertices", places.number, "uint16", differences=True)
    packing.add("colours", np.round(255 * np.clip(colours, 0, 1)), "uint8", differences=True)
    packing.add("faces", in_reading_order(mesh.faces), "uint32", differences=True)
    return {"low": places.low.tolist(), "step": places.step.tolist(), "faces": len(mesh.faces)}


def _view(show: Show) -> dict[str, Any]:
    """Where the page's camera looks from at first, and what it has to show."""
    measured = [fall for fall in show.falls if fall.is_measured]
    points = np.concatenate([fall.position for fall in measured])
    points = points[np.linspace(0, len(points) - 1, min(len(points), SEEN_POINTS)).astype(int)]
    downhill = downhill_direction(
        np.array([fall.position[0] for fall in measured]), np.array([fall.position[-1] for fall in measured])
    )
    surface = show.surface

    def seen(position: Array) -> Array:
        assert surface is not None
        raised = points + np.array([0.0, 0.0, LIFT_M])
        away = raised - position
        far = norm(away)
        hidden = any_hit(surface, np.broadcast_to(position, raised.shape), away / far[:, None], far)
        return np.where(hidden, 0.0, 1.0)

    view = place_camera(points, downhill, ASPECT, None if surface is None else seen)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return {
        "forward": view.forward.tolist(),
        "target": np.round(middle, 2).tolist(),
        "points": np.round(points, 2).tolist(),
    }


def _sun(view: Mapping[str, Any]) -> Array:
    """(3,) unit vector towards the sun."""
    away = np.array(view["forward"])
    azimuth_deg = float(np.degrees(np.arctan2(-away[0], -away[1])))
    return sun_direction(azimuth_deg + SUN_LEFT_DEG, SUN_UP_DEG)


def _person(show: Show) -> dict[str, Any] | None:
    """Somebody beside the lowest end of a path; None where there is no ground to stand on."""
    if show.surface is None:
        return None
    measured = [fall for fall in show.falls if fall.is_measured]
    lowest = min(measured, key=lambda fall: float(fall.position[-1, 2]))
    way = lowest.position[-1] - lowest.position[0]
    aside = unit(np.array([-way[1], way[0], 0.0])) if np.hypot(way[0], way[1]) > 1e-6 else np.array([1.0, 0.0, 0.0])
    high = float(show.surface.vertices[:, 2].max()) + 1.0
    for step in (ASIDE_M, -ASIDE_M, 0.0):
        place = lowest.position[-1] + step * aside
        foot = cast_rays(show.surface, np.array([[place[0], place[1], high]]), np.array([[0.0, 0.0, -1.0]])).point[0]
        if np.isfinite(foot).all():
            return {
                "place": np.round(foot, 3).tolist(),
                "height": PERSON_M,
                "outline": PERSON,
                "head": [HEAD_M, HEAD_RADIUS],
            }
    return None


@lru_cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")
