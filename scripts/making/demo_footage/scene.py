# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that Blender renders: sunlit rock with scrub and stones, the block, dust, survey targets, the camera."""

import bpy
import numpy as np
from mathutils import Vector
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from . import materials, shot, sight

Array = NDArray[np.float64]

SUN_GULLY = (0.80, -0.22, 0.72)
SAMPLES = 2
STEPS = (-0.5, 0.0, 0.5)
"""Where in the exposure the moving objects are set; in between they move evenly."""

DUST_S = 1.1


def build(take: shot.Shot, targets: Array, scale: float = 1.0) -> bpy.types.Scene:
    """An empty file filled with the whole scene; ``scale`` shrinks the picture for a preview."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 0, shot.FRAMES - 1
    scene.render.fps, scene.render.fps_base = shot.FPS, 1.0
    rock = materials.rock()
    vertices = take.local(take.site.vertices)
    _mesh("Terrain", vertices, take.site.faces, rock)
    _mesh("Around", *_surroundings(take), rock)
    _scrub(take)
    _stones(take)
    for number, place in enumerate(targets, 1):
        _target(f"T{number:02d}", place)
    _block(take)
    for impact in take.impacts:
        _dust(take, impact)
    _camera(scene, take)
    _light(scene, take)
    _settings(scene, scale)
    return scene


def _mesh(name: str, vertices: Array, faces: Array, material: bpy.types.Material) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.asarray(vertices, np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", np.asarray(faces, np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.materials.append(material)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def _surroundings(take: shot.Shot) -> tuple[Array, Array]:
    """The slope beyond the surveyed terrain, so that no frame shows the mesh's end; it is not in terrain.ply."""
    rng = np.random.default_rng(5)
    x, y = np.arange(-60.0, 240.0, 1.5), np.arange(-190.0, 190.0, 1.5)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    site = take.site
    low = np.array([site.rows_x[0], site.columns_y[0]]) + 0.4
    high = np.array([site.rows_x[-1], site.columns_y[-1]]) - 0.4
    inner = np.clip(grid, low, high)
    out = np.linalg.norm(grid - inner, axis=1)
    z = np.array([take.ground.height(*point) for point in inner])
    z = z - 0.25 * np.where(inner[:, 0] > 100.0, out, 0.0) - 0.05
    z += np.clip(out / 4.0, 0.0, 1.0) * rng.normal(0.0, 0.2, len(z))
    vertices = take.local(np.column_stack([grid, z]))
    corner = (np.arange(x.size - 1)[:, None] * y.size + np.arange(y.size - 1)).ravel()
    faces = np.concatenate(
        [
            np.column_stack([corner, corner + y.size, corner + y.size + 1]),
            np.column_stack([corner, corner + y.size + 1, corner + 1]),
        ]
    )
    inside = (out == 0.0)[faces].all(axis=1)
    return vertices, faces[~inside]


def _angular(rng: np.random.Generator, planes: int, low: float = 0.86) -> tuple[Array, Array]:
    """A convex polyhedron of about unit mean radius, its centroid at the origin: vertices and faces."""
    points = rng.standard_normal((planes, 3))
    points *= (rng.uniform(low, 1.12, planes) / np.linalg.norm(points, axis=1))[:, None]
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    outside = np.einsum(
        "ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), corners[:, 0]
    )
    faces = np.where(outside[:, None] > 0, hull.simplices, hull.simplices[:, ::-1])
    volumes = np.abs(outside) / 6.0
    centre = (volumes[:, None] * corners.sum(axis=1) / 4.0).sum(axis=0) / volumes.sum()
    size = (volumes.sum() / (4.0 / 3.0 * np.pi)) ** (1.0 / 3.0)
    return (points - centre) / size, faces


def _scattered(
    take: shot.Shot, rng: np.random.Generator, count: int, gentle: float, away: float
) -> tuple[Array, Array]:
    """Random points of the terrain (n, 3) in the gully's frame, and their normals."""
    site = take.site
    corners = site.vertices[site.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normal, axis=1)
    normal /= area[:, None]
    centre = corners.mean(axis=1)
    weight = area * (normal[:, 2] > gentle) * (centre[:, 0] > 45.0)
    path = np.array([shot._centre(take, t + shot.START_S) for t in np.arange(0.0, 10.0, 0.03)])
    weight *= cKDTree(path).query(centre)[0] > away
    chosen = rng.choice(len(weight), count, p=weight / weight.sum())
    return centre[chosen], normal[chosen]


