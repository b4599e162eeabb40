# SPDX-License-Identifier: GPL-3.0-or-later
"""An impact in words: what its card says, and what its flags mean."""

import math

import bpy

from ...core.reconstruction.intervals import in_words
from ...core.reconstruction.summary import MEANINGS
from ..scene.picks import impact_marks, impact_numbers, pick_names, spins
from ..scene.storage import store

FLAG_WORDS = {
    "first": "First of its chain: no incident velocity",
    "last": "Last of its chain: no restituted velocity",
    "departing": "Leaves the ground before it touches it: no coefficients",
    "into_ground": "Goes on into the ground",
    "below_terrain": "Beside a flight that passes under the terrain",
    "gap": "The chain is cut here (shattered or discarded)",
    "contact": "Rolls or slides before or after it",
    "doubtful": "Marked as doubtful",
    "shattered": "The block shatters here",
    "discarded": "Discarded: not used",
}
MORE_DIGITS = 2
TOO_FAST = "R over 1: faster after the impact than before it"


def title(pick: bpy.types.Object) -> str:
    """Which pick it is, and when."""
    return f"{pick[store.TRAJECTORY]}, {name(pick)}, {pick[store.TIME]:.3f} s"


def name(pick: bpy.types.Object) -> str:
    """What it is called within its trajectory."""
    number = impact_numbers.one(pick, "number")
    return pick_names.word(pick) if math.isnan(number) else f"impact {number:.0f}"


def numbers(pick: bpy.types.Object) -> list[str]:
    """Speeds and energies with standard deviations, coefficients with intervals; nothing without a result."""
    result = impact_numbers.of(pick)
    if result is None:
        return []
    speeds = _pair(result, "incident_mps", "restituted_mps", "sigma_speed1", "sigma_speed2", 1.0, 1)
    energies = _pair(result, "kinetic1_j", "kinetic2_j", "sigma_kinetic1_j", "sigma_kinetic2_j", 1e-3, 2)
    coefficients = [(symbol, between(result, key, 2)) for symbol, key in (("R_N", "rn"), ("R_T", "rt"))]
    coefficient = "   ".join(f"{symbol} {value}" for symbol, value in coefficients if value)
    lines = [speeds and f"v {speeds} m/s", coefficient, energies and f"E {energies} kJ", _spin(pick)]
    return [line for line in lines if line]


def _spin(pick: bpy.types.Object) -> str:
    """The spin before the impact and its energy; empty where it is not known."""
    values = [value for _, value in spins.words(pick)]
    if not values:
        return ""
    rate, turns, *energy = values
    return "   ".join([f"ω {rate}", f"{turns} turns/s", *(f"Eω {each}" for each in energy)])


def reasons(pick: bpy.types.Object) -> list[str]:
    """Why it should be looked at, a sentence each; nothing when it need not."""
    if not impact_marks.is_alarming(pick):
        return []
    flags = [flag for flag in impact_numbers.flags(pick) if flag in impact_marks.ALARMING]
    status = pick.get(store.STATUS, "ok")
    if status != "ok" and status not in flags:
        flags.append(status)
    said = [meaning(flag) for flag in flags]
    return [*said, TOO_FAST] if impact_numbers.one(pick, "r") > 1.0 else said


def meaning(flag: str) -> str:
    """A flag in words."""
    return FLAG_WORDS.get(flag) or MEANINGS.get(flag, flag)


def measured(value: float, sigma: float, digits: int) -> str:
    """A number with its standard deviation, which has a digit that is not 0; empty where the number is not defined."""
    if math.isnan(value):
        return ""
    if 0 < sigma < 0.5 * 10.0**-digits:
        digits = min(-math.floor(math.log10(sigma)), digits + MORE_DIGITS)
    return f"{value:.{digits}f}" + ("" if math.isnan(sigma) else f" ± {sigma:.{digits}f}")


def between(result: impact_numbers.Numbers, of: str, digits: int) -> str:
    """A coefficient or an angle with its 95 % interval; empty where it is not defined."""
    value = math.radians(result[f"{of}_deg"]) if of.startswith("theta") else result[of]
    return in_words(of, value, *result[f"interval_{of}"], digits)


def with_sigma(result: impact_numbers.Numbers, key: str, sigma_key: str, factor: float, digits: int) -> str:
    """A value, or the length of a vector, with its standard deviation; empty where it is not defined."""
    value, sigma = result[key], result[sigma_key] if sigma_key else math.nan
    return measured(factor * (math.hypot(*value) if isinstance(value, tuple) else value), factor * sigma, digits)


def _pair(
    result: impact_numbers.Numbers, before: str, after: str, sigma1: str, sigma2: str, factor: float, digits: int
) -> str:
    """A value before and after the impact; empty where neither is defined."""
    both = [with_sigma(result, key, sigma, factor, digits) for key, sigma in ((before, sigma1), (after, sigma2))]
    return " → ".join(value or "?" for value in both) if any(both) else ""
