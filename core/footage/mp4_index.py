# SPDX-License-Identifier: GPL-3.0-or-later
"""The index of MP4 and MOV files: whether it names every frame, and whether all that it names is there and shown.

ISO/IEC 14496-12: a file is a row of boxes, each with its length and its kind in front; the box "moov" is the index.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

LARGEST_BYTES = 1 << 28
"""No index is read that is larger: hours of video take some MB."""
HEADER_BYTES = 8
INSIDE = {b"trak", b"mdia", b"minf", b"stbl", b"edts"}
WANTED = {b"mvhd", b"mdhd", b"hdlr", b"stts", b"stsz", b"elst"}


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
    index = next((box for box in boxes if box.kind == b"moov"), None)
    in_parts = any(box.kind == b"moof" for box in boxes)
    if index is None or in_parts or boxes[-1].end > path.stat().st_size or index.end - index.begin > LARGEST_BYTES:
        return 0
    with path.open("rb") as file:
        file.seek(index.begin)
        data = file.read(index.end - index.begin)
    try:
        tracks = [_parts(data, box.begin, box.end) for box in _boxes(data, 0, len(data)) if box.kind == b"trak"]
        videos = [track for track in tracks if track[b"hdlr"][8:12] == b"vide"]
        movie = _parts(data, 0, len(data), {b"mvhd"})[b"mvhd"]
        return _frames(videos[0], _timescale(movie)) if len(videos) == 1 else 0
    except (KeyError, ValueError, ZeroDivisionError):  # the index is damaged: decoding tells what is there
        return 0


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
