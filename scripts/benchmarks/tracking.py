# SPDX-License-Identifier: GPL-3.0-or-later
"""How quickly the block and the background are followed, against a template that is looked for in every whole frame.

And how much chance there is in a track: from other clicks, in clips that begin a little later, whose backgrounds are
made of other pictures.
"""

import argparse
import os
import time
from pathlib import Path

import cv2
import numpy as np
from rockfall.core.footage.background import background_motion, no_motion
from rockfall.core.footage.sources import Pictures, kept
from rockfall.core.footage.tracking import track_block
from rockfall.core.footage.video import open_video, read_frames

ROOT = Path(__file__).resolve().parents[2]
BALL = ROOT / "assets" / "examples" / "bouncing_ball" / "balle1-vp9.avi"
DEMO = ROOT / "assets" / "demo" / "footage"
FOUND_PX = 5.0
BEGINS, CLICKED = (0, 7, 14), (50, 60, 75, 100, 130, 160, 190, 220)
"""Of the demo's footage: frames at which clips begin, and that are clicked."""
SETTLED_FRAME, LAST_FRAME = 30, 230
"""Of the ball: out of the hand, not yet out of the picture."""


def naive(pictures: Pictures, frame: int, pixel: tuple[float, float], diameter_px: float) -> np.ndarray:
    """(f, 2) the best place of the clicked patch in every frame by normalised cross-correlation."""
    half = round(0.8 * diameter_px)
    u, v = (int(p) for p in pixel)
    top, left = max(v - half, 0), max(u - half, 0)
    patch = pictures.images[frame][top : v + half + 1, left : u + half + 1]
    offset = np.array([u - left + 0.5, v - top + 0.5])
    best = [cv2.minMaxLoc(cv2.matchTemplate(picture, patch, cv2.TM_CCOEFF_NORMED))[3] for picture in pictures.images]
    return np.array(best) + offset


def compare(
    name: str, pictures: Pictures, click: tuple[int, float, float], truth: np.ndarray, seen: np.ndarray, *, still: bool
) -> None:
    """Print times and how many of the frames `seen` are right, by the true places (f, 2)."""
    count = pictures.time_s.size
    print(f"{name}: {count} frames of {pictures.width} × {pictures.height}")
    start = time.perf_counter()
    motion, _ = background_motion(pictures)
    background_s = time.perf_counter() - start
    motion = no_motion(0, count - 1) if still else motion
    start = time.perf_counter()
    track = track_block(pictures, click[0], click[1:], background=motion)
    track_s = time.perf_counter() - start
    start = time.perf_counter()
    places = naive(pictures, click[0], click[1:], float(np.median(track.diameter_px)))
    naive_s = time.perf_counter() - start
    error = np.full(count, np.inf)
    error[track.frame] = np.hypot(*(track.pixel - truth[track.frame]).T)
    wrong = np.hypot(*(places - truth).T)
    for what, seconds, apart in (
        ("the background", background_s, None),
        ("the block", track_s, error),
        ("template in the whole frame", naive_s, wrong),
    ):
        share = "" if apart is None else f"{100 * np.mean(apart[seen] < FOUND_PX):>6.1f} % within {FOUND_PX:g} px"
        if apart is not None:
            share += f", median error {np.median(apart[seen]):.2f} px"
        print(f"  {what:<30}{count / seconds:>8.0f} frames/s  {share}", flush=True)
    print(f"  the block is followed {naive_s / track_s:.1f} times as quickly as the template is found")


def from_the_file(path: Path, click: tuple[int, float, float], truth: np.ndarray) -> None:
    """Print what it takes from the file to the track, decoding included, and how far the track is off."""
    wall, processor = time.perf_counter(), time.process_time()
    video = open_video(path)
    opened = time.perf_counter() - wall
    source = kept(video, 0, video.frames - 1)
    motion, _ = background_motion(source)
    followed = time.perf_counter() - wall
    track = track_block(source, click[0], click[1:], background=motion)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    apart = np.hypot(*(track.pixel - truth[track.frame]).T)
    print(f"From the file: {video.frames} frames of {video.width} × {video.height}, {track.frame.size} with the block")
    print(f"  timestamps {opened:.2f} s, background {followed - opened:.2f} s, block {wall - followed:.2f} s")
    print(
        f"  {video.frames / wall:.0f} frames/s, {processor:.1f} s of processor time, "
        f"median error {np.median(apart):.2f} px"
    )


def from_other_clicks(path: Path, truth: np.ndarray, visible: np.ndarray) -> None:
    """Print how far the tracks are off, how many frames they lack, and how many hold something else than the block."""
    video = open_video(path)
    off, missing, false = [], [], []
    for first in BEGINS:
        source = kept(video, first, video.frames - 1)
        motion, _ = background_motion(source, first=first)
        for frame in CLICKED:
            track = track_block(source, frame, truth[frame] + (1, -1), background=motion, first=first)
            apart = np.hypot(*(track.pixel - truth[track.frame]).T)
            off.append(np.median(apart))
            missing.append(np.setdiff1d(np.flatnonzero(visible), track.frame).size)
            false.append(int(((apart > FOUND_PX) | ~visible[track.frame]).sum()))
    print(
        f"From {len(off)} clicks: median error {min(off):.2f} to {max(off):.2f} px, mean {np.mean(off):.2f}; "
        f"{min(missing)} to {max(missing)} of {visible.sum()} frames missing; {sum(false)} frames with something else"
    )


def main() -> None:
    """Print the rates."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(f"({os.process_cpu_count()} cores, load {os.getloadavg()[0]:.1f}; frames decoded beforehand)")
    ball = Pictures([picture for _, picture in read_frames(open_video(BALL))], np.arange(295) / 187.35)
    table = np.genfromtxt(BALL.with_name("balle1_redball_track_px.csv"), delimiter=",", skip_header=1)
    hand = np.full((295, 2), np.nan)
    known = table[:, 0] < 295
    hand[table[known, 0].astype(int)] = table[known, 1:3] + 0.5
    seen = np.isfinite(hand[:, 0]) & (np.arange(295) >= SETTLED_FRAME) & (np.arange(295) < LAST_FRAME)
    compare("Filmed ball", ball, (60, 147.0, 48.0), hand, seen, still=True)

    if (DEMO / "footage.mp4").exists():
        video = open_video(DEMO / "footage.mp4")
        demo = Pictures([picture for _, picture in read_frames(video)], video.time_s)
        block = np.genfromtxt(DEMO / "truth" / "block.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
        click = np.genfromtxt(DEMO / "clicks.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
        first = np.atleast_1d(click)[0]
        truth = np.full((video.time_s.size, 2), np.nan)
        truth[block["frame"]] = np.column_stack([block["u_px"], block["v_px"]])
        seen = np.isfinite(truth[:, 0])
        from_the_file(DEMO / "footage.mp4", (int(first["frame"]), first["u_px"], first["v_px"]), truth)
        visible = np.zeros(video.time_s.size, bool)
        visible[block["frame"]] = block["visible"] > 0
        from_other_clicks(DEMO / "footage.mp4", truth, visible)
        compare("Demo footage", demo, (int(first["frame"]), first["u_px"], first["v_px"]), truth, seen, still=False)


if __name__ == "__main__":
    main()
