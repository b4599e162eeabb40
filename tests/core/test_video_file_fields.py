# SPDX-License-Identifier: GPL-3.0-or-later
"""What video files say of themselves: streams, capture rates, how they are to be shown; read, said or refused."""

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.footage.advice import capture_rate_sentence, content_advice
from rockfall.core.footage.containers import codec_name
from rockfall.core.footage.file_facts import Stream, best_stream, file_facts, further_chapters
from rockfall.core.footage.video import open_video, read_frame, read_frames
from rockfall.core.formats.matroska import read_header
from rockfall.core.formats.mp4 import read_movie

DATA = Path(__file__).parent.parent / "data"
VIDEOS, FIELD = DATA / "videos", DATA / "field_cases"


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", 8 + len(content)) + kind + content


def inserted(data: bytes, within: list[bytes], new: bytes) -> bytes:
    """An MP4 file with a box added at the end of another, whose parents grow along; the index must come last."""
    assert data.index(b"mdat") < data.index(b"moov")
    at, grown = 0, bytearray(data)
    for kind in within:
        at = data.index(kind, at)
        length = int.from_bytes(data[at - 4 : at], "big")
        grown[at - 4 : at] = struct.pack(">I", length + len(new))
        end = at - 4 + length
    return bytes(grown[:end]) + new + bytes(grown[end:])


