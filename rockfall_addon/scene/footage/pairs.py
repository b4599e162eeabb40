# SPDX-License-Identifier: GPL-3.0-or-later
"""The pairs of a camera: a picture's pixel and the point of the terrain that is seen there, kept in doubles.

A pair may be open: half of it is missing, or was predicted and waits for a person to confirm it.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import bpy
import numpy as np

from ....core.camera.pairs import Pairs
from ....core.georeference import GlobalShift
from ....core.vectors import Array
from ..storage import store
from . import videos

COLOURS, FIRST_COLOUR = 6, 1
"""Of the theme's collections, without the first and the last: red is what passes below the terrain, brown is rock."""
PIXEL, POINT = "pixel", "point"


@dataclass(frozen=True)
class Pair:
    """A pixel and the point of the terrain that is seen there.

    Attributes
    ----------
    pixel : u, v [px]; None while it is missing.
    point : local [m]; None while it is missing.
    frame : the video's frame in which the pixel was marked.
    enabled : the camera is solved with it; otherwise the pair only checks the camera.
    proposed : the side that was computed and waits to be confirmed: "pixel", "point", or empty.
    agreed : the side that was computed and taken as it was: no measurement, so the pair only checks the camera.
    colour : number of its colour.
    """

    id: str
    name: str
    pixel: tuple[float, float] | None
    point: tuple[float, float, float] | None
    frame: int
    enabled: bool = True
    proposed: str = ""
    agreed: str = ""
    colour: int = 0
    sigma_px: float = math.nan
    sigma_m: float = math.nan

    @property
    def is_complete(self) -> bool:
        """Both sides are there, and a person has seen them."""
        return self.pixel is not None and self.point is not None and not self.proposed

    @property
    def counts(self) -> bool:
        """Whether the camera is solved with it: it is wanted, and a person has measured both sides."""
        return self.enabled and not self.agreed

    @property
    def missing(self) -> str:
        """The side that waits for a person: "pixel", "point", or empty."""
        if self.proposed:
            return self.proposed
        return PIXEL if self.pixel is None else POINT if self.point is None else ""


def pairs_of(camera: bpy.types.Object) -> list[Pair]:
    """The pairs of a camera, in the order in which they were made."""
    return [_pair(values.to_dict()) for values in camera.get(store.PAIRS, ())]


def complete_of(camera: bpy.types.Object) -> list[Pair]:
    """The pairs of a camera that have both sides."""
    return [pair for pair in pairs_of(camera) if pair.is_complete]


def keep_pairs(camera: bpy.types.Object, pairs: Sequence[Pair]) -> None:
    """Store the pairs; nothing is solved."""
    if pairs:
        camera[store.PAIRS] = [_values(pair) for pair in pairs]
    elif store.PAIRS in camera:
        del camera[store.PAIRS]
    if not any(pair.id == camera.get(store.OPEN_PAIR) and pair.missing for pair in pairs):
        camera[store.OPEN_PAIR] = ""


def with_id(pairs: Iterable[Pair], identifier: str) -> Pair | None:
    """The pair of an id."""
    return next((pair for pair in pairs if pair.id == identifier), None)


def open_pair(camera: bpy.types.Object) -> Pair | None:
    """The pair whose other side is clicked next."""
    pair = with_id(pairs_of(camera), str(camera.get(store.OPEN_PAIR, "")))
    return pair if pair is not None and pair.missing else None


def active_pair(camera: bpy.types.Object) -> Pair | None:
    """The pair of the active row."""
    pairs, index = pairs_of(camera), camera.rockfall_alignment.active
    return pairs[index] if 0 <= index < len(pairs) else None


def table(complete: Sequence[Pair], shift: GlobalShift, source: Path | None = None) -> Pairs:
    """Complete pairs as the core has them."""
    return Pairs(
        pixel=np.array([pair.pixel for pair in complete], dtype=np.float64).reshape(-1, 2),
        point=np.array([pair.point for pair in complete], dtype=np.float64).reshape(-1, 3),
        name=np.array([pair.name for pair in complete], dtype=np.str_),
        frame=np.array([pair.frame for pair in complete], dtype=np.intp),
        sigma_px=np.array([pair.sigma_px for pair in complete], dtype=np.float64),
        sigma_m=np.array([pair.sigma_m for pair in complete], dtype=np.float64),
        used=np.array([pair.counts for pair in complete], dtype=np.bool_),
        shift=shift,
        source=source,
    )


def times_of(camera: bpy.types.Object, frames: Iterable[int]) -> Array:
    """(n,) video times of frames [s]; those beyond the video have that of its end."""
    times = videos.times_of(camera)
    return times[np.clip(np.array(list(frames), dtype=np.intp), 0, times.size - 1)]


def _values(pair: Pair) -> dict:
    u, v = pair.pixel if pair.pixel is not None else (math.nan, math.nan)
    x, y, z = pair.point if pair.point is not None else (math.nan,) * 3
    plain = {f.name: getattr(pair, f.name) for f in fields(pair) if f.name not in (PIXEL, POINT)}
    return plain | {"u": float(u), "v": float(v), "x": float(x), "y": float(y), "z": float(z)}


def _pair(values: dict) -> Pair:
    pixel = (values.pop("u"), values.pop("v"))
    point = (values.pop("x"), values.pop("y"), values.pop("z"))
    known = {f.name for f in fields(Pair)}
    rest = {name: value for name, value in values.items() if name in known}
    rest["enabled"] = bool(rest.get("enabled", True))
    return Pair(pixel=None if math.isnan(pixel[0]) else pixel, point=None if math.isnan(point[0]) else point, **rest)
