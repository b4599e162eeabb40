# SPDX-License-Identifier: GPL-3.0-or-later
"""When things happen in the videos: true frames, the time origin, and events that synchronise several cameras."""

import json
from dataclasses import replace

import bpy
import numpy as np

from ...core.errors import RockfallError
from ...core.footage.advice import time_sigma_s
from ...core.footage.clock import DRIFT_NEEDS, synchronise
from ...core.remarks import Remark, to_text
from . import clocks, footage, picks, reconstruction, store, videos


def go_to(scene: bpy.types.Scene, frame: float) -> None:
    """Show a frame of the scene, with its fraction."""
    whole = int(np.floor(frame + 1e-6))
    scene.frame_set(whole, subframe=min(max(frame - whole, 0.0), 0.999999))


def step(scene: bpy.types.Scene, camera: bpy.types.Object, by: int) -> int:
    """Go `by` pictures on, to the very time of that picture; returns its index. It stays within the video."""
    times = videos.times_of(camera)
    now, slack = clocks.video_time(scene, camera), clocks.tolerance_s(times)
    index = clocks.index_at(times, now, slack)
    within = now > times[index] + 2 * slack
    wanted = index + by + (1 if by < 0 and within else 0)
    if now < times[0] - slack:  # before the video: its first picture comes next
        wanted = max(by - 1, 0)
    index = int(np.clip(wanted, 0, times.size - 1))
    go_to(scene, clocks.scene_frame_of(scene, camera, index))
    return index


def shown_common_s(scene: bpy.types.Scene, camera: bpy.types.Object) -> float:
    """Common time of the picture that is shown: its own timestamp, not that of the scene's frame."""
    return clocks.clock_of(camera).to_common(shown_video_s(scene, camera))


def shown_video_s(scene: bpy.types.Scene, camera: bpy.types.Object) -> float:
    """Timestamp of the picture that is shown, video time [s]."""
    return float(videos.times_of(camera)[clocks.true_frame(scene, camera)])


