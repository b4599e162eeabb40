# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured impacts as a table that a model draws from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...vectors import Array, Mask, Names

FEWEST_MEASURED = 10
"""With fewer there is no scatter to draw from."""
IQR_PER_SD = 1.349
"""Interquartile range of a normal law of standard deviation 1."""
LEAST_BANDWIDTH = 0.02
"""Of the logarithms: impacts that were all measured under the same conditions have no spread of their own."""
HEADER = 3
"""Numbers before the columns: how many impacts, and the two bandwidths."""
LN_ANGLE, LN_SPEED, WEIGHT, NORMAL, ALONG, ACROSS, TOTAL = range(7)
"""The columns: ln θ1, ln v_N1, weight, R_N, R_T cos φ, R_T sin φ, R."""
COLUMNS = 7
REACH2 = 6.0
"""Squared distance in bandwidths at which the kernel ends: the kernel max(0, 1 − d²/6) has in the plane the variance of
the bandwidth along each axis."""
FEWEST_NEAR = 5
"""With fewer impacts within the kernel's reach, the conditions are beyond those that were measured."""


@dataclass(frozen=True, eq=False)
class MeasuredRebounds:
    """k measured impacts: the incident conditions, and what became of the block.

    Attributes
    ----------
    site, trajectory : (k,) names.
    theta1 : (k,) incident angle, above zero [rad].
    vn1 : (k,) incident normal speed, above zero [m/s].
    rn : (k,) v2·n / |v1·n|; below zero where the block went on into the ground.
    rt : (k,) |v_T2| / |v_T1|.
    turn : (k,) angle φ between v_T1 and v_T2, 0…π [rad]: the deviation about the normal, without its side.
    weight : (k,) above zero, at most 1.
    left_out : reason → how many impacts of the table are not among them.

    Raises
    ------
    InputError : fewer than `FEWEST_MEASURED`.
    """

    site: Names
    trajectory: Names
    theta1: Array
    vn1: Array
    rn: Array
    rt: Array
    turn: Array
    weight: Array
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self) < FEWEST_MEASURED:
            out = ", ".join(f"{number} {reason}" for reason, number in self.left_out.items())
            raise InputError(
                f"Only {len(self)} measured impacts can be drawn from" + (f" ({out} left out)" if out else ""),
                advice=f"The model observed needs {FEWEST_MEASURED} with R_N and R_T: measure more, or merge tables",
            )

    def __len__(self) -> int:
        return self.theta1.size

    @cached_property
    def bandwidths(self) -> tuple[float, float]:
        """Of ln θ1 and ln v_N1: min(sd, IQR/1.349) · n^(−1/6), Silverman's rule (1986) in two dimensions.

        n is Kish's effective number (Σw)²/Σw². A bandwidth of 0.25 is about 25 % of the angle or the speed.
        """
        n = self.weight.sum() ** 2 / (self.weight**2).sum()
        angle, speed = (max(_spread(np.log(values)), LEAST_BANDWIDTH) for values in (self.theta1, self.vn1))
        return float(angle * n ** (-1 / 6)), float(speed * n ** (-1 / 6))

    @cached_property
    def numbers(self) -> Array:
        """(`HEADER` + 7 k,) as the compiled model takes them: the header, then the columns, rows in the order of θ1."""
        columns = (
            np.log(self.theta1),
            np.log(self.vn1),
            self.weight,
            self.rn,
            self.rt * np.cos(self.turn),
            self.rt * np.sin(self.turn),
            np.hypot(self.rn * np.sin(self.theta1), self.rt * np.cos(self.theta1)),
        )
        order = np.argsort(self.theta1, kind="stable")
        return np.concatenate([[len(self), *self.bandwidths], *(column[order] for column in columns)])

    def without(self, rows: Mask) -> "MeasuredRebounds":
        """Those that are not among (k,) rows."""
        kept = ~rows
        names = ("site", "trajectory", "theta1", "vn1", "rn", "rt", "turn", "weight")
        return MeasuredRebounds(**{name: getattr(self, name)[kept] for name in names}, left_out=self.left_out)

    def beyond(self, theta1: Array, vn1: Array, angle: float = 1.0, speed: float = 1.0) -> Mask:
        """(m,) whether incident conditions [rad], [m/s] are beyond those measured: fewer than `FEWEST_NEAR` near.

        angle, speed : factors on the bandwidths.
        """
        widths = np.multiply(self.bandwidths, (angle, speed))
        measured = np.stack([np.log(self.theta1), np.log(self.vn1)], axis=1) / widths
        given = np.log(np.maximum(np.stack([theta1, vn1], axis=1), SMALLEST)) / widths
        near = np.zeros(len(given), dtype=np.intp)
        for row in measured:
            near += ((given - row) ** 2).sum(axis=1) < REACH2
        return near < FEWEST_NEAR


SMALLEST = 1e-9
"""Of an angle [rad] or a speed [m/s] whose logarithm is taken."""


def _spread(values: Array) -> float:
    first, third = np.quantile(values, [0.25, 0.75])
    spread = float(np.std(values, ddof=1))
    return min(spread, float(third - first) / IQR_PER_SD) if third > first else spread
