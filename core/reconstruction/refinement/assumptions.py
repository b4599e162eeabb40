# SPDX-License-Identifier: GPL-3.0-or-later
"""What was taken for given or usual, whether the pixels agree, and what it does to the result."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...constants import GRAVITY_MPS2
from ...least_squares import inverse
from ...remarks import Remark
from ...vectors import Array
from .deviations import Fit, velocity_rows
from .problem import LAW_COLUMN, ground_rows
from .setup import Ground
from .solver import normal_equations
from .views import View

MATTERS = 1.2
"""A cause that makes deviations larger by this factor is spoken of."""
EXACT = 1e-3
"""Of the terrain's accuracy, for what the deviations would be without it."""
WRONG = 1.5
"""A terrain that is off by so many times what was stated is."""
GRAVITY_OFF, GRAVITY_SIGNIFICANCE = 0.1, 5.0
"""Gravity that is off by more than this part, and by more than so many standard deviations, is no gravity."""


def on_assumptions(ground: Ground, views: Sequence[View], fits: Sequence[Fit]) -> Iterator[Remark]:
    """Remarks on the terrain's accuracy, rolling shutters and gravity."""
    yield from _on_gravity(fits)
    yield from _on_accelerations(fits)
    yield from _on_terrain(ground, fits)
    yield from _on_shutters(views, fits)


def _on_gravity(fits: Sequence[Fit]) -> Iterator[Remark]:
    """A gravity that was fitted, or would be if it were, and is none."""
    found = [_gravity_of(fit) for fit in fits]
    weight = np.array([sigma**-2 for _, sigma in found])
    value, sigma = float(weight @ [one for one, _ in found] / weight.sum()), float(weight.sum() ** -0.5)
    rates = [fault for fit in fits for fault in fit.faults if fault.kind == "rate"]
    if rates:
        longer = 1 + float(np.median([fault.value[0] for fault in rates]))
        value = GRAVITY_MPS2 * longer**2
        sigma = 2 * GRAVITY_MPS2 * longer * float(np.median([fault.sigma[0] for fault in rates]))
    off = abs(value - GRAVITY_MPS2)
    wrong = off > GRAVITY_OFF * GRAVITY_MPS2 and off > GRAVITY_SIGNIFICANCE * sigma
    if value > 0 and (rates or wrong):
        text = (
            f"The flights have a gravity of {value:.3g} ± {sigma:.1g} m/s² instead of {GRAVITY_MPS2:g}: lengths should "
            f"be {GRAVITY_MPS2 / value:.3g} times as large (check the unit of the terrain), or times "
            f"{np.sqrt(value / GRAVITY_MPS2):.3g} times as long (check the capture rate of the video)."
        )
        if rates:
            text += " The deviations contain the latter."
        yield Remark(text, "warning", "gravity")


def _on_accelerations(fits: Sequence[Fit]) -> Iterator[Remark]:
    """Flights that are not those of gravity and drag."""
    found = [(fit, fit.accelerations) for fit in fits if fit.accelerations is not None]
    if not found or any(fault.kind in ("rate", "drag") for fit, _ in found for fault in fit.faults):
        return
    size = float(np.median([one.sigma_mps2 for _, one in found]))
    names = [name for fit, _ in found for name in fit.setup.names]
    who = f"trajectory {names[0]}" if len(names) == 1 else f"{len(names)} trajectories"
    law = "gravity and drag" if _dragged(found[0][0]) else "gravity"
    text = (
        f"The flights of {who} are not those of {law} alone: the pixels ask for a further acceleration of about "
        f"{size:.2g} m/s² (the lift of a block that spins, drag, an error of the lens, or frames that are missing). "
        "The velocities are those without it; their deviations contain it."
    )
    yield Remark(text, "warning", names[0] if len(names) == 1 else "flights")


def _dragged(fit: Fit) -> bool:
    return bool(fit.solution.evaluation.motion.dragged.any())


