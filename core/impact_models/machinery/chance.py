# SPDX-License-Identifier: GPL-3.0-or-later
"""Laws of chance as quantile functions: one uniform number in, one value out, so that a draw is reproducible.

A uniform number that is NaN asks for the mean of the law. Plain functions that compile as they stand.
"""

from math import erfc, inf, isnan, log, sqrt

SMALLEST = 2.0**-53
"""The spacing of the uniform numbers of numpy: stands for 0, and 1 less it for 1."""

# fmt: off
CENTRE = (
    (2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4, 4.5921953931549871457e4,
     1.3731693765509461125e4, 1.9715909503065514427e3, 1.3314166789178437745e2, 3.3871328727963666080),
    (5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4, 2.1213794301586595867e4,
     5.3941960214247511077e3, 6.8718700749205790830e2, 4.2313330701600911252e1, 1.0),
)
SHOULDER = (
    (7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1, 1.27045825245236838258,
     3.64784832476320460504, 5.76949722146069140550, 4.63033784615654529590, 1.42343711074968357734),
    (1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2, 1.48103976427480074590e-1,
     6.89767334985100004550e-1, 1.67638483018380384940, 2.05319162663775882187, 1.0),
)
TAIL = (
    (2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3, 2.65321895265761230930e-2,
     2.96560571828504891230e-1, 1.78482653991729133580, 5.46378491116411436990, 6.65790464350110377720),
    (2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5, 7.86869131145613259100e-4,
     1.48753612908506148525e-2, 1.36929880922735805310e-1, 5.99832206555887937690e-1, 1.0),
)
# fmt: on
"""Numerators and denominators of Wichura (1988), algorithm AS 241 (PPND16), highest power first."""


def _ratio(polynomials: tuple[tuple[float, ...], tuple[float, ...]], x: float) -> float:
    above, below = 0.0, 0.0
    for k in range(8):
        above = above * x + polynomials[0][k]
        below = below * x + polynomials[1][k]
    return above / below


def normal_quantile(u: float) -> float:
    """Quantile of the standard normal law, to 1e-15 (Wichura 1988, AS 241)."""
    u = min(max(u, SMALLEST), 1.0 - SMALLEST)
    q = u - 0.5
    if abs(q) <= 0.425:
        return q * _ratio(CENTRE, 0.180625 - q * q)
    r = sqrt(-log(min(u, 1.0 - u)))
    x = _ratio(SHOULDER, r - 1.6) if r <= 5.0 else _ratio(TAIL, r - 5.0)
    return x if q > 0.0 else -x


def uniform(u: float, low: float, high: float) -> float:
    """U(low, high)."""
    return 0.5 * (low + high) if isnan(u) else low + u * (high - low)


def normal(u: float, mean: float, sd: float) -> float:
    """N(mean, sd)."""
    return mean if isnan(u) or sd <= 0.0 else mean + sd * normal_quantile(u)


def truncated_normal(u: float, mean: float, sd: float, low: float, high: float) -> float:
    """N(mean, sd) given that it lies between `low` and `high`, which hold the mean; NaN asks for `mean` itself."""
    if isnan(u) or sd <= 0.0:
        return mean
    first = 0.5 * erfc((mean - low) / sd / sqrt(2.0)) if low > -inf else 0.0
    last = 1.0 - 0.5 * erfc((high - mean) / sd / sqrt(2.0)) if high < inf else 1.0
    return min(max(mean + sd * normal_quantile(first + u * (last - first)), low), high)
