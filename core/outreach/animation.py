# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of blocks frame by frame, for programs that play animations: glTF, USD, Alembic."""

from dataclasses import dataclass
from difflib import get_close_matches
from math import ceil, isfinite
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..camera.model import quaternion_from_rotation
from ..colours import srgb_to_linear
from ..errors import InputError
from ..film.composed.blocks import sun_direction
from ..film.composed.falls import Fall
from ..film.composed.ground import lit_ground
from ..film.composed.solids import SOLIDS, solid
from ..georeference import GlobalShift
from ..progress import Progress, silent
from ..terrain.decimation import decimate
from ..terrain.scan_colours import colours_at
from ..terrain.surface import Surface
from ..vectors import Array
from .show import CREDITS, DOI, Show

FORMATS = {"glb": "glTF 2.0, binary", "usdc": "USD, binary", "usda": "USD, text", "abc": "Alembic"}
ENDINGS = {"gltf": "glb", "usd": "usdc", "alembic": "abc"}
"""Other names of the formats."""
RATE = 25.0
MOST_RATE = 1000.0
MOST_FRAMES = 20_000
MOST_FACES = 1_000_000
SUN_DEG = (315.0, 50.0)
PATH_STEP_S = 1 / 30


@dataclass(frozen=True, eq=False)
class Animation:
    """A site and its blocks frame by frame, in metres about a near origin, z up; frame 0 is second 0.

    Attributes
    ----------
    rate : frames per second.
    names : of the b blocks.
    groups : (b,) "" for measured ones, else the model.
    colours : (b, 3) sRGB.
    sizes : (b, 3) diameters [m].
    place : (b, f, 3) of the centres [m]; before its start and after its end a block stays where it is.
    turn : (b, f, 4) unit quaternions w, x, y, z from its axes to the world, without jumps from q to −q.
    paths : (b) places (p, 3) along each path [m], NaN rows between stretches.
    body : the solid of diameter 1 that stands for all.
    ground : the terrain, or None.
    ground_colours : (n, 3) sRGB of its vertices.
    origin : the survey coordinates of the origin.
    about : what is to be said with it: title, credits, DOI.
    """

    rate: float
    names: tuple[str, ...]
    groups: tuple[str, ...]
    colours: Array
    sizes: Array
    place: Array
    turn: Array
    paths: tuple[Array, ...]
    body: Surface
    ground: Surface | None
    ground_colours: Array
    origin: GlobalShift
    about: dict[str, str]

    @property
    def frames(self) -> int:
        """How many."""
        return int(self.place.shape[1])


def known_format(text: str) -> str:
    """One of `FORMATS`, as a person writes it: glb, .glb, glTF.

    Raises
    ------
    InputError : it is not known; the nearest is named.
    """
    name = text.strip().lower().removeprefix(".")
    name = ENDINGS.get(name, name)
    if name not in FORMATS:
        near = get_close_matches(name, [*FORMATS, *ENDINGS], n=1, cutoff=0.4)
        hint = f"Did you mean {near[0]}? " if near else ""
        listed = ", ".join(f"{known} ({what})" for known, what in FORMATS.items())
        raise InputError(f"There is no format {text!r}", advice=f"{hint}Known: {listed}")
    return name


def animate(show: Show, rate: float = RATE, block: str = "rock", progress: Progress = silent) -> Animation:
    """Place the blocks of a show at every frame.

    Parameters
    ----------
    rate : frames per second.
    block : the solid that stands for all, see `solids`.

    Raises
    ------
    InputError : a rate that no program plays, or so many frames.
    """
    if not (isfinite(rate) and 0 < rate <= MOST_RATE):
        raise InputError(
            f"{rate:g} frames per second cannot be written", advice=f"Give more than 0, {MOST_RATE:g} at most"
        )
    frames = ceil(show.duration_s * rate - 1e-6) + 1
    if frames > MOST_FRAMES:
        raise InputError(
            f"{show.duration_s:.0f} s at {rate:g} Hz are {frames} frames, and {MOST_FRAMES} are the most",
            advice="Give a lower rate, or let all blocks start together",
        )
    body = solid(block, np.ones(3)) if block in SOLIDS else None
    if body is None:
        near = get_close_matches(block, SOLIDS, n=1, cutoff=0.4)
        raise InputError(
            f"There is no solid {block!r}",
            advice=f"{f'Did you mean {near[0]}? ' if near else ''}Known: {', '.join(SOLIDS)}",
        )
    moments = np.arange(frames) / rate
    place, turn = np.empty((len(show.falls), frames, 3)), np.empty((len(show.falls), frames, 4))
    for i, fall in enumerate(show.falls):
        progress("Placing the blocks", i, len(show.falls))
        place[i] = places_at(fall, moments)
        turn[i] = _continuous(quaternion_from_rotation(np.stack([fall.turn(float(moment)) for moment in moments])))
    ground, colours = _ground(show)
    extra = show.site.extra
    about = {
        "title": show.site.name,
        "description": show.site.description,
        "credits": str(extra.get(CREDITS, "")),
        "doi": str(extra.get(DOI, "")),
    }
    return Animation(
        rate,
        tuple(fall.name for fall in show.falls),
        tuple(fall.group for fall in show.falls),
        np.array([fall.colour for fall in show.falls]),
        np.stack([fall.diameters_m for fall in show.falls]),
        place,
        turn,
        tuple(_path(fall) for fall in show.falls),
        body,
        ground,
        colours,
        show.origin,
        about,
    )


