# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in glTF and GLB."""

import json
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..colours import linear_to_srgb
from ..errors import InputError, readable
from ..reading import check_promise, reading
from .coordinate_step import single_precision_step
from .scan_colours import Colours, colours_of, joined_colours
from .source import Source, check_face_indices

DAMAGED = "Export it again, as GLB or with its .bin beside it"
TRIANGLES = "Export it with triangles"
TRIANGLE_FAN = 6
READ_EXTENSIONS = {
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_pbrSpecularGlossiness",
    "EXT_texture_webp",
}  # fmt: skip
"""What changes no coordinate, or whole numbers for coordinates, which its nodes place."""
COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Of a component by its type: glTF 2.0, 3.6.2.2."""


def read_gltf(path: Path) -> Source:
    """Read all meshes of a glTF or GLB scene, in the places its nodes give them; Y is up by the standard.

    Raises
    ------
    InputError : damaged, a buffer is missing, no triangles, packed or written in a way that is not read.
    """
    import trimesh

    size = path.stat().st_size
    if not size:
        raise InputError("The file is empty", file=path, advice="Export it again")
    with reading(path, "glTF file", DAMAGED):
        document = _document(path, size)
        _check_accessors(document, size, path)
        notes = _examined(document, path)
        scene = trimesh.load_scene(path, process=False)
        points, faces, colours, offset, step = [], [], [], 0, np.zeros(3)
        for node in sorted(scene.graph.nodes_geometry):
            transform, name = scene.graph[node]
            geometry = scene.geometry[name]
            if not isinstance(geometry, trimesh.Trimesh):
                continue
            vertices = np.asarray(geometry.vertices, np.float64)
            points.append(vertices @ transform[:3, :3].T + transform[:3, 3])
            step = np.maximum(step, np.abs(transform[:3, :3]) @ single_precision_step(vertices))
            triangles = np.asarray(geometry.faces, np.int64)
            faces.append(check_face_indices(triangles, len(vertices), path).astype(np.int64) + offset)
            colours.append((_colours(geometry), str(name)))
            offset += len(vertices)
    if not faces:
        raise InputError("The mesh has no faces", file=path, advice="Export the surface with its faces (triangles)")
    found, said = joined_colours(colours)
    joined = f"{len(faces)} meshes of the scene were joined." if len(faces) > 1 else ""
    return Source(
        np.concatenate(points), check_face_indices(np.concatenate(faces), offset, path), up="y",
        notes=tuple(note for note in (*notes, joined, said) if note), colours=found, step=step,
    )  # fmt: skip


def _colours(mesh: Any) -> Colours | None:
    """Of the vertices, or of the texture at them."""
    visual = mesh.visual
    if visual.kind == "texture":
        if getattr(visual.material, "baseColorTexture", None) is None or visual.uv is None:
            return None
        return np.asarray(visual.to_color().vertex_colors[:, :3], dtype=np.uint8)
    if visual.kind != "vertex":
        return None
    return colours_of(linear_to_srgb(np.asarray(visual.vertex_colors[:, :3], dtype=np.float64) / 255))[0]


def _document(path: Path, size: int) -> dict[str, Any]:
    """What the file says of itself: the whole of a glTF, the first part of a GLB."""
    if path.suffix.lower() != ".glb":
        return json.loads(path.read_bytes())
    with path.open("rb") as file:
        beginning = file.read(20)
        if beginning[:4] != b"glTF":
            raise InputError('Not a GLB file: it does not begin with "glTF"', file=path, advice="Check its extension")
        promised, length = (int.from_bytes(beginning[at : at + 4], "little") for at in (8, 12))
        if promised > size or length > size:
            raise InputError("The file is truncated", file=path, advice="Copy or export it again")
        return json.loads(file.read(length))


def _examined(document: dict[str, Any], path: Path) -> list[str]:
    """What to say of meshes whose numbers are read, and of what is left out.

    Raises
    ------
    InputError : their numbers are packed, or mean something that is not read.
    """
    if other := sorted(set(document.get("extensionsRequired", [])) - READ_EXTENSIONS):
        raise InputError(
            f"The file needs the extension{'s' * (len(other) > 1)} {readable(', '.join(other), 100)}, which "
            f"{'are' if len(other) > 1 else 'is'} not read",
            file=path,
            advice="Export it without compression (Draco, meshopt) and extensions",
        )
    accessors, nodes = document.get("accessors", []), document.get("nodes", [])
    primitives = [one for mesh in document.get("meshes", []) for one in mesh["primitives"]]
    for primitive in primitives:
        for number in (primitive["attributes"]["POSITION"], primitive.get("indices")):
            accessor = accessors[number] if number is not None else {}
            what = next((word for word, is_so in (
                ("sparse numbers", "sparse" in accessor), ("normalised numbers", bool(accessor.get("normalized"))),
                ("no numbers for its vertices", number is not None and "bufferView" not in accessor),
            ) if is_so), "")  # fmt: skip
            if what:
                raise InputError(
                    f"A mesh has {what}, which are not read", file=path, advice="Export it with plain coordinates"
                )
        if primitive.get("mode", 4) == TRIANGLE_FAN:
            raise InputError("A mesh consists of triangle fans, which are not read", file=path, advice=TRIANGLES)
    found = {
        "points": sum(one.get("mode", 4) == 0 for one in primitives),
        "lines": sum(one.get("mode", 4) in (1, 2, 3) for one in primitives),
        "skins, so that meshes stay as they are at rest": sum("skin" in node for node in nodes),
        "shape keys": sum("targets" in one for one in primitives),
        "instances": sum("EXT_mesh_gpu_instancing" in node.get("extensions", {}) for node in nodes),
        "scenes other than the first": max(len(document.get("scenes", [])) - 1, 0),
    }
    left = ", ".join(f"{what} ({many:,})" for what, many in found.items() if many)
    return [f"Left out: {left}."] if left else []


def _check_accessors(document: dict[str, Any], size: int, path: Path) -> None:
    """Every table of numbers is as long as the buffers at the most, which may be in files beside this one."""
    for buffer in document.get("buffers", []):
        uri = unquote(buffer.get("uri", ""))
        if uri and not uri.startswith("data:"):
            beside = path.parent / uri
            if not beside.is_file():
                raise InputError(f"The glTF file cannot be read: {uri} is not beside it", file=path, advice=DAMAGED)
            size += beside.stat().st_size
    for number, accessor in enumerate(document.get("accessors", [])):
        count, component = int(accessor["count"]), COMPONENT_BYTES[accessor["componentType"]]
        check_promise(f"{count} rows in accessor {number}", count * component, size, path)
        if count < 0:
            raise InputError(f"The accessor {number} has {count} rows", file=path, advice=DAMAGED)
