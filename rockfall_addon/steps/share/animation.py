# SPDX-License-Identifier: GPL-3.0-or-later
"""An animation that the core has computed, as a scene that Blender's exporters write."""

from collections.abc import Callable, Iterable
from errno import ENOSPC
from os import strerror
from pathlib import Path

import addon_utils
import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.film.presets import blender_rate
from ....core.outreach.animation import Animation, linear_rgba, load_animation
from ....core.progress import Progress
from ...view.reporting import told

COLOUR = "Colour"
CHANNELS = (("location", 3), ("rotation_quaternion", 4))
ROOM = "Make room on the disk, or choose another folder."


def write(source: Path, files: list[Path], progress: Progress) -> None:
    """Write files of an animation, in the formats of their endings.

    Raises
    ------
    RockfallError : one cannot be written.
    """
    # Unlike factory settings, this leaves the enabled extensions alone.
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)
    check_formats(file.suffix.removeprefix(".") for file in files)
    animation = load_animation(source)
    progress("Building the scene", 0, len(files))
    _build(animation)
    for i, file in enumerate(files):
        progress(f"Writing {file.name}", i, len(files))
        _export(file, animation)
    progress(f"Writing {files[-1].name}", len(files), len(files))


def check_formats(endings: Iterable[str]) -> None:
    """Refuse formats that this Blender is built without.

    Raises
    ------
    RockfallError : there is one.
    """
    built = bpy.app.build_options
    for ending in endings:
        name, there = {"usdc": ("USD", built.usd), "usda": ("USD", built.usd), "abc": ("Alembic", built.alembic)}.get(
            ending, ("", True)
        )
        if not there:
            raise RockfallError(
                f"This Blender is built without {name}. Leave that format out, or use the Blender of blender.org."
            )


def _build(animation: Animation) -> None:
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = blender_rate(animation.rate)
    scene.frame_start, scene.frame_end = 0, animation.frames - 1
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 1.0
    root = bpy.data.objects.new("Rockfall", None)
    scene.collection.objects.link(root)
    origin = animation.origin
    root["survey_origin_m"] = origin.vector.tolist()
    root["crs"] = origin.crs
    for key, text in animation.about.items():
        if text:
            root[key] = text
    if animation.ground is not None:
        mesh = _mesh("Terrain", animation.ground.vertices, animation.ground.faces)
        colours = mesh.color_attributes.new(COLOUR, "FLOAT_COLOR", "POINT")
        colours.data.foreach_set("color", linear_rgba(animation.ground_colours).astype(np.float32).ravel())
        mesh.materials.append(_material("Terrain", None))
        _child(scene, root, bpy.data.objects.new("Terrain", mesh))
    materials = {
        group: _material(group or "Measured", animation.colours[animation.groups.index(group)])
        for group in dict.fromkeys(animation.groups)
    }
    moments = np.arange(animation.frames)
    bodies: dict[tuple[object, ...], bpy.types.Mesh] = {}
    for i, name in enumerate(animation.names):
        group, size = animation.groups[i], animation.sizes[i]
        key = (group, *size.tolist())
        if key not in bodies:
            bodies[key] = _mesh(f"Block {name}", animation.body.vertices * size, animation.body.faces)
            bodies[key].materials.append(materials[group])
        block = bpy.data.objects.new(name, bodies[key])
        block["kind"] = "simulated" if group else "measured"
        block["model"] = group
        block.rotation_mode = "QUATERNION"
        _child(scene, root, block)
        _animate(block, moments, animation.place[i], animation.turn[i])
        _child(scene, root, _path(f"Path {name}", animation.paths[i]))


def _child(scene: bpy.types.Scene, root: bpy.types.Object, obj: bpy.types.Object) -> None:
    scene.collection.objects.link(obj)
    obj.parent = root


def _mesh(name: str, vertices: np.ndarray, faces: np.ndarray) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh


