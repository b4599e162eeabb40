# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain normal at the scale of a block: what a block of some size feels, not what the scanner saw."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..compiled import in_chunks
from ..errors import InputError
from ..vectors import Array, dot, perpendicular, unit
from .raycast import ClosestPoints, closest_points
from .surface import Surface

LEAST_SPACINGS = 3.0
"""A patch has to span some points: its radius is at least this many mean point spacings."""
REACH_RADII = 10.0
"""A point further than this many radii from the surface has no terrain normal: it is not an impact on it."""
SEED_COSINE = -0.5
"""Faces further than 120° from the closest triangle are another sheet, whatever it is part of."""
STEEP_FIT = 0.5
"""Least cosine between the fitted plane's normal and the mean face normal; below, the patch is no sheet."""
AROUND = 6
"""Faces around a vertex of a triangle mesh, on the average: so often each is a corner."""
RIM, LEAST_RIM = 0.93 * float(np.sqrt(np.pi)), 0.3
"""What the rim of a patch takes off the variance of its plane, over the root of the number of its points; no more."""
LEAST = 1e-12
"""Keeps a paraboloid through points on a line from being singular."""


@dataclass(frozen=True, eq=False)
class LocalNormals:
    """Terrain normals at n points.

    Attributes
    ----------
    normal : (n, 3) unit, out of the ground; NaN where there is no surface within reach.
    spread_deg : (n,) area-weighted root mean square angle between the faces and the plane [°]; NaN likewise.
    tilt_deg : (n,) root mean square angle by which the plane is off, since so many points with so much noise tell of
        it [°]; NaN likewise.
    area_m2 : (n,) surface inside the sphere that was used [m²]; 0 likewise.
    point : (n, 3) centre of the sphere: the closest point of the surface [m]; NaN likewise.
    """

    normal: Array
    spread_deg: Array
    tilt_deg: Array
    area_m2: Array
    point: Array


def default_normal_radius(surface: Surface, block_diameter_m: float) -> float:
    """Radius of the patch [m]: the block's diameter, at least three times the mean point spacing."""
    return max(float(block_diameter_m), LEAST_SPACINGS * surface.mean_spacing_m)


def block_scale_normals(
    surface: Surface, points: Any, radius_m: float, *, reach_m: float | None = None
) -> LocalNormals:
    """Normal of the plane fitted to the surface within a sphere around the closest point of the surface.

    Parameters
    ----------
    points : (n, 3) local coordinates [m], near the surface.
    radius_m : of the sphere [m], see `default_normal_radius`.
    reach_m : how far from the surface a point may be [m]; ten radii when None.

    Raises
    ------
    InputError : a point that is not finite, a radius that is not positive.

    Notes
    -----
    The plane is the one of least squared distances (the smallest principal axis) from the surface, integrated over
    the triangles clipped to the sphere: large triangles count with their part inside, small ones with their area.
    Vertices do not matter.

    Only the sheet under the point counts: the patch grows from the closest triangle over shared edges inside the
    sphere, first to faces less than 120° from that triangle, which gives a first plane; then anew, to faces less than
    90° from this plane's normal. So a single odd triangle does not decide, and the other side of a plate stays out.
    Where the patch is as deep as wide (a notch), its smallest principal axis lies across it, more than 60° from the
    mean of the face normals; then this mean is the normal.

    The error of the plane is that of a least-squares plane through the patch's vertices, each off by the same standard
    deviation, independent of the others: of the scan, and of what lies between the points. It is told by what is left
    of a paraboloid through them, so that waves longer than the patch, which the points do show, are no noise.
    """
    radius = float(radius_m)
    if not (np.isfinite(radius) and radius > 0):
        raise InputError(
            f"The normal's radius is {radius_m} m", advice="Give a positive radius, such as the block's diameter"
        )
    closest = closest_points(surface, points, REACH_RADII * radius if reach_m is None else float(reach_m))
    seed = surface.face_normals[closest.face]
    first, _ = _planes(_integrated(surface, closest, radius, seed, seed, SEED_COSINE)[0])
    normal, extent = _planes(_integrated(surface, closest, radius, first, first)[0])
    sums, products = _integrated(surface, closest, radius, first, normal, with_products=True)
    area = sums[:, 0]
    found = area > 0
    spread = np.sqrt(np.divide(sums[:, 13], area, out=np.full(len(area), np.nan), where=found))
    normal[~found] = np.nan
    tilt = np.minimum(_tilts(extent, radius * np.sqrt(_leftover(products)), products[:, 0, 0] / AROUND), spread)
    return LocalNormals(normal, np.degrees(spread), np.degrees(tilt), area.copy(), closest.point)


