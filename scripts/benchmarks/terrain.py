# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick the terrain is: loading, index, rays, closest points, normals, shading.

Rays and closest points are measured beside other libraries in the same run, where those can be imported.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rockfall.core.georeference import GlobalShift
from rockfall.core.terrain.orientation import block_scale_normals
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.shading import shade
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply

LOAD = """
import sys, time
start = time.perf_counter()
from rockfall.core.terrain.readers import read_terrain
surface = read_terrain(sys.argv[1])
seconds = time.perf_counter() - start
try:
    # Not getrusage, whose peak begins with that of the parent process.
    status = open("/proc/self/status").read()
    peak = int(status.split("VmHWM:")[1].split()[0]) / 1024
except (OSError, IndexError):
    peak = float("nan")
print(len(surface.faces), seconds, peak)
"""


def rough_slope(triangles: int, folded: bool = False) -> Surface:
    """A rough 35° slope of half-metre cells; folded, a part of it overhangs."""
    n = int((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.arange(n) * 0.5, np.arange(n) * 0.5)
    z = 0.7 * x + 5 * np.sin(x / 10) * np.cos(y / 7) + np.random.default_rng(0).normal(0, 0.1, x.shape)
    if folded:
        x = x + 3 * np.sin(z * 2)
    i = np.arange(n * n, dtype=np.int32).reshape(n, n)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.stack([np.stack([a, b, d], 1), np.stack([a, d, c], 1)], axis=1).reshape(-1, 3)
    shift = GlobalShift(2_600_000.0, 1_200_000.0, 0.0, "EPSG:2056")
    return Surface(np.stack([x, y, z], -1).reshape(-1, 3), faces, shift, "slope")


def seconds(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def row(what: str, value: str, note: str = "") -> None:
    print(f"{what:<44}{value:>16}  {note}")


def loading(triangles: int) -> None:
    for folded in (False, True):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "terrain.ply"
            write_ply(rough_slope(triangles, folded), path)
            command = [sys.executable, "-c", LOAD, str(path)]
            output = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
            what = f"load PLY, {int(output[0]) / 1e6:.1f} M triangles" + (", with overhangs" if folded else "")
            row(what, f"{float(output[1]):.2f} s", f"peak {float(output[2]):.0f} MB, with imports, in a child process")


def rays(surface: Surface, count: int) -> None:
    rng = np.random.default_rng(1)
    top = surface.bounds[1]
    origins = np.column_stack([rng.uniform(0, top[:2], (count, 2)), rng.uniform(top[2], top[2] + 200, count)])
    directions = np.column_stack([rng.normal(0, 0.3, (count, 2)), np.full(count, -1.0)])
    ours = seconds(lambda: cast_rays(surface, origins, directions)) / count
    hits = cast_rays(surface, origins, directions)
    row("rays, in any order", f"{ours * 1e6:.2f} µs each", f"{np.isfinite(hits.distance).mean():.0%} hit")
    near = hits.point[hits.face >= 0] + [0, 0, 0.4]
    closest = seconds(lambda: closest_points(surface, near)) / len(near)
    row("closest points", f"{closest * 1e6:.2f} µs each")
    few = 20_000
    for name, cast, find in (mathutils_tree(surface), trimesh_tree(surface)):
        if cast is None:
            row(f"  {name}", "not installed")
            continue
        part = few if name.startswith("mathutils") else 1_000
        other = seconds(lambda cast=cast, part=part: cast(origins[:part], directions[:part])) / part
        row(f"  rays with {name}", f"{other * 1e6:.2f} µs each", f"{other / ours:.1f} times ours")
        other = seconds(lambda find=find, part=part: find(near[:part])) / part
        row(f"  closest points with {name}", f"{other * 1e6:.2f} µs each", f"{other / closest:.1f} times ours")


def mathutils_tree(surface: Surface) -> tuple:
    try:
        import bpy  # noqa: F401  (without it mathutils has no bvhtree)
        from mathutils.bvhtree import BVHTree
    except ImportError:
        return "mathutils BVHTree", None, None
    tree = BVHTree.FromPolygons(surface.vertices.tolist(), surface.faces.tolist(), all_triangles=True)
    return (
        "mathutils BVHTree (float32)",
        lambda o, d: [tree.ray_cast(a, b) for a, b in zip(o.tolist(), d.tolist(), strict=True)],
        lambda p: [tree.find_nearest(a) for a in p.tolist()],
    )


def trimesh_tree(surface: Surface) -> tuple:
    try:
        import rtree  # noqa: F401
        import trimesh
    except ImportError:
        return "trimesh (with rtree)", None, None
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    mesh.ray.intersects_first(surface.vertices[:1], [[0.0, 0.0, 1.0]])
    return (
        "trimesh (with rtree)",
        lambda o, d: mesh.ray.intersects_location(o, d, multiple_hits=False),
        lambda p: trimesh.proximity.closest_point(mesh, p),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=float, default=1e6, help="of the surface for all but loading")
    parser.add_argument("--load-triangles", type=float, default=5e6)
    parser.add_argument("--rays", type=int, default=1_000_000)
    arguments = parser.parse_args()

    warm = rough_slope(500)
    compiling = seconds(lambda: block_scale_normals(warm, warm.vertices[:9], 1.0))
    compiling += seconds(lambda: cast_rays(warm, warm.vertices[:9], [0, 0, 1]))
    row("kernels ready", f"{compiling:.2f} s", "compiled once, then from the cache on disk")
    loading(int(arguments.load_triangles))

    surface = rough_slope(int(arguments.triangles))
    print(f"\nOn {len(surface.faces):,} triangles:")
    row("spatial index", f"{seconds(lambda: surface.index):.2f} s")
    row("neighbours and face normals", f"{seconds(lambda: (surface.neighbours, surface.face_normals)):.2f} s")
    rays(surface, arguments.rays)
    points = surface.vertices[np.random.default_rng(2).integers(0, len(surface.vertices), 10_000)]
    for radius in (1.5, 5.0):
        taken = seconds(lambda radius=radius: block_scale_normals(surface, points, radius))
        row(f"normals at block scale, radius {radius} m", f"{len(points) / taken:,.0f} /s", "half-metre cells")
    row(f"shading, {len(surface.vertices):,} vertices", f"{seconds(lambda: shade(surface)):.2f} s")


if __name__ == "__main__":
    main()