def _merged_bodies(rng: np.random.Generator, places: Array, sizes: Array, flat: float, bodies) -> tuple[Array, Array]:
    vertices, faces, offset = [], [], 0
    for place, size in zip(places, sizes, strict=True):
        points, triangles = bodies[rng.integers(len(bodies))]
        turned = points @ Rotation.random(rng=rng).as_matrix().T * np.array([1.0, 1.0, flat]) * size
        vertices.append(turned + place)
        faces.append(triangles + offset)
        offset += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _scrub(take: shot.Shot) -> None:
    """Low bushes in loose groups on the gentler ground."""
    rng = np.random.default_rng(11)
    seeds, _ = _scattered(take, rng, 90, 0.62, 5.0)
    bodies = []
    for _ in range(6):
        points = rng.standard_normal((160, 3))
        points *= (rng.uniform(0.55, 1.1, 160) / np.linalg.norm(points, axis=1))[:, None]
        order = rng.permutation(160)
        leaves = np.concatenate([points[order, None] + rng.normal(0.0, 0.13, (160, 3, 3))]).reshape(-1, 3)
        bodies.append((leaves, np.arange(480).reshape(-1, 3)))
    places = []
    for seed in seeds:
        for _ in range(rng.integers(1, 6)):
            x, y = seed[:2] + rng.normal(0.0, 1.3, 2)
            z = take.ground.height(x, y)
            if np.isfinite(z):
                places.append([x, y, z + 0.15])
    sizes = rng.uniform(0.22, 0.62, len(places))
    vertices, faces = _merged_bodies(rng, np.array(places), sizes, 0.75, bodies)
    _mesh("Scrub", take.local(vertices), faces, materials.diffuse("Scrub", (0.075, 0.092, 0.030)))


def _stones(take: shot.Shot) -> None:
    """Loose stones on the ground; those near the run are small, so that the block does not pass through any."""
    rng = np.random.default_rng(12)
    bodies = [_angular(rng, 14) for _ in range(12)]
    places, normals = _scattered(take, rng, 2600, 0.45, 0.0)
    sizes = np.minimum(0.05 + 0.05 * rng.pareto(2.6, len(places)), 0.28)
    path = np.array([shot._centre(take, t + shot.START_S) for t in np.arange(0.0, 10.0, 0.03)])
    near = np.array([np.linalg.norm(path - place, axis=1).min() < 1.6 for place in places])
    sizes[near] = np.minimum(sizes[near], 0.07)
    vertices, faces = _merged_bodies(rng, places + 0.3 * sizes[:, None] * normals, sizes, 1.0, bodies)
    _mesh("Stones", take.local(vertices), faces, materials.diffuse("Stones", (0.25, 0.225, 0.19)))


def _target(name: str, place: Array) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=32, ring_count=16, radius=sight.TARGET_DIAMETER_M / 2.0, location=tuple(place)
    )
    made = bpy.context.object
    made.name = name
    material = bpy.data.materials.get("Target") or materials.diffuse("Target", (0.80, 0.16, 0.008), 0.35)
    made.data.materials.append(material)


def _block(take: shot.Shot) -> None:
    """The block keyed at the start, middle and end of each exposure."""
    points, faces = _angular(np.random.default_rng(3), 26, 0.9)
    made = _mesh("Block", points * take.diameters / 2.0, faces, materials.diffuse("Block", (0.60, 0.56, 0.49)))
    times, frames = exposures()
    made.rotation_mode = "QUATERNION"
    # the shutter of the first frame opens before the clock starts
    turns = shot.block_turns(take, np.maximum(times, 0.0)).as_quat(scalar_first=True)
    set_keys(made, "location", frames, shot.block_centre(take, times))
    set_keys(made, "rotation_quaternion", frames, _continuous(turns))


def _camera(scene: bpy.types.Scene, take: shot.Shot) -> None:
    lens = bpy.data.cameras.new("Camera")
    eye = bpy.data.objects.new("Camera", lens)
    scene.collection.objects.link(eye)
    scene.camera = eye
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", 36.0
    lens.lens = shot.FOCAL_PX * 36.0 / shot.WIDTH
    lens.clip_start, lens.clip_end = 1.0, 2000.0
    times, frames = exposures()
    position, rotation = shot.camera_path(take, times)
    # Blender's camera looks along -z with y up
    turns = np.swapaxes(rotation, 1, 2) @ np.diag([1.0, -1.0, -1.0])
    eye.rotation_mode = "QUATERNION"
    set_keys(eye, "location", frames, position)
    set_keys(eye, "rotation_quaternion", frames, _continuous(Rotation.from_matrix(turns).as_quat(scalar_first=True)))


