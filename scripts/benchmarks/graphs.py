# SPDX-License-Identifier: GPL-3.0-or-later
"""How quickly the editor of graphs draws, and follows a slider: 103 and 10 000 impacts with six models, 100 000 alone.

Runs in the window of a real Blender, found as by interface_tests.py. Without a graphics card the window is drawn by
software, which takes most of the time. "drawing" is the processor time of the thread that draws, "whole" what a person
waits for.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODELS = 6
CASES = ((103, MODELS), (10_000, MODELS), (100_000, 0))
FRAMES = 8
ROW = "row: "
HEADER = f"{'impacts':>8} {'models':>6} {'what':<34} {'drawing':>9} {'whole':>9}"


def row(impacts: int, models: int, what: str, drawing: float, whole: float) -> None:
    print(f"{ROW}{impacts:>8} {models:>6} {what:<34} {1e3 * drawing:>6.1f} ms {1e3 * whole:>6.1f} ms", flush=True)


def tiled(impacts, count):
    """A table of so many impacts, the same falls again and again under other names, a little apart."""
    import numpy as np

    place = np.arange(count) % len(impacts)
    rng = np.random.default_rng(3)

    def column(values):
        values = values[place]
        return values * rng.normal(1.0, 0.05, values.shape) if values.dtype.kind == "f" else values

    names = np.char.add(np.char.add(impacts.trajectory[place].astype(str), "-"), (place * 0).astype(str))
    names = np.char.add(names, (np.arange(count) // len(impacts)).astype(str))
    found = {
        name: column(getattr(impacts, name))
        for name in impacts.__dataclass_fields__
        if isinstance(getattr(impacts, name), np.ndarray)
    }
    found |= {"normal": impacts.normal[place], "trajectory": names}
    found["time_s"] = impacts.time_s[place]
    return replace(
        impacts,
        **found,
        flags={name: mask[place] for name, mask in impacts.flags.items()},
        sigma={name: values[place] for name, values in impacts.sigma.items()},
        extra={name: values[place] for name, values in impacts.extra.items()},
    )


def case_graphs(window):
    """Draw each table again and again, and move a slider."""
    import bpy

    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 2.0
    scene = bpy.context.scene
    comparison = window.part("rockfall_addon.scene.models.comparison")
    editor = window.part("rockfall_addon.view.graphs.editor")
    sheet = window.part("rockfall_addon.view.graphs.impact_sheet")
    find_courses = window.part("core.analysis.courses").find_courses
    names = window.part("rockfall_addon.scene.models.models").ORDER[:MODELS]
    demo = comparison.measured_of(scene).impacts
    area = window.area("NODE_EDITOR")
    region = next(one for one in area.regions if one.type == "WINDOW")
    taken: list[float] = []
    kept = sheet.draw

    def timed(context, canvas):
        start = time.thread_time()
        kept(context, canvas)
        taken.append(time.thread_time() - start)

    content = editor._contents[editor.IMPACTS]
    editor._contents[editor.IMPACTS] = replace(content, draw=timed)

    def draw() -> tuple[float, float]:
        taken.clear()
        start = time.perf_counter()
        with bpy.context.temp_override(window=window.window, area=area, region=region):
            region.tag_redraw()
            bpy.ops.wm.redraw_timer(type="DRAW", iterations=1)
        return sum(taken), time.perf_counter() - start

    for count, models in CASES:
        table = tiled(demo, count)
        measured = comparison.Measured(table, ("",) * count, find_courses(table, "rolling"))
        comparison._measure = lambda scene, measured=measured: measured
        comparison.measured_key = lambda scene, count=count: count
        scene.rockfall_comparison.models = set(names[:models])
        first = draw()
        graph = sheet.drawn_graph(scene, 0)
        assert sum(one.series.row.size for one in graph.measured) == count, "it shows another table"
        row(count, models, "drawn first", *first)
        again = [draw() for _ in range(FRAMES)]
        row(count, models, "drawn again", *(statistics.median(one) for one in zip(*again, strict=True)))
        canvas = editor._canvases[region.as_pointer()]
        frame = canvas.frames[0]
        start = time.perf_counter()
        for i in range(20):
            canvas.graph, canvas.part = 0, "plot"
            canvas.pointer = (frame.plot.left + 5.0 * i, frame.plot.bottom + 20.0)
            with bpy.context.temp_override(window=window.window, area=area, region=region):
                sheet.point(bpy.context, canvas)
        pointing = (time.perf_counter() - start) / 20
        row(count, models, "point under the mouse", pointing, pointing)
        if not models:
            continue
        group = scene.rockfall_parameters.noel_2017
        parameters = window.part("core.impact_models.registry").MODELS["noel_2017"].parameters
        spec = next(one for one in parameters if not one.choices)
        before = getattr(group, spec.name)
        moved = []
        for i in range(FRAMES):
            start, begun = time.perf_counter(), time.thread_time()
            setattr(group, spec.name, before * (1 + 0.01 * i))
            set_s, set_thread_s = time.perf_counter() - start, time.thread_time() - begun
            drawing, whole = draw()
            moved.append((set_thread_s + drawing, set_s + whole))
        row(count, models, f"slider {spec.name} moved", *(statistics.median(one) for one in zip(*moved, strict=True)))
        setattr(group, spec.name, before)


def main() -> int:
    sys.path.insert(0, str(ROOT / "scripts"))
    import interface_tests

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds that it may take")
    options = parser.parse_args()
    blender = interface_tests.find_blender()
    if "BLENDER_USER_RESOURCES" not in os.environ:
        interface_tests.use_checkout(blender)
    command = interface_tests.command(blender, [(Path(__file__), "case_graphs")], options.timeout)
    done = subprocess.run(
        command, cwd=ROOT, timeout=options.timeout + interface_tests.START_S, text=True, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    if done.returncode:
        print(f"{done.stdout}\nBlender ended with status {done.returncode}")
        return 1
    print(HEADER)
    print("\n".join(line.removeprefix(ROW) for line in done.stdout.splitlines() if line.startswith(ROW)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
