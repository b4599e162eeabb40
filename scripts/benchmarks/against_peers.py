# SPDX-License-Identifier: GPL-3.0-or-later
"""Rockfall beside other libraries in one run: rays, closest points and tables, over growing sizes.

The peers (trimesh with embreex, open3d, pyarrow, polars) are installed into an environment of their own,
build/peers, each by itself; one that cannot be installed is left out, in words. Every measurement is a process of its
own on the same files: processor time of all threads, the least of several repetitions, and the greatest memory of the
process so far, input and compiled code included. Ratios are those of one run; embree computes in single precision.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PEERS = {"trimesh": ("trimesh", "embreex"), "open3d": ("open3d",), "pyarrow": ("pyarrow",), "polars": ("polars",)}
"""Name → what is installed for it."""
OURS = "rockfall"
RAYS = 100_000
STEPS = ("rays", "closest points", "one ray", "one closest point", "read impacts.csv", "write impacts.csv")
SINGLE = 300
type Row = tuple[str, int, str, str, float, float, float]
"""Step, size, of what, library, seconds of processor time of one thing, MB, ratio of our time to theirs."""


def mesh_file(path: Path, triangles: int) -> None:
    """Hills of about so many triangles, and rays and points above them."""
    n = round((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(0, 500, n), np.linspace(0, 500, n))
    rng = np.random.default_rng(1)
    z = 30 * np.sin(x / 70) * np.cos(y / 50) + rng.normal(0, 0.05, x.shape)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([first, first + 1, first + n + 1], 1), np.stack([first, first + n + 1, first + n], 1)]
    )
    origins = np.column_stack([rng.uniform(100, 400, (RAYS, 2)), np.full(RAYS, 100.0)])
    towards = rng.normal(0, 0.4, (RAYS, 3)) - [0, 0, 1]
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    near = points[rng.integers(0, len(points), RAYS)] + rng.normal(0, 0.5, (RAYS, 3))
    np.savez(path, points=points, faces=faces.astype(np.int32), origins=origins, towards=towards, near=near)


def steps_of(who: str, path: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """Step → what is done, and how many things it does."""
    if path.suffix == ".csv":
        return tables(who, path)
    found = np.load(path)
    points, faces, origins, towards, near = (found[k] for k in ("points", "faces", "origins", "towards", "near"))
    if who == OURS:
        from rockfall.core.georeference import GlobalShift
        from rockfall.core.terrain.raycast import cast_ray, cast_rays, closest_point, closest_points
        from rockfall.core.terrain.surface import Surface

        surface = Surface(points, faces, GlobalShift(), "hills")
        return {
            "rays": (lambda: cast_rays(surface, origins, towards), RAYS),
            "closest points": (lambda: closest_points(surface, near), RAYS),
            "one ray": (lambda: [cast_ray(surface, origins[i], towards[i]) for i in range(SINGLE)], SINGLE),
            "one closest point": (lambda: [closest_point(surface, near[i]) for i in range(SINGLE)], SINGLE),
        }
    if who == "trimesh":
        import trimesh

        mesh = trimesh.Trimesh(points, faces, process=False)
        return {
            "rays": (lambda: mesh.ray.intersects_first(origins, towards), RAYS),
            "one ray": (
                lambda: [mesh.ray.intersects_first(origins[i : i + 1], towards[i : i + 1]) for i in range(SINGLE)],
                SINGLE,
            ),
        }
    import open3d

    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(points.astype(np.float32), faces.astype(np.uint32))
    rays, spots = np.hstack([origins, towards]).astype(np.float32), near.astype(np.float32)
    return {
        "rays": (lambda: scene.cast_rays(open3d.core.Tensor(rays)), RAYS),
        "closest points": (lambda: scene.compute_closest_points(open3d.core.Tensor(spots)), RAYS),
        "one ray": (lambda: [scene.cast_rays(open3d.core.Tensor(rays[i : i + 1])) for i in range(SINGLE)], SINGLE),
        "one closest point": (
            lambda: [scene.compute_closest_points(open3d.core.Tensor(spots[i : i + 1])) for i in range(SINGLE)],
            SINGLE,
        ),
    }


def tables(who: str, path: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """Reading and writing the table; the peers check neither units nor plausibility."""
    out = path.with_name(f"{who}.csv")
    if who == OURS:
        from rockfall.core.exchange.tables import read_impacts, write_impacts

        impacts = read_impacts(path)
        read, write = (lambda: read_impacts(path)), (lambda: write_impacts(impacts, out))
        return {"read impacts.csv": (read, len(impacts)), "write impacts.csv": (write, len(impacts))}
    if who == "pyarrow":
        from pyarrow import csv

        table = csv.read_csv(path)
        read, write = (lambda: csv.read_csv(path)), (lambda: csv.write_csv(table, out))
        return {"read impacts.csv": (read, table.num_rows), "write impacts.csv": (write, table.num_rows)}
    import polars

    frame = polars.read_csv(path)
    read, write = (lambda: polars.read_csv(path)), (lambda: frame.write_csv(out))
    return {"read impacts.csv": (read, frame.height), "write impacts.csv": (write, frame.height)}


def greatest_memory_mb() -> float:
    """Of this process so far. What `resource` says begins with the memory of the process that started this one."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024 / 1e6
    return float("nan")


