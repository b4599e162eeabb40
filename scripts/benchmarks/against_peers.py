# SPDX-License-Identifier: GPL-3.0-or-later
"""Rockfall beside other libraries in one run: terrain, tables, cameras, timestamps and tracks, over growing sizes.

The peers (trimesh with embreex, open3d, laspy, SciPy, OpenCV, pyarrow, polars) are installed into an environment of
their own, build/peers, each by itself; one that cannot be installed is left out, in words, and so is ffprobe where the
system has none. Every measurement is a process of its own on the same files: processor time of all threads and of what
it starts, the least of several repetitions, and the greatest memory of the process so far, input and compiled code
included. Ratios are those of one run.

What the peers do not do: embree computes in single precision; laspy reads and meshes nothing, SciPy's Delaunay looks
for no overhangs, loose parts or edges too long; solvePnP is told the lens; CSRT gives a box of the first frame's kind,
no outline and no background; the readers of tables know no units.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
PEERS = {
    "trimesh": ("trimesh", "embreex"),
    "open3d": ("open3d",),
    "laspy": ("laspy",),
    "scipy": ("laspy", "scipy"),
    "opencv": ("opencv-contrib-python-headless",),
    "pyarrow": ("pyarrow",),
    "polars": ("polars",),
}
"""Name → what is installed for it."""
OURS = "rockfall"
FFPROBE = "ffprobe"
WHO = {
    "triangles": ("trimesh", "open3d"),
    "points": ("laspy", "scipy"),
    "pairs": ("opencv",),
    "frames": (FFPROBE, "opencv"),
    "impacts": ("pyarrow", "polars"),
}
"""Of what a size is → those who do the same with it."""
RAYS = 100_000
STEPS = (
    "rays",
    "closest points",
    "one ray",
    "one closest point",
    "a cloud meshed",
    "a camera solved again",
    "a camera from nothing",
    "timestamps",
    "a track from the file",
    "read impacts.csv",
    "write impacts.csv",
)
SHOWN = 1_000_000
LONG_S = 3.0
"""What takes longer is repeated once."""
FOOTAGE = ROOT / "assets" / "demo" / "footage"
MARK = "<!-- beside other libraries: written by scripts/benchmarks/against_peers.py -->"
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
    others = {".csv": tables, ".las": clouds, ".npy": cameras, ".mp4": films}
    if path.suffix in others:
        return others[path.suffix](who, path)
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


def cloud_file(path: Path, points: int) -> None:
    """A LAS file of hills, points anywhere in plan."""
    import laspy

    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, (points * 0.5) ** 0.5, (2, points))
    cloud = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
    cloud.header.scales = [0.001] * 3
    cloud.x, cloud.y, cloud.z = x, y, 30 * np.sin(x / 70) * np.cos(y / 50)
    cloud.write(path)


def clouds(who: str, path: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """From the file to a surface; laspy to the points alone."""
    import laspy

    if who == OURS:
        from rockfall.core.terrain.readers import read_terrain

        return {"a cloud meshed": (lambda: read_terrain(path), laspy.read(path).header.point_count)}
    work = (lambda: laspy.read(path).xyz) if who == "laspy" else (lambda: triangles_of(laspy.read(path).xyz))
    return {"a cloud meshed": (work, laspy.read(path).header.point_count)}


def triangles_of(points: np.ndarray) -> object:
    """SciPy's Delaunay triangulation in plan."""
    from scipy.spatial import Delaunay

    return Delaunay(points[:, :2] - points[:, :2].mean(axis=0)).simplices


def pairs_file(path: Path, pairs: int) -> None:
    """Pixels and points (n, 5) of a camera 60 m from a slope."""
    from rockfall.core.camera.model import look_at, project

    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-20, 20, pairs), rng.uniform(-10, 10, pairs), rng.uniform(0, 25, pairs)])
    camera = look_at(1920, 1080, (0.0, -60.0, 15.0), (0.0, 0.0, 12.0), focal_px=1600.0)
    pixels = project(camera, points) + rng.normal(0, 0.5, (pairs, 2))
    np.save(path, np.hstack([pixels, points]))


