# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of motion graphs: motion.csv and track_residuals.csv."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..analysis.motion_graphs import CLEARANCE, HEIGHT, KINETIC, SPEED, TOTAL, FrameScale, MotionCourse
from ..vectors import Array
from .tables import Columns, write_columns

IN_TABLE = (
    (SPEED, "speed_mps", 1.0), (HEIGHT, "height_m", 1.0), (CLEARANCE, "clearance_m", 1.0),
    (KINETIC, "kinetic_J", 1e3), (TOTAL, "kinetic_with_rotation_J", 1e3),
)  # fmt: skip


def write_motion(courses: Sequence[MotionCourse], path: str | Path, scale: FrameScale | None = None) -> None:
    """Write motion.csv: a row for each moment, two at an impact.

    Parameters
    ----------
    scale : whose frame numbers have a column.
    """
    parts = [np.isfinite(course.time_s) for course in courses]
    time_s = _joined([course.time_s[part] for course, part in zip(courses, parts, strict=True)])
    segments = [course.flight[part] + 1 for course, part in zip(courses, parts, strict=True)]
    columns: Columns = {
        "trajectory": [c.trajectory for c, part in zip(courses, parts, strict=True) for _ in range(part.sum())],
        "segment": [str(number) for part in segments for number in part.tolist()],
        "time_s": _digits(time_s),
    }
    if scale is not None:
        columns["frame"] = _digits(scale.frames(time_s), 3)
    for quantity, name, factor in IN_TABLE:
        values = [course.values[quantity.name][part] for course, part in zip(courses, parts, strict=True)]
        columns[name] = _digits(factor * _joined(values))
    write_columns(path, columns)


def write_track_residuals(courses: Sequence[MotionCourse], path: str | Path) -> None:
    """Write track_residuals.csv: a row for each tracked pixel, observed less computed; empty outside of the motion."""
    tracks = [(course.trajectory, one) for course in courses for one in course.residuals]
    both = [
        np.vstack([np.empty((0, 2)), *(getattr(one, name) for _, one in tracks)]) for name in ("pixel", "offset_px")
    ]
    columns: Columns = {
        "trajectory": [name for name, one in tracks for _ in one.time_s],
        "video": [one.video for _, one in tracks for _ in one.time_s],
        "video_time_s": _digits(_joined([one.video_s for _, one in tracks])),
        "time_s": _digits(_joined([one.time_s for _, one in tracks])),
        "u_px": _digits(both[0][:, 0], 3),
        "v_px": _digits(both[0][:, 1], 3),
        "residual_u_px": _digits(both[1][:, 0], 3),
        "residual_v_px": _digits(both[1][:, 1], 3),
        "residual_px": _digits(_joined([one.distance_px for _, one in tracks]), 3),
    }
    write_columns(path, columns)


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([np.zeros(0), *parts])


def _digits(values: Array, digits: int = 6) -> list[str]:
    return ["" if value != value else f"{value:.{digits}f}" for value in values.tolist()]
