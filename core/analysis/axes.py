# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes of a graph: where a value lies along them, their ticks, and how zooming and panning change them."""

from dataclasses import dataclass, replace

import numpy as np

from ..vectors import Array

Limits = tuple[float, float]

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
NARROWEST = 1e-5
"""The least length of an axis, as a part of its greatest value: single precision draws no finer."""
LONGEST_LOG = 30.0
"""A logarithmic axis stays within so many powers of ten about 1."""


@dataclass(frozen=True)
class Axis:
    """One axis.

    Attributes
    ----------
    limits : values at its ends; both above zero on a logarithmic axis.
    log : logarithmic.
    label : its variable with its unit.
    symbol : the same where there is little room.
    """

    limits: Limits
    log: bool = False
    label: str = ""
    symbol: str = ""

    def places(self, values: Array) -> Array:
        """Values → from 0 to 1 along the axis, and beyond; NaN where a logarithmic axis has no place."""
        low, high = self._scaled(np.array(self.limits))
        return np.asarray((self._scaled(np.asarray(values, dtype=np.float64)) - low) / (high - low))

    def values(self, places: Array) -> Array:
        """The inverse of `places`."""
        low, high = self._scaled(np.array(self.limits))
        found = low + np.asarray(places, dtype=np.float64) * (high - low)
        with np.errstate(over="ignore"):
            return np.asarray(10.0**found if self.log else found)

    def zoomed(self, factor: float, about: float) -> "Axis":
        """The axis `factor` times as long, with the value at the place `about` (from 0 to 1) where it is."""
        low, high = self.values(np.array([about * (1 - factor), about + (1 - about) * factor])).tolist()
        return self._within(low, high)

    def panned(self, by: float) -> "Axis":
        """The axis moved by a part of its length."""
        low, high = self.values(np.array([by, 1 + by])).tolist()
        return self._within(low, high)

    def _scaled(self, values: Array) -> Array:
        if not self.log:
            return values
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.log10(np.where(values > 0, values, np.nan)))

    def _within(self, low: float, high: float) -> "Axis":
        """With new limits, unless they are too narrow or too far to be drawn."""
        if not np.isfinite([low, high]).all() or high - low <= NARROWEST * max(abs(low), abs(high)):
            return self
        if self.log and (low <= 10**-LONGEST_LOG or high >= 10**LONGEST_LOG):
            return self
        return replace(self, limits=(low, high))


@dataclass(frozen=True)
class Ticks:
    """Ticks of an axis, within its limits.

    Attributes
    ----------
    values, texts : of those with a number.
    minor : values of those without.
    """

    values: tuple[float, ...]
    texts: tuple[str, ...]
    minor: tuple[float, ...] = ()


def ticks(axis: Axis, most: int) -> Ticks:
    """At most `most` numbers (at least two) along an axis, at round values."""
    most = max(most, 2)
    if axis.log and (found := _log_ticks(axis.limits, most)) is not None:
        return found
    low, high = axis.limits
    step = round_step((high - low) / most)
    first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    while last - first + 1 > most:
        step = round_step(step * 1.01)
        first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
    values = tuple(i * step for i in range(first, last + 1))
    return Ticks(values, tuple(_number(value, step, max(abs(low), abs(high))) for value in values))


def round_step(least: float) -> float:
    """The smallest of 1, 2, 2.5 and 5 times a power of ten that is not below `least`."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in STEPS if step * power >= least * (1 - 1e-9)))


def _log_ticks(limits: Limits, most: int) -> Ticks | None:
    """Powers of ten, with 2 and 5 between where there is room; None where the axis is too short for two of them."""
    low, high = (float(np.log10(limit)) for limit in limits)
    powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    every = [(m, p) for p in powers for m in range(1, 10) if limits[0] * (1 - 1e-9) <= m * 10.0**p]
    every = [(m, p) for m, p in every if m * 10.0**p <= limits[1] * (1 + 1e-9)]
    for chosen in ((1, 2, 5), (1, 3), (1,)):
        some = [(m, p) for m, p in every if m in chosen]
        if len(some) < 2:
            return None
        if len(some) <= most:
            break
    else:
        apart = int(np.ceil(len(some) / most))
        some = [(m, p) for m, p in some if p % apart == 0]
    values = tuple(m * 10.0**p for m, p in some)
    minor = tuple(m * 10.0**p for m, p in every if (m, p) not in some) if len(powers) <= most + 2 else ()
    return Ticks(values, tuple(_log_number(m, p) for m, p in some), minor)


def _log_number(mantissa: int, power: int) -> str:
    if -4 < power < 3:
        return f"{mantissa * 10.0**power:.{max(0, -power)}f}"
    if 3 <= power < 6:
        return f"{mantissa * 10 ** (power - 3)}k"
    exponent = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{exponent}" if mantissa == 1 else f"{mantissa}·10{exponent}"


def _number(value: float, step: float, greatest: float) -> str:
    """A tick's number, with the digits that its step needs; k and M from ten thousand on."""
    for size, letter in ((1e6, "M"), (1e3, "k")):
        if greatest >= 10 * size:
            return f"{_plain(value / size, step / size)}{letter}" if value else "0"
    if greatest < 1e-4:
        return f"{value:.3g}".replace("-", "−")
    return _plain(value, step)


def _plain(value: float, step: float) -> str:
    digits = next((n for n in range(12) if abs(step * 10**n - round(step * 10**n)) < 1e-6 * step * 10**n), 12)
    return f"{value:.{digits}f}".replace("-", "−") if value else f"{0:.{digits}f}"