def measure(who: str, path: Path, repeats: int) -> None:
    """Print step → [seconds of processor time of one thing, MB] as JSON; the first repetition is not counted."""
    found = {}
    for step, (work, count) in steps_of(who, path).items():
        work()
        best = np.inf
        for _ in range(repeats):
            begin = time.process_time()
            work()
            best = min(best, time.process_time() - begin)
        found[step] = best / count, greatest_memory_mb()
    print(json.dumps(found))


def installed(place: Path) -> dict[str, str]:
    """Peer → the interpreter that has it; says which could not be installed."""
    python = str(place / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python"))
    if not Path(python).exists():
        venv.create(place, with_pip=True)
    there = {}
    for name, packages in PEERS.items():
        command = [python, "-m", "pip", "install", "-q", "numpy", *packages]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            print(f"{name} cannot be installed here, and is left out.")
        else:
            there[name] = python
    return there


def compared(path: Path, size: int, what: str, whom: dict[str, str], repeats: int) -> list[Row]:
    """What was measured on one file."""
    results = {}
    for who, python in whom.items():
        command = [python, __file__, "--measure", who, str(path), "--repeats", str(repeats)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{who} failed on {size:,} {what}: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
        else:
            results[who] = json.loads(done.stdout.splitlines()[-1])
    rows = []
    for step in STEPS:
        for who, found in results.items():
            if step in found and step in results.get(OURS, {}):
                rows.append((step, size, what, who, *found[step], results[OURS][step][0] / found[step][0]))
    return rows


def as_table(rows: list[Row]) -> str:
    """In Markdown."""
    lines = ["| step | size | library | each | process | ours / theirs |", "|---|---|---|---|---|---|"]
    for step, size, what, who, seconds, memory, ratio in rows:
        each = f"{1e6 * seconds:.2f} µs | {memory:.0f} MB | {ratio:.2f}"
        lines.append(f"| {step} | {size:,} {what} | {who} | {each} |")
    return "\n".join([*lines, ""])


def plot(rows: list[Row], path: Path) -> None:
    """Time of one thing, and memory below it, against size; a column for each step."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    steps = [step for step in STEPS if any(row[0] == step for row in rows)]
    figure = Figure(figsize=(3 * len(steps), 5.5), layout="constrained")
    axes = figure.subplots(2, len(steps), squeeze=False, sharex="col")
    libraries = list(dict.fromkeys(row[3] for row in rows))
    for column, step in enumerate(steps):
        for who in libraries:
            mine = [row for row in rows if row[0] == step and row[3] == who]
            look = {"color": f"C{libraries.index(who)}", "label": who}
            if mine:
                axes[0, column].loglog([row[1] for row in mine], [1e6 * row[4] for row in mine], "o-", **look)
                axes[1, column].loglog([row[1] for row in mine], [row[5] for row in mine], "o-", **look)
        for axis in axes[:, column]:
            low, high = axis.get_ylim()
            axis.set_ylim(low / 3, high * 3)
            axis.xaxis.set_minor_formatter(NullFormatter())
            axis.yaxis.set_minor_formatter(NullFormatter())
        axes[0, column].set_title(step)
        axes[0, column].legend(frameon=False)
        axes[1, column].set_xlabel(next(row[2] for row in rows if row[0] == step))
    axes[0, 0].set_ylabel("processor time of one [µs]")
    axes[1, 0].set_ylabel("memory of the process [MB]")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Measure all, print the table, and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=int, nargs="*", default=(100_000, 500_000, 1_000_000))
    parser.add_argument("--impacts", type=int, nargs="*", default=(1_000, 100_000, 1_000_000))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--peers", type=Path, default=ROOT / "build" / "peers", help="the environment of the peers")
    parser.add_argument("--out", type=Path, help="write the table here, as Markdown")
    parser.add_argument("--plot", type=Path, help="draw time and memory against size here")
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.measure[0], Path(arguments.measure[1]), arguments.repeats)
        return
    there = installed(arguments.peers)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for size in arguments.triangles:
            path = Path(folder) / "mesh.npz"
            mesh_file(path, size)
            whom = {OURS: sys.executable} | {name: there[name] for name in ("trimesh", "open3d") if name in there}
            rows += compared(path, size, "triangles", whom, arguments.repeats)
        for size in arguments.impacts:
            from analysis import made_impacts
            from rockfall.core.exchange.tables import write_impacts

            path = Path(folder) / "impacts.csv"
            write_impacts(made_impacts(size // 10, 10), path)
            whom = {OURS: sys.executable} | {name: there[name] for name in ("pyarrow", "polars") if name in there}
            rows += compared(path, size, "impacts", whom, arguments.repeats)
    print(as_table(rows))
    if arguments.out is not None:
        arguments.out.write_text(as_table(rows), encoding="utf-8")
    if arguments.plot is not None:
        plot(rows, arguments.plot)


if __name__ == "__main__":
    main()
