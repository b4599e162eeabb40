# SPDX-License-Identifier: GPL-3.0-or-later
"""What a video contains, against PyAV's timestamps and the frame numbers that the pictures show."""

import json
import os
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import rockfall.core.footage.video as module
from rockfall.core.errors import InputError
from rockfall.core.footage.containers import container_of
from rockfall.core.footage.video import frame_at, open_video, read_frame, read_frames
from rockfall.core.formats.mp4 import indexed_frames
from rockfall.core.opencv import FFMPEG_QUIET

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", FFMPEG_QUIET)  # read once a process, by whoever is first
FOLDER = Path(__file__).parent.parent / "data" / "videos"
PYAV = json.loads((FOLDER / "times.json").read_text())
REAL = Path(__file__).parent.parent.parent / "assets" / "examples" / "bouncing_ball" / "balle1-vp9.avi"
WHOLE = ["constant.mp4", "rotated.mov", "variable.mp4", "variable.mkv", "slower.mp4", "open_groups.ts", "vp9.webm"]
ALL = [*WHOLE, "repeated.avi", "bframes.avi", "doubled.mkv", "cut.mkv", "cut.avi"]


def shown(picture, turned=False):
    """The frame number that a picture shows."""
    grey = picture if picture.ndim == 2 else picture.mean(axis=2)
    row = (np.rot90(grey) if turned else grey)[24]
    code = sum(1 << bit for bit in range(8) if row[8 * bit + 4] > 127)
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


@pytest.fixture
def seeking(monkeypatch):
    """Seek also where grabbing on would be quicker; returns what was sought."""
    monkeypatch.setattr(module, "FAR_FRAMES", 1)
    calls, seek = [], module._seek

    def recorded(video, capture, index):
        capture, frame = seek(video, capture, index)
        calls.append((index, frame))
        return capture, frame

    monkeypatch.setattr(module, "_seek", recorded)
    return calls


@pytest.mark.parametrize("name", PYAV)
def test_timestamps_are_those_of_pyav(name):
    told = PYAV[name]
    for thorough in (False, True):
        video = open_video(FOLDER / name, thorough=thorough)
        expected = np.array(told["time_s"]) - told["start_s"]
        if name == "cut.avi":  # PyAV refuses the packet that was cut in two
            assert video.frames == expected.size
        np.testing.assert_allclose(video.time_s, expected, atol=2e-6)


@pytest.mark.parametrize("name", ["constant.mp4", "rotated.mov", "variable.mp4", "slower.mp4"])
def test_an_index_tells_the_times_of_large_pictures_as_decoding_them_does(name, monkeypatch):
    monkeypatch.setattr(module, "FEW_PIXELS", 0)
    monkeypatch.setattr(module, "_decodes_as_declared", lambda _: pytest.fail("the index was not used"))
    np.testing.assert_allclose(open_video(FOLDER / name).time_s, open_video(FOLDER / name, thorough=True).time_s)


@pytest.mark.parametrize(("box", "place", "value"), [(b"elst", 8, 500), (b"elst", 16, 0x20000), (b"stts", 8, 99)])
def test_an_index_that_shows_other_frames_is_not_relied_upon(box, place, value, tmp_path, monkeypatch):
    """Half a second is shown, twice as quickly, or the tables disagree."""
    data = bytearray((FOLDER / "constant.mp4").read_bytes())
    begin = data.index(box) + 4 + place
    assert indexed_frames(FOLDER / "constant.mp4") == 40
    data[begin : begin + 4] = value.to_bytes(4, "big")
    path = tmp_path / "edited.mp4"
    path.write_bytes(data)
    assert indexed_frames(path) == 0
    monkeypatch.setattr(module, "FEW_PIXELS", 0)
    np.testing.assert_allclose(open_video(path).time_s, open_video(path, thorough=True).time_s)


def test_an_index_of_a_file_that_is_cut_off_is_not_relied_upon(tmp_path):
    """The index stands in front: it names frames that are not there any more."""
    data = (FOLDER / "constant.mp4").read_bytes()
    index = data.index(b"moov") - 4
    assert index > data.index(b"mdat")
    begin = data.index(b"mdat") - 4
    path = tmp_path / "cut.mp4"
    path.write_bytes(data[:begin] + data[index:] + data[begin : index - 200])
    assert indexed_frames(path) == 0


