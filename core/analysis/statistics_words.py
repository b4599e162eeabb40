# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistics as tables of text, for the command line and for a panel alike."""

from collections.abc import Mapping, Sequence

from .curves import number
from .group_statistics import GroupStatistics
from .line_fits import FEWEST, LineFit
from .statistics import FEWEST_FOR_LAW, ImpactStatistics

TextRow = tuple[str, ...]
"""The cells of a row."""
MOST_GROUPS = 12
"""So many groups are shown, the largest ones; all are in groups.csv."""


def summary_rows(statistics: ImpactStatistics) -> list[TextRow]:
    """What a panel shows of a table of impacts: label and value, short enough for a sidebar."""
    rows: list[TextRow] = [
        ("Impacts used", f"{statistics.used} of {statistics.impacts}"),
        ("Trajectories", str(statistics.trajectories)),
    ]
    if statistics.doubts:
        rows.append(("Flagged among them", str(sum(statistics.doubts.values()))))
    if statistics.used < FEWEST:
        return [*rows, ("Fits", "too few impacts")]
    rt, angle, trend = statistics.rt, statistics.rn_angle, statistics.r_deviation
    return [
        *rows,
        ("Rᴛ", number(rt.slope)),
        ("    95 %", f"{number(rt.low)}–{number(rt.high)}"),
        ("    R² of vᴛ₂", _two(rt.r2)),
        ("Rɴ", law(statistics).replace("θ1", "θ₁")),
        ("    R² of ln Rɴ", _two(angle.r2)),
        ("R per 10° of deviation", number(10 * trend.slope)),
        ("    R²", _two(trend.r2)),
        ("Rɴ > 1", f"{statistics.rn_above_one} of {statistics.used}"),
    ]


def class_rows(statistics: ImpactStatistics) -> list[TextRow]:
    """R_N > 1 by incident angle: a heading, and a row for each class up to the last that has an impact."""
    rows: list[TextRow] = [("θ1", "impacts", "R_N > 1", "share (95 %)")]
    last = max((i for i, one in enumerate(statistics.classes) if one.n), default=-1)
    for one in statistics.classes[: last + 1]:
        low, high = one.interval
        share = f"{one.share:.0%} ({low:.0%}–{high:.0%})".replace("%", " %") if one.n else "–"
        rows.append((f"{one.low_deg:.0f}–{one.high_deg:.0f}°", str(one.n), str(one.above_one), share))
    return rows


def group_rows(groups: GroupStatistics, most: int = MOST_GROUPS) -> list[TextRow]:
    """A heading of two rows, and a row for each of the largest groups, in their order."""
    rows: list[TextRow] = [
        (groups.column, "impacts", "falls", "R_T (95 %)", "R_N", "R_N > 1", "R_N", "R", "θ1 [°]", "|v1| [m/s]"),
        ("", "used", "", "", "", "", "median", "median", "median", "median"),
    ]
    for name, one in _largest(groups.groups, most):
        middle = [
            format(one.spreads[variable].median, digits) if one.used else "–"
            for variable, digits in (("rn", ".2f"), ("r", ".2f"), ("theta1_deg", ".0f"), ("v1_mps", ".1f"))
        ]
        fits = (_slope(one.rt), law(one) if one.used >= FEWEST_FOR_LAW else "–")
        rows.append((name, str(one.used), str(one.trajectories), *fits, str(one.rn_above_one), *middle))
    return rows


def group_cells(groups: Mapping[str, ImpactStatistics], most: int = MOST_GROUPS) -> list[TextRow]:
    """The same in few columns, for a panel: a heading, and a row for each of the largest groups."""
    rows: list[TextRow] = [("", "used", "Rᴛ", "Rɴ > 1")]
    rows += [(name, str(one.used), _two(one.rt.slope), str(one.rn_above_one)) for name, one in _largest(groups, most)]
    return rows


def _largest(groups: Mapping[str, ImpactStatistics], most: int) -> list[tuple[str, ImpactStatistics]]:
    """In their order."""
    names = set(sorted(groups, key=lambda name: -groups[name].used)[:most])
    return [(name, one) for name, one in groups.items() if name in names]


def law(statistics: ImpactStatistics) -> str:
    """R_N by the incident angle in degrees."""
    if statistics.rn_angle.slope != statistics.rn_angle.slope:
        return "–"
    return f"{number(statistics.rn_factor)}·θ1^{_two(statistics.rn_angle.slope)}"


def aligned(rows: Sequence[TextRow]) -> list[str]:
    """Rows of text in columns: the first to the left, the others to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return lines


def _slope(fit: LineFit) -> str:
    return f"{fit.slope:.3f} ({fit.low:.3f}–{fit.high:.3f})".replace("-", "−") if fit.slope == fit.slope else "–"


def _two(value: float) -> str:
    return f"{value:.2f}".replace("-", "−") if value == value else "–"
