# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the block really is about the part of it that stands out: its outline, told by what it hides.

Its shaded side may look like the ground. But while the block moves, what is behind it changes, and where the block is
nothing of this change is seen. At each place beside the tracked centre, the change of the picture from one sighting to
a later one is compared with that of the background: the slope of one on the other is 1 where the ground is seen and 0
where the block hides it. A cast shadow only scales the ground.
"""

from typing import NamedTuple

import numpy as np

from ..least_squares import damped_step
from ..opencv import opencv
from ..vectors import Array
from .plates import Plates
from .templates import clip_window

CELLS = 8
"""Of a patch for one diameter of the block."""
REACH = 14
"""Cells on either side of the centre: 1.75 diameters."""
SIDE = 2 * REACH + 1
LAG = 3.0
"""Travel between the two sightings that are compared, in diameters."""
SLOW = 2.5
"""A block that takes longer for it than from one picture of the background to so many later stands in the background
itself."""
FEWEST, MOST = 12, 160
"""Pairs of sightings from which an outline is told."""
DISAGREE = 0.1
"""Offsets by either half of the pairs differ from that by all by no more than this [diameters], or than that itself."""
EVERY, AROUND = 60, 60
"""Sightings from one local estimate to the next, and on either side of each that it rests on. It counts against the one
of all sightings as its pairs do against this number."""
HALF_HIDDEN = 0.5
"""Shares above count alike, since they are known less well the less the ground varies."""
LIT = 0.12
"""The block sends at least this share of the ground's light, what is hidden by less is a shadow."""
SLIGHT = 0.08
"""Offsets below this share of the diameter are left alone: a block is no disc."""
EDGE_CELLS = 3.0
FAR = 0.15
"""Residuals of the hidden share beyond this count less."""
STEPS = 40


class Patch(NamedTuple):
    """A sighting in cells: the picture and the background, (29, 29, 3) uint8 each."""

    picture: np.ndarray
    behind: np.ndarray


class Outline(NamedTuple):
    """Centre (2,) of the outline from the tracked one, and its diameter, both in tracked diameters."""

    offset: Array
    diameter: float


def patch_of(picture: np.ndarray, frame: int, plates: Plates, centre: Array, diameter: float) -> Patch | None:
    """What is seen around a sighting and what is behind it; None at the border of the picture or of the background."""
    cell = diameter / CELLS
    reach = (REACH + 1) * cell + 1
    left, top, right, bottom = clip_window(picture, centre, reach)
    if (centre - reach < 0).any() or (centre + reach > picture.shape[1::-1]).any():
        return None
    part, (behind, _, seen) = plates.beside(picture, frame, (left, top, right, bottom))
    if not seen.all():
        return None
    cv2 = opencv()
    place = np.array([[cell, 0.0, 0.0], [0.0, cell, 0.0]])
    place[:, 2] = centre - (left, top) - 0.5 - REACH * cell
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    if cell > 2:
        part, behind = (cv2.blur(a, (int(cell),) * 2) for a in (part, behind))
    size = (SIDE, SIDE)
    picture, behind = (cv2.warpAffine(a, place, size, flags=flags) for a in (part, behind))
    return Patch(cv2.convertScaleAbs(picture), cv2.convertScaleAbs(behind))


def outline_offsets(patches: list[Patch | None], stable: Array, diameter: Array, spacing: float) -> tuple[Array, Array]:
    """(m, 2) from the tracked centres to those of the outline [px], and (m,) its diameter over the tracked one.

    Zeros and ones where nothing tells, or where both agree.

    Parameters
    ----------
    patches : (m,) of the sightings.
    stable : (m, 2) their places in the reference frame of the background [px].
    diameter : (m,) by which the patches are scaled [px].
    spacing : of the pictures that the background is made of [frames].
    """
    count = len(patches)
    nothing = np.zeros((count, 2)), np.ones(count)
    first, second = _pairs(patches, stable, diameter, int(min(AROUND, SLOW * spacing)))
    whole = _outline(patches, first, second)
    halves = [_outline(patches, first[part::2], second[part::2]) for part in (0, 1)] if whole is not None else []
    if whole is None or np.hypot(*whole.offset) < SLIGHT:
        return nothing
    most = max(float(np.hypot(*whole.offset)), DISAGREE)
    if any(half is None or np.hypot(*(half.offset - whole.offset)) > most for half in halves):
        return nothing
    where = np.linspace(0, count - 1, 1 + max(round(count / EVERY), 1)).round().astype(np.intp)
    offset, size = np.tile(whole.offset, (where.size, 1)), np.full(where.size, whole.diameter)
    for row, middle in enumerate(where.tolist()):
        near = np.abs(first - middle) <= AROUND
        local = _outline(patches, first[near], second[near])
        if local is not None:
            trust = near.sum() / (near.sum() + AROUND)
            offset[row] += trust * (local.offset - whole.offset)
            size[row] += trust * (local.diameter - whole.diameter)
    rows = np.arange(count)
    moved = np.column_stack([np.interp(rows, where, along) for along in offset.T])
    return moved * diameter[:, None], np.interp(rows, where, size)


