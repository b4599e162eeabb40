# SPDX-License-Identifier: GPL-3.0-or-later
"""What the header of a Matroska or WebM file says of its tracks of pictures (RFC 9559), and its tags."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

SEGMENT, TRACKS, TRACK, TAGS, CLUSTER = 0x18538067, 0x1654AE6B, 0xAE, 0x1254C367, 0x1F43B675
TRACK_TYPE, DEFAULT, ENABLED, DURATION, VIDEO = 0x83, 0x88, 0xB9, 0x23E383, 0xE0
WIDTH, HEIGHT, INTERLACED, STEREO = 0xB0, 0xBA, 0x9A, 0x53B8
CROPS = (0x54AA, 0x54BB, 0x54CC, 0x54DD)
"""Bottom, top, left, right."""
COLOUR, MATRIX, BITS, RANGE, TRANSFER, PRIMARIES = 0x55B0, 0x55B1, 0x55B2, 0x55B9, 0x55BA, 0x55BB
PROJECTION, PROJECTION_TYPE = 0x7670, 0x7671
TAG, SIMPLE, NAME, TEXT = 0x7373, 0x67C8, 0x45A3, 0x4487
PICTURES, SUBTITLES = 1, 0x11
"""Kinds of tracks."""
LARGEST_BYTES = 1 << 24
"""No header or table of tags is read that is larger."""
MOST_ELEMENTS = 100_000


class Element(NamedTuple):
    """Identifier, where it begins, and where its content begins and ends [bytes]."""

    identifier: int
    at: int
    begin: int
    end: int


@dataclass(frozen=True, eq=False)
class PictureTrack:
    """A track of pictures.

    Attributes
    ----------
    type_at : where the kind of the track stands in the file [bytes].
    width, height : [px].
    default, enabled : flags; both are set where they are not written.
    rate_hz : NaN where it is not written.
    cropped : pixels that are not to be shown, at any side.
    interlaced, stereo, spherical : it is.
    colour : primaries, transfer, matrix as of ISO/IEC 23001-8, and full range.
    bits : of a channel; 0 where it is not written.
    """

    type_at: int
    width: int
    height: int
    default: bool
    enabled: bool
    rate_hz: float
    cropped: bool
    interlaced: bool
    stereo: bool
    spherical: bool
    colour: tuple[int, int, int, bool]
    bits: int


@dataclass(frozen=True, eq=False)
class Header:
    """Tracks of pictures, and tags as name → text."""

    tracks: tuple[PictureTrack, ...] = ()
    tags: dict[str, str] = field(default_factory=dict)


def read_header(path: Path) -> Header:
    """What the file says; nothing where that is damaged."""
    tracks: list[PictureTrack] = []
    tags: dict[str, str] = {}
    try:
        for element, data in _tables(path):
            if element.identifier == TRACKS:
                entries = [one for one in _elements(data, 0, len(data)) if one.identifier == TRACK]
                for entry in entries:
                    track = _track(data, entry, element.begin)
                    tracks += [track] if track is not None else []
            else:
                tags |= _tags(data)
    except (ValueError, IndexError, struct.error):
        pass
    return Header(tuple(tracks), tags)


def _tables(path: Path) -> Iterator[tuple[Element, bytes]]:
    """The tables of tracks and of tags, as far as the sizes of what stands between them are known."""
    size = path.stat().st_size
    with path.open("rb") as file:

        def head(at: int) -> Element | None:
            file.seek(at)
            return _element(file.read(12), 0, at, size)

        at, end, count = 0, size, 0
        while at < end and count < MOST_ELEMENTS and (element := head(at)) is not None:
            count += 1
            if element.identifier == SEGMENT:
                at = element.begin
                continue
            if element.identifier in (TRACKS, TAGS) and element.end - element.begin <= LARGEST_BYTES:
                file.seek(element.begin)
                yield element, file.read(element.end - element.begin)
            at = element.end


def _track(data: bytes, entry: Element, offset: int) -> PictureTrack | None:
    values = {one.identifier: one for one in _elements(data, entry.begin, entry.end)}
    if VIDEO not in values or _whole(data, values, TRACK_TYPE) != PICTURES:
        return None
    inner = {one.identifier: one for one in _elements(data, values[VIDEO].begin, values[VIDEO].end)}
    colour = _inside(data, inner, COLOUR)
    step_ns = _whole(data, values, DURATION)
    return PictureTrack(
        type_at=offset + values[TRACK_TYPE].end - 1,
        width=_whole(data, inner, WIDTH),
        height=_whole(data, inner, HEIGHT),
        default=bool(_whole(data, values, DEFAULT, 1)),
        enabled=bool(_whole(data, values, ENABLED, 1)),
        rate_hz=1e9 / step_ns if step_ns else float("nan"),
        cropped=any(_whole(data, inner, side) for side in CROPS),
        interlaced=_whole(data, inner, INTERLACED) == 1,
        stereo=_whole(data, inner, STEREO) != 0,
        spherical=_whole(data, _inside(data, inner, PROJECTION), PROJECTION_TYPE) != 0,
        colour=(
            _whole(data, colour, PRIMARIES, 2),
            _whole(data, colour, TRANSFER, 2),
            _whole(data, colour, MATRIX, 2),
            _whole(data, colour, RANGE) == 2,
        ),
        bits=_whole(data, colour, BITS),
    )


def _tags(data: bytes) -> dict[str, str]:
    found: dict[str, str] = {}
    for tag in _elements(data, 0, len(data)):
        if tag.identifier != TAG:
            continue
        for one in _elements(data, tag.begin, tag.end):
            if one.identifier == SIMPLE:
                parts = {part.identifier: part for part in _elements(data, one.begin, one.end)}
                if NAME in parts and TEXT in parts:
                    name, text = (data[parts[key].begin : parts[key].end] for key in (NAME, TEXT))
                    found[name.decode("utf-8", "replace").rstrip("\0")] = text.decode("utf-8", "replace").rstrip("\0")
    return found


def _inside(data: bytes, values: dict[int, Element], identifier: int) -> dict[int, Element]:
    if identifier not in values:
        return {}
    outer = values[identifier]
    return {one.identifier: one for one in _elements(data, outer.begin, outer.end)}


def _whole(data: bytes, values: dict[int, Element], identifier: int, default: int = 0) -> int:
    if identifier not in values:
        return default
    return int.from_bytes(data[values[identifier].begin : values[identifier].end], "big")


def _elements(data: bytes, begin: int, end: int) -> Iterator[Element]:
    while begin < end:
        element = _element(data, begin, 0, end)
        if element is None or element.end > end:
            raise ValueError("an element is cut short")
        yield element
        begin = element.end


def _element(data: bytes, at: int, offset: int, size: int) -> Element | None:
    """The element whose head stands at `at` of the data, `offset` further on in the file; None where there is none."""
    if at + 2 > len(data) or data[at] == 0:
        return None
    wide = 9 - data[at].bit_length()
    identifier = int.from_bytes(data[at : at + wide], "big")
    if at + wide >= len(data) or data[at + wide] == 0:
        return None
    long = 9 - data[at + wide].bit_length()
    raw = int.from_bytes(data[at + wide : at + wide + long], "big")
    length, unknown = raw & ((1 << 7 * long) - 1), (1 << 7 * long) - 1
    begin = offset + at + wide + long
    return Element(identifier, offset + at, begin, size if length == unknown else min(begin + length, size))
