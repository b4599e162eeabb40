# SPDX-License-Identifier: GPL-3.0-or-later
"""A person adds footage, looks through its camera and steps through it."""

import shutil
import tempfile
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[2]
FOOTAGE = ROOT / "assets" / "demo" / "footage" / "footage.mp4"
DATA = ROOT / "tests" / "data" / "videos"


def add(window, *names, directory=DATA):
    with window.override():
        done = bpy.ops.rockfall.add_video(directory=str(directory), files=[{"name": name} for name in names])
    assert done == {"FINISHED"}


def case_footage_behind_the_camera(window):
    yield from window.show_sidebar(width=420)
    window.screenshot("nothing")
    add(window, FOOTAGE.name, directory=FOOTAGE.parent)
    yield 2.0
    scene = bpy.context.scene
    window.screenshot("first")
    x, y = window.centre()
    scene.render.fps = 45  # so that a picture is more than a frame
    for _ in range(3):
        yield from window.press("RIGHT_ARROW", x, y)
    assert (scene.frame_current, scene.frame_subframe) == (4, 0.5), "the third picture is at 4.5 frames of this scene"
    yield from window.press("RIGHT_ARROW", x, y, ctrl=True)
    assert scene.frame_current == 19
    yield from window.press("LEFT_ARROW", x, y)
    assert scene.frame_current == 18
    scene.render.fps = 30
    scene.frame_set(150)
    yield 1.5
    window.screenshot("later")


def case_every_picture_on_the_screen(window):
    """The bars that are seen behind the camera are those of the true frame, whatever the file's rates."""
    yield 0.5
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    space = window.area().spaces.active
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_text = space.show_gizmo = space.overlay.show_cursor = False
    space.shading.background_type = "VIEWPORT"
    videos, clocks = (
        window.part("rockfall_addon.scene.footage.videos"),
        window.part("rockfall_addon.scene.footage.clocks"),
    )
    scene = bpy.context.scene
    for name in ("constant.mp4", "variable.mp4"):
        add(window, name)
        camera = videos.active_camera(scene)
        camera.data.show_passepartout = False
        yield 1.0
        wrong = {}
        for index in range(1, 14):
            with window.override():
                bpy.ops.rockfall.step_frame(step=1)
            yield 0.4
            path = window.screenshot(f"{Path(name).suffix[1:]}-{Path(name).stem}")
            assert clocks.true_frame(scene, camera) == index
            if (found := bars(window, camera, path)) != index:
                wrong[index] = found
        assert not wrong, f"{name}: {wrong}"
        scene.frame_set(0)


def case_pixels_of_the_view(window):
    """Where the core sees points is where Blender draws them, zoomed and shifted."""
    yield 0.5
    add(window, FOOTAGE.name, directory=FOOTAGE.parent)
    view, videos = window.part("rockfall_addon.view.image_view"), window.part("rockfall_addon.scene.footage.videos")
    scene = bpy.context.scene
    camera = videos.active_camera(scene)
    camera.location = (12.0, -30.0, 8.0)
    camera.rotation_euler = (1.4, 0.05, 0.3)
    camera.data.shift_x, camera.data.shift_y = 0.08, -0.05
    region, space = window.region(), window.area().spaces.active
    rv3d, size = space.region_3d, videos.size_of(camera)
    for zoom, offset in ((0.0, (0.0, 0.0)), (28.0, (0.12, -0.08))):
        rv3d.view_camera_zoom, rv3d.view_camera_offset = zoom, offset
        window.redraw()
        yield 1.0
        rectangle = view.image_rectangle(region, rv3d, scene, camera)
        pixels = np.random.default_rng(1).uniform((40, 40), (1240, 680), (30, 2))
        back = view.to_pixel(rectangle, size, view.to_region(rectangle, size, pixels))
        np.testing.assert_allclose(back, pixels, atol=1e-9)
        origins, directions = view.ray(scene, camera, pixels, 0.0)
        points = origins + directions * np.random.default_rng(2).uniform(20, 90, (30, 1))
        drawn = np.array([location_3d_to_region_2d(region, rv3d, Vector(point)) for point in points.tolist()])
        ours = view.to_region(rectangle, size, view.project(scene, camera, points, 0.0))
        print("largest difference", np.abs(drawn - ours).max(), "px of the screen", flush=True)
        np.testing.assert_allclose(ours, drawn, atol=0.05)
    rv3d.view_perspective = "PERSP"
    assert view.image_rectangle(region, rv3d, scene, camera) is None


