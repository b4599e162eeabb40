# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user should know about a camera that was found from pairs, in plain words."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...remarks import Remark
from ...vectors import Array, norm
from ..model import Camera

POOR_FOCAL = 0.02
POOR_POSITION = 0.02
"""Shares of the focal length and of the distance above which a standard deviation is worth a word."""

NARROW_DEG = 10.0
FLAT = 0.03
SMALL_COVER = 0.1
POOR_SCATTER = 2.0
DEPENDENT = 0.98
FEW = 4
"""With no more observations to spare a wrong pair can hardly be told."""
RELIES = 2.5
"""So many times worse is the position known without one pair when the camera rests on it."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """A solution and the m pairs that it rests on.

    Attributes
    ----------
    pixels, points, depth : (m, 2) [px], (m, 3) local [m], (m,) along the camera's axis [m].
    parameters, covariance : as in `Resection`.
    scatter, redundancy, rmse_px : as in `Resection`.
    other : a different camera that fits nearly as well, or None.
    wrong : names and residuals [px] of the pairs that were left out, and by how much the camera's position moves with
        them [m], NaN where they have no pixel.
    asked : names of pairs that are used and should be looked at again, their residuals, and what these are without the
        pair [px], and by how much the camera's position moves without it [m].
    relied_on : name of the pair without which the position is known worst, its standard deviation then, and with the
        pair [m], as far as the clicks go.
    """

    camera: Camera
    pixels: Array
    points: Array
    depth: Array
    parameters: tuple[str, ...]
    covariance: Array
    scatter: float
    redundancy: int
    rmse_px: float
    other: Camera | None
    wrong: tuple[tuple[str, float, float], ...]
    asked: tuple[tuple[str, float, float, float], ...]
    relied_on: tuple[str, float, float]

    def sigma(self, name: str) -> float:
        i = self.parameters.index(name)
        return float(np.sqrt(self.covariance[i, i]))

    @property
    def sigma_position_m(self) -> float:
        """Of the position, in the direction in which it is known worst [m]."""
        with np.errstate(invalid="ignore"):
            values = np.linalg.eigvalsh(np.nan_to_num(self.covariance[3:6, 3:6], posinf=1e12, neginf=-1e12))
        return float(np.sqrt(max(values[-1], 0.0)))


def remarks_on(found: Geometry) -> tuple[Remark, ...]:
    """The gravest first; none when all is well."""
    return (
        *_on_wrong_pairs(found),
        *_on_pairs_to_look_at(found),
        *_on_a_rival(found),
        *_on_focal_length(found),
        *_on_position(found),
        *_on_the_pair_relied_on(found),
        *_on_lens(found),
        *_on_fit(found),
        *_on_redundancy(found),
        *_on_cover(found),
    )


def _on_wrong_pairs(found: Geometry) -> Iterator[Remark]:
    for name, residual, shift in found.wrong:
        moved = f"; with it the camera would stand {shift:.2g} m from here" if shift > found.sigma_position_m else ""
        off = f"({_pixels(residual)} off) and was left out{moved}. Check its pixel and its point."
        yield Remark(f"Pair {name} does not fit the others {off}", "warning", about_pair(name))


def _on_pairs_to_look_at(found: Geometry) -> Iterator[Remark]:
    for name, residual, alone, moved in found.asked:
        if moved > found.sigma_position_m / 2 or not np.isfinite(moved):
            where = f"which would stand {moved:.2g} m away without it" if np.isfinite(moved) else "and on it alone"
            text = f"Look at pair {name} again: the camera hangs on it, {where}."
        else:
            text = f"Look at pair {name} again: it may be wrong."
        text += f" It is used, and {_pixels(residual)} off; the others alone put it {_pixels(alone)} off."
        yield Remark(f"{text} If it is right, a pair near it will confirm it.", "warning", about_pair(name))


def about_pair(name: str) -> str:
    """What a remark about a pair is about."""
    return f"pair {name}"


def _pixels(residual: float) -> str:
    return f"{residual:.3g} px" if np.isfinite(residual) else "not in view"


def _on_a_rival(found: Geometry) -> Iterator[Remark]:
    if found.other is None:
        return
    away = norm(found.other.position - found.camera.position)
    text = (
        f"A second camera, {away:.3g} m from this one, fits the pairs nearly as well. "
        "Add pairs at other distances, or give a rough position to start from."
    )
    yield Remark(text, "warning", "position")


def _on_focal_length(found: Geometry) -> Iterator[Remark]:
    free = [name for name in ("f", "fx", "fy") if name in found.parameters]
    if not free:
        return
    share = max(found.sigma(name) for name in free) / found.camera.fx
    if share <= POOR_FOCAL:
        tied = abs(_focal_and_distance(found, free[0]))
        if tied <= DEPENDENT or share <= POOR_FOCAL / 4:
            return
        text = (
            f"The focal length (± {_percent(share)}) and the distance depend on each other (correlation {tied:.3f}): "
            f"{_reason(found)}. Lock the focal length if you know it, or add pairs nearer or farther."
        )
    else:
        known = f"to {_percent(share)} only" if share < 1 else "not at all"
        text = f"The focal length is known {known}: {_reason(found)}. Lock it, or add pairs nearer or farther."
    yield Remark(text, "advice", "focal")


def _focal_and_distance(found: Geometry, name: str) -> float:
    """Correlation of the focal length with the position along the camera's axis."""
    axis = np.zeros(len(found.parameters))
    axis[3:6] = found.camera.rotation[2]
    i = found.parameters.index(name)
    with np.errstate(invalid="ignore"):
        return float((found.covariance @ axis)[i] / np.sqrt(found.covariance[i, i] * (axis @ found.covariance @ axis)))


