# SPDX-License-Identifier: GPL-3.0-or-later
"""What the numbers of a fit mean, in plain words; above all when the data cannot tell."""

from collections.abc import Iterator, Sequence
from math import inf

from ..impact_models.machinery.parameters import ParameterSpec
from ..remarks import Remark

AT_LIMIT = 2e-3
"""Of the range: a value so near to its end is at the end."""
TOO_WIDE = 0.5
"""Of the range: an interval that covers more says nothing."""
TIGHT, FAIR = 0.10, 0.30
"""Half the interval, relative to the value."""
TOGETHER = 0.9
"""Correlation from which two parameters cannot be told apart."""
EXACT = 1e-5
"""Of the range: an interval that is narrower is no more than the rounding of the descent."""
CLEAR = 0.95
"""Level of the interval of a difference that must not hold zero, for the difference to count."""


def about_number(
    spec: ParameterSpec,
    default: float,
    value: float,
    ends: tuple[float, float],
    places: tuple[float, float, float],
    idle: bool,
    correlations: Sequence[tuple[str, float]],
) -> Iterator[Remark]:
    """About one fitted number; a problem where the data cannot tell it.

    Parameters
    ----------
    ends : the 95 % interval, in the parameter's unit.
    places : the value and its interval as parts of the range, 0…1.
    idle : whether the parameter has no effect on any of these impacts.
    correlations : (other parameter, correlation).
    """
    name = spec.name
    if idle:
        text = "The data cannot tell: it has no effect on these impacts with these settings; left at its default."
        yield Remark(text, "problem", name)
        return
    place, low, high = places
    wide, exact = high - low > TOO_WIDE, high - low <= EXACT
    at_end = place < AT_LIMIT or place > 1 - AT_LIMIT
    if wide:
        text = f"The data cannot tell: the interval covers {100 * (high - low):.0f} % of the range."
        yield Remark(text, "problem", name)
    elif not at_end:
        yield Remark(_width(value, ends, exact), "note", name)
    if at_end:
        which = "lower" if place < AT_LIMIT else "upper"
        text = f"It ended at the {which} limit of its range, {value:g}: the best value may lie beyond."
        yield Remark(text, "warning", name)
    for other, correlation in correlations if not exact else ():
        if abs(correlation) >= TOGETHER:
            text = f"It moves with {other} (correlation {correlation:+.2f}): only the pair is determined."
            yield Remark(text, "warning", name)
    if not wide:
        slack = EXACT * (spec.maximum - spec.minimum)
        same = ends[0] - slack <= default <= ends[1] + slack
        text = (
            f"Not clearly different from the default {default:g}." if same else f"The default {default:g} lies outside."
        )
        yield Remark(text, "note", name)


def _width(value: float, ends: tuple[float, float], exact: bool) -> str:
    if exact:
        return "Determined exactly, as by outcomes without any scatter."
    half = (ends[1] - ends[0]) / 2
    relative = half / abs(value) if value else float("inf")
    if relative <= TIGHT:
        return f"Well determined, to ±{100 * relative:.2g} %."
    if relative <= FAIR:
        return f"Fairly determined, to ±{100 * relative:.0f} %."
    return f"Only roughly determined: anything from {ends[0]:.3g} to {ends[1]:.3g} fits about as well."


def clear_errors(clusters: int) -> float:
    """Standard errors from which a difference counts: Student's t of clusters − 1; infinite with one.

    >>> round(clear_errors(5), 2), round(clear_errors(60), 2)
    (2.78, 2.0)
    """
    from scipy import stats

    return float(stats.t.ppf((1 + CLEAR) / 2, clusters - 1)) if clusters > 1 else inf


def about_choice(name: str, value: str, rival: str, gain: float, error: float, clusters: int) -> Remark:
    """About the choice that won over the best of the others by a mean score, with its standard error over clusters."""
    if abs(gain) < 1e-12:
        return Remark(f"The data cannot tell: {rival} fits exactly as well.", "problem", name)
    if not gain >= clear_errors(clusters) * error:
        text = f"The data cannot tell: {rival} fits about as well (score {gain:.3f} ± {error:.3f} more)."
        return Remark(text, "problem", name)
    return Remark(f"{value} fits clearly better than {rival} (score {gain:.3f} ± {error:.3f} less).", "note", name)


def about_holdout(default: float, held_out: float, gain: float, error: float, better: int, clusters: int) -> Remark:
    """Whether the fit helps on what it has not seen."""
    if not default:
        return Remark("The defaults already agree exactly.", "note", "hold-out")
    where, share = f"better in {better} of {clusters}", f"{100 * abs(gain) / default:.0f} %"
    seen = "On impacts it was not fitted to, the"
    if gain > clear_errors(clusters) * error:
        return Remark(f"{seen} model is {share} nearer than with its defaults ({where}).", "note", "hold-out")
    if gain < -clear_errors(clusters) * error:
        text = f"{seen} model is {share} farther than with its defaults: keep the defaults."
        return Remark(text, "warning", "hold-out")
    text = f"{seen} fit is not clearly better than the defaults (score {held_out:.3f} against {default:.3f}, {where})."
    return Remark(text, "warning", "hold-out")


def about_use(score: float, blind: float, *, chance: bool) -> Remark:
    """Whether the model knows anything at all about these impacts."""
    guess = "drawing one of the measured outcomes at random" if chance else "one and the same outcome for all impacts"
    if score >= blind:
        text = f"Beware: with a score of {score:.3f} the model is no better than {guess} ({blind:.3f})."
        return Remark(text, "warning", "score")
    text = (
        f"The model is {100 * (1 - score / blind):.0f} % nearer than {guess} (score {score:.3f} against {blind:.3f})."
    )
    return Remark(text, "note", "score")


def about_likeness(distance: float, scatter: float, rms: tuple[float, float, float]) -> Remark:
    """How alike two models get: their distance beside the scatter of outcomes from impact to impact (both scaled)."""
    amounts = f"v_N2 to {rms[0]:.2g} m/s, v_T2 to {rms[1]:.2g} m/s, deviation to {rms[2]:.2g}° on average"
    share = distance / scatter if scatter else float(distance > 0)
    if share < 0.01:
        return Remark(f"The two behave the same on these impacts ({amounts}).", "note", "likeness")
    if share < 0.1:
        return Remark(f"The two behave nearly alike ({amounts}).", "note", "likeness")
    if share < 0.4:
        text = f"The two behave somewhat alike ({amounts}): similar trends, visible differences."
        return Remark(text, "note", "likeness")
    text = f"The two stay different ({amounts}): no parameters among those fitted make one stand for the other."
    return Remark(text, "warning", "likeness")
