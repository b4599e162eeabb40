# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that Blender renders: sunlit rock with scrub and stones, the block, dust, survey targets, the camera."""

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from . import shot

Array = NDArray[np.float64]

SUN_GULLY = (0.80, -0.22, 0.72)
SAMPLES, PATCH_SAMPLES = 2, 16
STILL_SAMPLES = 16
STILL_FOCAL_PX = 1.5 * shot.FOCAL_PX
STILL_MARGIN_PX = 90.0
"""The still that all frames are painted with: sharper than a frame, and wider than all that they see, by a margin."""

PATCH_PX = 64
NOISE_LEVELS = 1.2
QUALITY = "MEDIUM"

STEPS = (-0.5, 0.0, 0.5)
"""Where in the exposure the moving things are set; in between they move evenly."""

TARGET_DIAMETER_M = 0.40
TARGETS = 14
DUST_S = 1.1


def build(take: shot.Shot, targets: Array, scale: float = 1.0) -> bpy.types.Scene:
    """An empty file filled with the whole scene; ``scale`` shrinks the picture for a preview."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 0, shot.FRAMES - 1
    scene.render.fps, scene.render.fps_base = shot.FPS, 1.0
    rock = _rock_material()
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


def render_still(scene: bpy.types.Scene, take: shot.Shot, path: Path) -> None:
    """All that stands still, once, with sun, shadows and skylight, as seen from the middle of the camera's path."""
    rotation, (left, right, top, bottom) = _still_view(take)
    lens = bpy.data.cameras.new("Still")
    eye = bpy.data.objects.new("Still", lens)
    scene.collection.objects.link(eye)
    eye.matrix_world = _pose(take.local(np.array(shot.EYE_GULLY)), rotation)
    width, height = round(right - left), round(bottom - top)
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", 36.0
    lens.lens = STILL_FOCAL_PX * 36.0 / width
    lens.shift_x, lens.shift_y = (left + right) / 2.0 / width, -(top + bottom) / 2.0 / width
    moving = [thing for thing in scene.objects if thing.name.split(".")[0] in ("Block", "Dust")]
    for thing in moving:
        thing.hide_render = True
    render, before = scene.render, (scene.render.resolution_x, scene.render.resolution_y, scene.camera)
    render.resolution_x, render.resolution_y, scene.camera = width, height, eye
    render.use_motion_blur, scene.cycles.samples = False, STILL_SAMPLES
    render.image_settings.color_depth, render.filepath = "16", str(path)
    bpy.ops.render.render(write_still=True)
    render.resolution_x, render.resolution_y, scene.camera = before
    render.use_motion_blur, scene.cycles.samples, render.image_settings.color_depth = True, SAMPLES, "8"
    for thing in moving:
        thing.hide_render = False
    bpy.data.objects.remove(eye)


def paint(scene: bpy.types.Scene, take: shot.Shot, still: Path) -> None:
    """Give all that stands still the colours of the still, from where it was taken: no light has to be traced again."""
    rotation, bounds = _still_view(take)
    eye = bpy.data.objects.new("Still eye", None)
    scene.collection.objects.link(eye)
    eye.matrix_world = _pose(take.local(np.array(shot.EYE_GULLY)), rotation)
    painted = _painted_material(eye, _shadow_axis(scene, take), bounds, still, take.radius)
    for name in ("Terrain", "Around", "Scrub", "Stones"):
        bpy.data.objects[name].data.materials[0] = painted


def _still_view(take: shot.Shot) -> tuple[Array, tuple[float, float, float, float]]:
    """Rotation of the still's camera, and its bounds (left, right, top, bottom) about the axis in its pixels."""
    _, rotations = shot.camera_path(take, np.arange(shot.FRAMES) / shot.FPS)
    middle = Rotation.from_matrix(rotations).mean().as_matrix()
    corners = np.array([[u, v, shot.FOCAL_PX] for u in (-1, 1) for v in (-1, 1)], float)
    corners[:, :2] *= np.array([shot.WIDTH, shot.HEIGHT]) / 2.0
    seen = np.einsum("ij,fkj,ck->fci", middle, rotations, corners).reshape(-1, 3)
    pixels = STILL_FOCAL_PX * seen[:, :2] / seen[:, 2:]
    low = np.floor(pixels.min(axis=0) - STILL_MARGIN_PX)
    high = np.ceil(pixels.max(axis=0) + STILL_MARGIN_PX)
    return middle, (low[0], high[0], low[1], high[1])


