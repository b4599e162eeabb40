# SPDX-License-Identifier: GPL-3.0-or-later
"""A proposed refinement: numbers and remarks beside the picks, kept in the scene until it is decided on.

Nothing else of the scene changes before it is applied.
"""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.footage.clock import Clock
from ...core.reconstruction.flight import flight_states
from ...core.reconstruction.refinement.reliability import worst
from ...core.reconstruction.refinement.result import Refinement
from ...core.reconstruction.refinement.what_if import gravest
from ...core.remarks import Remark
from ...core.vectors import Array
from ...core.workflow.refinement import Refined
from . import camera_paths, clocks, fingerprints, picks, reconstruction, sightings, store, sync, trails, videos

PROPOSED_COLOUR = (0.2, 0.9, 1.0)
ROW = 9  # time, x, y, z, its sigma, sigma of the time, normal


@dataclass(frozen=True)
class Change:
    """By how much a pick moves, in space and time, with standard deviations."""

    label: str
    moved_cm: float
    later_ms: float
    sigma_cm: float
    sigma_ms: float


@dataclass(frozen=True)
class Proposal:
    """What is proposed, for people.

    Attributes
    ----------
    before_px, after_px : root mean square residual.
    by_video : the latter for each video.
    unknowns : name, value and standard deviation of what was fitted beside the picks.
    what_if : a change of an input, and by how much a speed and R change at most, as text.
    unnoticed : an error of what is stated, how large it may be without being noticed, and what it then does to a speed
        at most, as text.
    stale : the picks were changed since.
    """

    before_px: float
    after_px: float
    pixels: int
    outliers: int
    by_video: Mapping[str, float]
    changes: tuple[Change, ...]
    unknowns: tuple[tuple[str, float, float], ...]
    what_if: tuple[tuple[str, str, str], ...]
    unnoticed: tuple[tuple[str, str, str], ...]
    remarks: tuple[Remark, ...]
    stale: bool


def lacking(scene: bpy.types.Scene) -> str:
    """What is missing before a refinement, in a sentence; empty when nothing is."""
    cameras = videos.cameras(scene)
    if not picks.objects_of(scene):
        return "Pick the impacts first."
    if not cameras:
        return "Add the video first: the picks are fitted to its pixels."
    if not any(camera_paths.is_solved(camera) for camera in cameras):
        return "Align the camera first: only then do pixels have places."
    if not seen_names(scene):
        return "Track the block, or click it in flight (kind “Block here”), in an aligned video."
    return ""


def seen_names(scene: bpy.types.Scene) -> list[str]:
    """Trajectories that were seen in aligned videos, in the order of their names."""
    aligned = [camera for camera in videos.cameras(scene) if camera_paths.is_solved(camera)]
    return sorted({name for camera in aligned for name in sightings.names_in(camera)})


def is_there(scene: bpy.types.Scene) -> bool:
    """Whether something is proposed."""
    return store.PROPOSAL in scene


