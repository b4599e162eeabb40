# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks: what a person marked, where and when, checked and in order."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from ..constants import SAME_TIME_S
from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array, Indices, Mask, Names, norm

KINDS = ("impact", "release", "pass", "contact", "stop", "takeoff")
STATUSES = ("ok", "doubtful", "shattered", "discarded")
LONGEST_S = 86_400.0
"""A day: what lasts longer has a wrong time, and would be sampled for ever."""


@dataclass(frozen=True, eq=False)
class Picks:
    """n picks, grouped by trajectory (in the order of first appearance), their times ascending inside each.

    Build them with `make_picks`, which fills the defaults, groups and checks.

    Attributes
    ----------
    trajectory : (n,) name of the block's run.
    time_s : (n,) on the common clock [s].
    position : (n, 3) local [m].
    kind : (n,) one of `KINDS`. An impact whose contact is no point is followed by its `takeoff`: where and when the
        block leaves the ground again.
    status : (n,) one of `STATUSES`.
    normal : (n, 3) unit, out of the ground; NaN where not given.
    sigma_time_s, sigma_position_m : (n,) standard deviations (of each coordinate); NaN where not given.
    angular_velocity : (n, 3) just before the pick [rad/s]; NaN where not given.
    row : (n,) row in the source as a text editor counts, the header being row 1; 0 without a source.
    extra : further columns as text, by name.
    source : file name for messages, may be empty.
    shift : of the local frame.
    """

    trajectory: Names
    time_s: Array
    position: Array
    kind: Names
    status: Names
    normal: Array
    sigma_time_s: Array
    sigma_position_m: Array
    angular_velocity: Array
    row: Indices
    extra: dict[str, Names]
    source: str = ""
    shift: GlobalShift = field(default_factory=GlobalShift)

    def __len__(self) -> int:
        return self.time_s.size

    @property
    def leaves_at(self) -> Indices:
        """(n,) index of the pick at which the block leaves the ground: its own, or the take-off that follows it."""
        own = np.arange(len(self))
        follows = (self.kind[:-1] == "impact") & (self.trajectory[1:] == self.trajectory[:-1])
        own[:-1] += (self.kind[1:] == "takeoff") & (self.status[1:] != "discarded") & follows
        return own

    @property
    def group_starts(self) -> Indices:
        """(groups,) index of the first pick of each trajectory."""
        if not len(self):
            return np.zeros(0, dtype=np.intp)
        return np.flatnonzero(np.r_[True, self.trajectory[1:] != self.trajectory[:-1]])

    def in_shift(self, shift: GlobalShift) -> "Picks":
        """The same picks in the local frame of another shift."""
        if np.array_equal(shift.vector, self.shift.vector):
            return replace(self, shift=shift)
        return replace(self, position=shift.to_local(self.shift.to_survey(self.position)), shift=shift)

    def error(self, index: int, problem: str, advice: str) -> InputError:
        """An `InputError` that points at one pick."""
        return InputError(
            problem,
            file=self.source or None,
            row=int(self.row[index]) or None,
            trajectory=str(self.trajectory[index]),
            advice=advice,
        )


def make_picks(
    trajectory: Sequence[str] | Names,
    time_s: Any,
    position: Any,
    *,
    kind: Sequence[str] | Names | None = None,
    status: Sequence[str] | Names | None = None,
    normal: Any = None,
    sigma_time_s: Any = None,
    sigma_position_m: Any = None,
    angular_velocity: Any = None,
    row: Any = None,
    extra: dict[str, Names] | None = None,
    source: str = "",
    shift: GlobalShift | None = None,
    sort: bool = False,
) -> Picks:
    """Picks from columns: defaults filled, rows grouped by trajectory, everything checked.

    Parameters
    ----------
    trajectory, time_s, position, … : columns as in `Picks`; None is the default of the format (impact, ok, not given).
    sort : put the times of each trajectory in order instead of refusing unsorted ones (a scene has no order).

    Raises
    ------
    InputError : an unknown kind or status, a value that is not finite, a normal of length zero, a negative standard
        deviation, times that are not ascending, two picks at one time, a release in mid-run, a take-off without its
        impact.
    """
    names = np.asarray(trajectory, dtype=np.str_).reshape(-1)
    n = names.size

    def column(values: Any) -> Array:
        return np.full(n, np.nan) if values is None else np.asarray(values, dtype=np.float64).reshape(n)

    def vectors(values: Any) -> Array:
        return np.full((n, 3), np.nan) if values is None else np.asarray(values, dtype=np.float64).reshape(n, 3)

    picks = Picks(
        trajectory=names,
        time_s=column(time_s),
        position=vectors(position),
        kind=np.full(n, "impact") if kind is None else np.asarray(kind, dtype=np.str_),
        status=np.full(n, "ok") if status is None else np.asarray(status, dtype=np.str_),
        normal=vectors(normal),
        sigma_time_s=column(sigma_time_s),
        sigma_position_m=column(sigma_position_m),
        angular_velocity=vectors(angular_velocity),
        row=np.zeros(n, dtype=np.intp) if row is None else np.asarray(row, dtype=np.intp),
        extra={name: np.asarray(values, dtype=np.str_) for name, values in (extra or {}).items()},
        source=source,
        shift=shift or GlobalShift(),
    )
    _check_values(picks)
    picks = _in_order(picks, _grouped_order(picks, sort))
    _check_times(picks)
    _check_releases(picks)
    _check_take_offs(picks)
    return replace(picks, normal=picks.normal / norm(picks.normal)[:, None])


