# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick blocks fall on a cloud of points, beside a mesh of the same slope, in one run, and in how much memory."""

import argparse
import resource
import statistics
import time

import numpy as np
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import ON_GROUND, Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.terrain.cloud import Cloud
from rockfall.core.terrain.surface import Surface

SIDE_M = 200.0


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """35°, then 11°; roughness from 1 to 20 m."""
    slope = -0.7 * np.minimum(x, 120) - 0.2 * np.maximum(x - 120, 0)
    return slope + 0.4 * np.sin(x / 3) * np.cos(y / 4) + 0.05 * np.sin(2.1 * x + y) * np.cos(1.7 * y)


def points(count: int) -> Ground:
    """At random places."""
    plan = np.random.default_rng(1).uniform(0, SIDE_M, (count, 2))
    return make_ground(Cloud(np.column_stack([plan, height(*plan.T)]), GlobalShift(), "cloud"))


def mesh(triangles: int) -> Ground:
    """Of a grid."""
    n = int(np.sqrt(triangles / 2)) + 1
    x, y = np.meshgrid(np.linspace(0, SIDE_M, n), np.linspace(0, SIDE_M, n))
    i = np.arange(n * n).reshape(n, n)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()])
    faces = np.concatenate([lower, upper]).astype(np.int32)
    return make_ground(Surface(vertices, faces, GlobalShift(), "mesh"))


def released(count: int, diameter: float) -> Releases:
    """On the upper part of the slope, 0.5 m above it."""
    plan = np.random.default_rng(2).uniform([5, 40], [25, SIDE_M - 40], (count, 2))
    start = np.column_stack([plan, height(*plan.T) + 0.7 * diameter + 0.5])
    return make_releases(start, diameter_m=diameter)


def megabytes() -> float:
    """The most that this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=4_000_000)
    parser.add_argument("--triangles", type=int, default=2_000_000)
    parser.add_argument("--blocks", type=int, default=2000)
    parser.add_argument("--diameter", type=float, nargs="+", default=[0.6, 1.5])
    parser.add_argument("--model", default="noel_2017")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    settings = Settings(arguments.model)
    started = time.process_time()
    cloud = points(arguments.points)
    assert cloud.tree
    print(
        f"{arguments.points} points, {next(iter(cloud.spacing_m.values())):.3f} m apart: made and indexed in "
        f"{time.process_time() - started:.1f} s of one core, {megabytes():.0f} MB in all"
    )
    grounds = {f"{arguments.points} points": cloud, f"{arguments.triangles} triangles": mesh(arguments.triangles)}
    print(
        f"{'ground':<20}{'diameter':>9}{'impacts':>9}{'steps':>7}{'path':>8}{'one core':>12}{'all cores':>12}  blocks/s"
    )
    for diameter in arguments.diameter:
        releases = released(arguments.blocks, diameter)
        for name, ground in grounds.items():
            run = simulate(ground, releases, settings)
            steps = np.count_nonzero(run.records.what == ON_GROUND) / len(run)
            rates = []
            for threads, clock in ((1, time.process_time), (None, time.perf_counter)):
                taken = []
                for _ in range(arguments.repeats):
                    start = clock()
                    simulate(ground, releases, settings, record="ends", threads=threads)
                    taken.append(clock() - start)
                rates.append(len(releases) / statistics.median(taken))
            print(
                f"{name:<20}{diameter:>8.2f}m{run.impacts.mean():>9.1f}{steps:>7.0f}{run.length_m.mean():>7.0f}m"
                f"{rates[0]:>12.0f}{rates[1]:>12.0f}"
            )


if __name__ == "__main__":
    main()
