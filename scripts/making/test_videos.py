# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the tiny videos of tests/data/videos, and times.json with the timestamps that PyAV reads in them.

Each picture shows the number of its frame in Gray code, as eight bars from left (lowest bit) to right. Needs PyAV with
libx264, libvpx-vp9 and mpeg4 (pip install av), in an environment of its own: it brings another FFmpeg than OpenCV's.
"""

import argparse
import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

WIDTH, HEIGHT = 64, 48
FOLDER = Path(__file__).parents[2] / "tests" / "data" / "videos"
MILLISECOND, FINE = Fraction(1, 1000), Fraction(1, 90_000)
DARK, BRIGHT = 50, 205
H264 = {"crf": "26"}


def picture(number: int) -> av.VideoFrame:
    """A picture that tells its number."""
    code = number ^ (number >> 1)
    bars = np.where((code >> np.arange(8)) & 1, BRIGHT, DARK).astype(np.uint8)
    row = np.repeat(bars, WIDTH // 8)
    image = np.broadcast_to(row[None, :, None], (HEIGHT, WIDTH, 3))
    return av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")


def make(name, codec, times, base, *, rate=30, pixels="yuv420p", numbers=None, options=None, stamps=None) -> None:
    """Write a video of frames at `times` [s], whole multiples of `base`; `stamps` replace them in the container."""
    with av.open(str(FOLDER / name), "w", options={"fflags": "+bitexact"}) as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pixels
        stream.codec_context.time_base = stream.time_base = base
        packets = []
        for number, time in zip(numbers or range(len(times)), times, strict=True):
            frame = picture(number)
            frame.pts, frame.time_base = round(time / base), base
            packets += stream.encode(frame)
        packets += stream.encode()
        for i, packet in enumerate(packets):
            if stamps:
                packet.pts = packet.dts = round(stamps[i] / base)
            container.mux(packet)


def two_streams(name: str) -> None:
    """Write a small stream of 10 pictures a second before one of the usual size and 30: both show their numbers."""
    with av.open(str(FOLDER / name), "w", options={"fflags": "+bitexact"}) as container:
        streams = []
        for rate, size in ((10, (WIDTH // 2, HEIGHT // 2)), (30, (WIDTH, HEIGHT))):
            stream = container.add_stream("libx264", rate=rate, options=H264 | {"bf": "0", "g": "12"})
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            streams.append((stream, rate, size))
        for stream, rate, (width, height) in streams:
            for number in range(rate):
                frame = picture(number).reformat(width, height)
                frame.pts, frame.time_base = number, Fraction(1, rate)
                for packet in stream.encode(frame):
                    container.mux(packet)
            for packet in stream.encode():
                container.mux(packet)


def disc(number: int, rng: np.random.Generator, ground: np.ndarray) -> av.VideoFrame:
    """A disc on its way over noisy ground, as it is at a number."""
    v, u = np.mgrid[: ground.shape[0], : ground.shape[1]]
    image = np.where(np.hypot(u - 12 - 3 * number, v - 20 - number) < 5, 215.0, ground)
    image = np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
    return av.VideoFrame.from_ndarray(np.repeat(image[:, :, None], 3, axis=2), format="rgb24")


def repeated(name: str, each: int, quality: int) -> None:
    """Write 40 frames of which each picture is stored so many times."""
    rng = np.random.default_rng(7)
    ground = np.kron(110 + 18 * rng.normal(size=(24, 40)), np.ones((4, 4)))
    with av.open(str(FOLDER / name), "w", options={"fflags": "+bitexact"}) as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": str(quality)})
        stream.height, stream.width = ground.shape
        stream.pix_fmt = "yuv420p"
        taken = [disc(number, rng, ground).to_ndarray(format="rgb24") for number in range(40 // each)]
        for number in range(40):
            frame = av.VideoFrame.from_ndarray(taken[number // each], format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 30)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)


def sound(name: str) -> None:
    with av.open(str(FOLDER / name), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate, frame.pts = 8000, 0
        for packet in (*stream.encode(frame), *stream.encode()):
            container.mux(packet)


def turn(name: str) -> None:
    """Write the flag "turn by 90° clockwise" into the track header (ISO/IEC 14496-12, 8.3.2)."""
    data = (FOLDER / name).read_bytes()
    place = data.index(b"tkhd") + 44
    words = [0, 1 << 16, 0, -1 << 16, 0, 0, HEIGHT << 16, 0, 1 << 30]
    matrix = b"".join(word.to_bytes(4, "big", signed=True) for word in words)
    (FOLDER / name).write_bytes(data[:place] + matrix + data[place + 36 :])


def shorten(name: str, whole: str, part: float) -> None:
    data = (FOLDER / whole).read_bytes()
    (FOLDER / name).write_bytes(data[: int(part * len(data))])


def pyav_times(name: str) -> dict[str, object]:
    """Timestamps of all frames as PyAV decodes them, and the start of the stream [s]."""
    with av.open(str(FOLDER / name)) as container:
        stream = container.streams.video[0]
        times = []
        try:
            for frame in container.decode(stream):
                times.append(round(float(frame.pts * stream.time_base), 9))
        except av.error.InvalidDataError:
            pass
        return {"start_s": round(float((stream.start_time or 0) * stream.time_base), 9), "time_s": times}


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    even = [Fraction(i, 30) for i in range(40)]
    television = [Fraction(1001 * i, 30_000) for i in range(40)]
    lost = (10, 11, 30)
    uneven = [0.5 + i / 30 + rng.uniform(0, 0.008) for i in range(70) if i not in lost]
    slower = list(np.cumsum(np.where(np.arange(150) < 75, 1 / 60, 1 / 15) + rng.uniform(0, 0.004, 150)))
    make("constant.mp4", "libx264", even, FINE, options=H264 | {"bf": "0", "g": "12"})
    make("rotated.mov", "libx264", television, Fraction(1001, 30_000), rate=Fraction(30_000, 1001), options=H264)
    turn("rotated.mov")
    make("variable.mp4", "libx264", uneven, FINE, options=H264 | {"bf": "3", "g": "12"})
    make("variable.mkv", "libx264", uneven, MILLISECOND, options=H264 | {"bf": "2", "g": "12"})
    reordered = H264 | {"bf": "4", "g": "25", "x264-params": "open-gop=1"}
    make("slower.mp4", "libx264", slower, FINE, options=reordered)
    make("open_groups.ts", "libx264", [Fraction(i, 30) for i in range(80)], FINE, options=reordered)
    make("vp9.webm", "libvpx-vp9", even, MILLISECOND, options={"g": "12", "crf": "40", "b": "0"})
    numbers = [i - (i > 11) for i in range(24)]
    make(
        "repeated.avi",
        "mjpeg",
        even[:24],
        Fraction(1, 30),
        pixels="yuvj420p",
        numbers=numbers,
        options={"qmin": "31", "qmax": "31"},
    )
    make("bframes.avi", "mpeg4", even, Fraction(1, 30), options={"bf": "2", "g": "12"})
    doubled = [Fraction(i - (i == 7), 25) for i in range(20)]
    still = [Fraction(i, 25) for i in range(20)]
    make("doubled.mkv", "libx264", still, MILLISECOND, rate=25, options=H264 | {"bf": "0"}, stamps=doubled)
    make("single.mp4", "libx264", even[:1], FINE, options=H264)
    make("no_times.h264", "libx264", even[:12], Fraction(1, 30), options=H264 | {"bf": "0"})
    make("interlaced.mp4", "libx264", even[:12], FINE, options=H264 | {"flags": "+ildct+ilme"})
    make("ten_bits.mp4", "libx264", even[:12], FINE, pixels="yuv420p10le", options=H264 | {"bf": "0"})
    make("full_range.mp4", "libx264", even[:12], FINE, pixels="yuvj420p", options=H264 | {"bf": "0"})
    two_streams("two_streams.mp4")
    repeated("halves_crf20.mp4", 2, 20)
    repeated("halves_crf34.mp4", 2, 34)
    repeated("none_crf34.mp4", 1, 34)
    sound("sound.mp4")
    shorten("cut.mp4", "constant.mp4", 0.6)
    shorten("cut.mkv", "variable.mkv", 0.6)
    shorten("cut.avi", "repeated.avi", 0.6)
    strange = (FOLDER / "single.mp4").read_bytes().replace(b"avc1", b"xyz1")
    (FOLDER / "strange.mp4").write_bytes(strange)
    names = ["constant.mp4", "rotated.mov", "variable.mp4", "variable.mkv", "slower.mp4", "open_groups.ts", "vp9.webm"]
    names += ["repeated.avi", "bframes.avi", "doubled.mkv", "single.mp4", "cut.mkv", "cut.avi"]
    (FOLDER / "times.json").write_text(json.dumps({name: pyav_times(name) for name in names}) + "\n")


if __name__ == "__main__":
    main()
