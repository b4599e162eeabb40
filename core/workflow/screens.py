# SPDX-License-Identifier: GPL-3.0-or-later
"""What passes screens, said in sentences."""

from collections.abc import Mapping, Sequence

from ..hazard.design import design_of
from ..hazard.screen_tally import Known, ScreenFigures, ScreenTally
from ..hazard.screens import HELD, OUTCOMES, OVER, THROUGH, Screen
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..remarks import Remark
from ..simulation.convergence import fewest
from ..simulation.coverage import check_lines
from ..simulation.engine import Simulation
from ..simulation.ground import Ground
from .barrier_verdicts import verdict_remark


def tallies_of(
    simulations: Sequence[Simulation], screens: Sequence[Screen], progress: Progress = silent
) -> dict[str, ScreenTally]:
    """Model → what passes the screens in simulations that recorded all; empty without screens."""
    tallies = {}
    for place, simulation in enumerate(simulations if screens else ()):
        progress("Looking at the screens", place, len(simulations))
        tallies[simulation.settings.model] = tally = ScreenTally(screens)
        tally.add(simulation)
    return tallies


def outside_remarks(screens: Sequence[Screen], ground: Ground) -> tuple[Remark, ...]:
    """How the screens' files were read, and which screens are partly outside of the terrain; see `check_screens`."""
    lines, names = [screen.line for screen in screens], [screen.name for screen in screens]
    read = dict.fromkeys(remark for screen in screens for remark in screen.remarks)
    return (*read, *check_lines(ground.terrain, lines, names, "screen", "no block is seen there", refuse=False))


def screen_remarks(tallies: Mapping[str, ScreenTally]) -> tuple[Remark, ...]:
    """Of each model and screen: how many blocks come, how fast, how high, and what barriers hold.

    Parameters
    ----------
    tallies : model → what passes the screens.
    """
    remarks = []
    for model, tally in tallies.items():
        without, after = tally.figures(), tally.figures(with_barriers=True)
        for values in design_of(tally).values():
            verdict = verdict_remark(values, find_model(model).title)
            remarks += [] if verdict is None else [verdict[1]]
        for figures, behind in zip(without, after, strict=True):
            remarks += _remarks_of_one(model, figures, behind)
    if any(screen.holds for tally in tallies.values() for screen in tally.screens):
        text = (
            "What barriers hold is told in hits.csv and screens.csv; the other tables are of the runs without them. "
            "Whether they are enough is told of the 95 % values without partial factors: rockfall design has these."
        )
        remarks.append(Remark(text, "note", "screens"))
    return tuple(remarks)


def _remarks_of_one(model: str, figures: ScreenFigures, behind: ScreenFigures) -> list[Remark]:
    name, n, title = figures.screen.name, figures.reach, find_model(model).title
    if not n:
        return [Remark(f"No block with {title} comes to {name}.", "warning", name)]
    text = f"{n} of {figures.blocks} blocks with {title} come to {name} ({100 * figures.share:.3g} %)"
    if figures.speed_mps and figures.energy_j:
        text += f"; 95 % values: speed {_value(figures.speed_mps)} m/s, energy {_value(figures.energy_j, 1e-3)} kJ"
    if figures.height_m:
        text += f", height of the centre {_value(figures.height_m)} m"
    remarks = [Remark(f"{text}.", "note", name)]
    known = [one.quantile(0.95) for one in (figures.energy_j, figures.height_m) if one is not None]
    if any(one.high != one.high for one in known):
        worth = min(one.effective for one in known)
        text = (
            f"{n} block{'s' if n > 1 else ''} with {title} at {name}, worth {worth:.0f} independent ones, "
            f"{'are' if n > 1 else 'is'} too few for an upper bound of the 95 % values, which takes {fewest(0.95)}."
        )
        remarks.append(Remark(text, "warning", name))
    if figures.screen.holds:
        counts = [behind.outcomes[OUTCOMES[place]] for place in (HELD, OVER, THROUGH)]
        text = (
            f"{name} holds {counts[0]} of the {behind.hits} hits with {title}; {counts[1]} go over it, {counts[2]} "
            "through."
        )
        remarks.append(Remark(text, "note", name))
    elif behind.reach < n:
        text = f"With the barriers {behind.reach} blocks with {title} come to {name}, without them {n}."
        remarks.append(Remark(text, "note", name))
    return remarks


def _value(known: Known, factor: float = 1.0) -> str:
    q95 = known.quantile(0.95)
    low, high = (f"{factor * end:.3g}" if end == end else "?" for end in (q95.low, q95.high))
    return f"{factor * q95.value:.3g} ({low} to {high})"
