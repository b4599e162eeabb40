# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion graphs in print: speed, heights, energy and residuals of tracks over one time axis."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from ..extras import FIGURES, demand
from ..progress import Progress, silent
from .figures import FORMATS, LINK, MEASURED, MUTED, PAGE_IN, STYLE, save_named
from .motion_graphs import (
    QUANTITIES,
    RESIDUAL,
    FrameScale,
    MotionCourse,
    Quantity,
    from_start,
    shown_quantities,
    time_limits,
)
from .stacked_graphs import quantity_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALL = "motion"
"""Name of the figure of all trajectories."""
SINCE_START = "Time since the start of each trajectory [s]"
LABEL_LETTERS = 18
MARKS = ("o", "D", "s", "^")
VIDEO_COLOURS = ("#20262e", "#0072b2", "#d55e00", "#009e73")


def save_motion_figures(
    courses: Sequence[MotionCourse],
    folder: str | Path,
    scale: FrameScale | None = None,
    quantities: Sequence[Quantity] = QUANTITIES,
    formats: Sequence[str] = FORMATS[:1],
    progress: Progress = silent,
) -> tuple[Path, ...]:
    """Write one figure of each trajectory that flies, and one of all from their starts on; returns the files.

    Parameters
    ----------
    scale : whose frames stand above the time.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    number = sum(bool(course.time_s.size) for course in courses)
    return save_named(_figures(courses, scale, quantities), folder, formats, progress, number + (len(courses) > 1))


def motion_figure(
    courses: Sequence[MotionCourse],
    quantities: Sequence[Quantity] = QUANTITIES,
    scale: FrameScale | None = None,
    chosen: str = "",
    limits: Sequence[tuple[float, float]] | None = None,
    label: str = "Time [s]",
) -> "Figure":
    """Stacked graphs with the time axis in common.

    Parameters
    ----------
    chosen : the trajectory that stands out among the others; "" for none.
    limits : of the time axis, then of each quantity that has something to show; None takes them from the values.
    label : of the time axis.

    Raises
    ------
    DependencyError : Matplotlib is not installed.
    """
    demand(FIGURES)
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = shown_quantities(courses, quantities)
    many, number = len(courses) > 1, max(len(shown), 1)
    with rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 0.75 + 1.25 * number), layout="constrained")
        rows = figure.subplots(number, 1, squeeze=False, sharex=True)[:, 0]
        for i, (axes, quantity) in enumerate(zip(rows, shown, strict=False)):
            for course in sorted(courses, key=lambda one: one.trajectory == chosen):
                stands_out = not many or course.trajectory == chosen
                _draw(axes, course, quantity, strong=stands_out, faint=many and bool(chosen) and not stands_out)
            axes.set_ylim(limits[i + 1] if limits else quantity_axis(courses, quantity).limits)
            axes.set_ylabel(fill(quantity.label, LABEL_LETTERS))
            axes.grid(axis="y", color="#e4e6e9", linewidth=0.4)
        rows[-1].set_xlabel(label)
        rows[-1].set_xlim(limits[0] if limits else time_limits(courses))
        if scale is not None:
            above = rows[0].secondary_xaxis("top", functions=(scale.frames, scale.times))
            above.set_xlabel(f"Frame of {scale.video}")
        if not shown:
            rows[0].text(0.5, 0.5, "no motion is known", ha="center", transform=rows[0].transAxes, color=MUTED)
        title = courses[0].trajectory if not many else f"{len(courses)} trajectories"
        figure.suptitle(f"{title}, {chosen} in front" if many and chosen else title, fontsize=8.5, fontweight="bold")
        _name_videos(rows[-1], courses, shown, many)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        return figure


def _figures(
    courses: Sequence[MotionCourse], scale: FrameScale | None, quantities: Sequence[Quantity]
) -> "Iterator[tuple[str, Figure]]":
    if len(courses) > 1:
        yield ALL, motion_figure([from_start(one) for one in courses], quantities, label=SINCE_START)
    taken: set[str] = {ALL}
    for course in courses:
        if course.time_s.size:
            yield _file_name(course.trajectory, taken), motion_figure([course], quantities, scale)


def _file_name(trajectory: str, taken: set[str]) -> str:
    """One that every system allows, and that no other trajectory has."""
    kept = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in trajectory)
    name, number = f"{ALL}_{kept}", 2
    while name.lower() in taken:
        name, number = f"{ALL}_{kept}_{number}", number + 1
    taken.add(name.lower())
    return name


def _draw(axes: "Axes", course: MotionCourse, quantity: Quantity, *, strong: bool, faint: bool) -> None:
    colour = LINK if faint else MEASURED
    width = 1.0 if strong else 0.5
    if quantity == RESIDUAL:
        for i, video in enumerate(course.residuals):
            shade = colour if faint else VIDEO_COLOURS[i % len(VIDEO_COLOURS)]
            axes.plot(
                video.time_s, video.distance_px, color=shade, linewidth=0.5 * width, marker=MARKS[i % len(MARKS)],
                markersize=1.8 if strong else 1.2, markeredgewidth=0,
            )  # fmt: skip
    else:
        axes.plot(*course.series(quantity), color=colour, linewidth=width, alpha=1.0 if strong or faint else 0.6)
    if strong:
        for time_s in course.impact_time_s:
            axes.axvline(float(time_s), color=LINK, linewidth=0.4, linestyle=(0, (2, 2)), zorder=0)


def _name_videos(axes: "Axes", courses: Sequence[MotionCourse], shown: Sequence[Quantity], many: bool) -> None:
    """Which mark is whose, where one trajectory was tracked in several videos."""
    from matplotlib.lines import Line2D

    if many or RESIDUAL not in shown or len(courses[0].residuals) < 2:
        return
    handles = [
        Line2D([], [], color=VIDEO_COLOURS[i % 4], marker=MARKS[i % 4], markersize=2.5, linewidth=0.6, label=one.video)
        for i, one in enumerate(courses[0].residuals)
    ]
    axes.legend(handles=handles, loc="upper right", frameon=False, fontsize=6.0, ncols=len(handles))
