# SPDX-License-Identifier: GPL-3.0-or-later
"""What a large terrain costs in Blender: memory, drawing and sliders, with the full mesh and with the coarse view.

Needs the bpy module. Drawing is measured off screen in the relief look, which is a software renderer where there is no
graphics card: compare the two, not with other machines. Each size runs in a process of its own, for its memory.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Callable

from terrain import rough_slope, row, seconds

DRAWS = 3


def memory_mb() -> float:
    """What this process holds now, where the system tells."""
    try:
        with open("/proc/self/status", encoding="ascii") as status:
            return int(status.read().split("VmRSS:")[1].split()[0]) / 1024
    except OSError:
        return float("nan")


def measure(triangles: int) -> None:
    import bpy
    import gpu
    import numpy as np
    import rockfall
    from rockfall.core.terrain.decimation import decimate
    from rockfall.core.terrain.raycast import cast_rays
    from rockfall.core.terrain.shading import Shading
    from rockfall.rockfall_addon.scene.terrain import terrain, terrain_look, terrain_view

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    rockfall.register()
    scene = bpy.context.scene
    surface = rough_slope(triangles)
    values = np.random.default_rng(0).random((3, len(surface.vertices)))
    shading = Shading(values[0], values[1], values[2], values[2] > 0.9, values[2])
    print(f"\n{len(surface.faces):,} triangles")
    scene.rockfall_terrain.view_limit = 10 * triangles
    start = memory_mb()
    taken = seconds(lambda: terrain.add_terrain(scene, surface, shading))
    row("Blender's mesh, all attributes", f"{taken:.2f} s", f"{memory_mb() - start:+.0f} MB")
    taken = seconds(lambda: decimate(surface.vertices, surface.faces, triangles // 5, values.T))
    row("  to a fifth of the triangles", f"{taken:.2f} s", "vertex clustering in the core")
    ground = terrain.active_terrain(scene)

    def painting() -> float:
        look = terrain_look.look_of(scene)
        return min(seconds(lambda: terrain_look.paint([ground.data], look)) for _ in range(3))

    row("  colours of the full mesh", f"{1000 * painting():.0f} ms", "on a change of a slider")
    draw = drawing(gpu, bpy)
    before = memory_mb()
    first, again = seconds(draw), min(seconds(draw) for _ in range(DRAWS))
    full = again
    row(
        "full: first picture, next pictures", f"{first:.2f} s, {1000 * again:.0f} ms", f"{memory_mb() - before:+.0f} MB"
    )
    row("  a slider, until it is drawn", f"{1000 * slider(scene, draw):.0f} ms")

    before = memory_mb()
    limit = min(3_000_000, len(surface.faces) - 1)
    taken = seconds(lambda: setattr(scene.rockfall_terrain, "view_limit", limit))
    row("coarse: made", f"{taken:.2f} s", f"{terrain_view.drawn_triangles(ground):,} triangles")
    first, again = seconds(draw), min(seconds(draw) for _ in range(DRAWS))
    note = f"{full / again:.1f} times as quick; {memory_mb() - before:+.0f} MB"
    row("coarse: first picture, next pictures", f"{first:.2f} s, {1000 * again:.0f} ms", note)
    row("  a slider, until it is drawn", f"{1000 * slider(scene, draw):.0f} ms")
    row("  back to the full mesh, drawn", f"{seconds(lambda: switch(scene, draw)):.2f} s")
    joined = terrain.surface_of_scene(scene)
    taken = seconds(lambda: cast_rays(joined, [[9.0, 9.0, 500.0]], [0, 0, -1]))
    row("first ray", f"{taken:.2f} s", "builds the index of the full mesh")
    terrain.forget_surfaces()
    row("the surface after an undo", f"{1000 * seconds(lambda: terrain.surface_of_scene(scene)):.0f} ms", "index kept")
    row("the process", f"{memory_mb():.0f} MB", "with all libraries and the arrays of this script")


def slider(scene: object, draw: Callable[[], None]) -> float:
    """Seconds from a slider's change until it is drawn."""

    def change(value: float) -> None:
        scene.rockfall_terrain.hillshade = value
        draw()

    return min(seconds(lambda value=value: change(value)) for value in (0.3, 0.7))


def switch(scene: object, draw: Callable[[], None]) -> None:
    scene.rockfall_terrain.full_resolution = True
    draw()


def drawing(gpu: object, bpy: object) -> Callable[[], None]:
    """A function that draws the 3-D view once, off screen, in the relief look."""
    from mathutils import Matrix, Vector

    gpu.init()
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    space = area.spaces.active
    space.shading.type, space.shading.light, space.shading.color_type = "SOLID", "FLAT", "VERTEX"
    space.overlay.show_overlays = False
    width, height = 1280, 720
    buffer = gpu.types.GPUOffScreen(width, height)
    terrain = next(obj for obj in bpy.context.scene.objects if obj.type == "MESH")
    middle = sum((Vector(corner) for corner in terrain.bound_box), Vector()) / 8
    away = 1.2 * max(terrain.dimensions)
    view = Matrix.LocRotScale(
        middle + Vector((-0.7, 0.0, 0.7)) * away, Vector((-0.7, 0, 0.7)).to_track_quat("Z", "Y"), None
    )
    camera = bpy.data.cameras.new("bench")
    camera.clip_end = 10 * away
    eye = bpy.data.objects.new("bench", camera)
    bpy.context.scene.collection.objects.link(eye)
    bpy.context.preferences.system.viewport_aa = "OFF"  # one pass for each picture
    turned = [0.0]

    def draw() -> None:
        turned[0] += 1e-3  # a picture from the same place would be taken from the last one
        turn = Matrix.Rotation(turned[0], 4, "Z")
        there = Matrix.Translation(middle) @ turn @ Matrix.Translation(-middle) @ view
        eye.matrix_world = there
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        lens = eye.calc_matrix_camera(graph, x=width, y=height)
        buffer.draw_view3d(bpy.context.scene, bpy.context.view_layer, space, region, there.inverted(), lens)
        with buffer.bind():
            gpu.state.active_framebuffer_get().read_color(0, 0, 1, 1, 4, 0, "UBYTE")  # waits until it is drawn

    return draw


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=float, nargs="*", default=[1e6, 2e6, 5e6])
    parser.add_argument("--here", action="store_true", help="in this process (one size)")
    arguments = parser.parse_args()
    if arguments.here:
        measure(int(arguments.triangles[0]))
        sys.stdout.flush()
        os._exit(0)  # a regular exit can crash after GPU work
    for triangles in arguments.triangles:
        subprocess.run([sys.executable, __file__, "--here", "--triangles", str(triangles)], check=True)


if __name__ == "__main__":
    main()
