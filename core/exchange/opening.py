# SPDX-License-Identifier: GPL-3.0-or-later
"""From project.toml to numbers: its terrain, its picks, and what is reconstructed from them."""

from typing import cast

from ..errors import InputError
from ..reconstruction.block import Block
from ..reconstruction.choices import FlightEnds
from ..reconstruction.drag import Drag
from ..reconstruction.picks import Picks
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
    surface = open_terrain(project)
    return surface, reconstruct_project(project, surface)


def read_project_picks(project: Project, surface: Surface | None) -> Picks:
    """The project's picks, in the frame of its terrain.

    Raises
    ------
    RockfallError : the project names none, the table is bad.
    """
    if project.picks is None:
        raise InputError("The project names no table of picks", advice='Add [picks] file = "picks.csv" to it')
    return read_picks(project.picks, None if surface is None else surface.shift)


def reconstruct_project(project: Project, surface: Surface | None, picks: Picks | None = None) -> Reconstruction:
    """Reconstruct as a project says; `picks` are those of the project when None.

    Raises
    ------
    RockfallError : see `read_project_picks`; the picks do not lie on the terrain.
    """
    if picks is None:
        picks = read_project_picks(project, surface)
    how = project.reconstruction
    return reconstruct(
        picks,
        surface=surface,
        block=blocks_of(project, picks),
        gravity_mps2=how.gravity_mps2,
        drag=drag_of(project),
        normal_radius_m=how.normal_radius_m,
        site=project.site.name,
        flights=cast(FlightEnds, how.flights),
    )


def open_terrain(project: Project) -> Surface | None:
    """The project's terrain, None when it has none.

    Raises
    ------
    RockfallError : the file is bad.
    """
    source = project.terrain
    if source is None:
        return None
    return read_terrain(source.file, shift=source.global_shift, up=source.up, unit_m=source.unit_m)


def block_of(project: Project, trajectory: str) -> Block:
    """The block of a trajectory."""
    entry = project.block_of(trajectory)
    return Block(entry.d1_m, entry.d2_m, entry.d3_m, entry.density_kgpm3, entry.shape)


def blocks_of(project: Project, picks: Picks) -> dict[str, Block]:
    """The block of each trajectory of the picks."""
    return {name: block_of(project, name) for name in dict.fromkeys(picks.trajectory.tolist())}


def drag_of(project: Project) -> Drag | None:
    """The drag of air, None when the flights are parabolas."""
    how = project.reconstruction
    return Drag(how.air_density_kgpm3, how.drag_coefficient) if how.drag else None
