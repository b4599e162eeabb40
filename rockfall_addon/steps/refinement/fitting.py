# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's picks, fitted to what was seen in its videos, as a proposal.

What is needed is taken from the scene first, then computed without Blender (in a thread), then stored.
"""

from collections.abc import Collection

import bpy

from ....core.errors import RockfallError
from ....core.progress import Progress
from ....core.workflow.opening import drag_of
from ....core.workflow.refinement import Refined, refine_picks
from ...scene import camera_paths, picks, proposal, reconstruction, sightings, store, sync, terrain, videos
from ...view import job


def work(scene: bpy.types.Scene, names: Collection[str] | None, free: Collection[str]) -> job.Work:
    """What there is to fit, with the result in the scene as a proposal.

    names : the trajectories, None for all that were seen.

    Raises
    ------
    RockfallError : something is missing.
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
    identifiers = [camera[store.ID] for camera in cameras]
    project = reconstruction.project_settings(scene, [])
    views = [sightings.seen_video(camera, used) for camera in cameras]
    surface, blocks = reconstruction.ground(scene), reconstruction.blocks_of(scene, set(used))
    prints, accuracy_m = proposal.prints(scene, used), terrain.accuracy_m(scene)

    def compute(progress: Progress) -> Refined:
        return refine_picks(
            table,
            views,
            surface=surface,
            block=blocks,
            gravity_mps2=project.reconstruction.gravity_mps2,
            drag=drag_of(project),
            normal_radius_m=project.reconstruction.normal_radius_m,
            names=used,
            free=free,
            sigma_terrain_m=accuracy_m,
            progress=progress,
        )

    def keep(scene: bpy.types.Scene, refined: object) -> str:
        there = [camera for one in identifiers if (camera := videos.by_id(scene, one)) is not None]
        if len(there) < len(identifiers) or proposal.prints(scene, used) != prints:
            raise RockfallError("The picks or videos were changed while they were refined. Refine again.")
        proposal.keep(scene, refined, there, free)
        return _summary(proposal.read(scene))

    return job.Work("refinement", compute, keep)


def _summary(found: proposal.Proposal) -> str:
    worries = [remark.text for remark in found.remarks if remark.severity in ("warning", "problem")]
    return " ".join([*worries[:1], f"{found.before_px:.2f} px before, {found.after_px:.2f} px after."])
