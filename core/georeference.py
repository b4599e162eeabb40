# SPDX-License-Identifier: GPL-3.0-or-later
"""Survey coordinates and the local frame in which everything is computed and drawn.

Blender and graphics cards are single precision: at 2 600 000 m a coordinate moves in steps of 0.25 m. So a
project has one `GlobalShift`, chosen in double precision before anything becomes single precision.
"""

import re
from dataclasses import dataclass

import numpy as np

from .errors import RockfallError
from .remarks import Remark
from .vectors import Array

LARGE_COORDINATE_M = 10_000.0
"""Beyond this, single precision no longer resolves a millimetre, and a shift is proposed."""
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From coordinates in which y points up to those in which z does; x stays."""

SAME_AS = {900913: 3857, 102100: 3857, 102113: 3857}
"""Codes that are none of EPSG's → the one of the same system: web maps, before EPSG had a code for them."""
CODES = range(1024, 32767)
"""What EPSG gives to systems, and GeoTIFF (OGC 19-008r4, 7.4) has room for; above it are those of users."""


def stated_code(crs: str) -> int | None:
    """2056 of "EPSG:2056", whether or not there is such a code; None for a system without a code, or nothing."""
    found = re.fullmatch(r"\s*EPSG\s*:+\s*(\d{1,9})\s*", crs, re.IGNORECASE)
    return int(found[1]) if found else None


def epsg_code(crs: str) -> int | None:
    """The code of a system as files can have it: 2056 of "EPSG:2056", 3857 of "EPSG:900913"; else None."""
    code = stated_code(crs)
    code = SAME_AS.get(code, code) if code is not None else None
    return code if code in CODES else None


def code_remarks(crs: str) -> list[Remark]:
    """What becomes of a code that is none of EPSG's in the files that are written."""
    stated, code = stated_code(crs), epsg_code(crs)
    if stated == code:
        return []
    if code is not None:
        text = f"EPSG has no code {stated}; files are written with {code}, which is the same system."
        return [Remark(text, "note", "crs")]
    text = (
        f"EPSG has no code {stated}: maps and GeoPackages name {crs.strip()} in words alone, and a GIS has to be told "
        "where they lie."
    )
    return [Remark(text, "warning", "crs")]


def z_up(vectors: Array) -> Array:
    """Vectors (..., 3) with y up in coordinates with z up."""
    turned = np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)
    return np.ascontiguousarray(turned)


@dataclass(frozen=True)
class GlobalShift:
    """What is subtracted from survey coordinates to get local ones.

    Attributes
    ----------
    x, y, z : the survey coordinates of the local origin [m].
    crs : coordinate reference system as the source states it ("EPSG:2056"), empty when unknown.
    vertical : the system of the heights, likewise ("EPSG:5728").

    Raises
    ------
    RockfallError : it is not finite: nothing could be brought back from it.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    crs: str = ""
    vertical: str = ""

    def __post_init__(self) -> None:
        if not np.isfinite(self.vector).all():
            said = f"The global shift ({self.x}, {self.y}, {self.z}) m is not finite."
            raise RockfallError(f"{said} Write metres, like 2600000.0.")

    @property
    def vector(self) -> Array:
        """(3,) [m]."""
        return np.array([self.x, self.y, self.z])

    def to_local(self, survey: Array) -> Array:
        """Survey → local coordinates, (..., 3) [m]."""
        return np.asarray(survey, dtype=np.float64) - self.vector

    def to_survey(self, local: Array) -> Array:
        """Local → survey coordinates, (..., 3) [m]."""
        return np.asarray(local, dtype=np.float64) + self.vector

    @classmethod
    def proposed(cls, minimum: Array, maximum: Array, crs: str = "") -> "GlobalShift":
        """The shift proposed for data within a box: none for small coordinates, else the box's centre rounded to 100 m.

        Raises
        ------
        RockfallError : the box is not finite.
        """
        low, high = np.asarray(minimum, dtype=np.float64), np.asarray(maximum, dtype=np.float64)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise RockfallError("No global shift can be proposed: the coordinates are not finite.")
        far = np.maximum(np.abs(low), np.abs(high)) > LARGE_COORDINATE_M
        x, y, z = np.where(far, np.round((low + high) / 2, -2), 0.0).tolist()
        return cls(x, y, z, crs)
