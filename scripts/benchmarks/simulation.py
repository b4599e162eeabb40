# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick whole falls are: blocks and contacts per second, creeping blocks, larger terrain, threads, memory.

The terrain is made by a seed: 500 × 500 m, 35°, then 15°, then flat, rough from 1 to 64 m. A core's figure is CPU time,
the best of some repeats. PlatRock 0.4.6 falls down the same terrain in the same run, in an environment of its own in
``build/``, where a Python that it takes (3.10 to 3.12) and its needs are there.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import COMPARED
from rockfall.core.simulation.engine import Settings, Simulation, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.surface import Surface
from scipy.ndimage import map_coordinates

SIZE_M = 500.0
ROUGHNESS = 0.012
"""Standard deviation of the knots of each octave, as a part of its wave length."""
ENVIRONMENT = Path("build/platrock")
PLATROCK = "platrock==0.4.6"
DROP_M = 2.0
"""How far above the terrain blocks are released beside PlatRock."""
CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
import simulation
simulation.{what}(*map(float, sys.argv[2:]))
"""


def heights(spacing: float, seed: int = 1) -> np.ndarray:
    """Of the grid's nodes, [y, x]."""
    rng = np.random.default_rng(seed)
    line = np.arange(round(SIZE_M / spacing) + 1) * spacing
    x, y = np.meshgrid(line, line)
    z = -np.tan(np.radians(35)) * np.minimum(x, 200) - np.tan(np.radians(15)) * np.clip(x - 200, 0, 150)
    for octave in range(7):
        wave = 2.0**octave
        knots = rng.normal(0, ROUGHNESS * wave, (int(SIZE_M / wave) + 4,) * 2)
        z += map_coordinates(knots, [y / wave + 1, x / wave + 1], order=3)
    return z


def slope(triangles: float) -> Surface:
    """As many triangles as two of each cell of a grid make."""
    spacing = SIZE_M / np.sqrt(triangles / 2)
    z = heights(spacing)
    n = len(z)
    x, y = np.meshgrid(np.arange(n) * spacing, np.arange(n) * spacing)
    i = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, GlobalShift(), "slope")


def case(triangles: float, blocks: int, diameter: float = 0.3) -> tuple[Ground, Releases]:
    """Spheres on the upper edge of the slope."""
    ground = make_ground(slope(triangles))
    places = starts(blocks)
    return ground, make_releases(placed_on(ground, places, np.full(blocks, diameter)), diameter_m=diameter)


def starts(blocks: int) -> np.ndarray:
    return np.random.default_rng(2).uniform([10, 100], [40, 400], (blocks, 2))


def row(what: str, value: str, note: str = "") -> None:
    print(f"{what:<52}{value:>18}  {note}", flush=True)


def best(work: Callable[[], Simulation], repeats: int, clock: Callable[[], float] = time.process_time) -> tuple:
    """The shortest time [s] and the result."""
    times = []
    for _ in range(repeats):
        start = clock()
        done = work()
        times.append(clock() - start)
    return min(times), done


def on_one_core(ground: Ground, releases: Releases, settings: Settings, repeats: int) -> tuple[float, Simulation]:
    """Seconds of CPU for each block, and the runs."""
    seconds, run = best(lambda: simulate(ground, releases, settings, record="ends", threads=1), repeats)
    return seconds / len(releases), run


def models(ground: Ground, releases: Releases, repeats: int) -> None:
    print(f"\nOne core, {len(ground.faces):,} triangles, spheres of 0.3 m")
    header = ("model", "blocks/s", "m", "impacts")
    print(f"{header[0]:<28}{header[1]:>12}{header[2]:>8}{header[3]:>10}")
    for name in COMPARED:
        each, run = on_one_core(ground, releases, Settings(name), repeats)
        print(f"{name:<28}{1 / each:>12,.0f}{run.length_m.mean():>8.0f}{run.impacts.mean():>10.1f}", flush=True)


