# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reconstruction and a refinement can be asked for."""

from typing import Literal, get_args

FlightEnds = Literal["contacts", "centres"]
"""What the flights join: the marked contact points, as Noël et al. 2018 do, or the block's centre at each contact."""
FLIGHT_ENDS: tuple[FlightEnds, ...] = get_args(FlightEnds)

Loss = Literal["huber", "cauchy", "linear"]
"""How pixels that do not fit count in a refinement."""
LOSSES: tuple[Loss, ...] = get_args(Loss)

FREE = ("camera", "clock", "clock_drift", "drag", "gravity")
"""What a refinement can fit beside the picks."""

SIGMA_AIM = 0.15
"""Standard deviation of the tracked spot about the block's centre, in parts of its diameter: its sunlit side draws the
eye of people and of trackers."""

SIGMA_DATUM = 0.0012
"""Standard deviation of how a camera lies to the terrain beside what its covariance says, in parts of the distance:
0.18 m from 150 m away. With it the speeds of one view hold where a camera stands 0.3 m off from there."""
