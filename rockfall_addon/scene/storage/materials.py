# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials and geometry-node groups, made by code so that no binary file has to be trusted."""

from collections.abc import Callable, Mapping

import bpy
import numpy as np

from ....core.colours import srgb_to_linear

ROCK_COLOUR = (0.47, 0.43, 0.38)
THIN_COLOUR = (0.30, 0.42, 0.60)
RELIEF_BRIGHTNESS = 1.2
RELIEF_MIDDLE = 0.55  # the light that contrast leaves as it is
OWN_LIGHT = 0.6
"""Scans and pictures bring light with their colours: this part of it is left to them."""
SUN_DIRECTION = (-0.5, -0.5, 0.7071)  # from the north-west as on maps would be behind a camera that looks up the slope
TRAIL_GROUP = "Rockfall trail"
TIME_ATTRIBUTE = "display_time_s"
SPEED_ATTRIBUTE = "speed_mps"
SPEED_COLOUR = "speed_colour"
TICK_ATTRIBUTE = "tick"
TICK_RADII = 1.5
RELIEF_COLOUR = "relief"
SCAN_COLOURS, FOOTAGE_COLOURS = OWN_COLOURS = ("scan_colours", "footage_colours")
PATH_MATERIAL = "Rockfall simulated film path"
TERRAIN_MATERIAL = "Rockfall terrain"
TERRAIN_VALUES = {
    "hillshade": 0.75, "eye_dome": 0.75, "thin": 0.7, "brightness": 1.0, "contrast": 1.0,
    SCAN_COLOURS: 1.0, FOOTAGE_COLOURS: 1.0,
}  # fmt: skip
"""Nodes of the terrain's material whose values the sliders set."""


def terrain_material() -> bpy.types.Material:
    """Relief as in Noël et al. 2018, figure 3: hillshade × eye-dome from the vertex attributes, thin data hatched.

    Rock, or the colours of the scan and of the footage where there are any.

    It emits its colour: no lamp, no shadow rays, no noise, the same picture from every engine. One from a file of an
    earlier version, without nodes for the sliders, is built anew.
    """
    material = _material(TERRAIN_MATERIAL, _build_terrain)
    tree = material.node_tree
    if any(name not in tree.nodes for name in TERRAIN_VALUES):
        tree.nodes.clear()
        _build_terrain(tree, tree.nodes.new("ShaderNodeOutputMaterial"))
    return material


def set_terrain_values(material: bpy.types.Material, values: Mapping[str, float]) -> None:
    """Give the terrain's material the sliders' values; nodes that a person has removed are left alone."""
    for name, value in values.items():
        node = material.node_tree.nodes.get(name)
        if node is not None and node.outputs[0].default_value != value:
            node.outputs[0].default_value = value


def emission_material(name: str, attribute: str, strength: float = 1.0) -> bpy.types.Material:
    """Shows a colour attribute as it is, whatever the light."""

    def build(tree: bpy.types.ShaderNodeTree, output: bpy.types.Node) -> None:
        colour = tree.nodes.new("ShaderNodeAttribute")
        colour.attribute_name = attribute
        emission = tree.nodes.new("ShaderNodeEmission")
        emission.inputs["Strength"].default_value = strength
        tree.links.new(colour.outputs["Color"], emission.inputs["Color"])
        tree.links.new(emission.outputs[0], output.inputs["Surface"])

    return _material(name, build)


def path_material(opacity: float) -> bpy.types.Material:
    """Of simulated paths in a film: their colours, and through them a part of what is behind. Workbench shows no part.

    opacity : of one path; the same material serves all.
    """

    def build(tree: bpy.types.ShaderNodeTree, output: bpy.types.Node) -> None:
        colour, emission = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeEmission")
        colour.attribute_name = SPEED_COLOUR
        clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
        mix.name = "Opacity"
        tree.links.new(colour.outputs["Color"], emission.inputs["Color"])
        tree.links.new(clear.outputs[0], mix.inputs[1])
        tree.links.new(emission.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs["Surface"])

    material = _material(PATH_MATERIAL, build)
    material.surface_render_method = "BLENDED"  # for EEVEE, which else shows grains
    material.node_tree.nodes["Opacity"].inputs[0].default_value = opacity
    return material


