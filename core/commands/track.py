# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall track``: the block followed through a video from one click → track.csv, events.csv, track.png."""

import argparse
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .options import add_fps, add_out, naming, positive, whole
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..exchange.footage_tables import EventTable, Track
    from ..footage.background import BackgroundMotion
    from ..footage.kinks import Kinks
    from ..footage.tracking import BlockTrack
    from ..footage.video import Video
    from ..vectors import Names
    from ..workflow.tracking import Click


def click(text: str) -> "Click":
    """FRAME,U,V."""
    try:
        frame, u, v = text.split(",")
        return whole(frame.strip()), float(u), float(v)
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(f"{text} is not FRAME,U,V") from None


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "video", metavar="VIDEO", help="video file, or a folder of numbered pictures, or their name, img_%%04d.png"
    )
    add_fps(parser)
    parser.add_argument(
        "--click",
        type=click,
        action="append",
        default=[],
        metavar="FRAME,U,V",
        help="frame, and pixel on the block, from the top left corner; again to bring the track back to the block",
    )
    parser.add_argument("--clicks", metavar="FILE", help="clicks.csv with frame, u_px, v_px and perhaps trajectory")
    parser.add_argument("--trajectory", metavar="NAME", help="name of the block's run, as in picks.csv")
    parser.add_argument("--from", dest="first", type=whole, metavar="FRAME", help="first frame to look at")
    parser.add_argument("--to", dest="last", type=whole, metavar="FRAME", help="last frame to look at")
    parser.add_argument(
        "--diameter-px", type=positive, metavar="D", help="of the block [px] (default: measured at the click)"
    )
    parser.add_argument("--still", action="store_true", help="the camera stands on a tripod (default: found out)")
    parser.add_argument(
        "--capture-rate",
        type=positive,
        metavar="HZ",
        help="pictures a second that the camera took; frames are then taken as evenly spaced",
    )
    add_out(parser)


def run(arguments: argparse.Namespace) -> int:
    """Track, write the tables and the picture, print the summary."""
    from ..exchange.footage_tables import write_events, write_track
    from ..footage.kinks import find_kinks
    from ..footage.pictures import draw_track
    from ..footage.video import open_video
    from ..opencv import write_picture
    from ..output import output_folder
    from ..workflow.tracking import follow_block

    clicks, name = _clicks(arguments)
    with PrintedProgress() as progress, naming(arguments.video):
        video = open_video(arguments.video, progress, rate_hz=arguments.fps)
        first = arguments.first or 0
        last = video.frames - 1 if arguments.last is None else arguments.last
        _check(video, clicks, first, last)
        track, motion, said = follow_block(
            video,
            clicks,
            first,
            last,
            still=arguments.still,
            diameter_px=arguments.diameter_px,
            progress=progress,
        )
        time_s = track.time_s if arguments.capture_rate is None else track.frame / arguments.capture_rate
        kinks = find_kinks(time_s, track.stable, track.sigma_px)
        events = _events(video, motion, track, kinks, name, arguments.capture_rate)
        with output_folder(arguments.out) as folder:
            write_track(_table(track, name), folder / "track.csv")
            write_events(events, folder / "events.csv")
            progress("Drawing the picture")
            labels = [f"{time:.3f} s" for time in kinks.time_s]
            picture = draw_track(video, track, motion, kinks, labels, clicks[0][0])
            write_picture(folder / "track.png", picture)
    _print_summary(arguments, track, motion, kinks, events)
    for sentence in (said, *_of_file(video, arguments.capture_rate)):
        if sentence:
            print(sentence)
    return 0


def _of_file(video: "Video", capture_rate_hz: float | None) -> list[str]:
    """What the file says of itself that a track rests on."""
    from ..footage.advice import capture_rate_sentence
    from ..footage.file_facts import chapters_remark, streams_remark

    how = "If so, give --capture-rate, and capture_rate_hz in the project."
    named = "" if capture_rate_hz else capture_rate_sentence(video.facts, video.rate_hz, how)
    return [streams_remark(video.facts), chapters_remark(video.path), named]


def _clicks(arguments: argparse.Namespace) -> "tuple[list[Click], str]":
    """Clicks of one trajectory, and its name.

    Raises
    ------
    InputError : no click, clicks on more than one trajectory.
    """
    from ..exchange.footage_tables import read_clicks

    clicks: list[Click] = list(arguments.click)
    names = {arguments.trajectory} if arguments.trajectory is not None else set()
    if arguments.clicks:
        table = read_clicks(arguments.clicks)
        chosen = np.ones(len(table), dtype=np.bool_)
        if arguments.trajectory is not None:
            chosen = (table.trajectory == arguments.trajectory) | (table.trajectory == "")
        names |= set(table.trajectory[chosen].tolist()) - {""}
        if len(names) > 1:
            raise InputError(
                f"There are clicks on the trajectories {', '.join(sorted(names))}",
                file=arguments.clicks,
                advice="One is tracked at a time: choose it with --trajectory",
            )
        pixels = table.pixel[chosen].tolist()
        clicks += [(int(f), u, v) for f, (u, v) in zip(table.frame[chosen], pixels, strict=True)]
    if not clicks:
        raise InputError(
            "There is no click on the block",
            file=arguments.clicks or arguments.video,
            trajectory=arguments.trajectory,
            advice="Give --click FRAME,U,V or --clicks FILE"
            + (_named_in(table.trajectory) if arguments.clicks else ""),
        )
    return sorted(clicks), next(iter(names), "")


