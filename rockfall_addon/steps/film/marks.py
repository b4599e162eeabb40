# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the blocks have hit: rings that appear in the film at the moment of each impact."""

import bpy
import numpy as np

from ...scene.footage import timing
from ...scene.storage import materials, store
from . import captions

GROUP = "Rockfall impact marks"
CORNERS = 16
BANDS = (
    (1.0, 0.62, (0.96, 0.96, 0.96)),
    (1.22, 1.0, (0.05, 0.05, 0.05)),
)
"""Outer and inner radius of the bands of a ring, and their colours: it stands out from a white trail, too."""


def impact_marks(scene: bpy.types.Scene, radius_m: float) -> bpy.types.Object | None:
    """One mesh of a ring for each impact; None when there is none."""
    objects = [o for o in store.with_role(scene, store.PICK_ROLE) if o[store.KIND] == "impact"]
    if not objects:
        return None
    angles = np.linspace(0.0, 2 * np.pi, CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(CORNERS)])
    edges = np.vstack([part * circle for outer, inner, _ in BANDS for part in (outer, inner)])
    ring = edges * radius_m + (0.0, 0.0, 0.25 * radius_m)
    colours = np.repeat([materials.linear_colour(colour) for _, _, colour in BANDS], 2 * CORNERS, axis=0)
    following = (np.arange(CORNERS) + 1) % CORNERS
    band = np.column_stack([np.arange(CORNERS), following, CORNERS + following, CORNERS + np.arange(CORNERS)])
    faces = np.vstack([band + 2 * CORNERS * number for number in range(len(BANDS))])
    offsets = timing.kept_offsets(scene)
    corners, times = [], []
    for obj in objects:
        corners.append(ring @ np.array(obj.rotation_quaternion.to_matrix()).T + np.array(obj.location))
        begin_s = float(obj[store.TIME]) - offsets.get(obj[store.TRAJECTORY], 0.0)
        times.append(np.full(len(ring), begin_s))
    mesh = bpy.data.meshes.new("Film impacts")
    steps = len(ring) * np.arange(len(objects))
    mesh.from_pydata(np.vstack(corners).tolist(), [], (faces[None] + steps[:, None, None]).reshape(-1, 4).tolist())
    attribute = mesh.attributes.new(materials.TIME_ATTRIBUTE, "FLOAT", "POINT")
    attribute.data.foreach_set("value", np.concatenate(times).astype(np.float32))
    captions.mark_colour(mesh, np.tile(colours, (len(objects), 1)))
    mesh.materials.append(materials.emission_material("Rockfall caption", captions.COLOUR_ATTRIBUTE))
    marks = bpy.data.objects.new("Film impacts", mesh)
    marks.modifiers.new("Up to now", "NODES").node_group = until_now_group()
    return marks


def until_now_group() -> bpy.types.GeometryNodeTree:
    """Geometry nodes: what has a display time later than the scene's is not there yet."""
    existing = bpy.data.node_groups.get((GROUP, None))
    if existing is not None:
        return existing
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new, link = group.nodes.new, group.links.new
    source, result = new("NodeGroupInput"), new("NodeGroupOutput")
    seconds, time, later = (
        new("GeometryNodeInputSceneTime"),
        new("GeometryNodeInputNamedAttribute"),
        new("FunctionNodeCompare"),
    )
    time.data_type = "FLOAT"
    time.inputs["Name"].default_value = materials.TIME_ATTRIBUTE
    later.data_type, later.operation = "FLOAT", "GREATER_THAN"
    cut = new("GeometryNodeDeleteGeometry")
    cut.domain = "POINT"
    link(time.outputs["Attribute"], later.inputs[0])
    link(seconds.outputs["Seconds"], later.inputs[1])
    link(source.outputs[0], cut.inputs["Geometry"])
    link(later.outputs[0], cut.inputs["Selection"])
    link(cut.outputs[0], result.inputs[0])
    return group
