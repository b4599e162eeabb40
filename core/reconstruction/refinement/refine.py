# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement: whole trajectories fitted to the block's pixels in every frame."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...constants import GRAVITY_MPS2
from ...errors import InputError, RockfallError
from ...progress import Progress, part, silent
from ..block import Block, per_pick
from ..choices import FREE, LOSSES, SIGMA_AIM, SIGMA_DATUM, Loss
from ..drag import Drag
from ..picks import Picks
from ..placement import check_placement
from .deviations import Fit, with_covariance
from .mending import mend
from .result import Refinement, summarise
from .search import Rival, search, search_one_by_one, solve_with_noise
from .setup import Setup, prepare, set_up
from .starts import check_start, find_clocks
from .views import PixelObservations, View, check_observations

if TYPE_CHECKING:
    from ...terrain.surface import Surface

__all__ = ["FREE", "SIGMA_AIM", "PixelObservations", "Refinement", "View", "refine"]


def refine(
    picks: Picks,
    views: Sequence[View],
    observations: PixelObservations,
    *,
    surface: "Surface | None" = None,
    block: Block | Mapping[str, Block] | None = None,
    gravity_mps2: float = GRAVITY_MPS2,
    drag: Drag | None = None,
    normal_radius_m: float | None = None,
    free: Sequence[str] = (),
    sigma_terrain_m: float | None = None,
    sigma_aim: float = SIGMA_AIM,
    sigma_datum: float = SIGMA_DATUM,
    loss: Loss = "huber",
    site: str = "",
    progress: Progress = silent,
) -> Refinement:
    """Fit the places and times of the picks to where the block's centre is seen in the frames.

    Parameters
    ----------
    picks : contact points on the terrain, as a person marked them: the first guess, and what holds what the pixels
        do not determine. A time without sigma_time_s counts as known to a frame, a place without sigma_position_m to
        10 m.
    views : the cameras, their clocks roughly right.
    observations : pixels of the block's centre.
    surface : terrain, which every block on the ground touches as a sphere; without it, places come from the rays alone.
    block, gravity_mps2, drag, normal_radius_m, site : see `reconstruct`; progress : called at every step.
    free : what else to fit, of `FREE`: the poses of the views that have a covariance, the clocks of all but the first
        view, the drag coefficient, gravity. All trajectories share these.
    sigma_terrain_m : accuracy of the terrain: the standard deviation of a height common to all of it, and of errors
        that are alike over some 20 m. None takes half the point spacing, from 2 to 20 cm. From contact to contact the
        centre's distance from the terrain differs from its radius by a tenth of it (blocks are no spheres) and a
        quarter of the point spacing times the spread of the terrain's normals (what lies between the points).
    sigma_aim : standard deviation of what all pixels of a trajectory in a view are off the block's centre by, alike, in
        parts of its diameter; 0 takes the pixels for the centre's.
    sigma_datum : standard deviation of how each camera that has a covariance lies to the terrain beside it, in parts of
        its distance; 0 takes both for of one survey. The mean of all cameras counts: what one is off by itself, the
        others show.
    loss : how pixels that do not fit count; "linear" trusts all of them.

    Raises
    ------
    InputError : pixels of a trajectory without picks, or at no time of its picks; a block behind a camera; nothing to
        fit; picks off the terrain.
    RockfallError : a parameter out of range; no flight joins the picks.

    Notes
    -----
    Unknowns are the centre's place and the time at every release, impact, contact and stop (the nodes of
    `find_segments`); free flights run between them in closed form, or with drag; rolling is straight and even. All
    are found at once, with the residuals: pixels at the time of their row (rolling shutter) against the projected
    centre and what is aimed off it, one part of the block's apparent diameter for each trajectory and view, itself
    against `sigma_aim`; the centre's distance from the terrain against the radius; the marked times, and the places
    where they have a standard deviation; places marked in flight that have one; the poses against their covariance
    where the cameras are fitted; readouts that are not given against 15 ± 9 ms. What the pixels tell of the errors of
    the terrain corrects what was stated. The standard deviations contain the errors of poses that are held, by their
    covariance or, without one, 0.1° and 0.2 % of the distance; and accelerations of the flights beside gravity and
    drag where the pixels ask for them. A flight thus counts with all its frames, and an impact is where and when two
    flights meet.
    """
    block = block if block is not None else Block()
    free_set = _check_parameters(free, loss, gravity_mps2, sigma_terrain_m, normal_radius_m)
    if not (np.isfinite(sigma_aim) and sigma_aim >= 0):
        raise RockfallError(f"The standard deviation of the aim must be a number not below zero, not {sigma_aim}.")
    if not (np.isfinite(sigma_datum) and sigma_datum >= 0):
        raise RockfallError(f"The standard deviation of the datum must be a number not below zero, not {sigma_datum}.")
    if surface is not None:
        picks = picks.in_shift(surface.shift)
        check_placement(picks, surface, per_pick(picks, block, lambda one: one.diameter_m))
    moved_views = tuple(view.in_shift(picks.shift) for view in views)
    check_observations(observations, moved_views, set(picks.trajectory.tolist()))
    if "camera" in free_set and all(view.pose_covariance is None for view in moved_views):
        raise InputError(
            "The cameras are to be fitted, but no view has a covariance of its pose",
            advice="Solve the camera from pairs of pixels and points, or hold it",
        )
    if "drag" in free_set and drag is None:
        drag = Drag()

    ground = prepare(picks, surface, block, drag, normal_radius_m, sigma_terrain_m)
    names = [name for name in dict.fromkeys(picks.trajectory.tolist()) if name in set(observations.trajectory.tolist())]
    groups = [names] if free_set else [[name] for name in names]
    errors = sigma_aim, sigma_datum
    setups = [set_up(ground, moved_views, observations, group, gravity_mps2, free_set, *errors) for group in groups]
    clock = free_set & {"clock", "clock_drift"}

    def alone(name: str) -> Setup:
        return set_up(ground, moved_views, observations, [name], gravity_mps2, clock, *errors)

    count = len(setups)
    parts = [progress] if count == 1 else [part(progress, i, count) for i in range(count)]
    fits = [_solve(setup, alone, loss, free_set, own) for setup, own in zip(setups, parts, strict=True)]
    return summarise(
        ground, moved_views, observations, fits,
        block=block, drag=drag, gravity_mps2=gravity_mps2, normal_radius_m=normal_radius_m, free=free_set, site=site,
    )  # fmt: skip