@pytest.mark.parametrize("name", WHOLE)
def test_packets_tell_the_times_without_decoding_all(name):
    video = open_video(FOLDER / name)
    assert not video.decoded
    assert video.keyframe_s.size >= 2
    assert np.isin(video.keyframe_s, video.time_s).all()


@pytest.mark.parametrize("name", ALL)
def test_each_picture_is_the_one_asked_for(name, seeking):
    video = open_video(FOLDER / name)
    turned = video.rotation_deg == 90
    number = np.arange(video.frames)
    if name == "repeated.avi":
        number = number - (number > 11)
    if name == "cut.mkv":  # of the last group, cut in two, only the picture that comes first in the file is there
        number[-1] += 1
    pictures = dict(read_frames(video, grey=True))
    assert [shown(picture, turned) for picture in pictures.values()] == number.tolist()
    seeking.clear()
    for index in range(video.frames - 1, -1, -3):
        alone = read_frame(video, index, grey=True)
        np.testing.assert_array_equal(alone, pictures[index])  # also where decoding began elsewhere
    scattered = [0, 1, 9, video.frames // 2, video.frames // 2, video.frames - 1]
    for index, picture in read_frames(video, sorted(i for i in scattered if i < video.frames)):
        assert shown(picture, turned) == number[index]
    if name in WHOLE:
        assert sum(frame > 0 for _, frame in seeking) >= 4


def test_a_seek_lands_at_a_keyframe_near_by(seeking):
    video = open_video(FOLDER / "slower.mp4")
    seeking.clear()
    read_frame(video, 149)
    [(_, frame)] = seeking
    assert 60 < frame <= 149


def test_constant_rate():
    video = open_video(FOLDER / "constant.mp4")
    assert (video.frames, video.header_frames, video.width, video.height) == (40, 40, 64, 48)
    assert (video.codec, video.container, video.rotation_deg, video.pixel_aspect) == ("H.264", "MP4", 0, 1.0)
    assert video.rate_hz == pytest.approx(30)
    assert video.mean_rate_hz == pytest.approx(30)
    assert video.duration_s == pytest.approx(40 / 30)
    assert not video.is_variable
    assert video.gaps.size == video.missing.size == video.duplicates.size == video.repeated.size == 0


def test_television_rate_and_rotation():
    video = open_video(FOLDER / "rotated.mov")
    assert video.rate_hz == pytest.approx(30_000 / 1001, rel=1e-9)
    assert (video.rotation_deg, video.width, video.height, video.container) == (90, 48, 64, "MOV")
    assert read_frame(video, 3).shape == (64, 48, 3)
    assert read_frame(video, 3, grey=True).shape == (64, 48)
    # Turned clockwise, the leftmost bar (lowest bit, set for frame 1) comes to the top.
    assert read_frame(video, 1, grey=True)[4, 24] > 127
    assert read_frame(video, 1, grey=True)[60, 24] < 127


@pytest.mark.parametrize("name", ["variable.mp4", "variable.mkv"])
def test_variable_rate_with_lost_frames(name):
    video = open_video(FOLDER / name)
    assert video.is_variable
    assert video.gaps.tolist() == [9, 27]
    assert video.missing.tolist() == [2, 1]
    assert video.resolution_s == (1e-3 if name.endswith("mkv") else 0)
    assert video.frames == 67


def test_milliseconds_are_no_variable_rate():
    video = open_video(FOLDER / "vp9.webm")
    assert (video.container, video.codec) == ("WebM", "VP9")
    assert np.ptp(video.step_s) > 0.9e-3
    assert not video.is_variable
    assert video.rate_hz == pytest.approx(30, rel=1e-3)


def test_a_slower_rate_is_no_series_of_gaps():
    video = open_video(FOLDER / "slower.mp4")
    assert video.step_s.max() > 3 * video.step_s.min()
    assert video.is_variable
    assert video.gaps.size == 0


@pytest.mark.parametrize("place", [0, 1, 50, 97, 98])
def test_gaps_are_found_also_at_the_ends(place):
    step = np.full(99, 0.02)
    step[place] = 0.10
    step[60:80] = 0.04  # darker for a while
    video = replace(open_video(FOLDER / "constant.mp4"), time_s=np.r_[0, np.cumsum(step)])
    assert video.gaps.tolist() == [place]
    assert video.missing.tolist() == [4]


def test_repeated_pictures_and_doubled_timestamps():
    assert open_video(FOLDER / "repeated.avi", thorough=True).repeated.tolist() == [12]
    doubled = open_video(FOLDER / "doubled.mkv")
    assert doubled.duplicates.tolist() == [7]
    assert doubled.counted
    assert doubled.gaps.tolist() == [7]
    assert [frame_at(doubled, time) for time in (0.2399, 0.24, 0.3199, 0.32)] == [5, 7, 7, 8]


def test_a_missing_last_timestamp_is_filled_in():
    video = open_video(FOLDER / "bframes.avi")
    assert video.counted
    np.testing.assert_allclose(video.step_s, 1 / 30, rtol=1e-9)


def test_cut_files_tell_what_is_left():
    for name, announced in (("cut.mkv", 67), ("cut.avi", 24)):
        video = open_video(FOLDER / name)
        assert 5 < video.frames < 0.7 * announced
        assert video.header_frames >= announced


def test_decoding_goes_on_after_damage(tmp_path, seeking):
    path = tmp_path / "damaged.mp4"
    data = bytearray((FOLDER / "constant.mp4").read_bytes())
    begin = data.index(b"mdat") + 4
    middle = begin + (len(data) - begin) // 3
    data[middle : middle + 60] = bytes(byte ^ 0x5A for byte in data[middle : middle + 60])
    path.write_bytes(data)
    video = open_video(path)
    assert 30 <= video.frames < 40
    assert video.gaps.size >= 1
    assert video.frames + video.missing.sum() == 40
    late = np.flatnonzero(video.time_s > video.keyframe_s[-1] - 1e-6)
    assert late.size >= 4
    for index, picture in read_frames(video, late):
        assert shown(picture) == round(30 * video.time_s[index])


def test_frame_at():
    video = open_video(FOLDER / "variable.mp4")
    for index in (0, 9, 10, 66):
        time = video.time_s[index]
        assert frame_at(video, time) == index
        assert frame_at(video, round(time, 6)) == index
        assert frame_at(video, time - 1e-3) == max(index - 1, 0)
    assert frame_at(video, -1) == 0
    assert frame_at(video, 99) == 66


def test_wrong_indices_are_refused():
    video = open_video(FOLDER / "constant.mp4")
    with pytest.raises(InputError, match="no frame 40: the video has the frames 0 to 39"):
        read_frame(video, 40)
    with pytest.raises(InputError, match="ascending"):
        list(read_frames(video, [3, 2]))
    assert list(read_frames(video, [])) == []


def test_a_file_that_was_damaged_since(tmp_path):
    path = tmp_path / "film.mkv"
    path.write_bytes((FOLDER / "variable.mkv").read_bytes())
    video = open_video(path)
    path.write_bytes((FOLDER / "cut.mkv").read_bytes())
    with pytest.raises(InputError, match=r"Frame 66 at .* s cannot be decoded"):
        read_frame(video, 66)


def refused(path, says):
    """The refusal of a video; what it says is compared behind the file's path, which holds the name of the test."""
    with pytest.raises(InputError) as caught:
        open_video(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert re.search(says, message.removeprefix(str(path)))


def test_a_file_that_is_gone_since(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_bytes((FOLDER / "constant.mp4").read_bytes())
    video = open_video(path)
    path.unlink()
    with pytest.raises(InputError) as caught:
        read_frame(video, 3)
    assert str(caught.value) == f"{path}: There is no such file. Check the path."


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none.mp4", "There is no such file"),
        (".", "This is a folder"),
        ("cut.mp4", "its index, which comes last, is missing"),
        ("sound.mp4", "sound and no video"),
        ("strange.mp4", r"xyz1.*ffmpeg -i strange.mp4 -c:v libx264 .*-fps_mode passthrough"),
        ("interlaced.mp4", "same picture, as interlaced video.* bwdif=mode=send_field"),
        ("no_times.h264", "12 frames of this file have no timestamps"),
        ("times.json", "not a video file"),
    ],
)
def test_what_cannot_be_used_is_named(name, says, capfd):
    refused(FOLDER / name, says)
    assert capfd.readouterr().err == ""


def test_empty_files_and_pictures_are_named(tmp_path):
    empty, still = tmp_path / "empty.mp4", tmp_path / "still.mp4"
    empty.touch()
    still.write_bytes(cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    refused(empty, "The file is empty")
    refused(still, r"This is a picture file \(PNG\), not a video")


def test_a_video_whose_pictures_are_all_damaged(tmp_path):
    path = tmp_path / "zeros.mp4"
    data = bytearray((FOLDER / "constant.mp4").read_bytes())
    begin = data.index(b"mdat") + 4
    size = int.from_bytes(data[begin - 8 : begin - 4], "big") - 8
    data[begin : begin + size] = bytes(size)
    path.write_bytes(data)
    refused(path, "No picture can be decoded: the video is in H.264, which is damaged or not supported here")


def test_timestamps_that_run_backwards(tmp_path):
    """The time of one Matroska block, two bytes behind its track number, is set back."""
    path = tmp_path / "back.webm"
    data = bytearray((FOLDER / "vp9.webm").read_bytes())
    times = [(at, int.from_bytes(data[at : at + 2], "big")) for at in block_times(data)]
    at, time = times[8]
    data[at : at + 2] = (time - 200).to_bytes(2, "big")
    path.write_bytes(data)
    refused(path, "The timestamps run backwards. Convert it with ffmpeg -i back.webm")


def block_times(data):
    """Where the times of the blocks stand: element A3, its size in one to four bytes, track 1."""
    for at in range(len(data) - 6):
        length = 9 - data[at + 1].bit_length()
        if data[at] == 0xA3 and length <= 4 and data[at + 1 + length] == 0x81:
            yield at + 2 + length


def test_a_picture_that_cannot_be_decoded_although_it_is_there(monkeypatch):
    class Capture:
        def retrieve(self):
            return False, None

    video = open_video(FOLDER / "constant.mp4")
    monkeypatch.setattr(module, "_grabbed", lambda *_: iter([(3, Capture())]))
    with pytest.raises(InputError, match=r"Frame 3 at 0\.100 s cannot be decoded: the file is damaged there"):
        read_frame(video, 3)


def test_transport_streams_of_recorders_and_of_cameras(tmp_path):
    """Packets of 188 bytes, and of 192 with a time in front of each."""
    assert open_video(FOLDER / "open_groups.ts").container == "MPEG transport stream"
    data = (FOLDER / "open_groups.ts").read_bytes()
    camera = tmp_path / "camera.m2ts"
    camera.write_bytes(b"".join(b"\0\0\1\2" + data[at : at + 188] for at in range(0, len(data), 188)))
    assert open_video(camera).container == "MPEG transport stream"
    other = tmp_path / "other.ts"
    other.write_bytes(b"G" + bytes(1000))
    assert container_of(other) == ""


def test_other_letters_in_the_name(tmp_path):
    path = tmp_path / "Éboulement 01 – 石 %d.mp4"
    path.write_bytes((FOLDER / "constant.mp4").read_bytes())
    assert shown(read_frame(open_video(path), 33)) == 33


def test_progress_is_told():
    said = []
    open_video(FOLDER / "constant.mp4", lambda *one: said.append(one), thorough=True)
    assert said[0] == ("Reading the timestamps of constant.mp4", 0, 0)
    assert said[1:] == [("Decoding constant.mp4", frame, 40) for frame in range(40)]


@pytest.mark.skipif(not REAL.exists(), reason="the example is not in this checkout")
def test_real_footage_whose_header_is_wrong():
    video = open_video(REAL)
    assert (video.header_frames, video.frames) == (300, 295)
    assert video.gaps.tolist() == [0]
    assert video.missing.tolist() == [5]
    assert video.rate_hz == pytest.approx(187.35, abs=0.01)
