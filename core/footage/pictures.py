# SPDX-License-Identifier: GPL-3.0-or-later
"""A track drawn on a frame of its video."""

from collections.abc import Sequence

import numpy as np

from ..colours import scale_colours
from ..opencv import opencv
from ..vectors import Array
from .background import BackgroundMotion, destabilise
from .kinks import Kinks
from .sources import Source, frames
from .tracking import BlockTrack

WIDTH = 1280
"""Of the picture, at least [px]."""
LARGEST = 2400
FADE = 0.35
FINE = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""
GROUND = 28
WHITE = (255, 255, 255)
DARK = (20, 20, 20)
RING = (80, 235, 255)


def draw_track(
    source: Source, track: BlockTrack, motion: BackgroundMotion, kinks: Kinks, labels: Sequence[str], frame: int
) -> np.ndarray:
    """The path as seen from one frame, (h, w, 3) BGR uint8.

    The line is coloured by time; dots stand for frames (each, or every 2, 5, 10, … where these would touch), rings with
    labels for proposed impacts. Where the camera follows the block, the picture is continued by the first and the last
    frame of the track.
    """
    cv2 = opencv()
    path = destabilise(motion, np.full(len(track.stable), frame), track.stable)
    hits = destabilise(motion, np.full(len(kinks), frame), kinks.pixel)
    size = np.array([source.width, source.height], dtype=np.float64)
    shown = np.concatenate([path, hits])
    around = 3 * float(np.median(track.diameter_px))
    low = np.where(shown.min(axis=0) < 0, np.maximum(shown.min(axis=0) - around, -1.5 * size), 0.0)
    high = np.where(shown.max(axis=0) > size, np.minimum(shown.max(axis=0) + around, 2.5 * size), size)
    zoom = min(max(1.0, WIDTH / (high - low)[0]), LARGEST / float((high - low).max()))
    picture = _ground(source, motion, track, frame, low, high, zoom)

    unit = max(picture.shape[1] / 1280, 0.75)
    where = (path - low) * zoom
    colours = scale_colours(track.time_s, track.time_s[0], track.time_s[-1])[:, ::-1] * 255
    joined = np.diff(track.frame) == 1
    for halo in (True, False):
        for i in range(len(where) - 1):
            colour = DARK if halo else colours[i]
            thick = max(1, round((3.6 if halo else 1.8) * unit))
            if joined[i]:
                _line(picture, where[i], where[i + 1], colour, thick)
            elif not halo:
                _dashes(picture, where[i], where[i + 1], colours[i], unit)
    usual = float(np.median(np.hypot(*np.diff(where, axis=0).T))) if len(where) > 1 else 0.0
    every = next((k for k in (1, 2, 5, 10, 20, 50) if k * usual >= 9 * unit), 100)
    for i in np.flatnonzero(track.frame % every == 0):
        _dot(picture, where[i], 2.8 * unit, DARK, -1)
        _dot(picture, where[i], 2.0 * unit, colours[i], -1)
    _ends(picture, where, track, unit)
    radius = max(0.75 * float(np.median(track.diameter_px)) * zoom, 8 * unit)
    taken: list[tuple[float, float, float, float]] = []
    for place, label in zip((hits - low) * zoom, labels, strict=True):
        _dot(picture, place, radius, DARK, round(4 * unit))
        _dot(picture, place, radius, RING, max(1, round(1.8 * unit)))
        _label(picture, place, label, radius + 6 * unit, 0.5 * unit, taken)
    _scale(picture, track, where, unit)
    return cv2.convertScaleAbs(picture)


def _ground(
    source: Source, motion: BackgroundMotion, track: BlockTrack, frame: int, low: Array, high: Array, zoom: float
) -> np.ndarray:
    """Frames laid on each other, the chosen one on top, faded so that the line stands out."""
    cv2 = opencv()
    width, height = np.ceil((high - low) * zoom).astype(int)
    canvas = np.full((height, width, 3), GROUND, np.uint8)
    place = np.array([[zoom, 0, -low[0] * zoom], [0, zoom, -low[1] * zoom], [0, 0, 1.0]])
    corner = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    first = int(motion.frames[0])
    onto = np.linalg.inv(motion.homography[frame - first])
    under = [] if motion.still else [int(track.frame[0]), int(track.frame[-1])]
    shown = dict(frames(source, sorted({*under, frame})))
    for number in (*under, frame):
        across = np.linalg.inv(corner) @ place @ onto @ motion.homography[number - first] @ corner
        cv2.warpPerspective(
            shown[number], across, (int(width), int(height)), canvas, cv2.INTER_CUBIC, cv2.BORDER_TRANSPARENT
        )
    grey = np.repeat(cv2.cvtColor(canvas, cv2.COLOR_BGR2GRAY)[:, :, None], 3, axis=2)
    faded: np.ndarray = cv2.addWeighted(canvas, 1 - FADE - 0.1, grey, FADE - 0.1, 0)
    return faded


