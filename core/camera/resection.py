# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera from pairs of a pixel and a point of the terrain: its pose, and as much of its lens as they can tell.

Least squares on the pixels with the errors of both sides, after a start that needs no guess and hardly cares for wrong
pairs. A pair is called wrong by its residual against what the others predict (Baarda 1968, with a variance that is
estimated together with the stated one).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtri

from ..errors import InputError, RockfallError
from ..georeference import GlobalShift
from ..least_squares import damped_step, inverse, scales
from ..remarks import Remark
from ..vectors import Array, Mask, distance_to_ray, norm
from .model import (
    GUESSED_FOCAL,
    INTRINSICS,
    SIGMA_PX,
    Camera,
    project_with_derivatives,
    rays,
    rotation_from_vector,
    with_intrinsics,
)
from .resection_advice import Geometry, remarks_on
from .starting import Starts, find_starts

POSE = ("rx", "ry", "rz", "x", "y", "z")
"""The pose's parameters: turns about the camera's own axes [rad], and the position [m]."""

POSE_PAIRS = 4
"""Give the pose of a camera whose lens is known."""

STEPS = 50
ADJUSTED = 3
"""From how many of the starts the least squares begin."""

STARTS_OF_MAJORITIES = 8
COST_OF_A_PAIR = 30.0
"""What leaving a pair out costs, in squared residuals: sets of few pairs fit too well to be compared without."""

RIVAL = 6.0
"""Another camera is worth a word when its squared residuals are no more than this above the best one's."""

HUBER = 3.0
PRIOR_FREEDOM = 6.0
"""How many observations the stated errors are worth when the scatter of the pairs is judged."""

FALSE_ALARM = 0.002
"""Chance that a sound set of pairs loses one."""

TRUSTED_SCATTER = 3.0
"""Up to this many times the stated errors, all pairs are believed unless one stands out."""


@dataclass(frozen=True, eq=False)
class Resection:
    """A camera found from n pairs.

    Attributes
    ----------
    camera : what was found, with what was known.
    residual_px : (n, 2) measured minus computed pixel [px]; NaN where the point has no pixel.
    residual_m : (n,) distance at the point between it and the pixel's ray [m].
    used : (n,) False for pairs that were left out as wrong.
    rmse_px : root of the mean squared length of the residuals of the used pairs [px].
    parameters : (p,) names in the order of the covariance: `POSE`, then what was free of the lens.
    covariance : (p, p) [rad, m, px, 1]; infinite when the pairs do not determine the parameters.
    scatter : residuals in units of the stated errors, 1 when they agree; NaN without redundancy. Above 1 the
        covariance is enlarged by its square.
    redundancy : observations more than unknowns.
    remarks : what a user should know, the gravest first.
    wrong : names of the pairs left out, or their numbers from 1.
    """

    camera: Camera
    residual_px: Array
    residual_m: Array
    used: Mask
    rmse_px: float
    parameters: tuple[str, ...]
    covariance: Array
    scatter: float
    redundancy: int
    remarks: tuple[Remark, ...]
    wrong: tuple[str, ...]

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations by name [rad, m, px, 1]; a common focal length also as fx and fy."""
        found = dict(zip(self.parameters, np.sqrt(np.diagonal(self.covariance)).tolist(), strict=True))
        if "f" in found:
            found["fx"], found["fy"] = found["f"], found["f"] * self.camera.fy / self.camera.fx
        return found

    @property
    def pose_covariance(self) -> Array:
        """(6, 6) rotation about the camera's axes [rad], position [m]."""
        return self.covariance[:6, :6]

    @property
    def pose_covariance_given_lens(self) -> Array:
        """(6, 6) the same with the lens held as found: for what moves the pose and not the lens.

        With `pose_covariance` it could back away as if the focal length grew along.
        """
        pose, lens = self.covariance[:6, :6], self.covariance[6:, 6:]
        both = self.covariance[:6, 6:]
        return pose - both @ inverse(lens, partly=True) @ both.T if lens.size else pose

    def correlation(self, first: str, second: str) -> float:
        """Correlation of two parameters, −1…1; NaN when they are not determined."""
        i, j = self.parameters.index(first), self.parameters.index(second)
        with np.errstate(invalid="ignore"):
            return float(self.covariance[i, j] / np.sqrt(self.covariance[i, i] * self.covariance[j, j]))