def _pose(position: Array, rotation: Array) -> Matrix:
    """Blender's matrix of a camera, which looks along -z with y up."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.T @ np.diag([1.0, -1.0, -1.0])
    matrix[:3, 3] = position
    return Matrix(matrix.tolist())


def _shadow_axis(scene: bpy.types.Scene, take: shot.Shot) -> bpy.types.Object:
    """An empty that goes with the block, its z towards the sun."""
    axis = bpy.data.objects.new("Shadow", None)
    scene.collection.objects.link(axis)
    axis.rotation_euler = Vector(take.turned(np.array(SUN_GULLY))).to_track_quat("Z", "Y").to_euler()
    times, frames = _exposures()
    _keys(axis, "location", frames, shot.block_centre(take, times))
    return axis


def _painted_material(
    eye: bpy.types.Object, axis: bpy.types.Object, bounds: tuple[float, float, float, float], still: Path, radius: float
) -> bpy.types.Material:
    """The still, thrown onto the ground from its eye, darker where the block stands before the sun."""
    material, make, link = _material("Painted")

    def maths(operation: str, first, second=None, clamp: bool = False):
        node = make("ShaderNodeMath")
        node.operation, node.use_clamp = operation, clamp
        for socket, value in zip(node.inputs, (first, second), strict=False):
            if isinstance(value, float):
                socket.default_value = value
            elif value is not None:
                link(value, socket)
        return node.outputs[0]

    def coordinates(thing: bpy.types.Object):
        place, parts = make("ShaderNodeTexCoord"), make("ShaderNodeSeparateXYZ")
        place.object = thing
        link(place.outputs["Object"], parts.inputs[0])
        return parts.outputs

    left, right, top, bottom = bounds
    x, y, z = coordinates(eye)
    depth = maths("MULTIPLY", z, -1.0)
    u = maths(
        "ADD",
        maths("MULTIPLY", maths("DIVIDE", x, depth), float(STILL_FOCAL_PX / (right - left))),
        float(-left / (right - left)),
    )
    v = maths(
        "ADD",
        maths("MULTIPLY", maths("DIVIDE", y, depth), float(STILL_FOCAL_PX / (bottom - top))),
        float(bottom / (bottom - top)),
    )
    both, image = make("ShaderNodeCombineXYZ"), make("ShaderNodeTexImage")
    link(u, both.inputs[0])
    link(v, both.inputs[1])
    image.image, image.interpolation, image.extension = bpy.data.images.load(str(still)), "Linear", "EXTEND"
    link(both.outputs[0], image.inputs["Vector"])

    x, y, z = coordinates(axis)
    away = maths("SQRT", maths("ADD", maths("MULTIPLY", x, x), maths("MULTIPLY", y, y)))
    edge = maths("DIVIDE", maths("SUBTRACT", 1.12 * radius, away), 0.24 * radius, clamp=True)
    behind = maths("MULTIPLY", maths("LESS_THAN", z, 0.0), maths("GREATER_THAN", z, -8.0))
    grey = make("ShaderNodeRGBToBW")
    link(image.outputs["Color"], grey.inputs[0])
    lit = maths("DIVIDE", maths("SUBTRACT", grey.outputs[0], 0.06), 0.10, clamp=True)
    shade = maths("MULTIPLY", maths("MULTIPLY", edge, behind), lit)
    light, surface = maths("SUBTRACT", 1.0, maths("MULTIPLY", shade, 0.68)), make("ShaderNodeEmission")
    link(image.outputs["Color"], surface.inputs["Color"])
    link(light, surface.inputs["Strength"])
    material.cycles.emission_sampling = "NONE"
    link(surface.outputs[0], make("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def render_frame(scene: bpy.types.Scene, frame: int, path: Path, pixel: Array) -> None:
    """One frame as a PNG: the whole with few samples, what is near the block with more, and a sensor's noise."""
    import cv2

    image = _rendered(scene, frame, path, SAMPLES)
    left, top = (int(value) - PATCH_PX for value in pixel)
    right, bottom = min(left + 2 * PATCH_PX, shot.WIDTH), min(top + 2 * PATCH_PX, shot.HEIGHT)
    left, top = max(left, 0), max(top, 0)
    if right - left > 8 and bottom - top > 8:
        render = scene.render
        render.use_border = render.use_crop_to_border = True
        # a hair inside the pixel, or rounding may take the one before
        render.border_min_x, render.border_max_x = (left + 0.01) / shot.WIDTH, (right + 0.01) / shot.WIDTH
        render.border_min_y = (shot.HEIGHT - bottom + 0.01) / shot.HEIGHT
        render.border_max_y = (shot.HEIGHT - top + 0.01) / shot.HEIGHT
        patch = _rendered(scene, frame, path, PATCH_SAMPLES)
        render.use_border = render.use_crop_to_border = False
        image[top:bottom, left:right] = patch
    noise = np.random.default_rng([shot.SEED, frame]).normal(0.0, NOISE_LEVELS, image.shape)
    cv2.imwrite(str(path), np.clip(np.rint(image + noise), 0, 255).astype(np.uint8))


