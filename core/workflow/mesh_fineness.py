# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the edges of the triangles are that blocks meet, beside the blocks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..remarks import Remark
from ..simulation.engine import Simulation
from ..terrain.surface import Surface
from ..vectors import norm

COARSE = 0.5
"""Edges longer than this part of the diameter may be felt, where the ground is curved."""
CURVED_DEG = 0.3
"""Faces whose normals are nearer than this to those at their corners lie in a plane, however large they are."""
MOST_LOOKED_AT = 100_000
"""Faces from which the medians are found."""


@dataclass(frozen=True)
class Fineness:
    """The triangles that blocks meet, beside the blocks.

    Attributes
    ----------
    edge_m : median length of their edges.
    diameter_m : median diameter of the blocks.
    bend_deg : median angle between their normals and those at their corners.
    """

    edge_m: float
    diameter_m: float
    bend_deg: float

    @property
    def is_coarse(self) -> bool:
        """Whether blocks may feel the triangles in place of the surface."""
        return self.edge_m > COARSE * self.diameter_m and self.bend_deg > CURVED_DEG

    def __str__(self) -> str:
        ratio = self.edge_m / self.diameter_m
        return (
            f"mesh of {length(self.edge_m)} (median edge where blocks touch it), blocks of "
            f"{length(self.diameter_m)}: edges of {ratio:.2g} diameters"
        )


def length(metres: float) -> str:
    """A length for people."""
    return f"{100 * metres:.2g} cm" if metres < 1 else f"{metres:.2g} m"


def fineness(simulations: Sequence[Simulation]) -> Fineness | None:
    """Of the terrain's triangles that blocks touch, as far as they were recorded; None on points."""
    ground = simulations[0].ground
    terrain = ground.terrain
    if not isinstance(terrain, Surface):
        return None
    met = np.concatenate([one.records.face for one in simulations])
    met = np.unique(met[(met >= 0) & (met < len(terrain.faces))])
    if not met.size:
        return None
    met = met[:: 1 + met.size // MOST_LOOKED_AT]
    corners = terrain.vertices[terrain.faces[met]]
    edges = norm(np.roll(corners, -1, axis=1) - corners)
    cosine = np.einsum("fi,fki->fk", terrain.face_normals[met], terrain.vertex_normals[terrain.faces[met]])
    bend = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    diameter = np.concatenate([one.releases.diameter_m for one in simulations])
    return Fineness(float(np.median(edges)), float(np.median(diameter)), float(np.nanmedian(bend)))


def fineness_remarks(simulations: Sequence[Simulation]) -> list[Remark]:
    """How long edges are beside the blocks; a warning where the blocks may feel the triangles."""
    found = fineness(simulations)
    if found is None:
        return []
    text = f"{str(found)[0].upper()}{str(found)[1:]}."
    if not found.is_coarse:
        return [Remark(text, "note", "mesh")]
    text += (
        " Where the ground is curved, single triangles may change the run-out. Check the mesh to see by how much, or "
        "use a mesh with edges of half a diameter."
    )
    return [Remark(text, "warning", "mesh")]


def median_edge(terrain: Surface) -> float:
    """Of all triangles [m]."""
    corners = terrain.vertices[terrain.faces[:: 1 + len(terrain.faces) // MOST_LOOKED_AT]]
    return float(np.median(norm(np.roll(corners, -1, axis=1) - corners)))
