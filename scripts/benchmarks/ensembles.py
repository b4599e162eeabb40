# SPDX-License-Identifier: GPL-3.0-or-later
"""What many runs and many projects take, and whether they survive being killed.

``workers``: the same chunks on two threads of this process and on 1, 2 and 4 workers of Dask, in turns; the ratio is
Dask's overhead. ``many``: blocks with maps on two workers, the rate, the greatest memory, and what 10^9 would take.
``sweep``: small projects as a batch that is killed halfway and goes on, beside each simulated by itself.
"""

import argparse
import filecmp
import io
import json
import os
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, redirect_stdout
from pathlib import Path

import numpy as np
from rockfall.core.cli import main as main_command
from rockfall.core.hazard.cell_tally import CellTally
from rockfall.core.hazard.cells import cells_over
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.engine import Settings
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases
from rockfall.core.simulation.release_sources import on_line
from rockfall.core.terrain.writers import write_ply
from rockfall.core.workflow.dask_pool import DaskPool
from rockfall.core.workflow.ensembles import Chunk, Pool, Work, run_ensemble

sys.path.insert(0, str(Path(__file__).parent))
from simulation import slope  # the same terrain as in its own benchmark

CELL_M = 2.0


class Threads:
    """A pool of the threads of this process."""

    def __init__(self, number: int) -> None:
        self._number = number

    def compute(
        self, work: Work, chunks: Iterator[tuple[int, int, Releases]], beat: Callable[[], None]
    ) -> Iterator[tuple[int, Chunk]]:
        with ThreadPoolExecutor(self._number) as pool:
            sent: dict[Future[Chunk], int] = {}
            while True:
                while len(sent) < 2 * self._number and (following := next(chunks, None)) is not None:
                    number, first, part = following
                    sent[pool.submit(work.chunk, part, first)] = number
                if not sent:
                    return
                for one in wait(sent, return_when=FIRST_COMPLETED).done:
                    yield sent.pop(one), one.result()


def blocks_on(ground: Ground, number: int) -> Releases:
    line = np.array([[20.0, 50.0, np.nan], [20.0, 450.0, np.nan]])
    return on_line(ground, [line], Blocks(), number, seed=1)


def work_on(triangles: float) -> Work:
    surface = slope(triangles)
    return Work(make_ground(surface), Settings("noel_2017", seed=1), {"maps": CellTally(cells_over(surface, CELL_M))})


def seconds(work: Work, releases: Releases, pool: Pool) -> tuple[float, float]:
    """By the clock, and of all processors: of this process and the workers."""
    began, used = time.perf_counter(), cpu(pool)
    run_ensemble(work, releases, pool)
    return time.perf_counter() - began, cpu(pool) - used


def cpu(pool: Pool) -> float:
    there = sum(pool._client.run(time.process_time).values()) if isinstance(pool, DaskPool) else 0.0
    return time.process_time() + there


def workers(triangles: float, blocks: int, repeats: int) -> None:
    work = work_on(triangles)
    releases, few = blocks_on(work.ground, blocks), blocks_on(work.ground, 4 * 4096)
    print(f"{triangles:g} triangles, {blocks} blocks, maps of {CELL_M:g} m; {os.process_cpu_count()} cores", flush=True)
    measured: dict[str, list[tuple[float, float]]] = {}
    with ExitStack() as opened:
        pools: dict[str, Pool] = {"1 thread": Threads(1), "2 threads": Threads(2)}
        pools |= {f"{n} workers": opened.enter_context(DaskPool(None, n)) for n in (1, 2, 4)}
        for pool in pools.values():
            run_ensemble(work, few, pool)
        for _ in range(repeats):
            for name, pool in pools.items():
                measured.setdefault(name, []).append(seconds(work, releases, pool))
    base = measured["2 threads"]
    for name, each in measured.items():
        clock, used = (statistics.median(values) for values in zip(*each, strict=True))
        ratios = [statistics.median(a[i] / b[i] for a, b in zip(each, base, strict=True)) for i in (0, 1)]
        print(f"{name:10} {clock:7.2f} s, {blocks / clock:8.0f} blocks/s, {used:7.2f} s of processors; "
              f"{ratios[0]:.3f} and {ratios[1]:.3f} times two threads", flush=True)  # fmt: skip


