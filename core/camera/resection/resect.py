# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera from pairs, with what it rests on.

Least squares on the pixels with the errors of both sides, after a start that needs no guess and hardly cares for wrong
pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...georeference import GlobalShift
from ...least_squares import inverse
from ...remarks import Remark
from ...vectors import Array, Mask, distance_to_ray, norm
from ..model import SIGMA_PX, Camera, rays
from ..quality import POSE, CameraQuality
from .adjustment import Solution, moved_with, sigma_without, without_each
from .advice import Geometry, remarks_on
from .pair_choice import choose, choose_near
from .problem import Problem, basis_of, check_number, checked_pairs, free_columns, starting_camera
from .starting import find_starts
from .uncertainty import confidence, worst_sigma


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
    covariance : (p, p) [rad, m, px, 1], with what few pairs cannot show (`uncertainty`): 1.96 standard deviations
        hold 95 %; infinite when the pairs do not determine the parameters.
    scatter : residuals in units of the stated errors, 1 when they agree; NaN without redundancy.
    redundancy : observations more than unknowns.
    remarks : what a user should know, the gravest first.
    wrong : names of the pairs left out, or their numbers from 1.
    asked : names of pairs that are used, and that a person should look at again: the camera hangs on them.
    by_lens : (p, p) part of the covariance that comes from what was assumed of the lens.
    doubt : (n,) probability that a pair is wrong, of what the others say.
    whole : (15, 15) covariance of pose and lens together, as in `CameraQuality`; None where it is infinite.
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
    asked: tuple[str, ...]
    by_lens: Array
    doubt: Array
    whole: Array | None

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
        covariance = self.covariance - self.by_lens
        pose, lens, both = covariance[:6, :6], covariance[6:, 6:], covariance[:6, 6:]
        if not lens.size or np.isinf(pose).any():
            return pose
        return pose - both @ inverse(lens, partly=True) @ both.T

    @property
    def quality(self) -> CameraQuality:
        """What the camera rests on."""
        worst = worst_sigma(self.covariance[3:6, 3:6])
        return CameraQuality(int(self.used.sum()), self.redundancy, self.wrong, self.asked, worst, self.whole)

    def correlation(self, first: str, second: str) -> float:
        """Correlation of two parameters, −1…1; NaN when they are not determined."""
        i, j = self.parameters.index(first), self.parameters.index(second)
        with np.errstate(invalid="ignore"):
            return float(self.covariance[i, j] / np.sqrt(self.covariance[i, i] * self.covariance[j, j]))


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
    problem, named = checked_pairs(pixels, points, sigma_px, sigma_m, width, height, names, rows, source)
    columns = free_columns(free)
    shift = shift if shift is not None else camera.shift if camera is not None else GlobalShift()
    start = starting_camera(camera, width, height, shift, columns)
    problem = replace(problem, basis=basis_of(start, columns))
    check_number(problem, columns, source)

    near = choose_near(start, problem, robust) if camera is not None else None
    if near is not None:
        (solution, used), other = near, None
    else:
        solution, other, used = _searched(start, problem, columns, robust, with_pose=camera is not None)
    known = confidence(solution, problem, used, other, robust=robust)
    residual_m = distance_to_ray(problem.points, *rays(solution.camera, problem.pixels))
    depth = (problem.points - solution.camera.position) @ solution.camera.rotation[2]
    rmse = float(np.sqrt(np.mean(np.einsum("ni,ni->n", solution.residual, solution.residual)[used])))
    redundancy = 2 * int(used.sum()) - problem.unknowns
    deletion = without_each(solution)
    alone = sigma_without(deletion, used) * known.factor
    geometry = Geometry(
        camera=solution.camera,
        pixels=problem.pixels[used],
        points=problem.points[used],
        depth=depth[used],
        parameters=(*POSE, *columns),
        covariance=known.covariance,
        scatter=known.scatter,
        redundancy=redundancy,
        rmse_px=rmse,
        other=other.camera if other is not None else None,
        wrong=tuple(
            (named[i], float(norm(solution.residual[i])), moved_with(solution, problem, used, i))
            for i in np.flatnonzero(~used).tolist()
        ),
        asked=tuple(
            (named[i], float(norm(solution.residual[i])), float(norm(deletion.residual[i])), float(known.moved_m[i]))
            for i in np.flatnonzero(known.asked).tolist()
        ),
        relied_on=(named[int(np.argmax(alone))], float(alone.max()), worst_sigma(known.own[3:6, 3:6])),
    )
    return Resection(
        camera=solution.camera,
        residual_px=solution.residual,
        residual_m=residual_m,
        used=used,
        rmse_px=rmse,
        parameters=(*POSE, *columns),
        covariance=known.covariance,
        scatter=known.scatter,
        redundancy=redundancy,
        remarks=remarks_on(geometry),
        wrong=tuple(name for name, *_ in geometry.wrong),
        asked=tuple(name for name, *_ in geometry.asked),
        by_lens=known.by_lens,
        doubt=known.doubt,
        whole=known.whole if np.isfinite(known.whole).all() else None,
    )


def _searched(
    start: Camera, problem: Problem, columns: tuple[str, ...], robust: bool, *, with_pose: bool
) -> tuple[Solution, Solution | None, Mask]:
    """The best of the cameras that three pairs at a time lead to, a rival, and which pairs are believed."""
    starts = find_starts(
        start,
        problem.pixels,
        problem.points,
        problem.sigma_px,
        problem.sigma_m,
        free_focal=bool({"f", "fx", "fy"} & set(columns)),
        with_pose=with_pose,
    )
    return choose(start, problem, starts, robust)
