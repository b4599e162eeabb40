# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says about a video, in words."""

import bpy

from ....core.footage.sequences import is_there
from ....core.remarks import Remark, from_plain, from_text
from ...scene.footage import camera_paths, clocks, footage, timing, video_files, video_times, videos
from ...scene.picks import proposal
from ...scene.storage import store
from ...view import image_view

OTHER_RATE = 1e-4
SOON_S = 1e-3


def facts(camera: bpy.types.Object) -> list[tuple[str, str]]:
    """A table about the file."""
    known, (width, height) = videos.facts_of(camera), videos.size_of(camera)
    times = videos.times_of(camera)
    rate = float(known.get("rate_hz", 0.0))
    rows = [
        ("Size", f"{width} × {height} px"),
        ("Rate", f"{rate:.5g} per second" if rate else "unknown"),
        ("Frames", f"{times.size}"),
        ("Duration", f"{float(times[-1] - times[0]) + (1 / rate if rate else 0):.2f} s"),
        ("Format", f"{known.get('codec', '?')} in {known.get('container', '?')}"),
    ]
    return [*rows, ("Turned by", f"{known['rotation_deg']}°")] if known.get("rotation_deg") else rows


def remarks(camera: bpy.types.Object) -> list[Remark]:
    """What deserves a look in the file, and what its frame rate is good for."""
    known = videos.facts_of(camera)
    said = [*from_plain(known.get("remarks", ())), *from_plain(known.get("advice", ()))]
    if rate := named_capture_rate(camera):
        text = (
            f"By {known.get('named_capture_rate_in')} of the file {rate:.5g} pictures a second were taken, and it "
            f"plays {known['rate_hz']:.5g}. Take that over, unless the file plays at the speed of the fall."
        )
        said.insert(0, Remark(text, "advice", "capture rate"))
    count = footage.hidden(camera)
    if count:
        text = (
            f"{count} pictures come too close upon one another for Blender's player. Step by step each is shown; "
            "during playback the next one stands for it."
        )
        said.append(Remark(text, "note", "playback"))
    return said


def named_capture_rate(camera: bpy.types.Object) -> float:
    """The capture rate [Hz] that the file names, where none was chosen and it is not that of the file; else 0."""
    return 0.0 if videos.capture_rate_of(camera) else float(videos.facts_of(camera).get("named_capture_rate_hz", 0.0))


def is_missing(camera: bpy.types.Object) -> bool:
    """Whether the file has moved."""
    return not is_there(video_files.file_of(camera)) or video_files.clip_of(camera) is None


def missing(camera: bpy.types.Object) -> str:
    """What to say about a file that has moved."""
    if video_files.clip_of(camera) is None:
        return "The footage behind the camera was removed. Nothing that was marked is lost: find the file again."
    path = video_files.file_of(camera)
    return f"{path.name} is not in {path.parent} any more. Nothing is lost: tell where it is."


def warnings(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[Remark]:
    """What makes the view wrong."""
    said = []
    unset = None if proposal.is_applied(scene) else video_times.never_synchronised(scene)
    if unset is not None:
        ready = all(map(camera_paths.is_solved, videos.cameras(scene)))
        then = "Mark one event in both, and synchronise them." if ready else "Once both are aligned, do so."
        text = f"{unset.name} is not synchronised: both videos begin together until it is. {then}"
        said.append(Remark(text, "warning", "clock"))
    if scene.camera == camera and not image_view.shape_agrees(scene, camera):
        text = "The scene's render size has another shape than the video: footage and terrain do not fit."
        said.append(Remark(text, "warning", "render size"))
    times, time = videos.times_of(camera), clocks.video_time(scene, camera)
    if time < times[0] - SOON_S:
        said.append(Remark("The scene is before this video begins: its first picture is shown.", "warning", "time"))
    elif time > times[-1] + videos.stored_step_s(camera) + SOON_S:
        said.append(Remark("The scene is behind the end of this video: its last picture is shown.", "warning", "time"))
    return said


def rates(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """What to know when the scene plays at another rate than the video; empty when they agree."""
    rate = float(videos.facts_of(camera).get("rate_hz", 0.0)) / clocks.clock_of(camera).speed
    playing = timing.frame_rate(scene)
    if not rate or abs(rate / playing - 1) < OTHER_RATE:
        return ""
    return (
        f"The scene plays {playing:.5g} frames a second, the video has {rate:.5g} pictures a second of the fall. Times "
        "are right all the same; playback skips or repeats pictures, and stepping goes from picture to picture."
    )


def now(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[tuple[str, str]]:
    """Which picture is shown."""
    index, times = clocks.true_frame(scene, camera), videos.times_of(camera)
    return [
        ("Picture", f"{index} of {times.size - 1}"),
        ("In the video", f"{times[index]:.3f} s"),
        ("Common time", f"{clocks.clock_of(camera).to_common(float(times[index])):.3f} s"),
    ]


def synchronised(scene: bpy.types.Scene, camera: bpy.types.Object) -> list[str]:
    """How the clocks of several videos hang together."""
    reference = video_times.reference_camera(scene)
    if reference is None:
        return []
    own = video_times.events_of(camera)
    marked = ", ".join(f"{number} at {time:.3f} s" for number, time in own.items()) or "none"
    if camera == reference:
        return [f"The others are set by the clock of {camera.name}.", f"Events marked here: {marked}."]
    said = [f"{camera.name} is set by the clock of {reference.name}.", f"Events marked here: {marked}."]
    shared = set(own) & set(video_times.events_of(reference))
    if fit(camera):
        return said
    if not shared:
        return [*said, "Go to the picture of the same event in both videos, and mark it in each."]
    return [*said, f"{len(shared)} shared: synchronise."]


def fit(camera: bpy.types.Object) -> tuple[Remark, ...]:
    """What the synchronisation of a video found; empty before it."""
    return from_text(str(camera.get(store.SYNCHRONISED, "")), "note")
