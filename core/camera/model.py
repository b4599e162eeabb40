# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera: a pinhole with Brown's lens distortion, its pose, and the way between points and pixels.

Pixels are counted from the top-left *corner* of the image, u to the right and v down, so that the centre of the first
pixel is (0.5, 0.5); OpenCV's own functions count from that centre. The camera's axes are x right, y down, z forward:
``Xc = R (X − position)``.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..georeference import GlobalShift
from ..vectors import Array, cross, norm, unit

INTRINSICS = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "p1", "p2")
"""The inner parameters of a camera, in the order of every array of them; the focal lengths and the centre in px."""

FULL_FRAME_DIAGONAL_MM = 43.2666
"""Of the 36 × 24 mm frame, by which cameras state their equivalent focal length."""
GUESSED_FOCAL = 1.2
"""Of a lens that nothing is known of, in widths of the image: 45°, as phones and camcorders have before zooming."""
SIGMA_PX = 1.0
"""Standard deviation of a picked pixel's u and of its v, where none is given [px]."""

NEWTON_STEPS = 60
TABLE_SIZE = 512


def _forward() -> Array:
    return np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera at a place.

    Attributes
    ----------
    width, height : of the image [px].
    fx, fy, cx, cy : focal lengths and principal point [px].
    k1, k2, k3, p1, p2 : Brown's radial and tangential coefficients as OpenCV has them, on normalised coordinates.
    position : (3,) of the centre of projection, local [m].
    rotation : (3, 3) from the world to the camera; without one it looks along +y with z up.
    shift : between local and survey coordinates.

    Raises
    ------
    InputError : a number is not finite, a length not positive, or the rotation not a rotation.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    position: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=_forward)
    shift: GlobalShift = field(default_factory=GlobalShift)

    def __post_init__(self) -> None:
        position = np.array(self.position, dtype=np.float64)
        rotation = np.array(self.rotation, dtype=np.float64)
        if self.width <= 0 or self.height <= 0:
            raise InputError(f"The camera's image is {self.width} × {self.height} px, which is no size")
        if not np.isfinite(self.intrinsics).all() or self.fx <= 0 or self.fy <= 0:
            raise InputError("The camera's inner parameters are not finite, or its focal length is not positive")
        if position.shape != (3,) or not np.isfinite(position).all():
            raise InputError("The camera's position is not three finite numbers")
        if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
            raise InputError("The camera's rotation is not three rows of three finite numbers")
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise InputError("The camera's rotation is not a rotation: its rows are not at right angles, or it mirrors")
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rotation", rotation)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self.width, self.height

    @property
    def intrinsics(self) -> Array:
        """(9,) in the order of `INTRINSICS`."""
        return np.array([getattr(self, name) for name in INTRINSICS], dtype=np.float64)

    def in_shift(self, shift: GlobalShift) -> "Camera":
        """The same camera in the local frame of another shift."""
        return replace(self, position=shift.to_local(self.shift.to_survey(self.position)), shift=shift)


@dataclass(frozen=True, eq=False)
class Projection:
    """Pixels of n points, and how they answer to everything that made them.

    Attributes
    ----------
    pixel : (n, 2) [px]; NaN, with the derivatives, behind the camera and beyond the validity of the distortion.
    depth : (n,) along the camera's axis [m].
    d_point, d_position : (n, 2, 3) by the point and by the camera's position [px/m].
    d_rotation : (n, 2, 3) by w at 0 in ``R' = exp([w]×) R`` [px/rad]: about the camera's own axes.
    focal_px : (2,) of the camera.
    plane, bent : (n, 2) normalised coordinates without and with the distortion.
    """

    pixel: Array
    depth: Array
    d_point: Array
    d_rotation: Array
    d_position: Array
    focal_px: Array
    plane: Array
    bent: Array

    @property
    def d_intrinsics(self) -> Array:
        """(n, 2, 9) by the inner parameters in the order of `INTRINSICS`; made when asked for, since few ask."""
        x, y = self.plane.T
        r2 = x * x + y * y
        found = np.zeros((x.size, 2, 9))
        found[:, 0, 0], found[:, 1, 1] = self.bent.T
        found[:, 0, 2] = found[:, 1, 3] = 1.0
        found[:, :, 4:7] = (self.plane * self.focal_px)[:, :, None] * np.stack([r2, r2**2, r2**3], axis=1)[:, None, :]
        found[:, :, 7] = np.stack([2 * x * y, r2 + 2 * y * y], axis=1) * self.focal_px
        found[:, :, 8] = np.stack([r2 + 2 * x * x, 2 * x * y], axis=1) * self.focal_px
        return found


