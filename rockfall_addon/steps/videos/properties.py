# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of a video's clock, for the panel. They are kept as doubles; what is shown here is single precision."""

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ...scene.storage import store

MICRO = 1e-6


def _is_video(obj: bpy.types.Object) -> bool:
    from ...scene.footage import videos

    return videos.is_video(obj)


def _clock(name: str, unit: float = 1.0) -> dict:
    """Getter and setter of a number of the clock, shown in a unit."""

    def get(self: bpy.types.PropertyGroup) -> float:
        from ...scene.footage import clocks

        return getattr(clocks.clock_of(self.id_data), name) / unit if _is_video(self.id_data) else 0.0

    def put(self: bpy.types.PropertyGroup, value: float) -> None:
        from dataclasses import replace

        from ...scene.footage import clocks

        if _is_video(self.id_data):
            clock = replace(clocks.clock_of(self.id_data), **{name: store.double(value) * unit})
            clocks.set_clock(self.id_data, clock)
            _changed(self.id_data)

    return {"get": get, "set": put}


def _get_capture(self: bpy.types.PropertyGroup) -> float:
    from ...scene.footage import videos

    return (videos.capture_rate_of(self.id_data) if _is_video(self.id_data) else None) or 0.0


def _set_capture(self: bpy.types.PropertyGroup, value: float) -> None:
    from ...scene.footage import clocks

    if _is_video(self.id_data):
        clocks.set_capture_rate(self.id_data, store.double(value) or None)
        _changed(self.id_data)


def _get_row_time(self: bpy.types.PropertyGroup) -> float:
    from ...scene.footage import videos

    known = videos.row_time_of(self.id_data) if _is_video(self.id_data) else None
    return -1.0 if known is None else known / MICRO


def _set_row_time(self: bpy.types.PropertyGroup, value: float) -> None:
    if value >= 0:
        self.id_data[store.ROW_TIME] = store.double(value) * MICRO
    elif store.ROW_TIME in self.id_data:
        del self.id_data[store.ROW_TIME]


def _changed(camera: bpy.types.Object) -> None:
    from ...scene.footage import video_times

    for scene in camera.users_scene:
        video_times.clock_changed(scene, camera)


class VideoProperties(bpy.types.PropertyGroup):
    """The clock of a camera's video."""

    capture_rate_hz: FloatProperty(
        name="Capture rate [Hz]", description="Pictures per second when filming, for slow motion: 240 for a file that "
        "plays them at 30. 0: the file plays at the speed of the fall",
        min=0.0, soft_max=2000.0, max=100_000.0, precision=2, get=_get_capture, set=_set_capture,
    )  # fmt: skip
    offset_s: FloatProperty(
        name="Offset [s]", description="Common time of the video's beginning, or of its events once it is synchronised",
        precision=4, step=1, **_clock("offset_s"),
    )  # fmt: skip
    drift_ppm: FloatProperty(
        name="Drift [ppm]", description="How much faster the common clock runs than the video's, in millionths: 10 are "
        "36 ms in an hour",
        precision=1, min=-900_000.0, soft_min=-1000.0, soft_max=1000.0, **_clock("drift", MICRO),
    )  # fmt: skip
    row_time_us: FloatProperty(
        name="Row time [µs]", description="Time between the readout of two rows of the picture [µs]: rolling shutter. "
        "0 for a global shutter. -1: not known, so that the refinement fits it, as 0 to 30 ms for a whole picture",
        min=-1.0, soft_max=50.0, precision=2, get=_get_row_time, set=_set_row_time,
    )  # fmt: skip


class VideoSettings(bpy.types.PropertyGroup):
    """How videos are synchronised."""

    event: IntProperty(
        name="Event", description="Number of the event that is marked: the same in all videos that see it",
        default=1, min=1, max=99,
    )  # fmt: skip
    fit_drift: BoolProperty(
        name="Drift too", description="Find the drift of the clocks as well, from three shared events on",
        default=False,
    )  # fmt: skip


CLASSES = (VideoSettings, VideoProperties)


def register() -> None:
    bpy.types.Scene.rockfall_videos = bpy.props.PointerProperty(type=VideoSettings)
    bpy.types.Object.rockfall_video = bpy.props.PointerProperty(type=VideoProperties)


def unregister() -> None:
    del bpy.types.Object.rockfall_video
    del bpy.types.Scene.rockfall_videos