def take(picks: Picks, rows: Indices | Mask) -> Picks:
    """Some of the picks, in the given order."""
    return _in_order(picks, rows)


def _in_order(picks: Picks, order: Indices | Mask) -> Picks:
    columns = ("trajectory", "time_s", "position", "kind", "status", "normal", "sigma_time_s", "sigma_position_m")
    chosen = {name: getattr(picks, name)[order] for name in (*columns, "angular_velocity", "row")}
    return replace(picks, **chosen, extra={name: values[order] for name, values in picks.extra.items()})


def _grouped_order(picks: Picks, sort: bool) -> Indices:
    """Order that brings the rows of a trajectory together, trajectories in the order of their first row."""
    starts = picks.group_starts
    rank: dict[str, int] = {}
    group = np.array([rank.setdefault(str(name), len(rank)) for name in picks.trajectory[starts]], dtype=np.intp)
    of_row = np.repeat(group, np.diff(np.r_[starts, len(picks)]))
    return np.lexsort((picks.time_s, of_row)) if sort else np.argsort(of_row, kind="stable")


def _first(mask: Any) -> int | None:
    return int(np.argmax(mask)) if mask.any() else None


def _check_values(picks: Picks) -> None:
    if (i := _first(picks.trajectory == "")) is not None:
        raise picks.error(i, "The trajectory has no name", "Name the block's run in the column trajectory")
    for label, values, known in (("kind", picks.kind, KINDS), ("status", picks.status, STATUSES)):
        if (i := _first(~np.isin(values, known))) is not None:
            near = get_close_matches(str(values[i]).lower(), known, n=1)
            advice = f"Did you mean {near[0]}? " if near else ""
            raise picks.error(i, f"Unknown {label} '{values[i]}'", f"{advice}Use one of {', '.join(known)}")
    finite = np.isfinite(picks.time_s) & np.isfinite(picks.position).all(axis=1)
    if (i := _first(~finite)) is not None:
        raise picks.error(i, "The time or the position is not a finite number", "Give time_s, x_m, y_m and z_m")
    given = np.isfinite(picks.normal)
    if (i := _first(given.any(axis=1) & ~given.all(axis=1))) is not None:
        raise picks.error(i, "Only a part of the terrain normal is given", "Give nx, ny and nz, or none of them")
    if (i := _first(norm(picks.normal) == 0)) is not None:
        raise picks.error(i, "The terrain normal has length zero", "Leave nx, ny, nz empty to take the terrain's")
    for label, sigma in (("sigma_time_s", picks.sigma_time_s), ("sigma_position_m", picks.sigma_position_m)):
        if (i := _first((sigma < 0) | np.isinf(sigma))) is not None:
            raise picks.error(i, f"{label} is not a standard deviation", "Give a number of zero or more, or nothing")


def _check_times(picks: Picks) -> None:
    step = np.diff(picks.time_s)
    step[picks.group_starts[1:] - 1] = np.inf
    if (i := _first(np.abs(step) <= SAME_TIME_S)) is not None:
        other = f" (the other one is in row {picks.row[i]})" if picks.row[i] else ""
        problem = f"Two picks at one time, {float(picks.time_s[i + 1])!r} s{other}"
        raise picks.error(i + 1, problem, "Remove one of them, or correct its time")
    if (i := _first(step < 0)) is not None:
        before = f" in row {picks.row[i]}" if picks.row[i] else ""
        late, early = float(picks.time_s[i]), float(picks.time_s[i + 1])
        problem = f"The times are not sorted: {early!r} s comes after {late!r} s{before}"
        raise picks.error(i + 1, problem, "Put the rows of a trajectory in time order, or correct the time")
    first = np.repeat(picks.group_starts, np.diff(np.append(picks.group_starts, len(picks))))
    lasting = picks.time_s - picks.time_s[first]
    if (i := _first(lasting > LONGEST_S)) is not None:
        problem = f"The trajectory lasts for {lasting[i]:.4g} s, longer than any fall"
        raise picks.error(i, problem, "Correct the time, or give the next run a trajectory name of its own")


def _check_releases(picks: Picks) -> None:
    allowed = np.zeros(len(picks), dtype=np.bool_)
    allowed[picks.group_starts] = True
    allowed[1:] |= (picks.kind[:-1] == "stop") | np.isin(picks.status[:-1], STATUSES[2:])
    if (i := _first((picks.kind == "release") & ~allowed)) is not None:
        problem = "A release in the middle of a run: the block is already moving"
        raise picks.error(i, problem, "Give the new run its own trajectory name, or end the run before with a stop")


def _check_take_offs(picks: Picks) -> None:
    ends = (picks.kind == "takeoff") & (picks.status != "discarded")
    follows = np.zeros(len(picks), dtype=np.bool_)
    follows[1:] = (picks.kind[:-1] == "impact") & np.isin(picks.status[:-1], STATUSES[:2])
    follows[picks.group_starts] = False
    if (i := _first(ends & ~follows)) is not None:
        problem = f"The take-off at {float(picks.time_s[i]):.3f} s does not follow an impact"
        raise picks.error(i, problem, "Mark the impact whose contact it ends right before it, or remove it")
