# SPDX-License-Identifier: GPL-3.0-or-later
"""Between tracks and picks: where a track begins, and the picks that are proposed from it."""

import bpy

from ....core.errors import RockfallError
from ....core.footage.kinks import SHORTEST
from ....core.workflow.first_picks import first_picks
from ...scene.footage import clicks, sightings, sync
from ...scene.picks import picks, places, reconstruction
from ...scene.storage import store

NOTE = "proposed from the track"


def clicks_for(scene: bpy.types.Scene, camera: bpy.types.Object, name: str) -> list[tuple[int, float, float]]:
    """Frames and pixels on the block, to begin a track with: clicked by hand, and those of the picks.

    Raises
    ------
    RockfallError : there are none.
    """
    seen = sightings.seen_in(camera, name)
    clicked = zip(seen.frame[seen.by_hand].tolist(), seen.pixel[seen.by_hand].tolist(), strict=True)
    found = {frame: (u, v) for frame, (u, v) in clicked}
    for obj in picks.objects_of(scene, [name]):
        click = clicks.of(obj).get(camera[store.ID])
        if click is not None and click.centre:
            found.setdefault(click.frame, (float(click.pixel[0]), float(click.pixel[1])))
    if not found:
        raise RockfallError(
            f"It is not known where the block of {name} is in {camera.name}. Choose the tool Pick Impacts, and the "
            "kind “Block here”, and click the block where it flies, best in two or three pictures."
        )
    return sorted((frame, u, v) for frame, (u, v) in found.items())


def propose(scene: bpy.types.Scene, camera: bpy.types.Object, name: str) -> list[bpy.types.Object]:
    """New picks where the tracked block's velocity changes at once, and where the track begins and ends in flight.

    Those that are there already stay.

    Raises
    ------
    RockfallError : no track, a camera that is not aligned, no terrain.
    """
    if len(sightings.seen_in(camera, name)) < 2 * SHORTEST:
        raise RockfallError(f"The block of {name} is not tracked in {camera.name}. Track it first.")
    found = first_picks(
        [sightings.seen_video(camera, [name])],
        places.surface_of(scene),
        {name: places.block_of(scene, name)},
        gravity_mps2=reconstruction.project_settings(scene, []).reconstruction.gravity_mps2,
        normal_radius_m=places.normal_radius(scene),
        marked=picks.read(scene, picks.ordered(scene, picks.objects_of(scene, [name]))),
    ).picks
    made = []
    for i in range(len(found)):
        extra = {column: str(values[i]) for column, values in found.extra.items()} | {"note": NOTE}
        kind = str(found.kind[i])
        obj = picks.add_pick(scene, name, float(found.time_s[i]), found.position[i], kind=kind, extra=extra)
        obj[store.SIGMA_TIME] = [float(found.sigma_time_s[i])]
        made.append(obj)
    sync.sync(scene, [name])
    return made
