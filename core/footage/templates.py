# SPDX-License-Identifier: GPL-3.0-or-later
"""The block in one picture: how much of each pixel it covers, and the disc or streak that explains this best.

A pixel of which the block covers the share α shows (1 − α) · background + α · block. With the background known and the
block's colours learnt, α follows by least squares (matting with a known background, Smith & Blinn 1996), whether the
block is lighter or darker than what is behind it. Its shape is a disc, swept along its motion while the shutter is
open.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..opencv import opencv
from ..vectors import Array
from .plates import Plates, over_channels

SHAPE_ERROR = 0.15
"""Of the covered share: real blocks have facets and are not discs."""
OTHER_COLOUR = 0.4
"""Squared distance from the mixture of the two colours, in their squared contrast, that halves the share."""
MARGIN = 0.4
"""Width of the ring around the block that must be free, in diameters."""
COLOURS = 4
STEPS = 8


@dataclass(frozen=True, eq=False)
class Appearance:
    """What is known of the block's looks.

    Attributes
    ----------
    colours : (k, 3) BGR, from its dark to its bright side.
    diameter_px : [px].
    shutter : share of the time between frames during which the shutter is open.
    """

    colours: Array
    diameter_px: float
    shutter: float = 0.0


@dataclass(frozen=True, eq=False)
class Cover:
    """Shares covered by the block in a window of a frame.

    Attributes
    ----------
    left, top : of the window [px].
    alpha : (h, w) share, noisy where the contrast is low.
    weight : (h, w) 1 / variance; zero where nothing is known.
    noise : (h, w) the part of the variance that is noise.
    """

    left: int
    top: int
    alpha: Array
    weight: Array
    noise: Array


@dataclass(frozen=True, eq=False)
class Sighting:
    """The block in one frame.

    Attributes
    ----------
    pixel : (2,) centre [px].
    sigma_px : of each coordinate, as far as the fit knows.
    diameter_px : fitted.
    score : likeness, 1 for a perfect disc of the block's colour on a free background.
    amplitude : share of the block's contrast that is found.
    visible : share of the disc that lies in the picture, where the background is known.
    contrast : contrast with the background in standard deviations of a pixel, where the block should be.
    """

    pixel: Array
    sigma_px: float
    diameter_px: float
    score: float
    amplitude: float
    visible: float
    contrast: float


def cover(picture: np.ndarray, frame: int, plates: Plates, looks: Appearance, centre: Array, reach: float) -> Cover:
    """Shares covered in the window of ± `reach` around a centre."""
    left, top, right, bottom = clip_window(picture, centre, reach)
    if right <= left or bottom <= top:
        empty = np.zeros((0, 0))
        return Cover(left, top, empty, empty, empty)
    part, (behind, sigma, seen) = plates.beside(picture, frame, (left, top, right, bottom))
    change = part - behind
    known = change.reshape(-1, 3) if seen.all() else change[seen > 0]
    if len(known):
        change -= np.median(np.ascontiguousarray(known.T), axis=1)  # in the order in which it is quick
    alpha, noise, other = _shares(change, behind, sigma, looks.colours)
    alpha = alpha / (1 + other / OTHER_COLOUR)
    weight = seen / (noise + SHAPE_ERROR**2)
    return Cover(left, top, alpha.astype(np.float64), weight.astype(np.float64), noise.astype(np.float64))


def _shares(
    change: np.ndarray, behind: np.ndarray, sigma: np.ndarray, colours: Array
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each pixel: share covered by the colour that explains it best, its variance by noise, what is left over."""
    variance = sigma**2
    total = over_channels(change, change) / variance

    def explained(colour: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        contrast = colour - behind
        power = np.maximum(over_channels(contrast, contrast) / variance, 1e-3)
        along = over_channels(change, contrast) / variance
        share = np.clip(along / power, -0.5, 1.25)
        return share, 1 / power, np.maximum(total - 2 * share * along + share**2 * power - 2, 0)

    share, noise, left = explained(colours[0].astype(np.float32))
    for colour in colours[1:].astype(np.float32):
        other = explained(colour)
        better = other[2] < left
        share, noise, left = (np.where(better, a, b) for a, b in zip(other, (share, noise, left), strict=True))
    return share, noise, left * noise


def palette(picture: np.ndarray, strength: np.ndarray, centre: Array, radius: float) -> Array | None:
    """(k, 3) colours of what stands out in a disc, from dark to bright; None when next to nothing does.

    Parameters
    ----------
    picture, strength : (h, w, 3) and (h, w) of a window, the change in standard deviations.
    centre, radius : in the window [px].
    """
    rows, columns = np.indices(strength.shape) + 0.5
    inside = (np.hypot(columns - centre[0], rows - centre[1]) <= max(radius, 1.0)) & (strength > 2)
    chosen = picture[inside].astype(np.float64)
    if len(chosen) < 4:
        return None
    axis = np.linalg.eigh(np.cov(chosen.T) + 1e-6 * np.ones((3, 3)))[1][:, -1]
    order = np.argsort(chosen @ (axis if axis.sum() > 0 else -axis), kind="stable")
    parts = np.array_split(chosen[order], COLOURS)
    return np.array([part.mean(axis=0) for part in parts])


def clip_window(picture: np.ndarray, centre: Array, reach: float) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the window ± `reach` around a centre, inside the picture."""
    height, width = picture.shape[:2]
    left, top = (max(int(np.floor(c - reach)), 0) for c in centre)
    right, bottom = (min(int(np.ceil(c + reach)), size) for c, size in zip(centre, (width, height), strict=True))
    return left, top, right, bottom


def disc(u: Array, v: Array, centre: Array, diameter: float, streak: Array) -> Array:
    """(h, w) share of the pixels (u, v), (w,) and (h, 1), that is covered by a disc swept along `streak` (2,) [px]."""
    return _discs(u, v, centre[None], np.array([diameter]), streak)[0]


def _discs(u: Array, v: Array, centres: Array, diameters: Array, streak: Array) -> Array:
    """(k, h, w) of k discs that differ little; the first tells in how many steps all are swept."""
    length = float(np.hypot(*streak))
    count = 1 + int(np.ceil(length / max(1.0, 0.25 * float(diameters[0]))))
    swept = centres[:, None] + ((np.arange(count) + 0.5) / count - 0.5)[:, None] * streak
    along, down = u - swept[..., :1], v.ravel() - swept[..., 1:]
    distance = np.sqrt(np.square(down)[..., :, None] + np.square(along)[..., None, :])
    radius, soft = 0.5 * diameters, np.maximum(1.6, 0.15 * diameters)
    share: Array = (radius[:, None, None, None] - distance) / soft[:, None, None, None] + 0.5
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    return share[:, 0] if count == 1 else share.mean(axis=1)


def search(here: Cover, looks: Appearance, streak: Array, most: int = 8) -> tuple[Array, Array]:
    """Places that look like the block, best first: (n, 2) centres [px] and (n,) scores, n ≤ `most`.

    Centres up to half a diameter outside the window are found as well.
    """
    cv2 = opencv()
    if here.alpha.size == 0:
        return np.zeros((0, 2)), np.zeros(0)
    diameter = looks.diameter_px
    half = np.ceil(diameter * (0.5 + MARGIN) + np.abs(streak) / 2).astype(int)
    u, v = np.arange(-half[0], half[0] + 1.0), np.arange(-half[1], half[1] + 1.0)[:, None]
    shape = disc(u, v, np.zeros(2), diameter, streak)
    near = (disc(u, v, np.zeros(2), diameter * (1 + 2 * MARGIN), streak) > 0.02).astype(np.float64)
    pad = int(np.ceil(diameter / 2))
    alpha, weight, noise = (
        cv2.copyMakeBorder(a, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=0.0)
        for a in (here.alpha * here.weight, here.weight, here.weight * (here.alpha**2 - here.noise))
    )

    def summed(what: Array, kernel: Array) -> Array:
        result: Array = cv2.filter2D(what, cv2.CV_64F, kernel, borderType=cv2.BORDER_CONSTANT)
        return result

    model = summed(weight, shape**2)
    score = 2 * summed(alpha, shape) / (np.maximum(summed(noise, near), 0) + model + 1e-9)
    score[model < 0.2 * np.sum(shape**2)] = 0  # less than a contrast of half a standard deviation
    grown = cv2.dilate(score, np.ones((2 * int(diameter // 3) + 1,) * 2))
    rows, columns = np.nonzero((score >= grown) & (score > 0.3))
    order = np.argsort(-score[rows, columns], kind="stable")[:most]
    place = np.column_stack([columns[order], rows[order]]).astype(np.float64)
    return place + np.array([here.left, here.top]) - pad + 0.5, score[rows[order], columns[order]]


def fit(here: Cover, looks: Appearance, centre: Array, streak: Array) -> Sighting | None:
    """The disc or streak that explains the shares best, by least squares from a first guess; None without a trace.

    The size is held near what is known of it. Residuals beyond a quarter of the block's contrast count less (Huber).
    """
    diameter = looks.diameter_px
    margin = diameter * (0.5 + 0.5 * MARGIN) + np.abs(streak) / 2
    height, width = here.alpha.shape
    low = np.maximum(np.floor(centre - margin).astype(int) - (here.left, here.top), 0)
    high = np.minimum(np.ceil(centre + margin).astype(int) - (here.left, here.top), (width, height))
    if (high - low < 2).any():
        return None
    part = (slice(low[1], high[1]), slice(low[0], high[0]))
    u = np.arange(low[0], high[0]) + here.left + 0.5
    v = (np.arange(low[1], high[1]) + here.top + 0.5)[:, None]
    alpha, weight, noise = here.alpha[part], here.weight[part], here.noise[part]

    values = np.array([*centre, 0.0, 1.0])
    step = np.array([0.05, 0.05, 0.02])
    beside = np.vstack([np.zeros(3), np.diag(step)])
    prior = np.array([0.0, 0.0, 1 / 0.06**2, 1 / 0.5**2])
    far = np.array([0.35 * diameter + 1, 0.35 * diameter + 1, 0.3, 0.6])
    normal, factor = np.eye(4), 1.0
    for _ in range(STEPS):
        near = values[:3] + beside
        shapes = _discs(u, v, near[:, :2], diameter * np.exp(near[:, 2]), streak)
        now = values[3] * shapes[0]
        slope = np.concatenate([values[3] * (shapes[1:] - shapes[0]) / step[:, None, None], shapes[:1]]).reshape(4, -1)
        residual = (alpha - now).ravel()
        robust = weight.ravel() / np.maximum(1, np.abs(residual) / np.sqrt(noise.ravel() + 0.25**2))
        normal = (slope * robust) @ slope.T + np.diag(prior)
        moved = np.linalg.solve(
            normal + 1e-9 * np.eye(4), (slope * robust) @ residual - prior * (values - (*centre, 0, 1))
        )
        values = values + np.clip(moved, -far / 2, far / 2)
        if (np.abs(values - (*centre, 0.0, 1.0)) > far).any():
            return None
        factor = float(np.sum(robust * residual**2) / max(np.count_nonzero(robust > 0), 1))
        if np.hypot(*moved[:2]) < 0.003:
            break
    shape = disc(u, v, values[:2], diameter * float(np.exp(values[2])), streak)
    found = 2 * np.sum(weight * alpha * shape)
    energy = max(np.sum(weight * (alpha**2 - noise)), 0) + np.sum(weight * shape**2)
    covariance = np.linalg.inv(normal + 1e-9 * np.eye(4))[:2, :2] * max(factor, 0.05)
    whole = np.pi / 4 * (diameter * np.exp(values[2])) ** 2
    inside = float(np.sum(weight * shape / np.maximum(noise, 1e-6)) / max(np.sum(weight * shape), 1e-9))
    return Sighting(
        pixel=values[:2],
        sigma_px=float(np.sqrt(np.trace(covariance) / 2)),
        diameter_px=float(diameter * np.exp(values[2])),
        score=float(found / max(energy, 1e-9)),
        amplitude=float(values[3]),
        visible=float(np.sum(shape * (weight > 0)) / whole),
        contrast=float(np.sqrt(inside)),
    )


def learn(
    picture: np.ndarray, frame: int, plates: Plates, looks: Appearance, seen: Sighting, rate: float
) -> Appearance:
    """The looks with what this frame adds: the colours of the block, and its size."""
    left, top, right, bottom = clip_window(picture, seen.pixel, 0.5 * seen.diameter_px + 1)
    part, strength = _change(picture, frame, plates, (left, top, right, bottom))
    fresh = palette(part, strength, seen.pixel - (left, top), 0.42 * seen.diameter_px)
    colours = looks.colours if fresh is None else (1 - rate) * looks.colours + rate * fresh
    size = float(np.exp((1 - rate) * np.log(looks.diameter_px) + rate * np.log(seen.diameter_px)))
    return replace(looks, colours=colours, diameter_px=size)


def _change(
    picture: np.ndarray, frame: int, plates: Plates, window: tuple[int, int, int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """The window of a frame, and how much it differs from the background in standard deviations."""
    part, (behind, sigma, seen) = plates.beside(picture, frame, window)
    change = part - behind
    return part, np.sqrt(over_channels(change, change) / np.float32(3)) / sigma * seen


def first_looks(
    picture: np.ndarray, frame: int, plates: Plates, click: Array, diameter_px: float | None
) -> tuple[Appearance, Array, Array] | None:
    """Looks, centre (2,) and streak (2,) of what moves at a click; None when nothing does.

    The streak of a blurred block is known up to its sign.
    """
    cv2 = opencv()
    reach = 3.0 * diameter_px if diameter_px else max(picture.shape[:2]) / 8
    left, top, right, bottom = clip_window(picture, click, max(reach, 24.0))
    part, strength = _change(picture, frame, plates, (left, top, right, bottom))
    u, v = np.arange(left, right) + 0.5, (np.arange(top, bottom) + 0.5)[:, None]
    away = np.hypot(u - click[0], v - click[1])
    near = max(4.0, 0.5 * diameter_px if diameter_px else 0.0)
    smooth = cv2.blur(strength, (3, 3)) * (away <= near) * (1 - 0.5 * away / near)
    row, column = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
    if smooth[row, column] < 2.5:
        return None
    colour = np.median(part[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].reshape(-1, 3), axis=0)
    looks = Appearance(colour.astype(np.float64)[None], diameter_px or 5.0)
    centre, streak, size = click, np.zeros(2), 0.0
    for _ in range(3):
        here = cover(picture, frame, plates, looks, click, max(reach, 24.0))
        mask = ((here.alpha > 0.5) & (here.noise < 0.06)).astype(np.uint8)
        labels = cv2.connectedComponents(mask, connectivity=4)[1]
        label = labels[row, column]
        if label == 0:
            break
        blob = labels == label
        rows, columns = np.nonzero(blob)
        size = float(np.sqrt(4 * rows.size / np.pi))
        places = np.column_stack([columns + left + 0.5, rows + top + 0.5])
        spread = np.cov(places.T) + np.eye(2) / 12 if rows.size > 3 else np.eye(2)
        short, long = np.linalg.eigvalsh(spread)
        centre = places.mean(axis=0)
        streak = np.zeros(2)
        if long > 1.7**2 * short:
            size = float(4 * np.sqrt(short))
            streak = np.linalg.eigh(spread)[1][:, 1] * np.sqrt(12 * (long - short))
        radius = 0.42 * (diameter_px or size)
        middle = centre if diameter_px is None or np.hypot(*(centre - click)) < 0.5 * diameter_px else click
        fresh = palette(part, strength, middle - (left, top), radius)
        looks = looks if fresh is None else replace(looks, colours=fresh)
    if diameter_px is None:
        if size < 2:
            return None
        looks = replace(looks, diameter_px=size)
    elif np.hypot(*(centre - click)) > diameter_px:
        centre = click
    return looks, centre, streak