def _named_in(trajectories: "Names") -> str:
    """Which trajectories a table has clicks on, to be added to an advice."""
    names = sorted({name for name in trajectories.tolist() if name})
    return f"; the table has clicks on {', '.join(names[:8])}" if names else ""


def _check(video: "Video", clicks: "list[Click]", first: int, last: int) -> None:
    """Before the work begins.

    Raises
    ------
    InputError : frames or pixels that are not in the video, no click within the frames.
    """
    for frame in (first, last, *(click[0] for click in clicks)):
        if not 0 <= frame < video.frames:
            raise InputError(
                f"There is no frame {frame}: the video has the frames 0 to {video.frames - 1}", file=video.path
            )
    if first > last:
        raise InputError(
            f"The first frame, {first}, comes after the last, {last}",
            file=video.path,
            advice="Exchange --from and --to",
        )
    for frame, u, v in clicks:
        if not (0 <= u <= video.width and 0 <= v <= video.height):
            raise InputError(
                f"The click at ({u:g}, {v:g}) in frame {frame} is outside the picture",
                file=video.path,
                advice=f"The picture has {video.width} × {video.height} pixels, counted from the top left corner",
            )
        if not first <= frame <= last:
            raise InputError(
                f"The click in frame {frame} is outside the frames {first} to {last}",
                file=video.path,
                advice="Change --from or --to",
            )


def _table(track: "BlockTrack", name: str) -> "Track":
    from ..exchange.footage_tables import Track

    return Track(
        trajectory=np.full(track.frame.size, name),
        frame=track.frame,
        time_s=track.time_s,
        pixel=track.pixel.round(3),
        sigma_px=track.sigma_px.round(3),
        score=track.score.round(3),
        row=np.zeros(track.frame.size, dtype=np.intp),
    )


def _events(
    video: "Video",
    motion: "BackgroundMotion",
    track: "BlockTrack",
    kinks: "Kinks",
    name: str,
    capture_rate_hz: float | None,
) -> "EventTable":
    """Proposed impacts at video times, their pixels in the nearest frame."""
    from ..exchange.footage_tables import EventTable
    from ..footage.advice import with_repeats
    from ..footage.background import destabilise

    number = np.arange(video.frames, dtype=np.float64)
    if capture_rate_hz is None:
        time, sigma, place = kinks.time_s, kinks.sigma_time_s, np.interp(kinks.time_s, video.time_s, number)
    else:
        place = kinks.time_s * capture_rate_hz
        time = np.interp(place, number, video.time_s)
        sigma = kinks.sigma_time_s * capture_rate_hz * video.usual_step_s
    sigma = with_repeats(sigma, time, video, track.repeated)
    frame = np.clip(np.round(place).astype(np.intp), motion.frames[0], motion.frames[-1])
    return EventTable(
        trajectory=np.full(len(kinks), name),
        frame=frame,
        time_s=time.round(6),
        pixel=destabilise(motion, frame, kinks.pixel).round(3),
        sigma_time_s=sigma.round(6),
        kind=np.full(len(kinks), "impact"),
        row=np.zeros(len(kinks), dtype=np.intp),
        extra={"score": np.array([f"{score:.1f}" for score in kinks.score], dtype=np.str_)},
    )


def _print_summary(
    arguments: argparse.Namespace,
    track: "BlockTrack",
    motion: "BackgroundMotion",
    kinks: "Kinks",
    events: "EventTable",
) -> None:
    first, last = int(track.frame[0]), int(track.frame[-1])
    twice = np.setdiff1d(track.repeated[(track.repeated > first) & (track.repeated < last)], track.frame).size
    gaps = last - first + 1 - track.frame.size - twice
    hidden = f", not seen in {gaps} between" if gaps else ""
    hidden += f"; {twice} that repeat the one before are left out" if twice else ""
    print(f"The block is followed through {track.frame.size} frames, {first} to {last}{hidden}.")
    print(f"  before: {track.stopped[0]}. After: {track.stopped[1]}.")
    size, sigma = np.median(track.diameter_px), np.median(track.sigma_px)
    print(f"  {size:.0f} px across; centre to ± {sigma:.2f} px (median; {track.sigma_px.max():.2f} px at most)")
    if motion.still:
        print("The camera stands still.")
    else:
        print(
            f"The camera moves: {np.median(motion.inliers):.0f} corners of the background (median, "
            f"{motion.inliers.min()} at least), residual {motion.rms_px.max():.2f} px at most."
        )
    clock = "" if arguments.capture_rate is None else f" at {arguments.capture_rate:g} pictures a second"
    print(f"{len(kinks)} impacts are proposed{clock}{':' if len(kinks) else '.'}")
    for i in range(len(kinks)):
        u, v = events.pixel[i]
        speed = kinks.time_s[i] / events.time_s[i] if arguments.capture_rate and events.time_s[i] else 1.0
        print(
            f"  {kinks.time_s[i]:9.4f} s ± {1000 * speed * events.sigma_time_s[i]:.1f} ms  frame {events.frame[i]}  "
            f"({u:.1f}, {v:.1f})  velocity changes by {kinks.score[i]:.0f} sigmas"
        )
    print(f"Written to {arguments.out}: track.csv, events.csv, track.png")
