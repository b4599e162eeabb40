# SPDX-License-Identifier: GPL-3.0-or-later
"""How many blocks are enough: until energy and height are known where it matters, at screens that blocks reach.

An area is a screen too: its outline, closed.
"""

from math import isfinite, isinf

import numpy as np

from ..hazard.design import KNOWN_TO, LEAST_DIFFERENT
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import ScreenHits, blocks_at
from ..impact_models.registry import find_model
from ..remarks import Remark
from ..simulation.convergence import Quantile, fewest, quantile, values_needed
from ..simulation.ground import Ground
from ..simulation.release import Releases
from .simulation import Scenario

NEARLY = 0.8
"""When a quantile is known this nearly as well as ever more blocks from the same places would make it, they end."""


def as_many_as(scenario: Scenario, ground: Ground, most: int) -> Releases:
    """The releases of a scenario, from each place as many times as many blocks as make `most` of them all."""
    releases = scenario.releases(ground)
    times = most // len(releases)
    if times < 2 or scenario.more_releases is None:
        return releases
    return scenario.more_releases(times)(ground)


def in_chance_order(releases: Releases, seed: int) -> Releases:
    """The same blocks in an order that chance makes: the first of them are like all, wherever they start."""
    return releases.take(np.random.default_rng([seed, 7]).permutation(len(releases)))


def known_values(hits: ScreenHits, share: float) -> tuple[Quantile, Quantile] | None:
    """Energy [J] and height [m] that a share of the blocks does not exceed; None where the blocks are no sample.

    hits : of one screen.
    """
    each = blocks_at(hits)
    there = np.isfinite(each.up_m)
    if not there.any() or np.unique(each.energy_j).size < LEAST_DIFFERENT * len(each):
        return None
    return quantile(each.energy_j, share, each.place), quantile(each.up_m[there], share, each.place[there])


def is_known(tally: ScreenTally, share: float) -> bool:
    """Whether energy and height are known at every screen that blocks reach, and they reach one.

    Known is to `KNOWN_TO`; or as well as further blocks would tell, where these cannot tell it so well.
    """
    return bool(tally.screens) and bool(found := _reached(tally, share)) and all(map(_is_settled, found.values()))


def enough_remarks(model: str, tally: ScreenTally, share: float) -> list[Remark]:
    """How many blocks it took, or that they were not enough, and where."""
    title = find_model(model).title
    percent = f"{100 * share:g} % values of energy and height"
    found = _reached(tally, share)
    if not found:
        text = f"No block of {tally.blocks} with {title} reaches a screen: how many are enough is not known."
        return [Remark(text, "warning", model)]
    remarks = [
        Remark(f"{tally.blocks} blocks with {title} are not enough at {name}: {why}.", "warning", name)
        for name, values in found.items()
        if (why := _why_not(values))
    ]
    if remarks:
        return remarks
    text = f"{tally.blocks} blocks with {title} are enough: {percent} are known to {100 * KNOWN_TO:g} %."
    return [Remark(text, "note", model)]


def _reached(tally: ScreenTally, share: float) -> dict[str, tuple[Quantile, Quantile] | None]:
    hits = tally.hits
    hits, found = hits.take(hits.reaches), {}
    for place, screen in enumerate(tally.screens):
        own = hits.take(hits.screen == place)
        if len(own):
            found[screen.name] = known_values(own, share)
    return found


def _times(one: Quantile) -> float:
    """As many times as many independent values would make it known; one or less when it is."""
    return (one.known_to / KNOWN_TO) ** 2 if isfinite(one.known_to) else fewest(one.share) / one.effective


def _is_settled(values: tuple[Quantile, Quantile] | None) -> bool:
    """Whether further blocks would not make it better known: it is, or it takes other places, or they are repeats."""
    return values is None or all(
        one.known_to <= KNOWN_TO or (_more_places(one) and one.effective >= NEARLY * one.most_effective)
        for one in values
    )


def _more_places(one: Quantile) -> bool:
    """Whether no number of blocks from the same places would make it known."""
    return isinf(values_needed(one, _times(one)))


def _why_not(values: tuple[Quantile, Quantile] | None) -> str:
    """Empty where the values are known."""
    if values is None:
        return "the same runs come again and again, since neither the model nor the releases leave anything to chance"
    energy, height = (one.known_to for one in values)
    if max(energy, height) <= KNOWN_TO:
        return ""
    if np.isfinite([energy, height]).all():
        why = f"the energy is known to {100 * energy:.2g} %, the height to {100 * height:.2g} %"
    else:
        why = f"too few come there for an interval, which takes {fewest(values[0].share)} that are independent"
    if any(_more_places(one) for one in values if one.known_to > KNOWN_TO):
        why += "; more blocks from the same places do not tell, release from more places or from an area"
    return why