def with_intrinsics(camera: Camera, values: ArrayLike) -> Camera:
    """The camera with other inner parameters, (9,) in the order of `INTRINSICS`."""
    numbers = np.asarray(values, dtype=np.float64).tolist()
    return replace(camera, **dict(zip(INTRINSICS, numbers, strict=True)))


def look_at(
    width: int,
    height: int,
    position: ArrayLike,
    target: ArrayLike,
    *,
    focal_px: float | None = None,
    fov_deg: float | None = None,
    up: ArrayLike = (0.0, 0.0, 1.0),
) -> Camera:
    """An undistorted camera that looks at a point.

    Parameters
    ----------
    position, target : (3,) local [m].
    focal_px, fov_deg : one of them: the focal length, or the horizontal angle of view.
    up : (3,) what is upright in the image; when the camera looks along it, +y is taken.

    Raises
    ------
    InputError : neither or both of the focal length and the angle of view; the target is the position.
    """
    if (focal_px is None) == (fov_deg is None):
        raise InputError("A camera needs either its focal length or its angle of view")
    focal = focal_px if focal_px is not None else focal_of_view(width, fov_deg or 0.0)
    place, upright = np.asarray(position, dtype=np.float64), np.asarray(up, dtype=np.float64)
    forward = unit(np.asarray(target, dtype=np.float64) - place)
    if not np.isfinite(forward).all():
        raise InputError("The camera cannot look at the place where it stands")
    right = cross(forward, upright)
    if norm(right) < 1e-9 * norm(upright):
        right = cross(forward, np.array([0.0, 1.0, 0.0]))
    if norm(right) < 1e-9:
        from scipy.linalg import null_space

        right = null_space(forward[None])[:, 0]
    right = unit(right)
    rotation = np.stack([right, cross(forward, right), forward])
    return Camera(width, height, focal, focal, width / 2, height / 2, position=place, rotation=rotation)


def pinhole(width: int, height: int, focal_px: float, shift: GlobalShift | None = None) -> Camera:
    """A camera without distortion whose axis meets the middle of the image."""
    return Camera(width, height, focal_px, focal_px, width / 2, height / 2, shift=shift or GlobalShift())


def focal_of_view(width: int, fov_deg: float) -> float:
    """Focal length [px] of a horizontal angle of view."""
    return float(width / 2 / np.tan(np.radians(fov_deg) / 2))


def full_frame_mm(focal_px: float, size: tuple[int, int]) -> float:
    """What a focal length [px] is on full frame, by the diagonal of the image [mm]."""
    return FULL_FRAME_DIAGONAL_MM * focal_px / float(np.hypot(*size))


def project(
    camera: Camera, points: ArrayLike, *, position: Array | None = None, rotation: Array | None = None
) -> Array:
    """Pixels of points, (n, 2) [px].

    Parameters
    ----------
    points : (n, 3) local [m].
    position, rotation : (n, 3) and (n, 3, 3), a pose for each point instead of the camera's own.

    Notes
    -----
    A point behind the camera, or beyond the radius to which the distortion can be inverted, has no pixel: NaN.
    """
    seen = _in_camera(camera, points, position, rotation)
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = seen[:, :2] / seen[:, 2:]
    plane[~(seen[:, 2] > 0)] = np.nan
    return distort(camera, plane)