def keep(scene: bpy.types.Scene, refined: Refined, cameras: Sequence[bpy.types.Object], free: Collection[str]) -> None:
    """Keep a refinement of the scene's picks, from the videos of these cameras."""
    before, fit = refined.before, refined.fit
    new, names = fit.picks, list(dict.fromkeys(refined.before.trajectory.tolist()))
    objects = picks.ordered(scene, picks.objects_of(scene, names))
    first = [f"{name} " if len(names) > 1 else "" for name in before.trajectory.tolist()]
    labels = [f"{first[i]}{before.kind[i]} {before.time_s[i]:.2f}" for i in range(len(before))]
    ids = [camera[store.ID] for camera in cameras]
    rmse_px = fit.rmse_px_by_view.tolist()
    changes = 100 * refined.moved_m, 1e3 * refined.later_s, 100 * new.sigma_position_m, 1e3 * new.sigma_time_s
    kept = {
        "names": names,
        "prints": prints(scene, names),
        "ids": [obj[store.ID] for obj in objects],
        "ends": fit.reconstruction.ends,
        "free": list(free),
        "before_px": fit.rmse_px_before,
        "after_px": fit.rmse_px,
        "pixels": int(np.isfinite(fit.residual_px[:, 0]).sum()),
        "outliers": int(fit.outlier.sum()),
        "by_video": {view.name: px for view, px in zip(fit.views, rmse_px, strict=True)},
        "picks": [list(row) for row in zip(labels, *(column.tolist() for column in changes), strict=True)],
        "unknowns": [[name, *pair] for name, pair in fit.unknowns.items()],
        "what_if": [[row.cells[0], row.cells[2], row.cells[4]] for row in gravest(fit.what_if)],
        "unnoticed": [[row.cells[0], row.cells[1], row.cells[3]] for row in worst(fit.statements)],
        "advice": [[remark.text, remark.severity, remark.about] for remark in refined.remarks],
        "clocks": {identifier: view.clock.numbers for identifier, view in zip(ids, fit.views, strict=True)},
        "gaps": any(view.clock.gaps for view in fit.views),
        "gravity_mps2": fit.reconstruction.gravity_mps2,
        "drag": refined.drag_coefficient,
        "rmse_px": dict(zip(ids, rmse_px, strict=True)),
    }
    rows = np.column_stack([new.time_s, new.position, new.sigma_position_m, new.sigma_time_s, new.normal])
    discard(scene)
    scene[store.PROPOSAL] = json.dumps(kept)
    scene[store.PROPOSAL_ROWS] = rows.ravel().tolist()
    scene[store.PROPOSAL_PATH] = _path(fit).ravel().tolist()
    poses = {
        identifier: {
            "reference": [*view.path.reference.position.tolist(), *view.path.reference.rotation.ravel().tolist()],
            "position": view.path.position.ravel().tolist(),
            "rotation": view.path.rotation.ravel().tolist(),
            "covariance": covariance.ravel().tolist(),
        }
        for identifier, view, covariance in zip(ids, fit.views, refined.pose_covariance, strict=True)
        if covariance is not None
    }
    if poses:
        scene[store.PROPOSAL_POSES] = poses


def read(scene: bpy.types.Scene) -> Proposal | None:
    """What is proposed; None when nothing is."""
    kept = _kept(scene)
    if kept is None:
        return None
    return Proposal(
        before_px=kept["before_px"],
        after_px=kept["after_px"],
        pixels=kept["pixels"],
        outliers=kept["outliers"],
        by_video=kept["by_video"],
        changes=tuple(Change(*row) for row in kept["picks"]),
        unknowns=tuple((name, value, sigma) for name, value, sigma in kept["unknowns"]),
        what_if=tuple((change, speed, r) for change, speed, r in kept.get("what_if", [])),  # 0.1.0 has none
        unnoticed=tuple((error, size, speed) for error, size, speed in kept.get("unnoticed", [])),  # nor these
        # 0.1.0 kept sentences alone
        remarks=tuple(Remark(one) if isinstance(one, str) else Remark(*one) for one in kept["advice"]),
        stale=_is_stale(scene, kept),
    )


def path(scene: bpy.types.Scene) -> tuple[Array, Array, np.ndarray] | None:
    """Points (n, 3) of the proposed flights, their colours (n, 3), and whether each is joined with the next one."""
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
    kept = _kept(scene)
    if kept is None:
        raise RockfallError("Nothing is proposed. Refine first.")
    if _is_stale(scene, kept):
        raise RockfallError("The picks were changed since this was computed. Refine again.")
    rows = np.array(scene[store.PROPOSAL_ROWS], dtype=np.float64).reshape(-1, ROW)
    by_id = {obj.get(store.ID): obj for obj in picks.objects_of(scene)}
    for identifier, row in zip(kept["ids"], rows.tolist(), strict=True):
        obj = by_id[identifier]
        obj[store.TIME] = row[0]
        obj[store.POSITION] = row[1:4]
        obj.location = row[1:4]
        for key, value in ((store.SIGMA_POSITION, row[4]), (store.SIGMA_TIME, row[5])):
            if np.isfinite(value):
                obj[key] = [value]
        if np.isfinite(row[6:]).all():  # the place is a radius below the fitted centre, along this very normal
            obj[store.NORMAL] = row[6:]
    _apply_shared(scene, kept)
    discard(scene)
    if scene.rockfall.flights_join != kept["ends"]:
        scene.rockfall.flights_join = kept["ends"]
    sync.sync(scene, again=bool(kept["free"]))
    return len(kept["ids"])


