# SPDX-License-Identifier: GPL-3.0-or-later
"""The rate at which the marked point of a block turns in one flight: which rates fit, and what decides among them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..remarks import Remark
from ..vectors import Array, perpendicular
from .block import Block
from .spin import Spin, measure_spin
from .spin_fits import fit_rates
from .spin_marks import Marks
from .spin_phases import directions, nearest, phases, tilted

Verdict = Literal["measured", "counted", "ambiguous", "unknown"]
"""One rate fits; several do, and the one that was counted by eye is taken; several do; none is known."""

SIGMA_AXIS = np.radians(15.0)
"""Standard deviation of the assumed axis, in either direction [rad]."""
SIGMA_RADIUS = 0.15
"""Standard deviation of the marked point's distance from the centre, in parts of the radius: blocks are no balls."""
MOST_OF_ROLLING = 1.5
"""Rates up to this many times that of rolling are looked for: little but friction turns a block."""
LEAST_LIMIT = 1.0
"""They are always looked for up to this [turns/s]."""
LARGEST_SIGMA_TURNS = 1 / 8
"""The attitude of a mark that is known worse is not known."""
UNSTEADY = 9.0
"""χ² per degree of freedom above which the marks are not of one steady turn."""


@dataclass(frozen=True, eq=False)
class MarksOnBlock:
    """The marks of one flight on their block: centre, direction (m, 3), unit axis, σ of a coordinate of the centre."""

    block: Block
    marks: Marks
    centre: Array
    direction: Array
    axis: Array
    sigma_centre_m: float

    @property
    def phase(self) -> Array:
        """(m,) [turns]."""
        return phases(self.direction, self.axis)

    @property
    def sigma_turns(self) -> Array:
        """(m,) standard deviation of the phases from that of the clicks."""
        squares = np.zeros(self.phase.size)
        for way in (0, 2):
            there, back = (self._phase(ray=self.marks.aside[:, way + side]) for side in (0, 1))
            squares += ((there - back) / 2) ** 2
        return np.maximum(np.sqrt(squares), 1e-6)

    @property
    def shared(self) -> list[tuple[Array, Array]]:
        """The phases with an error that all marks share, a standard deviation to either side of each kind."""
        radius, off = self.block.radius_m, self.sigma_centre_m
        ways = self.marks.right[0], self.marks.down[0]
        tilt = tilted(self.axis, SIGMA_AXIS)
        return [
            (self._phase(radius=radius * (1 + SIGMA_RADIUS)), self._phase(radius=radius * (1 - SIGMA_RADIUS))),
            *(
                (self._phase(centre=self.centre + off * way), self._phase(centre=self.centre - off * way))
                for way in ways
            ),
            (self._phase(axis=tilt[0]), self._phase(axis=tilt[1])),
            (self._phase(axis=tilt[2]), self._phase(axis=tilt[3])),
        ]

    def _phase(
        self,
        *,
        ray: Array | None = None,
        centre: Array | None = None,
        radius: float | None = None,
        axis: Array | None = None,
    ) -> Array:
        """(m,) the phases with something else, nearest to those without."""
        direction = directions(
            self.marks.origin,
            self.marks.ray if ray is None else ray,
            self.centre if centre is None else centre,
            self.block.radius_m if radius is None else radius,
        )
        other = phases(direction, self.axis) if axis is None else _about(direction, axis, self.axis)
        return nearest(np.where(np.isfinite(other), other, self.phase), self.phase)


def _about(direction: Array, axis: Array, usual: Array) -> Array:
    """The phases about a tilted axis, from the same start as about the usual one."""
    start = perpendicular(usual)[0]
    return phases(direction, axis) - phases(start[None], axis)