EQUIRECTANGULAR = box(b"prhd", bytes(16)) + box(b"equi", bytes(20))
SAMPLE = [b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd", b"avc1"]


def mp4(tmp_path: Path, within: list[bytes], new: bytes, name: str = "film.mp4") -> Path:
    path = tmp_path / name
    path.write_bytes(inserted((VIDEOS / "constant.mp4").read_bytes(), within, new))
    return path


def metadata(values: dict[str, bytes], kind: int) -> bytes:
    """Apple's metadata: names in "keys", values in "ilst"."""
    names = b"".join(box(b"mdta", name.encode()) for name in values)
    items = b"".join(
        box(struct.pack(">I", i + 1), box(b"data", struct.pack(">II", kind, 0) + value))
        for i, value in enumerate(values.values())
    )
    handler = box(b"hdlr", bytes(8) + b"mdta" + bytes(13))
    return box(b"meta", handler + box(b"keys", struct.pack(">II", 0, len(values)) + names) + box(b"ilst", items))


def test_of_two_streams_of_matroska_the_default_is_used_and_both_are_said() -> None:
    """The first is small and slow, the second is marked as default: by ffprobe 160 × 90 at 10 and 320 × 180 at 30."""
    video = open_video(FIELD / "09-second-stream" / "two.mkv")
    assert (video.width, video.height, video.frames) == (320, 180, 60)
    assert video.rate_hz == pytest.approx(30, rel=1e-3)
    assert read_frame(video, 40).shape == (180, 320, 3)
    said = content_advice(video)[0]
    assert "2 streams of pictures: 160 × 90 px at 10 Hz; 320 × 180 px at 30 Hz (default). Number 2 is used" in said


def shown(picture: np.ndarray) -> int:
    """The number in Gray code that a picture shows."""
    row = picture.mean(axis=2)[picture.shape[0] // 2]
    width = picture.shape[1] // 8
    code = sum(1 << bit for bit in range(8) if row[width * bit + width // 2] > 127)
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


@pytest.mark.parametrize(
    ("flags", "width", "rate"), [((3, 0), 32, 10), ((0, 3), 64, 30), ((3, 3), 64, 30), ((0, 0), 64, 30)]
)
def test_of_two_tracks_of_mp4_the_enabled_or_the_largest_is_used(
    flags: tuple[int, int], width: int, rate: int, tmp_path: Path
) -> None:
    data = bytearray((VIDEOS / "two_streams.mp4").read_bytes())
    at = 0
    for flag in flags:
        at = data.index(b"tkhd", at) + 4
        data[at + 3] = flag
    path = tmp_path / "two.mp4"
    path.write_bytes(data)
    for thorough in (False, True):
        video = open_video(path, thorough=thorough)
        assert (video.width, video.frames) == (width, rate)
        assert video.rate_hz == pytest.approx(rate)
    assert [shown(picture) for _, picture in read_frames(video)] == list(range(rate))
    assert shown(read_frame(video, rate - 2)) == rate - 2
    assert f"Number {1 if width == 32 else 2} is used" in content_advice(video)[0]


def test_a_thumbnail_is_no_video() -> None:
    small = Stream(64, 48, 30.0, True, False, 0, b"")
    assert best_stream((Stream(640, 480, np.nan, True, True, 0, b""), small)) == 1
    assert best_stream((small, Stream(640, 480, 30.0, True, False, 0, b""))) == 1
    assert best_stream((small, Stream(640, 480, 30.0, False, False, 0, b""))) == 0
    assert best_stream((small, small)) == best_stream(()) == 0


def test_a_cover_picture_is_no_video(tmp_path: Path) -> None:
    """Where it stands before the track, FFmpeg counts it as the first stream."""
    picture = cv2.imencode(".png", np.full((30, 20, 3), 200, np.uint8))[1].tobytes()
    items = box(b"ilst", box(b"covr", box(b"data", struct.pack(">II", 14, 0) + picture)))
    cover = box(b"udta", box(b"meta", bytes(4) + box(b"hdlr", bytes(8) + b"mdirappl" + bytes(9)) + items))
    data = (VIDEOS / "constant.mp4").read_bytes()
    at = data.index(b"trak") - 4
    index = data.index(b"moov") - 4
    length = int.from_bytes(data[index : index + 4], "big")
    path = tmp_path / "cover.mp4"
    path.write_bytes(data[:index] + struct.pack(">I", length + len(cover)) + data[index + 4 : at] + cover + data[at:])
    assert len(read_movie(path).covers_at) == 1
    video = open_video(path)
    assert (video.width, video.height, video.frames) == (64, 48, 40)


def test_a_named_capture_rate_is_proposed_by_inspect(capsys: pytest.CaptureFixture[str]) -> None:
    """120 frames at 30 a second whose metadata say that 240 were taken."""
    path = FIELD / "16-capture-fps-tag" / "slow_meta.mp4"
    assert main(["inspect", str(path)]) == 0
    said = capsys.readouterr().out
    assert "By com.android.capture.fps of the file 240 pictures a second were taken, and it plays 30" in said
    assert "8 times slower than life. If so, give --capture-rate" in said
    assert main(["inspect", str(path), "--capture-rate", "240"]) == 0
    assert "com.android" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "kind", "value", "rate"),
    [
        ("com.android.capture.fps", 23, struct.pack(">f", 120.0), 120.0),
        ("com.android.capture.fps", 24, struct.pack(">d", 59.94), 59.94),
        ("com.apple.quicktime.capture.fps", 1, b"240", 240.0),
        ("com.android.capture.fps", 67, struct.pack(">i", 960), 960.0),
        ("com.android.capture.fps", 1, b"soon", np.nan),
        ("com.android.capture.fps", 23, struct.pack(">f", 0.0), np.nan),
        ("com.android.version", 1, b"14", np.nan),
    ],
)
def test_capture_rates_in_apples_metadata(name: str, kind: int, value: bytes, rate: float, tmp_path: Path) -> None:
    facts = file_facts(mp4(tmp_path, [b"moov"], metadata({"com.other": b"x", name: value}, kind)))
    assert facts.capture_rate_hz == pytest.approx(rate, nan_ok=True)
    assert facts.capture_rate_name == ("" if np.isnan(rate) else name)


def test_a_capture_rate_that_is_the_files_own_is_not_proposed(tmp_path: Path) -> None:
    """Phones write it into ordinary videos too."""
    facts = file_facts(mp4(tmp_path, [b"moov"], metadata({"com.android.capture.fps": struct.pack(">f", 30.0)}, 23)))
    assert capture_rate_sentence(facts, 30.0, "") == ""
    assert "2 times slower" in capture_rate_sentence(facts, 15.0, "")
    assert "4 times faster" in capture_rate_sentence(facts, 120.0, "")


def test_sonys_capture_rate_and_apples_slow_motion_are_read(tmp_path: Path) -> None:
    xml = b'\0\0\0\0<NonRealTimeMeta><VideoFrame videoCodec="AVC" captureFps="119.88p" formatFps="23.98p"/>'
    handler = box(b"hdlr", bytes(8) + b"nrtm" + bytes(13))
    facts = file_facts(mp4(tmp_path, [b"moov"], box(b"meta", bytes(4) + handler + box(b"xml ", xml))))
    assert (facts.capture_rate_hz, facts.capture_rate_name) == (119.88, "Sony captureFps")
    slow = metadata({"com.apple.quicktime.full-frame-rate-playback-intent": b"\0"}, 65)
    assert "its times are those of the fall" in file_facts(mp4(tmp_path, [b"moov"], slow)).remarks[0]
    normal = metadata({"com.apple.quicktime.full-frame-rate-playback-intent": b"\1"}, 65)
    assert file_facts(mp4(tmp_path, [b"moov"], normal)).remarks == ()


@pytest.mark.parametrize(
    ("new", "says"),
    [
        (box(b"clap", struct.pack(">8I", 48, 1, 36, 1, 0, 1, 0, 1)), "asks to show 48 × 36 px of its pictures"),
        (box(b"colr", b"nclx" + struct.pack(">3HB", 9, 18, 9, 0)), "high dynamic range (HLG)"),
        (box(b"colr", b"nclx" + struct.pack(">3HB", 9, 16, 9, 0)), "high dynamic range (PQ)"),
        (box(b"fiel", b"\2\1"), "interlaced"),
        (box(b"sv3d", box(b"svhd", bytes(5)) + box(b"proj", EQUIRECTANGULAR)), "show all directions"),
        (box(b"st3d", b"\0\0\0\0\1"), "two eyes"),
    ],
)
def test_what_a_sample_entry_asks_for_is_said(new: bytes, says: str, tmp_path: Path) -> None:
    video = open_video(mp4(tmp_path, SAMPLE, new))
    assert video.frames == 40
    assert any(says in sentence for sentence in content_advice(video))


def test_ordinary_colours_and_fields_are_not_remarked(tmp_path: Path) -> None:
    for new in (box(b"colr", b"nclx" + struct.pack(">3HB", 1, 1, 1, 0)), box(b"fiel", b"\1\0")):
        assert content_advice(open_video(mp4(tmp_path, SAMPLE, new))) == []


@pytest.mark.parametrize(
    ("matrix", "says"),
    [([-1, 0, 0, 0, 1, 0, 64, 0], "mirrored"), ([0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0], "no multiple of 90°")],
)
def test_a_mirrored_or_slanting_display_is_said(matrix: list[float], says: str, tmp_path: Path) -> None:
    data = bytearray((VIDEOS / "constant.mp4").read_bytes())
    at = data.index(b"tkhd") + 44
    data[at : at + 36] = struct.pack(">9i", *(round(value * 65536) for value in matrix), 1 << 30)
    (tmp_path / "m.mp4").write_bytes(data)
    assert says in content_advice(open_video(tmp_path / "m.mp4"))[0]


def test_an_edit_list_at_another_speed_is_said(tmp_path: Path) -> None:
    data = bytearray((VIDEOS / "constant.mp4").read_bytes())
    at = data.index(b"elst") + 4 + 16
    data[at : at + 4] = struct.pack(">i", 0x4000)
    (tmp_path / "slow.mp4").write_bytes(data)
    assert "plays parts at another speed (0.25)" in content_advice(open_video(tmp_path / "slow.mp4"))[0]


def test_ten_bits_are_said_and_a_full_range_is_read() -> None:
    """The bars are 50 and 205 bright in both; as 8 bits they are so to the rounding of the coding."""
    video = open_video(VIDEOS / "ten_bits.mp4")
    assert video.bits == 10
    assert "10 bits, reduced to 8" in content_advice(video)[0]
    for name in ("ten_bits.mp4", "full_range.mp4", "constant.mp4"):
        bright = read_frame(open_video(VIDEOS / name), 5, grey=True)[24, 4::8].astype(int)
        assert np.minimum(abs(bright - 50), abs(bright - 205)).max() <= 3
    assert content_advice(open_video(VIDEOS / "full_range.mp4")) == []


def timecode_track(number: int, place: int) -> bytes:
    entry = box(b"tmcd", bytes(6) + struct.pack(">H", 1) + bytes(4) + struct.pack(">III", 0, 30000, 1000) + b"\x1e\0")
    table = box(
        b"stbl", box(b"stsd", struct.pack(">II", 0, 1) + entry) + box(b"stco", struct.pack(">III", 0, 1, place))
    )
    media = box(b"hdlr", bytes(8) + b"tmcd" + bytes(13)) + box(b"minf", table)
    return box(b"trak", box(b"mdia", media))


def test_a_timecode_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = (VIDEOS / "constant.mp4").read_bytes()
    number = (1 * 3600 + 2 * 60 + 3) * 30 + 4
    added = box(b"free", struct.pack(">I", number))
    index = data.index(b"moov") - 4
    data = data[:index] + added + data[index:]
    path = tmp_path / "tc.mp4"
    path.write_bytes(inserted(data, [b"moov"], timecode_track(number, index + 8)))
    assert main(["inspect", str(path)]) == 0
    assert "timecode   01:02:03:04 at the first picture" in capsys.readouterr().out


def element(identifier: int, content: bytes) -> bytes:
    name = identifier.to_bytes((identifier.bit_length() + 7) // 8, "big")
    return name + (len(content) | 1 << 56).to_bytes(8, "big") + content


def number(identifier: int, value: int) -> bytes:
    return element(identifier, value.to_bytes(max((value.bit_length() + 7) // 8, 1), "big"))


def matroska(path: Path, *video: bytes, tags: dict[str, str] | None = None) -> Path:
    """The header of a file with one track of pictures."""
    inner = element(0xE0, number(0xB0, 64) + number(0xBA, 48) + b"".join(video))
    track = element(0xAE, number(0xD7, 1) + number(0x83, 1) + number(0x23E383, 33_333_333) + inner)
    said = b"".join(
        element(0x67C8, element(0x45A3, name.encode()) + element(0x4487, text.encode()))
        for name, text in (tags or {}).items()
    )
    segment = element(0x1654AE6B, track) + element(0x1254C367, element(0x7373, said))
    path.write_bytes(element(0x1A45DFA3, element(0x4282, b"matroska")) + element(0x18538067, segment))
    return path


@pytest.mark.parametrize(
    ("video", "says"),
    [
        (number(0x54DD, 8), "asks to show a part"),
        (number(0x9A, 1), "interlaced"),
        (number(0x53B8, 1), "two eyes"),
        (element(0x7670, number(0x7671, 1)), "all directions"),
        (element(0x55B0, number(0x55BA, 16)), "high dynamic range (PQ)"),
    ],
)
def test_what_matroska_says(video: bytes, says: str, tmp_path: Path) -> None:
    path = matroska(tmp_path / "a.mkv", video, tags={"COM.ANDROID.CAPTURE.FPS": "240"})
    facts = file_facts(path)
    assert says in facts.remarks[0]
    assert facts.capture_rate_hz == 240
    assert read_header(path).tracks[0].rate_hz == pytest.approx(30)


def test_damaged_headers_say_nothing(tmp_path: Path) -> None:
    whole = matroska(tmp_path / "a.mkv", number(0x54DD, 8)).read_bytes()
    movie = (FIELD / "16-capture-fps-tag" / "slow_meta.mp4").read_bytes()
    for data, suffix in ((whole, "mkv"), (movie, "mp4")):
        for cut in range(12, len(data), max(len(data) // 60, 1)):
            path = tmp_path / f"cut.{suffix}"
            path.write_bytes(data[:cut])
            file_facts(path)


@pytest.mark.parametrize(
    ("name", "others"),
    [
        ("GH010123.MP4", ("GH020123.MP4", "GH030123.MP4")),
        ("GX020077.MP4", ("GX010077.MP4",)),
        ("GOPR0123.MP4", ("GP010123.MP4",)),
        ("GH010124.MP4", ()),
        ("film.mp4", ()),
    ],
)
def test_chapters_of_a_recording(name: str, others: tuple[str, ...], tmp_path: Path) -> None:
    names = ("GH010123", "GH020123", "GH030123", "GX010077", "GX020077", "GOPR0123", "GP010123", "GH010124")
    for one in names:
        (tmp_path / f"{one}.MP4").write_bytes(b"x")
    (tmp_path / "GH010123.THM").write_bytes(b"x")
    (tmp_path / "film.mp4").write_bytes(b"x")
    assert further_chapters(tmp_path / name) == others


def test_chapters_are_said_by_inspect(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("GH010123.MP4", "GH020123.MP4"):
        (tmp_path / name).write_bytes((VIDEOS / "constant.mp4").read_bytes())
    assert main(["inspect", str(tmp_path / "GH010123.MP4")]) == 0
    assert "GH020123.MP4 beside it belongs to the same recording" in capsys.readouterr().out


def test_a_file_of_nearly_4_gib_goes_on_in_the_next_number(tmp_path: Path) -> None:
    with (tmp_path / "DJI_0010.MP4").open("wb") as file:
        file.truncate(4_000_000_000)
    for name in ("DJI_0011.MP4", "DJI_0012.MP4"):
        (tmp_path / name).write_bytes(b"x")
    assert further_chapters(tmp_path / "DJI_0010.MP4") == ("DJI_0011.MP4",)
    assert further_chapters(tmp_path / "DJI_0011.MP4") == ()


def test_pixels_that_are_not_square_are_read() -> None:
    """By the codec's own aspect of 10 / 11."""
    video = open_video(FIELD / "10-nonsquare-camera" / "par1080.mp4")
    assert video.pixel_aspect == pytest.approx(10 / 11)
    assert "0.909 times as wide as high" in content_advice(video)[0]
    assert content_advice(replace(video, pixel_aspect=1.0)) == []


@pytest.mark.parametrize("how", ["empty", "zeros", "no time scale"])
def test_a_header_of_the_movie_that_says_nothing_falls_back_to_decoding(how: str, tmp_path: Path) -> None:
    data = (VIDEOS / "constant.mp4").read_bytes()
    at = data.index(b"mvhd")
    length = int.from_bytes(data[at - 4 : at], "big")
    if how == "empty":
        new = struct.pack(">I", 8) + b"mvhd" + struct.pack(">I", length - 8) + b"free" + data[at + 12 : at + length - 4]
    elif how == "zeros":
        new = data[at - 4 : at + 4] + bytes(length - 8)
    else:
        new = data[at - 4 : at + 16] + bytes(4) + data[at + 20 : at + length - 4]
    assert len(new) == length
    path = tmp_path / "odd.mp4"
    path.write_bytes(data[: at - 4] + new + data[at + length - 4 :])
    np.testing.assert_allclose(open_video(path).time_s, open_video(VIDEOS / "constant.mp4").time_s)


def test_codecs_without_letters_are_named_by_their_code() -> None:
    assert codec_name(0xFFFFFFFF) == "an unnamed codec"
    assert codec_name(-1) == "an unnamed codec"
    assert codec_name(0xFE61FF01) == "a codec with the code 0x01ff61fe"
    assert codec_name(int.from_bytes(b"xyz1", "little")) == "xyz1"
    assert codec_name(int.from_bytes(b"avc1", "little")) == "H.264"


def test_pictures_that_change_their_size_are_refused(tmp_path: Path) -> None:
    """As where a recorder changes its mode; here by a file that is said to have been smaller at first."""
    video = replace(open_video(VIDEOS / "constant.mp4"), width=32)
    with pytest.raises(InputError, match="Frame 0 has 64 × 48 px, and the first has 32 × 48"):
        read_frame(video, 0)