@dataclass(frozen=True, eq=False)
class _Problem:
    """The pairs, and which columns of the lens are free: `basis` is (9, k)."""

    pixels: Array
    points: Array
    sigma_px: Array
    sigma_m: Array
    basis: Array

    @property
    def unknowns(self) -> int:
        return 6 + self.basis.shape[1]


@dataclass(frozen=True, eq=False)
class _Solution:
    """A camera, the residuals of all pairs, (n, 2) [px], their derivatives (n, 2, p) and covariances (n, 2, 2).

    `normal` and `right` are the weighted normal equations of the pairs in use, `cost` is Huber's, `misfit` that plus
    what makes solutions with different covariances comparable.
    """

    camera: Camera
    residual: Array
    slopes: Array
    noise: Array
    normal: Array
    right: Array
    cost: float
    misfit: float


def resect(
    pixels: ArrayLike,
    points: ArrayLike,
    width: int,
    height: int,
    *,
    free: Sequence[str] = ("f",),
    camera: Camera | None = None,
    sigma_px: ArrayLike = SIGMA_PX,
    sigma_m: ArrayLike = 0.0,
    names: Sequence[str] | None = None,
    robust: bool = True,
    shift: GlobalShift | None = None,
    rows: Sequence[int] | None = None,
    source: str | None = None,
) -> Resection:
    """Find a camera from pairs of pixels and points.

    Parameters
    ----------
    pixels : (n, 2) from the image's top-left corner [px].
    points : (n, 3) in the local frame of `shift` [m].
    width, height : of the image [px].
    free : what is unknown of the lens: "f" (both focal lengths in their ratio), "fx", "fy", "c" (both of the centre),
        "cx", "cy", "k1", "k2", "k3", "p1", "p2"; empty for the pose alone.
    camera : where to start, and the values of everything that is not free. Without one the centre is the image's and
        the lens free of distortion.
    sigma_px, sigma_m : standard deviations of a pixel's coordinate and of a point's, one or (n,).
    names : (n,) of the pairs; rows, source : (n,) rows and name of the file they come from, for messages.
    robust : leave out pairs that do not fit the others.
    shift : of the points; the camera's own without one.

    Raises
    ------
    InputError : what the pairs cannot give, with the row: too few, not finite, outside the image, twice the same, all
        on a line; or a parameter that does not exist, or a known lens for another image size.
    RockfallError : no camera sees the points where they were picked.

    Notes
    -----
    With the fewest pairs there can be, nothing tells a wrong one: `remarks` say so.
    """
    problem, named = _checked(pixels, points, sigma_px, sigma_m, width, height, names, rows, source)
    columns = _free_columns(free)
    shift = shift if shift is not None else camera.shift if camera is not None else GlobalShift()
    start = _starting_camera(camera, width, height, shift, columns)
    problem = replace(problem, basis=_basis(start, columns))
    _check_number(problem, columns, source)

    focal_is_free = bool({"f", "fx", "fy"} & set(columns))
    starts = find_starts(
        start,
        problem.pixels,
        problem.points,
        problem.sigma_px,
        problem.sigma_m,
        free_focal=focal_is_free,
        with_pose=camera is not None,
    )
    solution, other, used = _solve(start, problem, starts, robust)
    scatter, covariance = _spread(solution, problem, used)
    residual_m = _distances(solution.camera, problem)
    depth = (problem.points - solution.camera.position) @ solution.camera.rotation[2]
    rmse = float(np.sqrt(np.mean(np.einsum("ni,ni->n", solution.residual, solution.residual)[used])))
    redundancy = 2 * int(used.sum()) - problem.unknowns
    geometry = Geometry(
        camera=solution.camera,
        pixels=problem.pixels[used],
        points=problem.points[used],
        depth=depth[used],
        parameters=(*POSE, *columns),
        covariance=covariance,
        scatter=scatter,
        redundancy=redundancy,
        rmse_px=rmse,
        other=other.camera if other is not None else None,
        wrong=tuple((named[i], float(norm(solution.residual[i]))) for i in np.flatnonzero(~used)),
    )
    return Resection(
        camera=solution.camera,
        residual_px=solution.residual,
        residual_m=residual_m,
        used=used,
        rmse_px=rmse,
        parameters=(*POSE, *columns),
        covariance=covariance,
        scatter=scatter,
        redundancy=redundancy,
        remarks=remarks_on(geometry),
        wrong=tuple(name for name, _ in geometry.wrong),
    )


