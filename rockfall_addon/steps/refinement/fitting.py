# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks, fitted to what was seen in its videos, as a proposal."""

from collections.abc import Collection

import bpy

from ....core.errors import RockfallError
from ....core.exchange.opening import drag_of
from ....core.progress import Progress, silent
from ....core.workflow.refinement import refine_picks
from ...scene import camera_paths, picks, proposal, reconstruction, sightings, sync, videos


def propose(
    scene: bpy.types.Scene, names: Collection[str] | None, free: Collection[str], progress: Progress = silent
) -> None:
    """Fit, and keep the result in the scene as a proposal.

    names : the trajectories, None for all that were seen.

    Raises
    ------
    RockfallError : something is missing; whatever the core refuses.
    """
    lacking = proposal.lacking(scene)
    if lacking:
        raise RockfallError(lacking)
    seen = [name for name in proposal.seen_names(scene) if names is None or name in names]
    if not seen:
        raise RockfallError(f"The block of {', '.join(names or ())} was not seen in an aligned video. Track it first.")
    sync.sync(scene)
    table = picks.trusted(picks.read(scene, picks.ordered(scene, picks.objects_of(scene, seen))))
    used = [name for name in seen if name in table.trajectory]
    if not used:
        raise RockfallError(f"There are no picks of {', '.join(seen)}. Pick them, or propose them from the track.")
    cameras = [camera for camera in videos.cameras(scene) if camera_paths.is_solved(camera)]
    project = reconstruction.project_settings(scene, [])
    refined = refine_picks(
        table,
        [sightings.seen_video(camera, used) for camera in cameras],
        surface=reconstruction.ground(scene),
        block=reconstruction.blocks_of(scene, set(used)),
        gravity_mps2=project.reconstruction.gravity_mps2,
        drag=drag_of(project),
        normal_radius_m=project.reconstruction.normal_radius_m,
        names=used,
        free=free,
        progress=progress,
    )
    proposal.keep(scene, refined, cameras, free)
