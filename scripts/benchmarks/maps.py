# SPDX-License-Identifier: GPL-3.0-or-later
"""What maps and screens cost: beside the runs alone, how many blocks a second with all of them, and how much memory.

The terrain is that of ``simulation.py``: 500 × 500 m, 500,000 triangles, blocks of 0.3 m from its upper edge; cells of
1 m, three screens across it. Costs are CPU time of one thread, each beside the runs in the same turn, the median of
some turns.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from rockfall.core.hazard.cell_tally import CellTally
from rockfall.core.hazard.cells import cells_over
from rockfall.core.hazard.face_tally import FaceTally
from rockfall.core.hazard.screen_tally import ScreenTally
from rockfall.core.hazard.screens import Screen
from rockfall.core.hazard.tally import Tally
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.workflow.hazard import run_chunks
from simulation import DROP_M, PLATROCK, case, row, run_platrock

TRIANGLES, CELL_M = 5e5, 1.0
MODELS = ("noel_2017", "pfeiffer_bowen_1989")
SCREENS = tuple(Screen(f"x = {x} m", np.array([[x, 0.0], [x, 500.0]])) for x in (100, 200, 300))


def processor(work: Callable[[], object]) -> float:
    """CPU time [s]."""
    start = time.process_time()
    work()
    return time.process_time() - start


def counted(ground: Ground, releases: Releases, model: str, tallies: list[Tally], threads: int | None = 1) -> None:
    run_chunks(ground, releases, Settings(model), tallies, threads=threads)
    for tally in tallies:
        tally.arrays()  # what waits is sorted in


def costs(ground: Ground, releases: Releases, turns: int) -> None:
    print(
        f"\nOne core, {len(releases):,} blocks, cells of {CELL_M:g} m; times those of runs of which only ends are kept"
    )
    cells = cells_over(ground.surface, CELL_M)
    header = ("model", "blocks/s", "all moments", "screens", "maps", "maps, faces", "passages")
    print("{:<24}{:>10}{:>14}{:>12}{:>12}{:>14}{:>12}".format(*header))
    for model in MODELS:
        simulate(ground, releases.take(slice(0, 64)), Settings(model))
        ways: dict[str, list[float]] = {"ends": [], "all": [], "screens": [], "maps": [], "faces": []}
        passages = 0
        for _ in range(turns):
            tally = CellTally(cells)
            both: list[Tally] = [CellTally(cells), FaceTally(len(ground.owner))]
            work = {
                "ends": lambda: simulate(ground, releases, Settings(model), record="ends", threads=1),  # noqa: B023
                "all": lambda: counted(ground, releases, model, []),  # noqa: B023
                "screens": lambda: counted(ground, releases, model, [ScreenTally(SCREENS)]),  # noqa: B023
                "maps": lambda: counted(ground, releases, model, [tally]),  # noqa: B023
                "faces": lambda: counted(ground, releases, model, both),  # noqa: B023
            }
            for name, one in work.items():
                ways[name].append(processor(one))
            passages = int(tally.passages.figures([]).count.sum())
        ratios = [
            statistics.median(a / b for a, b in zip(ways[name], ways["ends"], strict=True))
            for name in ("all", "screens", "maps", "faces")
        ]
        rate = len(releases) / min(ways["ends"])
        print(
            f"{model:<24}{rate:>10,.0f}" + "{:>14.2f}{:>12.2f}{:>12.2f}{:>14.2f}".format(*ratios)
            + f"{passages / len(releases):>12.0f}", flush=True,
        )  # fmt: skip


def beside_platrock(blocks: int, ground: Ground, releases: Releases) -> None:
    """The maps of PlatRock (its post-processing, cells of 1 m) and ours, one core, each beside its own runs.

    PlatRock has passages, stops, and the mean, 90, 95 and 99 % of height, speed and energy; ours also the median,
    translational energy, shares above limits, maxima and standard errors.
    """
    print("\nMaps beside PlatRock's, one core, constant R_N 0.35 and R_T 0.85 (PlatRock: and a roughness of 0.1)")
    found = run_platrock(blocks)
    if found is None:
        return
    runs, _, metres, maps = found
    row(f"{PLATROCK}, {blocks} blocks", f"{1e3 * maps:,.1f} ms", f"{maps / runs:.2f} of its runs; {metres:.0f} m each")
    settings = Settings("azimi_desvarreux_1977", {"rn": 0.35, "rt": 0.85})
    dropped = make_releases(releases.position + np.array([0.0, 0.0, DROP_M]), diameter_m=0.3)
    simulate(ground, dropped.take(slice(0, 64)), settings)
    run_chunks(ground, dropped.take(slice(0, 64)), settings, [CellTally(cells_over(ground.surface, CELL_M))], threads=1)
    tally = CellTally(cells_over(ground.surface, CELL_M))
    alone = processor(lambda: simulate(ground, dropped, settings, record="ends", threads=1))

    def mapped() -> None:
        run_chunks(ground, dropped, settings, [tally], threads=1)
        tally.maps()

    ours = (processor(mapped) - alone) / len(dropped)
    length = simulate(ground, dropped, settings, record="ends").length_m.mean()
    quicker = f"a metre {maps / metres / ours * length:,.0f} times as quick"
    note = f"{ours * len(dropped) / alone:.2f} of its runs; {length:.0f} m each; {quicker}"
    row(f"ours, {len(dropped):,} blocks", f"{1e3 * ours:,.4f} ms", note)


def all_cores(blocks: int, model: str) -> None:
    """Run in a child: prints seconds and rate of blocks with all maps, and the greatest memory."""
    ground, releases = case(TRIANGLES, blocks)
    _ = ground.plan
    cells = cells_over(ground.surface, CELL_M)
    counted(ground, releases.take(slice(0, 256)), model, [CellTally(cells), ScreenTally(SCREENS)])
    start, before = time.perf_counter(), time.process_time()
    counted(ground, releases, model, [CellTally(cells), ScreenTally(SCREENS)], None)
    taken, used = time.perf_counter() - start, time.process_time() - before
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    peak = int(status.split("VmHWM:")[1].split()[0]) / 1e6
    note = f"{blocks / taken:,.0f} blocks/s, {used:.1f} s of CPU; peak {peak:.2f} GB with terrain and releases"
    row(f"{blocks:,} blocks, all maps, three screens, {model}", f"{taken:.1f} s", note)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=4096, help="of the costs on one core")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--large", type=int, nargs="*", default=[100_000], help="numbers of blocks on all cores")
    parser.add_argument("--platrock", type=int, default=10, help="blocks of PlatRock; 0 leaves it out")
    parser.add_argument("--child", nargs=2, metavar=("BLOCKS", "MODEL"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        all_cores(int(arguments.child[0]), arguments.child[1])
        return
    print(f"{os.process_cpu_count()} cores; load {', '.join(f'{value:.1f}' for value in os.getloadavg())}")
    ground, releases = case(TRIANGLES, arguments.blocks)
    seconds = processor(partial(getattr, ground, "plan"))
    row("the terrain's triangles in plan, once", f"{seconds:.2f} s", "of CPU, compiled before" if seconds < 3 else "")
    if arguments.blocks:
        costs(ground, releases, arguments.turns)
    if arguments.platrock:
        beside_platrock(arguments.platrock, ground, releases)
    del ground, releases
    print("\nAll cores")
    for blocks in arguments.large:
        subprocess.run([sys.executable, __file__, "--child", str(blocks), MODELS[0]], check=True)
    print(f"load at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