def _rendered(scene: bpy.types.Scene, frame: int, path: Path, samples: int) -> NDArray[np.uint8]:
    import cv2

    scene.frame_set(frame)
    scene.cycles.samples, scene.cycles.seed = samples, frame
    scene.render.filepath = str(path.with_name("rendering.png"))
    bpy.ops.render.render(write_still=True)
    return cv2.imread(scene.render.filepath)


def encode(frames: Path, out: Path) -> None:
    """The frames as H.264 in MP4, by Blender's sequencer."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render, strips = scene.render, scene.sequence_editor_create().strips
    names = [f"{frame:04d}.png" for frame in range(shot.FRAMES)]
    strip = strips.new_image("Frames", str(frames / names[0]), channel=1, frame_start=1)
    for name in names[1:]:
        strip.elements.append(name)
    scene.frame_start, scene.frame_end = 1, shot.FRAMES
    render.fps, render.fps_base = shot.FPS, 1.0
    render.resolution_x, render.resolution_y, render.resolution_percentage = shot.WIDTH, shot.HEIGHT, 100
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    render.filepath, render.use_file_extension = str(out), True
    render.image_settings.media_type = "VIDEO"
    movie = render.ffmpeg
    movie.format, movie.codec, movie.audio_codec = "MPEG4", "H264", "NONE"
    movie.constant_rate_factor, movie.ffmpeg_preset, movie.gopsize = QUALITY, "GOOD", shot.FPS
    bpy.ops.render.render(animation=True)


def terrain_tree(take: shot.Shot) -> BVHTree:
    """The terrain for ray casting."""
    return BVHTree.FromPolygons(take.local(take.site.vertices).tolist(), take.site.faces.tolist())


def is_clear(tree: BVHTree, eye: Array, point: Array, margin: float) -> bool:
    """Whether nothing of the terrain lies between the eye and a point, but for the last ``margin`` metres."""
    way = point - eye
    length = float(np.linalg.norm(way))
    return tree.ray_cast(Vector(eye), Vector(way / length), length - margin)[0] is None


def choose_targets(take: shot.Shot, tree: BVHTree) -> Array:
    """Centres (n, 3) of the survey targets: on the rock, in sight, off the run, spread over the reference frame."""
    position, rotation = (one[0] for one in shot.camera_path(take, np.zeros(1)))
    path = shot.block_centre(take, np.arange(0.0, shot.FRAMES / shot.FPS, 0.05))
    radius = TARGET_DIAMETER_M / 2.0
    places, pixels = [], []
    for u in np.arange(70.0, shot.WIDTH - 69.0, 19.0):
        for v in np.arange(60.0, shot.HEIGHT - 59.0, 19.0):
            ray = rotation.T @ np.array([u - shot.WIDTH / 2.0, v - shot.HEIGHT / 2.0, shot.FOCAL_PX])
            hit, normal, _, _ = tree.ray_cast(Vector(position), Vector(ray / np.linalg.norm(ray)))
            if hit is None:
                continue
            centre = np.array(hit) + (radius - 0.03) * np.array(normal)
            rim = [centre + radius * 1.3 * (np.cos(a) * rotation[0] + np.sin(a) * rotation[1]) for a in range(7)]
            if not all(is_clear(tree, position, point, 0.0) for point in rim):
                continue
            if np.linalg.norm(path - centre, axis=1).min() > 2.0:
                places.append(centre)
                pixels.append([u / shot.WIDTH, v / shot.WIDTH])
    spread = np.column_stack([pixels, 0.012 * (np.array(places) - position) @ rotation[2]])
    chosen = [int(np.argmin(spread[:, 0] + spread[:, 1]))]
    while len(chosen) < TARGETS:
        gap = np.min(np.linalg.norm(spread[:, None] - spread[None, chosen], axis=2), axis=1)
        chosen.append(int(np.argmax(gap)))
    return np.array([places[i] for i in sorted(chosen, key=lambda i: (round(3 * pixels[i][1]), pixels[i][0]))])


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
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


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


def _rock_material() -> bpy.types.Material:
    """Marl and limestone: beds, blotches, grain and grass, all by noise at world positions."""
    material, make, link = _material("Rock")
    place = make("ShaderNodeNewGeometry")
    blotch = _noise(make, link, place, 0.16, 6.0)
    grain = _noise(make, link, place, 2.6, 5.0)
    ramp = make("ShaderNodeValToRGB")
    _ramp(
        ramp,
        (0.36, (0.085, 0.075, 0.066)),
        (0.46, (0.185, 0.160, 0.132)),
        (0.55, (0.285, 0.240, 0.185)),
        (0.66, (0.46, 0.405, 0.325)),
    )
    link(_sum(make, link, blotch, 0.55, grain, 0.45), ramp.inputs["Fac"])
    speckle = make("ShaderNodeTexVoronoi")
    speckle.inputs["Scale"].default_value = 3.2
    link(place.outputs["Position"], speckle.inputs["Vector"])
    dark = make("ShaderNodeMapRange")
    dark.inputs["From Min"].default_value, dark.inputs["From Max"].default_value = 0.0, 0.42
    dark.inputs["To Min"].default_value, dark.inputs["To Max"].default_value = 0.55, 1.08
    link(speckle.outputs["Distance"], dark.inputs["Value"])
    rock = _mixed(make, link, ramp.outputs["Color"], dark.outputs["Result"], "MULTIPLY")
    grass = make("ShaderNodeValToRGB")
    _ramp(grass, (0.35, (0.040, 0.050, 0.018)), (0.65, (0.125, 0.128, 0.045)))
    link(grain, grass.inputs["Fac"])
    share = make("ShaderNodeMath")
    share.operation = "MULTIPLY"
    patches = make("ShaderNodeValToRGB")
    _ramp(patches, (0.52, (0, 0, 0)), (0.60, (1, 1, 1)))
    link(_sum(make, link, _noise(make, link, place, 0.09, 8.0), 0.85, grain, 0.15), patches.inputs["Fac"])
    flat = make("ShaderNodeSeparateXYZ")
    link(place.outputs["Normal"], flat.inputs["Vector"])
    gentle = make("ShaderNodeMapRange")
    gentle.inputs["From Min"].default_value, gentle.inputs["From Max"].default_value = 0.45, 0.75
    link(flat.outputs["Z"], gentle.inputs["Value"])
    link(patches.outputs["Color"], share.inputs[0])
    link(gentle.outputs["Result"], share.inputs[1])
    colour = _mixed(make, link, rock, grass.outputs["Color"], "MIX", share.outputs["Value"])
    bump = make("ShaderNodeBump")
    bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.9, 0.12
    link(_noise(make, link, place, 3.5, 5.0), bump.inputs["Height"])
    surface = make("ShaderNodeBsdfDiffuse")
    link(colour, surface.inputs["Color"])
    link(bump.outputs["Normal"], surface.inputs["Normal"])
    link(surface.outputs["BSDF"], make("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def _material(name: str):
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree.nodes.new, tree.links.new


def _noise(make, link, place, scale: float, detail: float):
    noise = make("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = scale, detail
    noise.inputs["Roughness"].default_value = 0.62
    link(place.outputs["Position"], noise.inputs["Vector"])
    return noise.outputs["Fac"]


def _sum(make, link, first, a: float, second, b: float):
    products = []
    for value, weight in ((first, a), (second, b)):
        product = make("ShaderNodeMath")
        product.operation = "MULTIPLY"
        product.inputs[1].default_value = weight
        link(value, product.inputs[0])
        products.append(product)
    total = make("ShaderNodeMath")
    link(products[0].outputs[0], total.inputs[0])
    link(products[1].outputs[0], total.inputs[1])
    return total.outputs[0]


def _mixed(make, link, a, b, blend: str, factor=None):
    mix = make("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", blend
    mix.inputs["Factor"].default_value = 1.0
    link(a, mix.inputs[6])
    link(b, mix.inputs[7])
    if factor is not None:
        link(factor, mix.inputs[0])
    return mix.outputs[2]


def _ramp(node, *stops) -> None:
    elements = node.color_ramp.elements
    while len(elements) < len(stops):
        elements.new(0.5)
    for element, (place, colour) in zip(elements, stops, strict=True):
        element.position, element.color = place, (*colour, 1.0)


def _diffuse(name: str, colour, glow: float = 0.0) -> bpy.types.Material:
    material, make, link = _material(name)
    surface = make("ShaderNodeBsdfDiffuse")
    surface.inputs["Color"].default_value = (*colour, 1.0)
    shader = surface.outputs["BSDF"]
    if glow:
        light, both = make("ShaderNodeEmission"), make("ShaderNodeAddShader")
        light.inputs["Color"].default_value = (*colour, 1.0)
        light.inputs["Strength"].default_value = glow
        link(shader, both.inputs[0])
        link(light.outputs["Emission"], both.inputs[1])
        shader = both.outputs["Shader"]
        material.cycles.emission_sampling = "NONE"
    link(shader, make("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


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
    from scipy.spatial import cKDTree

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
    _mesh("Scrub", take.local(vertices), faces, _diffuse("Scrub", (0.075, 0.092, 0.030)))


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
    _mesh("Stones", take.local(vertices), faces, _diffuse("Stones", (0.25, 0.225, 0.19)))


def _target(name: str, place: Array) -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(
        segments=32, ring_count=16, radius=TARGET_DIAMETER_M / 2.0, location=tuple(place)
    )
    thing = bpy.context.object
    thing.name = name
    material = bpy.data.materials.get("Target") or _diffuse("Target", (0.80, 0.16, 0.008), 0.35)
    thing.data.materials.append(material)


def _block(take: shot.Shot) -> None:
    """The block keyed at the start, middle and end of each exposure."""
    points, faces = _angular(np.random.default_rng(3), 26, 0.9)
    thing = _mesh("Block", points * take.diameters / 2.0, faces, _diffuse("Block", (0.60, 0.56, 0.49)))
    times, frames = _exposures()
    thing.rotation_mode = "QUATERNION"
    # the shutter of the first frame opens before the clock starts
    turns = shot.block_turns(take, np.maximum(times, 0.0)).as_quat(scalar_first=True)
    _keys(thing, "location", frames, shot.block_centre(take, times))
    _keys(thing, "rotation_quaternion", frames, _continuous(turns))


def _camera(scene: bpy.types.Scene, take: shot.Shot) -> None:
    lens = bpy.data.cameras.new("Camera")
    eye = bpy.data.objects.new("Camera", lens)
    scene.collection.objects.link(eye)
    scene.camera = eye
    lens.sensor_fit, lens.sensor_width = "HORIZONTAL", 36.0
    lens.lens = shot.FOCAL_PX * 36.0 / shot.WIDTH
    lens.clip_start, lens.clip_end = 1.0, 2000.0
    times, frames = _exposures()
    position, rotation = shot.camera_path(take, times)
    # Blender's camera looks along -z with y up
    turns = np.swapaxes(rotation, 1, 2) @ np.diag([1.0, -1.0, -1.0])
    eye.rotation_mode = "QUATERNION"
    _keys(eye, "location", frames, position)
    _keys(eye, "rotation_quaternion", frames, _continuous(Rotation.from_matrix(turns).as_quat(scalar_first=True)))


def _exposures() -> tuple[Array, Array]:
    """Video times of all keys, and the same in Blender's frames; the middle of an exposure is its timestamp."""
    frames = np.arange(shot.FRAMES)[:, None] + np.array(STEPS) * shot.SHUTTER_S * shot.FPS
    return frames.ravel() / shot.FPS, frames.ravel()


