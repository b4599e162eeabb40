# SPDX-License-Identifier: GPL-3.0-or-later
"""Standard deviations and intervals of impacts, from what is not known of their velocities, place and normal."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ..vectors import Array, Indices, Mask, dot, norm, perpendicular, unit
from .impact import Apparent, Impacts, apparent
from .uncertainty import ERRORS

SCALARS = ("vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev")
JUDGED = ("rn", "rt", "r", "theta1", "theta_dev")
"""What has an interval."""
COVERAGE = 0.95
DRAWS_LOG2 = 9
"""Draws of an interval: 2 to this power."""
DRAWS_FILE = Path(__file__).resolve().parents[2] / "assets" / "intervals" / "draws.npy"
"""Points of a Sobol sequence in units of 2^-32, by ``scripts/making/interval_draws.py``."""
SIGMA_ROWS = 256
"""Impacts whose deviations are computed at a time: their points stay in the processor's cache."""
ROWS = 64
"""Impacts that are drawn at a time: their draws stay in the processor's cache."""
NO_VARIANCE = 1e-13
"""A variance that is a smaller part of the greatest one is none, but the error of its computation."""
MOST_DIGITS = 3
EVERYTHING = {
    "rn": (0.1, 2.0),
    "rt": (0.2, 1.5),
    "r": (0.2, 1.5),
    "theta1": tuple(np.radians([5.0, 85.0])),
    "theta_dev": tuple(np.radians([15.0, 165.0])),
}
"""An interval over this leaves nothing out that a rebound can have."""


@dataclass(frozen=True, eq=False)
class ImpactErrors:
    """What is not known of n impacts.

    Attributes
    ----------
    covariance : (n, 9, 9) of v1, v2 [m/s] and the place [m]; rows of a velocity that is not known are NaN.
    by_place : (n, 3, 3) change of the block-scale normal with the place [1/m].
    tilt : (n,) root mean square angle by which that normal is off, wherever it is [rad]; NaN counts as none.
    """

    covariance: Array
    by_place: Array
    tilt: Array

    def known(self) -> tuple[Mask, Mask]:
        """(n,) something is known of the error of v1, of v2."""
        return np.isfinite(self.covariance[:, 0, 0]), np.isfinite(self.covariance[:, 3, 3])

    def roots(self) -> Array:
        """(n, 9, 9) symmetric square roots of the covariance, whose columns are pairs of points and draws.

        Notes
        -----
        Of all roots the one that is a continuous function of the covariance (Higham 2008, Functions of Matrices, 1.7).
        Principal axes are not: their signs, and the axes themselves where two deviations are equal, are chosen by the
        last bit of a library, and with them the points and the draws.
        """
        size, axes = np.linalg.eigh(np.nan_to_num(self.covariance))
        size = np.where(size > NO_VARIANCE * size[:, -1:], size, 0.0)
        return (axes * np.sqrt(size)[:, None, :]) @ np.swapaxes(axes, 1, 2)


