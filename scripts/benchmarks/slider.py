# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a frame takes while a person drags a model's parameter beside the graphs: the demo, and 10 000 impacts.

Runs in the window of a real Blender, found as by interface_tests.py, with simulated events: a frame lasts from the
mouse's event until Blender has drawn the window and asks for the next one. Without a graphics card the window is drawn
by software, which takes most of the time: the same window with nothing in it is measured, too. "main thread" is the
processor's time of the thread that computes and asks for drawings, "all threads" with those that draw.

Six models; those of the demo have their blocks in the 3-D view. The blocks of 10 000 impacts follow as soon as the
slider rests; here they have none.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "benchmarks"))

MODEL, PARAMETER, MODELS, IMPACTS = "noel_2017", "rt", 6, 10_000
FRAMES = 90
DATA, BLOCKS, EVALUATION, GRAPHS, REST = "data", "3-D blocks", "Blender's evaluation", "graphs", "the rest"
PARTS = (DATA, BLOCKS, EVALUATION, GRAPHS, REST)
KINDS = ("wall", "main thread", "all threads")
ROW = "row: "
HEADS = ("median", "95 %", *PARTS)
WIDTHS = tuple(max(len(head) + 2, 8) for head in HEADS)
HEADER = " " * 47 + "".join(f"{head:>{width}}" for head, width in zip(HEADS, WIDTHS, strict=True))


class Parts:
    """What the parts of a frame have taken [s], each without those that it calls: of each of `KINDS`."""

    def __init__(self) -> None:
        self.taken = {part: [0.0] * len(KINDS) for part in PARTS}
        self.stack: list[str] = []
        self.since = self.now()

    @staticmethod
    def now() -> tuple[float, ...]:
        return time.perf_counter(), time.thread_time(), time.process_time()

    def count(self) -> None:
        """Give the time since the last change to the part that runs."""
        now = self.now()
        for i in range(len(KINDS)):
            self.taken[self.stack[-1] if self.stack else REST][i] += now[i] - self.since[i]
        self.since = now

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        self.begin(name)
        try:
            yield
        finally:
            self.end()

    def begin(self, name: str) -> None:
        self.count()
        self.stack.append(name)

    def end(self) -> None:
        self.count()
        if self.stack:
            self.stack.pop()

    def frame(self) -> dict[str, list[float]]:
        """What has been taken since the last call."""
        self.count()
        taken, self.taken = self.taken, {part: [0.0] * len(KINDS) for part in PARTS}
        return taken

    def watch(self, owner: object, name: str, part: str) -> Callable[[], None]:
        """Count a function to a part; what is given back ends it."""
        kept = getattr(owner, name)

        def counted(*given: object, **named: object) -> object:
            with self.part(part):
                return kept(*given, **named)

        setattr(owner, name, counted)
        return lambda: setattr(owner, name, kept)


