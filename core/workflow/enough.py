# SPDX-License-Identifier: GPL-3.0-or-later
"""How many blocks are enough: until energy and height are known where it matters, at screens that blocks reach.

An area is a screen too: its outline, closed.
"""

import numpy as np

from ..hazard.design import LEAST_DIFFERENT
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import ScreenHits
from ..impact_models.registry import find_model
from ..remarks import Remark
from ..simulation.convergence import Quantile, quantile
from ..simulation.release import Releases

KNOWN_TO = 0.05
"""Blocks are enough when half the interval of a value is less than this part of it."""


def in_chance_order(releases: Releases, seed: int) -> Releases:
    """The same blocks in an order that chance makes: the first of them are like all, wherever they start."""
    return releases.take(np.random.default_rng([seed, 7]).permutation(len(releases)))


def known_values(hits: ScreenHits, share: float) -> tuple[Quantile, Quantile] | None:
    """Energy [J] and height [m] that a share of the hits does not exceed; None where the hits are no sample."""
    height = hits.up_m[np.isfinite(hits.up_m)]
    if not height.size or np.unique(hits.energy_j).size < LEAST_DIFFERENT * len(hits):
        return None
    return quantile(hits.energy_j, share), quantile(height, share)


def is_known(tally: ScreenTally, share: float) -> bool:
    """Whether energy and height are known to `KNOWN_TO` at every screen that blocks reach, and they reach one."""
    return bool(tally.screens) and bool(found := _reached(tally, share)) and not any(map(_why_not, found.values()))


def enough_remarks(model: str, tally: ScreenTally, share: float) -> list[Remark]:
    """How many blocks it took, or that they were not enough, and where."""
    title = find_model(model).title
    percent = f"{100 * share:g} % values of energy and height"
    if is_known(tally, share):
        text = f"{tally.blocks} blocks with {title} are enough: {percent} are known to {100 * KNOWN_TO:g} %."
        return [Remark(text, "note", model)]
    found = _reached(tally, share)
    if not found:
        text = f"No block of {tally.blocks} with {title} reaches a screen: how many are enough is not known."
        return [Remark(text, "warning", model)]
    return [
        Remark(f"{tally.blocks} blocks with {title} are not enough at {name}: {why}.", "warning", name)
        for name, values in found.items()
        if (why := _why_not(values))
    ]


def _reached(tally: ScreenTally, share: float) -> dict[str, tuple[Quantile, Quantile] | None]:
    hits = tally.hits
    hits, found = hits.take(hits.reaches), {}
    for place, screen in enumerate(tally.screens):
        own = hits.take(hits.screen == place)
        if len(own):
            found[screen.name] = known_values(own, share)
    return found


def _why_not(values: tuple[Quantile, Quantile] | None) -> str:
    """Empty where the values are known."""
    if values is None:
        return "the same runs come again and again, since neither the model nor the releases leave anything to chance"
    energy, height = (one.known_to for one in values)
    if max(energy, height) <= KNOWN_TO:
        return ""
    if not np.isfinite([energy, height]).all():
        return "too few come there for an interval"
    return f"the energy is known to {100 * energy:.2g} %, the height to {100 * height:.2g} %"