def contacts(ground: Ground, releases: Releases, repeats: int) -> None:
    """The flights of simulated blocks once more, each to its first contact: what an impact costs beside its model."""
    from rockfall.core.compiled import kernel
    from rockfall.core.simulation.contact_kernels import first_contact
    from rockfall.core.simulation.results import flights_of
    from rockfall.core.terrain.kernels import STACK_SIZE

    @kernel
    def fly_again(tree, p, v, radius, gravity):
        stack, times, total = np.empty(STACK_SIZE, np.int64), np.empty(STACK_SIZE), 0.0
        for i in range(len(p)):
            start, speed = (p[i, 0], p[i, 1], p[i, 2]), (v[i, 0], v[i, 1], v[i, 2])
            total += first_contact(tree, stack, times, start, speed, (0.0, 0.0, -gravity), radius, np.inf)[0]
        return total

    run = simulate(ground, releases, Settings("noel_2017"), record="impacts")
    rows, _ = flights_of(run)
    p, v = (np.ascontiguousarray(part[rows]) for part in (run.records.position, run.records.v2))
    work = lambda: fly_again(ground.tree, p, v, releases.radius_m[0], run.settings.gravity_mps2)  # noqa: E731
    work()
    seconds, _ = best(work, repeats)
    row("first contacts, one core", f"{len(p) / seconds / 1e6:.2f} million/s", f"{len(p):,} flights of noel_2017")


def creeping(repeats: int, blocks: int) -> None:
    ground, releases = case(2 * 250**2, blocks, (6 / np.pi) ** (1 / 3))
    each, run = on_one_core(ground, releases, Settings("azimi_desvarreux_1977", {"rt": 0.92}), repeats)
    note = f"1 m³ on cells of 2 m, {run.length_m.mean():.0f} m, {run.impacts.mean():.0f} impacts"
    row("creeping blocks, one core", f"{1 / each:,.0f} /s", note)


def larger_terrain(ground: Ground, releases: Releases, repeats: int, threads: int) -> None:
    print("\nLarger terrain and more threads, noel_2017")
    settings = Settings("noel_2017")
    small, _ = on_one_core(ground, releases, settings, repeats)
    large_ground, large_releases = case(2e6, len(releases))
    large, _ = on_one_core(large_ground, large_releases, settings, repeats)
    row("500,000 triangles, one core", f"{1 / small:,.0f} /s")
    row("2 million triangles, one core", f"{1 / large:,.0f} /s", f"{large / small:.2f} times the time")
    clock = time.perf_counter
    one, _ = best(lambda: simulate(ground, releases, settings, record="ends", threads=1), repeats, clock)
    for count in sorted({2, threads}):
        if count <= (os.process_cpu_count() or 1):
            more, _ = best(
                lambda count=count: simulate(ground, releases, settings, record="ends", threads=count), repeats, clock
            )
            row(f"{count} threads", f"{len(releases) / more:,.0f} /s", f"{one / more:.2f} times one thread, wall clock")


def recording(ground: Ground, releases: Releases, repeats: int) -> None:
    print("\nRecording, one core, noel_2017")
    for level in ("ends", "impacts", "all"):
        work = lambda level=level: simulate(ground, releases, Settings("noel_2017"), record=level, threads=1)  # noqa: E731
        seconds, run = best(work, repeats)
        memory = 176e-6 * len(run.records) / len(releases)
        row(f"  {level}", f"{len(releases) / seconds:,.0f} /s", f"{1e5 * memory / 1e3:.2f} GB for 100,000 blocks")


def peak_memory(triangles: float) -> None:
    """Run in a child: prints the peak of a terrain with its index and 1000 blocks on it [GB]."""
    ground, releases = case(triangles, 1000)
    simulate(ground, releases, Settings("noel_2017"), record="ends")
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    print(int(status.split("VmHWM:")[1].split()[0]) / 1e6)


def first_run(triangles: float) -> None:
    """Run in a child: prints the CPU time that the first simulation takes beyond the second [s]."""
    ground, releases = case(triangles, 10)
    taken = [best(lambda: simulate(ground, releases, Settings("noel_2017")), 1)[0] for _ in range(2)]
    print(taken[0] - taken[1])


def child(what: str, *arguments: float, **environment: str) -> float:
    """The number that a function of this module prints in a process of its own."""
    command = [sys.executable, "-c", CHILD.format(what=what), str(Path(__file__).parent), *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | environment)
    return float(done.stdout.split()[-1])


def compilation() -> None:
    with tempfile.TemporaryDirectory() as folder:
        cold = child("first_run", 5000, NUMBA_CACHE_DIR=folder)
        warm = child("first_run", 5000, NUMBA_CACHE_DIR=folder)
    row("first simulation, compiled anew", f"{cold:.2f} s", "of CPU, once for all models; hidden in Blender")
    row("first simulation, kept code", f"{warm:.2f} s")


