# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera is to be found from: pairs that are checked, what is free of the lens, and where to begin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...georeference import GlobalShift
from ...vectors import Array, Mask
from ..model import GUESSED_FOCAL, INTRINSICS, Camera

FREE_LENS = ("f", "fx", "fy", "c", "cx", "cy", "k1", "k2", "k3", "p1", "p2")
"""What can be free of the lens: "f" are both focal lengths in their ratio, "c" both coordinates of the centre."""

PHONE_CENTRE, PHONE_K1 = 0.007, 0.015
"""What is usual of lenses that nobody has calibrated: standard deviations of the centre from the image's middle, in
widths of the image, and of the distortion k1 from none.

An assumption, of telephones, whose video is corrected for most of its distortion: 13 px of 1920, and a corner that is
bent by 15 px of a wide one. Of single calibrations that are printed, a good colour camera of 1920 px is 0.2 and 0.3 %
off with k1 0.026, old web cameras 1 to 4 % with k1 beyond 0.1: what lies beyond this shows in residuals of 12 pairs.
"""

POSE_PAIRS = 4
"""Give the pose of a camera whose lens is known."""

OUTSIDE = "Check the size of the image, and that v counts down from its top"
EXCHANGED = (
    "With u and v exchanged all pairs lie inside: exchange them (u counts to the right, v down), or check whether "
    "the image is turned"
)


@dataclass(frozen=True, eq=False)
class Problem:
    """n pairs, and what of the lens is free.

    Attributes
    ----------
    pixels, points : (n, 2) [px], (n, 3) local [m].
    sigma_px, sigma_m : (n,) their standard deviations.
    basis : (9, k) how the parameters of the lens follow the k free ones.
    """

    pixels: Array
    points: Array
    sigma_px: Array
    sigma_m: Array
    basis: Array

    @property
    def unknowns(self) -> int:
        return 6 + self.basis.shape[1]


def needed_pairs(free: Sequence[str]) -> int:
    """The fewest pairs that `resect` accepts for what is free of the lens."""
    k = len(free_columns(free))
    return max(POSE_PAIRS + 1, (6 + k + 1) // 2 + 1) if k else POSE_PAIRS


def checked_pairs(
    pixels: ArrayLike,
    points: ArrayLike,
    sigma_px: ArrayLike,
    sigma_m: ArrayLike,
    width: int,
    height: int,
    names: Sequence[str] | None,
    rows: Sequence[int] | None,
    source: str | None,
) -> tuple[Problem, list[str]]:
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
    outside = _outside(image, width, height)
    for i in np.flatnonzero(outside):
        u, v = image[i]
        raise refuse(
            i,
            f"the pixel ({u:g}, {v:g}) lies outside the image of {width} × {height} px",
            EXCHANGED if are_exchanged(image, width, height) else OUTSIDE,
        )
    for values, least, what in ((image, 1e-6, "pixel"), (world, 1e-9, "point")):
        gap = np.abs(values[:, None] - values[None]).max(axis=2)
        for i, j in np.argwhere(np.triu(gap < least, 1)):
            raise refuse(j, f"the same {what} as pair {named[i]}", "Leave one of the two out")
    return Problem(image, world, spread_px, spread_m, np.zeros((9, 0))), named


def are_exchanged(image: Array, width: int, height: int) -> bool:
    """Whether pixels (n, 2) of which some are outside of the image all lie inside with u and v exchanged."""
    return not _outside(image[:, ::-1], width, height).any()


def _outside(image: Array, width: int, height: int) -> Mask:
    """(n,) which pixels (n, 2) are not in the image."""
    return np.asarray(((image < 0) | (image > [width, height])).any(axis=1))


def free_columns(free: Sequence[str]) -> tuple[str, ...]:
    """The free parameters of the lens, each once, in the order of `INTRINSICS`, "f" first."""
    asked = [
        name
        for each in ([free] if isinstance(free, str) else free)
        for name in ("cx cy" if each == "c" else each).split()
    ]
    if unknown := [name for name in asked if name not in ("f", *INTRINSICS)]:
        raise InputError(f"“{unknown[0]}” is no parameter of a camera", advice=f"Choose among {', '.join(FREE_LENS)}")
    if "f" in asked and {"fx", "fy"} & set(asked):
        raise InputError("f already frees fx and fy", advice="Free either f, or fx and fy")
    return tuple(name for name in ("f", *INTRINSICS) if name in asked)


def basis_of(camera: Camera, columns: tuple[str, ...]) -> Array:
    """(9, k) how the nine parameters of the lens follow the free ones."""
    basis = np.zeros((9, len(columns)))
    for column, name in enumerate(columns):
        if name == "f":
            basis[:2, column] = 1.0, camera.fy / camera.fx
        else:
            basis[INTRINSICS.index(name), column] = 1.0
    return basis


def assumed_of_lens(camera: Camera, problem: Problem) -> tuple[tuple[str, ...], Array]:
    """Names of what is neither free of the lens nor known, and the standard deviations of what was taken for it (q,).

    A centre in the very middle of the image and a distortion of nothing at all are nobody's measurement.
    """
    free: Mask = np.asarray(problem.basis.any(axis=1), dtype=np.bool_)
    assumed: dict[str, float] = {}
    for name, middle in (("cx", camera.width / 2), ("cy", camera.height / 2)):
        if not free[INTRINSICS.index(name)] and getattr(camera, name) == middle:
            assumed[name] = PHONE_CENTRE * camera.width
    bent = any(getattr(camera, name) for name in INTRINSICS[4:])
    if not bent and not free[4:].any():
        assumed["k1"] = PHONE_K1
    return tuple(assumed), np.array(list(assumed.values()))


def starting_camera(
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


def check_number(problem: Problem, columns: tuple[str, ...], source: str | None) -> None:
    n, k, needed = len(problem.points), len(columns), needed_pairs(columns)
    if n < needed:
        what = "the pose alone" if not k else f"the pose and {', '.join(columns)}"
        lock = f"Add pairs (10 or more are good), or lock parameters: {POSE_PAIRS} pairs give the pose"
        easier = lock if k else "Add pairs"
        raise InputError(f"{n} pairs are too few: {what} needs {needed}", file=source, advice=easier)
    for values, what in ((problem.points, "points"), (problem.pixels, "pixels")):
        extent = np.linalg.svd(values - values.mean(axis=0), compute_uv=False)
        if extent[1] < 1e-3 * extent[0]:
            raise InputError(
                f"All {what} lie on a line, from which no camera can be found",
                file=source,
                advice="Add pairs beside the line",
            )
