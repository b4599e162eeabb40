# SPDX-License-Identifier: GPL-3.0-or-later
"""How quickly the trajectories follow a pick that is dragged: one edit, beside computing and showing all again.

Blender as a module is needed: the bpy wheel.
"""

import argparse
import cProfile
import importlib
import pstats
import statistics
import time
from collections.abc import Callable

import bpy
import numpy as np

SLOPE = 0.7


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 120.0 - SLOPE * x + 0.3 * np.sin(1.7 * x) * np.cos(1.3 * y)


def make_terrain(triangles: int) -> object:
    from rockfall.core.georeference import GlobalShift
    from rockfall.core.terrain.surface import Surface

    side = int((triangles / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.linspace(-5, 165, side), np.linspace(-60, 60, side), indexing="ij")
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + side, corner + side + 1], 1), np.stack([corner, corner + side + 1, corner + 1], 1)]
    )
    vertices = np.column_stack([x.ravel(), y.ravel(), hill(x, y).ravel()])
    return Surface(vertices, faces.astype(np.int32), GlobalShift(), "hill")


def make_picks(trajectories: int, impacts: int) -> object:
    from rockfall.core.reconstruction.picks import make_picks

    rng = np.random.default_rng(3)
    names, times, places = [], [], []
    for run in range(trajectories):
        step = rng.uniform(0.6, 1.4, impacts)
        x = np.cumsum(step * 13.0) * 150.0 / (14.0 * impacts)
        y = -50.0 + 100.0 * run / trajectories + np.cumsum(rng.normal(0, 0.3, impacts))
        names += [f"run {run + 1}"] * impacts
        times += (30.0 * run + np.cumsum(step)).tolist()
        places += np.column_stack([x, y, hill(x, y)]).tolist()
    return make_picks(names, times, places, sigma_position_m=[0.05] * len(names))


def timed(work: Callable[[], object], repeats: int) -> tuple[list[float], list[float]]:
    """Times of some runs [ms], on the wall and of this thread's processor, which other work on the machine spares."""
    wall, processor = [], []
    for _ in range(repeats):
        start, busy = time.perf_counter(), time.thread_time()
        work()
        wall.append(1e3 * (time.perf_counter() - start))
        processor.append(1e3 * (time.thread_time() - busy))
    return wall, processor


def said(taken: tuple[list[float], list[float]]) -> str:
    wall, processor = taken
    return (
        f"median {statistics.median(wall):6.1f} ms, best {min(wall):6.1f} ms, "
        f"processor {statistics.median(processor):6.1f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trajectories", type=int, default=20)
    parser.add_argument("--impacts", type=int, default=10)
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--edits", type=int, default=60)
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    package = importlib.import_module("rockfall")
    bpy.context.preferences.addons.new().module = "rockfall"
    package.register()
    parts = {
        name: importlib.import_module(f"rockfall.rockfall_addon.scene.{room}.{name}")
        for room, name in (
            ("footage", "sync"),
            ("picks", "picks"),
            ("picks", "reconstruction"),
            ("terrain", "terrain"),
        )
    }
    from rockfall.core.terrain.shading import shade

    scene = bpy.context.scene
    surface = make_terrain(options.triangles)
    parts["terrain"].add_terrain(scene, surface, shade(surface))
    made = make_picks(options.trajectories, options.impacts)
    start = time.perf_counter()
    parts["reconstruction"].show(scene, parts["reconstruction"].reconstruct_scene(scene, made))
    bpy.context.view_layer.update()
    print(
        f"{len(surface.faces)} triangles, {options.trajectories} trajectories of {options.impacts} impacts: "
        f"first time {time.perf_counter() - start:.1f} s, with the index of the terrain"
    )

    live = parts["sync"]
    objects = sorted(
        parts["picks"].objects_of(scene, ["run 7" if options.trajectories > 6 else "run 1"]), key=lambda o: o.name
    )
    pick = objects[len(objects) // 2]
    place = np.array(pick.location)
    step = [0]

    def dragged() -> None:
        """As a person drags: the picks are read where they are, nothing is written to them."""
        step[0] += 1
        pick.location = place + np.array([0.02 * np.sin(step[0]), 0.3 * np.sin(0.1 * step[0]), 0.0])
        live.sync(scene, [pick["rockfall_trajectory"]], dragging=True)

    def edited() -> None:
        """As with one change that is kept: snapped to the terrain, keyed, told."""
        step[0] += 1
        pick.location = place + np.array([0.02 * np.sin(step[0]), 0.3 * np.sin(0.1 * step[0]), 0.0])
        live.sync(scene, [pick["rockfall_trajectory"]])

    def shown(work: Callable[[], None]) -> Callable[[], None]:
        def both() -> None:
            work()
            bpy.context.view_layer.update()  # what Blender computes of the changed objects

        return both

    for name, function in (("dragged", dragged), ("edited", edited)):
        live.is_dragging = lambda held=name == "dragged": held
        function()
        if options.profile:
            profile = cProfile.Profile()
            profile.enable()
            for _ in range(20):
                function()
            profile.disable()
            pstats.Stats(profile).sort_stats("cumulative").print_stats(28)
        print(f"one pick {name}:                {said(timed(function, options.edits))}")
        bpy.context.view_layer.update()
        print(f"  and evaluated by Blender:      {said(timed(shown(function), options.edits))}")
    edit = statistics.median(timed(edited, options.edits)[0])

    def everything() -> None:
        parts["reconstruction"].refresh(scene)

    everything()
    taken = timed(everything, 8)
    print(f"all trajectories again:          {said(taken)}")
    print(f"  that is {statistics.median(taken[0]) / edit:.1f} times as long as one edit")
    taken = timed(shown(everything), 8)
    print(f"  and evaluated by Blender:      {said(taken)}")


if __name__ == "__main__":
    main()
