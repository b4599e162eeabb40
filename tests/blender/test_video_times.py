# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks of videos: rates, events, origins, steps from picture to picture."""

import bpy
import numpy as np
import pytest
from video_scene import DATA, Part, add, scene


def test_television_rate_is_exact(part: Part) -> None:
    new_videos = part("rockfall_addon.scene.footage.new_videos")
    new_videos.add_video(scene(), DATA / "rotated.mov")
    assert scene().render.fps / scene().render.fps_base == 30_000 / 1001


@pytest.mark.parametrize(("rate", "fps", "base"), [(30, 30, 1), (29.97002997, 30_000, 1001), (59.94006, 30_000, 500.5)])
def test_scene_rate(part: Part, rate: float, fps: int, base: float) -> None:
    assert part("rockfall_addon.scene.footage.clocks").scene_rate(rate) == (fps, base)


def test_odd_rate(part: Part) -> None:
    fps, base = part("rockfall_addon.scene.footage.clocks").scene_rate(29.83)
    assert fps == 30
    assert fps / base == pytest.approx(29.83)


@pytest.fixture
def pair(part: Part) -> tuple[bpy.types.Object, bpy.types.Object]:
    """A video of 30 pictures a second, and one that varies and begins elsewhere."""
    return add(part, "constant.mp4"), add(part, "variable.mp4")


@pytest.mark.parametrize("fit_drift", [False, True])
def test_events_synchronise(part: Part, fit_drift: bool) -> None:
    """Events at pictures whose times are known lead back to the clock that was made up for the second video."""
    videos = part("rockfall_addon.scene.footage.videos")
    clocks = part("rockfall_addon.scene.footage.clocks")
    times = part("rockfall_addon.scene.footage.video_times")
    reference, other = (add(part, "slower.mp4") for _ in range(2))
    assert times.reference_camera(scene()) == reference
    assert times.never_synchronised(scene()) == other
    assert bpy.types.ROCKFALL_PT_videos.step_state(bpy.context) == "ATTENTION"
    drift = 0.02 if fit_drift else 0.0
    seen = videos.times_of(reference)[[30, 80, 110, 130]]
    truth = part("core.footage.clock").Clock(-0.3, drift, 0.2)
    other_s = videos.times_of(other)
    step = 0.0
    for number, common in enumerate(seen, start=1):
        times.go_to(scene(), clocks.frame_at(scene(), common))
        times.mark_event(scene(), reference, number)
        index = int(np.abs(other_s - truth.to_video(common)).argmin())
        step = max(step, abs(float(other_s[index] - truth.to_video(common))))
        times.go_to(scene(), clocks.scene_frame_of(scene(), other, index))
        assert times.mark_event(scene(), other, number) == pytest.approx(other_s[index], abs=1e-9)
    said = times.synchronise_cameras(scene(), fit_drift=fit_drift)
    found = clocks.clock_of(other)
    np.testing.assert_allclose(found.to_common(other_s), truth.to_common(other_s), atol=4 * step)
    assert "4 events" in said[0].text
    assert part("rockfall_addon.steps.videos.wording").fit(other)[0] == said[0]
    assert clocks.clock_of(reference).offset_s == 0.0
    assert times.never_synchronised(scene()) is None
    said = part("rockfall_addon.steps.videos.wording").warnings(scene(), other)
    assert not [remark for remark in said if remark.about == "clock"]


def test_frames_that_are_missing_stay_so(part: Part) -> None:
    """A gap that a refinement found: the clock jumps there, also when it is synchronised or its rate is told."""
    videos, clocks = part("rockfall_addon.scene.footage.videos"), part("rockfall_addon.scene.footage.clocks")
    times = part("rockfall_addon.scene.footage.video_times")
    reference, other = (add(part, "slower.mp4") for _ in range(2))
    shown = videos.times_of(other)
    gap = (float(shown[60]), 0.2)
    clocks.set_clock(other, part("core.footage.clock").Clock(gaps=(gap,)))
    assert clocks.clock_of(other).to_common(shown[[60, 61]]) == pytest.approx(shown[[60, 61]] + [0, 0.2])
    event = float(videos.times_of(reference)[100])
    times.go_to(scene(), clocks.frame_at(scene(), event))
    times.mark_event(scene(), reference, 1)
    times.go_to(scene(), clocks.scene_frame_of(scene(), other, 90))
    times.mark_event(scene(), other, 1)
    times.synchronise_cameras(scene(), fit_drift=False)
    found = clocks.clock_of(other)
    assert found.gaps == (gap,)
    assert found.to_common(float(shown[90])) == pytest.approx(event)
    assert found.to_common(float(shown[30])) == pytest.approx(event - 0.2 - float(shown[90] - shown[30]))
    clocks.set_capture_rate(other, 60.0)
    assert clocks.clock_of(other).gaps == (gap,)


