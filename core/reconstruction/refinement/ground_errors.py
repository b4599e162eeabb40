# SPDX-License-Identifier: GPL-3.0-or-later
"""By how much a block that touches the terrain is off it, and how alike this is from contact to contact.

Blocks are no spheres, and a terrain hides what lies between its points: this differs from contact to contact. The
terrain's own errors do not. The registration of a scan lifts all of it, and what a scan takes for the ground (grass,
the drift of a flight line) is off alike over metres.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...vectors import Array

SMOOTH_M = 20.0
"""Over this distance the terrain's smooth errors become less alike by 1/e [m]: several contacts."""


@dataclass(frozen=True, eq=False)
class GroundErrors:
    """Of the distances between the terrain and the g blocks that touch it.

    Attributes
    ----------
    contact_m : (g,) standard deviations of what differs from contact to contact [m].
    terrain : (g, g) covariance of what the terrain's accuracy does [m²].
    contact_scale, terrain_scale : factors on the standard deviations of the two that the fit found; 1 before.
    whitening : (g, g) inverse of the Cholesky factor of the covariance of both.
    """

    contact_m: Array
    terrain: Array
    contact_scale: float
    terrain_scale: float
    whitening: Array

    @property
    def sigma_m(self) -> Array:
        """(g,) standard deviation of each distance [m]."""
        return np.sqrt((self.contact_scale * self.contact_m) ** 2 + self.terrain_scale**2 * np.diag(self.terrain))

    def with_contact(self, contact_m: Array) -> "GroundErrors":
        """With other standard deviations of what differs from contact to contact, (g,) [m]."""
        return replace(self, contact_m=contact_m).scaled(self.contact_scale, self.terrain_scale)

    def scaled(self, contact_scale: float, terrain_scale: float) -> "GroundErrors":
        """With other factors."""
        variance = np.diag((contact_scale * self.contact_m) ** 2) + terrain_scale**2 * self.terrain
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
    slope = sigma_terrain_m * np.sqrt(2 * -np.expm1(-across_m / SMOOTH_M)) / across_m
    return np.asarray(np.sqrt(2.0) * slope)  # about both axes


def normal_variance(sigma_terrain_m: float, normal: Array) -> Array:
    """(n,) variance of the distance along normals (n, 3) between a terrain and what it is of [m²].

    sigma_terrain_m : as of `ground_errors`: a height common to all of the terrain, and smooth errors beside.
    """
    upward = np.nan_to_num(normal[:, 2], nan=1.0)
    return np.asarray(sigma_terrain_m**2 * (upward**2 + 1.0))


def ground_errors(place: Array, normal: Array, contact_m: Array, sigma_terrain_m: float) -> GroundErrors:
    """Errors at places (g, 3) with terrain normals (g, 3).

    Parameters
    ----------
    sigma_terrain_m : accuracy of the terrain [m]: the standard deviation of a height common to all of it, and of smooth
        errors beside.
    """
    apart = np.sqrt(((place[:, None] - place[None]) ** 2).sum(axis=2))
    upward = np.nan_to_num(normal[:, 2], nan=1.0)
    terrain = sigma_terrain_m**2 * (np.outer(upward, upward) + np.exp(-apart / SMOOTH_M))
    count = contact_m.size
    return GroundErrors(contact_m, terrain, 1.0, 1.0, np.zeros((count, count))).scaled(1.0, 1.0)
