# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall inspect``: what a video file really contains, with advice → frames.csv."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..output import write_text
from .options import add_fps, positive
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..footage.video import Video

FEW_GAPS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "video",
        metavar="VIDEO",
        help="MP4, MOV, MKV, WebM, AVI, … as the camera wrote it; or a folder of numbered pictures, or their name, as "
        "img_%%04d.png",
    )
    add_fps(parser)
    parser.add_argument(
        "--capture-rate",
        type=positive,
        metavar="HZ",
        help="frames per second at which the camera took them, for slow motion (default: the rate of the file)",
    )
    parser.add_argument("--diameter", type=positive, metavar="M", help="of the block [m], for advice on its rotation")
    speed = parser.add_mutually_exclusive_group()
    speed.add_argument("--speed", type=positive, metavar="MPS", help="highest speed of the block [m/s]")
    speed.add_argument("--picks", metavar="FILE", help="picks.csv that tell the highest speed instead of --speed")
    parser.add_argument("--out", metavar="DIR", help="folder for frames.csv (default: nothing is written)")


def run(arguments: argparse.Namespace) -> int:
    """Decode all frames, print what there is, and write their times where asked to."""
    from ..footage.advice import capture_rate_sentence, content_advice, rate_advice
    from ..footage.video import open_video
    from ..output import output_folder

    speed = _fastest(arguments.picks) if arguments.picks else arguments.speed
    with PrintedProgress() as progress:
        video = open_video(arguments.video, progress, thorough=True, rate_hz=arguments.fps)
    how = "If so, give --capture-rate here and in track, and capture_rate_hz in the project."
    named = "" if arguments.capture_rate else capture_rate_sentence(video.facts, video.rate_hz, how)
    advice = (
        content_advice(video)
        + ([named] if named else [])
        + rate_advice(
            video,
            capture_rate_hz=arguments.capture_rate,
            speed_mps=speed,
            radius_m=arguments.diameter / 2 if arguments.diameter else None,
        )
    )
    if arguments.out:
        with output_folder(arguments.out) as folder:
            _write_frames(video, folder / "frames.csv")
    for name, value in _contents(video, arguments.capture_rate):
        print(f"{name:<10} {value}")
    print()
    for sentence in advice:
        print(sentence)
    if arguments.out:
        print(f"Written: frames.csv in {arguments.out}")
    return 0


def _contents(video: "Video", capture_rate_hz: float | None) -> list[tuple[str, str]]:
    """Names and values for the sheet."""
    turned = f", shown turned by {video.rotation_deg}° clockwise" if video.rotation_deg else ""
    rows = [
        ("file", str(video.path)),
        ("picture", f"{video.width} × {video.height} px{turned}"),
        ("codec", f"{video.codec} in {video.container}"),
        ("frames", f"{video.frames} pictures, {_names(video)}")
        if video.pictures
        else ("frames", f"{video.frames} can be decoded, {video.header_frames or 'no number'} announced"),
    ]
    if video.facts.timecode:
        rows.append(("timecode", f"{video.facts.timecode} at the first picture; times here count from it"))
    if video.frames > 1:
        rows += _timing(video, capture_rate_hz)
    return rows


def _names(video: "Video") -> str:
    return f"{video.pictures[0].name} to {video.pictures[-1].name}"


def _timing(video: "Video", capture_rate_hz: float | None) -> list[tuple[str, str]]:
    step = video.step_s[video.step_s > 0]
    slowest, usual, quickest = 1 / step.max(), 1 / np.median(step), 1 / step.min()
    kind = "variable" if video.is_variable else "constant"
    rounded = ", times rounded to milliseconds" if video.resolution_s else ""
    announced = f"{video.header_rate_hz:.6g}" if np.isfinite(video.header_rate_hz) else "none"
    rows = [
        (
            "rate",
            f"{video.rate_hz:.6g} frames a second, {kind} (lowest {slowest:.4g}, median {usual:.4g}, "
            f"highest {quickest:.4g}{rounded}); announced {announced}",
        ),
        ("duration", f"{video.duration_s:.3f} s, frames from {video.time_s[0]:.3f} to {video.time_s[-1]:.3f} s"),
    ]
    gaps = [
        f"{lost} missing after frame {frame} at {video.time_s[frame]:.3f} s"
        for frame, lost in zip(video.gaps[:FEW_GAPS], video.missing, strict=False)
    ]
    further = video.gaps.size - FEW_GAPS
    more = [f"and {further} more {'gap' if further == 1 else 'gaps'}"] if further > 0 else []
    rows.append(("gaps", "; ".join(gaps + more) or "none"))
    if capture_rate_hz:
        from ..footage.clock import clock_for

        clock = clock_for(video, capture_rate_hz)
        slower = f"{1 / clock.rate:.4g} times slower than life" if clock.rate < 1 else f"{clock.rate:.4g} times life"
        rows.append(("motion", f"{slower}: the {video.duration_s:.3f} s took {clock.rate * video.duration_s:.3f} s"))
    return rows


def _fastest(picks_file: str) -> float:
    """Highest mean speed between two picks of a trajectory [m/s].

    Raises
    ------
    InputError : a table that cannot be read, or without two picks of one trajectory.
    """
    from ..exchange.tables import read_picks

    picks = read_picks(picks_file)
    together = picks.trajectory[1:] == picks.trajectory[:-1]
    if not together.any():
        raise InputError("No trajectory has two picks, so there is no speed", file=picks_file, advice="Use --speed")
    way = np.linalg.norm(np.diff(picks.position, axis=0), axis=1)[together]
    return float((way / np.diff(picks.time_s)[together]).max())


def _write_frames(video: "Video", path: Path) -> None:
    """frames.csv: ``frame,time_s,step_s``, the step from the frame before."""
    steps = ["", *(f"{step:.6f}" for step in video.step_s)]
    lines = [f"{i},{time:.6f},{step}" for i, (time, step) in enumerate(zip(video.time_s, steps, strict=True))]
    write_text(path, "\n".join(["frame,time_s,step_s", *lines, ""]))