def test_next_video_begins_with_the_others(part: Part) -> None:
    clocks, videos = part("rockfall_addon.scene.footage.clocks"), part("rockfall_addon.scene.footage.videos")
    camera = add(part, "constant.mp4")
    clocks.set_clock(camera, part("core.footage.clock").Clock(465.5))
    other = add(part, "variable.mp4")
    assert clocks.clock_of(other).to_common(float(videos.times_of(other)[0])) == 465.5


def test_nothing_to_synchronise(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    times, errors = part("rockfall_addon.scene.footage.video_times"), part("core.errors")
    with pytest.raises(errors.RockfallError, match="same event"):
        times.synchronise_cameras(scene(), fit_drift=False)
    part("rockfall_addon.scene.footage.footage").remove(scene(), pair[1])
    with pytest.raises(errors.RockfallError, match="one video only"):
        times.synchronise_cameras(scene(), fit_drift=False)


def test_stepping_lands_on_true_frames(part: Part) -> None:
    videos = part("rockfall_addon.scene.footage.videos")
    clocks = part("rockfall_addon.scene.footage.clocks")
    times = part("rockfall_addon.scene.footage.video_times")
    camera = add(part, "variable.mp4")
    scene().render.fps = 24
    stamps = videos.times_of(camera)
    scene().frame_set(0)
    for index in range(1, 40):
        assert bpy.ops.rockfall.step_frame(step=1) == {"FINISHED"}
        assert clocks.true_frame(scene(), camera) == index
        assert clocks.video_time(scene(), camera) == pytest.approx(stamps[index], abs=2e-7)
    bpy.ops.rockfall.step_frame(step=-10)
    assert clocks.true_frame(scene(), camera) == 29
    times.go_to(scene(), clocks.frame_at(scene(), float(stamps[10] + 0.4 * (stamps[11] - stamps[10]))))
    bpy.ops.rockfall.step_frame(step=-1)
    assert clocks.video_time(scene(), camera) == pytest.approx(stamps[10], abs=2e-7), "back to the picture's own time"
    bpy.ops.rockfall.step_frame(step=-100)
    bpy.ops.rockfall.step_frame(step=1000)
    assert clocks.true_frame(scene(), camera) == stamps.size - 1
    scene().frame_set(-40)
    bpy.ops.rockfall.step_frame(step=1)
    assert clocks.video_time(scene(), camera) == pytest.approx(stamps[0], abs=2e-7), (
        "from before the video to its start"
    )


def test_time_origin(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    clocks = part("rockfall_addon.scene.footage.clocks")
    camera, other = pair
    scene().camera = camera
    scene().frame_set(12)
    assert bpy.ops.rockfall.time_origin_here(what="SCENE") == {"FINISHED"}
    assert (scene().frame_current, clocks.true_frame(scene(), camera)) == (0, 12)
    assert clocks.common_time(scene()) == pytest.approx(0.4)
    assert bpy.ops.rockfall.time_origin_here(what="CLOCK") == {"FINISHED"}
    assert clocks.common_time(scene()) == 0.0
    assert clocks.true_frame(scene(), camera) == 12
    assert clocks.clock_of(other).to_common(0.4) == pytest.approx(0.0), "all clocks are set"


def test_common_clock_stays_with_picks(part: Part, pair: tuple[bpy.types.Object, ...]) -> None:
    bpy.ops.rockfall.load_demo()
    with pytest.raises(RuntimeError, match="common clock"):
        bpy.ops.rockfall.time_origin_here(what="CLOCK")


def test_scene_rate_changed(part: Part) -> None:
    clocks, words = part("rockfall_addon.scene.footage.clocks"), part("rockfall_addon.steps.videos.wording")
    camera = add(part, "constant.mp4")
    assert words.rates(scene(), camera) == ""
    scene().render.fps = 24
    assert "24" in words.rates(scene(), camera)
    scene().frame_set(12)
    assert clocks.true_frame(scene(), camera) == 15
    assert bpy.ops.rockfall.use_video_rate() == {"FINISHED"}
    assert (scene().render.fps, scene().frame_current) == (30, 15)


def test_slow_motion(part: Part) -> None:
    """240 pictures a second stored at 30: the fall takes an eighth of the file's duration."""
    clocks = part("rockfall_addon.scene.footage.clocks")
    camera = add(part, "constant.mp4")
    camera.rockfall_video.capture_rate_hz = 240
    assert clocks.clock_of(camera).to_common(0.8) == pytest.approx(0.1)
    assert camera.rockfall_video.capture_rate_hz == 240
    assert bpy.ops.rockfall.use_video_rate() == {"FINISHED"}
    assert scene().render.fps == 240
    scene().frame_set(17)
    assert clocks.true_frame(scene(), camera) == 17
    camera.rockfall_video.offset_s = 0.35
    assert clocks.clock_of(camera).offset_s == 0.35, "as typed, not its single precision"