def _pairs(patches: list[Patch | None], stable: Array, diameter: Array, longest: int) -> tuple[np.ndarray, np.ndarray]:
    """Sightings, and for each the next one that the block has travelled far enough to reach, in time."""
    travelled = np.r_[0.0, np.cumsum(np.hypot(*np.diff(stable, axis=0).T) / diameter[1:])]
    later = np.searchsorted(travelled, travelled + LAG)
    pairs = [
        (i, j)
        for i, j in enumerate(later.tolist())
        if j < len(patches) and j <= i + longest and patches[i] and patches[j]
    ]
    both = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _outline(patches: list[Patch | None], first: np.ndarray, second: np.ndarray) -> Outline | None:
    """The disc that hides what changes behind it; None where none is found."""
    if first.size < FEWEST:
        return None
    if first.size > MOST:
        chosen = np.linspace(0, first.size - 1, MOST).astype(np.intp)
        first, second = first[chosen], second[chosen]
    rows = np.unique(np.r_[first, second])
    seen, behind = (np.stack([getattr(patches[i], name) for i in rows]).astype(np.float32) for name in Patch._fields)
    a, b = np.searchsorted(rows, first), np.searchsorted(rows, second)
    slope = _slope(seen[b] - seen[a], behind[b] - behind[a])
    u = np.linspace(-REACH, REACH, SIDE).astype(np.float64)
    v = u[:, None]
    free = np.hypot(u, v) > REACH - 2
    hidden = 1 - slope / max(float(np.median(slope[free])), 0.1)
    ground = np.median(behind, axis=0).mean(axis=2)
    own = np.median(seen, axis=0).mean(axis=2) - slope * ground
    shadow = own < LIT * ground * hidden
    return _disc(np.where(shadow, 0.0, np.clip(hidden, 0.0, 1.0)), u, v)


def _slope(change: np.ndarray, behind: np.ndarray) -> Array:
    """(h, w) slope of the change (k, h, w, 3) of the picture on that of the background, wrong ones weighed down."""
    weight = np.ones(change.shape[:3], np.float32)
    slope = np.zeros(change.shape[1:3], np.float32)
    both, own = np.einsum("khwc,khwc->khw", change, behind), np.einsum("khwc,khwc->khw", behind, behind)
    for _ in range(3):
        slope = (weight * both).sum(axis=0) / np.maximum((weight * own).sum(axis=0), 1e-6)
        left = np.sqrt(np.mean((change - slope[..., None] * behind) ** 2, axis=3))
        weight = 1 / np.maximum(1, left / (2.4 * np.maximum(np.median(left, axis=0), 1.0)))
    return slope.astype(np.float64)


def _disc(hidden: Array, u: Array, v: Array) -> Outline | None:
    """The disc with a soft edge that fits best what is hidden."""
    half, whole = _fitted(np.minimum(hidden, HALF_HIDDEN), u, v), _fitted(hidden, u, v)
    outside = np.hypot(half[0], half[1]) > 0.6 * CELLS or not 0.6 * CELLS < whole[2] < 2 * CELLS or half[3] < 0.25
    return None if outside else Outline(half[:2] / CELLS, float(whole[2] / CELLS))


def _fitted(target: Array, u: Array, v: Array) -> Array:
    """(4,) centre, diameter [cells] and height of the disc, by damped least squares; residuals far off count less."""
    values = np.array([0.0, 0.0, float(CELLS), float(target.max())])
    for _ in range(STEPS):
        along, down = u - values[0], v - values[1]
        distance = np.maximum(np.hypot(along, down), 1e-9)
        inside = (0.5 * values[2] - distance) / EDGE_CELLS + 0.5
        shape, edge = np.clip(inside, 0.0, 1.0), values[3] * ((inside > 0) & (inside < 1)) / EDGE_CELLS
        slopes = np.stack([edge * along / distance, edge * down / distance, 0.5 * edge, shape]).reshape(4, -1)
        gap = (target - values[3] * shape).ravel()
        weighted = slopes / np.sqrt(1 + (gap / FAR) ** 2)
        step = damped_step((weighted @ slopes.T)[None], (weighted @ gap)[None], 0.05)[0]  # SciPy takes longer to load
        values = values + np.clip(step, -1.5, 1.5)
        if np.abs(step).max() < 1e-4:
            break
    return values
