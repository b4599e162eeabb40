# SPDX-License-Identifier: GPL-3.0-or-later
"""Sequences of pictures, files with several streams, capture rates and repeated pictures in Blender."""

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
from video_scene import DATA, Part, scene

FIELD = DATA.parent / "field_cases"
NUMBERS = (7, 8, 9, 11, 12)


def pictures(folder: Path) -> Path:
    """Pictures whose brightness tells their number; number 10 is missing."""
    folder.mkdir()
    for number in NUMBERS:
        cv2.imwrite(str(folder / f"img_{number:04d}.png"), np.full((30, 40, 3), 10 * number, np.uint8))
    return folder / "img_0009.png"


def test_one_picture_brings_its_whole_sequence(part: Part, tmp_path: Path) -> None:
    """The clip is at the file whose number belongs to the time of each picture."""
    chosen = pictures(tmp_path / "s")
    with pytest.raises(RuntimeError, match="Pictures per Second"):
        bpy.ops.rockfall.add_video(filepath=str(chosen))
    assert bpy.ops.rockfall.add_video(filepath=str(chosen), pictures_per_second=25.0) == {"FINISHED"}
    videos, video_files, clocks, footage, project_videos = (
        part(f"rockfall_addon.scene.{name}")
        for name in (
            "footage.videos",
            "footage.video_files",
            "footage.clocks",
            "footage.footage",
            "footage.project_videos",
        )
    )
    camera = videos.active_camera(scene())
    np.testing.assert_allclose(videos.times_of(camera), np.array([0, 1, 2, 4, 5]) / 25)
    clip = video_files.clip_of(camera)
    assert clip.source == "SEQUENCE"
    for index, number in enumerate(NUMBERS):
        frame = clocks.scene_frame_of(scene(), camera, index)
        scene().frame_set(round(frame))
        footage.follow(scene())
        assert 7 + scene().frame_current - clip.frame_start + clip.frame_offset == number
        assert int(video_files.picture(camera, index)[10, 10, 0]) // 10 == number
    assert part("rockfall_addon.steps.videos.wording").is_missing(camera) is False
    (entry,) = project_videos.write_videos(scene(), tmp_path) if hasattr(project_videos, "write_videos") else (None,)
    if entry is not None:
        assert entry.rate_hz == 25
        assert entry.file == (tmp_path / "s" / "img_%04d.png").resolve()


def test_the_stream_that_is_used_is_shown_in_front_of_blenders_own(part: Part) -> None:
    """Blender plays the first stream of a file; the pictures that count are those of the second."""
    assert bpy.ops.rockfall.add_video(filepath=str(FIELD / "09-second-stream" / "two.mkv")) == {"FINISHED"}
    videos, footage = part("rockfall_addon.scene.footage.videos"), part("rockfall_addon.scene.footage.footage")
    camera = videos.active_camera(scene())
    assert videos.size_of(camera) == (320, 180)
    footage.follow(scene())
    still = [b for b in camera.data.background_images if b.source == "IMAGE" and b.show_background_image]
    assert tuple(still[0].image.size) == (320, 180)
    assert any("2 streams" in str(remark) for remark in part("rockfall_addon.steps.videos.wording").remarks(camera))


def test_a_named_capture_rate_is_offered_and_taken_over(part: Part) -> None:
    path = FIELD / "16-capture-fps-tag" / "slow_meta.mp4"
    assert bpy.ops.rockfall.add_video(filepath=str(path)) == {"FINISHED"}
    videos, wording = part("rockfall_addon.scene.footage.videos"), part("rockfall_addon.steps.videos.wording")
    camera = videos.active_camera(scene())
    assert "240 pictures a second were taken" in wording.remarks(camera)[0].text
    assert bpy.ops.rockfall.use_named_capture_rate() == {"FINISHED"}
    assert part("rockfall_addon.scene.footage.clocks").clock_of(camera).rate == pytest.approx(1 / 8)
    assert not any("were taken" in remark.text for remark in wording.remarks(camera))
    with pytest.raises(RuntimeError, match="names no other capture rate"):
        bpy.ops.rockfall.use_named_capture_rate()


def test_repeated_pictures_are_said(part: Part) -> None:
    assert bpy.ops.rockfall.add_video(filepath=str(FIELD / "04-repeated-frames" / "dup23.mp4")) == {"FINISHED"}
    camera = part("rockfall_addon.scene.footage.videos").active_camera(scene())
    said = [remark.text for remark in part("rockfall_addon.steps.videos.wording").remarks(camera)]
    assert any("every 5th: about 24 pictures a second are stored as 30" in text for text in said)
