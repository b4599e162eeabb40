# SPDX-License-Identifier: GPL-3.0-or-later
"""What kind of file it is, told by its first bytes: for readable names, and for saying why it is no video."""

from pathlib import Path

from ..formats.mp4 import file_boxes

HEAD_BYTES = 4096
MAGIC = (
    (0, b"\x1aE\xdf\xa3", "Matroska"),
    (4, b"ftyp", "MP4"),
    (4, b"moov", "MOV"),
    (4, b"mdat", "MOV"),
    (4, b"wide", "MOV"),
    (8, b"AVI ", "AVI"),
    (8, b"WAVE", "WAV sound"),
    (0, b"OggS", "Ogg"),
    (0, b"FLV", "FLV"),
    (0, b"0&\xb2u\x8ef\xcf\x11", "ASF (WMV)"),
    (0, b"\x00\x00\x01\xba", "MPEG programme stream"),
    (0, b"\x06\x0e+4", "MXF"),
    (0, b"GIF8", "GIF"),
    (0, b"\x89PNG", "PNG picture"),
    (0, b"\xff\xd8\xff", "JPEG picture"),
    (0, b"BM", "BMP picture"),
    (0, b"II*\x00", "TIFF picture"),
    (0, b"MM\x00*", "TIFF picture"),
    (0, b"ID3", "MP3 sound"),
    (0, b"fLaC", "FLAC sound"),
)
"""(offset, bytes there, name)."""
BRANDS = {
    b"qt  ": "MOV",
    b"M4A ": "MP4 sound",
    b"heic": "HEIC picture",
    b"mif1": "HEIF picture",
    b"avif": "AVIF picture",
}
"""Of the files that begin as MP4 does, those that are something else (ISO/IEC 14496-12, major brand)."""
CODECS = {
    "avc1": "H.264",
    "avc3": "H.264",
    "h264": "H.264",
    "hevc": "H.265 (HEVC)",
    "hvc1": "H.265 (HEVC)",
    "hev1": "H.265 (HEVC)",
    "av01": "AV1",
    "vp80": "VP8",
    "vp90": "VP9",
    "vp09": "VP9",
    "mjpg": "Motion JPEG",
    "jpeg": "Motion JPEG",
    "fmp4": "MPEG-4 Part 2",
    "mp4v": "MPEG-4 Part 2",
    "xvid": "MPEG-4 Part 2",
    "divx": "MPEG-4 Part 2",
    "dx50": "MPEG-4 Part 2",
    "mpg1": "MPEG-1",
    "mpg2": "MPEG-2",
    "apch": "ProRes 422 HQ",
    "apcn": "ProRes 422",
    "apcs": "ProRes 422 LT",
    "apco": "ProRes 422 Proxy",
    "ap4h": "ProRes 4444",
    "dvsd": "DV",
    "ffv1": "FFV1",
}


UNKNOWN_CODEC = 0xFFFFFFFF
"""What OpenCV has for a codec that it does not know."""


def container_of(path: Path) -> str:
    """Name of the container: "MP4", "MOV", "Matroska", "WebM", "AVI", …; "… picture" or "… sound"; empty if unknown."""
    head = _head(path)
    name = next((name for offset, magic, name in MAGIC if head[offset : offset + len(magic)] == magic), "")
    if name == "MP4":
        return BRANDS.get(head[8:12], name)
    if name == "Matroska":
        return "WebM" if b"webm" in head[:64] else name
    if not name and any(head[start : start + 2 * size : size] == b"GG" for start, size in ((0, 188), (4, 192))):
        return "MPEG transport stream"
    return name


def codec_name(fourcc: int) -> str:
    """Readable name of a codec from its four-character code, with the code: "H.264 (avc1)"."""
    value = fourcc & 0xFFFFFFFF
    code = value.to_bytes(4, "little").decode("latin-1").strip("\0 ")
    if not code or value == UNKNOWN_CODEC:
        return "an unnamed codec"
    if not (code.isascii() and code.isprintable()):
        return f"a codec with the code 0x{value.to_bytes(4, 'little').hex()}"
    return CODECS.get(code.lower(), code)


def lacks_index(path: Path) -> bool:
    """Whether an MP4 or MOV file ends before its index (the box "moov"), as after a recording that broke off."""
    return not any(box.kind in (b"moov", b"moof") for box in file_boxes(path))


def holds_sound(path: Path) -> bool:
    """Whether the file has a sound track, as far as its ends tell; asked only when there is no picture track."""
    with path.open("rb") as file:
        text = file.read(1 << 20)
        file.seek(max(path.stat().st_size - (1 << 20), 0))
        text += file.read()
    return any(mark in text for mark in (b"soun", b"A_OPUS", b"A_VORBIS", b"A_AAC", b"A_PCM", b"auds", b"WAVEfmt"))


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(HEAD_BYTES)