def places_at(fall: Fall, moments_s: Array) -> Array:
    """(f, 3) where a block is; before its start, after its end and in gaps where it was seen last [m]."""
    found, last = np.empty((moments_s.size, 3)), fall.position[0]
    for i, moment in enumerate(moments_s.tolist()):
        state = fall.state(moment)
        if state is not None:
            last = state[0]
        elif moment > fall.time_s[0]:
            last = fall.position[int(np.searchsorted(fall.time_s, moment, side="right")) - 1]
        found[i] = last
    return found


def save_animation(animation: Animation, file: Path) -> None:
    """Write it for another process, which `load_animation` reads."""
    lengths = np.array([len(path) for path in animation.paths])
    ground = animation.ground
    origin, about = animation.origin, animation.about
    np.savez(
        file,
        rate=animation.rate,
        names=np.array(animation.names),
        groups=np.array(animation.groups),
        colours=animation.colours,
        sizes=animation.sizes,
        place=animation.place,
        turn=animation.turn,
        paths=np.concatenate(animation.paths),
        lengths=lengths,
        body_vertices=animation.body.vertices,
        body_faces=animation.body.faces,
        has_ground=ground is not None,
        ground_vertices=np.zeros((0, 3)) if ground is None else ground.vertices,
        ground_faces=np.zeros((0, 3), np.int32) if ground is None else ground.faces,
        ground_colours=animation.ground_colours,
        origin=origin.vector,
        systems=np.array([origin.crs, origin.vertical]),
        about_keys=np.array(list(about)),
        about_texts=np.array(list(about.values())),
    )


def load_animation(file: Path) -> Animation:
    """What `save_animation` has written."""
    with np.load(file, allow_pickle=False) as found:
        values: dict[str, NDArray[Any]] = dict(found)
    crs, vertical = values["systems"].tolist()
    x, y, z = values["origin"].tolist()
    origin = GlobalShift(x, y, z, crs, vertical)
    ground = None
    if values["has_ground"]:
        ground = Surface(values["ground_vertices"], values["ground_faces"], origin, "terrain")
    return Animation(
        float(values["rate"]),
        tuple(values["names"].tolist()),
        tuple(values["groups"].tolist()),
        values["colours"],
        values["sizes"],
        values["place"],
        values["turn"],
        tuple(np.split(values["paths"], np.cumsum(values["lengths"])[:-1])),
        Surface(values["body_vertices"], values["body_faces"], GlobalShift(), "solid"),
        ground,
        values["ground_colours"],
        origin,
        dict(zip(values["about_keys"].tolist(), values["about_texts"].tolist(), strict=True)),
    )


def linear_rgba(colours: Array) -> Array:
    """(n, 4) as the formats keep colours, of (n, 3) sRGB."""
    linear = srgb_to_linear(np.asarray(colours))
    return np.column_stack([linear, np.ones(len(linear))])


def _continuous(turns: Array) -> Array:
    """(f, 4) with signs such that none jumps to the opposite quaternion."""
    flips = np.cumprod(np.where(np.einsum("ij,ij->i", turns[1:], turns[:-1]) < 0, -1.0, 1.0))
    return turns * np.r_[1.0, flips][:, None]


def _path(fall: Fall) -> Array:
    _, place = fall.path(float(fall.time_s[-1]))
    kept = np.zeros(len(place), dtype=bool)
    usual_s = float(np.median(np.diff(fall.time_s)))
    kept[:: max(round(PATH_STEP_S / max(usual_s, 1e-3)), 1)] = True
    kept[[0, -1]] = True
    repeated = np.r_[np.all(np.diff(place, axis=0) == 0, axis=1), False]  # an impact, which has two rows
    return place[kept | repeated | ~np.isfinite(place[:, 0])]


def _ground(show: Show) -> tuple[Surface | None, Array]:
    surface = show.surface
    if surface is None or not len(surface.faces):
        return None, np.zeros((0, 3))
    coarse = decimate(surface.vertices, surface.faces, MOST_FACES)
    scanned = None if surface.colours is None else colours_at(coarse.vertices, surface.vertices, surface.colours)
    ground = Surface(coarse.vertices, coarse.faces, surface.shift, surface.name, colours=scanned)
    return ground, lit_ground(ground, sun_direction(*SUN_DEG), show.photographs).colours