def rays(
    camera: Camera, pixels: ArrayLike, *, position: Array | None = None, rotation: Array | None = None
) -> tuple[Array, Array]:
    """The rays through pixels: origins (n, 3) local [m] and unit directions (n, 3).

    Parameters
    ----------
    pixels : (n, 2) [px], inside the image or not.
    position, rotation : (n, 3) and (n, 3, 3), a pose for each pixel instead of the camera's own.

    Notes
    -----
    A pixel that the distortion reaches from no direction has no ray: its direction is NaN.
    """
    plane = undistort(camera, pixels)
    seen: Array = np.ones((len(plane), 3))
    seen[:, :2] = plane
    seen = unit(seen)
    turn: Array = camera.rotation if rotation is None else np.asarray(rotation, dtype=np.float64)
    directions = seen @ turn if turn.ndim == 2 else np.einsum("nij,ni->nj", turn, seen)
    place = camera.position if position is None else np.asarray(position, dtype=np.float64)
    return np.array(np.broadcast_to(place, directions.shape)), directions


def validity_radius(camera: Camera) -> float:
    """The undistorted radius, on normalised coordinates, up to which the distortion is monotonic; inf without end."""
    return _validity_radius(camera.k1, camera.k2, camera.k3, float(np.hypot(camera.p1, camera.p2)))


def distort(camera: Camera, normalised: ArrayLike) -> Array:
    """Pixels of normalised coordinates (x/z, y/z), (n, 2) → (n, 2) [px]; NaN beyond the validity of the distortion."""
    plane = np.asarray(normalised, dtype=np.float64).reshape(-1, 2)
    if _is_distorted(camera):
        reach = validity_radius(camera)
        plane = np.where((np.einsum("ni,ni->n", plane, plane) <= reach**2)[:, None], plane, np.nan)
        plane = _distorted(camera, plane)
    return plane * [camera.fx, camera.fy] + [camera.cx, camera.cy]


def undistort(camera: Camera, pixels: ArrayLike) -> Array:
    """Normalised coordinates (x/z, y/z) of pixels, (n, 2) → (n, 2), by Newton's method; NaN where there are none."""
    plane = (np.asarray(pixels, dtype=np.float64).reshape(-1, 2) - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    return _undistorted(camera, plane) if _is_distorted(camera) else plane


def project_with_derivatives(
    camera: Camera, points: ArrayLike, *, position: Array | None = None, rotation: Array | None = None
) -> Projection:
    """Pixels and their derivatives; the parameters are those of `project`."""
    seen = _in_camera(camera, points, position, rotation)
    depth = seen[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = seen[:, :2] / seen[:, 2:]
        inverse = 1 / depth
    reach = validity_radius(camera)
    plane[~((depth > 0) & (np.einsum("ni,ni->n", plane, plane) <= reach**2))] = np.nan
    focal = np.array([camera.fx, camera.fy])
    bent = _distorted(camera, plane)

    a, b, c = _bending(camera, plane)
    by_plane = np.stack([np.stack([a, b], axis=1), np.stack([b, c], axis=1)], axis=1) * focal[:, None]
    by_seen = np.empty((depth.size, 2, 3))
    by_seen[:, :, :2] = by_plane * inverse[:, None, None]
    by_seen[:, :, 2] = -np.einsum("nij,nj->ni", by_plane, plane) * inverse[:, None]
    turn = camera.rotation if rotation is None else np.asarray(rotation, dtype=np.float64)
    by_point = by_seen @ turn

    return Projection(
        pixel=bent * focal + [camera.cx, camera.cy],
        depth=depth,
        d_point=by_point,
        d_rotation=cross(seen[:, None, :], by_seen),
        d_position=-by_point,
        focal_px=focal,
        plane=plane,
        bent=bent,
    )


def rotation_from_vector(vector: ArrayLike) -> Array:
    """exp([w]×), (..., 3) [rad] → (..., 3, 3): Rodrigues' formula."""
    w = np.asarray(vector, dtype=np.float64)
    angle = norm(w)[..., None, None]
    skew = np.zeros((*w.shape, 3))
    skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0] = np.moveaxis(w, -1, 0)
    skew -= np.swapaxes(skew, -1, -2)
    return np.eye(3) + np.sinc(angle / np.pi) * skew + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (skew @ skew)


def vector_from_rotation(rotation: ArrayLike) -> Array:
    """The rotation vector of rotations, (..., 3, 3) → (..., 3) [rad], of length 0…π."""
    q = quaternion_from_rotation(rotation)
    sine = norm(q[..., 1:])
    angle = 2 * np.arctan2(sine, q[..., 0])
    ratio = np.divide(angle, sine, out=np.full(sine.shape, 2.0), where=sine > 0)
    return q[..., 1:] * ratio[..., None]


def quaternion_from_rotation(rotation: ArrayLike) -> Array:
    """Unit quaternions w, x, y, z with w ≥ 0 of rotations, (..., 3, 3) → (..., 4): Shepperd 1978."""
    r = np.asarray(rotation, dtype=np.float64)
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    # Row i is 4 qᵢ q: the row of the largest component is well conditioned.
    products = np.empty((*r.shape[:-2], 4, 4))
    products[..., 0, 0], products[..., 1, 1] = 1 + xx + yy + zz, 1 + xx - yy - zz
    products[..., 2, 2], products[..., 3, 3] = 1 - xx + yy - zz, 1 - xx - yy + zz
    for i, j, value in (
        (0, 1, r[..., 2, 1] - r[..., 1, 2]),
        (0, 2, r[..., 0, 2] - r[..., 2, 0]),
        (0, 3, r[..., 1, 0] - r[..., 0, 1]),
        (1, 2, r[..., 0, 1] + r[..., 1, 0]),
        (1, 3, r[..., 0, 2] + r[..., 2, 0]),
        (2, 3, r[..., 1, 2] + r[..., 2, 1]),
    ):
        products[..., i, j] = products[..., j, i] = value
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = unit(np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :])
    return np.where(q[..., :1] < 0, -q, q)


