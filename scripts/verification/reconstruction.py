# SPDX-License-Identifier: GPL-3.0-or-later
"""How near reconstruction from footage comes to the truth over the whole range of geometry, and when it says so.

One thing at a time is changed from a usual footage. The falls, the footage and the noise are those of
`scripts/benchmarks/refinement.py`, which shares nothing with what it measures but the camera model.
"""

import csv
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from checks import paragraph

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

from refinement import AIR, CAMERA, MAGNUS, ROCK_DRAG, SHUTTER, TERRAIN, Case, Pairs, Wrong, measure
from synthetic_falls import NONE, Air, fall, rough_slope

TITLE = "Accuracy of reconstruction"
SUMMARY = "errors, intervals and failures over views, geometry, noise, and wrong inputs"
FALLS, SEED = 40, 1
LARGE = 0.10
"""A fall fails when one of its speeds is off by more than this part."""
AZIMUTHS = (0, 15, 30, 45, 60, 70, 80, 90)
SECOND = ("other solution",)
USUAL = Case("usual", 3840, 2160, 30.0, 150.0, 1, wrong=Wrong(cause=SECOND))


@dataclass(frozen=True)
class Group:
    """Cases in which one thing changes."""

    title: str
    words: str
    cases: tuple[Case, ...]


def _cases(*rows: tuple[str, dict]) -> tuple[Case, ...]:
    return tuple(replace(USUAL, name=name, **changes) for name, changes in rows)


def _wrong(name: str, cause: tuple[str, ...], views: int = 1, **what: object) -> tuple[str, dict]:
    return name, {"views": views, "wrong": Wrong(cause=cause, **what)}  # type: ignore[arg-type]


