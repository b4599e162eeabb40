# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick footage is: the timestamps of a video beside decoding it, single frames beside reading up to them.

Without a file, a 1080p film is made with OpenCV's own writer: MPEG-4 Part 2, or H.264 where OpenCV can write it.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rockfall.core.footage.video import Video, open_video, read_frame, read_frames

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


def synthetic(path: Path, frames: int) -> None:
    """A rough slope that the camera pans across, with grain."""
    import cv2

    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    rng = np.random.default_rng(0)
    slope = cv2.resize(rng.integers(0, 255, (1080 // 6, 2600 // 6, 3), np.uint8), (2600, 1080))
    grain = rng.integers(0, 12, (1080, 1920, 3), np.uint8)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"avc1"), 60, (1920, 1080))
    if not writer.isOpened():
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 60, (1920, 1080))
    for i in range(frames):
        writer.write(cv2.add(slope[:, i % 600 : i % 600 + 1920], np.roll(grain, 17 * i, axis=1)))
    writer.release()


def seconds(*functions: Callable[[], object], repeats: int = 3) -> list[float]:
    """The quickest of a few runs of each, in turns so that other work on the machine meets all of them."""
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(repeats):
        for function, own in zip(functions, times, strict=True):
            start = time.perf_counter()
            function()
            own.append(time.perf_counter() - start)
    return [min(own) for own in times]


def row(what: str, value: str, note: str = "") -> None:
    print(f"{what:<44}{value:>16}  {note}")


def decode_all(path: Path) -> int:
    import cv2

    capture, frames = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), 0
    while capture.grab():
        capture.get(cv2.CAP_PROP_POS_MSEC)
        frames += 1
    return frames


def drain(video: Video, grey: bool) -> None:
    for _ in read_frames(video, grey=grey):
        pass


def read_up_to(video: Video, index: int) -> None:
    import cv2

    capture = cv2.VideoCapture(str(video.path), cv2.CAP_FFMPEG)
    for _ in range(index + 1):
        capture.grab()
    capture.retrieve()


def benchmark(path: Path) -> None:
    video = open_video(path)
    row(
        "film",
        f"{video.frames} frames",
        f"{video.width} × {video.height}, {video.codec}, {video.keyframe_s.size} keyframes",
    )
    every, opened, thorough = seconds(
        lambda: decode_all(path), lambda: open_video(path), lambda: open_video(path, thorough=True)
    )
    row("decoding every frame for its time", f"{every:.2f} s", f"{video.frames / every:.0f} frames/s")
    row("open_video", f"{opened:.2f} s", f"{every / opened:.1f} times as quick; decoded all: {video.decoded}")
    row("open_video, thorough", f"{thorough:.2f} s", f"{thorough / every:.2f} of decoding")
    for grey in (False, True):
        [took] = seconds(lambda grey=grey: drain(video, grey), repeats=1)
        row(f"read_frames, {'grey' if grey else 'colour'}", f"{video.frames / took:.0f} frames/s")
    places = [int(part * (video.frames - 1)) for part in (0.1, 0.5, 0.9)]
    for index in places:
        alone, up_to = seconds(lambda i=index: read_frame(video, i), lambda i=index: read_up_to(video, i))
        row(f"frame {index} alone", f"{1000 * alone:.0f} ms", f"{up_to / alone:.1f} times as quick as reading up to it")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("video", nargs="*", type=Path, help="films to measure (default: a synthetic one)")
    parser.add_argument("--frames", type=int, default=600, help="of the synthetic film")
    arguments = parser.parse_args()
    for path in arguments.video:
        benchmark(path)
    if not arguments.video:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "film.mp4"
            synthetic(path, arguments.frames)
            benchmark(path)


if __name__ == "__main__":
    main()