def cameras(who: str, path: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """The pose, near one that is known to 0.5 m and from nothing; ours with the focal length, its errors and advice."""
    found = np.load(path)
    pixels, points = np.ascontiguousarray(found[:, :2]), np.ascontiguousarray(found[:, 2:])
    if who == OURS:
        from dataclasses import replace

        from rockfall.core.camera.resection.resect import resect

        last = resect(pixels, points, 1920, 1080).camera
        near = replace(last, position=last.position + np.array([0.3, -0.3, 0.2]))
        return {
            "a camera solved again": (lambda: resect(pixels, points, 1920, 1080, camera=near), 1),
            "a camera from nothing": (lambda: resect(pixels, points, 1920, 1080), 1),
        }
    import cv2

    lens = np.array([[1600.0, 0, 960], [0, 1600, 540], [0, 0, 1]])
    _, turn, place = cv2.solvePnP(points, pixels, lens, None)
    begin = place + np.array([[0.3], [0.2], [0.3]])
    return {
        "a camera solved again": (
            lambda: cv2.solvePnP(points, pixels, lens, None, turn.copy(), begin.copy(), useExtrinsicGuess=True),
            1,
        ),
        "a camera from nothing": (lambda: cv2.solvePnP(points, pixels, lens, None, flags=cv2.SOLVEPNP_SQPNP), 1),
    }


def films(who: str, path: Path) -> dict[str, tuple[Callable[[], object], int]]:
    """The true timestamps of all frames, and a block followed from a click to the end, decoding included."""
    click = np.atleast_1d(
        np.genfromtxt(FOOTAGE / "clicks.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    )[0]
    frame, u, v = int(click["frame"]), float(click["u_px"]), float(click["v_px"])
    if who == OURS:
        from rockfall.core.footage.background import background_motion
        from rockfall.core.footage.sources import kept
        from rockfall.core.footage.tracking import track_block
        from rockfall.core.footage.video import open_video

        frames = open_video(path).frames

        def track() -> object:
            source = kept(open_video(path), 0, frames - 1)
            return track_block(source, frame, (u, v), background=background_motion(source)[0])

        return {"timestamps": (lambda: open_video(path), frames), "a track from the file": (track, frames)}
    if who == FFPROBE:
        command = [FFPROBE, "-v", "error", "-select_streams", "v:0", "-show_entries", "packet=pts_time"]
        command += ["-of", "csv", str(path)]
        frames = len(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split())
        return {"timestamps": (lambda: subprocess.run(command, capture_output=True, check=True), frames)}
    import cv2

    def follow() -> int:
        film, tracker, number = cv2.VideoCapture(str(path)), cv2.TrackerCSRT.create(), 0
        while True:
            there, picture = film.read()
            if not there:
                return number
            if number == frame:
                tracker.init(picture, (round(u) - 10, round(v) - 10, 20, 20))
            elif number > frame:
                tracker.update(picture)
            number += 1

    return {"a track from the file": (follow, follow())}


def processor_s() -> float:
    """Of this process and of those it started that have ended."""
    ended = os.times()
    return time.process_time() + ended.children_user + ended.children_system


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
        begin = time.perf_counter()
        work()
        often = 1 if time.perf_counter() - begin > LONG_S else repeats
        best = np.inf
        for _ in range(often):
            inside = 20 if who == FFPROBE else 1  # the time of other processes comes in hundredths of a second
            begin = processor_s()
            for _ in range(inside):
                work()
            best = min(best, (processor_s() - begin) / inside)
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
    if shutil.which(FFPROBE):
        there[FFPROBE] = sys.executable
    else:
        print("ffprobe is not on this system, and is left out.")
    return there


ONE_THREAD = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
"""Of linear algebra, as Rockfall's commands have it: threads that wait count as work. All else has all cores."""


def compared(path: Path, size: int, what: str, whom: dict[str, str], repeats: int) -> list[Row]:
    """What was measured on one file."""
    results = {}
    for who, python in whom.items():
        command = [python, __file__, "--measure", who, str(path), "--repeats", str(repeats)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=ONE_THREAD)
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
        each = f"{in_words(seconds)} | {memory:.0f} MB | {'' if who == OURS else f'{ratio:.2f}'}"
        lines.append(f"| {step} | {size:,} {what} | {who} | {each} |")
    return "\n".join([*lines, ""])


def in_words(seconds: float) -> str:
    """With a unit that leaves three digits."""
    size, unit = next(((size, unit) for size, unit in ((1.0, "s"), (1e-3, "ms")) if seconds >= size), (1e-6, "µs"))
    return f"{seconds / size:.3g} {unit}"


def into_page(path: Path, rows: list[Row]) -> None:
    """Replace what stands between the two marks of a page by the table of the largest things up to a million."""
    largest = {row[2]: max(other[1] for other in rows if other[2] == row[2] and other[1] <= SHOWN) for row in rows}
    rows = [row for row in rows if row[1] == largest[row[2]]]
    before, _, after = path.read_text(encoding="utf-8").split(MARK)
    path.write_text(f"{before}{MARK}\n{as_table(rows)}{MARK}{after}", encoding="utf-8")


def plot(rows: list[Row], path: Path) -> None:
    """Time of one thing, and memory below it, against size; a column for each step of several sizes."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    steps = [step for step in STEPS if len({row[1] for row in rows if row[0] == step}) > 1]
    if not steps:
        return
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


def impacts_file(path: Path, impacts: int) -> None:
    """A table of so many impacts."""
    from analysis import made_impacts
    from rockfall.core.exchange.tables import write_impacts

    write_impacts(made_impacts(impacts // 10, 10), path)


def whom(what: str, there: dict[str, str]) -> dict[str, str]:
    """Ours and the peers for a kind of thing that are there, with their interpreters."""
    return {OURS: sys.executable} | {name: there[name] for name in WHO[what] if name in there}


def main() -> None:
    """Measure all, print the table, and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=int, nargs="*", default=(100_000, 500_000, 1_000_000, 5_000_000))
    parser.add_argument("--impacts", type=int, nargs="*", default=(1_000, 100_000, 1_000_000))
    parser.add_argument("--points", type=int, nargs="*", default=(100_000, 1_000_000))
    parser.add_argument("--pairs", type=int, nargs="*", default=(12,))
    parser.add_argument("--no-film", action="store_true", help="neither timestamps nor tracks")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--peers", type=Path, default=ROOT / "build" / "peers", help="the environment of the peers")
    parser.add_argument("--out", type=Path, help="write the table here, as Markdown")
    parser.add_argument("--page", type=Path, help="replace the table between the marks of this page, as of README.md")
    parser.add_argument("--plot", type=Path, help="draw time and memory against size here")
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.measure[0], Path(arguments.measure[1]), arguments.repeats)
        return
    there = installed(arguments.peers)
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        made = {"triangles": ("mesh.npz", mesh_file), "points": ("cloud.las", cloud_file)}
        made |= {"pairs": ("pairs.npy", pairs_file), "impacts": ("impacts.csv", impacts_file)}
        for what, (name, make) in made.items():
            for size in getattr(arguments, what):
                path = Path(folder) / name
                make(path, size)
                rows += compared(path, size, what, whom(what, there), arguments.repeats)
        film = FOOTAGE / "footage.mp4"
        if film.exists() and not arguments.no_film:
            from rockfall.core.footage.video import open_video

            rows += compared(film, open_video(film).frames, "frames", whom("frames", there), arguments.repeats)
    print(as_table(rows))
    if arguments.out is not None:
        arguments.out.write_text(as_table(rows), encoding="utf-8")
    if arguments.page is not None:
        into_page(arguments.page, rows)
    if arguments.plot is not None:
        plot(rows, arguments.plot)


if __name__ == "__main__":
    main()
