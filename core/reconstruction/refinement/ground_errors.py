# SPDX-License-Identifier: GPL-3.0-or-later
"""By how much a block that touches the terrain is off it, and how alike this is from contact to contact.

Blocks are no spheres, and a terrain hides what lies between its points: this differs from contact to contact. The
terrain's own errors do not. The registration of a scan lifts all of it, and what a scan takes for the ground (grass,
the drift of a flight line) is off alike over some metres, or many. How the cameras lie to the terrain is not known
better than a survey can tell, however well each is known by itself: an error of all cameras moves all contacts alike.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...vectors import Array

SMOOTH_M = (20.0, 2.0)
"""Over these distances the terrain's smooth errors, of half the variance each, become less alike by 1/e [m]: several
contacts, and from one to the next."""


@dataclass(frozen=True, eq=False)
class GroundErrors:
    """Of the distances between the terrain and the g blocks that touch it.

    Attributes
    ----------
    contact_m : (g,) standard deviations of what differs from contact to contact [m].
    terrain : (g, g) covariance of what the terrain's accuracy does [m²].
    datum : (g, g) of what the cameras' places do, all alike [m²].
    contact_scale, terrain_scale : factors on the standard deviations of the two that the fit found; 1 before.
    whitening : (g, g) inverse of the Cholesky factor of the covariance of both.
    """

    contact_m: Array
    terrain: Array
    datum: Array
    contact_scale: float
    terrain_scale: float
    whitening: Array

    @property
    def sigma_m(self) -> Array:
        """(g,) standard deviation of each distance [m]."""
        terrain = self.terrain_scale**2 * np.diag(self.terrain) + np.diag(self.datum)
        return np.sqrt((self.contact_scale * self.contact_m) ** 2 + terrain)

    @property
    def own_sigma_m(self) -> Array:
        """(g,) the same without what the cameras do to it [m]."""
        return np.sqrt(self.sigma_m**2 - np.diag(self.datum))

    @property
    def tilting_scale(self) -> float:
        """Factor on the terrain's accuracy where what contacts are off by beyond their own is the terrain's: errors
        that differ from contact to contact may be waves of it, which tilt it."""
        beyond = self.own_sigma_m**2 - np.minimum(self.contact_scale, 1.0) ** 2 * self.contact_m**2
        return float(np.sqrt(np.mean(beyond / np.diag(self.terrain)))) if self.contact_m.size else 1.0

    def with_contact(self, contact_m: Array) -> "GroundErrors":
        """With other standard deviations of what differs from contact to contact, (g,) [m]."""
        return replace(self, contact_m=contact_m).scaled(self.contact_scale, self.terrain_scale)

    def scaled(self, contact_scale: float, terrain_scale: float) -> "GroundErrors":
        """With other factors."""
        variance = np.diag((contact_scale * self.contact_m) ** 2) + terrain_scale**2 * self.terrain + self.datum
        return replace(
            self,
            contact_scale=contact_scale,
            terrain_scale=terrain_scale,
            whitening=np.linalg.inv(np.linalg.cholesky(variance)),
        )


def terrain_tilt(sigma_terrain_m: float, across_m: Array) -> Array:
    """(n,) root mean square angle by which the terrain's smooth errors tilt planes of some extent (n,) [m], in radians.

    Two points so far apart are off by amounts that are alike only so far: their difference tilts the plane.
    """
    unlike = 1 - _alike(across_m)
    return np.asarray(2 * sigma_terrain_m * np.sqrt(unlike) / across_m)  # about both axes


def _alike(apart_m: Array) -> Array:
    """Correlation of the terrain's smooth errors at some distance."""
    return np.asarray(np.mean([np.exp(-apart_m / smooth) for smooth in SMOOTH_M], axis=0))


def normal_variance(sigma_terrain_m: float, normal: Array) -> Array:
    """(n,) variance of the distance along normals (n, 3) between a terrain and what it is of [m²].

    sigma_terrain_m : as of `ground_errors`: a height common to all of the terrain, and smooth errors beside.
    """
    upward = np.nan_to_num(normal[:, 2], nan=1.0)
    return np.asarray(sigma_terrain_m**2 * (upward**2 + 1.0))


def ground_errors(
    place: Array, normal: Array, contact_m: Array, sigma_terrain_m: float, datum_m: float = 0.0
) -> GroundErrors:
    """Errors at places (g, 3) with terrain normals (g, 3).

    Parameters
    ----------
    sigma_terrain_m : accuracy of the terrain [m]: the standard deviation of a height common to all of it, and of smooth
        errors beside.
    datum_m : standard deviation of each coordinate of how the cameras lie to the terrain [m].
    """
    apart = np.sqrt(((place[:, None] - place[None]) ** 2).sum(axis=2))
    upward = np.nan_to_num(normal[:, 2], nan=1.0)
    terrain = sigma_terrain_m**2 * (np.outer(upward, upward) + _alike(apart))
    across = np.where(np.isfinite(normal), normal, [0.0, 0.0, 1.0])
    count = contact_m.size
    empty = np.zeros((count, count))
    return GroundErrors(contact_m, terrain, datum_m**2 * across @ across.T, 1.0, 1.0, empty).scaled(1.0, 1.0)