def shaded_material(name: str, attribute: str) -> bpy.types.Material:
    """A colour attribute, brighter where the surface faces the hillshade's sun; needs no lamp."""

    def build(tree: bpy.types.ShaderNodeTree, output: bpy.types.Node) -> None:
        colour, geometry = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeNewGeometry")
        colour.attribute_name = attribute
        towards = tree.nodes.new("ShaderNodeVectorMath")
        towards.operation = "DOT_PRODUCT"
        towards.inputs[1].default_value = SUN_DIRECTION
        tree.links.new(geometry.outputs["Normal"], towards.inputs[0])
        light = math_node(tree, "MULTIPLY_ADD", towards.outputs["Value"], 0.45)
        light.node.inputs[2].default_value = 0.6
        _emit(tree, output, colour.outputs["Color"], light)

    return _material(name, build)


def trail_group() -> bpy.types.GeometryNodeTree:
    """Geometry nodes: a polyline with times becomes a tube, wholly or up to the current time, with beads at ticks.

    The polyline's bare points are joined to the tube because Blender keeps the active colour attribute (which the
    viewport's solid mode shows) from the original mesh alone; its edges would be drawn black.
    """
    existing = bpy.data.node_groups.get((TRAIL_GROUP, None))
    if existing is not None and "Ticks" in existing.interface.items_tree:
        return existing
    group = bpy.data.node_groups.new(TRAIL_GROUP, "GeometryNodeTree")
    if existing is not None:  # of a file saved before there were ticks
        existing.user_remap(group)
        bpy.data.node_groups.remove(existing)
        group.name = TRAIL_GROUP
    group.is_modifier = True
    interface = group.interface
    interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    radius = interface.new_socket("Radius", in_out="INPUT", socket_type="NodeSocketFloat")
    radius.subtype, radius.default_value, radius.min_value = "DISTANCE", 0.06, 0.0
    until_now = interface.new_socket("Up to now", in_out="INPUT", socket_type="NodeSocketBool")
    until_now.default_value = False
    interface.new_socket("Ticks", in_out="INPUT", socket_type="NodeSocketBool").default_value = False
    interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")

    new, link = group.nodes.new, group.links.new
    source, result = new("NodeGroupInput"), new("NodeGroupOutput")
    seconds = new("GeometryNodeInputSceneTime")
    time = new("GeometryNodeInputNamedAttribute")
    time.data_type = "FLOAT"
    time.inputs["Name"].default_value = TIME_ATTRIBUTE
    later = new("FunctionNodeCompare")
    later.data_type, later.operation = "FLOAT", "GREATER_THAN"
    both = new("FunctionNodeBooleanMath")
    both.operation = "AND"
    cut = new("GeometryNodeDeleteGeometry")
    cut.domain = "POINT"
    curve, circle, tube = (
        new("GeometryNodeMeshToCurve"),
        new("GeometryNodeCurvePrimitiveCircle"),
        new("GeometryNodeCurveToMesh"),
    )
    circle.inputs["Resolution"].default_value = 6
    material = new("GeometryNodeSetMaterial")
    material.inputs["Material"].default_value = emission_material("Rockfall trail", SPEED_COLOUR)
    join = new("GeometryNodeJoinGeometry")
    link(time.outputs["Attribute"], later.inputs[0])
    link(seconds.outputs["Seconds"], later.inputs[1])
    link(later.outputs[0], both.inputs[0])
    link(source.outputs["Up to now"], both.inputs[1])
    link(source.outputs["Geometry"], cut.inputs["Geometry"])
    link(both.outputs[0], cut.inputs["Selection"])
    link(cut.outputs[0], curve.inputs[0])
    link(source.outputs["Radius"], circle.inputs["Radius"])
    link(curve.outputs[0], tube.inputs["Curve"])
    link(circle.outputs[0], tube.inputs["Profile Curve"])
    link(tube.outputs[0], material.inputs[0])
    link(material.outputs[0], join.inputs[0])
    bare = new("GeometryNodeDeleteGeometry")
    bare.domain, bare.mode = "EDGE", "EDGE_FACE"
    link(cut.outputs[0], bare.inputs["Geometry"])
    link(_beads(group, source, cut.outputs[0], material.inputs["Material"].default_value), join.inputs[0])
    link(bare.outputs[0], join.inputs[0])  # the last one: its active colour is the whole's
    link(join.outputs[0], result.inputs[0])
    return group


