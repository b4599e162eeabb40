# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry nodes that play simulated blocks: each vertex is a parabola, and has a block while it lasts.

Blender computes the places itself, so that ten thousand runs play without Python at each frame.
"""

import bpy

from ..storage.materials import math_node

GROUP = "Rockfall simulated blocks"
BLOCK, SIZE = "Block", "Size"
"""Inputs of the group: an object whose mesh has the radius 1, and how much larger than they are blocks are drawn."""
BEGIN, END = "begin_s", "end_s"
"""Attributes of a parabola: display times [s]."""
VELOCITY, ACCELERATION, SPIN, TURN = "velocity", "acceleration", "spin", "turn"
"""At its start [m/s], [m/s²], [rad/s], and how the block is turned there."""
HALF_AXES = "half_axes_m"
"""Attribute: half of d1, d2, d3 of the block [m]."""


def blocks_group() -> bpy.types.GeometryNodeTree:
    """The node group, made once in a file."""
    existing = bpy.data.node_groups.get((GROUP, None))
    if existing is not None:
        return existing
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    interface = group.interface
    interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    interface.new_socket(BLOCK, in_out="INPUT", socket_type="NodeSocketObject")
    size = interface.new_socket(SIZE, in_out="INPUT", socket_type="NodeSocketFloat")
    size.default_value, size.min_value = 1.0, 0.0
    interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")

    new, link = group.nodes.new, group.links.new
    source, result = new("NodeGroupInput"), new("NodeGroupOutput")
    now = new("GeometryNodeInputSceneTime").outputs["Seconds"]
    begin, end = _attribute(group, BEGIN, "FLOAT"), _attribute(group, END, "FLOAT")
    early, late = (_compare(group, now, bound, how) for bound, how in ((begin, "LESS_THAN"), (end, "GREATER_EQUAL")))
    either = new("FunctionNodeBooleanMath")
    either.operation = "OR"
    link(early, either.inputs[0])
    link(late, either.inputs[1])
    cut = new("GeometryNodeDeleteGeometry")
    cut.domain = "POINT"
    link(source.outputs["Geometry"], cut.inputs["Geometry"])
    link(either.outputs[0], cut.inputs["Selection"])

    elapsed = math_node(group, "SUBTRACT", now, begin)
    half = math_node(group, "MULTIPLY", elapsed, 0.5)
    speed = new("ShaderNodeVectorMath")  # v + ½ a τ
    speed.operation = "ADD"
    link(_attribute(group, VELOCITY, "FLOAT_VECTOR"), speed.inputs[0])
    link(_scaled(group, _attribute(group, ACCELERATION, "FLOAT_VECTOR"), half), speed.inputs[1])
    way = _scaled(group, speed.outputs[0], elapsed)
    axes, larger = _attribute(group, HALF_AXES, "FLOAT_VECTOR"), math_node(group, "SUBTRACT", source.outputs[SIZE], 1.0)
    lift = new("ShaderNodeCombineXYZ")  # an enlarged block must not sink into the slope
    mean = new("ShaderNodeVectorMath")
    mean.operation = "DOT_PRODUCT"
    mean.inputs[1].default_value = (1 / 3, 1 / 3, 1 / 3)
    link(axes, mean.inputs[0])
    link(math_node(group, "MULTIPLY", mean.outputs["Value"], larger), lift.inputs["Z"])
    offset = new("ShaderNodeVectorMath")
    offset.operation = "ADD"
    link(way, offset.inputs[0])
    link(lift.outputs[0], offset.inputs[1])
    place = new("GeometryNodeSetPosition")
    link(cut.outputs[0], place.inputs["Geometry"])
    link(offset.outputs[0], place.inputs["Offset"])

    spin = _attribute(group, SPIN, "FLOAT_VECTOR")
    length = new("ShaderNodeVectorMath")
    length.operation = "LENGTH"
    link(spin, length.inputs[0])
    turned = new("FunctionNodeAxisAngleToRotation")
    link(spin, turned.inputs["Axis"])
    link(math_node(group, "MULTIPLY", length.outputs["Value"], elapsed), turned.inputs["Angle"])
    turn = new("FunctionNodeRotateRotation")
    turn.rotation_space = "GLOBAL"
    link(_attribute(group, TURN, "QUATERNION"), turn.inputs["Rotation"])
    link(turned.outputs[0], turn.inputs["Rotate By"])

    block = new("GeometryNodeObjectInfo")
    link(source.outputs[BLOCK], block.inputs["Object"])
    instances = new("GeometryNodeInstanceOnPoints")
    link(place.outputs[0], instances.inputs["Points"])
    link(block.outputs["Geometry"], instances.inputs["Instance"])
    link(turn.outputs[0], instances.inputs["Rotation"])
    link(_scaled(group, axes, source.outputs[SIZE]), instances.inputs["Scale"])
    link(instances.outputs[0], result.inputs[0])
    return group


def _attribute(group: bpy.types.GeometryNodeTree, name: str, kind: str) -> bpy.types.NodeSocket:
    node = group.nodes.new("GeometryNodeInputNamedAttribute")
    node.data_type = kind
    node.inputs["Name"].default_value = name
    return node.outputs["Attribute"]


def _compare(
    group: bpy.types.GeometryNodeTree, a: bpy.types.NodeSocket, b: bpy.types.NodeSocket, operation: str
) -> bpy.types.NodeSocket:
    node = group.nodes.new("FunctionNodeCompare")
    node.data_type, node.operation = "FLOAT", operation
    group.links.new(a, node.inputs[0])
    group.links.new(b, node.inputs[1])
    return node.outputs[0]


def _scaled(
    group: bpy.types.GeometryNodeTree, vector: bpy.types.NodeSocket, factor: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    node = group.nodes.new("ShaderNodeVectorMath")
    node.operation = "SCALE"
    group.links.new(vector, node.inputs[0])
    group.links.new(factor, node.inputs["Scale"])
    return node.outputs[0]