def normals_beside(surface: Surface, points: Array, radius_m: float, facing: Array) -> Array:
    """(n, 3) normals as of `block_scale_normals`, of points beside others whose normals `facing` (n, 3) are known.

    A third of the work: the patch is of the faces less than 90° from that normal. NaN where there is no surface.
    """
    closest = closest_points(surface, points, REACH_RADII * radius_m)
    sums, _ = _integrated(surface, closest, radius_m, facing, facing)
    normal, _ = _planes(sums)
    normal[sums[:, 0] == 0] = np.nan
    return normal


def _integrated(
    surface: Surface,
    closest: ClosestPoints,
    radius: float,
    facing: Array,
    axes: Array,
    least_cosine: float = 0.0,
    with_products: bool = False,
) -> tuple[Array, Array]:
    """Sums over the patches, and products of their corners' terms, (0, 7, 7) unless wanted; see `patch_kernels`."""
    from . import patch_kernels

    n, terms = len(closest.face), patch_kernels.TERMS
    sums = np.zeros((n, patch_kernels.SUMS))
    products = np.zeros((n if with_products else 0, terms, terms))
    across = np.stack(perpendicular(axes), axis=1)

    def chunk(start: int, stop: int) -> None:
        stamp = np.zeros(len(surface.faces), np.int32)
        patch_kernels.integrate_patches(
            surface.vertices, surface.faces, surface.face_normals, surface.neighbours, closest.point, closest.face,
            facing, least_cosine, axes, radius, across, stamp, sums, products, start, stop,
        )  # fmt: skip

    in_chunks(chunk, n)
    return sums, products


def _leftover(products: Array) -> Array:
    """(n,) variance of the vertices about their paraboloid; where they are too few for one, about their mean height."""
    full = products + np.swapaxes(np.tril(products, -1), 1, 2)
    count, bent = full[:, 0, 0] / AROUND, full.shape[1] - 1
    variance = np.divide(full[:, -1, -1], full[:, 0, 0], out=np.zeros(len(full)), where=count > 0)
    enough = np.flatnonzero(count > 2 * bent)
    if enough.size:
        normal, right = full[enough, :bent, :bent], full[enough, :bent, -1]
        fitted = np.einsum(
            "ni,ni->n", right, np.linalg.solve(normal + LEAST * np.eye(bent), right[:, :, None])[:, :, 0]
        )
        left = np.maximum(full[enough, -1, -1] - fitted, 0.0) / AROUND
        variance[enough] = left / (count[enough] - bent)
    return variance


def _tilts(extent: Array, sigma_m: Array, points: Array) -> Array:
    """(n,) root mean square error of the planes' direction [rad].

    Parameters
    ----------
    extent : (n, 3) mean squared distance of the surface from the middle along its principal axes, ascending [m²].
    sigma_m : (n,) standard deviation of each of so many `points` (n,).

    Notes
    -----
    The surface between the points is part of the patch, so that those about its rim, within and without, count in part.
    That is as if the rim were blurred by linear interpolation: it takes 0.93 spacings over the radius off the variance.
    """
    rim = np.maximum(1 - RIM / np.sqrt(np.maximum(points, 1.0)), LEAST_RIM)
    with np.errstate(invalid="ignore", divide="ignore"):
        return sigma_m * np.sqrt(rim * (1 / extent[:, 1] + 1 / extent[:, 2]) / np.maximum(points, 1.0))


def _planes(sums: Array) -> tuple[Array, Array]:
    """(n, 3) normals of the planes of least squares, on the side of the face normals, zero where there is no area; and
    (n, 3) the mean squares along the principal axes, the normal first [m²]."""
    area = np.where(sums[:, 0] > 0, sums[:, 0], 1.0)
    mean = sums[:, 1:4] / area[:, None]
    second = np.empty((len(sums), 3, 3))
    for (i, j), column in zip(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)), range(4, 10), strict=True):
        second[:, i, j] = second[:, j, i] = sums[:, column] / area - mean[:, i] * mean[:, j]
    extent, axes = np.linalg.eigh(second)
    normal, outward = axes[:, :, 0], unit(sums[:, 10:13])
    cosine = dot(normal, outward)
    normal = np.where((np.abs(cosine) < STEEP_FIT)[:, None], outward, normal * np.sign(cosine)[:, None])
    return np.nan_to_num(normal, nan=0.0), extent
