# SPDX-License-Identifier: GPL-3.0-or-later
"""Captions as geometry: they are in the render with any engine, and follow the time without a handler.

A caption is a mesh of loose points that hold a number for each moment; geometry nodes look up the one for the scene's
time and write it out. Sizes and places are shares of the picture's height, the origin is its centre.
"""

import bpy
import numpy as np

from ....core.vectors import Array
from ...scene.storage import materials

VALUE_ATTRIBUTE, COLOUR_ATTRIBUTE = "caption_value", "colour"
WHITE, BRIGHT_GREY, GREY = (0.95, 0.96, 0.97), (0.84, 0.87, 0.90), (0.66, 0.71, 0.76)
SHADOW = (0.02, 0.025, 0.03)
ROUNDNESS = 3  # segments of a letter's curve: all letters are drawn six times over, and anew for every frame
OUTLINE, BOLD = 0.075, 0.022  # of the text's size, in a small picture
FONT = "Inter.woff2"


def caption(
    name: str,
    text: str,
    place: tuple[float, float],
    size: float,
    *,
    align: str = "LEFT",
    colour: tuple[float, float, float] = WHITE,
    values: Array | None = None,
    rate: float = 1.0,
    decimals: int = 1,
    unit: str = "",
    weight: float = 1.0,
) -> bpy.types.Object:
    """A line of text; with values (n,) the number at the scene's time stands between text and unit.

    Parameters
    ----------
    align : "LEFT", "CENTER" or "RIGHT" of the place.
    rate : how many values there are for a second.
    weight : 1 for letters that are legible when they are 15 pixels high, less for large ones.
    """
    series = np.zeros(1) if values is None else np.asarray(values, dtype=np.float64)
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(series))
    mesh.attributes.new(VALUE_ATTRIBUTE, "FLOAT", "POINT").data.foreach_set("value", series.astype(np.float32))
    mark_colour(mesh, np.tile(materials.linear_colour(colour), (len(series), 1)))
    obj = bpy.data.objects.new(name, mesh)
    obj.location = (*place, 0.0)
    modifier = obj.modifiers.new("Caption", "NODES")
    modifier.node_group = caption_group(align, values is not None)
    inputs = {
        "Text": text, "Unit": unit, "Decimals": decimals, "Rate": float(rate),
        "Size": float(size), "Weight": float(size * weight), "Colour": materials.linear_colour(colour),
    }  # fmt: skip
    for key, value in inputs.items():
        materials.set_input(modifier, key, value)
    return obj


def mark_colour(mesh: bpy.types.Mesh, colours: Array) -> None:
    """Give a mesh its colours (n, 4), linear; Workbench shows the active ones."""
    attribute = mesh.attributes.new(COLOUR_ATTRIBUTE, "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", colours.astype(np.float32).ravel())
    mesh.attributes.active_color_name = mesh.attributes.default_color_name = COLOUR_ATTRIBUTE


def caption_group(align: str, with_number: bool) -> bpy.types.GeometryNodeTree:
    """Geometry nodes: a series of numbers → the line of text at the scene's time, with a dark outline.

    A text without a number has a group of its own, which does not look at the time and so is not made anew.
    """
    name = f"Rockfall caption {align.lower()}{' number' if with_number else ''}"
    existing = bpy.data.node_groups.get((name, None))
    if existing is not None:
        return existing
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    group.is_modifier = True
    for socket, kind in (
        ("Geometry", "Geometry"), ("Text", "String"), ("Unit", "String"), ("Decimals", "Int"),
        ("Rate", "Float"), ("Size", "Float"), ("Weight", "Float"), ("Colour", "Color"),
    ):  # fmt: skip
        group.interface.new_socket(socket, in_out="INPUT", socket_type=f"NodeSocket{kind}")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, result = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    link = group.links.new

    text = _text_with_number(group, source) if with_number else source.outputs["Text"]
    curves = group.nodes.new("GeometryNodeStringToCurves")
    _set_font(curves)
    curves.inputs["Align X"].default_value = {"LEFT": "Left", "CENTER": "Center", "RIGHT": "Right"}[align]
    link(text, curves.inputs["String"])
    link(source.outputs["Size"], curves.inputs["Size"])
    coarse = group.nodes.new("GeometryNodeSetSplineResolution")
    coarse.inputs["Resolution"].default_value = ROUNDNESS
    link(curves.outputs[0], coarse.inputs[0])
    fill = group.nodes.new("GeometryNodeFillCurve")
    link(coarse.outputs[0], fill.inputs["Curve"])
    real = group.nodes.new("GeometryNodeRealizeInstances")
    link(fill.outputs["Mesh"], real.inputs["Geometry"])

    join = group.nodes.new("GeometryNodeJoinGeometry")
    letters = _moved(group, source, real.outputs[0], [(BOLD, 0.0, 0.0), (-BOLD, 0.0, 0.0)])
    bright = _coloured(group, letters)
    link(source.outputs["Colour"], bright.inputs["Value"])
    sides = [(OUTLINE * right, OUTLINE * up, -OUTLINE) for right in (-1, 1) for up in (-1, 1)]
    dark = _coloured(group, _moved(group, source, real.outputs[0], sides))
    dark.inputs["Value"].default_value = materials.linear_colour(SHADOW)
    material = group.nodes.new("GeometryNodeSetMaterial")
    material.inputs["Material"].default_value = materials.emission_material("Rockfall caption", COLOUR_ATTRIBUTE)
    for geometry in (bright, dark):
        link(geometry.outputs["Geometry"], join.inputs[0])
    link(source.outputs["Geometry"], join.inputs[0])  # keeps the active colour attribute
    link(join.outputs[0], material.inputs["Geometry"])
    link(material.outputs[0], result.inputs[0])
    return group


