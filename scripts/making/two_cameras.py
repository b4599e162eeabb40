# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of assets/examples/two_cameras from the arrays of tt_tracker (github ckjellson/tt_tracker, data/outside).

Bounces are picked from camera 1 alone: the kinks of its track, and where the rays through them meet the plane that the
ball's centre is in when it touches the table.
"""

import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from rockfall.core.camera.model import Camera, rays
from rockfall.core.camera.resection.resect import resect
from rockfall.core.exchange.footage_tables import Track, write_track
from rockfall.core.exchange.tables import write_columns, write_picks
from rockfall.core.footage.kinks import find_kinks
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.vectors import Array

EXAMPLE = Path(__file__).parents[2] / "assets" / "examples" / "two_cameras"
RATE_HZ, WIDTH, HEIGHT = 30.0, 1280, 720
LENGTH_M, BREADTH_M, RADIUS_M = 2.74, 1.525, 0.02
NAMES = ("left far", "right far", "right near", "left near", "net near", "net far")
POINTS = np.array(
    [(0, 1.525, 0), (2.74, 1.525, 0), (2.74, 0, 0), (0, 0, 0), (1.37, -0.1525, 0.1525), (1.37, 1.6775, 0.1525)]
)
ORDERS = (0, 1, 2, 3, 4, 5), (2, 3, 0, 1, 5, 4)
"""Which of the points those of each camera are; camera 2 stands on the other side."""
MISSING = 0, 719
SIGMA_PX, SIGMA_PAIR_PX = 1.0, 2.0
SIGMA_END_S = 1e-3
"""The ends of a trajectory are cuts, at times of our choice."""

SLIP = 900
"""Frame of camera 2 from which on it is one frame late: between 760 and 990 one was doubled, or camera 1 lost one."""

FASTEST_PX, LONGEST_GAP = 60.0, 4
"""Of the ball from frame to frame, and of frames in which it is not seen."""
FEWEST = 6
"""Sightings of a path, and of a flight on either side of a bounce."""
SMOOTH_PX, NEIGHBOURS = 10.0, ((1, 2), (2, 4))
"""A sighting that is further from the lines and parabolas through those before and those after is another thing's:
degrees and numbers of sightings."""
NEAR_STROKE_S = 1.2 / RATE_HZ
"""Sightings as near to a stroke are left out: which side of it they are on is not sure."""
NEAR_END_M = 0.02
"""A bounce is at least so far from the edges of the table."""


@dataclass(frozen=True)
class Run:
    """The ball between two strokes: frames of camera 1 from `first` to `last`, times [s] and pixels of its bounces."""

    first: int
    last: int
    time_s: Array
    sigma_s: Array
    pixel: Array


def sightings(path: Array) -> tuple[Array, Array]:
    """Frames (m,) and pixels (m, 2) of camera 1 or 2.

    tt_tracker cuts the fractions off the centres of its blobs and counts rows from the bottom: on average the centre is
    half a pixel beyond the number and, the first pixel's centre being at 0.5, one beyond it from the corner.
    """
    seen = np.flatnonzero((path[:, :2] != MISSING).any(axis=1))
    return seen, np.stack([path[seen, 0] + 1.0, HEIGHT - path[seen, 1]], axis=1)


def linked(frame: Array, pixel: Array) -> list[Array]:
    """Indices of paths that one moving thing can have taken, those of the ball being the long ones."""
    came, length = np.full(frame.size, -1), np.ones(frame.size, dtype=np.intp)
    for i in range(frame.size):
        earlier = np.flatnonzero((frame < frame[i]) & (frame >= frame[i] - LONGEST_GAP))
        gap = frame[i] - frame[earlier]
        near = earlier[np.hypot(*(pixel[i] - pixel[earlier]).T) < FASTEST_PX * gap]
        if near.size:
            came[i] = near[np.argmax(length[near] * 100 + near - i)]
            length[i] = length[came[i]] + 1
    taken = np.zeros(frame.size, dtype=np.bool_)
    paths = []
    for end in np.argsort(-length, kind="stable"):
        path, i = [], int(end)
        while i >= 0 and not taken[i]:
            path.append(i)
            i = int(came[i])
        taken[path] = True
        if len(path) >= FEWEST:
            paths.append(np.array(path[::-1]))
    smooth = [path[without_strays(frame[path], pixel[path])] for path in paths]
    return sorted((path for path in smooth if path.size >= FEWEST), key=lambda path: int(path[0]))


def without_strays(frame: Array, pixel: Array) -> Array:
    """Indices of the sightings that continue the motion before or after them."""
    kept = np.arange(frame.size)
    while kept.size > FEWEST:
        off = np.full(kept.size, np.inf)
        for i in range(kept.size):
            for degree, number in NEIGHBOURS:
                for others in (np.arange(i - number, i), np.arange(i + 1, i + 1 + number)):
                    if others[0] < 0 or others[-1] >= kept.size:
                        continue
                    time = frame[kept[others]] - frame[kept[i]]
                    here = np.polynomial.polynomial.polyfit(time, pixel[kept[others]], degree)[0]
                    off[i] = min(off[i], np.hypot(*(pixel[kept[i]] - here)))
        if off.max() < SMOOTH_PX:
            break
        kept = np.delete(kept, np.argmax(off))
    return kept


def runs_of(frame: Array, pixel: Array) -> list[Run]:
    """The runs in one path of camera 1: strokes turn the ball's direction along the table, bounces keep it."""
    time = frame / RATE_HZ
    kinks = find_kinks(time, pixel, np.full(frame.size, SIGMA_PX))
    before, after = kinks.velocity_before, kinks.velocity_after
    stroke = before[:, 0] * after[:, 0] < 0
    bounce = ~stroke & (before[:, 1] > 0) & (after[:, 1] < before[:, 1] - 60)
    cuts = np.r_[-np.inf, kinks.time_s[~bounce], np.inf]
    runs = []
    for start, end in pairwise(cuts):
        mine = np.flatnonzero((time > start + NEAR_STROKE_S) & (time < end - NEAR_STROKE_S))
        here = np.flatnonzero(bounce & (kinks.time_s > start) & (kinks.time_s < end))
        if not here.size or not mine.size:
            continue
        parts = np.searchsorted(kinks.time_s[here], time[mine])
        if np.bincount(parts, minlength=here.size + 1).min() >= 3 and mine.size >= 2 * FEWEST:
            run = Run(
                int(frame[mine[0]]),
                int(frame[mine[-1]]),
                kinks.time_s[here],
                kinks.sigma_time_s[here],
                kinks.pixel[here],
            )
            runs.append(run)
    return runs


