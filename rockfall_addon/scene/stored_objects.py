# SPDX-License-Identifier: GPL-3.0-or-later
"""What the objects of each role, but picks, must hold to be used; see `stored_values`."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...core.impact_models.registry import MODELS
from ...core.plausibility import GREATEST_M, OF_UNIT
from ...core.remarks import Severity, from_plain
from . import store
from .stored_values import BEYOND, NO_TEXT, NOT_FINITE, Check, count, json_of, name, number, numbers

PER_POSE, PER_SIGHTING, SIGMA_OF_SIGHTING = 12, 7, 5


@dataclass(frozen=True)
class Kept:
    """What an object of a role holds.

    Attributes
    ----------
    needed : without which it is none.
    beside : what it can be without.
    together : keys of these that are used together: where one cannot be used, all go.
    do : what to do when it is set aside.
    severity : of its being set aside.
    """

    needed: Mapping[str, Check] = field(default_factory=dict)
    beside: Mapping[str, Check] = field(default_factory=dict)
    together: tuple[tuple[str, ...], ...] = ()
    do: str = ""
    severity: Severity = "note"


def _no_list(value: object, multiple: int) -> str:
    """Why something is no list of numbers, so many or a multiple of it; empty where it is one."""
    if getattr(value, "typecode", "") in ("d", "f", "i") and len(value) and not len(value) % multiple:
        return ""
    return "is no list of numbers" if multiple == 1 else f"is no list of {multiple} numbers each"


def series(multiple: int, unknown: int | None = None) -> Check:
    """Finite numbers, so many or a multiple of it.

    Parameters
    ----------
    unknown : which of so many is NaN where it was not given.
    """

    def check(value: object) -> str:
        if problem := _no_list(value, multiple):
            return problem
        rows = np.array(value, dtype=np.float64).reshape(-1, multiple)
        known = rows if unknown is None else np.delete(rows, unknown, axis=1)
        return "" if np.isfinite(known).all() else NOT_FINITE

    return check


def _pose_sigmas(value: object) -> str:
    """Standard deviations of poses: infinite where the background was not recognised."""
    return _no_list(value, 2) or ("" if (np.array(value) >= 0).all() else BEYOND)


def _covariance(value: object) -> str:
    """(6, 6) of a pose, which must have an inverse."""
    problem = numbers(36)(value)
    matrix = np.zeros((6, 6)) if problem else np.array(value, dtype=np.float64).reshape(6, 6)
    return problem or ("" if np.linalg.eigvalsh(matrix + matrix.T)[0] > 0 else "is no covariance")


def _text(value: object) -> str:
    return "" if isinstance(value, str) else NO_TEXT


def _clock(value: object) -> str:
    problem = series(2)(value) or ("" if len(value) >= 4 else "is no list of 4 numbers")
    return problem or ("" if 1 + value[1] > 0 and value[3] > 0 else BEYOND)


def _texts(found: list) -> None:
    if not all(isinstance(each, str) for each in found):
        raise TypeError


def _digests(found: dict) -> None:
    _texts(list(found.values()))


def _releases(found: list) -> None:
    if not found:
        raise ValueError
    for release, trajectory, time_s in found:
        if not isinstance(release, str) or not isinstance(trajectory, str) or number()(time_s):
            raise ValueError


def _is_model(value: object) -> str:
    return "" if isinstance(value, str) and value in MODELS else "names no model"


def _cells(value: object) -> str:
    problem = numbers(5, -GREATEST_M, GREATEST_M)(value)
    return problem or ("" if value[2] > 0 and min(value[3:]) >= 1 else BEYOND)


_model = {store.MODEL: _is_model}
_trajectory = {store.TRAJECTORY: name}
_amount = number(0.0)
_place = numbers(3, -GREATEST_M, GREATEST_M)
POSE = (store.SOLVED, store.CAMERA, store.REFERENCE_POSE, store.POSE_TIMES, store.POSES)
_poses: dict[str, Check] = {
    store.CAMERA: numbers(9),
    store.REFERENCE_POSE: numbers(PER_POSE),
    store.POSE_TIMES: series(1),
    store.POSES: series(PER_POSE),
}

BY_ROLE: dict[str, Kept] = {
    store.CAMERA_ROLE: Kept(
        needed={
            store.ID: name,
            store.VIDEO_FILE: _text,
            store.VIDEO_SIZE: numbers(2, 1.0, 1e5),
            store.VIDEO_TIMES: series(1),
            store.CLOCK: _clock,
        },
        beside={
            **_poses,
            store.SOLVED: lambda value: "" if isinstance(value, (bool, int)) else "is neither true nor false",
            store.POSE_SIGMA: _pose_sigmas,
            store.POSE_COVARIANCE: _covariance,
            store.CAMERA_SHIFT: _place,
            store.RMSE: _amount,
            store.ASPECT: numbers(2, 1e-3, 1e3),
            store.CAMERA_KEYED: series(2),
            store.CAPTURE_RATE: number(0.0, OF_UNIT["hz"]),
            store.ROW_TIME: number(-1.0, 1.0),
            store.VIDEO_FACTS: json_of(dict),
            store.TRACK_NAMES: json_of(list, _texts),
            store.TRACK_ROWS: series(PER_SIGHTING, unknown=SIGMA_OF_SIGHTING),
            store.SOLUTION: json_of(dict),
            store.CAMERA_QUALITY: json_of(dict),
            store.FOLLOWED: json_of(dict),
            store.EVENTS: json_of(dict),
            store.KNOWN_LENS: numbers(9),
        },
        together=(POSE, (store.TRACK_NAMES, store.TRACK_ROWS)),
        do="Add the video again",
        severity="problem",
    ),
    store.FLIGHTS_ROLE: Kept(_trajectory, {store.MASS: _amount, store.TOP_SPEED: _amount}, do="Others were made"),
    store.BLOCK_ROLE: Kept(_trajectory, do="Another one was made"),
    store.MODEL_BLOCK_ROLE: Kept(_model | _trajectory, {store.LANE: _amount}, do="Show the models again"),
    store.MODEL_FLIGHTS_ROLE: Kept(_model, do="Show the models again"),
    store.SIMULATED_BLOCKS_ROLE: Kept({**_model, store.RELEASES: json_of(list, _releases)}, do="Simulate again"),
    store.SIMULATED_PATHS_ROLE: Kept(
        {**_model, store.RELEASES: json_of(list, _releases), store.ENDS: json_of(list, _texts)}, do="Simulate again"
    ),
    store.SIMULATED_PATTERN_ROLE: Kept(_model, do="Simulate again"),
    store.SIMULATED_TREES_ROLE: Kept(do="Simulate again"),
    store.MAPS_ROLE: Kept(
        {
            **_model,
            store.MAP_CELLS: _cells,
            store.MAP_BLOCKS: count,
            store.MAP_OF: json_of(dict, lambda found: from_plain(found["remarks"], "note")),
        },
        do="Compute the maps again",
    ),
    store.FACE_MAPS_ROLE: Kept({store.MAP_BLOCKS: count}, do="Compute the maps again"),
    store.TERRAIN_ROLE: Kept(
        beside={
            store.REACH: _amount,
            store.THIN_SHARE: number(0.0, 1.0),
            store.STANDING_OUT: number(0.0, 1.0),
            store.FOOTAGE_OF: json_of(dict, _digests),
        }
    ),
}


def incomplete(role: str, values: Mapping[str, object]) -> tuple[str, ...]:
    """Keys that are of no use, as others are missing that belong to them."""
    lost: list[str] = []
    for keys in BY_ROLE[role].together:
        there = [key for key in keys if key in values]
        if there and len(there) < len(keys) and (keys != POSE or values.get(store.SOLVED) or len(there) > 1):
            lost += there
    if role == store.CAMERA_ROLE and store.POSES in values and store.POSE_TIMES in values and not lost:
        poses, times = len(values[store.POSES]), len(values[store.POSE_TIMES])
        if poses != PER_POSE * times:
            lost += POSE
        elif store.POSE_SIGMA in values and len(values[store.POSE_SIGMA]) != 2 * times:
            lost.append(store.POSE_SIGMA)
    return tuple(lost)
