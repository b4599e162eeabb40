# SPDX-License-Identifier: GPL-3.0-or-later
"""How reliable and how quick cameras are found: success without a start, coverage, and times beside OpenCV and scipy.

On a busy machine set OPENBLAS_NUM_THREADS=1: waiting threads of the linear algebra cost more than the work.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from rockfall.core.camera.model import Camera, look_at, project, rays, rotation_from_vector, undistort
from rockfall.core.camera.motion import FeatureTracks, solve_motion
from rockfall.core.camera.resection.resect import Resection, resect
from rockfall.core.errors import RockfallError
from rockfall.core.vectors import Array, norm, unit
from scipy.optimize import least_squares

WIDTH, HEIGHT = 3840, 2160
ACTION_CAMERA = {"k1": -0.28, "k2": 0.09, "k3": -0.012, "p1": 0.0007, "p2": -0.0011}


def made(
    seed: int | np.random.Generator,
    n: int,
    *,
    planar: bool = False,
    bent: bool = False,
    sigma_px: float = 0.5,
    sigma_m: float = 0.0,
) -> tuple[Camera, Array, Array]:
    """A random camera of 20–400 mm, 5–500 m away, tilted −90…60° and rolled, with n pairs: pixels and points."""
    rng = np.random.default_rng(seed)
    focal = np.exp(rng.uniform(np.log(20), np.log(400))) / 36 * WIDTH
    distance = np.exp(rng.uniform(np.log(5), np.log(500)))
    tilt, azimuth = np.radians(rng.uniform(-90, 60)), rng.uniform(0, 2 * np.pi)
    forward = np.array([np.cos(tilt) * np.cos(azimuth), np.cos(tilt) * np.sin(azimuth), np.sin(tilt)])
    place = rng.uniform(-100, 100, 3)
    camera = look_at(WIDTH, HEIGHT, place, place + forward, focal_px=focal)
    camera = replace(camera, rotation=rotation_from_vector([0, 0, rng.uniform(-0.3, 0.3)]) @ camera.rotation)
    if bent:
        camera = replace(camera, k1=rng.uniform(-0.15, 0.1), k2=0.02, p1=3e-4, p2=-2e-4)
    while True:
        pixels = rng.uniform((0.05 * WIDTH, 0.05 * HEIGHT), (0.95 * WIDTH, 0.95 * HEIGHT), (n, 2))
        extent = np.linalg.svd(pixels - pixels.mean(axis=0), compute_uv=False)
        if extent[1] <= 0.25 * extent[0]:
            continue
        origins, directions = rays(camera, pixels)
        along = distance * rng.uniform(0.6, 1.6, n)
        if planar:
            across = unit(np.cross(camera.rotation[2], rng.normal(size=3)))
            normal = rotation_from_vector(across * np.radians(rng.uniform(25, 50))) @ camera.rotation[2]
            along = distance * (camera.rotation[2] @ normal) / (directions @ normal)
        if ((along > 0) & (along < 10 * distance)).all():
            break
    points = origins + directions * along[:, None] + sigma_m * rng.normal(size=(n, 3))
    return camera, np.clip(pixels + sigma_px * rng.normal(size=(n, 2)), 0, (WIDTH, HEIGHT)), points


def reliability(cases: int) -> None:
    """Success without a start, coverage of 95 % intervals, errors against the Cramér–Rao bound."""
    print(f"{'pairs':>6} {'free':>5} {'place':>6} {'success':>8} {'coverage':>9} {'error/bound':>12} {'median':>9}")
    for n, free, planar in (
        (4, (), False),
        (4, (), True),
        (6, (), False),
        (6, ("f",), False),
        (6, ("f",), True),
        (8, ("f",), False),
        (12, ("f",), False),
        (20, ("f",), False),
        (20, ("f",), True),
    ):
        rng = np.random.default_rng(n)
        success, inside, squared, taken, judged = 0, [], [], [], 0
        for number in range(cases):
            sigma_m = 0.02 * (number % 2)
            camera, pixels, points = made(rng, n, planar=planar, bent=number % 3 == 0, sigma_m=sigma_m)
            known = replace(camera, position=np.zeros(3), rotation=np.eye(3))
            if free:
                known = replace(known, fx=5000.0, fy=5000.0)
            begin = time.perf_counter()
            try:
                found = resect(pixels, points, WIDTH, HEIGHT, free=free, camera=known, sigma_px=0.5, sigma_m=sigma_m)
            except RockfallError as error:
                print(error)
                judged += 1
                continue
            taken.append(time.perf_counter() - begin)
            if not determined(found, points):
                continue
            judged += 1
            away = found.camera.position - camera.position
            distance = float(away @ np.linalg.solve(found.covariance[3:6, 3:6], away))
            success += distance < 40 and bool(found.used.all())
            inside += (np.abs(away) < 1.96 * np.sqrt(np.diagonal(found.covariance)[3:6])).tolist()
            squared.append(min(distance, 40) * max(1.0, np.nan_to_num(found.scatter)) ** 2)
        print(
            f"{n:>6} {','.join(free) or '—':>5} {'plane' if planar else 'space':>6} {100 * success / judged:>6.1f} % "
            f"{100 * np.mean(inside):>7.1f} % {np.sqrt(np.mean(squared) / 3):>12.2f} "
            f"{1e3 * statistics.median(taken):>6.1f} ms   of {judged} determined cases"
        )


def determined(found: Resection, points: Array) -> bool:
    """Whether the pairs determine the camera at all: the focal length to 5 %, the position to 5 % of the distance."""
    distance = norm(points - found.camera.position).mean()
    worst = np.sqrt(np.linalg.eigvalsh(found.covariance[3:6, 3:6])[-1]) if np.isfinite(found.covariance).all() else 1e9
    return bool(found.sigma.get("f", 0.0) < 0.05 * found.camera.fx and worst < 0.05 * distance)


def wrong_pairs(cases: int) -> None:
    """How often exactly the pairs that are 50 px off, or swapped, are named."""
    for n, count, swap in ((8, 1, False), (10, 2, False), (12, 2, False), (12, 2, True), (20, 4, False)):
        rng, named = np.random.default_rng(n), 0
        for _ in range(cases):
            _, pixels, points = made(rng, n)
            chosen = np.sort(rng.choice(n, count, replace=False))
            angle = rng.uniform(0, 2 * np.pi, count)
            if swap:
                pixels[chosen] = pixels[chosen[::-1]]
            else:
                pixels[chosen] += 50 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            found = resect(np.clip(pixels, 0, (WIDTH, HEIGHT)), points, WIDTH, HEIGHT, sigma_px=0.5)
            named += found.wrong == tuple(str(i + 1) for i in chosen)
        print(f"{count} of {n} pairs {'swapped' if swap else '50 px off'}: named in {100 * named / cases:.0f} %")


def timed(work: Callable[[], object], repeats: int) -> float:
    """Median time of some runs [s]."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        kept = work()  # noqa: F841 — as a caller does; freeing it is not part of the work
        taken.append(time.perf_counter() - begin)
    return statistics.median(taken)