def _checked(
    pixels: ArrayLike,
    points: ArrayLike,
    sigma_px: ArrayLike,
    sigma_m: ArrayLike,
    width: int,
    height: int,
    names: Sequence[str] | None,
    rows: Sequence[int] | None,
    source: str | None,
) -> tuple[_Problem, list[str]]:
    """The pairs as arrays, and what each is called."""
    image = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    world = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    n = len(image)
    if len(world) != n:
        raise InputError(f"There are {n} pixels but {len(world)} points", file=source)
    named = [str(name) for name in names] if names is not None else [str(i + 1) for i in range(n)]
    if len(named) != n or (rows is not None and len(rows) != n):
        raise InputError(f"There are {n} pairs, but not as many names or rows", file=source)

    def refuse(index: int, problem: str, advice: str) -> InputError:
        row = int(rows[index]) if rows is not None else None
        return InputError(f"pair {named[index]}: {problem}", file=source, row=row, advice=advice)

    spread_px = np.array(np.broadcast_to(np.asarray(sigma_px, dtype=np.float64), (n,)))
    spread_m = np.array(np.broadcast_to(np.asarray(sigma_m, dtype=np.float64), (n,)))
    finite = np.isfinite(image).all(axis=1) & np.isfinite(world).all(axis=1)
    for i in np.flatnonzero(~finite):
        raise refuse(i, "a coordinate is not a finite number", "Pick it again")
    for i in np.flatnonzero(~((spread_px > 0) & np.isfinite(spread_px) & (spread_m >= 0) & np.isfinite(spread_m))):
        raise refuse(i, "its error is not a positive number", "Give pixels an error above zero, points zero or more")
    outside = (image < 0).any(axis=1) | (image > [width, height]).any(axis=1)
    for i in np.flatnonzero(outside):
        u, v = image[i]
        raise refuse(
            i,
            f"the pixel ({u:g}, {v:g}) lies outside the image of {width} × {height} px",
            "Check the size of the image, and that v counts down from its top",
        )
    for values, least, what in ((image, 1e-6, "pixel"), (world, 1e-9, "point")):
        gap = np.abs(values[:, None] - values[None]).max(axis=2)
        for i, j in np.argwhere(np.triu(gap < least, 1)):
            raise refuse(j, f"the same {what} as pair {named[i]}", "Leave one of the two out")
    return _Problem(image, world, spread_px, spread_m, np.zeros((9, 0))), named


def _free_columns(free: Sequence[str]) -> tuple[str, ...]:
    """The free parameters of the lens, each once, in the order of `INTRINSICS`, "f" first."""
    asked = [
        name
        for each in ([free] if isinstance(free, str) else free)
        for name in ("cx cy" if each == "c" else each).split()
    ]
    if unknown := [name for name in asked if name not in ("f", *INTRINSICS)]:
        raise InputError(
            f"“{unknown[0]}” is no parameter of a camera", advice=f"Choose among f, c, {', '.join(INTRINSICS)}"
        )
    if "f" in asked and {"fx", "fy"} & set(asked):
        raise InputError("f already frees fx and fy", advice="Free either f, or fx and fy")
    return tuple(name for name in ("f", *INTRINSICS) if name in asked)