def exposures() -> tuple[Array, Array]:
    """Video times of all keys, and the same in Blender's frames; the middle of an exposure is its timestamp."""
    frames = np.arange(shot.FRAMES)[:, None] + np.array(STEPS) * shot.SHUTTER_S * shot.FPS
    return frames.ravel() / shot.FPS, frames.ravel()


def _continuous(quaternions: Array) -> Array:
    signs = np.sign(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
    return quaternions * np.concatenate([[1.0], np.cumprod(np.where(signs < 0, -1.0, 1.0))])[:, None]


def set_keys(made: bpy.types.Object, path: str, frames: Array, values: Array, interpolation: str = "LINEAR") -> None:
    made.animation_data_create()
    action = made.animation_data.action
    if action is None:
        action = bpy.data.actions.new(made.name)
        made.animation_data.action = action
    values = values[:, None] if values.ndim == 1 else values
    code = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items[interpolation].value
    for index in range(values.shape[1]):
        curve = action.fcurve_ensure_for_datablock(made, path, index=index)
        curve.keyframe_points.add(len(frames))
        curve.keyframe_points.foreach_set("co", np.column_stack([frames, values[:, index]]).astype(np.float32).ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), code, np.int32))
        curve.update()


def _dust(take: shot.Shot, impact) -> None:
    """A few soft puffs that rise from a contact, grow and fade; the harder the blow, the more of them."""
    rng = np.random.default_rng(int(1000 * impact.time))
    material = bpy.data.materials.get("Dust") or materials.dust()
    contact, normal = take.local(impact.contact), take.turned(impact.normal)
    blow = float(np.linalg.norm(impact.v2 - impact.v1))
    strength = np.clip(blow / 14.0, 0.15, 1.0)
    start = (impact.time - shot.START_S) * shot.FPS
    for _ in range(5):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=1.0, location=tuple(contact))
        puff = bpy.context.object
        puff.name = "Dust"
        puff.data.materials.append(material)
        puff.visible_shadow = False
        for polygon in puff.data.polygons:
            polygon.use_smooth = True
        age = np.linspace(0.0, 1.0, 12)
        frames = start + age * DUST_S * shot.FPS
        drift = normal * rng.uniform(0.2, 0.9) + rng.normal(0.0, 0.35, 3) + np.array([0.15, 0.0, 0.1])
        set_keys(puff, "location", frames, contact + 0.1 * normal + drift * (age**0.6)[:, None] * strength)
        size = (0.06 + rng.uniform(0.25, 0.6) * strength * age**0.5)[:, None] * rng.uniform(0.8, 1.2, 3)
        size[0] = size[-1] = 0.0
        set_keys(puff, "scale", frames, size)
        alpha = 0.8 * strength * (1.0 - age) ** 1.4
        set_keys(puff, "color", frames, np.column_stack([np.ones((12, 3)), alpha]))


def _light(scene: bpy.types.Scene, take: shot.Shot) -> None:
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.angle, lamp.color = 4.2, np.radians(0.53), (1.0, 0.93, 0.82)
    sun = bpy.data.objects.new("Sun", lamp)
    direction = take.turned(np.array(SUN_GULLY))
    sun.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    background = world.node_tree.nodes.get("Background") or world.node_tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.52, 0.66, 0.90, 1.0)
    background.inputs["Strength"].default_value = 0.62


def _settings(scene: bpy.types.Scene, scale: float) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = shot.WIDTH, shot.HEIGHT
    render.resolution_percentage = round(100 * scale)
    render.use_motion_blur, render.motion_blur_shutter = True, shot.SHUTTER_S * shot.FPS
    render.motion_blur_position = "CENTER"
    render.use_persistent_data = True
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGB"
    render.image_settings.compression = 15
    cycles.device, cycles.samples = "CPU", SAMPLES
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces, cycles.diffuse_bounces = 0, 0
    cycles.glossy_bounces = cycles.transmission_bounces = 0
    cycles.transparent_max_bounces = 8
    cycles.use_auto_tile = False
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