def _gravity_of(fit: Fit) -> tuple[float, float]:
    """Gravity and its standard deviation; where it is held, as one step of the search would have it."""
    problem, solution = fit.setup.problem, fit.solution
    column = problem.columns.law[1]
    if column >= 0:
        return solution.state.gravity, float(np.sqrt(fit.covariance[column, column]))
    size = problem.columns.size
    freed = replace(problem, columns=replace(problem.columns, size=size + 1))
    pixels = solution.evaluation.pixels
    columns = pixels.columns.copy()
    columns[solution.evaluation.segment >= 0, LAW_COLUMN] = size
    evaluation = replace(solution.evaluation, pixels=replace(pixels, columns=columns))
    information, gradient = normal_equations(freed, evaluation, solution.weight)
    covariance = inverse(information, partly=True)
    wider = np.sqrt(np.trace(fit.covariance[:size, :size]) / max(np.trace(fit.independent), 1e-300)) * fit.scale
    step = -float(covariance[-1] @ gradient)
    return solution.state.gravity + step, max(float(wider * np.sqrt(covariance[-1, -1])), 1e-9)


def _on_terrain(ground: Ground, fits: Sequence[Fit]) -> Iterator[Remark]:
    """A terrain that is not what was stated, and one of which nothing was."""
    touching = [fit for fit in fits if fit.setup.problem.surface is not None and fit.setup.problem.grounded.size]
    if not touching:
        return
    errors = [fit.setup.problem.ground for fit in touching]
    scale = float(np.median([np.median(one.own_sigma_m / one.scaled(1.0, 1.0).own_sigma_m) for one in errors]))
    off = 100 * float(np.median([np.median(one.own_sigma_m) for one in errors]))
    accuracy = 100 * ground.sigma_terrain_m
    stated = "stated" if ground.terrain_stated else "taken by its point spacing"
    if scale > WRONG and not any(fit.accelerations for fit in fits):
        text = (
            f"The terrain is off by about {off:.2g} cm where blocks touch it, not by the {accuracy:.2g} cm {stated}, "
            "which the deviations allow for: check the terrain, and how it and the cameras lie to each other."
        )
        yield Remark(text, "warning", "terrain")
    elif not ground.terrain_stated:
        share = float(np.median([_share_of_terrain(fit) for fit in touching]))
        if share > MATTERS:
            assert ground.surface is not None
            text = (
                f"The accuracy of the terrain is not given: {accuracy:.2g} cm is taken by its point spacing of "
                f"{ground.surface.mean_spacing_m:.2g} m, which makes the deviations of speeds {share:.1f} times as "
                "large as an exact terrain would. Give it: about 2 cm for a terrestrial scan, 5 cm from a drone, 20 cm "
                "for an airborne one."
            )
            yield Remark(text, "advice", "terrain")


def _share_of_terrain(fit: Fit) -> float:
    """By how much larger the deviations of velocities are for the terrain's accuracy."""
    problem, solution = fit.setup.problem, fit.solution
    exact = replace(
        problem, ground=problem.ground.scaled(problem.ground.contact_scale, EXACT * problem.ground.terrain_scale)
    )
    information = solution.information.copy()
    for one, sign in ((problem, -1.0), (exact, 1.0)):
        rows = ground_rows(one, solution.state)
        columns = rows.columns[0]
        information[np.ix_(columns, columns)] += sign * rows.jacobian[0].T @ rows.jacobian[0]
    slope = velocity_rows(problem, solution.evaluation.motion, np.flatnonzero(~problem.contact), at_end=False)
    slope = slope[:, :, : problem.columns.size]

    def deviation(covariance: Array) -> Array:
        return np.sqrt(np.einsum("kij,jl,kil->k", slope, covariance, slope))

    now, without = deviation(fit.independent), deviation(fit.scale**2 * inverse(information, partly=True))
    return float(np.median(now / np.maximum(without, 1e-300))) if len(slope) else 1.0


def _on_shutters(views: Sequence[View], fits: Sequence[Fit]) -> Iterator[Remark]:
    """Rolling shutters that were not given."""
    for i, view in enumerate(views):
        found = []
        for fit in fits:
            column = fit.setup.problem.columns.readout[i]
            if column >= 0:
                found.append((fit.solution.state.readout_s[i], np.sqrt(fit.covariance[column, column])))
        if found:
            value, sigma = np.median(found, axis=0)
            text = (
                f"The rolling shutter of view {view.name} is not given: a readout of {1e3 * value:.0f} ± "
                f"{1e3 * sigma:.0f} ms was fitted beside the motion, and the deviations contain it. Give the time of "
                "a row, 0 for a global shutter."
            )
            yield Remark(text, "note", f"shutter {view.name}")