def _continuous(quaternions: Array) -> Array:
    signs = np.sign(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
    return quaternions * np.concatenate([[1.0], np.cumprod(np.where(signs < 0, -1.0, 1.0))])[:, None]


def _keys(thing: bpy.types.Object, path: str, frames: Array, values: Array, interpolation: str = "LINEAR") -> None:
    thing.animation_data_create()
    action = thing.animation_data.action
    if action is None:
        action = bpy.data.actions.new(thing.name)
        thing.animation_data.action = action
    values = values[:, None] if values.ndim == 1 else values
    code = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items[interpolation].value
    for index in range(values.shape[1]):
        curve = action.fcurve_ensure_for_datablock(thing, path, index=index)
        curve.keyframe_points.add(len(frames))
        curve.keyframe_points.foreach_set("co", np.column_stack([frames, values[:, index]]).astype(np.float32).ravel())
        curve.keyframe_points.foreach_set("interpolation", np.full(len(frames), code, np.int32))
        curve.update()


def _dust(take: shot.Shot, impact) -> None:
    """A few soft puffs that rise from a contact, grow and fade; the harder the blow, the more of them."""
    rng = np.random.default_rng(int(1000 * impact.time))
    material = bpy.data.materials.get("Dust") or _dust_material()
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
        _keys(puff, "location", frames, contact + 0.1 * normal + drift * (age**0.6)[:, None] * strength)
        size = (0.06 + rng.uniform(0.25, 0.6) * strength * age**0.5)[:, None] * rng.uniform(0.8, 1.2, 3)
        size[0] = size[-1] = 0.0
        _keys(puff, "scale", frames, size)
        alpha = 0.8 * strength * (1.0 - age) ** 1.4
        _keys(puff, "color", frames, np.column_stack([np.ones((12, 3)), alpha]))


def _dust_material() -> bpy.types.Material:
    material, make, link = _material("Dust")
    info, facing, soft = make("ShaderNodeObjectInfo"), make("ShaderNodeLayerWeight"), make("ShaderNodeMath")
    facing.inputs["Blend"].default_value = 0.5
    soft.operation = "SUBTRACT"
    soft.inputs[0].default_value = 1.0
    link(facing.outputs["Facing"], soft.inputs[1])
    square, thin = make("ShaderNodeMath"), make("ShaderNodeMath")
    square.operation, thin.operation = "POWER", "MULTIPLY"
    square.inputs[1].default_value = 1.3
    link(soft.outputs[0], square.inputs[0])
    link(square.outputs[0], thin.inputs[0])
    link(info.outputs["Alpha"], thin.inputs[1])
    clear, grey, mix = make("ShaderNodeBsdfTransparent"), make("ShaderNodeEmission"), make("ShaderNodeMixShader")
    grey.inputs["Color"].default_value = (0.60, 0.54, 0.44, 1.0)
    material.cycles.emission_sampling = "NONE"
    link(thin.outputs[0], mix.inputs["Fac"])
    link(clear.outputs["BSDF"], mix.inputs[1])
    link(grey.outputs["Emission"], mix.inputs[2])
    link(mix.outputs["Shader"], make("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


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


def check_projection(scene: bpy.types.Scene, take: shot.Shot, points: Array) -> float:
    """The largest difference [px] between this script's projection and Blender's, over points and some frames."""
    from bpy_extras.object_utils import world_to_camera_view

    worst = 0.0
    for frame in range(0, shot.FRAMES, 23):
        scene.frame_set(frame)
        position, rotation = (one[0] for one in shot.camera_path(take, np.array([frame / shot.FPS])))
        centre = shot.block_centre(take, np.array([frame / shot.FPS]))
        own = shot.projected(np.concatenate([points, centre]), position, rotation)
        block = np.array(bpy.data.objects["Block"].matrix_world.translation)
        seen = [world_to_camera_view(scene, scene.camera, Vector(point)) for point in [*points, block]]
        theirs = np.array([[one.x * shot.WIDTH, (1.0 - one.y) * shot.HEIGHT] for one in seen])
        worst = max(worst, float(np.abs(own - theirs).max()))
    return worst
