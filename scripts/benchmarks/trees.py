# SPDX-License-Identifier: GPL-3.0-or-later
"""What trees cost: a simulation without them, with trees that no block meets, and with forests.

The terrain is that of ``simulation.py``: 500 × 500 m, 500,000 triangles, blocks of 0.3 m from its upper edge. Costs are
CPU time of one thread, each beside the runs without trees in the same turn, the median of some turns. Blocks in forests
run less far: their cost is that of a metre of path as well.
"""

import argparse
import statistics
import time
from dataclasses import replace

from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.trees import in_cells, random_trees
from simulation import case

MODEL, TRIANGLES = "noel_2017", 5e5
DENSITIES = (200.0, 600.0, 1500.0)
DBH_M, SD_M = 0.3, 0.1


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=2000)
    parser.add_argument("--turns", type=int, default=5)
    options = parser.parse_args()
    ground, releases = case(TRIANGLES, options.blocks)
    forests = {f"{n:g}/ha": random_trees(ground.terrain, n, DBH_M, SD_M, seed=1) for n in DENSITIES}
    low = random_trees(ground.terrain, DENSITIES[1], DBH_M, SD_M, seed=1, height_m=1e-3)
    cases = {"none": None, f"{DENSITIES[1]:g}/ha, 1 mm high": low} | forests
    for name, trees in forests.items():
        started = time.process_time()
        in_cells(trees)
        print(f"{name}: {len(trees):,} trees into cells in {1000 * (time.process_time() - started):.0f} ms")
    settings = {name: replace(Settings(MODEL), trees=trees) for name, trees in cases.items()}
    spent: dict[str, list[float]] = {name: [] for name in cases}
    runs: dict[str, Simulation] = {}
    for one in settings.values():
        simulate(ground, releases.take(slice(0, 64)), one, record="ends")
    for _ in range(options.turns):
        for name, one in settings.items():
            started = time.process_time()
            runs[name] = simulate(ground, releases, one, record="ends", threads=1)
            spent[name].append(time.process_time() - started)
    bare = spent["none"]
    metres = runs["none"].length_m.sum()
    print(f"\n{'trees':<20}{'time':>8}{'a metre':>10}{'hits each':>12}{'run-out':>10}")
    for name, run in runs.items():
        ratio = statistics.median(one / other for one, other in zip(spent[name], bare, strict=True))
        path = ratio * metres / run.length_m.sum()
        out = (run.position - run.releases.position)[:, 0].mean()
        print(f"{name:<20}{ratio:>8.2f}{path:>10.2f}{run.tree_hits.mean():>12.1f}{out:>8.0f} m")


if __name__ == "__main__":
    main()
