# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated blocks in a film: how many there may be, how long the film waits for them, and what its legend says."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..impact_models.machinery.base import ImpactModel
from ..vectors import Array, Mask

NUMBER = 20
"""Simulated blocks for each measured one and model, where no number is given."""
MOST_BLOCKS = 50_000
"""More would hide each other, and each frame would take minutes."""
LONGEST_WAIT_S = 60.0
"""A film goes on for so long at most after the last measured block [s]; it says how many simulated ones still move."""


@dataclass(frozen=True, eq=False)
class Group:
    """Blocks that have one colour in a film.

    Attributes
    ----------
    name : for the legend.
    colour : sRGB.
    end_s : (n,) display time at which each block's motion ends [s].
    stopped : (n,) whether it is at rest then.
    left, lost : how many of the others have left the terrain, or were lost from sight; the rest was cut off in motion.
    """

    name: str
    colour: tuple[float, float, float]
    end_s: Array
    stopped: Mask
    left: int = 0
    lost: int = 0


@dataclass(frozen=True, eq=False)
class LegendEntry:
    """A colour in a film's legend: a name, and below it a text with a number that is another one at each moment.

    Attributes
    ----------
    name : whose blocks they are.
    colour : sRGB.
    text, unit : before and after the number.
    counts : (q,) the number at each moment; None for the name alone.
    """

    name: str
    colour: tuple[float, float, float]
    text: str = ""
    counts: Array | None = None
    unit: str = ""


def check_number(number: int, models: int, releases: int = 1) -> None:
    """Refuse a number of simulated blocks that cannot be shown.

    Raises
    ------
    InputError : none, or too many.
    """
    if number < 1:
        raise InputError(
            f"{number} simulated blocks for each measured one are none to show", advice="Give --number 1 or more"
        )
    total = number * models * releases
    if total > MOST_BLOCKS:
        raise InputError(
            f"{total} simulated blocks are too many for a film, which shows up to {MOST_BLOCKS}",
            advice=f"Give --number {max(MOST_BLOCKS // (models * releases), 1)} or less",
        )


def group_name(model: ImpactModel) -> str:
    """What the legend calls a model's blocks: without chance, those from one start fall as one."""
    return model.title if model.is_random else f"{model.title}, without chance"


def path_opacity(paths: int) -> float:
    """Part of what is behind it that each simulated path hides: many must not hide the slope, and few must show."""
    return float(np.clip(3.5 / np.sqrt(max(paths, 1)), 0.04, 0.7))


def last_moment(measured_end_s: float, groups: Sequence[Group]) -> float:
    """Display time at which the last block that is shown ends, or at which the film waits no longer [s]."""
    ends = [float(group.end_s.max(initial=0.0)) for group in groups]
    return min(max([measured_end_s, *ends]), measured_end_s + LONGEST_WAIT_S)


def legend(measured: Group, simulated: Sequence[Group], moments_s: Array, final_s: float) -> tuple[LegendEntry, ...]:
    """The legend, the measured blocks first.

    Parameters
    ----------
    moments_s : (q,) display times at which the numbers are asked for.
    final_s : when the film's last block ends.
    """
    return _entry(measured, "", moments_s, final_s), *(
        _entry(group, "simulated: ", moments_s, final_s) for group in simulated
    )


def stopped_by(group: Group, moments_s: Array) -> Array:
    """(q,) how many blocks of a group are at rest at each moment."""
    return np.searchsorted(np.sort(group.end_s[group.stopped]), moments_s + 1e-9, side="right").astype(np.float64)


def _entry(group: Group, words: str, moments_s: Array, final_s: float) -> LegendEntry:
    n = len(group.end_s)
    text = f"{words}{n} block{'' if n == 1 else 's'}, {_fate(group, final_s)}"
    return LegendEntry(group.name, group.colour, text, stopped_by(group, moments_s), " stopped")


def _fate(group: Group, final_s: float) -> str:
    """What becomes of the blocks that never stop."""
    moving = int(np.count_nonzero(group.stopped & (group.end_s > final_s + 1e-9)))
    cut = int(np.count_nonzero(~group.stopped)) - group.left - group.lost
    numbers = (
        (group.left, "leaves the terrain", "leave the terrain"),
        (group.lost, "goes out of sight", "go out of sight"),
        (cut, "is cut off", "are cut off"),
        (moving, "moves on", "move on"),
    )
    return "".join(f"{number} {one if number == 1 else more}, " for number, one, more in numbers if number)