def _is_distorted(camera: Camera) -> bool:
    return any((camera.k1, camera.k2, camera.k3, camera.p1, camera.p2))


def _in_camera(camera: Camera, points: ArrayLike, position: Array | None, rotation: Array | None) -> Array:
    """(n, 3) camera coordinates [m]."""
    away = np.asarray(points, dtype=np.float64).reshape(-1, 3) - (camera.position if position is None else position)
    turn = camera.rotation if rotation is None else np.asarray(rotation, dtype=np.float64)
    return away @ turn.T if turn.ndim == 2 else np.einsum("nij,nj->ni", turn, away)


def _distorted(camera: Camera, plane: Array) -> Array:
    """Brown's distortion of normalised coordinates, (n, 2) → (n, 2)."""
    r2 = np.einsum("ni,ni->n", plane, plane)[:, None]
    tangential = np.array([camera.p2, camera.p1])
    stretch = 1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3))
    return plane * (stretch + 2 * (plane @ tangential)[:, None]) + r2 * tangential


def _bending(camera: Camera, plane: Array) -> tuple[Array, Array, Array]:
    """The symmetric derivative of the distortion, [[a, b], [b, c]], each (n,)."""
    x, y = plane.T
    r2 = x * x + y * y
    stretch = 1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3))
    slope = 2 * (camera.k1 + r2 * (2 * camera.k2 + 3 * camera.k3 * r2))
    a = stretch + slope * x * x + 2 * camera.p1 * y + 6 * camera.p2 * x
    b = slope * x * y + 2 * camera.p1 * x + 2 * camera.p2 * y
    return a, b, stretch + slope * y * y + 6 * camera.p1 * y + 2 * camera.p2 * x