def prints(scene: bpy.types.Scene, names: Sequence[str]) -> list[str]:
    """What tells whether the picks of some trajectories are still the same."""
    known = fingerprints.remembered(scene)
    return [known.get(name, "").rstrip(fingerprints.COMPLETE) for name in names]


def is_applied(scene: bpy.types.Scene) -> bool:
    """Whether all picks but those in the air have the normals that a refinement gives them."""
    grounded = [pick for pick in store.of_role(scene, store.PICK_ROLE) if pick.get(store.KIND) != "pass"]
    return bool(grounded) and all(store.NORMAL in pick for pick in grounded)


def discard(scene: bpy.types.Scene) -> None:
    """Forget the proposal."""
    for key in (store.PROPOSAL, store.PROPOSAL_PATH, store.PROPOSAL_ROWS, store.PROPOSAL_POSES):
        if key in scene:
            del scene[key]


def _kept(scene: bpy.types.Scene) -> dict[str, Any] | None:
    return store.read_json(scene, store.PROPOSAL, None)


def _is_stale(scene: bpy.types.Scene, kept: dict[str, Any]) -> bool:
    return prints(scene, kept["names"]) != kept["prints"]


def _path(fit: Refinement) -> Array:
    """(n, 4) places of the refined centres, and 1 where a place is joined with the next one."""
    flights, parts = fit.reconstruction.flights, []
    for i in range(len(flights.start_time_s)):
        clock = trails.moments(float(flights.start_time_s[i]), float(flights.end_time_s[i]))
        position, _ = flight_states(flights, np.full(len(clock), i), clock)
        parts.append(np.c_[position, np.arange(len(clock)) < len(clock) - 1])
    return np.vstack(parts) if parts else np.zeros((0, 4))


def _apply_shared(scene: bpy.types.Scene, kept: dict[str, Any]) -> None:
    """Clocks, poses, gravity and drag that were fitted."""
    if "clock" in kept["free"] or kept.get("gaps"):
        for identifier, values in kept["clocks"].items():
            camera = videos.by_id(scene, identifier)
            if camera is not None:
                clocks.set_clock(camera, Clock.of_numbers(values))
                camera_paths.follow_clock(scene, camera)
    if store.PROPOSAL_POSES in scene:
        for identifier, poses in scene[store.PROPOSAL_POSES].to_dict().items():
            camera = videos.by_id(scene, identifier)
            if camera is None:
                continue
            old, reference = camera_paths.camera_path(camera), np.array(poses["reference"])
            one = replace(old.reference, position=reference[:3], rotation=reference[3:].reshape(3, 3))
            new = replace(
                old,
                reference=one,
                position=np.array(poses["position"]).reshape(-1, 3),
                rotation=np.array(poses["rotation"]).reshape(-1, 3, 3),
            )
            covariance = np.array(poses["covariance"]).reshape(6, 6)
            rmse_px = kept["rmse_px"][identifier]
            quality = camera_paths.quality_of(camera)
            quality = None if quality is None else quality.of_pose_alone
            camera_paths.set_camera_path(
                scene, camera, new, rmse_px=rmse_px, pose_covariance=covariance, quality=quality
            )
    if "gravity" in kept["free"]:
        scene[store.GRAVITY] = kept["gravity_mps2"]
    if "drag" in kept["free"] and kept["drag"] is not None:
        density = reconstruction.project_settings(scene, []).reconstruction.air_density_kgpm3
        scene[store.DRAG] = [density, kept["drag"]]
        if not scene.rockfall.use_drag:
            scene.rockfall.use_drag = True
