# SPDX-License-Identifier: GPL-3.0-or-later
"""Which side of a face is out of the ground, whatever the winding in the file."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..vectors import Array, norm
from .surface import face_cross_products

CONFIDENT = 0.05
"""Part of a component's area that must be left over in plan (up minus down) to tell its upper side."""


@dataclass(frozen=True, eq=False)
class Oriented:
    """Faces whose normals point out of the ground.

    Attributes
    ----------
    faces : (m, 3).
    flipped : number of faces that were turned.
    components : number of connected pieces; 0 when there was no need to count them.
    contradictions : edges at which no winding agrees (a Möbius strip).
    """

    faces: NDArray[np.int32]
    flipped: int
    components: int = 0
    contradictions: int = 0


def orient(vertices: Array, faces: NDArray[np.int32], any_up: bool, any_down: bool, total_up: float = 0.0) -> Oriented:
    """Turn faces so that neighbours agree and normals point out of the ground.

    Parameters
    ----------
    any_up, any_down : whether any face has a normal with positive, negative z; all faces alike need no more work.
    total_up : z of the total vector area; when clear, it settles a mesh of one consistent component.

    Notes
    -----
    Neighbours across an edge agree when they run along it in opposite senses; this carries the winding over each
    connected component. A closed component (a boulder) is turned to have a positive volume, an open one to have
    more of its area facing up than down. An open component that stands nearly upright (a piece of a wall) does not
    tell, and follows what most of the confident area of the file needed.
    """
    if not any_down:
        return Oriented(faces, 0)
    if not any_up:
        return Oriented(np.ascontiguousarray(faces[:, ::-1]), len(faces))
    from . import kernels

    m = len(faces)
    neighbours = kernels.edge_neighbours(faces, len(vertices))
    component, flipped = np.empty(m, np.int32), np.empty(m, np.bool_)
    components, contradictions = kernels.flood_winding(faces, neighbours, component, flipped)
    if components == 1 and total_up and not flipped.any() and (neighbours < 0).any():
        return Oriented(faces if total_up > 0 else np.ascontiguousarray(faces[:, ::-1]), 0 if total_up > 0 else m, 1)
    cross = face_cross_products(vertices, faces)
    area = norm(cross)
    sign = np.where(flipped, -1.0, 1.0)

    def per_component(values: Array) -> Array:
        return np.bincount(component, values, components).astype(np.float64)

    total = per_component(area)
    evidence = per_component(sign * cross[:, 2]) / total
    certain = np.abs(evidence) > CONFIDENT
    is_open = np.zeros(components, np.bool_)
    is_open[component[(neighbours < 0).any(axis=1)]] = True
    if not is_open.all():
        centre = np.stack([per_component(vertices[faces[:, 0], k]) for k in range(3)], axis=1)
        centre /= per_component(np.ones(m))[:, None]
        volume = per_component(sign * np.einsum("ij,ij->i", vertices[faces[:, 0]] - centre[component], cross))
        evidence[~is_open] = volume[~is_open]
        certain |= ~is_open
    outward = np.where(evidence < 0, -1.0, 1.0)
    as_in_file = per_component(sign * area)
    file_sense = np.sign((as_in_file * outward)[certain].sum())
    uncertain = ~certain & (as_in_file != 0)
    if file_sense:
        outward[uncertain] = file_sense * np.sign(as_in_file[uncertain])
    turn = sign * outward[component] < 0
    return Oriented(np.where(turn[:, None], faces[:, ::-1], faces), int(turn.sum()), components, contradictions)
