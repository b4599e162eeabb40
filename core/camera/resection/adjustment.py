# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera that fits pairs best: least squares with the errors of both sides, from a start."""

from dataclasses import dataclass, replace

import numpy as np

from ...least_squares import damped_step, inverse, scales
from ...vectors import Array, Mask, norm
from ..model import Camera, project_with_derivatives, rotation_from_vector, with_intrinsics
from .problem import Problem, basis_of
from .starting import Starts

STEPS = 50
HUBER = 3.0


@dataclass(frozen=True, eq=False)
class Solution:
    """A camera, the residuals of all pairs, (n, 2) [px], their derivatives (n, 2, p) and covariances (n, 2, 2).

    `weight` (n,) is Huber's of each pair, 0 of those that are not used; `normal` and `right` are the normal equations
    with these weights, `cost` is Huber's, `misfit` that plus what makes solutions with other covariances comparable.
    """

    camera: Camera
    residual: Array
    slopes: Array
    noise: Array
    weight: Array
    normal: Array
    right: Array
    cost: float
    misfit: float


def adjusted_from(start: Camera, problem: Problem, starts: Starts, index: int, used: Mask) -> Solution | None:
    """Least squares from one start: the pose and the focal length first, then all; None when a point has no pixel."""
    larger = starts.focal_px[index] / start.fx
    camera = replace(
        start,
        fx=start.fx * larger,
        fy=start.fy * larger,
        position=starts.position[index],
        rotation=starts.rotation[index],
    )
    focal_is_free = bool(problem.basis[:2].any())
    if problem.basis.shape[1] > focal_is_free:
        few = basis_of(camera, ("f",) if focal_is_free else ())
        first = adjusted(camera, replace(problem, basis=few), used)
        camera = first.camera if first is not None else camera
    return adjusted(camera, problem, used)


def adjusted(camera: Camera, problem: Problem, used: Mask, *, steps: int = STEPS) -> Solution | None:
    """Levenberg–Marquardt; the points' errors, seen from the camera, are renewed between rounds."""
    noise = _noise(camera, problem)
    solution = _minimised(camera, problem, used, noise, steps)
    if problem.sigma_m.any():
        for _ in range(3):
            if solution is None:
                break
            noise = _noise(solution.camera, problem)
            solution = _minimised(solution.camera, problem, used, noise, steps)
    return solution


def is_settled(solution: Solution) -> bool:
    """Whether another step would move no parameter by a thousandth of its standard deviation."""
    step = damped_step(solution.normal, solution.right, 0.0)
    return bool(np.abs(step * scales(solution.normal)).max() < 1e-3)


def _noise(camera: Camera, problem: Problem) -> Array:
    """(n, 2, 2) covariances of the pixels, with the points' errors as the camera sees them [px²]."""
    noise: Array = problem.sigma_px[:, None, None] ** 2 * np.eye(2)
    if problem.sigma_m.any():
        slope = np.nan_to_num(project_with_derivatives(camera, problem.points).d_point)
        noise = noise + problem.sigma_m[:, None, None] ** 2 * (slope @ np.swapaxes(slope, 1, 2))
    return noise


def _minimised(camera: Camera, problem: Problem, used: Mask, noise: Array, steps: int) -> Solution | None:
    trust = np.asarray(np.linalg.inv(noise[used]), dtype=np.float64)
    now = _measured(camera, problem, used, noise, trust)
    damping = 1e-7
    for _ in range(steps):
        if now is None:
            break
        step = damped_step(now.normal, now.right, damping)
        moved = _moved(now.camera, problem.basis, step)
        new = _measured(moved, problem, used, noise, trust) if moved is not None else None
        if new is None or new.cost > now.cost * (1 + 1e-12):
            damping = max(10 * damping, 1e-4)
            if damping > 1e6:
                break
            continue
        finished = np.abs(step * scales(now.normal)).max() < 1e-4 or now.cost - new.cost < 1e-9 * new.cost
        now, damping = new, max(damping / 10, 1e-12)
        if finished:
            break
    return now


def _moved(camera: Camera, basis: Array, step: Array) -> Camera | None:
    """The camera after a step; None when its focal length collapses."""
    values = camera.intrinsics + basis @ step[6:]
    if not np.isfinite(step).all() or values[0] < 0.2 * camera.fx or values[1] < 0.2 * camera.fy:
        return None
    moved = replace(
        camera, rotation=rotation_from_vector(step[:3]) @ camera.rotation, position=camera.position + step[3:6]
    )
    return with_intrinsics(moved, values)