def by_opencv_and_scipy(pixels: Array, points: Array, focal: float) -> Array:
    """What one would write down: solvePnP at a guessed focal length, then scipy with numeric derivatives."""
    matrix = np.array([[focal, 0, WIDTH / 2], [0, focal, HEIGHT / 2], [0, 0, 1]])
    _, turn, move = cv2.solvePnP(points, pixels, matrix, None, flags=cv2.SOLVEPNP_SQPNP)

    def gap(values: Array) -> Array:
        matrix = np.array([[values[6], 0, WIDTH / 2], [0, values[6], HEIGHT / 2], [0, 0, 1]])
        return (cv2.projectPoints(points, values[:3], values[3:6], matrix, None)[0][:, 0] - pixels).ravel()

    start = np.concatenate([turn.ravel(), move.ravel(), [focal]])
    return least_squares(gap, start, x_scale="jac", method="trf").x


def one_solve() -> None:
    """12 pairs with a free focal length."""
    camera, pixels, points = made(4, 12)
    ours = timed(lambda: resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5), 15)
    last = replace(camera, position=camera.position + 0.05, fx=1.01 * camera.fx, fy=1.01 * camera.fy)
    again = timed(lambda: resect(pixels, points, WIDTH, HEIGHT, sigma_px=0.5, camera=last), 15)
    theirs = timed(lambda: by_opencv_and_scipy(pixels, points, camera.fx * 1.2), 15)
    print(
        f"one solve of 12 pairs, focal length free: {1e3 * ours:.1f} ms from nothing, "
        f"{1e3 * again:.1f} ms from a camera 0.1 m away; solvePnP with a focal "
        f"length 20 % off and scipy with numeric derivatives {1e3 * theirs:.1f} ms ({theirs / ours:.2f} times)"
    )