def _basis(camera: Camera, columns: tuple[str, ...]) -> Array:
    """(9, k) how the nine parameters of the lens follow the free ones."""
    basis = np.zeros((9, len(columns)))
    for column, name in enumerate(columns):
        if name == "f":
            basis[:2, column] = 1.0, camera.fy / camera.fx
        else:
            basis[INTRINSICS.index(name), column] = 1.0
    return basis


def _starting_camera(
    camera: Camera | None, width: int, height: int, shift: GlobalShift, columns: tuple[str, ...]
) -> Camera:
    if camera is None:
        if not {"f", "fx"} & set(columns):
            raise InputError(
                "The focal length is neither free nor known", advice="Free it, or give a camera that has it"
            )
        focal = GUESSED_FOCAL * width
        return Camera(width, height, focal, focal, width / 2, height / 2, shift=shift)
    if camera.size != (width, height):
        raise InputError(
            f"The known camera has {camera.width} × {camera.height} px, the image {width} × {height} px",
            advice="A lens is known for one image size; scale its parameters, or free them",
        )
    return camera.in_shift(shift)


def needed_pairs(free: Sequence[str]) -> int:
    """The fewest pairs that `resect` accepts for what is free of the lens."""
    k = len(_free_columns(free))
    return max(POSE_PAIRS + 1, (6 + k + 1) // 2 + 1) if k else POSE_PAIRS


def _check_number(problem: _Problem, columns: tuple[str, ...], source: str | None) -> None:
    n, k, needed = len(problem.points), len(columns), needed_pairs(columns)
    if n < needed:
        what = "the pose alone" if not k else f"the pose and {', '.join(columns)}"
        lock = f"Add pairs (10 or more are good), or lock parameters: {POSE_PAIRS} pairs give the pose"
        easier = lock if k else "Add pairs"
        raise InputError(f"{n} pairs are too few: {what} needs {needed}", file=source, advice=easier)
    centred = problem.points - problem.points.mean(axis=0)
    extent = np.linalg.svd(centred, compute_uv=False)
    if extent[1] < 1e-3 * extent[0]:
        raise InputError(
            "All points lie on a line, from which no camera can be found",
            file=source,
            advice="Add pairs beside the line",
        )
    extent = np.linalg.svd(problem.pixels - problem.pixels.mean(axis=0), compute_uv=False)
    if extent[1] < 1e-3 * extent[0]:
        raise InputError(
            "All pixels lie on a line, from which no camera can be found",
            file=source,
            advice="Add pairs beside the line",
        )


def _solve(start: Camera, problem: _Problem, starts: Starts, robust: bool) -> tuple[_Solution, _Solution | None, Mask]:
    """The best of the starts, adjusted; a rival that fits as well; and which pairs are believed."""
    used = np.ones(len(problem.points), dtype=bool)
    best, other = _best_adjusted(start, problem, starts, used)
    if robust and _may_lose_one(problem, used):
        if best is None or _scatter(best, problem, used) > TRUSTED_SCATTER:
            best, used = _least_contradicted(start, problem, starts)
            other = None
        else:
            best, used = _snooped(problem, best, used)
    if best is None:
        raise RockfallError(
            "No camera sees the points where they were picked. Check that each pixel belongs to its point, that v "
            "counts down from the top of the image, and the points' coordinates."
        )
    return best, other, used


def _may_lose_one(problem: _Problem, used: Mask) -> bool:
    return 2 * (int(used.sum()) - 1) - problem.unknowns >= 1


def _best_adjusted(
    start: Camera, problem: _Problem, starts: Starts, used: Mask
) -> tuple[_Solution | None, _Solution | None]:
    """Least squares from the promising starts: the best, and another one that fits nearly as well."""
    found = [each for index in _promising(starts, used) if (each := _adjust_from(start, problem, starts, index, used))]
    if not found:
        return None, None
    best = min(found, key=lambda each: each.misfit)
    scatter = _scatter(best, problem, used)
    limit = best.misfit + RIVAL * (max(1.0, scatter**2) if np.isfinite(scatter) else 1.0)
    distance = float(norm(problem.points - best.camera.position).mean())
    for each in found:
        if each.misfit < limit and norm(each.camera.position - best.camera.position) > 0.02 * distance:
            return best, each
    return best, None


def _promising(starts: Starts, used: Mask, most: int = ADJUSTED) -> list[int]:
    """Starts that differ, the best first."""
    residual = np.minimum(starts.residual, 1e3)
    cost = np.log1p(residual[:, used] ** 2).sum(axis=1)
    order = np.argsort(cost, kind="stable")
    chosen: list[int] = []
    for index in order.tolist():
        if chosen and (len(chosen) == most or cost[index] > cost[chosen[0]] + 3 * np.sqrt(used.sum())):
            break
        # The same minimum has the same residuals, whatever the units of its parameters.
        if all(np.abs(residual[index] - residual[other]).max() > 0.3 for other in chosen):
            chosen.append(index)
    return chosen


def _adjust_from(start: Camera, problem: _Problem, starts: Starts, index: int, used: Mask) -> _Solution | None:
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
        few = _basis(camera, ("f",) if focal_is_free else ())
        first = _adjust(camera, replace(problem, basis=few), used)
        camera = first.camera if first is not None else camera
    return _adjust(camera, problem, used)


def _adjust(camera: Camera, problem: _Problem, used: Mask) -> _Solution | None:
    """Levenberg–Marquardt; the points' errors, seen from the camera, are renewed between rounds."""
    noise = _noise(camera, problem)
    solution = _minimised(camera, problem, used, noise)
    if problem.sigma_m.any():
        for _ in range(3):
            if solution is None:
                break
            noise = _noise(solution.camera, problem)
            solution = _minimised(solution.camera, problem, used, noise)
    return solution


def _noise(camera: Camera, problem: _Problem) -> Array:
    """(n, 2, 2) covariances of the pixels, with the points' errors as the camera sees them [px²]."""
    noise: Array = problem.sigma_px[:, None, None] ** 2 * np.eye(2)
    if problem.sigma_m.any():
        slope = np.nan_to_num(project_with_derivatives(camera, problem.points).d_point)
        noise = noise + problem.sigma_m[:, None, None] ** 2 * (slope @ np.swapaxes(slope, 1, 2))
    return noise


def _minimised(camera: Camera, problem: _Problem, used: Mask, noise: Array) -> _Solution | None:
    trust = np.asarray(np.linalg.inv(noise[used]), dtype=np.float64)
    now = _measured(camera, problem, used, noise, trust)
    damping = 1e-7
    for _ in range(STEPS):
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


def _measured(camera: Camera, problem: _Problem, used: Mask, noise: Array, trust: Array) -> _Solution | None:
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
    return _Solution(
        camera=camera,
        residual=residual,
        slopes=slopes,
        noise=noise,
        normal=flat.T @ tall,
        right=tall.T @ gap.reshape(-1),
        cost=cost,
        misfit=cost - float(np.log(np.linalg.det(trust)).sum()),
    )


def _squares(solution: _Solution) -> Array:
    """(n,) squared residuals in units of their covariance; NaN where a point has no pixel."""
    return np.einsum("ni,nij,nj->n", solution.residual, np.linalg.inv(solution.noise), solution.residual)


def _scatter(solution: _Solution, problem: _Problem, used: Mask) -> float:
    """Residuals of the used pairs in units of the stated errors; NaN without redundancy."""
    redundancy = 2 * int(used.sum()) - problem.unknowns
    return float(np.sqrt(_squares(solution)[used].sum() / redundancy)) if redundancy > 0 else float("nan")


def _least_contradicted(start: Camera, problem: _Problem, starts: Starts) -> tuple[_Solution | None, Mask]:
    """The camera that the fewest pairs contradict, among those that a majority of them leads to."""
    everyone = np.ones(len(problem.points), dtype=bool)
    best: _Solution | None = None
    kept, least = everyone, np.inf
    for index in _promising(starts, everyone, STARTS_OF_MAJORITIES):
        used = _majority(problem, starts.residual[index])
        found = _adjust_from(start, problem, starts, index, used)
        if found is None:
            continue
        found, used = _snooped(problem, found, used)
        cost = float(_squares(found)[used].sum()) + COST_OF_A_PAIR * int((~used).sum())
        if cost < least:
            best, kept, least = found, used, cost
    return best, kept


def _majority(problem: _Problem, residual: Array) -> Mask:
    """The pairs that fit a start, where each pair counts little when it is far off."""
    scale = max(1.0, float(np.median(residual)) / 1.18)  # the median of two normal components
    used = residual < 4.5 * scale
    least = max(4, (problem.unknowns + 2) // 2)
    if used.sum() < least:
        used[np.argsort(residual, kind="stable")[:least]] = True
    return used


def _snooped(problem: _Problem, solution: _Solution, used: Mask) -> tuple[_Solution, Mask]:
    """Pairs leave that the others contradict, the worst first, and return when they are believed again."""
    tried = {used.tobytes()}
    for _ in range(2 * len(used)):
        suspicion = _suspicion(problem, solution, used)
        changed = used.copy()
        leaving, returning = np.where(used, suspicion, -np.inf), np.where(used, np.inf, suspicion)
        if leaving.max() > 1 and _may_lose_one(problem, used) and used.sum() > 4:
            changed[np.argmax(leaving)] = False
        elif returning.min() < 1:
            changed[np.argmin(returning)] = True
        if changed.tobytes() in tried:
            break
        tried.add(changed.tobytes())
        better = _adjust(solution.camera, problem, changed)
        if better is None:
            break
        solution, used = better, changed
    return solution, used


def _suspicion(problem: _Problem, solution: _Solution, used: Mask) -> Array:
    """(n,) each pair's squared residual against what the others predict, over the limit for a wrong pair.

    The variance is that of the others, together with the stated one as if `PRIOR_FREEDOM` observations had shown it,
    and no less than the stated one.
    """
    spread = inverse(solution.normal)
    around = solution.slopes @ spread @ np.swapaxes(solution.slopes, 1, 2)
    expected = solution.noise + np.where(used, -1.0, 1.0)[:, None, None] * around
    suspicion = np.where(used, 0.0, np.inf)
    total = float(_squares(solution)[used].sum())
    freedom = 2 * int(used.sum()) - problem.unknowns + PRIOR_FREEDOM
    for i in range(len(used)):
        shares = np.linalg.eigvalsh(expected[i] / solution.noise[i, 0, 0]) if np.isfinite(expected[i]).all() else [0.0]
        if shares[0] < 1e-6:
            continue  # nothing checks this pair, or it has no pixel
        squared = float(solution.residual[i] @ np.linalg.solve(expected[i], solution.residual[i]))
        rest = max(total - squared, 0.0) if used[i] else total
        others = freedom - 2 if used[i] else freedom
        limit = 2 * fdtri(2, others, 1 - FALSE_ALARM / len(used))
        suspicion[i] = squared / max(1.0, (PRIOR_FREEDOM + rest) / others) / limit
    return suspicion


def _spread(solution: _Solution, problem: _Problem, used: Mask) -> tuple[float, Array]:
    """The scatter, and the covariance of the parameters that goes with it."""
    scatter = _scatter(solution, problem, used)
    larger = max(1.0, scatter**2) if np.isfinite(scatter) else 1.0
    return scatter, inverse(solution.normal) * larger


def _distances(camera: Camera, problem: _Problem) -> Array:
    """(n,) between the points and the rays of their pixels [m]."""
    return distance_to_ray(problem.points, *rays(camera, problem.pixels))
