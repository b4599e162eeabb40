# SPDX-License-Identifier: GPL-3.0-or-later
"""From project.toml to numbers: its terrain, its picks, and what is reconstructed from them."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from ..camera.quality import remarks_on_quality
from ..errors import InputError, RockfallError
from ..exchange.cameras import CameraFile, read_camera
from ..exchange.project import Project
from ..exchange.tables import read_picks
from ..georeference import Z_UP, GlobalShift
from ..reconstruction.block import Block
from ..reconstruction.choices import FlightEnds
from ..reconstruction.drag import Drag
from ..reconstruction.picks import Picks
from ..reconstruction.trajectory import Reconstruction, reconstruct
from ..remarks import Remark
from ..terrain.misplaced import unit_hint
from ..terrain.readers import read_tiles
from ..terrain.surface import Surface
from .uprightness import turned_path, turned_picks

FAR_CAMERA_M = 1000.0
"""A camera may be so far beside and above its terrain, and half as far again as this is large."""


def open_project(project: Project) -> tuple[Surface | None, Reconstruction]:
    """Read a project's files and reconstruct as it says; the surface is None in a project without terrain.

    Raises
    ------
    RockfallError : the project names no picks, a file is bad, or the picks do not lie on the terrain.
    """
    surface = open_terrain(project)
    return surface, reconstruct_project(project, surface)


def read_project_picks(project: Project, surface: Surface | None) -> tuple[Picks, tuple[str, ...]]:
    """The project's picks, in the frame of its terrain and as upright as it; and sentences on what was done to them.

    Raises
    ------
    RockfallError : the project names none, the table is bad.
    """
    if project.picks is None:
        raise InputError("The project names no table of picks", advice='Add [picks] file = "picks.csv" to it')
    return turned_picks(read_picks(project.picks, None if surface is None else surface.shift), surface)


def read_project_camera(
    file: Path, surface: Surface | None, shift: GlobalShift | None = None
) -> tuple[CameraFile, tuple[str, ...]]:
    """A camera of a project, in the frame of its terrain and as upright as it; and sentences on what was done to it.

    Parameters
    ----------
    shift : of the local frame where there is no terrain; None takes that proposed for the camera.

    Raises
    ------
    InputError : see `read_camera`.
    """
    read = read_camera(file, shift if surface is None else surface.shift)
    path, notes = turned_path(read.path, surface)
    hint = "" if surface is None else unit_hint(path.position, surface, FAR_CAMERA_M)
    if hint:
        notes = (*notes, f"The camera {file.name} is far from the terrain. {hint}.")
    notes = (*notes, *map(str, remarks_on_quality(read.quality, file.name)))
    if path is read.path:
        return read, notes
    turn = np.eye(6)
    turn[3:, 3:] = Z_UP
    own, with_lens = (
        None if matrix is None else turn @ matrix @ turn.T
        for matrix in (read.pose_covariance, read.pose_covariance_with_lens)
    )
    quality = None if read.quality is None else read.quality.turned(Z_UP)
    return replace(read, path=path, pose_covariance=own, pose_covariance_with_lens=with_lens, quality=quality), notes


def reconstruct_project(project: Project, surface: Surface | None, picks: Picks | None = None) -> Reconstruction:
    """Reconstruct as a project says; `picks` are those of the project when None.

    Raises
    ------
    RockfallError : see `read_project_picks`; the picks do not lie on the terrain.
    """
    notes: tuple[str, ...] = ()
    if picks is None:
        picks, notes = read_project_picks(project, surface)
    how = project.reconstruction
    made = reconstruct(
        picks,
        surface=surface,
        block=blocks_of(project, picks),
        gravity_mps2=how.gravity_mps2,
        drag=drag_of(project),
        normal_radius_m=how.normal_radius_m,
        site=project.site.name,
        flights=cast(FlightEnds, how.flights),
    )
    remarks = (*(Remark(note, about="picks") for note in notes), *camera_remarks(project))
    return replace(made, remarks=(*remarks, *made.remarks))


def camera_remarks(project: Project) -> tuple[Remark, ...]:
    """What is to be known of the cameras that a project's picks were made with; nothing of one that cannot be read."""
    found: list[Remark] = []
    for video in project.videos:
        if video.camera is not None:
            with suppress(RockfallError, OSError):
                found += remarks_on_quality(read_camera(video.camera).quality, video.name)
    return tuple(found)


def open_terrain(project: Project) -> Surface | None:
    """The project's terrain, of all its files; None when it has none.

    Raises
    ------
    RockfallError : a file is bad.
    """
    source = project.terrain
    if source is None:
        return None
    return read_tiles(source.files, source.how, shift=source.global_shift)


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
