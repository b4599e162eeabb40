# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of a parameter's range a slider spans."""

from math import floor, log10

from .parameters import ParameterSpec

MANY_TIMES = 20.0
"""Where the range goes beyond this many times the default, the slider does not; the field beside it does."""
ALL_OF = 2.0
"""A range that is not longer than this is on the slider as a whole."""
LITTLE = 0.01
"""Part of a range that the slider spans where the default is at its lower end."""


def slider_range(spec: ParameterSpec) -> tuple[float, float, float]:
    """Start, end and step of a slider: the whole range, or the part of a very wide one in which the default lies."""
    reach = float(spec.default) - spec.minimum
    end = spec.maximum
    if end - spec.minimum > max(MANY_TIMES * reach, ALL_OF):
        end = spec.minimum + (4 * reach if reach > 0 else max(LITTLE * (end - spec.minimum), min(1.0, end)))
    step = 10.0 ** floor(log10((end - spec.minimum) / 100))
    return spec.minimum, end, step
