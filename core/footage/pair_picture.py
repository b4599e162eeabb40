# SPDX-License-Identifier: GPL-3.0-or-later
"""The check of a solved camera: marked and re-projected pairs on a frame of the video."""

from collections.abc import Sequence

import numpy as np

from ..opencv import opencv
from ..vectors import Array

FINE = 4
"""Bits of a pixel's fraction in OpenCV's drawing."""
DARK = (20, 20, 20)
MARKED, COMPUTED, LEFT_OUT = (80, 235, 255), (120, 255, 120), (90, 90, 255)


def draw_pairs(
    picture: np.ndarray, marked: Array, computed: Array, names: Sequence[str], used: np.ndarray
) -> np.ndarray:
    """A ring where each pair was marked and a cross where the camera sees its point, (h, w, 3) BGR uint8.

    Parameters
    ----------
    picture : (h, w, 3) BGR uint8.
    marked, computed : (n, 2) [px]; a pair without a computed pixel (NaN) has no cross.
    names : (n,) written beside the rings.
    used : (n,) pairs that were left out are red.
    """
    cv2 = opencv()
    shown = picture.copy()
    unit = max(shown.shape[1] / 1280, 0.5)
    for colour, thick in ((DARK, round(4 * unit)), (None, max(1, round(1.6 * unit)))):
        for place, found, name, believed in zip(marked, computed, names, used, strict=True):
            ring = colour or (MARKED if believed else LEFT_OUT)
            cv2.circle(shown, _fixed(place), round(9 * unit * 2**FINE), ring, thick, cv2.LINE_AA, FINE)
            corner = (round(place[0] + 12 * unit), round(place[1] - 8 * unit))
            cv2.putText(
                shown, str(name), corner, cv2.FONT_HERSHEY_SIMPLEX, max(0.45 * unit, 0.4), ring, thick, cv2.LINE_AA
            )
            if np.isfinite(found).all():
                cross = colour or (COMPUTED if believed else LEFT_OUT)
                for arm in ((6 * unit, 0.0), (0.0, 6 * unit)):
                    cv2.line(shown, _fixed(found - arm), _fixed(found + arm), cross, thick, cv2.LINE_AA, FINE)
    return shown


def _fixed(place: Array) -> tuple[int, int]:
    """OpenCV counts from the centre of the first pixel."""
    u, v = np.round((np.clip(place, -1e4, 1e5) - 0.5) * 2**FINE).astype(int)
    return int(u), int(v)
