# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the tables of a simulation take, beside the simulation itself and Python's csv module, in one run."""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rockfall.core.exchange.simulated_motion import write_simulated_impacts, write_simulated_trajectories
from rockfall.core.exchange.simulation_tables import summary, write_runs
from rockfall.core.exchange.tables import write_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.simulation.results import impacts_of
from rockfall.core.terrain.surface import Surface

SIDE_M = 500
SHIFT = GlobalShift(2_600_000.0, 1_200_000.0, 500.0)


def slope() -> Surface:
    """500 000 triangles: 35°, then 15°, then flat; rough from 1 to 64 m."""
    line = np.arange(SIDE_M + 1.0)
    x, y = np.meshgrid(line, line)
    z = -0.7 * np.minimum(x, 200) - 0.268 * np.clip(x - 200, 0, 150)
    rng = np.random.default_rng(0)
    for length in 2.0 ** np.arange(7):
        phase = rng.uniform(0, 6, 2)
        z += 0.012 * length * np.sin(2 * x / length + phase[0]) * np.cos(2 * y / length + phase[1])
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), SHIFT, "slope")


def timed[T](what: str, rows: int, work: Callable[[], T]) -> T:
    """Do it, and say how long it took."""
    clock, processor = time.perf_counter(), time.process_time()
    result = work()
    clock, processor = time.perf_counter() - clock, time.process_time() - processor
    print(f"{what:<34}{clock:8.2f} s{processor:8.2f} s of processors{1e6 * processor / rows:8.2f} µs a row", flush=True)
    return result


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=100_000)
    parser.add_argument("--model", default="noel_2017")
    parser.add_argument("--compared", type=int, default=2000, help="blocks written by the csv module, too")
    arguments = parser.parse_args()
    n, settings = arguments.blocks, Settings(arguments.model)
    ground = make_ground(slope())
    rng = np.random.default_rng(1)
    places = placed_on(ground, rng.uniform([10, 100], [30, 400], (n, 2)), np.full(n, 0.3))
    places[:, 2] += 1.0
    releases = make_releases(places, diameter_m=0.3)
    few = slice(0, min(n, arguments.compared))
    warm = simulate(ground, releases.take(slice(0, 64)), settings)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_simulated_impacts([warm], folder / "impacts.csv")
        write_runs([warm], folder / "runs.csv")
        done = timed("simulate", n, lambda: simulate(ground, releases, settings, record="impacts"))
        impacts = int(done.impacts.sum())
        timed("impacts.csv", impacts, lambda: write_simulated_impacts([done], folder / "impacts.csv"))
        timed("runs.csv", n, lambda: write_runs([done], folder / "runs.csv"))
        timed("summary.json", n, lambda: summary([done], {}))
        part = done.part(few.start, few.stop)
        rows = int(part.impacts.sum())
        timed(f"impacts.csv, {few.stop} blocks", rows, lambda: write_simulated_impacts([part], folder / "part.csv"))
        timed("the same by Python's csv module", rows, lambda: write_impacts(impacts_of(part), folder / "csv.csv"))
        moved = simulate(ground, releases.take(few), settings)
        path = folder / "trajectories.csv"
        timed(f"trajectories.csv, {few.stop} blocks", few.stop, lambda: write_simulated_trajectories([moved], path))
        size = (folder / "impacts.csv").stat().st_size / 1e6
        print(f"{n} blocks, {impacts} impacts, {size:.0f} MB of impacts.csv")


if __name__ == "__main__":
    main()