def impact_sigmas(
    values: Apparent | Impacts, v1: Array, v2: Array, normal: Array, mass: Array, errors: ImpactErrors
) -> dict[str, Array]:
    """Standard deviations of n impacts' velocities, coefficients, angles and energies.

    Parameters
    ----------
    values : eq. 7–10; NaN has no deviation.
    v1, v2, normal : (n, 3).
    mass : (n,) [kg].

    Returns
    -------
    "v1", "v2" (n, 3); `SCALARS`, "kinetic1_j", "kinetic2_j" (n,); NaN where undefined or not known.

    Notes
    -----
    The root mean square deviation from the value over pairs of points √3 times to either side along each column of the
    root of the errors, with a weight of 1/6 each (Julier & Uhlmann 2004): first-order propagation where a column is
    linear, but true for R_N at grazing impacts too, where a small tilt of the normal changes it by half. The normal is
    that of the block's scale, without the roughness below it; it goes with the place, and is tilted by tilt/√2 about
    each of two axes at right angles to it, independent of everything else.
    """
    here = _scalars(v1, v2, normal, mass)
    roots, squares = errors.roots(), np.empty_like(here)
    for start in range(0, len(v1), SIGMA_ROWS):
        some = slice(start, start + SIGMA_ROWS)
        columns = _beside(v1[some], v2[some], normal[some], mass[some], roots[some], errors, some)
        squares[some] = np.sum(np.nan_to_num(columns - here[some, None]) ** 2, axis=1) / 6
    known1, known2 = errors.known()
    result = {}
    for i, name in enumerate((*SCALARS, "kinetic1_j", "kinetic2_j")):
        uses1, uses2 = not name.endswith("2") and "2_" not in name, not name.endswith("1") and "1_" not in name
        known = (known1 | (not uses1)) & (known2 | (not uses2)) & np.isfinite(here[:, i])
        if name in SCALARS:
            known &= np.isfinite(getattr(values, name))
        result[name] = np.where(known, np.sqrt(squares[:, i]), np.nan)
    diagonal = np.sqrt(np.maximum(np.einsum("nii->ni", errors.covariance), 0.0))
    for name, part, velocity in (("v1", slice(0, 3), v1), ("v2", slice(3, 6), v2)):
        result[name] = np.where(np.isfinite(velocity), diagonal[:, part], np.nan)
    return result


def _scalars(v1: Array, v2: Array, normal: Array, mass: Array) -> Array:
    """(n, 11) the scalar columns."""
    found = apparent(v1, v2, normal)
    energies = [0.5 * mass * dot(v, v) for v in (v1, v2)]
    return np.stack([getattr(found, name) for name in SCALARS] + energies, axis=1)