def _beads(
    group: bpy.types.GeometryNodeTree,
    source: bpy.types.Node,
    points: bpy.types.NodeSocket,
    look: bpy.types.Material,
) -> bpy.types.NodeSocket:
    """A bead on each point that is a tick, in the colour of the point."""
    new, link = group.nodes.new, group.links.new
    tick, both = new("GeometryNodeInputNamedAttribute"), new("FunctionNodeBooleanMath")
    tick.data_type, both.operation = "BOOLEAN", "AND"
    tick.inputs["Name"].default_value = TICK_ATTRIBUTE
    size, bead = new("ShaderNodeMath"), new("GeometryNodeMeshIcoSphere")
    size.operation, size.inputs[1].default_value = "MULTIPLY", TICK_RADII
    instances, real, material = (
        new("GeometryNodeInstanceOnPoints"),
        new("GeometryNodeRealizeInstances"),
        new("GeometryNodeSetMaterial"),
    )
    material.inputs["Material"].default_value = look
    link(tick.outputs["Attribute"], both.inputs[0])
    link(source.outputs["Ticks"], both.inputs[1])
    link(source.outputs["Radius"], size.inputs[0])
    link(size.outputs[0], bead.inputs["Radius"])
    link(points, instances.inputs["Points"])
    link(both.outputs[0], instances.inputs["Selection"])
    link(bead.outputs[0], instances.inputs["Instance"])
    link(instances.outputs[0], real.inputs[0])
    link(real.outputs[0], material.inputs[0])
    return material.outputs[0]


def socket_id(group: bpy.types.GeometryNodeTree, name: str) -> str:
    """Identifier under which a modifier keeps the value of a group's input."""
    return next(s.identifier for s in group.interface.items_tree if s.name == name and s.in_out == "INPUT")


def set_input(modifier: bpy.types.NodesModifier, name: str, value: object) -> None:
    """Give an input of a modifier's node group its value, in Blender 5.2 and before."""
    identifier = socket_id(modifier.node_group, name)
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, identifier).value = value
    else:
        modifier[identifier] = value


def get_input(modifier: bpy.types.NodesModifier, name: str) -> object:
    """The value of an input of a modifier's node group, in Blender 5.2 and before."""
    identifier = socket_id(modifier.node_group, name)
    if hasattr(modifier, "properties"):
        return getattr(modifier.properties.inputs, identifier).value
    return modifier[identifier]


def linear_colour(colour: tuple[float, float, float]) -> tuple[float, float, float, float]:
    """An sRGB colour as Blender's materials and attributes want it."""
    r, g, b = srgb_to_linear(np.array(colour)).tolist()
    return r, g, b, 1.0


def _material(name: str, build: Callable[[bpy.types.ShaderNodeTree, bpy.types.Node], None]) -> bpy.types.Material:
    existing = bpy.data.materials.get((name, None))
    if existing is not None:
        return existing
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    build(tree, tree.nodes.new("ShaderNodeOutputMaterial"))
    return material


