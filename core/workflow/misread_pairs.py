# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs that no camera fits: are they written another way than they are read?"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..camera.model import Camera
from ..camera.pairs import Pairs
from ..camera.resection.resect import Resection
from ..constants import UNITS_M
from ..errors import InputError, RockfallError
from ..vectors import Array, norm

IMPLAUSIBLE = 0.02
"""Root mean square of the residuals, in parts of the image's diagonal, above which a fit is none: 88 px in 4K."""
SIGMAS = 10.0
"""And in standard deviations of the pixels, where these are large."""
FEWEST_USED = 0.5
"""So must be one that leaves out more than this part of the pairs."""
BETTER = 0.1
"""Another reading explains the pairs if it leaves less than this part of the residuals."""
NAMED = 3
SUSPICIOUS, REDUNDANT = 5.0, 4
"""Residuals of so many times what was stated, with so many observations to spare: other readings are tried."""

type Reading = Callable[[Array, Array, tuple[int, int]], tuple[Array, Array]]
"""Pixels (n, 2) and points (n, 3) of an image of some size, read another way."""

READINGS: tuple[tuple[str, str, Reading], ...] = (
    (
        "v_px counted from the bottom",
        "Count v_px from the top row, or give z_m as heights, not depths",
        lambda pixel, point, size: (_columns(pixel[:, 0], size[1] - pixel[:, 1]), point),
    ),
    (
        "u_px and v_px exchanged",
        "Exchange the columns u_px and v_px",
        lambda pixel, point, _: (pixel[:, ::-1], point),
    ),
    (
        "x and y exchanged",
        "Exchange the columns x_m and y_m (x is east, y is north), if the picture is not mirrored",
        lambda pixel, point, _: (pixel, point[:, [1, 0, 2]]),
    ),
    (
        "y and z exchanged",
        "Exchange the columns y_m and z_m",
        lambda pixel, point, _: (pixel, point[:, [0, 2, 1]]),
    ),
    (
        "z_m in feet",
        "Multiply z_m by 0.3048, or name the column z_ft",
        lambda pixel, point, _: (pixel, point * [1.0, 1.0, UNITS_M["ft"]]),
    ),
    (
        "x_m and y_m in feet",
        "Multiply x_m and y_m by 0.3048, or name the columns x_ft and y_ft",
        lambda pixel, point, _: (pixel, point * [UNITS_M["ft"], UNITS_M["ft"], 1.0]),
    ),
)
"""What else may have been written: in words, what to do, and how it is read.

All but the units are reflections, so that cameras fit them equally well but for how they are held: the one that is
held most upright is taken. A mirrored picture is the same as x and y exchanged, depths for heights the same as rows
counted from below.
"""


def _columns(*columns: Array) -> Array:
    return np.stack(columns, axis=1)


def most_px(size: tuple[int, int], sigma_px: float) -> float:
    """Root mean square of the residuals [px] above which a camera is not believed."""
    return max(IMPLAUSIBLE * float(np.hypot(*size)), SIGMAS * sigma_px)


def check_reading(
    pairs: Pairs,
    found: Resection | None,
    size: tuple[int, int],
    sigma_px: float,
    solve: Callable[[Pairs], Resection],
) -> None:
    """Refuse a camera that no pairs of its image have, or whose pairs fit another reading far better.

    Parameters
    ----------
    pairs : from which no camera, or `found`, was solved.
    sigma_px : of a coordinate [px].
    solve : what to solve other readings with; it may raise RockfallError.

    Raises
    ------
    InputError : with how else the pairs may have been written, or which of them are farthest off.

    Notes
    -----
    Mirrored pixels of a slope that is nearly a plane fit a camera on its other side to some pixels.
    """
    limit = most_px(size, sigma_px)
    plausible = found is not None and found.rmse_px < limit and float(found.used.mean()) > FEWEST_USED
    if found is not None and plausible and not (found.redundancy >= REDUNDANT and found.scatter > SUSPICIOUS):
        return
    most = limit
    if found is not None:
        most = BETTER * (found.rmse_px if plausible else _rmse(found))
    fitting: list[tuple[float, float, str, str]] = []
    for words, todo, read in READINGS:
        pixel, point = read(pairs.pixel, pairs.point, size)
        if ((pixel < 0) | (pixel > size)).any():
            continue
        try:
            with np.errstate(all="ignore"):  # of a reading that no camera explains some numbers are none
                other = solve(replace(pairs, pixel=pixel, point=point))
        except RockfallError:
            continue
        if other.rmse_px < most and float(other.used.mean()) > FEWEST_USED:
            fitting.append((_roll_deg(other.camera), other.rmse_px, words, todo))
    if fitting:
        _, rmse, words, advice = min(fitting, key=lambda one: one[0])
        reason = f"{_how_far(pairs, found)}. With {words} they fit to {rmse:.2g} px"
        raise InputError(reason, file=pairs.source, advice=advice)
    if not plausible:
        advice = (
            "Check that pixels and points are of the same marks, the image's size, and that x is east, y north, z up"
        )
        raise InputError(_how_far(pairs, found), file=pairs.source, advice=advice)


def _roll_deg(camera: Camera) -> float:
    """By how much the camera is turned about its axis from upright [°], 0 to 180, in steps of 10."""
    right, down = camera.rotation[0, 2], camera.rotation[1, 2]
    return 10 * round(abs(float(np.degrees(np.arctan2(right, -down)))) / 10)


def _rmse(found: Resection) -> float:
    """Of all pairs in view, whether they were used or not [px]."""
    length = norm(found.residual_px)
    seen = np.isfinite(length)
    return float(np.sqrt(np.mean(length[seen] ** 2))) if seen.any() else np.inf


def _how_far(pairs: Pairs, found: Resection | None) -> str:
    if found is None:
        return f"No camera fits the {len(pairs)} pairs"
    length = np.nan_to_num(norm(found.residual_px), nan=np.inf)
    worst = [
        f"{pairs.name[i]} ({f'{length[i]:.0f} px' if np.isfinite(length[i]) else 'not in view'})"
        for i in np.argsort(-length, kind="stable")[:NAMED]
    ]
    return (
        f"No camera fits the {len(pairs)} pairs: they are {_rmse(found):.3g} px off (root mean square), most of all "
        f"{', '.join(worst)}"
    )