def origin_here(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """The picture that is shown becomes frame 0 of the scene; times of picks and videos stay.

    Raises
    ------
    RockfallError : the picks cannot be shown again.
    """
    scene[store.TIME_ORIGIN] = shown_common_s(scene, camera)
    _shown_again(scene)
    go_to(scene, 0.0)


def zero_here(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """The picture that is shown becomes common time 0 and frame 0 of the scene: all clocks are set.

    Raises
    ------
    RockfallError : there are picks, whose times are on the common clock.
    """
    if picks.objects_of(scene):
        raise RockfallError(
            "The picks have their times on the common clock, so it cannot be set to 0 here any more. "
            "Let the scene begin here instead."
        )
    zero = shown_common_s(scene, camera)
    for each in videos.cameras(scene):
        old = clocks.clock_of(each)
        clocks.set_clock(each, replace(old, offset_s=old.offset_s - zero))
    scene[store.TIME_ORIGIN] = 0.0
    _shown_again(scene)
    go_to(scene, 0.0)


def fit_range(scene: bpy.types.Scene) -> None:
    """Let the scene last as long as its footage; Blender plays no frames below 0."""
    ends = [clocks.scene_frame_of(scene, camera, index) for camera in videos.cameras(scene) for index in (0, 10**9)]
    if ends:
        scene.frame_start = max(0, int(np.floor(min(ends))))
        scene.frame_end = max(int(np.ceil(max(ends))), scene.frame_start + 1)


def use_rate_of(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Play the scene so that each frame is a picture of this video; the present picture stays."""
    rate = float(videos.facts_of(camera).get("rate_hz", 0.0)) / clocks.clock_of(camera).speed
    if rate > 0:
        index = clocks.true_frame(scene, camera)
        clocks.set_scene_rate(scene, rate)
        fit_range(scene)
        footage.follow(scene)
        go_to(scene, clocks.scene_frame_of(scene, camera, index))


def events_of(camera: bpy.types.Object) -> dict[int, float]:
    """Number of an event → video time at which this camera saw it [s]."""
    return {int(number): float(time) for number, time in store.read_json(camera, store.EVENTS, {}).items()}


def mark_event(scene: bpy.types.Scene, camera: bpy.types.Object, number: int) -> float:
    """The picture that is shown is that of an event; returns its video time [s]."""
    events = events_of(camera) | {number: shown_video_s(scene, camera)}
    _keep_events(camera, events)
    return events[number]


def clear_event(camera: bpy.types.Object, number: int) -> None:
    """Take back the mark of an event."""
    events = events_of(camera)
    events.pop(number, None)
    _keep_events(camera, events)


def reference_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The camera whose clock the others are set by: the chosen one, else the one that was added first."""
    chosen = videos.by_id(scene, str(scene.get(store.REFERENCE_CAMERA, "")))
    if chosen is not None:
        return chosen
    order = store.read_json(scene, store.KNOWN_VIDEOS, {})
    return next((c for c in (videos.by_id(scene, one) for one in order) if c is not None), None)


def never_synchronised(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """A video whose clock nobody has set: it begins with the reference, to the picture; None when there is none."""
    reference = reference_camera(scene)
    if reference is None:
        return None
    begin = clocks.clock_of(reference).to_common(float(videos.times_of(reference)[0]))
    for camera in videos.cameras(scene):
        own = clocks.clock_of(camera).to_common(float(videos.times_of(camera)[0]))
        if camera != reference and store.SYNCHRONISED not in camera and own == begin:
            return camera
    return None


def synchronise_cameras(scene: bpy.types.Scene, *, fit_drift: bool) -> list[Remark]:
    """Set the clocks of all cameras that share events with the reference camera; returns remarks about the fit.

    Raises
    ------
    RockfallError : there is one camera only, no event was marked in two, or the events cannot tell a drift.
    """
    reference = reference_camera(scene)
    others = [camera for camera in videos.cameras(scene) if camera != reference]
    if reference is None or not others:
        raise RockfallError("There is one video only: nothing is to be synchronised with it.")
    known, clock, said = events_of(reference), clocks.clock_of(reference), []
    for camera in others:
        seen = events_of(camera)
        both = sorted(set(seen) & set(known))
        if not both:
            continue
        common = [clock.to_common(known[number]) for number in both]
        sigma = float(np.hypot(_frame_sigma_s(reference), _frame_sigma_s(camera)))
        drifts = fit_drift and len(both) >= DRIFT_NEEDS
        own = clocks.clock_of(camera)
        fit = synchronise(
            common,
            [own.filmed(seen[number]) for number in both],
            rate=own.rate,
            fit_drift=drifts,
            sigma_s=sigma,
            names=[str(number) for number in both],
        )
        clocks.set_clock(camera, replace(fit.clock, gaps=own.gaps))
        sentence = _sentence(camera, reference, both, fit.residual_s, fit.sigma_offset_s, fit.clock.drift, drifts)
        remarks = [Remark(sentence, "note", camera.name), *fit.remarks]
        camera[store.SYNCHRONISED] = to_text(remarks)
        said += remarks
    if not said:
        raise RockfallError(
            f"No event is marked in {reference.name} and in another video. Go to the picture of an impact or a clap in "
            "each video, and mark it there as the same event."
        )
    footage.follow(scene)
    return said


def clock_changed(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """A number of the clock was typed: what was said about the fit does not hold any more."""
    if store.SYNCHRONISED in camera:
        del camera[store.SYNCHRONISED]
    footage.follow(scene)


def _sentence(
    camera: bpy.types.Object,
    reference: bpy.types.Object,
    events: list[int],
    residual_s: np.ndarray,
    sigma_s: float,
    drift: float,
    drifts: bool,
) -> str:
    text = f"{camera.name} is set by {len(events)} event{'s' if len(events) > 1 else ''} seen in {reference.name}"
    if np.isfinite(sigma_s):
        text += f", to ± {1000 * sigma_s:.1f} ms"
    if len(events) > 1:
        worst = int(np.abs(residual_s).argmax())
        text += f"; event {events[worst]} is {1000 * residual_s[worst]:+.1f} ms off, the others less"
    return text + (f"; its clock drifts by {1e6 * drift:+.0f} millionths." if drifts else ".")


def _frame_sigma_s(camera: bpy.types.Object) -> float:
    """How well a moment is known that is marked on its picture, on the common clock [s]."""
    rate = float(videos.facts_of(camera).get("rate_hz", 0.0))
    return time_sigma_s(rate) * clocks.clock_of(camera).speed if rate > 0 else 1e-3


def _keep_events(camera: bpy.types.Object, events: dict[int, float]) -> None:
    camera[store.EVENTS] = json.dumps({str(number): time for number, time in sorted(events.items())})


def _shown_again(scene: bpy.types.Scene) -> None:
    fit_range(scene)
    if store.has_role(scene, store.PICK_ROLE):
        reconstruction.refresh(scene)
    footage.follow(scene)