def many(triangles: float, blocks: int) -> None:
    work = work_on(triangles)
    began = time.perf_counter()
    releases = blocks_on(work.ground, blocks)
    placed = time.perf_counter() - began
    with DaskPool(None, 2) as pool:
        run_ensemble(work, releases.take(slice(0, 8192)), pool)
        took, _ = seconds(work, releases, pool)
        memory = sum(
            one["metrics"]["memory"] for one in pool._client.scheduler_info()["workers"].values()
        ) + 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # fmt: skip
    print(f"{blocks} blocks on {triangles:g} triangles with maps of {CELL_M:g} m, two workers on "
          f"{os.process_cpu_count()} cores: placed in {placed:.0f} s, simulated in {took:.0f} s, "
          f"{blocks / took:.0f} blocks/s, {memory / 1e9:.2f} GB in all processes")  # fmt: skip
    print(f"10^9 blocks at this rate: {1e9 / blocks * took / 3600:.0f} h on these 2 workers, "
          f"{1e9 / blocks * took / 3600 / 64:.1f} h on 128")  # fmt: skip


def make_projects(root: Path, number: int) -> None:
    surface = slope(5000)
    for i in range(number):
        folder = root / f"site{i:03d}"
        folder.mkdir(parents=True)
        write_ply(surface, folder / "terrain.ply")
        folder.joinpath("project.toml").write_text(
            f'schema = 1\n[terrain]\nfile = "terrain.ply"\n[simulation]\nmodels = ["noel_2017"]\nseed = {i}\n'
            f'record = ["impacts"]\n[simulation.releases]\nfrom = "points"\npoints_m = [[20.0, {100 + i}.0]]\n'
            "number = 100\n"
        )


def sweep(number: int, jobs: int) -> None:
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        make_projects(root / "sites", number)

        def batch(out: str) -> list[str]:
            return [sys.executable, "-m", "rockfall.core.start", "batch", str(root / "sites"), "simulate",
                    "--jobs", str(jobs), "--out", str(root / out)]  # fmt: skip

        def finished(out: str) -> int:
            return len(list((root / out).glob("*/job.json")))

        process = subprocess.Popen(batch("killed"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while finished("killed") < number // 2:
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        process.wait()
        kept = finished("killed")
        began = time.perf_counter()
        subprocess.run(batch("killed"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
        print(f"the rest took {time.perf_counter() - began:.0f} s", flush=True)
        for project in sorted((root / "sites").glob("*/project.toml")):
            with redirect_stdout(io.StringIO()):
                done = main_command(["simulate", str(project), "--out", str(root / "whole" / project.parent.name)])
            if done:
                raise SystemExit(f"{project.parent.name} cannot be simulated by itself")
        states = [one["state"] for one in json.loads((root / "killed/summary.json").read_text())["jobs"]]
        tables = [path.relative_to(root / "whole") for path in (root / "whole").glob("*/*.csv")]
        same = sum(filecmp.cmp(root / "whole" / one, root / "killed" / one, shallow=False) for one in tables)
        print(f"{number} projects, killed after {kept}: {states.count('already done')} were not done again, "
              f"{states.count('done')} were done; {same} of {len(tables)} tables are the same bytes as those "
              f"of each by itself; left over: {sorted(p.name for p in (root / 'killed').glob('.*'))}")  # fmt: skip
        if not 0 < same == len(tables):
            raise SystemExit("The tables differ")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("workers", "many", "sweep"))
    parser.add_argument("--triangles", type=float, default=500_000)
    parser.add_argument("--blocks", type=float, default=60_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--projects", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    if asked.what == "workers":
        workers(asked.triangles, int(asked.blocks), asked.repeats)
    elif asked.what == "many":
        many(asked.triangles, int(asked.blocks))
    else:
        sweep(asked.projects, asked.jobs)


if __name__ == "__main__":
    main()
