# SPDX-License-Identifier: GPL-3.0-or-later
"""What a video file says of itself beside its pictures: its streams, its capture rate, how it is to be shown."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..formats.matroska import SUBTITLES, PictureTrack, read_header
from ..formats.mp4 import Movie, VideoTrack, read_movie
from .containers import container_of

CAPTURE_RATE = re.compile(r"(^|[. ])capture\W?fps$", re.IGNORECASE)
"""com.android.capture.fps, com.apple.quicktime.capture.fps, and what Sony calls captureFps."""
SLOW_BY_DEFAULT = "com.apple.quicktime.full-frame-rate-playback-intent"
FASTEST_HZ = 1e5
HDR = {16: "PQ", 18: "HLG"}
"""Transfer characteristics of ISO/IEC 23001-8."""
BT_2020 = 9
TURNED = 1e-3
GOPRO = re.compile(r"(?P<head>G[HXLPSO])(?P<chapter>\d\d)(?P<clip>\d{4})", re.IGNORECASE)
GOPRO_FIRST = re.compile(r"GOPR(?P<clip>\d{4})", re.IGNORECASE)
NUMBERED = re.compile(r"(?P<head>.*?)(?P<number>\d+)(?P<tail>(?:_D)?)", re.IGNORECASE)
SPLIT_BYTES = 3_500_000_000
"""Cameras that split their recordings do so a little below 4 GiB."""
NAMED = 3


@dataclass(frozen=True)
class Stream:
    """A stream of pictures in a file.

    Attributes
    ----------
    width, height : of the stored pictures [px].
    rate_hz : NaN where it is not known.
    default : the file says that it is one of those to be shown.
    still : it holds a single picture, as a thumbnail does.
    at, name : where the name of its entry stands in the file, and by which it is hidden.
    """

    width: int
    height: int
    rate_hz: float
    default: bool
    still: bool
    at: int
    name: bytes


@dataclass(frozen=True, eq=False)
class FileFacts:
    """What a file says.

    Attributes
    ----------
    streams, used : of pictures, and the index of the one that is decoded.
    hidden : what is read in place of the entries of the others: offset → bytes.
    capture_rate_hz, capture_rate_name : at which the camera took the pictures, and which field says so; NaN, "".
    timecode : of the first picture; empty without.
    remarks : sentences about what the file asks for and is not done, or what its numbers mean.
    """

    streams: tuple[Stream, ...] = ()
    used: int = 0
    hidden: Mapping[int, bytes] = field(default_factory=dict)
    capture_rate_hz: float = np.nan
    capture_rate_name: str = ""
    timecode: str = ""
    remarks: tuple[str, ...] = ()


def file_facts(path: Path) -> FileFacts:
    """What a file says; what it does not say, or in other formats, is left at its default."""
    container = container_of(path)
    if container in ("MP4", "MOV"):
        return _of_movie(read_movie(path))
    if container in ("Matroska", "WebM"):
        return _of_matroska(path)
    return FileFacts()


def best_stream(streams: tuple[Stream, ...]) -> int:
    """Index of the stream that is meant: no thumbnail, marked as default, the largest, the first."""
    if not streams:
        return 0
    return max(
        range(len(streams)),
        key=lambda i: (not streams[i].still, streams[i].default, streams[i].width * streams[i].height, -i),
    )


def further_chapters(path: Path) -> tuple[str, ...]:
    """Names of files beside a video that go on with its recording, or begin it.

    GoPro cuts a recording into chapters GH010123, GH020123, …, or GOPR0123, GP010123, …; other cameras give the next
    number to what follows a file of nearly 4 GiB.
    """
    if not path.is_file():
        return ()
    stem, suffix = path.stem, path.suffix.lower()
    others = sorted(
        one for one in path.parent.iterdir() if one.suffix.lower() == suffix and one.name != path.name and one.is_file()
    )
    clip = _gopro_clip(stem)
    if clip:
        return tuple(one.name for one in others if _gopro_clip(one.stem) == clip)
    found = NUMBERED.fullmatch(stem)
    if found is None or path.stat().st_size < SPLIT_BYTES:
        return ()
    number = found["number"]
    following = f"{found['head']}{int(number) + 1:0{len(number)}d}{found['tail']}".lower()
    return tuple(one.name for one in others if one.stem.lower() == following)


def chapters_remark(path: Path) -> str:
    """That a recording goes on in other files, a sentence; empty where there are none."""
    names = further_chapters(path)
    if not names:
        return ""
    shown = ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")
    return (
        f"{shown} beside it {'belongs' if len(names) == 1 else 'belong'} to the same recording: each file has its own "
        "times from 0 on. Use them as videos of their own, or join them first."
    )


def streams_remark(facts: FileFacts) -> str:
    """That there are several streams of pictures and which is used, a sentence; empty for one."""
    if len(facts.streams) < 2:
        return ""
    each = [
        f"{one.width} × {one.height} px"
        + (f" at {one.rate_hz:.4g} Hz" if np.isfinite(one.rate_hz) and not one.still else "")
        + (" (a single picture)" if one.still else " (default)" if one.default and not _all_default(facts) else "")
        for one in facts.streams
    ]
    return (
        f"The file has {len(each)} streams of pictures: {'; '.join(each)}. Number {facts.used + 1} is used. "
        "For another, take it out with ffmpeg -map 0:v:N -c copy, N from 0."
    )


def _all_default(facts: FileFacts) -> bool:
    return all(one.default for one in facts.streams)


def _gopro_clip(stem: str) -> str:
    """What the chapters of one recording have in common; empty for other names."""
    if found := GOPRO_FIRST.fullmatch(stem):
        return f"GP{found['clip']}"
    found = GOPRO.fullmatch(stem)
    return f"{found['head'].upper()}{found['clip']}" if found else ""


def _chosen(streams: list[Stream]) -> tuple[tuple[Stream, ...], int, dict[int, bytes]]:
    found = tuple(streams)
    used = best_stream(found)
    return found, used, {one.at: one.name for i, one in enumerate(found) if i != used}


def _of_movie(movie: Movie) -> FileFacts:
    several = any(track.frames > 1 for track in movie.tracks)
    streams, used, hidden = _chosen(
        [
            Stream(t.width, t.height, t.rate_hz, t.enabled, several and t.frames == 1, t.kind_at, b"free")
            for t in movie.tracks
        ]
    )
    if streams:  # else FFmpeg takes the cover for the first stream
        hidden |= {at: b"free" for at in movie.covers_at if at < streams[used].at}
    rate, name = capture_rate(movie.metadata)
    slow = movie.metadata.get(SLOW_BY_DEFAULT)
    return FileFacts(
        streams=streams,
        used=used,
        hidden=hidden,
        capture_rate_hz=rate,
        capture_rate_name=name,
        timecode=movie.timecode,
        remarks=tuple(_movie_remarks(movie.tracks[used], slow)) if streams else (),
    )


def _of_matroska(path: Path) -> FileFacts:
    header = read_header(path)
    streams, used, hidden = _chosen(
        [
            Stream(t.width, t.height, t.rate_hz, t.default and t.enabled, False, t.type_at, bytes([SUBTITLES]))
            for t in header.tracks
        ]
    )
    rate, name = capture_rate(header.tags)
    remarks = tuple(_matroska_remarks(header.tracks[used])) if streams else ()
    return FileFacts(streams, used, hidden, rate, name, header.tags.get("TIMECODE", ""), remarks)


def capture_rate(metadata: Mapping[str, str]) -> tuple[float, str]:
    """The capture rate [Hz] that metadata name, and the name of the field; NaN and "" where none does."""
    for name, value in metadata.items():
        if CAPTURE_RATE.search(name):
            try:
                rate = float(value)
            except ValueError:
                continue
            if 0 < rate < FASTEST_HZ:
                return rate, name
    return np.nan, ""


def _movie_remarks(track: VideoTrack, slow: str | None) -> Iterator[str]:
    if any(abs(speed - 1) > TURNED for speed in track.speeds):
        parts = ", ".join(f"{speed:g}" for speed in dict.fromkeys(track.speeds))
        yield (
            f"The file's edit list plays parts at another speed ({parts}): this is not done here, times are those at "
            "which the pictures were stored."
        )
    a, b, _, c, d, *_ = track.matrix
    if a * d - b * c < 0:
        yield "The file asks to be shown mirrored: this is not done, pictures and pixels are as they were taken."
    elif min(abs(a), abs(b)) > TURNED:
        yield "The file asks to be turned by an angle that is no multiple of 90°: this is not done."
    if track.clean is not None and (track.clean[0] < track.width or track.clean[1] < track.height):
        yield (
            f"The file asks to show {track.clean[0]:g} × {track.clean[1]:g} px of its pictures: they are used whole, "
            "and so are their pixels."
        )
    if slow is not None and slow.strip() in ("0", "0.0"):
        yield (
            "The phone plays this video as slow motion, but its times are those of the fall: it needs no capture rate. "
            "A copy that was exported with the slow motion in it does."
        )
    yield from _looks(track.colour, 0, track.fields == 2, track.spherical, track.stereo)


def _matroska_remarks(track: PictureTrack) -> Iterator[str]:
    if track.cropped:
        yield "The file asks to show a part of its pictures: they are used whole, and so are their pixels."
    yield from _looks(track.colour, track.bits, track.interlaced, track.spherical, track.stereo)


def _looks(
    colour: tuple[int, int, int, bool] | None, bits: int, interlaced: bool, spherical: bool, stereo: bool
) -> Iterator[str]:
    if spherical:
        yield (
            "The pictures show all directions: no lens is known here that does so. Export a view of the fall, with a "
            "fixed angle, from the camera maker's program."
        )
    if stereo:
        yield "Each picture holds those of two eyes: cut one of them out before a camera is solved."
    if interlaced:
        yield "The file says that its pictures are interlaced: each then holds two moments. Make a frame of each field."
    if colour is not None and (colour[1] in HDR or colour[0] == BT_2020 or bits > 8):
        what = HDR.get(colour[1], "")
        yield (
            f"The pictures are of high dynamic range{f' ({what})' if what else ''} and are reduced to 8 bits: they "
            "look pale. Places and times are not touched."
        )