def _solve(setup: Setup, alone: Callable[[str], Setup], loss: Loss, free: frozenset[str], progress: Progress) -> Fit:
    """Solve a problem; several trajectories, from where each of them is likeliest by itself.

    Parameters
    ----------
    alone : makes the problem of one of the trajectories, with the poses held.
    """
    check_start(setup)
    state, rivals = setup.state, list[Rival]()
    several = len(setup.names) > 1
    if several:
        state, rivals = search_one_by_one(setup, [alone(name) for name in setup.names], loss, progress)
    if "clock" in free:
        state = find_clocks(setup.problem, state)
    if several:
        found = solve_with_noise(
            setup.problem, state, loss, lambda *_: progress("Fitting all trajectories together", 0, 0)
        )
    else:
        found = search(setup, state, loss, progress)
    mended = mend(found, loss, progress)
    if mended.found is not found:
        found = replace(mended.found, rivals=())
    return with_covariance(
        replace(setup, problem=found.problem, noise=found.noise), found.solution, [*rivals, *found.rivals], mended
    )


def _check_parameters(
    free: Sequence[str], loss: str, gravity_mps2: float, sigma_terrain_m: float | None, normal_radius_m: float | None
) -> frozenset[str]:
    unknown = sorted(set(free) - set(FREE))
    if unknown:
        raise RockfallError(f"{unknown[0]!r} cannot be fitted. Choose from {', '.join(FREE)}.")
    if loss not in LOSSES:
        raise RockfallError(f"Unknown loss {loss!r}. Use one of {', '.join(LOSSES)}.")
    if not (np.isfinite(gravity_mps2) and gravity_mps2 > 0):
        raise RockfallError(f"Gravity must be a positive number [m/s²], not {gravity_mps2}.")
    for label, value in (("standard deviation of the terrain", sigma_terrain_m), ("normal's radius", normal_radius_m)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise RockfallError(f"The {label} must be a positive number [m], not {value}.")
    return frozenset(free)
