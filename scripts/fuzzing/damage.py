# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged copies of a file, as bad discs, other programs, and people who mean no good make them."""

import re
import struct
from collections.abc import Callable

import numpy as np

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_]\w+")
NUMBERS = (
    *(b"nan", b"NaN", b"inf", b"-inf", b"0", b"-1", b"1e308", b"-1e308", b"1e300", b"1e-320", b"1e18", b"2e9", b"-0.0"),
    *(b"4294967295", b"4294967296", b"2147483648", b"18446744073709551616", b"9" * 40, b"9" * 5000, b"1e999", b"1e9"),
    *(b"", b" ", b'"', b'""', b"1,5", b"1_0", b"0x10", b"true", b"[]", b"{}", b"null", b"[1, 2]", b"\xc3\xa9", b"\xff"),
    *(b"\x1b[31m", b"\x07", b"\0", b"\r", b"\xe2\x80\xae", b"\xd9\xa1\xd9\xa2", b"x" * 5000, b"1e5", b"1e-9", b"-7"),
)
MOST_BYTES = 100_000_000
"""Damages multiply: what is larger is not damaged again."""
WHOLE = (0, 1, 2, 3, 127, 128, 255, 256, 32767, 65535, 65536, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
REALS = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-310, 1e9, -0.0, 1e18)


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """The data with one to four damages."""
    for _ in range(int(random.choice([1, 1, 1, 2, 3, 4]))):
        if len(data) > MOST_BYTES:
            break
        ways = BINARY_WAYS if b"\0" in data[:4096] or random.random() < 0.08 else TEXT_WAYS
        data = ways[int(random.integers(len(ways)))](data, random)
    return data


def _place(data: bytes, random: np.random.Generator) -> int:
    """More often near the beginning, where headers are."""
    within = min(len(data), int(random.choice([64, 400, 4000, 1 << 30])))
    return int(random.integers(within + 1))


def _cut(data: bytes, random: np.random.Generator) -> bytes:
    return data[: _place(data, random)]


def _hole(data: bytes, random: np.random.Generator) -> bytes:
    at = _place(data, random)
    return data[:at] + data[at + int(random.integers(1, 200)) :]


def _flip(data: bytes, random: np.random.Generator) -> bytes:
    new = bytearray(data)
    for _ in range(int(random.integers(1, 8)) if data else 0):
        new[min(_place(data, random), len(data) - 1)] ^= 1 << int(random.integers(8))
    return bytes(new)


def _filled(data: bytes, random: np.random.Generator) -> bytes:
    at, size = _place(data, random), int(random.integers(1, 64))
    fill = bytes([int(random.choice([0, 255, 32, 10]))])
    return data[:at] + fill * min(size, len(data) - at) + data[at + size :]


def _repeated(data: bytes, random: np.random.Generator) -> bytes:
    at, size = _place(data, random), int(random.integers(1, 300))
    return data[: at + size] + data[at : at + size] * int(random.integers(1, 20)) + data[at + size :]


def _inserted(data: bytes, random: np.random.Generator) -> bytes:
    at = _place(data, random)
    return data[:at] + random.bytes(int(random.integers(1, 40))) + data[at:]


def _whole(data: bytes, random: np.random.Generator) -> bytes:
    """A whole number of a header that promises too much, or nothing."""
    at, size = _place(data, random), int(random.choice([1, 2, 4, 8]))
    value = WHOLE[int(random.integers(len(WHOLE)))] & ((1 << (8 * size)) - 1)
    order = "little" if random.random() < 0.8 else "big"
    return data[:at] + value.to_bytes(size, order)[: max(len(data) - at, 0)] + data[at + size :]


def _real(data: bytes, random: np.random.Generator) -> bytes:
    at, value = _place(data, random), REALS[int(random.integers(len(REALS)))]
    with np.errstate(over="ignore"):
        new = struct.pack("<d", value) if random.random() < 0.6 else np.float32(value).tobytes()
    return data[:at] + new[: max(len(data) - at, 0)] + data[at + len(new) :]


def _match(pattern: re.Pattern[bytes], data: bytes, random: np.random.Generator) -> re.Match[bytes] | None:
    return pattern.search(data, _place(data, random)) or pattern.search(data)


def _number(data: bytes, random: np.random.Generator) -> bytes:
    found = _match(NUMBER, data, random)
    new = NUMBERS[int(random.integers(len(NUMBERS)))]
    return data if found is None else data[: found.start()] + new + data[found.end() :]


def _same_size_number(data: bytes, random: np.random.Generator) -> bytes:
    """Text within a binary file keeps its length."""
    found = _match(NUMBER, data, random)
    if found is None:
        return data
    new = random.choice([b"9" * 40, b"0" * 40, b"-1".ljust(40), b"1e308".ljust(40)])
    return data[: found.start()] + bytes(new)[: found.end() - found.start()] + data[found.end() :]


def _word(data: bytes, random: np.random.Generator) -> bytes:
    """A word becomes another of the file."""
    found, other = _match(WORD, data, random), _match(WORD, data, random)
    if found is None or other is None:
        return data
    return data[: found.start()] + other[0] + data[found.end() :]


def _lines(change: Callable[[list[bytes], int, np.random.Generator], list[bytes]]) -> Callable[..., bytes]:
    def changed(data: bytes, random: np.random.Generator) -> bytes:
        lines = data.split(b"\n")
        return b"\n".join(change(lines, int(random.integers(min(len(lines), 60))), random))

    return changed


def _swapped(lines: list[bytes], at: int, random: np.random.Generator) -> list[bytes]:
    other = int(random.integers(len(lines)))
    lines[at], lines[other] = lines[other], lines[at]
    return lines


def _nested(data: bytes, random: np.random.Generator) -> bytes:
    found = _match(NUMBER, data, random)
    opened = [b"[", b'{"a":', b"{a=", b"[["][int(random.integers(4))]
    depth = int(random.choice([50, 5000, 200_000]))
    at = len(data) if found is None else found.start()
    closed = b"" if random.random() < 0.5 else {b"[": b"]", b"[[": b"]]"}.get(opened, b"}") * depth
    return data[:at] + opened * depth + b"1" + closed + data[at:]


def _other_separator(data: bytes, random: np.random.Generator) -> bytes:
    separator = [b";", b"\t", b" ", b"|", b",,"][int(random.integers(5))]
    return data.replace(b",", separator)


def _other_encoding(data: bytes, random: np.random.Generator) -> bytes:
    name = ["utf-16", "utf-32", "utf-8-sig", "cp500"][int(random.integers(4))]
    return data.decode("latin-1").encode(name, "replace")


ANY_WAYS = (_cut, _hole, _flip, _filled, _repeated, _inserted)
BINARY_WAYS = (*ANY_WAYS, _whole, _whole, _whole, _real, _real, _same_size_number, _number, _word)
TEXT_WAYS = (
    *ANY_WAYS,
    *(_number,) * 8,
    *(_word,) * 3,
    _nested,
    _other_separator,
    _other_encoding,
    _lines(lambda lines, at, _: [*lines[:at], *lines[at + 1 :]]),
    _lines(lambda lines, at, _: [*lines[: at + 1], *lines[at:]]),
    _lines(lambda lines, at, random: [*lines[:at], *lines[at : at + 1] * int(random.integers(2, 2000)), *lines[at:]]),
    _lines(_swapped),
)
