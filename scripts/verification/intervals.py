# SPDX-License-Identifier: GPL-3.0-or-later
"""How often the intervals of 95 % values hold the truth, where blocks of one place of release are alike."""

from collections.abc import Callable
from math import isfinite
from pathlib import Path

import numpy as np
from checks import paragraph
from numpy.typing import NDArray
from rockfall.core.hazard.design import KNOWN_TO
from rockfall.core.simulation.convergence import fewest, quantile
from rockfall.core.workflow.enough import NEARLY
from scipy import optimize, stats

TITLE = "Intervals of 95 % values"
SUMMARY = (
    "how often they hold the truth, where blocks of one place of release are alike, and how often a verdict is wrong"
)
SHARE = 0.95
DRAWS, FALLS = 1000, 400
CASES = ((15, 20), (15, 200), (60, 10), (300, 3))
"""Places of release, and blocks that come from each on average."""
ALIKE = (0.0, 0.1, 0.3, 0.7)

type Values = NDArray[np.float64]
type Draw = Callable[[np.random.Generator, NDArray[np.intp], int, float], Values]


def _normal(rng: np.random.Generator, own: NDArray[np.intp], places: int, alike: float) -> Values:
    """The places differ in their mean: all together are normal, 10 ± 1."""
    return 10 + np.sqrt(alike) * rng.normal(size=places)[own] + np.sqrt(1 - alike) * rng.normal(size=own.size)


def _scaled(rng: np.random.Generator, own: NDArray[np.intp], places: int, alike: float) -> Values:
    """The places differ in their scale: exponential, times a lognormal one of each place."""
    return np.exp(alike * rng.normal(size=places))[own] * rng.exponential(size=own.size)


def _true_normal(_: float) -> float:
    return 10 + float(stats.norm.ppf(SHARE))


def _true_scaled(alike: float) -> float:
    """Where ∫ φ(z) (1 − exp(−q e^(−s z))) dz is the share, by Gauss and Hermite."""
    z, weight = np.polynomial.hermite_e.hermegauss(80)
    weight /= weight.sum()
    return float(optimize.brentq(lambda q: weight @ -np.expm1(-q * np.exp(-alike * z)) - SHARE, 0.1, 100.0))


LAWS: dict[str, tuple[Draw, Callable[[float], float]]] = {
    "means differ": (_normal, _true_normal),
    "scales differ": (_scaled, _true_scaled),
}


def page(_: Path) -> str:
    """The chapter as Markdown."""
    lines = [
        f"# {TITLE}",
        "",
        *paragraph(
            "Values of blocks from known laws, in which the places of release differ: in their mean (normal; *alike* "
            "is the part of the variance that is between the places) or in their scale (exponential times lognormal; "
            "*alike* is the standard deviation of its logarithm). The true 95 % value is in closed form or integrated. "
            "An interval at 95 % should hold it in 95 % of all draws, and its upper end should be below it in 2.5 %. "
            "*Plain* is the same interval as if all blocks were independent."
        ),
        "",
        "| law | places | blocks each | alike | holds it | upper end too low | has an upper end | plain holds it |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for law in LAWS:
        for places, each in CASES:
            for alike in ALIKE:
                held, low, there, plain = _coverage(law, places, each, alike)
                lines.append(
                    f"| {law} | {places} | {each} | {alike:g} | {100 * held:.1f} % | {100 * low:.1f} % | "
                    f"{100 * there:.0f} % | {100 * plain:.1f} % |"
                )
    lines += [
        "",
        *paragraph(
            f"An upper end takes {fewest(SHARE)} independent values. Few places that differ much seldom have one, and "
            "then in those draws in which the places happen to look alike: of these it is too low more often than in "
            "2.5 %, but not of all draws."
        ),
        "",
        "## Blocks that fall until it is known",
        "",
        *paragraph(
            "Asked after 200, 400, 800 … blocks at the screen, until the value is known to "
            f"{100 * KNOWN_TO:g} % or to {NEARLY:g} of what the places can tell, at most 12 800. The barrier has 1 % "
            "less than the true value: *enough* is wrong, and should be said in less than 2.5 % of all falls. To ask "
            "several times costs some of that."
        ),
        "",
        "| law | places | alike | wrongly enough | blocks, median |",
        "|---|---|---|---|---|",
    ]
    for law in LAWS:
        for places, alike in ((15, 0.0), (15, 0.3), (100, 0.1), (100, 0.3), (0, 0.0)):
            wrong, blocks = _stopped(law, places, alike)
            lines.append(f"| {law} | {places or 'each its own'} | {alike:g} | {100 * wrong:.1f} % | {blocks:.0f} |")
    lines += ["", *paragraph("Written by `scripts/verification/intervals.py`; the same seeds give the same draws.")]
    return "\n".join(lines) + "\n"


def _coverage(law: str, places: int, each: int, alike: float) -> tuple[float, float, float, float]:
    """Shares of draws: the interval holds the truth, its upper end is too low, there is one, the plain one holds it."""
    draw, true = LAWS[law]
    truth, rng = true(alike), np.random.default_rng([places, each, int(100 * alike), len(law)])
    found = np.zeros((DRAWS, 4))
    for row in found:
        own = np.repeat(np.arange(places), rng.poisson(each, places))
        values = draw(rng, own, places, alike)
        known, plain = quantile(values, SHARE, own), quantile(values, SHARE)
        low = known.high < truth
        row[:] = (
            not low and not known.low > truth,
            low,
            isfinite(known.high),
            not plain.high < truth and not plain.low > truth,
        )
    held, low, there, plainly = found.mean(axis=0).tolist()
    return held, low, there, plainly


def _stopped(law: str, places: int, alike: float) -> tuple[float, float]:
    """Share of falls that end with a wrong "enough", and the median number of blocks at the screen."""
    draw, true = LAWS[law]
    limit, rng = 0.99 * true(alike), np.random.default_rng([places, int(100 * alike), len(law), 1])
    most, wrong, blocks = 12_800, 0, []
    for _ in range(FALLS):
        own = rng.integers(0, places, most) if places else np.arange(most)
        values = draw(rng, own, places or most, alike)
        n = 200
        while True:
            known = quantile(values[:n], SHARE, own[:n])
            if n == most or known.known_to <= KNOWN_TO or known.effective >= NEARLY * known.most_effective:
                break
            n *= 2
        wrong += known.high <= limit
        blocks.append(n)
    return wrong / FALLS, float(np.median(blocks))