def _moved(
    group: bpy.types.GeometryNodeTree,
    source: bpy.types.Node,
    letters: bpy.types.NodeSocket,
    places: list[tuple[float, float, float]],
) -> bpy.types.NodeSocket:
    """Copies of the letters, moved by shares of their size: thin strokes vanish in a small picture."""
    around = group.nodes.new("GeometryNodeJoinGeometry")
    for place in places:
        move = group.nodes.new("ShaderNodeVectorMath")
        move.operation = "SCALE"
        move.inputs[0].default_value = place
        group.links.new(source.outputs["Weight"], move.inputs["Scale"])
        moved = group.nodes.new("GeometryNodeTransform")
        group.links.new(letters, moved.inputs["Geometry"])
        group.links.new(move.outputs[0], moved.inputs["Translation"])
        group.links.new(moved.outputs[0], around.inputs[0])
    return around.outputs[0]


def _text_with_number(group: bpy.types.GeometryNodeTree, source: bpy.types.Node) -> bpy.types.NodeSocket:
    """Text, number at the scene's time, unit → one string."""
    new, link = group.nodes.new, group.links.new
    seconds = new("GeometryNodeInputSceneTime")
    index = new("ShaderNodeMath")
    index.operation = "MULTIPLY"
    link(seconds.outputs["Seconds"], index.inputs[0])
    link(source.outputs["Rate"], index.inputs[1])
    whole = new("FunctionNodeFloatToInt")
    whole.rounding_mode = "ROUND"
    link(index.outputs[0], whole.inputs[0])
    attribute = new("GeometryNodeInputNamedAttribute")
    attribute.data_type = "FLOAT"
    attribute.inputs["Name"].default_value = VALUE_ATTRIBUTE
    sample = new("GeometryNodeSampleIndex")
    sample.data_type, sample.domain, sample.clamp = "FLOAT", "POINT", True
    link(source.outputs["Geometry"], sample.inputs["Geometry"])
    link(attribute.outputs["Attribute"], sample.inputs["Value"])
    link(whole.outputs[0], sample.inputs["Index"])
    number = new("FunctionNodeValueToString")
    link(sample.outputs["Value"], number.inputs["Value"])
    link(source.outputs["Decimals"], number.inputs["Decimals"])
    join = new("GeometryNodeStringJoin")
    # the input that takes many has the last one first
    for part in (source.outputs["Unit"], number.outputs["String"], source.outputs["Text"]):
        link(part, join.inputs["Strings"])
    return join.outputs["String"]


def _coloured(group: bpy.types.GeometryNodeTree, geometry: bpy.types.NodeSocket) -> bpy.types.Node:
    store = group.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "FLOAT_COLOR", "POINT"
    store.inputs["Name"].default_value = COLOUR_ATTRIBUTE
    group.links.new(geometry, store.inputs["Geometry"])
    return store


def _set_font(curves: bpy.types.Node) -> None:
    folder = bpy.utils.system_resource("DATAFILES", path="fonts")
    try:
        font = bpy.data.fonts.load(f"{folder}/{FONT}", check_existing=True)
        font.pack()  # the file may be opened by another Blender
    except RuntimeError:
        return  # Blender's built-in font
    if "Font" in curves.inputs:
        curves.inputs["Font"].default_value = font
    else:
        curves.font = font
