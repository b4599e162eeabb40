# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement: the scene's picks and sightings → the core's fit → a proposal, kept in the scene until it is decided on.

The proposal is numbers and sentences beside the picks; nothing of the scene changes before it is applied.
"""

import json
from collections.abc import Sequence
from dataclasses import replace

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.footage.clock import Clock
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.flight import flight_states
from ...core.reconstruction.picks import take
from ...core.reconstruction.refinement.refine import PixelObservations, Refinement, View, refine
from ...core.vectors import Array, norm
from . import fingerprints, observations, picks, reconstruction, store, sync, trails, videos

PROPOSED_COLOUR = (0.2, 0.9, 1.0)
ROW = 9  # time, x, y, z, its sigma, sigma of the time, normal
TINY = 1e-9


def ready(scene: bpy.types.Scene) -> list[str]:
    """What is missing before a refinement, in sentences; empty when nothing is."""
    cameras = videos.cameras(scene)
    if not picks.things_of(scene):
        return ["Pick the impacts first."]
    if not cameras:
        return ["Add the video first: the picks are fitted to its pixels."]
    if not any(videos.is_solved(camera) for camera in cameras):
        return ["Align the camera first: only then pixels tell places."]
    if not _seen(scene, None):
        return ["Track the block, or click it in flight (kind “Block here”), in an aligned video."]
    return []


def propose(scene: bpy.types.Scene, names: Sequence[str] | None, free: Sequence[str]) -> dict:
    """Fit, and keep the result in the scene as a proposal; returns what `proposal` does.

    names : the trajectories, None for all that were seen.

    Raises
    ------
    RockfallError : something is missing; whatever the core refuses.
    """
    lacking = ready(scene)
    if lacking:
        raise RockfallError(lacking[0])
    cameras = [camera for camera in videos.cameras(scene) if videos.is_solved(camera)]
    seen = _seen(scene, names)
    if not seen:
        raise RockfallError(f"The block of {', '.join(names or ())} was not seen in an aligned video. Track it first.")
    sync.sync(scene)
    table = picks.trusted(picks.picks_of(scene))
    used = [name for name in seen if name in table.trajectory]
    if not used:
        raise RockfallError(f"There are no picks of {', '.join(seen)}. Pick them, or propose them from the track.")
    table = take(table, np.isin(table.trajectory, used))
    how = reconstruction.project_settings(scene, []).reconstruction
    found = refine(
        table,
        [_view(camera) for camera in cameras],
        _pixels(cameras, used),
        surface=reconstruction.ground(scene),
        block=reconstruction.blocks_of(scene, set(used)),
        gravity_mps2=how.gravity_mps2,
        drag=Drag(how.air_density_kgpm3, how.drag_coefficient) if how.drag else None,
        normal_radius_m=how.normal_radius_m,
        free=[name for name in free if name != "clock" or len(cameras) > 1],
    )
    _keep(scene, table, found, cameras, used, free)
    return proposal(scene)


def proposal(scene: bpy.types.Scene) -> dict | None:
    """What is proposed, for the panel; None when nothing is.

    names, before_px, after_px, pixels, outliers, by_video {name: px}, picks [[label, cm, ms, ± cm, ± ms]], advice,
    unknowns [[name, value, sigma]], free, stale.
    """
    text = scene.get(store.PROPOSAL)
    if not text:
        return None
    kept = json.loads(text)
    return kept | {"stale": _prints(scene, kept["names"]) != kept["prints"]}


def proposed_path(scene: bpy.types.Scene) -> tuple[Array, Array, np.ndarray] | None:
    """Points (n, 3) of the proposed flights, their colours (n, 3), and whether each is joined with the next."""
    if store.PROPOSAL_PATH not in scene:
        return None
    rows = np.array(scene[store.PROPOSAL_PATH], dtype=np.float64).reshape(-1, 4)
    return rows[:, :3], np.tile(PROPOSED_COLOUR, (len(rows), 1)), rows[:, 3] > 0


def apply(scene: bpy.types.Scene) -> int:
    """Make the proposal the picks' state; returns how many picks that concerned.

    Raises
    ------
    RockfallError : there is none, or the picks were changed since it was made.
    """
    kept = proposal(scene)
    if kept is None:
        raise RockfallError("Nothing is proposed. Refine first.")
    if kept["stale"]:
        raise RockfallError("The picks were changed since this was computed. Refine again.")
    rows = np.array(scene[store.PROPOSAL_ROWS], dtype=np.float64).reshape(-1, ROW)
    by_id = {thing.get(store.ID): thing for thing in picks.things_of(scene)}
    for identifier, row in zip(kept["ids"], rows.tolist(), strict=True):
        thing = by_id[identifier]
        thing[store.TIME] = row[0]
        thing[store.POSITION] = row[1:4]
        thing.location = row[1:4]
        for key, value in ((store.SIGMA_POSITION, row[4]), (store.SIGMA_TIME, row[5])):
            if np.isfinite(value):
                thing[key] = [value]
        if np.isfinite(row[6:]).all():  # the place is a radius below the fitted centre, along this very normal
            thing[store.NORMAL] = row[6:]
    _apply_shared(scene, kept)
    discard(scene)
    if scene.rockfall.flights_join != kept["ends"]:
        scene.rockfall.flights_join = kept["ends"]
    sync.sync(scene, again=bool(kept["free"]))
    return len(kept["ids"])


def discard(scene: bpy.types.Scene) -> None:
    """Forget the proposal."""
    for key in (store.PROPOSAL, store.PROPOSAL_PATH, store.PROPOSAL_ROWS, store.PROPOSAL_POSES):
        if key in scene:
            del scene[key]


def _seen(scene: bpy.types.Scene, names: Sequence[str] | None) -> list[str]:
    """Trajectories with picks that were seen in aligned videos."""
    seen = {n for camera in videos.cameras(scene) if videos.is_solved(camera) for n in observations.names_in(camera)}
    return sorted(seen if names is None else seen & set(names))


def _view(camera: bpy.types.Object) -> View:
    return View(
        camera.name, videos.camera_path(camera), videos.clock_of(camera), videos.row_time_of(camera),
        videos.pose_covariance(camera),
    )  # fmt: skip


def _pixels(cameras: Sequence[bpy.types.Object], names: Sequence[str]) -> PixelObservations:
    parts = [(i, name, observations.seen_in(camera, name)) for i, camera in enumerate(cameras) for name in names]
    return PixelObservations(
        view=np.concatenate([np.full(len(seen), i, dtype=np.intp) for i, _, seen in parts]),
        trajectory=np.concatenate([np.full(len(seen), name) for _, name, seen in parts]),
        time_s=np.concatenate([seen.time_s for _, _, seen in parts]),
        pixel=np.concatenate([seen.pixel for _, _, seen in parts]),
        sigma_px=np.concatenate([seen.sigma_px for _, _, seen in parts]),
    )


def _keep(
    scene: bpy.types.Scene,
    table: picks.Picks,
    found: Refinement,
    cameras: Sequence[bpy.types.Object],
    used: Sequence[str],
    free: Sequence[str],
) -> None:
    new = found.picks
    things = picks.ordered(scene, picks.things_of(scene, used))
    moved = norm(new.position - table.position)
    later = new.time_s - table.time_s
    rows = np.column_stack([new.time_s, new.position, new.sigma_position_m, new.sigma_time_s, new.normal])
    names = [f"{name} " if len(used) > 1 else "" for name in table.trajectory.tolist()]
    labels = [f"{names[i]}{table.kind[i]} {table.time_s[i]:.2f}" for i in range(len(table))]
    kept = {
        "names": list(used),
        "prints": _prints(scene, used),
        "ids": [thing[store.ID] for thing in things],
        "ends": found.reconstruction.ends,
        "free": list(free),
        "before_px": found.rmse_px_before,
        "after_px": found.rmse_px,
        "pixels": int(np.isfinite(found.residual_px[:, 0]).sum()),
        "outliers": int(found.outlier.sum()),
        "by_video": {view.name: float(px) for view, px in zip(found.views, found.rmse_px_by_view, strict=True)},
        "picks": [
            [labels[i], 100 * moved[i], 1e3 * later[i], 100 * new.sigma_position_m[i], 1e3 * new.sigma_time_s[i]]
            for i in range(len(new))
        ],
        "unknowns": [[name, *pair] for name, pair in found.unknowns.items()],
        "advice": [remark.text for remark in found.remarks],
        "clocks": {
            camera[store.ID]: [v.clock.offset_s, v.clock.drift, v.clock.origin_s, v.clock.rate]
            for camera, v in zip(cameras, found.views, strict=True)
        },
        "gravity_mps2": found.reconstruction.gravity_mps2,
        "drag": found.reconstruction.drag.coefficient if found.reconstruction.drag is not None else None,
        "rmse_px": {camera[store.ID]: float(px) for camera, px in zip(cameras, found.rmse_px_by_view, strict=True)},
    }
    scene[store.PROPOSAL] = json.dumps(kept)
    scene[store.PROPOSAL_ROWS] = rows.ravel().tolist()
    scene[store.PROPOSAL_PATH] = _path(found).ravel().tolist()
    if "camera" in free:
        poses = {}
        for camera, view in zip(cameras, found.views, strict=True):
            path, one = view.path, view.path.reference
            if view.pose_covariance is not None:
                poses[camera[store.ID]] = {
                    "reference": [*one.position.tolist(), *one.rotation.ravel().tolist()],
                    "position": path.position.ravel().tolist(),
                    "rotation": path.rotation.ravel().tolist(),
                    "covariance": np.asarray(view.pose_covariance).ravel().tolist(),
                }
        scene[store.PROPOSAL_POSES] = poses


def _path(found: Refinement) -> Array:
    """(n, 4) places of the refined centres, and 1 where a place is joined with the next one."""
    flights, parts = found.reconstruction.flights, []
    for i in range(len(flights.start_time_s)):
        clock = trails.moments(float(flights.start_time_s[i]), float(flights.end_time_s[i]))
        position, _ = flight_states(flights, np.full(len(clock), i), clock)
        parts.append(np.c_[position, np.arange(len(clock)) < len(clock) - 1])
    return np.vstack(parts) if parts else np.zeros((0, 4))


def _prints(scene: bpy.types.Scene, names: Sequence[str]) -> list[str]:
    prints = fingerprints.remembered(scene)
    return [prints.get(name, "").rstrip(fingerprints.COMPLETE) for name in names]


def _apply_shared(scene: bpy.types.Scene, kept: dict) -> None:
    """Clocks, poses, gravity and drag that were fitted."""
    if "clock" in kept["free"]:
        for identifier, values in kept["clocks"].items():
            camera = videos.by_id(scene, identifier)
            if camera is not None:
                videos.set_clock(camera, Clock(*values))
                videos.follow_clock(scene, camera)
    if "camera" in kept["free"] and store.PROPOSAL_POSES in scene:
        for identifier, poses in scene[store.PROPOSAL_POSES].to_dict().items():
            camera = videos.by_id(scene, identifier)
            if camera is None:
                continue
            path, reference = videos.camera_path(camera), np.array(poses["reference"])
            one = replace(path.reference, position=reference[:3], rotation=reference[3:].reshape(3, 3))
            path = replace(
                path,
                reference=one,
                position=np.array(poses["position"]).reshape(-1, 3),
                rotation=np.array(poses["rotation"]).reshape(-1, 3, 3),
            )
            covariance = np.array(poses["covariance"]).reshape(6, 6)
            rmse_px = kept["rmse_px"][identifier]
            videos.set_camera_path(scene, camera, path, rmse_px=rmse_px, pose_covariance=covariance)
    if "gravity" in kept["free"]:
        scene[store.GRAVITY] = kept["gravity_mps2"]
    if "drag" in kept["free"] and kept["drag"] is not None:
        density = reconstruction.project_settings(scene, []).reconstruction.air_density_kgpm3
        scene[store.DRAG] = [density, max(kept["drag"], TINY)]
        if not scene.rockfall.use_drag:
            scene.rockfall.use_drag = True