def _measured(camera: Camera, problem: Problem, used: Mask, noise: Array, trust: Array) -> Solution | None:
    """Residuals and normal equations at a camera; None when a used point has no pixel."""
    seen = project_with_derivatives(camera, problem.points)
    if not np.isfinite(seen.pixel[used]).all():
        return None
    slopes = np.concatenate([seen.d_rotation, seen.d_position, seen.d_intrinsics @ problem.basis], axis=2)
    residual = problem.pixels - seen.pixel
    gap, slope = residual[used], slopes[used]
    weighted = (trust @ gap[:, :, None])[..., 0]
    squared = np.einsum("ni,ni->n", gap, weighted)
    length = np.sqrt(squared)
    weight = np.minimum(1, HUBER / np.maximum(length, 1e-300))
    flat = slope.reshape(-1, slope.shape[2])
    tall = ((trust * weight[:, None, None]) @ slope).reshape(flat.shape)
    cost = float(np.where(length <= HUBER, squared, 2 * HUBER * length - HUBER**2).sum())
    weights = np.zeros(len(used))
    weights[used] = weight
    return Solution(
        camera=camera,
        residual=residual,
        slopes=slopes,
        noise=noise,
        weight=weights,
        normal=flat.T @ tall,
        right=tall.T @ gap.reshape(-1),
        cost=cost,
        misfit=cost - float(np.log(np.linalg.det(trust)).sum()),
    )


def squares(solution: Solution) -> Array:
    """(n,) squared residuals in units of their covariance; NaN where a point has no pixel."""
    return np.einsum("ni,nij,nj->n", solution.residual, np.linalg.inv(solution.noise), solution.residual)


@dataclass(frozen=True, eq=False)
class Deletion:
    """What each pair looks like to the others: n pairs as if each had been left out, the others kept as they are.

    A pair that is not used is seen by all that are. All from one solution, linearised (Belsley, Kuh and Welsch 1980);
    with Huber's weights, since a pair that weighs less pulls the camera less, too.

    Attributes
    ----------
    residual : (n, 2) of the pair against what the others predict [px]; NaN where they do not determine the camera, or
        it has no pixel.
    expected : (n, 2, 2) its covariance as the errors are stated [px²].
    spread : (n, p, p) covariance of the parameters without the pair; infinite where nothing but it determines them.
    moved : (n, p) by how much the parameters move without it; 0 for pairs that are not used.
    """

    residual: Array
    expected: Array
    spread: Array
    moved: Array

    @property
    def squared(self) -> Array:
        """(n,) squared residuals in units of their covariance; NaN where nothing checks the pair."""
        good = _all_finite(self.residual) & _all_finite(self.expected)
        found = np.full(len(good), np.nan)
        if good.any():
            solved = np.linalg.solve(self.expected[good], self.residual[good][:, :, None])[..., 0]
            found[good] = np.einsum("ni,ni->n", self.residual[good], solved)
        return found


def without_each(solution: Solution) -> Deletion:
    """Each pair against the others."""
    slopes, noise = solution.slopes, solution.noise
    seen = _all_finite(slopes) & _all_finite(solution.residual)
    known = np.where(seen[:, None, None], slopes, 0.0)
    gap = np.where(seen[:, None], solution.residual, np.nan)
    pull = np.swapaxes(known, 1, 2) @ np.linalg.inv(noise) * solution.weight[:, None, None]
    spread = inverse(solution.normal - pull @ known)
    with np.errstate(invalid="ignore"):
        moved = -(spread @ (pull @ np.nan_to_num(gap)[:, :, None]))[..., 0]
        moved[solution.weight == 0] = 0.0
        return Deletion(
            residual=gap - (known @ moved[:, :, None])[..., 0],
            expected=noise + known @ spread @ np.swapaxes(known, 1, 2),
            spread=spread,
            moved=moved,
        )


def sigma_without(deletion: Deletion, used: Mask) -> Array:
    """(n,) standard deviation of the position in its worst direction without each used pair [m]; 0 for the others.

    Infinite where nothing but the pair determines it; as the errors are stated.
    """
    place = deletion.spread[:, 3:6, 3:6]
    known = _all_finite(place)
    sigma = np.where(used, np.inf, 0.0)
    values = np.linalg.eigvalsh(place[known])[:, -1]
    sigma[known] = np.where(used[known], np.sqrt(np.maximum(values, 0.0)), 0.0)
    return sigma


def _all_finite(values: Array) -> Mask:
    """(n,) which of n arrays have finite numbers only."""
    return np.asarray(np.isfinite(values).reshape(len(values), -1).all(axis=1), dtype=np.bool_)


def moved_with(solution: Solution, problem: Problem, used: Mask, pair: int) -> float:
    """By how much the position moves when a pair that was left out is used as well [m]; NaN where it has no pixel."""
    more = used.copy()
    more[pair] = True
    found = adjusted(solution.camera, problem, more)
    return float("nan") if found is None else float(norm(found.camera.position - solution.camera.position))
