# SPDX-License-Identifier: GPL-3.0-or-later
"""The index of MP4 and MOV files: whether it names every frame and all are there and shown, and what it says of them.

ISO/IEC 14496-12: a file is a row of boxes, each with its length and its kind in front; the box "moov" is the index.
Its metadata (the boxes "keys" and "ilst") are those of Apple's QuickTime File Format.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypedDict

import numpy as np

LARGEST_BYTES = 1 << 28
"""No index is read that is larger: hours of video take some MB."""
HEADER_BYTES = 8
INSIDE = {b"trak", b"mdia", b"minf", b"stbl", b"edts"}
WANTED = {b"mvhd", b"mdhd", b"hdlr", b"stts", b"stsz", b"elst", b"tkhd", b"stsd"}
ENABLED = 1
"""Flag of a track that is shown."""
ENTRY_BYTES = 78
"""Of a sample entry of video, before the boxes in it."""
MOST_KEYS = 1000
SONY_CAPTURE = re.compile(rb'captureFps="(\d+(?:\.\d+)?)[pi]?"')


class Box(NamedTuple):
    """Kind, and where the content begins and ends [bytes]."""

    kind: bytes
    begin: int
    end: int


def file_boxes(path: Path) -> Iterator[Box]:
    """The boxes of a file, as far as they can be told; the last may end beyond the file."""
    size, offset = path.stat().st_size, 0
    with path.open("rb") as file:
        while offset + HEADER_BYTES <= size:
            file.seek(offset)
            box = _box(file.read(2 * HEADER_BYTES), 0, offset, size)
            if box is None:
                return
            yield box
            offset = box.end


def indexed_frames(path: Path) -> int:
    """How many frames the index names when each of them is in the file and none is cut off by an edit list, else 0.

    Only plain files are answered for: one video track, no fragments.
    """
    boxes = list(file_boxes(path))
    if any(box.kind == b"moof" for box in boxes) or (boxes and boxes[-1].end > path.stat().st_size):
        return 0
    data, _ = _index(path)
    try:
        tracks = [_parts(data, box.begin, box.end) for box in _boxes(data, 0, len(data)) if box.kind == b"trak"]
        videos = [track for track in tracks if track[b"hdlr"][8:12] == b"vide"]
        movie = _parts(data, 0, len(data), {b"mvhd"})[b"mvhd"]
        return _frames(videos[0], _timescale(movie)) if len(videos) == 1 else 0
    except (*DAMAGED, ZeroDivisionError):  # the index is damaged: decoding tells what is there
        return 0


@dataclass(frozen=True, eq=False)
class VideoTrack:
    """What the index says of a track of pictures.

    Attributes
    ----------
    kind_at : where the name of its box stands in the file [bytes].
    width, height : of the stored pictures [px].
    enabled : it is one of those that are shown.
    frames, rate_hz : number of its pictures, and how many a second they are on average; NaN where that is not known.
    matrix : (3, 3) row-vector matrix by which it is shown.
    speeds : of the parts of its edit list: 1 for true speed.
    clean : width and height that are to be shown of the picture [px]; None for all.
    colour : primaries, transfer, matrix as of ISO/IEC 23001-8, and full range; None where not given.
    fields : of a picture: 1, or 2 where it is interlaced.
    spherical, stereo : it is a picture of all directions; of two eyes.
    """

    kind_at: int
    width: int
    height: int
    enabled: bool
    frames: int
    rate_hz: float
    matrix: tuple[float, ...]
    speeds: tuple[float, ...] = ()
    clean: tuple[float, float] | None = None
    colour: tuple[int, int, int, bool] | None = None
    fields: int = 1
    spherical: bool = False
    stereo: bool = False


@dataclass(frozen=True, eq=False)
class Movie:
    """What the index says: tracks of pictures, metadata as name → text, places of cover pictures, frames of timecode.

    timecode : hours, minutes, seconds and frames of the first picture, in words; empty without.
    """

    tracks: tuple[VideoTrack, ...] = ()
    metadata: dict[str, str] = field(default_factory=dict)
    covers_at: tuple[int, ...] = ()
    timecode: str = ""


DAMAGED = (KeyError, ValueError, IndexError, struct.error, UnicodeDecodeError, RecursionError, OverflowError)


def read_movie(path: Path) -> Movie:
    """What the index of a file says; nothing where there is no index, or a damaged one."""
    data, offset = _index(path)
    tracks, covers, metadata, timecode = [], [], dict[str, str](), ""
    try:
        for box in _boxes(data, 0, len(data)):
            try:
                if box.kind == b"trak":
                    parts = _parts(data, box.begin, box.end)
                    subtype = parts[b"hdlr"][8:12]
                    if subtype == b"vide":
                        tracks.append(_track(parts, offset + box.begin - 4))
                    elif subtype == b"tmcd":
                        timecode = timecode or _timecode(path, data, box, parts)
                elif box.kind == b"meta":
                    metadata |= _metadata(data, box)
                elif box.kind == b"udta":
                    for inner in _boxes(data, box.begin, box.end):
                        if inner.kind == b"meta":
                            covers += [offset + at for at in _covers(data, inner)]
                            metadata |= _metadata(data, inner)
            except DAMAGED:
                continue
    except DAMAGED:
        pass
    return Movie(tuple(tracks), metadata, tuple(covers), timecode)


def _index(path: Path) -> tuple[bytes, int]:
    """The content of the box "moov", and where it begins in the file; empty where there is none, or a vast one."""
    size = path.stat().st_size
    index = next((box for box in file_boxes(path) if box.kind == b"moov"), None)
    if index is None or index.end > size or index.end - index.begin > LARGEST_BYTES:
        return b"", 0
    with path.open("rb") as file:
        file.seek(index.begin)
        return file.read(index.end - index.begin), index.begin


def _track(parts: dict[bytes, bytes], kind_at: int) -> VideoTrack:
    header, entry = parts[b"tkhd"], parts[b"stsd"][8:]
    matrix_at = 52 if header[0] == 1 else 40
    matrix = struct.unpack(">9i", header[matrix_at : matrix_at + 36])
    width, height = struct.unpack(">HH", entry[32:36])
    runs = np.frombuffer(parts.get(b"stts", b"")[8:], ">u4").astype(np.int64)
    runs = runs[: runs.size // 2 * 2].reshape(-1, 2)
    frames, ticks = int(runs[:, 0].sum()), int(runs.prod(axis=1).sum())
    length = int.from_bytes(entry[:4], "big")
    return VideoTrack(
        kind_at=kind_at,
        width=width,
        height=height,
        enabled=bool(header[3] & ENABLED),
        frames=frames,
        rate_hz=frames * _timescale(parts[b"mdhd"]) / ticks if ticks else np.nan,
        matrix=tuple(value / (1 << 30 if i % 3 == 2 else 1 << 16) for i, value in enumerate(matrix)),
        speeds=tuple(speed for _, begin, speed in _edits(parts[b"elst"]) if begin >= 0) if b"elst" in parts else (),
        **_of_entry(entry, min(length, len(entry))),
    )


class _Entry(TypedDict, total=False):
    clean: tuple[float, float]
    colour: tuple[int, int, int, bool]
    fields: int
    spherical: bool
    stereo: bool


def _of_entry(entry: bytes, end: int) -> _Entry:
    """What the boxes in a sample entry say; QuickTime may end them by four zeros."""
    found = _Entry()
    at = 8 + ENTRY_BYTES
    while at + HEADER_BYTES <= end:
        box = _box(entry, at, 0, end)
        if box is None or box.end > end:
            break
        data = entry[box.begin : box.end]
        if box.kind == b"clap" and len(data) >= 16:
            wide, over_w, high, over_h = struct.unpack(">4I", data[:16])
            found["clean"] = wide / max(over_w, 1), high / max(over_h, 1)
        elif box.kind == b"colr" and data[:4] in (b"nclx", b"nclc") and len(data) >= 10:
            primaries, transfer, matrix = struct.unpack(">3H", data[4:10])
            found["colour"] = primaries, transfer, matrix, bool(data[10:11] and data[10] & 0x80)
        elif box.kind == b"fiel" and data:
            found["fields"] = data[0]
        elif box.kind == b"sv3d":
            found["spherical"] = True
        elif box.kind == b"st3d" and len(data) > 4:
            found["stereo"] = data[4] != 0
        at = box.end
    return found


def _metadata(data: bytes, box: Box) -> dict[str, str]:
    """Name → value, as text, of the metadata in a box "meta"; also the capture rate that Sony writes as XML."""
    begin = box.begin if data[box.begin + 4 : box.begin + 8] in (b"hdlr", b"keys", b"ilst") else box.begin + 4
    inner = {one.kind: one for one in _boxes(data, begin, box.end)}
    found: dict[str, str] = {}
    if b"xml " in inner and (match := SONY_CAPTURE.search(data[inner[b"xml "].begin : inner[b"xml "].end])):
        found["Sony captureFps"] = match[1].decode()
    if b"keys" not in inner or b"ilst" not in inner:
        return found
    at, names = inner[b"keys"].begin + 8, list[str]()
    while at + 8 <= inner[b"keys"].end and len(names) < MOST_KEYS:
        length = int.from_bytes(data[at : at + 4], "big")
        if length < 8:
            break
        names.append(data[at + 8 : at + length].decode("utf-8", "replace"))
        at += length
    for item in _boxes(data, inner[b"ilst"].begin, inner[b"ilst"].end):
        number = int.from_bytes(item.kind, "big") - 1
        value = next((one for one in _boxes(data, item.begin, item.end) if one.kind == b"data"), None)
        if value is not None and 0 <= number < len(names):
            found[names[number]] = _value(data[value.begin : value.end])
    return found


def _value(data: bytes) -> str:
    """Of a box "data": its kind, a language, and its value."""
    kind, value = int.from_bytes(data[:4], "big"), data[8:]
    if kind == 23 and len(value) == 4:
        return repr(struct.unpack(">f", value)[0])
    if kind == 24 and len(value) == 8:
        return repr(struct.unpack(">d", value)[0])
    if kind in (21, 65, 66, 67, 74):
        return str(int.from_bytes(value, "big", signed=True))
    if kind in (22, 75, 76, 77, 78):
        return str(int.from_bytes(value, "big"))
    return value.decode("utf-8", "replace")


def _covers(data: bytes, box: Box) -> list[int]:
    """Where the names of the boxes of cover pictures stand in the index."""
    begin = box.begin if data[box.begin + 4 : box.begin + 8] in (b"hdlr", b"ilst") else box.begin + 4
    return [
        cover.begin - 4
        for one in _boxes(data, begin, box.end)
        if one.kind == b"ilst"
        for cover in _boxes(data, one.begin, one.end)
        if cover.kind == b"covr"
    ]


def _timecode(path: Path, data: bytes, box: Box, parts: dict[bytes, bytes]) -> str:
    """Of the first sample of a track of timecode: the number of a frame, counted from midnight."""
    entry = parts[b"stsd"][8:]
    per_second = entry[32] if len(entry) > 32 else 0  # size, format, 6, reference, reserved, flags, scale, duration
    offsets = _parts(data, box.begin, box.end, {b"stco", b"co64"})
    wide = b"co64" in offsets
    table = offsets[b"co64" if wide else b"stco"]
    place = int.from_bytes(table[8 : 16 if wide else 12], "big")
    if not per_second or not 0 < place <= path.stat().st_size - 4:
        return ""
    with path.open("rb") as file:
        file.seek(place)
        number = int.from_bytes(file.read(4), "big")
    seconds, frames = divmod(number, per_second)
    return f"{seconds // 3600 % 24:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}:{frames:02d}"


def _frames(track: dict[bytes, bytes], movie_hz: int) -> int:
    """Of a track's table of times; 0 where it disagrees with that of sizes, or where not all of them are shown."""
    runs = np.frombuffer(track[b"stts"][8:], ">u4").astype(np.int64).reshape(-1, 2)
    count = int.from_bytes(track[b"stsz"][8:12], "big")
    if runs[:, 0].sum() != count:
        return 0
    if b"elst" in track:
        end = int(runs.prod(axis=1).sum())
        edits = [edit for edit in _edits(track[b"elst"]) if edit[1] >= 0]
        if len(edits) != 1 or edits[0][2] != 1:
            return 0
        shown_s, begin = edits[0][0] / movie_hz, edits[0][1]
        if begin + shown_s * _timescale(track[b"mdhd"]) < end - 0.5 * end / max(count, 1):
            return 0
    return count


