# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials of the scene, as shader nodes: rock, dust, plain colours, and the still thrown onto the ground."""

from pathlib import Path

import bpy


def rock() -> bpy.types.Material:
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


def dust() -> bpy.types.Material:
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


def diffuse(name: str, colour, glow: float = 0.0) -> bpy.types.Material:
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


def painted(
    eye: bpy.types.Object,
    axis: bpy.types.Object,
    bounds: tuple[float, float, float, float],
    focal_px: float,
    still: Path,
    radius: float,
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

    def coordinates(of: bpy.types.Object):
        place, parts = make("ShaderNodeTexCoord"), make("ShaderNodeSeparateXYZ")
        place.object = of
        link(place.outputs["Object"], parts.inputs[0])
        return parts.outputs

    left, right, top, bottom = bounds
    x, y, z = coordinates(eye)
    depth = maths("MULTIPLY", z, -1.0)
    u = maths(
        "ADD",
        maths("MULTIPLY", maths("DIVIDE", x, depth), float(focal_px / (right - left))),
        float(-left / (right - left)),
    )
    v = maths(
        "ADD",
        maths("MULTIPLY", maths("DIVIDE", y, depth), float(focal_px / (bottom - top))),
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
