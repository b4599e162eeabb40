# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain in the colours of its scan and of the footage."""

import math
import tomllib
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

FOOTAGE = Path(__file__).resolve().parents[2] / "assets" / "demo" / "footage"
ROCK, THIN = np.array((0.47, 0.43, 0.38)), np.array((0.30, 0.42, 0.60))


def linear(srgb: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def attribute(mesh, name: str, kind: str = "color_srgb") -> np.ndarray:
    found = np.empty(4 * len(mesh.vertices), dtype=np.float32)
    mesh.attributes[name].data.foreach_get(kind, found)
    return found.reshape(-1, 4)


def scan_file(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """A coloured scan as a table, and its points and colours."""
    x, y = np.meshgrid(np.arange(40) * 0.5, np.arange(40) * 0.5)
    points = np.column_stack([x.ravel(), y.ravel(), (0.7 * x + 0.05 * np.sin(2 * y)).ravel()])
    numbers = np.column_stack([6 * x.ravel() + 20, 6 * y.ravel() + 20, 200 - 4 * x.ravel()]).astype(np.uint8)
    rows = [f"{a:.4f} {b:.4f} {c:.4f} {r} {g} {u}" for (a, b, c), (r, g, u) in zip(points, numbers, strict=True)]
    path.write_text("x y z red green blue\n" + "\n".join(rows))
    return points, numbers


@pytest.fixture
def scan(part, tmp_path):
    points, numbers = scan_file(tmp_path / "scan.xyz")
    assert bpy.ops.rockfall.import_terrain(filepath=str(tmp_path / "scan.xyz")) == {"FINISHED"}
    (ground,) = [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "terrain"]
    return ground, points, numbers


def expected(ground, points: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """(n, 3) of the scan at the mesh's vertices, by their places in plan."""
    shift = np.array(bpy.context.scene["rockfall_shift_m"])
    places = np.array([vertex.co for vertex in ground.data.vertices]) + shift
    column = np.round(places[:, :2] * 2).astype(int)
    table = {(round(x * 2), round(y * 2)): colour for (x, y, _), colour in zip(points, numbers, strict=True)}
    return np.array([table[tuple(at)] for at in column.tolist()])


def test_a_coloured_scan_is_shown_in_its_colours(part, scan, tmp_path) -> None:
    ground, points, numbers = scan
    wanted = expected(ground, points, numbers)
    np.testing.assert_array_equal(np.rint(255 * attribute(ground.data, "scan_colours"))[:, :3], wanted)
    settings = bpy.context.scene.rockfall_terrain
    for name in ("hillshade", "eye_dome", "thin"):
        setattr(settings, name, 0.0)
    own = linear(wanted / 255) * (0.6 + 0.4 / 0.55)
    np.testing.assert_allclose(attribute(ground.data, "relief", "color")[:, :3], np.minimum(own, 1), atol=1e-5)
    settings.scan_colours = 0.25
    light = 1.2 + 0.25 * (0.6 + 0.4 / 0.55 - 1.2)
    mixed = (ROCK + 0.25 * (linear(wanted / 255) - ROCK)) * light
    np.testing.assert_allclose(attribute(ground.data, "relief", "color")[:, :3], np.minimum(mixed, 1), atol=1e-5)
    terrain = part("rockfall_addon.scene.terrain.terrain")
    before = terrain.surface_of(ground).colours
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "site.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "site.blend"))
    (ground,) = [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "terrain"]
    np.testing.assert_array_equal(terrain.surface_of(ground).colours, before)
    np.testing.assert_array_equal(before, wanted)


def test_the_coarse_view_has_them_too(part, scan) -> None:
    ground, _, _ = scan
    bpy.context.scene.rockfall_terrain.view_limit = 2000
    mesh = part("rockfall_addon.scene.terrain.terrain_mesh").stand_in(ground).data
    assert len(mesh.polygons) < 1500
    shift = np.array(bpy.context.scene["rockfall_shift_m"])
    places = np.array([vertex.co for vertex in mesh.vertices]) + shift
    found = 255 * attribute(mesh, "scan_colours")
    np.testing.assert_allclose(found[:, 0], 6 * places[:, 0] + 20, atol=4)
    np.testing.assert_allclose(found[:, 1], 6 * places[:, 1] + 20, atol=4)


def test_the_material_makes_the_same_colours(part, scan, tmp_path) -> None:
    """A picture from above without light and shade, against the scan's own colour in the middle of it."""
    _, points, numbers = scan
    settings = bpy.context.scene.rockfall_terrain
    for name in ("hillshade", "eye_dome", "thin"):
        setattr(settings, name, 0.0)
    scene = bpy.context.scene
    shift = np.array(scene["rockfall_shift_m"])
    middle = np.array([9.75, 9.75, 0.0]) - shift
    camera = bpy.data.objects.new("above", bpy.data.cameras.new("above"))
    scene.collection.objects.link(camera)
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.4
    camera.location = (middle[0], middle[1], 60.0)
    scene.camera = camera
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.view_settings.view_transform = "Raw"
    for strength, of in ((1.0, 1.0), (0.0, 0.0)):
        settings.scan_colours = strength
        scene.render.filepath = str(tmp_path / f"{of}.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3].mean(axis=0)
        near = np.argsort(np.abs(points[:, :2] - 9.75).max(axis=1))[:4]
        own = linear(numbers[near].mean(axis=0) / 255) * (0.6 + 0.4 / 0.55)
        np.testing.assert_allclose(pixels, own if of else 1.2 * ROCK, atol=0.015)


@pytest.fixture
def demo(part):
    assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    return [obj for obj in bpy.context.scene.objects if obj.get("rockfall_role") == "terrain"]


def in_first_picture(survey: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) colours in the first picture at places, by OpenCV's own projection, and whether they are well inside."""
    said = tomllib.loads((FOOTAGE / "camera.toml").read_text(encoding="utf-8"))
    matrix = np.array([[said["fx"], 0, said["cx"]], [0, said["fy"], said["cy"]], [0, 0, 1]])
    lens = np.array([said.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")])
    turn, _ = cv2.Rodrigues(np.array(said["rotation"]))
    pixels = cv2.projectPoints(survey - np.array(said["position"]), turn, np.zeros(3), matrix, lens)[0][:, 0]
    video = cv2.VideoCapture(str(FOOTAGE / "footage.mp4"))
    frame = cv2.GaussianBlur(video.read()[1], (0, 0), 1.5)
    video.release()
    inside = ((pixels > 20) & (pixels < [said["width"] - 20, said["height"] - 20])).all(axis=1)
    at = np.where(inside[:, None], pixels, 0).astype(int)
    return frame[at[:, 1], at[:, 0], ::-1].astype(float), inside


def test_the_footage_colours_what_it_shows(part, demo) -> None:
    """Where the first picture shows the ground, it has about the colour of that picture; elsewhere it is rock."""
    assert bpy.ops.rockfall.colour_from_footage() == {"FINISHED"}
    scene = bpy.context.scene
    shift = np.array(scene["rockfall_shift_m"])
    seen = total = 0
    apart, pairs = [], []
    for ground in demo:
        found = 255 * attribute(ground.data, "footage_colours")
        places = np.array([vertex.co for vertex in ground.data.vertices], dtype=np.float64) + shift
        sure = found[:, 3] > 250
        shown, inside = in_first_picture(places)
        both = sure & inside
        apart.append(np.abs(shown[both] - found[both, :3]).ravel())
        pairs.append(np.column_stack([shown[both].mean(axis=1), found[both, :3].mean(axis=1)]))
        seen, total = seen + int((found[:, 3] > 0).sum()), total + len(found)
        rock = attribute(ground.data, "relief", "color")[found[:, 3] == 0]
        assert np.abs(rock[:, 0] / rock[:, 1] - ROCK[0] / ROCK[1]).min(initial=0) < 1e-3
    assert 0.05 < seen / total < 0.95
    assert np.concatenate(apart).size > 3000
    assert np.median(np.concatenate(apart)) < 12
    assert np.corrcoef(np.concatenate(pairs).T)[0, 1] > 0.7


def test_a_camera_that_moves_makes_them_stale_and_they_can_be_removed(part, demo) -> None:
    scene, colours = bpy.context.scene, part("rockfall_addon.scene.terrain.terrain_colours")
    assert bpy.ops.rockfall.colour_from_footage() == {"FINISHED"}
    assert colours.have(scene, "footage_colours")
    assert not colours.is_stale(scene)
    camera = next(obj for obj in scene.objects if "rockfall_poses" in obj)
    poses = np.array(camera["rockfall_poses"])
    poses[0] += 0.5
    camera["rockfall_poses"] = poses.tolist()
    assert colours.is_stale(scene)
    assert bpy.ops.rockfall.colour_from_footage() == {"FINISHED"}
    assert not colours.is_stale(scene)
    assert bpy.ops.rockfall.remove_footage_colours() == {"FINISHED"}
    assert not colours.have(scene, "footage_colours")
    assert not bpy.ops.rockfall.remove_footage_colours.poll()


def test_without_an_aligned_video_there_is_nothing_to_colour_from(part, scan) -> None:
    assert not bpy.ops.rockfall.colour_from_footage.poll()


def test_a_page_of_the_scene_has_the_colours_of_the_footage(part, demo) -> None:
    shown, ground = part("rockfall_addon.scene.picks.shown"), part("core.film.composed.ground")
    scene = bpy.context.scene
    assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    with_them = shown.show(shown.ask(scene, simulated=False, together=True), lambda *_: None)
    without = shown.show(shown.ask(scene, simulated=False, together=True, terrain_colours="none"), lambda *_: None)
    assert with_them.photographs
    assert not without.photographs
    sun = np.array([0.0, -math.sqrt(0.5), math.sqrt(0.5)])
    lit = ground.lit_ground(with_them.surface, sun, with_them.photographs).colours
    plain = ground.lit_ground(without.surface, sun).colours
    changed = np.abs(lit - plain).max(axis=1) > 0.05
    assert 0.05 < changed.mean() < 0.95
    shown_there, inside = in_first_picture(with_them.origin.to_survey(with_them.surface.vertices[changed]))
    assert inside.sum() > 2000
    assert np.median(np.abs(shown_there[inside] - 255 * lit[changed][inside])) < 12