def _emit(
    tree: bpy.types.ShaderNodeTree, output: bpy.types.Node, colour: bpy.types.NodeSocket, light: bpy.types.NodeSocket
) -> None:
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(colour, emission.inputs["Color"])
    tree.links.new(light, emission.inputs["Strength"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


def _build_terrain(tree: bpy.types.ShaderNodeTree, output: bpy.types.Node) -> None:
    new, link = tree.nodes.new, tree.links.new

    def attribute(name: str) -> bpy.types.NodeSocket:
        node = new("ShaderNodeAttribute")
        node.attribute_name = name
        return node.outputs["Fac"]

    def slider(name: str) -> bpy.types.NodeSocket:
        node = new("ShaderNodeValue")
        node.name = node.label = name
        node.outputs[0].default_value = TERRAIN_VALUES[name]
        return node.outputs[0]

    def lit(name: str) -> bpy.types.NodeSocket:
        """1 - strength · (1 - value)."""
        dark = math_node(tree, "SUBTRACT", attribute(name), 1.0)
        result = math_node(tree, "MULTIPLY_ADD", dark, slider(name))
        result.node.inputs[2].default_value = 1.0
        return result

    # hatches: stripes of one metre across the diagonal, where data are thin
    place, split = new("ShaderNodeTexCoord"), new("ShaderNodeSeparateXYZ")
    link(place.outputs["Object"], split.inputs[0])
    diagonal = math_node(
        tree, "ADD", split.outputs["X"], math_node(tree, "ADD", split.outputs["Y"], split.outputs["Z"])
    )
    stripe = math_node(tree, "GREATER_THAN", math_node(tree, "FRACT", diagonal, 0.0), 0.5)
    hatch = math_node(tree, "MULTIPLY", stripe, math_node(tree, "MULTIPLY", attribute("thin"), slider("thin")))

    def mixed(kind: str, part: bpy.types.NodeSocket) -> tuple[bpy.types.NodeSocket, ...]:
        """The inputs A and B of a new node that mixes them, and its output."""
        node = new("ShaderNodeMix")
        node.data_type = kind
        link(part, next(s for s in node.inputs if s.enabled and s.name == "Factor"))
        ends = [next(s for s in node.inputs if s.enabled and s.name == name) for name in "AB"]
        return *ends, next(s for s in node.outputs if s.enabled)

    light = math_node(tree, "MULTIPLY", lit("hillshade"), lit("eye_dome"))
    even = math_node(tree, "POWER", math_node(tree, "DIVIDE", light, RELIEF_MIDDLE), slider("contrast"))
    bright = math_node(tree, "MULTIPLY", even, RELIEF_MIDDLE * RELIEF_BRIGHTNESS)
    own = math_node(tree, "MULTIPLY_ADD", even, 1.0 - OWN_LIGHT)
    own.node.inputs[2].default_value = OWN_LIGHT
    colour: bpy.types.NodeSocket | None = None
    for name in OWN_COLOURS:
        found = new("ShaderNodeAttribute")
        found.attribute_name = name
        # a mesh without the attribute gives black, with alpha 1; black of a scan is a colour that it does not know
        known = math_node(tree, "GREATER_THAN", found.outputs["Fac"], 0.0)
        part = math_node(tree, "MULTIPLY", math_node(tree, "MULTIPLY", known, found.outputs["Alpha"]), slider(name))
        before, after, result = mixed("RGBA", part)
        if colour is None:
            before.default_value = (*ROCK_COLOUR, 1.0)
        else:
            link(colour, before)
        link(found.outputs["Color"], after)
        colour = result
        before, after, lighter = mixed("FLOAT", part)
        link(bright, before)
        link(own, after)
        bright = lighter
    before, after, result = mixed("RGBA", hatch)
    link(colour, before)
    after.default_value = (*THIN_COLOUR, 1.0)
    _emit(tree, output, result, math_node(tree, "MULTIPLY", bright, slider("brightness")))


def math_node(
    tree: bpy.types.NodeTree, operation: str, a: bpy.types.NodeSocket, b: bpy.types.NodeSocket | float
) -> bpy.types.NodeSocket:
    """The output of a new node that does one thing to two numbers."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    tree.links.new(a, node.inputs[0])
    if isinstance(b, float):
        node.inputs[1].default_value = b
    else:
        tree.links.new(b, node.inputs[1])
    return node.outputs[0]