def beside_platrock(blocks: int, ground: Ground, releases: Releases, repeats: int) -> None:
    """PlatRock's classical rebound (R_n 0.35, R_t 0.85, roughness 0.1) on the same terrain: a grid of 1 m, spheres of
    0.3 m dropped from 2 m. Beside it the two of ours that are nearest to it, with the same numbers: constant R_N and
    R_T, without roughness, and CRSP, which has that roughness and takes less where blocks are quick or slip.
    """
    print("\nBeside PlatRock on 500,000 triangles")
    dropped = make_releases(releases.position + np.array([0.0, 0.0, DROP_M]), diameter_m=0.3)
    found = run_platrock(blocks)
    if found is None:
        return
    seconds, contacts, metres, _ = found
    note = f"{contacts:.0f} contacts and {metres:.0f} m each, {contacts / seconds:,.0f} contacts/s"
    row(f"{PLATROCK}, {blocks} blocks", f"{1 / seconds:.2f} /s", note)
    coefficients = {"rn": 0.35, "rt": 0.85}
    for name, more in (("azimi_desvarreux_1977", {}), ("pfeiffer_bowen_1989", {"roughness": 0.1})):
        ours, run = on_one_core(ground, dropped, Settings(name, coefficients | more), repeats)
        impacts, length = run.impacts.mean(), run.length_m.mean()
        note = (
            f"{impacts:.0f} contacts and {length:.0f} m each: {seconds / ours:,.0f} times PlatRock for a block, "
            f"{seconds / ours * length / metres:,.0f} times for a metre, "
            f"{seconds / ours * impacts / contacts:,.0f} times for a contact"
        )
        row(f"ours, one core, {name}", f"{1 / ours:,.0f} /s", note)


def run_platrock(blocks: int) -> tuple[float, float, float, float] | None:
    """Of a block: seconds, contacts, metres, and seconds of its maps; None, with the reason, where it does not run."""
    python = platrock_python()
    if python is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        volume = np.pi / 6 * 0.3**3
        np.savez(Path(folder, "case.npz"), z=heights(1.0), starts=starts(blocks), volume=volume)
        command = [str(python), str(Path(__file__).with_name("platrock_case.py")), folder]
        path = f"{python.parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"HOME": folder, "PATH": path})
    words = done.stdout.split("RESULT")
    if done.returncode or len(words) < 2:
        row("PlatRock", "did not run", (done.stderr or done.stdout).strip().splitlines()[-1][:90])
        return None
    seconds, contacts, metres, mapped = map(float, words[1].split()[:4])
    return seconds, contacts, metres, mapped


def platrock_python() -> Path | None:
    """The Python of PlatRock's environment, made when it is not there; None, with the reason, where it cannot be."""
    python = ENVIRONMENT / "bin" / "python"
    if (ENVIRONMENT / "ready").exists():
        return python.absolute()
    given = os.environ.get("PLATROCK_PYTHON")
    found = next(
        (name for name in (given, "python3.12", "python3.11", "python3.10") if name and shutil.which(name)), None
    )
    if found is None:
        row("PlatRock", "not measured", "it takes Python 3.10 to 3.12: say PLATROCK_PYTHON=/path/to/python3.12")
        return None
    shutil.rmtree(ENVIRONMENT, ignore_errors=True)
    for command in ([found, "-m", "venv", str(ENVIRONMENT)], [str(python), "-m", "pip", "install", "-q", PLATROCK]):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            row("PlatRock", "not measured", done.stderr.strip().splitlines()[-1][:90])
            return None
    (ENVIRONMENT / "ready").touch()
    return python.absolute()


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=5000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=os.process_cpu_count() or 1)
    parser.add_argument("--quick", action="store_true", help="fewer blocks, nothing of 10 million triangles")
    parser.add_argument("--no-platrock", action="store_true")
    arguments = parser.parse_args()
    blocks, repeats = (1000, 3) if arguments.quick else (arguments.blocks, arguments.repeats)
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    print(f"{os.process_cpu_count()} cores; load {load} in the last 1, 5, 15 minutes")
    compilation()
    ground, releases = case(5e5, blocks)
    models(ground, releases, repeats)
    contacts(ground, releases, repeats)
    creeping(repeats, blocks // 4)
    recording(ground, releases, repeats)
    larger_terrain(ground, releases, repeats, arguments.threads)
    if not arguments.quick:
        row("peak of 10 million triangles and their index", f"{child('peak_memory', 1e7):.2f} GB", "1,000 blocks")
    if not arguments.no_platrock:
        beside_platrock(5 if arguments.quick else 20, ground, releases, repeats)
    print(f"load at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
