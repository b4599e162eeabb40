# SPDX-License-Identifier: GPL-3.0-or-later
"""What was measured of the spin of a flight."""

from dataclasses import dataclass

import numpy as np

from ..remarks import Remark
from ..vectors import Array
from .spin import Spin
from .spin_marks import Axis
from .spin_rates import Verdict


@dataclass(frozen=True, eq=False)
class FlightSpin:
    """What the marks of one flight say.

    Attributes
    ----------
    trajectory : name. flight : its number in the trajectory, from 1, contacts not counted.
    last_pick : index of the pick that ends it. impact : number of its impact, 0 where it is none.
    start_time_s, end_time_s : of the flight [s].
    mark_time_s, direction : (n,) times of the marks that count, (n, 3) unit vectors from the centre to the point then.
    axis : what was assumed.
    spin : None where it is not known.
    verdict : why.
    others : turns per second that fit as well as that of the spin, or all that fit where it is not known; signed.
    energy_j, sigma_energy_j : rotational energy ½Iω² and its standard deviation [J]; NaN where it is not known.
    remarks : on the spin, the gravest first.
    """

    trajectory: str
    flight: int
    last_pick: int
    impact: int
    start_time_s: float
    end_time_s: float
    mark_time_s: Array
    direction: Array
    axis: Axis
    spin: Spin | None
    verdict: Verdict
    others: tuple[float, ...]
    energy_j: float
    sigma_energy_j: float
    remarks: tuple[Remark, ...]

    @property
    def turns_per_s(self) -> float:
        """NaN where it is not known."""
        return np.nan if self.spin is None else self.spin.rate / (2 * np.pi)

    @property
    def sigma_turns_per_s(self) -> float:
        """NaN where it is not known."""
        return np.nan if self.spin is None else self.spin.sigma_rate / (2 * np.pi)