def _edits(content: bytes) -> list[tuple[int, int, float]]:
    """Of each entry of an edit list: duration in ticks of the movie, first tick of the media (−1: a pause), speed."""
    entries = np.frombuffer(content[8:], ">i8,>i8,>i4" if content[0] == 1 else ">u4,>i4,>i4")
    return [(duration, begin, speed / 0x10000) for duration, begin, speed in entries.tolist()]


def _timescale(header: bytes) -> int:
    """Ticks per second, from the header of a movie or of its media [Hz]."""
    at = 20 if header[0] == 1 else 12
    if len(header) < at + 4:
        raise ValueError("a header is cut short")
    return int.from_bytes(header[at : at + 4], "big")


def _parts(data: bytes, begin: int, end: int, wanted: set[bytes] = WANTED) -> dict[bytes, bytes]:
    """Contents of the wanted boxes, at any depth."""
    parts: dict[bytes, bytes] = {}
    for box in _boxes(data, begin, end):
        if box.kind in wanted:
            parts.setdefault(box.kind, data[box.begin : box.end])
        elif box.kind in INSIDE:
            for kind, content in _parts(data, box.begin, box.end, wanted).items():
                parts.setdefault(kind, content)
    return parts


def _boxes(data: bytes, begin: int, end: int) -> Iterator[Box]:
    while begin + HEADER_BYTES <= end:
        box = _box(data, begin, 0, end)
        if box is None or box.end > end:
            raise ValueError("a box is cut short")
        yield box
        begin = box.end


def _box(data: bytes, at: int, offset: int, size: int) -> Box | None:
    """The box whose header stands at `at`, which is `offset` further on in the file; None where there is none."""
    length, header = int.from_bytes(data[at : at + 4], "big"), HEADER_BYTES
    if length == 1:
        length, header = int.from_bytes(data[at + 8 : at + 16], "big"), 2 * HEADER_BYTES
    begin = at + offset
    if length == 0:
        return Box(data[at + 4 : at + 8], begin + header, size)
    if length < header:
        return None
    return Box(data[at + 4 : at + 8], begin + header, begin + length)
