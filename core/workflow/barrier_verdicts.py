# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether barriers are enough, in sentences: the evidence stands before what follows from it."""

from ..hazard.design import DesignValues, Verdict
from ..remarks import Remark


def verdict_remark(values: DesignValues, title: str) -> tuple[Verdict, Remark] | None:
    """Whether the barrier that stands at a screen is enough for what a model says, with the evidence.

    Parameters
    ----------
    title : of the model.
    """
    verdict, screen, share = values.verdict, values.screen, f"{100 * values.energy_j.share:g} %"
    if verdict is None:
        return None
    evidence = evidence_sentence(values)
    if verdict == "not_known":
        text = f"Whether {screen.name} is enough is not known yet with {title}: {more_words(values)}. {evidence}"
        return verdict, Remark(text, "warning", screen.name)
    if verdict == "not_enough":
        text = f"{screen.name} is not enough for {title}: {'; '.join(values.faults)}. {evidence}"
        return verdict, Remark(text, "problem", screen.name)
    asked = f"{values.needed_energy_j / 1000:.3g} kJ and {values.needed_height_m:.2f} m"
    has = f"{(screen.capacity_j or 0) / 1000:.4g} kJ and {screen.height_m:.4g} m"
    text = (
        f"{evidence} The upper ends of the {share} values ask for {asked}, and it has {has}: {screen.name} is enough "
        f"for what {title} says."
    )
    return verdict, Remark(text, "note", screen.name)


def evidence_sentence(values: DesignValues) -> str:
    """How many blocks come to a screen, from how many places, and how many independent ones they are worth."""
    text = f"{values.reach} of {values.blocks} blocks come to {values.screen.name}"
    if values.places == values.reach:
        return f"{text}."
    if values.released_from == 1:
        return f"{text}, all from one place of release: what others would give is not in the intervals."
    worth = min(values.energy_j.effective, values.height_m.effective)
    return (
        f"{text}, from {values.places} of {values.released_from} places of release: blocks from one place are alike, "
        f"and these are worth {worth:.0f} independent ones."
    )


def more_words(values: DesignValues) -> str:
    """What would tell what is not known yet."""
    more = values.more
    if more is None:
        return "no number of blocks tells" if not values.is_sample else "nothing more is needed"
    if more.elsewhere:
        return f"about {more.blocks} blocks from as many other places of release, as of an area, would tell"
    return f"about {more.blocks} more blocks would tell"
