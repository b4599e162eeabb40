# SPDX-License-Identifier: GPL-3.0-or-later
"""Colour scales: the same ones in the viewport, in films, in figures and in legends."""

import numpy as np

from .vectors import Array

# Eight evenly spaced sRGB colours after the perceptually uniform map "plasma" (S. van der Walt & N. Smith, CC0), its
# dark end made brighter so that slow blocks show on a shaded slope.
SPEED_SCALE = np.array(
    [
        [0.42, 0.10, 0.80],
        [0.55, 0.10, 0.75],
        [0.66, 0.14, 0.59],
        [0.80, 0.28, 0.47],
        [0.90, 0.42, 0.36],
        [0.97, 0.58, 0.25],
        [0.99, 0.75, 0.15],
        [0.94, 0.98, 0.13],
    ]
)

MEASURED_COLOUR = (0.98, 0.98, 0.98)
"""Of measured blocks over terrain and in films, which are darker; graphs on a light ground have black. Each model has a
hue of its own: after Okabe & Ito (2008), distinct with any colour vision, and without their vermilion, since red is
what passes below the terrain."""


def srgb_to_linear(colours: Array) -> Array:
    """IEC 61966-2-1 transfer function, (..., 3) → (..., 3) in 0…1."""
    c = np.asarray(colours, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(values: Array) -> Array:
    """The inverse of `srgb_to_linear`."""
    v = np.asarray(values, dtype=np.float64)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 0.0031308) ** (1 / 2.4) - 0.055)


def scale_colours(values: Array, low: float, high: float, scale: Array = SPEED_SCALE) -> Array:
    """Colours of values on a scale, clipped at its ends.

    Parameters
    ----------
    values : (n,)
    low, high : the values at the ends of the scale.
    scale : (m, 3) evenly spaced sRGB colours.

    Returns
    -------
    (n, 3) sRGB in 0…1; NaN values are grey.
    """
    values = np.asarray(values, dtype=np.float64)
    span = high - low if high > low else 1.0
    place = np.clip((np.nan_to_num(values, nan=low) - low) / span, 0.0, 1.0) * (len(scale) - 1)
    knots = np.arange(len(scale))
    colours = np.column_stack([np.interp(place, knots, scale[:, channel]) for channel in range(3)])
    colours[np.isnan(values)] = 0.5
    return colours


def rounded_top(value: float) -> float:
    """The end of a legend: the value rounded up to a number that reads well."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(
        next(
            step * power
            for step in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
            if step * power >= value * (1 - 1e-9)
        )
    )
