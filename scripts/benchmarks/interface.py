# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person waits for in the window: from a click to the redrawn trajectory; and what a large job needs of memory.

Runs in the window of a real Blender, found as by interface_tests.py. Without a graphics card the window is drawn by
software; "computed" is the part of the wait that does not depend on it.
"""

import argparse
import csv
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOOTAGE = ROOT / "assets" / "demo" / "footage"
TRIANGLES, RATE_HZ, CLIP_S, SIZE = 2_000_000, 30, 2.0, (3840, 2160)
NAME = "B10"
ROW = "row: "
SHOWN_S = 20.0
BESIDE_PX = 40.0  # farther than the reach of the pick that is there: it is moved


def row(what: str, value: str, note: str = "") -> None:
    print(f"{ROW}{what:<44}{value:>16}  {note}", flush=True)


def memory_mb(what: str = "VmRSS") -> float:
    """What this process holds now, or held at most (VmHWM), where the system tells."""
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            return int(status.read().split(f"{what}:")[1].split()[0]) / 1024
    except OSError:
        return float("nan")


def case_picks(window):
    """Click each impact in its picture, then again beside it; time until the footage shows the new trajectory."""
    import bpy
    import gpu

    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    arranging = window.part("rockfall_addon.view.arranging")
    yield from window.wait_for(lambda: not arranging.is_waiting(), 60, "arranged")
    yield 2.0
    scene = bpy.context.scene
    parts = {
        name: window.part(f"rockfall_addon.scene.{room}.{name}")
        for room, name in (("footage", "videos"), ("storage", "fingerprints"), ("footage", "sync"))
    }
    parts["image_view"] = window.part("rockfall_addon.view.image_view")
    area = max((one for one in window.window.screen.areas if one.type == "VIEW_3D"), key=lambda one: one.width)
    region = next(one for one in area.regions if one.type == "WINDOW")
    known, drawn, computed, count, kept = [""], [], [], [0], parts["sync"].sync

    def now() -> str:
        return parts["fingerprints"].remembered(scene).get(NAME, "")

    def look() -> None:
        if bpy.context.region != region or drawn:
            return
        count[0] += 1
        if now() != known[0]:
            gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "UBYTE")  # waits until it is drawn
            drawn.append(time.perf_counter())

    def timed(*given: object, **named: object) -> object:
        start = time.perf_counter()
        done = kept(*given, **named)
        if done.rebuilt:
            computed.append(time.perf_counter() - start)
        return done

    handle = bpy.types.SpaceView3D.draw_handler_add(look, (), "WINDOW", "POST_PIXEL")
    parts["sync"].sync = timed
    waits, works, redraws, drawings = [], [], [], []
    for frame, u, v in seen_impacts():
        for beside in (0.0, BESIDE_PX):
            scene.frame_set(frame)
            yield 0.6
            camera = parts["videos"].active_camera(scene)
            rectangle = parts["image_view"].image_rectangle(region, area.spaces.active.region_3d, scene, camera)
            x, y = parts["image_view"].to_region(rectangle, (1280, 720), (u + beside, v))
            x, y = round(region.x + x), round(region.y + y)
            yield from window.move(x, y)
            known[0], count[0] = now(), 0
            drawn.clear(), computed.clear()
            start = time.perf_counter()
            for value in ("PRESS", "RELEASE"):
                window.window.event_simulate(type="LEFTMOUSE", value=value, x=x, y=y)
            yield from window.wait_for(lambda: drawn, SHOWN_S, "the trajectory is drawn")
            yield 0.3
            waits.append(1e3 * (drawn[0] - start))
            works.append(1e3 * sum(computed))
            drawings.append(count[0])
            begun = time.perf_counter()
            with bpy.context.temp_override(window=window.window, area=area, region=region):
                region.tag_redraw()
                bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
            redraws.append(1e3 * (time.perf_counter() - begun))
    bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    parts["sync"].sync = kept
    picks = len([one for one in scene.objects if one.get("rockfall_role") == "pick"])
    row("picks", f"{picks}", f"{len(waits)} clicks on the demo's footage; the first is not counted: kernels are loaded")
    for what, taken in (
        ("click until the trajectory is drawn", waits),
        ("  of it computed: trajectory and what shows it", works),
        ("  for comparison: the window drawn once more", redraws),
    ):
        counted = taken[1:]
        row(what, f"{statistics.median(counted):.0f} ms", f"median; {min(counted):.0f}–{max(counted):.0f} ms")
    row("drawings of the footage's view for a click", f"{statistics.median(drawings):.0f}", "the last shows it")


def seen_impacts() -> list[tuple[int, float, float]]:
    """Frame and pixel of the block at the impacts that the footage shows."""

    def read(name: str) -> list[dict[str, str]]:
        with (FOOTAGE / "truth" / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    frames = [round(RATE_HZ * float(one["time_s"])) for one in read("impacts.csv") if float(one["time_s"]) > 1.3]
    block = {int(one["frame"]): (float(one["u_px"]), float(one["v_px"])) for one in read("block.csv")}
    return [(frame, *block[frame]) for frame in frames]


def case_memory(window):
    """A large terrain and a 4K clip, as far as the pictures and the index of the terrain need memory."""
    import bpy

    with tempfile.TemporaryDirectory() as directory:
        begun = memory_mb()
        row("Blender with the extension", f"{begun:.0f} MB", f"terrain: {TRIANGLES:,} triangles; clip: 3840 × 2160")
        last = [begun]

        def tell(what: str, note: str = "") -> None:
            now = memory_mb()
            row(what, f"{now:.0f} MB", f"{now - last[0]:+.0f} MB{note}")
            last[0] = now

        clip = Path(directory) / "clip.mp4"
        write_clip(clip)
        yield 0.5
        tell("  this script's clip written", ", OpenCV")
        scene, parts = bpy.context.scene, window.part("rockfall_addon.scene.terrain.terrain")
        started = time.perf_counter()
        add_slope(window, scene)
        taken = time.perf_counter() - started
        yield 5.0
        tell("terrain added and drawn", f", {taken:.1f} s to add it")
        surface = parts.surface_of_scene(scene)
        cast = window.part("core.terrain.raycast").cast_rays
        assert cast(surface, [[9.0, 9.0, 500.0]], [0, 0, -1]).face[0] >= 0
        yield 1.0
        tell("terrain's index, with the first ray")
        with window.override():
            assert bpy.ops.rockfall.add_video(filepath=str(clip)) == {"FINISHED"}
        yield 3.0
        tell("4K clip added and drawn")
        for frame in range(0, int(CLIP_S * RATE_HZ), 2):
            scene.frame_set(frame)
            window.redraw()
            yield 0.3
        yield 1.0
        tell("stepped through the clip", ", Blender's cache of pictures")
        videos = window.part("rockfall_addon.scene.footage.videos")
        video_files = window.part("rockfall_addon.scene.footage.video_files")
        camera = videos.active_camera(scene)
        for index in range(0, int(CLIP_S * RATE_HZ), 6):
            video_files.picture(camera, index)
        yield 1.0
        tell("ten pictures read for the loupe")
        row("at most", f"{memory_mb('VmHWM'):.0f} MB", "with the arrays of this script")


def add_slope(window, scene) -> None:
    import numpy as np

    side = int((TRIANGLES / 2) ** 0.5) + 1
    x, y = np.meshgrid(np.arange(side) * 0.5, np.arange(side) * 0.5)
    z = 0.7 * x + 5 * np.sin(x / 10) * np.cos(y / 7) + np.random.default_rng(0).normal(0, 0.1, x.shape)
    i = np.arange(side * side, dtype=np.int32).reshape(side, side)
    a, b, c, d = (i[p, q].ravel() for p in (slice(-1), slice(1, None)) for q in (slice(-1), slice(1, None)))
    faces = np.stack([np.stack([a, b, d], 1), np.stack([a, d, c], 1)], axis=1).reshape(-1, 3)
    shift = window.part("core.georeference").GlobalShift()
    surface = window.part("core.terrain.surface").Surface(np.stack([x, y, z], -1).reshape(-1, 3), faces, shift, "slope")
    window.part("rockfall_addon.scene.terrain.terrain").add_terrain(
        scene, surface, window.part("core.terrain.shading").shade(surface)
    )


def write_clip(path: Path) -> None:
    import cv2
    import numpy as np

    width, height = SIZE
    rough = np.random.default_rng(1).integers(0, 255, (height // 8, width // 8 + 32, 3), dtype=np.uint8)
    wide = cv2.resize(rough, None, fx=8, fy=8, interpolation=cv2.INTER_LINEAR)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), RATE_HZ, SIZE)
    for frame in range(int(CLIP_S * RATE_HZ)):
        writer.write(np.ascontiguousarray(wide[:, 4 * frame : 4 * frame + width]))
    writer.release()


def main() -> int:
    sys.path.insert(0, str(ROOT / "scripts"))
    import interface_tests

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", default=["picks", "memory"], help="picks, memory")
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds that one of them may take")
    options = parser.parse_args()
    blender = interface_tests.find_blender()
    if "BLENDER_USER_RESOURCES" not in os.environ:
        interface_tests.use_checkout(blender)
    for name in options.what:
        command = interface_tests.command(blender, [(Path(__file__), f"case_{name}")], options.timeout)
        done = subprocess.run(
            command, cwd=ROOT, timeout=options.timeout + interface_tests.START_S, text=True, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        if done.returncode:
            print(f"{done.stdout}\n{name}: Blender ended with status {done.returncode}")
            return 1
        print("\n".join(line.removeprefix(ROW) for line in done.stdout.splitlines() if line.startswith(ROW)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