def _reason(found: Geometry) -> str:
    """Why the pairs cannot tell the focal length from the distance."""
    centred = found.points - found.points.mean(axis=0)
    _, extent, axes = np.linalg.svd(centred)
    if len(centred) > 3 and extent[2] < FLAT * extent[0]:
        facing = abs(float(axes[2] @ found.camera.rotation[2])) > np.cos(np.radians(30))
        return "the pairs lie nearly in a plane facing the camera" if facing else "the pairs lie nearly in a plane"
    if np.ptp(found.depth) < 0.15 * found.depth.mean():
        return "the pairs are all at nearly the same distance"
    if _field_deg(found) < NARROW_DEG:
        return f"the pairs span only {_field_deg(found):.2g}° of view"
    return "the pairs are few, or close together"


def _field_deg(found: Geometry) -> float:
    """The angle that the pairs span, roughly."""
    span = np.ptp(found.pixels, axis=0) / [found.camera.fx, found.camera.fy]
    return float(np.degrees(2 * np.arctan(np.hypot(*span) / 2)))


def _on_position(found: Geometry) -> Iterator[Remark]:
    distance = float(norm(found.points - found.camera.position).mean())
    worst = found.sigma_position_m
    if worst <= POOR_POSITION * distance:
        return
    text = (
        f"The camera's position is known to {worst:.2g} m only, at {distance:.3g} m from the pairs. "
        "Add pairs that are farther apart, in the image and in depth."
    )
    yield Remark(text, "advice", "position")


def _on_the_pair_relied_on(found: Geometry) -> Iterator[Remark]:
    name, alone, together = found.relied_on
    asked = name in {one for one, *_ in found.asked}
    if asked or found.redundancy <= FEW or not alone > RELIES * together:
        return
    known = f"to {alone:.2g} m" if np.isfinite(alone) else "not at all"
    text = (
        f"The camera rests on pair {name}: without it the position is known {known}, with it to "
        f"{together:.2g} m, and the others hardly check it. Add one near it."
    )
    yield Remark(text, "advice", about_pair(name))


def _on_lens(found: Geometry) -> Iterator[Remark]:
    camera = found.camera
    for name, size in (("cx", camera.width), ("cy", camera.height)):
        if name in found.parameters and found.sigma(name) > 0.03 * size:
            text = (
                f"The image's centre {name} is known to {_px(found.sigma(name))} px only. "
                "Lock it to the middle of the image, or add pairs towards all edges."
            )
            yield Remark(text, "advice", name)
    corner = np.hypot(*camera.size) / 2
    reach = float(norm(found.pixels - [camera.cx, camera.cy]).max() / corner)
    radius = corner / camera.fx
    for name, power in (("k1", 3), ("k2", 5), ("k3", 7), ("p1", 2), ("p2", 2)):
        if name not in found.parameters:
            continue
        bend = found.sigma(name) * radius**power * camera.fx
        if bend > 0.005 * corner * 2:
            text = (
                f"The distortion {name} is known to {_px(bend)} px at the image's corner only; the pairs reach "
                f"{_percent(reach)} of the way there. Lock it, or add pairs near the corners."
            )
            yield Remark(text, "advice", name)


def _on_fit(found: Geometry) -> Iterator[Remark]:
    if not found.scatter > POOR_SCATTER:
        return
    text = (
        f"The pairs fit to {found.rmse_px:.2g} px, {found.scatter:.2g} times worse than their stated errors; the "
        "errors of the camera were enlarged accordingly. Check the pairs, or free the lens's distortion."
    )
    yield Remark(text, "advice", "fit")


def _on_redundancy(found: Geometry) -> Iterator[Remark]:
    n = len(found.pixels)
    if found.redundancy > FEW:
        return
    if found.redundancy > 2:
        yield Remark(f"With {n} pairs a wrong one can hardly be told. Add two or more.", "advice", "pairs")
    else:
        yield Remark(f"With {n} pairs nothing tells a wrong one. Add three or more.", "advice", "pairs")


def _on_cover(found: Geometry) -> Iterator[Remark]:
    from scipy.spatial import ConvexHull

    cover = ConvexHull(found.pixels).volume / (found.camera.width * found.camera.height)
    if cover >= SMALL_COVER:
        return
    text = (
        f"The pairs cover only {_percent(cover)} of the image; away from them the camera is an extrapolation. "
        "Spread the pairs."
    )
    yield Remark(text, "advice", "pairs")


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 0.995 else f"{100 * share:.0f} %"


def _px(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"
