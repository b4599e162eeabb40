# SPDX-License-Identifier: GPL-3.0-or-later
"""twins.csv: how the block would have flown on from each measured impact, had a model been right."""

import csv
from pathlib import Path

import numpy as np

from ..analysis.twins import Twins
from ..georeference import GlobalShift
from ..reconstruction.landing import Launches
from ..vectors import Array
from .csv_text import read_table

START = ("x_m", "y_m", "z_m")
V2 = ("v2x_mps", "v2y_mps", "v2z_mps")
LANDING = ("landing_x_m", "landing_y_m", "landing_z_m")
LANDING_VELOCITY = ("landing_vx_mps", "landing_vy_mps", "landing_vz_mps")
MEASURED = ("measured_x_m", "measured_y_m", "measured_z_m")
DERIVED = (
    "length_m",
    "duration_difference_s",
    "length_difference_m",
    "height_difference_m",
    "landing_offset_m",
)
TWINS_COLUMNS = (
    "model", "replicate", "site", "trajectory", "impact", "time_s", *START, *V2, "gravity_mps2", "drag_per_m",
    "duration_s", *LANDING, *LANDING_VELOCITY, "height_m", "measured_duration_s", *MEASURED, "measured_height_m",
    *DERIVED, "flags",
)  # fmt: skip
"""The columns of twins.csv. Differences are twin − measured; positions are survey coordinates."""
FLAGS = ("into_ground", "left_terrain")


def write_twins(twins: Twins, path: str | Path) -> None:
    """Write twins.csv. The flight of a row can be computed again from its start, v2, gravity and drag."""
    start, survey = twins.launches, twins.shift.to_survey
    numbers = {
        "time_s": twins.time_s,
        **_named(START, survey(start.position)),
        **_named(V2, start.velocity),
        "gravity_mps2": np.full(len(twins), start.gravity_mps2),
        "drag_per_m": start.drag_per_m,
        "duration_s": twins.duration_s,
        **_named(LANDING, survey(twins.landing)),
        **_named(LANDING_VELOCITY, twins.landing_velocity),
        "height_m": twins.height_m,
        "measured_duration_s": twins.measured_duration_s,
        **_named(MEASURED, survey(twins.measured_landing)),
        "measured_height_m": twins.measured_height_m,
        **{name: getattr(twins, name) for name in DERIVED},
    }
    marks = zip(*(getattr(twins, name).tolist() for name in FLAGS), strict=True)
    columns: dict[str, list[object]] = {
        name: getattr(twins, name).tolist() for name in ("model", "replicate", "site", "trajectory", "impact")
    }
    columns |= {name: ["" if v != v else repr(v) for v in values.tolist()] for name, values in numbers.items()}
    columns["flags"] = [";".join(name for name, here in zip(FLAGS, row, strict=True) if here) for row in marks]
    with Path(path).open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(TWINS_COLUMNS)
        writer.writerows(zip(*(columns[name] for name in TWINS_COLUMNS), strict=True))


def read_twins(path: str | Path, shift: GlobalShift | None = None) -> Twins:
    """Read twins.csv.

    Parameters
    ----------
    shift : of the local frame; None proposes one.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row.
    """
    needed = ("model", "trajectory", "impact", "time_s", *START, *V2, "gravity_mps2", "duration_s", *LANDING)
    table = read_table(path, needed, TWINS_COLUMNS)
    survey = table.vectors(START, required=True)
    shift = shift or GlobalShift.proposed(survey.min(axis=0), survey.max(axis=0))
    gravity = table.numbers("gravity_mps2", required=True)
    other = np.flatnonzero(gravity != gravity[0])
    if other.size:
        raise table.error(int(other[0]), "Gravity is not that of the first row", "Keep tables of two gravities apart")
    drag = table.numbers("drag_per_m")
    flags = [set(cell.split(";")) for cell in table.text("flags")]
    marks = {name: np.array([name in here for here in flags], dtype=np.bool_) for name in FLAGS}
    return Twins(
        model=np.array(table.text("model"), dtype=np.str_),
        replicate=np.nan_to_num(table.numbers("replicate")).astype(np.intp),
        site=np.array(table.text("site"), dtype=np.str_),
        trajectory=np.array(table.text("trajectory"), dtype=np.str_),
        impact=table.numbers("impact", required=True).astype(np.intp),
        time_s=table.numbers("time_s", required=True),
        launches=Launches(
            shift.to_local(survey), table.vectors(V2, required=True), np.nan_to_num(drag), float(gravity[0])
        ),
        duration_s=table.numbers("duration_s", required=True),
        landing=shift.to_local(table.vectors(LANDING, required=True)),
        landing_velocity=table.vectors(LANDING_VELOCITY),
        height_m=table.numbers("height_m"),
        measured_duration_s=table.numbers("measured_duration_s"),
        measured_landing=shift.to_local(table.vectors(MEASURED)),
        measured_height_m=table.numbers("measured_height_m"),
        shift=shift,
        **marks,
    )


def _named(names: tuple[str, ...], vectors: Array) -> dict[str, Array]:
    return {name: vectors[:, axis] for axis, name in enumerate(names)}
