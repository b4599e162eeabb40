# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frame of simulated blocks takes: Blender's evaluation, in a scene without anything else, and showing them.

Blender as a module is needed: the bpy wheel. With --window, in a real Blender, also a redraw with and without both:

    blender --factory-startup --addons bl_ext.user_default.rockfall --python THIS_FILE -- --window 1000 10000
"""

import argparse
import importlib
import statistics
import sys
import time

import bpy
import numpy as np

FLIGHTS, BOUNCE_S = 30, 0.8
FRAMES = 40


def part(name: str) -> object:
    package = "bl_ext.user_default.rockfall" if bpy.app.binary_path else "rockfall"
    return importlib.import_module(f"{package}.{name}")


def falls(runs: int) -> object:
    """Blocks that bounce down a plane, each 30 times."""
    rng = np.random.default_rng(1)
    k = runs * FLIGHTS
    number = np.tile(np.arange(FLIGHTS), runs)
    start = number * BOUNCE_S
    position = np.column_stack([4.0 * start, np.repeat(rng.uniform(0, 100, runs), FLIGHTS), 120.0 - 3.0 * start])
    velocity = np.tile([4.0, 0.0, -3.0 + 0.5 * 9.81 * BOUNCE_S], (k, 1))
    return part("core.simulation.parabolas").Parabolas(
        np.repeat(np.arange(runs), FLIGHTS), start, np.full(k, BOUNCE_S), position, velocity,
        np.tile([0.0, 0.0, -9.81], (k, 1)), rng.normal(0, 8, (k, 3)),
    )  # fmt: skip


def show(scene: bpy.types.Scene, runs: int) -> None:
    simulation, paths = (
        part("rockfall_addon.scene.simulation.simulation"),
        part("rockfall_addon.scene.simulation.simulated_paths"),
    )
    parabolas = falls(runs)
    lines = part("core.simulation.parabolas").polylines_of(parabolas, paths.LINE_TOLERANCE_M)
    figures = {name: np.ones(runs) for name in paths.FIGURES} | {"release": np.zeros(runs)}
    drawn = paths.Paths(np.bincount(lines.run), lines.position, lines.time_s, lines.speed_mps, figures, ("stopped",))
    attributes = simulation.attributes_of(parabolas, np.zeros(runs, int), np.full((runs, 3), 0.5))
    simulation.show_prepared(scene, [simulation.Prepared("noel_2017", ["line"], parabolas.position, attributes, drawn)])


def median_ms(work: object, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        before = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - before))
    return statistics.median(times)


def evaluation(scene: bpy.types.Scene, frames: int) -> float:
    """Median time of a change of the frame [ms]."""
    numbers = iter(range(1, 10 * frames))
    return median_ms(lambda: scene.frame_set(next(numbers) % 500), frames)


def redraw(frames: int) -> float:
    """Median time of drawing the window once [ms]."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        return median_ms(lambda: bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1), frames)


def measure(options: argparse.Namespace) -> None:
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    print(f"empty scene: {evaluation(scene, FRAMES):.2f} ms a frame")
    for runs in options.runs:
        print(f"{runs} runs of {FLIGHTS} flights: shown in {median_ms(lambda n=runs: show(scene, n), 1) / 1000:.2f} s")
        print(f"   {evaluation(scene, FRAMES):.2f} ms a frame")
        if options.window:
            settings = scene.rockfall_simulation
            for blocks, paths in ((False, False), (True, False), (False, True), (True, True)):
                settings.show_blocks, settings.show_paths = blocks, paths
                scene.frame_set(200)
                redraw(2)
                print(f"   redraw, blocks {blocks}, paths {paths}: {redraw(10):.1f} ms")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=int, nargs="*", default=[1_000, 10_000, 100_000])
    parser.add_argument("--window", action="store_true")
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    options = parser.parse_args(arguments)
    if not bpy.app.binary_path:
        import rockfall

        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
        bpy.context.preferences.addons.new().module = "rockfall"
        rockfall.register()
        measure(options)
        return

    def in_window() -> None:
        measure(options)
        bpy.ops.wm.quit_blender()

    bpy.app.timers.register(in_window, first_interval=2.0)


if __name__ == "__main__":
    main()
