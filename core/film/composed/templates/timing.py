# SPDX-License-Identifier: GPL-3.0-or-later
"""How films map their seconds to those of a fall."""

import numpy as np

from ....errors import InputError
from ..falls import Fall
from ..film_clock import FilmClock, Freeze, Slow, film_clock
from ..material import Material

NICE_RATES = (4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
SLOW_PART = 0.5
"""Slow motion at an impact is by this part of the film's rate."""


def nice_rate(fall_s: float, film_s: float) -> float:
    """The rate that reads well at which so many seconds of the fall take about so many of the film."""
    return min(NICE_RATES, key=lambda rate: abs(np.log(rate * film_s / fall_s)))


def shown_clock(
    material: Material, fall: Fall, span_s: tuple[float, float], rate: float, stops: tuple[int, ...] = ()
) -> FilmClock:
    """The clock of a stretch, slowed down and stopped at impacts of a block, as asked or as the film does."""
    request, (begin_s, end_s) = material.request, span_s
    rate = request.rate or rate
    stops = stops if request.slow_at is None else request.slow_at
    times = hit_times(fall, stops, material)
    slow = [Slow(time, SLOW_PART * rate) for time in times]
    return film_clock(begin_s, end_s, rate=rate, slow=slow, freezes=[Freeze(time, request.freeze_s) for time in times])


def lasting_clock(
    material: Material, fall: Fall, span_s: tuple[float, float], film_s: float, stops: tuple[int, ...]
) -> FilmClock:
    """The clock with stops whose film lasts about so long, of those whose rates read well."""
    clocks = [shown_clock(material, fall, span_s, rate, stops) for rate in NICE_RATES]
    return min(clocks, key=lambda clock: abs(np.log(clock.duration_s / film_s)))


def hit_times(fall: Fall, impacts: tuple[int, ...], material: Material) -> list[float]:
    """Moments of some impacts [s].

    Raises
    ------
    InputError : there is no such impact.
    """
    if not impacts:
        return []
    numbers = [] if fall.hits is None else fall.hits.number.tolist()
    wrong = [impact for impact in impacts if impact not in numbers]
    if wrong or fall.hits is None:
        raise InputError(
            f"Trajectory {fall.name} has no impact {wrong[0] if wrong else impacts[0]}", file=material.request.project,
            advice=f"Its impacts: {numbers[0]} to {numbers[-1]}" if numbers else "It has no impacts",
        )  # fmt: skip
    return [float(fall.hits.time_s[numbers.index(impact)]) for impact in impacts]


def hardest(fall: Fall, most: int, begin_s: float = -np.inf, end_s: float = np.inf) -> tuple[int, ...]:
    """The impacts of the greatest energy in a stretch of time, of those whose numbers are known, in order."""
    if fall.hits is None:
        return ()
    hits = fall.hits
    energy = np.where((hits.time_s > begin_s) & (hits.time_s < end_s) & np.isfinite(hits.rn), hits.energy1_j, np.nan)
    known = np.flatnonzero(np.isfinite(energy))
    best = known[np.argsort(-energy[known], kind="stable")[:most]]
    return tuple(int(number) for number in hits.number[np.sort(best)])