def _path(name: str, places: np.ndarray) -> bpy.types.Object:
    """A path as edges between its places; a row without numbers parts them."""
    known = np.isfinite(places[:, 0])
    number = np.cumsum(known) - 1
    joined = np.flatnonzero(known[:-1] & known[1:])
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(int(known.sum()))
    mesh.vertices.foreach_set("co", places[known].astype(np.float32).ravel())
    mesh.edges.add(len(joined))
    mesh.edges.foreach_set("vertices", np.column_stack([number[joined], number[joined + 1]]).astype(np.int32).ravel())
    mesh.update()
    return bpy.data.objects.new(name, mesh)


def _material(name: str, colour: np.ndarray | None) -> bpy.types.Material:
    """A matt one of a colour; of the colours of the vertices for None."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = 1.0
    if colour is None:
        vertex = tree.nodes.new("ShaderNodeVertexColor")
        vertex.layer_name = COLOUR
        tree.links.new(vertex.outputs["Color"], shader.inputs["Base Color"])
    else:
        shader.inputs["Base Color"].default_value = linear_rgba(colour[None])[0].tolist()
        material.diffuse_color = linear_rgba(colour[None])[0].tolist()
    return material


def _animate(block: bpy.types.Object, moments: np.ndarray, place: np.ndarray, turn: np.ndarray) -> None:
    """Keys at every frame, straight between them."""
    action = bpy.data.actions.new(block.name)
    data = block.animation_data_create()
    data.action = action
    slot = action.slots.new("OBJECT", block.name)
    data.action_slot = slot
    strip = action.layers.new("Motion").strips.new(type="KEYFRAME")
    bag = strip.channelbag(slot, ensure=True)
    block.location, block.rotation_quaternion = place[0], turn[0]
    for (path, count), values in zip(CHANNELS, (place, turn), strict=True):
        for index in range(count):
            curve = bag.fcurves.new(path, index=index)
            points = curve.keyframe_points
            points.add(len(moments))
            points.foreach_set("co", np.column_stack([moments, values[:, index]]).astype(np.float32).ravel())
            points.foreach_set("interpolation", np.ones(len(moments), dtype=np.int32))  # linear
            curve.update()


def _export(file: Path, animation: Animation) -> None:
    exporter: Callable[[Path, Animation], object] = {
        ".glb": _gltf, ".usdc": _usd, ".usda": _usd, ".abc": _alembic,
    }[file.suffix]  # fmt: skip
    try:
        exporter(file, animation)
    except (RuntimeError, OSError) as error:
        raise RockfallError(f"Blender could not write {file.name}: {told(error)}. {ROOM}") from error
    if not file.is_file() or not file.stat().st_size:
        raise RockfallError(f"Blender has not written {file.name} ({strerror(ENOSPC)}?). {ROOM}")


def _gltf(file: Path, animation: Animation) -> None:
    addon_utils.enable("io_scene_gltf2")
    bpy.ops.export_scene.gltf(
        filepath=str(file),
        export_format="GLB",
        export_yup=True,
        export_extras=True,
        use_mesh_edges=True,
        export_animations=True,
        export_animation_mode="SCENE",
        export_anim_scene_split_object=False,
        export_force_sampling=False,
        export_optimize_animation_size=False,
        export_vertex_color="MATERIAL",
        export_frame_range=False,
    )


def _usd(file: Path, animation: Animation) -> None:
    bpy.ops.wm.usd_export(
        filepath=str(file),
        export_animation=True,
        export_mesh_colors=True,
        export_custom_properties=True,
        convert_orientation=False,
        meters_per_unit=1.0,
        xform_op_mode="TOS",
        root_prim_path="/root",
    )


def _alembic(file: Path, animation: Animation) -> None:
    bpy.ops.wm.alembic_export(
        filepath=str(file),
        start=0,
        end=animation.frames - 1,
        vcolors=True,
        export_custom_properties=True,
        as_background_job=False,
    )