def judged(
    found: MarksOnBlock, name: str, speed_mps: float
) -> tuple[Spin | None, Verdict, tuple[float, ...], tuple[Remark, ...]]:
    """The spin, why it is known or not, the other turns per second that fit, and what there is to say."""
    time, count = found.marks.time_s, found.marks.time_s.size
    if np.unique(time).size < 2:
        text = f"{counted(count)}: mark the same point of the block again in another picture of this flight."
        return None, "unknown", (), (Remark(text, "advice", name),)
    sigma = found.sigma_turns
    worst = float(np.median(sigma))
    if worst > LARGEST_SIGMA_TURNS:
        text = (
            "The block is too small in the picture: the clicks leave the angle of the marks open to "
            f"± {360 * worst:.0f}°. Click more finely (Click ±), or mark a film that shows it larger."
        )
        return None, "unknown", (), (Remark(text, "warning", name),)
    rolling = speed_mps / (2 * np.pi * found.block.radius_m)
    limit = max(MOST_OF_ROLLING * rolling, LEAST_LIMIT)
    fits = fit_rates(time, found.phase, sigma, limit)
    about = found.marks.about[np.isfinite(found.marks.about)]
    chosen = int(np.argmin(np.abs(fits.rate - about[-1]))) if about.size else 0
    others = tuple(float(rate) for i, rate in enumerate(fits.rate.tolist()) if i != chosen)
    if others and not about.size:
        others = tuple(fits.rate.tolist())
        gap = float(np.diff(np.unique(time)).min())
        rates = _listed(fits.rate.tolist())
        step = np.r_[found.marks.step_s, np.inf]
        text = (
            f"Marks {gap:.3f} s apart do not tell the whole turns between them: {rates} turns/s fit alike (rolling at "
            f"{speed_mps:.1f} m/s would be {rolling:.1f}). {_what_to_do(float(np.nanmin(step)), 1 / (2 * limit))}"
        )
        return None, "ambiguous", others, (Remark(text, "warning", name),)
    turns = fits.turns[chosen]
    spin = measure_spin(time, turns, sigma_turns=sigma, axis=found.axis)
    remarks = []
    variance = spin.sigma_rate**2
    for there, back in found.shared:
        ends = [measure_spin(time, turns + way - found.phase, sigma_turns=sigma).rate for way in (there, back)]
        variance += max(abs(end - spin.rate) for end in ends) ** 2
    beyond = float(fits.chi_square[chosen]) / max(count - 2, 1)
    if count > 2 and beyond > 1:
        variance += (beyond - 1) * spin.sigma_rate**2
    if count > 2 and beyond > UNSTEADY:
        off = 360 * float(np.sqrt((spin.residual_turns**2).mean()))
        text = f"The marks lie {off:.0f}° off a steady turn: is it the same point, and the right axis?"
        remarks.append(Remark(text, "warning", name))
    if others:
        text = f"{_listed(others)} turns/s fit alike; what was counted by eye decides."
        remarks.append(Remark(text, "note", name))
    rate = np.sqrt(variance)
    spin = replace(spin, sigma_rate=float(rate), sigma_angular_velocity=rate * np.abs(spin.axis))
    return spin, "counted" if others else "measured", others, tuple(remarks)


def _what_to_do(step_s: float, needed_s: float) -> str:
    """Where marks are too far apart in time; step_s : between two pictures of the film, inf where it is not known."""
    if np.isfinite(step_s) and step_s > needed_s:
        return f"Pictures {step_s:.3f} s apart cannot tell it: give the turns/s that were counted by eye."
    return f"Mark the point in pictures less than {needed_s:.3f} s apart, or give the turns/s that were counted by eye."


def counted(marks: int) -> str:
    """So many marks, in words."""
    return "1 mark" if marks == 1 else f"{marks} marks"


def _listed(rates: Sequence[float]) -> str:
    """At most six rates, from the slowest on."""
    texts = [f"{round(rate, 1) + 0.0:.1f}" for rate in sorted(rates, key=abs)]  # no -0.0
    return ", ".join(texts[:6]) + (f" and {len(texts) - 6} more" if len(texts) > 6 else "")