def bars(window, camera, path):
    """The number that the bars on the screen tell."""
    view, videos = window.part("rockfall_addon.view.image_view"), window.part("rockfall_addon.scene.footage.videos")
    region, space = window.region(), window.area().spaces.active
    rectangle = view.image_rectangle(region, space.region_3d, bpy.context.scene, camera)
    image = bpy.data.images.load(str(path))
    width, height = image.size
    grey = np.array(image.pixels[:], np.float32).reshape(height, width, 4)[:, :, :3].mean(axis=2)
    bpy.data.images.remove(image)
    size = videos.size_of(camera)
    places = view.to_region(rectangle, size, [[(i + 0.5) * size[0] / 8, size[1] / 3] for i in range(8)])
    values = [grey[round(region.y + y), round(region.x + x)] for x, y in places]
    code = sum(int(value > 0.4) << i for i, value in enumerate(values))
    number = 0
    while code:
        number ^= code
        code >>= 1
    return number


def case_video_undone_and_redone(window):
    yield from window.show_sidebar()
    with window.override():
        bpy.ops.ed.undo_push(message="before")
        bpy.ops.rockfall.add_video("EXEC_DEFAULT", True, filepath=str(DATA / "constant.mp4"))
    yield 1.0
    videos, clocks = (
        window.part("rockfall_addon.scene.footage.videos"),
        window.part("rockfall_addon.scene.footage.clocks"),
    )
    (camera,) = videos.cameras(bpy.context.scene)
    identifier = camera["rockfall_id"]
    with window.override():
        camera.rockfall_video.offset_s = 0.25
        bpy.ops.ed.undo_push(message="offset")
        bpy.ops.ed.undo()
    yield 1.0
    assert clocks.clock_of(videos.by_id(bpy.context.scene, identifier)).offset_s == 0.0
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert videos.cameras(bpy.context.scene) == []
    with window.override():
        bpy.ops.ed.redo()
        bpy.ops.ed.redo()
    yield 1.0
    camera = videos.by_id(bpy.context.scene, identifier)
    assert clocks.clock_of(camera).offset_s == 0.25
    with window.override():
        bpy.ops.object.select_all(action="DESELECT")
        camera.select_set(True)
        bpy.ops.object.delete("EXEC_DEFAULT", True)
    yield 2.0
    assert videos.deleted(bpy.context.scene) == {identifier: "constant.mp4"}
    window.screenshot("camera-deleted")
    with window.override():
        bpy.ops.ed.undo()
    yield 1.0
    assert videos.deleted(bpy.context.scene) == {}
    assert not bpy.context.scene.get("rockfall_problem")


def case_video_proxy(window):
    """The small copies show the same pictures."""
    yield 0.5
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    space = window.area().spaces.active
    space.overlay.show_floor = space.overlay.show_axis_x = space.overlay.show_axis_y = False
    space.overlay.show_text = space.show_gizmo = space.overlay.show_cursor = False
    videos = window.part("rockfall_addon.scene.footage.videos")
    for name in ("constant.mp4", "variable.mp4"):
        folder = Path(tempfile.mkdtemp())
        shutil.copy(DATA / name, folder)
        add(window, name, directory=folder)
        camera = videos.active_camera(bpy.context.scene)
        yield 1.0
        with window.override():
            assert bpy.ops.rockfall.build_proxy(size="50") == {"FINISHED"}
        assert window.area().type == "VIEW_3D"
        yield 4.0
        files = [path for path in folder.rglob("*") if path.is_file()]
        print(files, flush=True)
        assert any("proxy" in path.name and path.stat().st_size > 0 for path in files), files
        wrong = {}
        for index in range(1, 11):
            with window.override():
                bpy.ops.rockfall.step_frame(step=1)
            yield 0.4
            found = bars(window, camera, window.screenshot(name.split(".")[0]))
            if found != index:
                wrong[index] = found
        assert not wrong, f"{name}: {wrong}"
        bpy.context.scene.frame_set(0)
        shutil.rmtree(folder)