GROUPS = (
    Group(
        "Views", "Cameras 60–90° apart, with clocks that differ by up to 50 ms.",
        _cases(("one", {}), ("two", {"views": 2}), ("three", {"views": 3})),
    ),
    Group(
        "Direction of view", "Angle in plan between the camera's direction and the fall line: 0° looks up the slope, "
        "90° along it, where rays graze the humps that hide the contact.",
        _cases(*((f"{low}–{low + 10}°", {"azimuth_deg": (low, low + 10.0)}) for low in AZIMUTHS)),
    ),
    Group(
        "Distance", "With a lens such that the fall fills 70 % of the picture each time.",
        _cases(*((f"{far:g} m", {"distance_m": float(far)}) for far in (50, 150, 300, 600))),
    ),
    Group(
        "Lens", "Part of the picture's tighter side that the fall fills: a longer lens fills more.",
        _cases(*((f"{100 * fill:.0f} %", {"fill": fill}) for fill in (0.15, 0.3, 0.5, 0.7))),
    ),
    Group(
        "Pictures a second", "",
        _cases(*((f"{rate:g} Hz", {"rate_hz": float(rate)}) for rate in (10, 15, 30, 60, 120))),
    ),
    Group(
        "Pixels", "",
        _cases(("1280 × 720", {"width": 1280, "height": 720}), ("1920 × 1080", {"width": 1920, "height": 1080}),
               ("3840 × 2160", {})),
    ),
    Group(
        "The camera's own accuracy", "Pairs of pixels and points from which it was solved.",
        _cases(("20 pairs of 1 px, 2 cm", {}), ("12 pairs of 1.5 px, 3 cm", {"pairs": Pairs(12, 1.5, 0.03)}),
               ("8 pairs of 3 px, 10 cm", {"pairs": Pairs(8, 3.0, 0.1)}),
               ("20 pairs, focal length solved too", {"pairs": Pairs(free=("f",))})),
    ),
    Group(
        "Colour of the tracker's noise", "Correlation from one frame to the next.",
        _cases(*((f"{memory:g}", {"memory": memory}) for memory in (0.0, 0.5, 0.9, 0.97)),
               ("0.9, two views", {"memory": 0.9, "views": 2})),
    ),
    Group(
        "What the program is not told, or told wrongly", "Nothing in the input gives it away.",
        _cases(
            _wrong("terrain wrong by 5 cm, not stated", TERRAIN, terrain_m=0.05),
            _wrong("terrain wrong by 20 cm, not stated", TERRAIN, terrain_m=0.2),
            _wrong("terrain wrong by 20 cm, not stated, two views", TERRAIN, 2, terrain_m=0.2),
            _wrong("terrain 20 cm too high, not stated", TERRAIN, raised_m=0.2),
            _wrong("camera 0.3 m too high, no covariance", CAMERA, lifted_m=0.3),
            _wrong("rolling shutter of 10 ms", SHUTTER, readout_s=0.01),
            _wrong("rolling shutter of 20 ms", SHUTTER, readout_s=0.02),
            _wrong("rolling shutter of 30 ms", SHUTTER, readout_s=0.03),
            _wrong("rolling shutter of 20 ms, two views", SHUTTER, 2, readout_s=0.02),
            _wrong("drag of rock not modelled", AIR, air=Air(drag_per_m=ROCK_DRAG)),
            _wrong("Magnus force", AIR, air=Air(lift_per_s=MAGNUS)),
            _wrong("Magnus force, two views", AIR, 2, air=Air(lift_per_s=MAGNUS)),
        ),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What came out of one case.

    Attributes
    ----------
    median, tail : median of the relative errors of speeds, and what 95 % of them are below.
    bound : median of errors with the Cramér–Rao bound; NaN where it is not defined.
    coverage : share of speeds within their 95 % interval.
    failed : share of falls with a speed off by more than `LARGE`.
    said : share of falls with the warning that names the cause, of the failed ones as `said_failed` (NaN without any).
    """

    median: float
    tail: float
    bound: float
    coverage: float
    failed: float
    said: float
    said_failed: float


@cache
def _falls(count: int, air: Air) -> tuple:
    rng = np.random.default_rng(SEED)
    surface = rough_slope(rng)
    return surface, [fall(surface, rng, air) for _ in range(count)]


def measured(case: Case, count: int = FALLS) -> Row:
    """Film and refine `count` falls."""
    surface, falls = _falls(count, case.wrong.air)
    tallies = [measure(case, surface, [one], SEED + 100 + i) for i, one in enumerate(falls)]
    errors = np.abs(np.concatenate([tally.refined for tally in tallies]))
    least = np.concatenate([tally.best for tally in tallies])
    failed = np.array([np.max(np.abs(tally.refined)) > LARGE for tally in tallies])
    said = np.array([tally.named[0] for tally in tallies])
    drawn = np.abs(np.random.default_rng(0).normal(size=(200, least.size)) * least)
    return Row(
        median=float(np.median(errors)),
        tail=float(np.quantile(errors, 0.95)),
        bound=np.nan if case.pairs.free or case.wrong.air != NONE else float(np.median(drawn)),
        coverage=float(np.mean(np.concatenate([tally.speed_hits for tally in tallies]))),
        failed=float(failed.mean()),
        said=float(said.mean()),
        said_failed=float(said[failed].mean()) if failed.any() else np.nan,
    )


def page(folder: Path) -> str:
    """The chapter as Markdown, with reconstruction.csv beside it; a quarter of an hour on two cores."""
    cases = [(group.title, case) for group in GROUPS for case in group.cases]
    with ProcessPoolExecutor(os.process_cpu_count(), mp_context=get_context("spawn")) as pool:
        rows = dict(zip(cases, pool.map(measured, [case for _, case in cases]), strict=True))
    with (folder / "reconstruction.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["group", "case", *vars(next(iter(rows.values())))])
        writer.writerows([[group, case.name, *(f"{value:.4f}" for value in vars(row).values())]
                          for (group, case), row in rows.items()])  # fmt: skip
    lines = [
        f"# {TITLE}",
        "",
        *paragraph(
            f"{FALLS} synthetic falls of 6 to 10 contacts each, 4 to 17 m/s, down a rough slope of 38°. Usual footage: "
            "one view of 4K at 30 pictures a second from 150 m, seen 45–60° from the fall line, held by hand and "
            "stabilised, solved from 20 pairs; contacts marked to 3 px at whole frames, the block tracked to 1.5 px. "
            "One thing is changed at a time."
        ),
        "",
        *paragraph(
            "Errors are those of speeds before and after impacts, relative to the true ones; the bound is that of "
            "Cramér and Rao for all that is unknown; *within* is the share of true speeds inside the stated 95 % "
            f"interval; a fall *fails* when one of its speeds is off by more than {LARGE:.0%}; *said* is the share of "
            "falls with a warning of other solutions that fit alike, or of the cause where something is wrong, and the "
            "same of the falls that fail. Shares of falls are known to ± 8 % at worst, those of speeds to ± 3 %."
        ),
    ]
    for group in GROUPS:
        lines += ["", f"## {group.title}", ""]
        lines += [*paragraph(group.words), ""] if group.words else []
        lines += ["| | median error | bound | 95 % below | within | fails | said | of the failed |", "|---" * 8 + "|"]
        lines += [_line(case.name, rows[group.title, case]) for case in group.cases]
    lines += ["", "Written by `scripts/verification/reconstruction.py`; the numbers are in `reconstruction.csv`."]
    return "\n".join(lines) + "\n"


def _line(name: str, row: Row) -> str:
    def percent(value: float, digits: int = 0) -> str:
        return "–" if np.isnan(value) else f"{100 * value:.{digits}f} %"

    cells = [percent(row.median, 2), percent(row.bound, 2), percent(row.tail, 1), percent(row.coverage)]
    cells += [percent(row.failed), percent(row.said), percent(row.said_failed)]
    return "| " + " | ".join([name, *cells]) + " |"