def _beside(v1: Array, v2: Array, normal: Array, mass: Array, roots: Array, errors: ImpactErrors, rows: slice) -> Array:
    """(k, 22, 11) the scalar columns at the pairs of points, of some rows."""
    axes = np.sqrt(3.0) * np.swapaxes(roots, 1, 2)
    away = np.concatenate([axes, -axes], axis=1)  # (k, 18, 9)
    slant = np.sqrt(1.5) * np.nan_to_num(errors.tilt[rows])[:, None, None] * np.stack(perpendicular(normal), axis=1)
    leaning = np.concatenate([away[:, :, 6:] @ np.swapaxes(errors.by_place[rows], 1, 2), slant, -slant], axis=1)
    away = np.pad(away, ((0, 0), (0, 4), (0, 0)))
    into, out, ground = v1[:, None] + away[:, :, :3], v2[:, None] + away[:, :, 3:6], unit(normal[:, None] + leaning)
    count = leaning.shape[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        flat = _scalars(into.reshape(-1, 3), out.reshape(-1, 3), ground.reshape(-1, 3), np.repeat(mass, count))
    return flat.reshape(len(v1), count, -1)


def impact_intervals(
    values: Apparent | Impacts, v1: Array, v2: Array, normal: Array, errors: ImpactErrors
) -> dict[str, Array]:
    """Intervals that hold R_N, R_T, R, θ1 and θ_dev of n impacts with a probability of 95 %, by drawing.

    Parameters
    ----------
    As of `impact_sigmas`.

    Returns
    -------
    `JUDGED` → (n, 2) lower and upper end; NaN where undefined or not known. The upper end is infinite where the block
    may have passed along the ground, since R_N has no limit there.

    Notes
    -----
    Always the same draws, evenly spread over the errors (Sobol's points), so that the same impact has the same
    interval in every table. All errors are normal; coefficients and angles are not.
    """
    n = len(v1)
    result = {name: np.full((n, 2), np.nan) for name in JUDGED}
    known1, known2 = errors.known()
    both = known1 & known2 & np.isfinite(values.r)
    only1 = known1 & ~both & np.isfinite(values.theta1)
    rows = np.flatnonzero(both | only1)
    roots = errors.roots()[rows]
    for start in range(0, rows.size, ROWS):
        some = rows[start : start + ROWS]
        drawn = _drawn(v1[some], v2[some], normal[some], roots[start : start + ROWS], errors, some)
        ends = _ends(drawn)
        for i, name in enumerate(JUDGED):
            value = getattr(values, name)[some]
            defined = np.isfinite(value) & (both[some] | (name == "theta1"))
            low, high = np.minimum(ends[:, i, 0], value), np.maximum(ends[:, i, 1], value)
            result[name][some] = np.where(defined[:, None], np.stack([low, high], axis=1), np.nan)
    return result


@cache
def _draws() -> Array:
    """(m, 11) standard normal draws: of velocities and place, and of the normal's tilt."""
    from scipy.special import ndtri

    return np.asarray(ndtri(np.load(DRAWS_FILE) / 2.0**32))


def _drawn(v1: Array, v2: Array, normal: Array, roots: Array, errors: ImpactErrors, rows: Indices) -> Array:
    """(k, 5, m) draws of `JUDGED`; a block that passes along the ground has an infinite R_N."""
    draws = _draws()
    away = np.swapaxes(roots @ draws[:, :ERRORS].T, 1, 2)  # (k, m, 9)
    into, out = v1[:, None, :] + away[:, :, :3], v2[:, None, :] + away[:, :, 3:6]
    off = away[:, :, 6:] @ np.swapaxes(errors.by_place[rows], 1, 2)
    axes = np.stack(perpendicular(normal), axis=1)  # (k, 2, 3)
    tilt = np.nan_to_num(errors.tilt[rows])[:, None, None] / np.sqrt(2) * (draws[:, ERRORS:] @ axes)
    ground = unit(normal[:, None, :] + off + tilt)
    side = np.where(dot(v2, normal) < 0, -1.0, 1.0)[:, None]
    speed1, speed2, along = norm(into), norm(out), dot(into, out)
    approach, escape = -dot(into, ground), side * dot(out, ground)
    along1, along2 = (np.sqrt(np.maximum(s**2 - n**2, 0.0)) for s, n in ((speed1, approach), (speed2, escape)))
    with np.errstate(invalid="ignore", divide="ignore"):
        columns = {
            "rn": np.where(approach > 0, np.maximum(escape, 0.0) / approach, np.inf),
            "rt": along2 / along1,
            "r": speed2 / speed1,
            "theta1": np.arctan2(np.maximum(approach, 0.0), along1),
            "theta_dev": np.arccos(np.clip(along / (speed1 * speed2), -1.0, 1.0)),
        }
    return np.stack([columns[name] for name in JUDGED], axis=1)


def _ends(drawn: Array) -> Array:
    """(k, c, 2) ends of the middle `COVERAGE` of draws (k, c, m)."""
    m = drawn.shape[-1]
    low = int((1 - COVERAGE) / 2 * m)
    return np.partition(drawn, (low, m - 1 - low), axis=-1)[..., [low, m - 1 - low]]


def undetermined(name: str, interval: Array) -> Mask:
    """(n,) intervals (n, 2) of one of `JUDGED` that leave nothing out."""
    low, high = EVERYTHING[name]
    return (interval[:, 0] <= low) & (interval[:, 1] >= high)


def in_words(name: str, value: float, low: float, high: float, digits: int) -> str:
    """A number with its interval, "undetermined" alone where that leaves nothing out; empty where it is not defined.

    Parameters
    ----------
    name : of `JUDGED`; angles are in radians, and in degrees in the text.
    digits : after the point, more where the interval is that narrow.
    """
    if not np.isfinite(value):
        return ""
    scale, unit = (180 / np.pi, "°") if name.startswith("theta") else (1.0, "")
    if not np.isfinite(low):
        return f"{scale * value:.{digits}f}{unit}"
    if undetermined(name, np.array([[low, high]]))[0]:
        return "undetermined"
    while scale * (high - low) < 2 * 10.0**-digits and digits < MOST_DIGITS:
        digits += 1
    least = f"{scale * low:.{digits}f}"
    ends = f"from {least}" if np.isinf(high) else f"{least} to {scale * high:.{digits}f}"
    return f"{scale * value:.{digits}f}{unit} ({ends})"