def motion(frames: int, features: int) -> None:
    """A shake of 0.5°, a pan of 8°, 30 % wrong tracks."""
    rng = np.random.default_rng(2)
    camera = look_at(1920, 1080, (0, 0, 5), (0, 80, 25), fov_deg=60)
    turn = np.radians(0.5) * rng.normal(size=(frames, 3))
    turn[:, 1] += np.radians(8) * np.linspace(-0.5, 0.5, frames)
    turn[0] = 0
    rotation = rotation_from_vector(turn) @ camera.rotation
    position = np.repeat(camera.position[None], frames, axis=0)
    origins, directions = rays(camera, rng.uniform((200, 100), (1720, 980), (features, 2)))
    points = origins + directions * rng.uniform(40, 120, (features, 1))
    frame, feature = (each.ravel() for each in np.meshgrid(np.arange(frames), np.arange(features), indexing="ij"))
    pixel = project(camera, points[feature], position=position[frame], rotation=rotation[frame])
    pixel += 0.5 * rng.normal(size=pixel.shape)
    wrong = (rng.random(frame.size) < 0.3) & (frame > 0)
    pixel[wrong] += rng.uniform(-80, 80, (int(wrong.sum()), 2))
    tracks = FeatureTracks(frame, feature, pixel)

    def points_of(origins: Array, directions: Array) -> Array:
        """The nearest of the true points, as a terrain would give it."""
        return points[np.argmax(directions @ unit(points - origins[0]).T, axis=1)]

    for mode, ground in (("rotation", None), ("full", points_of)):
        begin = time.perf_counter()
        found = solve_motion(camera, tracks, np.arange(frames) / 30, 0, mode=mode, points_of=ground)
        taken = time.perf_counter() - begin
        gap = found.path.rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)
        away = np.degrees(np.sqrt((gap**2).sum(axis=(1, 2)) / 2))
        print(
            f"motion, {mode}: {frames} frames × {features} features in {taken:.2f} s; rotation off by "
            f"{np.sqrt(np.mean(away**2)):.4f}° (worst {away.max():.4f}°), position by "
            f"{1e3 * norm(found.path.position - position).max():.0f} mm at most"
        )


def inverse_distortion(count: int) -> None:
    """Newton to rounding beside OpenCV's five rounds of iteration."""
    camera = Camera(1920, 1080, 1500, 1480, 950, 555, **ACTION_CAMERA)
    pixels = np.random.default_rng(0).uniform((0, 0), camera.size, (count, 2))
    matrix = np.array([[camera.fx, 0, camera.cx - 0.5], [0, camera.fy, camera.cy - 0.5], [0, 0, 1]])
    bent = np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])
    work = (pixels - 0.5)[:, None]
    exact = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-15)
    ours = timed(lambda: undistort(camera, pixels), 5)
    theirs = timed(lambda: cv2.undistortPoints(work, matrix, bent), 5)
    precise = timed(lambda: cv2.undistortPoints(work, matrix, bent, criteria=exact), 5)
    five = np.abs(cv2.undistortPoints(work, matrix, bent)[:, 0] - undistort(camera, pixels)).max() * camera.fx
    print(
        f"inverse distortion: {1e9 * ours / count:.0f} ns a pixel to rounding; OpenCV {1e9 * theirs / count:.0f} ns to "
        f"{five:.1g} px, {1e9 * precise / count:.0f} ns to rounding"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--features", type=int, default=300)
    arguments = parser.parse_args()
    one_solve()
    inverse_distortion(100_000)
    motion(arguments.frames, arguments.features)
    wrong_pairs(max(arguments.cases // 5, 20))
    reliability(arguments.cases)


if __name__ == "__main__":
    main()
