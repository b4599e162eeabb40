# SPDX-License-Identifier: GPL-3.0-or-later
"""How near a reconstruction comes to the truth, where the truth is known: the demo site, or an instrumented block."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..reading import reader
from ..reconstruction.impact import Impacts, apparent
from ..vectors import Array, Indices, Names, angle_between, norm

COLUMNS = (
    *("trajectory", "impact", "time_s", "nx", "ny", "nz"),
    *("v1x_mps", "v1y_mps", "v1z_mps", "v2x_mps", "v2y_mps", "v2z_mps"),
)


@dataclass(frozen=True, eq=False)
class Truth:
    """n true impacts.

    Attributes
    ----------
    trajectory, impact : (n,) name of the run, and number of the impact in it, as in impacts.csv.
    time_s : (n,) [s].
    normal : (n, 3) of the terrain at block scale.
    v1, v2 : (n, 3) velocity of the block's centre just before and after [m/s]; NaN where there is none.
    """

    trajectory: Names
    impact: Indices
    time_s: Array
    normal: Array
    v1: Array
    v2: Array


@dataclass(frozen=True)
class Deviation:
    """Differences "reconstructed − true" of one quantity, over ``n`` impacts.

    Attributes
    ----------
    median : median of the absolute difference.
    p90 : 90 % quantile of the absolute difference.
    bias : median of the signed difference.
    typical : median of the true value.
    """

    name: str
    unit: str
    n: int
    median: float
    p90: float
    bias: float
    typical: float


@reader("table of true impacts")
def read_truth(path: str | Path) -> Truth:
    """Read a table of true impacts; it needs the columns in `COLUMNS`, others are not looked at.

    Raises
    ------
    InputError : the file cannot be read, lacks a column, or has a cell that is no number.
    """
    path = Path(path)
    with path.open(encoding="utf-8-sig", newline="") as file:
        cells = csv.DictReader(file)
        missing = [name for name in COLUMNS if name not in (cells.fieldnames or ())]
        if missing:
            raise InputError(
                f"The table of true impacts lacks the column {missing[0]}",
                file=path,
                row=1,
                advice=f"It needs {', '.join(COLUMNS)}",
            )
        rows = list(cells)

    def number(row: int, name: str) -> float:
        cell = rows[row][name] or ""
        try:
            return float(cell) if cell.strip() else np.nan
        except ValueError as error:
            raise InputError(
                f"{name} is {cell!r}, not a number", file=path, row=row + 2, advice="Correct the cell or leave it empty"
            ) from error

    def vectors(*names: str) -> Array:
        return np.array([[number(row, name) for name in names] for row in range(len(rows))]).reshape(-1, len(names))

    return Truth(
        trajectory=np.array([row["trajectory"] for row in rows], dtype=np.str_),
        impact=vectors("impact")[:, 0].astype(np.intp),
        time_s=vectors("time_s")[:, 0],
        normal=vectors("nx", "ny", "nz"),
        v1=vectors("v1x_mps", "v1y_mps", "v1z_mps"),
        v2=vectors("v2x_mps", "v2y_mps", "v2z_mps"),
    )


def compare_with_truth(impacts: Impacts, truth: Truth) -> tuple[Deviation, ...]:
    """Differences of speeds, coefficients and angles, matched by trajectory and impact number.

    Raises
    ------
    InputError : no impact of the one table is in the other.
    """
    place = {key: i for i, key in enumerate(zip(truth.trajectory.tolist(), truth.impact.tolist(), strict=True))}
    keys = list(zip(impacts.trajectory.tolist(), impacts.impact.tolist(), strict=True))
    here = np.array([i for i, key in enumerate(keys) if key in place], dtype=np.intp)
    if not here.size:
        raise InputError("No impact is in the table of true impacts", advice="Take the table that belongs to the picks")
    there = np.array([place[keys[i]] for i in here], dtype=np.intp)
    v1, v2, normal = truth.v1[there], truth.v2[there], truth.normal[there]
    true = apparent(v1, v2, normal)
    one = np.ones(here.size)
    return (
        _deviation("time", "s", impacts.time_s[here], truth.time_s[there]),
        _deviation("|v1|", "m/s", norm(impacts.v1[here]), norm(v1)),
        _deviation("|v2|", "m/s", norm(impacts.v2[here]), norm(v2)),
        _deviation("v1 (vector)", "m/s", norm(impacts.v1[here] - v1), 0.0 * one),
        _deviation("v2 (vector)", "m/s", norm(impacts.v2[here] - v2), 0.0 * one),
        _deviation("R_N", "", impacts.rn[here], true.rn),
        _deviation("R_T", "", impacts.rt[here], true.rt),
        _deviation("R", "", impacts.r[here], true.r),
        _deviation("θ1", "deg", np.degrees(impacts.theta1[here]), np.degrees(true.theta1)),
        _deviation("θ_dev", "deg", np.degrees(impacts.theta_dev[here]), np.degrees(true.theta_dev)),
        _deviation("normal", "deg", np.degrees(angle_between(impacts.normal[here], normal)), 0.0 * one),
    )


def truth_sentences(deviations: tuple[Deviation, ...]) -> list[str]:
    """The comparison for people."""
    by_name = {one.name: one for one in deviations}
    v1, v2, r, rn = by_name["|v1|"], by_name["|v2|"], by_name["R"], by_name["R_N"]
    return [
        f"Against the truth (median of the absolute error): incident speed {v1.median:.2f} of {v1.typical:.1f} m/s, "
        f"restituted speed {v2.median:.2f} of {v2.typical:.1f} m/s, R {r.median:.3f} of {r.typical:.2f}, "
        f"R_N {rn.median:.3f} of {rn.typical:.2f}, θ1 {by_name['θ1'].median:.1f}°, "
        f"deviation {by_name['θ_dev'].median:.1f}°."
    ]


def _deviation(name: str, unit: str, found: Array, true: Array) -> Deviation:
    difference = found - true
    known = np.isfinite(difference)
    if not known.any():
        return Deviation(name, unit, 0, np.nan, np.nan, np.nan, np.nan)
    difference = difference[known]
    size = np.abs(difference)
    return Deviation(
        name,
        unit,
        int(known.sum()),
        float(np.median(size)),
        float(np.quantile(size, 0.9)),
        float(np.median(difference)),
        float(np.median(true[known])),
    )