def at_height(camera: Camera, pixel: Array, height_m: float) -> Array:
    """(n, 3) where rays meet a level plane."""
    origin, direction = rays(camera, pixel)
    return origin + direction * ((height_m - origin[:, 2]) / direction[:, 2])[:, None]


def at_side(camera: Camera, pixel: Array, y_m: float) -> Array:
    """(n, 3) where rays meet an upright plane along the table."""
    origin, direction = rays(camera, pixel)
    return origin + direction * ((y_m - origin[:, 1]) / direction[:, 1])[:, None]


def write_table() -> None:
    """The table's top as a mesh with metres for sides of some decimetres."""
    x, y = np.meshgrid(np.linspace(0, LENGTH_M, 15), np.linspace(0, BREADTH_M, 9))
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    head = f"ply\nformat ascii 1.0\nelement vertex {x.size}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [f"{u:.6g} {v:.6g} 0" for u, v in zip(x.ravel(), y.ravel(), strict=True)]
    rows += [f"3 {p} {q} {r}" for p, q, r in faces.tolist()]
    (EXAMPLE / "table.ply").write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def main(source: Path) -> None:
    """Write pairs, tracks, picks and the table."""
    cameras = []
    for number, order in enumerate(ORDERS, start=1):
        clicked = np.load(source / f"c{number}.npy").astype(np.float64)
        # Rows of clicks are counted from the bottom as 720 − row.
        pixel = np.stack([clicked[:, 0] + 0.5, HEIGHT - clicked[:, 1] + 0.5], axis=1)
        point = POINTS[list(order)]
        cameras.append(resect(pixel, point, WIDTH, HEIGHT, sigma_px=SIGMA_PAIR_PX).camera)
        columns = {"name": [NAMES[i] for i in order]}
        for name, values in zip(("u_px", "v_px", "x_m", "y_m", "z_m"), (*pixel.T, *point.T), strict=True):
            columns[name] = [f"{value:.6g}" for value in values]
        columns["sigma_px"] = [f"{SIGMA_PAIR_PX:g}"] * len(pixel)
        write_columns(EXAMPLE / f"pairs_{number}.csv", columns)

    seen = [sightings(np.load(source / f"ballpath{number}.npy")) for number in (1, 2)]
    paths = [linked(*one) for one in seen]
    runs = [run for path in paths[0] for run in runs_of(seen[0][0][path], seen[0][1][path])]
    picks = []
    kept = []
    for run in runs:
        bounce = at_height(cameras[0], run.pixel, RADIUS_M)
        inside = (bounce[:, :2] > NEAR_END_M).all(axis=1) & (
            bounce[:, :2] < np.array([LENGTH_M, BREADTH_M]) - NEAR_END_M
        ).all(axis=1)
        if not inside.all():
            print("left out", run.first, run.last, bounce.round(2).tolist())
            continue
        kept.append(run)
        name = f"run_{run.first:04d}"
        frames = np.array([run.first, run.last])
        ends = seen[0][1][np.searchsorted(seen[0][0], frames)]
        first, last = (at_side(cameras[0], ends[i : i + 1], float(bounce[-i, 1]))[0] for i in (0, 1))
        start, end = (run.first - 0.5) / RATE_HZ, (run.last + 0.5) / RATE_HZ
        picks.append((name, start, first, "pass", SIGMA_END_S))
        for time, sigma, place in zip(run.time_s, run.sigma_s, bounce, strict=True):
            picks.append((name, time, place - [0, 0, RADIUS_M], "impact", sigma))
        picks.append((name, end, last, "pass", SIGMA_END_S))
    name, time, place, kind, sigma = zip(*picks, strict=True)
    write_picks(
        make_picks(name, np.round(time, 5), np.round(place, 4), kind=kind, sigma_time_s=np.round(sigma, 5)),
        EXAMPLE / "picks.csv",
    )
    for number, ((frame, pixel), found) in enumerate(zip(seen, paths, strict=True), start=1):
        ball = np.sort(np.unique(np.concatenate(found)))
        of_run = np.full(frame.size, "", dtype="<U8")
        for run in kept:
            mine = ball[(frame[ball] >= run.first) & (frame[ball] <= run.last)]
            of_run[mine] = f"run_{run.first:04d}"
        rows = np.flatnonzero(of_run != "")
        taken = frame[rows] - ((frame[rows] >= SLIP) & (number == 2))
        nothing = np.full(rows.size, np.nan)
        track = Track(
            trajectory=of_run[rows],
            frame=frame[rows],
            time_s=np.round(taken / RATE_HZ, 6),
            pixel=pixel[rows],
            sigma_px=np.full(rows.size, SIGMA_PX),
            score=nothing,
            row=np.zeros(rows.size, dtype=np.intp),
        )
        write_track(track, EXAMPLE / f"track_{number}.csv")
        print(f"camera {number}: {frame.size} sightings, {ball.size} on paths, {rows.size} in {len(kept)} runs")
    print(f"{sum(kind == 'impact' for kind in kind)} bounces")
    write_table()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