def tell(what: str, frames: list[dict[str, list[float]]]) -> None:
    """A row for each kind of time."""
    for i, kind in enumerate(KINDS):
        whole = sorted(1e3 * sum(taken[i] for taken in frame.values()) for frame in frames)
        parts = [1e3 * statistics.median(frame[part][i] for frame in frames) for part in PARTS]
        cells = [statistics.median(whole), whole[len(whole) * 95 // 100], *parts]
        numbers = "".join(f"{cell:>{width}.1f}" for cell, width in zip(cells, WIDTHS, strict=True))
        print(f"{ROW}{what if not i else '':<34}{kind:<13}{numbers}", flush=True)


def find_slider(window, name: str):
    """Where in the window the sidebar has the slider of a parameter: pixels of its middle, left end and right end."""
    import bpy

    area = window.area("NODE_EDITOR")
    sidebar = window.region("UI", "NODE_EDITOR")

    def pointed() -> str:
        with bpy.context.temp_override(window=window.window, area=area, region=sidebar):
            found = bpy.context.property
        return "" if found is None else found[1]

    x = sidebar.x + sidebar.width // 2
    for y in range(sidebar.y + sidebar.height - 10, sidebar.y + 5, -9):
        window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
        yield 0.05
        if pointed().endswith(name):
            return x, y
    raise AssertionError(f"the sidebar has no slider {name}")


def drag(window, parts: Parts, place: tuple[int, int], moved: Callable[[], object]):
    """Drag a slider to and fro, an event for each frame; the frames in which the value changed."""
    x, y = place
    found, reach = [], 60
    window.window.event_simulate(type="LEFTMOUSE", value="PRESS", x=x, y=y)
    yield 0.3
    way = [x - i for i in range(1, reach)] + [x - reach + i for i in range(2 * reach)]
    way = (way + [x + reach - i for i in range(reach)])[: FRAMES + 30]
    for i, at in enumerate(way):
        before = moved()
        parts.frame()
        window.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=at, y=y)
        yield 0.0
        frame = parts.frame()
        if moved() != before and i >= 10:
            found.append(frame)
    window.window.event_simulate(type="LEFTMOUSE", value="RELEASE", x=way[-1], y=y)
    yield 0.5
    assert len(found) > FRAMES // 2, f"the slider has moved {len(found)} times only"
    return found


def redraw(window, parts: Parts):
    """Draw the editors again that a slider draws again, with nothing changed."""
    found = []
    for _ in range(FRAMES // 2):
        parts.frame()
        for area in window.window.screen.areas:
            if area.type in ("NODE_EDITOR", "VIEW_3D"):
                area.tag_redraw()
        yield 0.0
        found.append(parts.frame())
    return found


def case_slider(window):
    """The empty window, the demo, many impacts."""
    import bpy
    from graphs import tiled

    with window.override():
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 1.0
    space = window.area("NODE_EDITOR").spaces.active
    space.show_region_ui = True
    yield 1.0
    window.region("UI", "NODE_EDITOR").active_panel_category = "Rockfall"
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    yield 1.0
    parts = Parts()
    tell("empty window, drawn again", (yield from redraw(window, parts)))

    with window.override():
        assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
    yield 2.0
    scene = bpy.context.scene
    comparison = window.part("rockfall_addon.scene.models.comparison")
    sheet = window.part("rockfall_addon.view.graphs.impact_sheet")
    names = window.part("rockfall_addon.scene.models.models").ORDER[:MODELS]
    scene.rockfall_comparison.models = {MODEL}
    yield 1.0  # its parameters are unfolded now, and stay so with other models
    scene.rockfall_comparison.models = {MODEL, *names}
    assert len(scene.rockfall_comparison.models) == MODELS
    with window.override():
        assert bpy.ops.rockfall.show_models(models=set(scene.rockfall_comparison.models)) == {"FINISHED"}
    yield 3.0
    watch(window, parts)
    group = scene.rockfall_parameters.noel_2017

    def value() -> float:
        return float(getattr(group, PARAMETER))

    for what, count in ((f"{len(comparison.measured_of(scene).impacts)} impacts", 0), (f"{IMPACTS} impacts", IMPACTS)):
        if count:
            table = tiled(comparison.measured_of(scene).impacts, count)
            find_courses = window.part("core.analysis.courses").find_courses
            measured = comparison.Measured(table, ("",) * count, find_courses(table, "rolling"))
            comparison._measure = lambda scene, measured=measured: measured
            comparison.measured_key = lambda scene: IMPACTS
            window.redraw()
            yield 5.0
        place = yield from find_slider(window, f"{MODEL}.{PARAMETER}")
        load = os.getloadavg()[0]
        dragged = yield from drag(window, parts, place, value)
        graph = sheet.drawn_graph(scene, 0)
        assert len(graph.drawn) == MODELS + 1
        tell(f"{what} × {MODELS}, slider {PARAMETER}", dragged)
        tell(f"{what} × {MODELS}, drawn again", (yield from redraw(window, parts)))
        print(f"{ROW}load of the machine while it was dragged: {load:.1f}", flush=True)
        window.screenshot(what)


def watch(window, parts: Parts) -> None:
    """Count Rockfall's functions, and Blender's evaluation, to the parts of a frame."""
    import bpy

    comparison = window.part("rockfall_addon.scene.models.comparison")
    editor = window.part("rockfall_addon.view.graphs.editor")
    for module, name, part in (
        (comparison, "predictions_of", DATA),
        (comparison, "measured_of", DATA),
        (window.part("rockfall_addon.scene.models.comparison_scores"), "ranking", DATA),
        (comparison, "_move_blocks", BLOCKS),
        (editor, "draw_content", GRAPHS),
    ):
        parts.watch(module, name, part)
    bpy.app.handlers.depsgraph_update_pre.append(lambda *given: parts.begin(EVALUATION))
    bpy.app.handlers.depsgraph_update_post.append(lambda *given: parts.end())


def main() -> int:
    sys.path.insert(0, str(ROOT / "scripts"))
    import interface_tests

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds that it may take")
    options = parser.parse_args()
    blender = interface_tests.find_blender()
    if "BLENDER_USER_RESOURCES" not in os.environ:
        interface_tests.use_checkout(blender)
    command = interface_tests.command(blender, [(Path(__file__), "case_slider")], options.timeout)
    done = subprocess.run(
        command, cwd=ROOT, timeout=options.timeout + interface_tests.START_S, text=True, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    if done.returncode:
        print(f"{done.stdout}\nBlender ended with status {done.returncode}")
        return 1
    print(f"Time in ms; {os.process_cpu_count()} processors.\n{HEADER}")
    print("\n".join(line.removeprefix(ROW) for line in done.stdout.splitlines() if line.startswith(ROW)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