def _undistorted(camera: Camera, target: Array) -> Array:
    """The inverse of `_distorted` within its validity radius, (n, 2); NaN outside the image of that disc.

    The distortion is the gradient of a function that is convex within the disc, so that Newton's method with shortened
    steps finds the one point there is.
    """
    reach = validity_radius(camera)
    at = _radially_undistorted(camera, target, reach)
    miss = target - _distorted(camera, at)
    scale, length = 1 + norm(target), norm(miss)
    share = np.ones(len(target))
    active = np.flatnonzero(np.isfinite(target).all(axis=1))
    for _ in range(NEWTON_STEPS):
        active = active[(length[active] > 4e-16 * scale[active]) & (share[active] > 1e-6)]
        if not active.size:
            break
        here, gap = at[active], miss[active]
        a, b, c = _bending(camera, here)
        determinant = np.maximum(a * c - b * b, 1e-12)
        step = np.stack([c * gap[:, 0] - b * gap[:, 1], a * gap[:, 1] - b * gap[:, 0]], axis=1)
        new = _within(here + step * (share[active] / determinant)[:, None], reach)
        new_miss = target[active] - _distorted(camera, new)
        new_length = norm(new_miss)
        better = new_length < length[active]
        improved = active[better]
        at[improved], miss[improved], length[improved] = new[better], new_miss[better], new_length[better]
        share[active] = np.where(better, np.minimum(2 * share[active], 1), share[active] / 4)
    return np.where((length <= 1e-12 * scale)[:, None], at, np.nan)


def _radially_undistorted(camera: Camera, target: Array, reach: float) -> Array:
    """Where Newton's method starts: the inverse of the radial part, from a table, (n, 2)."""

    def bent(radius: Array) -> Array:
        r2 = radius**2
        return radius * (1 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3)))

    length = norm(target)
    far = np.max(length[np.isfinite(length)], initial=1e-3)
    end = min(far, reach)
    while end < reach and bent(np.array(end)) < far:
        end = min(2 * end, reach)
    radius = np.linspace(0, end, TABLE_SIZE)
    found = np.interp(length, np.maximum.accumulate(bent(radius)), radius)
    return target * np.divide(found, length, out=np.ones_like(length), where=length > 0)[:, None]


def _within(plane: Array, reach: float) -> Array:
    """Points drawn back onto the disc that the distortion is valid in, (n, 2)."""
    if np.isinf(reach):
        return plane.copy()
    return plane * np.minimum(1, reach / np.maximum(norm(plane), 1e-300))[:, None]


@lru_cache(maxsize=256)
def _validity_radius(k1: float, k2: float, k3: float, tangential: float) -> float:
    """Where the derivative of the distortion, a symmetric matrix, first stops being positive definite in a direction.

    With L = 1 + k1 r² + …, L' = d(rL)/dr, a = p r and c the cosine of the direction from the tangential axis, the
    determinant is L L' + 2 a c (L' + 3 L) + 16 a² c² − 4 a². Its least value over c lies at c = −1, where it is
    (L' − 6a)(L − 2a), or between, where it is L L' − (L' + 3L)²/16 − 4 a².
    """
    if not any((k1, k2, k3, tangential)):
        return float("inf")
    r = np.polynomial.Polynomial([0.0, 1.0])
    stretch = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    slope = 1 + 3 * k1 * r**2 + 5 * k2 * r**4 + 7 * k3 * r**6
    side = tangential * r
    ends = [_positive_roots(slope - 6 * side), _positive_roots(stretch - 2 * side)]
    if tangential:
        between = _positive_roots(stretch * slope - (slope + 3 * stretch) ** 2 / 16 - 4 * side**2)
        ends.append(between[(slope + 3 * stretch)(between) < 16 * side(between)])
    return float(np.min(np.concatenate(ends), initial=np.inf))


def _positive_roots(polynomial: np.polynomial.Polynomial) -> Array:
    trimmed = polynomial.trim(1e-13)  # what is less bends no lens, and makes the roots overflow
    if trimmed.degree() < 1:
        return np.empty(0)
    roots = trimmed.roots()
    return np.real(roots[(np.abs(np.imag(roots)) < 1e-9) & (np.real(roots) > 0)])
