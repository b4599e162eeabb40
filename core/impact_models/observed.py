# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured rebounds: no formula, but the measured impacts themselves, drawn again under like conditions.

Of the k measured impacts one is drawn, and the block takes over its R_N, R_T and deviation together, so that what
belongs together stays together. The probability of impact i is proportional to

    w_i · max(0, 1 − d_i²/6)        d_i² = [ln(θ1/θ1_i)/h_θ]² + [ln(v_N1/v_N1_i)/h_v]²

w_i is its weight by its errors, h_θ and h_v are bandwidths by Silverman's rule (`MeasuredRebounds`) times a parameter.
The kernel of Epanechnikov has a reach of √6 = 2.45 bandwidths. Where fewer than five impacts are within it, the
conditions are beyond those measured, and the reach is one bandwidth more than the distance of the fifth nearest.

    v_N2 = R_N v_N1
    v_T2 = R_T |v_T1|, turned from v_T1 about n by the deviation φ, to either side with the same probability
    |v2| ≤ max(1, R) |v1|           else both parts are shortened alike; R is that of the drawn impact
    ω2   = (n × v_T2)/r             rolling [rad/s]

The scatter is that of the measured values, errors of measuring included: the weights make uncertain impacts rare.

The side is drawn because a slope prefers none. R_N and R_T were measured under other conditions, so that v2 could grow
beyond any that was measured: hence the limit. Speed grows only where it did so in a measured impact; the energy with
rotation may grow, since the spin before is not looked at. The mean is that of R_N, of R_T and of R with the same
probabilities, without deviation.

