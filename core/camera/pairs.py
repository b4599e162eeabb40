# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of a pixel and the point that is seen there, and how far a camera's path is from them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array, Indices, Mask, Names, distance_to_ray
from .path import CameraPath, project_at, rays_at


@dataclass(frozen=True, eq=False)
class Pairs:
    """n pixels and the points of the terrain that are seen there.

    Attributes
    ----------
    pixel : (n, 2) [px].
    point : (n, 3) local [m].
    name : (n,) for people; the number of the row where none is given.
    frame : (n,) of the video, −1 where not given.
    sigma_px, sigma_m : (n,) standard deviations of a coordinate; NaN where not given.
    used : (n,) False for pairs that are only to be checked.
    shift : of the local frame.
    row, source : (n,) rows in a text editor and the file, where they come from one.
    """

    pixel: Array
    point: Array
    name: Names
    frame: Indices
    sigma_px: Array
    sigma_m: Array
    used: Mask
    shift: GlobalShift
    row: Indices | None = None
    source: Path | None = None

    def __len__(self) -> int:
        return len(self.pixel)

    def some(self, rows: Indices | Mask) -> "Pairs":
        """Some of them."""
        return replace(
            self,
            pixel=self.pixel[rows],
            point=self.point[rows],
            name=self.name[rows],
            frame=self.frame[rows],
            sigma_px=self.sigma_px[rows],
            sigma_m=self.sigma_m[rows],
            used=self.used[rows],
            row=None if self.row is None else self.row[rows],
        )

    def error(self, index: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one pair."""
        row = None if self.row is None else int(self.row[index])
        return InputError(problem, file=self.source, row=row, advice=advice)


def pair_residuals(path: CameraPath, pairs: Pairs, time_s: ArrayLike) -> tuple[Array, Array]:
    """What is left of all pairs, used or not: (n, 2) marked minus projected [px], and (n,) from point to ray [m].

    time_s : (n,) video times of the pairs' frames [s].
    """
    time = np.asarray(time_s, dtype=np.float64)
    left = pairs.pixel - project_at(path, pairs.point, time)
    return left, distance_to_ray(pairs.point, *rays_at(path, pairs.pixel, time))