def _point(place: Array) -> tuple[int, int]:
    u, v = np.round((np.clip(place, -1e4, 1e4) - 0.5) * 2**FINE).astype(int)
    return int(u), int(v)


def _line(picture: np.ndarray, a: Array, b: Array, colour: Sequence[float] | Array, thick: int) -> None:
    cv2 = opencv()
    cv2.line(picture, _point(a), _point(b), [float(c) for c in colour], thick, cv2.LINE_AA, FINE)


def _dashes(picture: np.ndarray, a: Array, b: Array, colour: Array, unit: float) -> None:
    count = max(int(np.hypot(*(b - a)) / (10 * unit)), 1)
    for k in range(count):
        _line(picture, a + (b - a) * (k + 0.25) / count, a + (b - a) * (k + 0.75) / count, colour, max(1, round(unit)))


def _dot(picture: np.ndarray, place: Array, radius: float, colour: Sequence[float] | Array, thick: int) -> None:
    cv2 = opencv()
    cv2.circle(picture, _point(place), round(radius * 2**FINE), [float(c) for c in colour], thick, cv2.LINE_AA, FINE)


def _ends(picture: np.ndarray, where: Array, track: BlockTrack, unit: float) -> None:
    """An open dot at the beginning, a full one at the end."""
    for place, thick in ((where[0], max(1, round(1.6 * unit))), (where[-1], -1)):
        _dot(picture, place, 5 * unit, DARK, round(4 * unit))
        _dot(picture, place, 5 * unit, WHITE, thick)


def _label(
    picture: np.ndarray,
    place: Array,
    text: str,
    away: float,
    scale: float,
    taken: list[tuple[float, float, float, float]],
) -> None:
    """Beside a place, on the first side that is inside the picture and free."""
    cv2 = opencv()
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    sides = ((away, height / 2), (-away - width, height / 2), (-width / 2, away + height), (-width / 2, -away))
    for across, down in sides:
        left, bottom = place[0] + across, place[1] + down
        box = (left - 4, bottom - height - 4, left + width + 4, bottom + 4)
        inside = box[0] > 0 and box[1] > 0 and box[2] < picture.shape[1] and box[3] < picture.shape[0]
        if inside and not any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken):
            taken.append(box)
            _text(picture, text, left, bottom, scale)
            return


def _text(picture: np.ndarray, text: str, left: float, bottom: float, scale: float) -> None:
    cv2 = opencv()
    for colour, thick in ((DARK, 4), (WHITE, 1)):
        cv2.putText(
            picture, text, (round(left), round(bottom)), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thick, cv2.LINE_AA
        )


def _scale(picture: np.ndarray, track: BlockTrack, where: Array, unit: float) -> None:
    """Colours of the times, in the corner that is farthest from the path."""
    cv2 = opencv()
    height, width = picture.shape[:2]
    wide, tall = round(200 * unit), max(round(7 * unit), 3)
    corners = [
        (left, top)
        for top in (height - round(34 * unit), round(44 * unit))
        for left in (round(24 * unit), width - wide - round(24 * unit))
    ]
    free = [float(np.hypot(*(where - (left + wide / 2, top)).T).min()) for left, top in corners]
    left, top = corners[0] if free[0] > wide else corners[int(np.argmax(free))]
    times = np.linspace(track.time_s[0], track.time_s[-1], wide)
    strip = scale_colours(times, times[0], times[-1])[:, ::-1] * 255
    cv2.rectangle(picture, (left - 2, top - 2), (left + wide + 1, top + tall + 1), DARK, -1)
    picture[top : top + tall, left : left + wide] = np.round(strip)
    _text(picture, f"{times[0]:.2f} s", left, top - 8 * unit, 0.45 * unit)
    last = f"{times[-1]:.2f} s"
    (long, _), _ = cv2.getTextSize(last, cv2.FONT_HERSHEY_SIMPLEX, 0.45 * unit, 1)
    _text(picture, last, left + wide - long, top - 8 * unit, 0.45 * unit)