Source: resampling under like conditions: Lall & Sharma 1996 (nearest neighbours), here with a kernel; the kernel:
Epanechnikov 1969; the bandwidth: Silverman 1986. That coefficients of restitution are drawn so is this program's.
"""

from math import atan2, inf, isnan, log, sqrt
from typing import Any, NamedTuple

from .machinery.base import ImpactModel
from .machinery.contact import leaving, rolling, split
from .machinery.measured import (
    ACROSS,
    ALONG,
    FEWEST_NEAR,
    HEADER,
    LN_ANGLE,
    LN_SPEED,
    NORMAL,
    REACH2,
    SMALLEST,
    TOTAL,
    WEIGHT,
)
from .machinery.parameters import number
from .machinery.triples import Motion, Vector, add, cross, length, scaled

RULE = "1 is Silverman's rule (1986)"


class Parameters(NamedTuple):
    """What can be set."""

    angle_bandwidth: float = number(1, 0.1, 10, "factor on the bandwidth of the incident angle", RULE, symbol="h_θ")
    speed_bandwidth: float = number(1, 0.1, 10, "factor on the bandwidth of the normal speed", RULE, symbol="h_v")


class Draws(NamedTuple):
    """The chance of one impact: which measured one, and to which side."""

    impact: float
    side: float


def first_within(measured: Any, k: int, angle: float) -> int:
    """The first of the measured impacts, which are in the order of their angles, whose ln θ1 is not below `angle`."""
    low, high = 0, k
    while low < high:
        middle = (low + high) // 2
        if measured[HEADER + LN_ANGLE * k + middle] < angle:
            low = middle + 1
        else:
            high = middle
    return low


def distance2(measured: Any, i: int, k: int, angle: float, speed: float, per_angle: float, per_speed: float) -> float:
    """d_i² of the measured impact i from given conditions."""
    a = (measured[HEADER + LN_ANGLE * k + i] - angle) * per_angle
    b = (measured[HEADER + LN_SPEED * k + i] - speed) * per_speed
    return a * a + b * b


def fifth_nearest2(measured: Any, k: int, angle: float, speed: float, per_angle: float, per_speed: float) -> float:
    """d² of the measured impact that is the fifth nearest."""
    first, second, third, fourth, fifth = inf, inf, inf, inf, inf
    for i in range(k):
        d2 = distance2(measured, i, k, angle, speed, per_angle, per_speed)
        if d2 < fifth:
            first, d2 = min(first, d2), max(first, d2)
            second, d2 = min(second, d2), max(second, d2)
            third, d2 = min(third, d2), max(third, d2)
            fourth, fifth = min(fourth, d2), max(fourth, d2)
    return fifth


def rebound(
    v1: Vector, n: Vector, omega1: Vector, radius: float, mass: float, p: Parameters, u: Draws, measured: Any
) -> Motion:
    """v2 [m/s] and ω2 [rad/s]; see the module."""
    approach, tangential, tangential_speed = split(v1, n)
    k = int(measured[0])
    angle = log(max(atan2(approach, tangential_speed), SMALLEST))
    speed = log(max(approach, SMALLEST))
    width = measured[1] * p.angle_bandwidth
    per_angle, per_speed = 1.0 / width, 1.0 / (measured[2] * p.speed_bandwidth)

    per_reach2, near, total = 1.0 / REACH2, 0, 0.0
    start = first_within(measured, k, angle - sqrt(REACH2) * width)
    stop = first_within(measured, k, angle + sqrt(REACH2) * width)
    for i in range(start, stop):
        share = 1.0 - distance2(measured, i, k, angle, speed, per_angle, per_speed) * per_reach2
        near += 1 if share > 0.0 else 0
        total += measured[HEADER + WEIGHT * k + i] * (share if share > 0.0 else 0.0)
    if near < FEWEST_NEAR:
        reach = 1.0 + sqrt(fifth_nearest2(measured, k, angle, speed, per_angle, per_speed))
        per_reach2, total, start, stop = 1.0 / (reach * reach), 0.0, 0, k
        for i in range(k):
            share = 1.0 - distance2(measured, i, k, angle, speed, per_angle, per_speed) * per_reach2
            total += measured[HEADER + WEIGHT * k + i] * (share if share > 0.0 else 0.0)

    rn, along, across, most = 0.0, 0.0, 0.0, 0.0
    if isnan(u.impact):
        for i in range(start, stop):
            share = 1.0 - distance2(measured, i, k, angle, speed, per_angle, per_speed) * per_reach2
            part = measured[HEADER + WEIGHT * k + i] * (share if share > 0.0 else 0.0) / total
            ahead, aside = measured[HEADER + ALONG * k + i], measured[HEADER + ACROSS * k + i]
            rn += part * measured[HEADER + NORMAL * k + i]
            along += part * sqrt(ahead * ahead + aside * aside)
            most += part * measured[HEADER + TOTAL * k + i]
    else:
        left, drawn = u.impact * total, start
        for i in range(start, stop):
            share = 1.0 - distance2(measured, i, k, angle, speed, per_angle, per_speed) * per_reach2
            drawn = i if share > 0.0 else drawn
            left -= measured[HEADER + WEIGHT * k + i] * (share if share > 0.0 else 0.0)
            if left < 0.0:
                break
        rn = measured[HEADER + NORMAL * k + drawn]
        along = measured[HEADER + ALONG * k + drawn]
        across = measured[HEADER + ACROSS * k + drawn]
        most = measured[HEADER + TOTAL * k + drawn]
        if u.side < 0.5:
            across = -across
    after = add(scaled(tangential, along), scaled(cross(n, tangential), across))
    v2 = leaving(n, rn * approach, after)
    size, limit = length(v2), max(1.0, most) * length(v1)
    if size > limit:
        v2, after = scaled(v2, limit / size), scaled(after, limit / size)
    return v2, rolling(n, after, radius)


MODEL = ImpactModel(
    name="observed",
    title="Measured rebounds",
    reference="Measured impacts of the site, or of several, drawn again under like conditions; after Lall, U. & "
    "Sharma, A. (1996): A nearest neighbor bootstrap for resampling hydrologic time series. Water Resources Research "
    "32(3), 679–693.",
    function=rebound,
    parameter_type=Parameters,
    draw_type=Draws,
    colour=(0.55, 0.30, 0.75),
    energy_never_grows=False,
    draws_from_impacts=True,
)
