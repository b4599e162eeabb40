# SPDX-License-Identifier: GPL-3.0-or-later
"""From project.toml to numbers: its terrain, its picks, and what is reconstructed from them."""

from typing import cast

from ..errors import RockfallError
from ..reconstruction.block import Block
from ..reconstruction.drag import Drag
from ..reconstruction.motion import FlightEnds
from ..reconstruction.trajectory import Reconstruction, reconstruct
from ..terrain.readers import read_terrain
from ..terrain.surface import Surface
from .project import Project
from .tables import read_picks


def open_project(project: Project) -> tuple[Surface | None, Reconstruction]:
    """Read a project's files and reconstruct as it says; the surface is None in a project without terrain.

    Raises
    ------
    RockfallError : the project names no picks, a file is bad, or the picks do not lie on the terrain.
    """
    if project.picks is None:
        raise RockfallError('The project names no table of picks: add [picks] file = "picks.csv" to it.')
    source, how = project.terrain, project.reconstruction
    surface = None
    if source is not None:
        surface = read_terrain(source.file, shift=source.global_shift, up=source.up, unit_m=source.unit_m)
    picks = read_picks(project.picks, None if surface is None else surface.shift)
    entries = {name: project.block_of(name) for name in dict.fromkeys(picks.trajectory.tolist())}
    result = reconstruct(
        picks,
        surface=surface,
        block={name: Block(one.d1_m, one.d2_m, one.d3_m, one.density_kgpm3) for name, one in entries.items()},
        gravity_mps2=how.gravity_mps2,
        drag=Drag(how.air_density_kgpm3, how.drag_coefficient) if how.drag else None,
        normal_radius_m=how.normal_radius_m,
        site=project.site.name,
        flights=cast(FlightEnds, how.flights),
    )
    return surface, result
