# SPDX-License-Identifier: GPL-3.0-or-later
"""Surface through points with known normals, in space: between tetrahedra in the open and tetrahedra in the ground."""

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, Mask, cross, dot, norm

DATA = 3.0
"""How much more the place of a tetrahedron counts than the surface that it would leave."""
ROUNDS = 12
"""So often tetrahedra are given anew to the side that makes the surface smaller."""


def surface_in_space(points: Array, normals: Array, max_edge_m: float) -> NDArray[np.int32]:
    """Faces (m, 3) over points (n, 3), their normals on the side of those of the points.

    Parameters
    ----------
    normals : (n, 3) unit, out of the ground.
    max_edge_m : longest edge, in space [m]; longer ones bridge what was not scanned.

    Notes
    -----
    Each tetrahedron of the Delaunay tetrahedra of the points is in the open or in the ground. No point is nearer to the
    middle of its circumscribed sphere than its own corners, so the side on which that middle lies of their planes tells
    (Amenta & Bern 1999, with the normals known). Tetrahedra in doubt, flat ones among the points of a sheet, are given
    to the side that leaves less surface. The surface is what lies between both: it has no holes, no borders but those
    where edges are too long, and folds back as often as the points do.
    """
    from scipy.spatial import Delaunay

    n = len(points)
    low, high = points.min(axis=0), points.max(axis=0)
    reach = float(norm(high - low)) + 1.0
    sides = np.stack([low - reach, high + reach])
    corners = np.array([[sides[i, 0], sides[j, 1], sides[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    places = np.vstack([points, corners])
    found = Delaunay(places)
    tetrahedra, beside = found.simplices, found.neighbors
    side = _sides(places, np.vstack([normals, np.zeros((8, 3))]), tetrahedra)
    opened = _smaller_surface(places, tetrahedra, beside, side)
    faces = _between(places, tetrahedra, beside, opened)
    faces = faces[(faces < n).all(axis=1)]
    corner = points[faces]
    edges = norm(corner - np.roll(corner, 1, axis=1))
    return faces[edges.max(axis=1) <= max_edge_m].astype(np.int32)


def _sides(places: Array, normals: Array, tetrahedra: NDArray[np.int32]) -> Array:
    """(t,) cosine of the middle of the circumscribed sphere to the normals of its points: 1 in the open, -1 below."""
    a = places[tetrahedra[:, 0]]
    b, c, d = (places[tetrahedra[:, k]] - a for k in (1, 2, 3))
    b2, c2, d2 = dot(b, b), dot(c, c), dot(d, d)
    with np.errstate(all="ignore"):  # of flat tetrahedra, which are in doubt
        middle = b2[:, None] * cross(c, d) + c2[:, None] * cross(d, b) + d2[:, None] * cross(b, c)
        middle /= (2.0 * dot(b, cross(c, d)))[:, None]
        total = dot(normals[tetrahedra[:, 0]], middle)
        for k, corner in ((1, b), (2, c), (3, d)):
            total += dot(normals[tetrahedra[:, k]], middle - corner)
        cosine = total / (4.0 * norm(middle))
    return np.nan_to_num(cosine, nan=0.0, posinf=0.0, neginf=0.0)


def _smaller_surface(places: Array, tetrahedra: NDArray[np.int32], beside: NDArray[np.int32], side: Array) -> Mask:
    """(t,) whether tetrahedra are in the open, once those in doubt went to where most of their own surface is."""
    areas = np.stack([norm(_across(places, tetrahedra, k)[1]) / 2 for k in range(4)], axis=1)
    total = np.maximum(areas.sum(axis=1), np.finfo(float).tiny)
    inner = beside >= 0
    opened, chance = side > 0, np.random.default_rng(0)
    for _ in range(ROUNDS):
        beside_open = opened[beside]
        leaning = (areas * (inner & beside_open)).sum(axis=1) - (areas * (inner & ~beside_open)).sum(axis=1)
        wanted = leaning / total + DATA * side > 0
        # Half of those that want to change do, by chance: neighbours that changed places would do so for ever.
        changed = (wanted != opened) & (chance.random(len(opened)) < 0.5)
        opened = opened ^ changed
    return opened


def _across(places: Array, tetrahedra: NDArray[np.int32], k: int) -> tuple[NDArray[np.int32], Array]:
    """The face opposite of corner k of tetrahedra, and twice its vector area."""
    face = tetrahedra[:, [i for i in range(4) if i != k]]
    a = places[face[:, 0]]
    return face, cross(places[face[:, 1]] - a, places[face[:, 2]] - a)


def _between(
    places: Array, tetrahedra: NDArray[np.int32], beside: NDArray[np.int32], opened: Mask
) -> NDArray[np.int32]:
    """Faces between open tetrahedra and others, facing the open."""
    found = []
    for k in range(4):
        lower = np.flatnonzero(~opened & (beside[:, k] >= 0) & opened[beside[:, k]])
        upper = beside[lower, k]
        face, twice = _across(places, tetrahedra[lower], k)
        a = places[face[:, 0]]
        own = dot(twice, places[tetrahedra[lower, k]] - a)
        # The fourth corner of the other tetrahedron is the one of which the sum is left over.
        other = tetrahedra[upper].sum(axis=1) - face.sum(axis=1)
        beyond = dot(twice, places[other] - a)
        up = np.where(np.abs(beyond) >= np.abs(own), beyond > 0, own < 0)  # the flatter of both tells less
        found.append(np.where(up[:, None], face, face[:, ::-1]))
    return np.concatenate(found)
