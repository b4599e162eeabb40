# SPDX-License-Identifier: GPL-3.0-or-later
"""The same picture from every render engine: nothing needs a lamp, all colours are in the meshes."""

import bpy

SAMPLES = 12


def use_engine(scene: bpy.types.Scene, engine: str) -> None:
    """Set a scene up for "cycles", "workbench" or "eevee"."""
    {"cycles": _cycles, "workbench": _workbench, "eevee": _eevee}[engine](scene)
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.render.film_transparent = False


def _cycles(scene: bpy.types.Scene) -> None:
    scene.render.engine = "CYCLES"
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = SAMPLES
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 0
    cycles.transparent_max_bounces = 0
    cycles.use_auto_tile = False


def _workbench(scene: bpy.types.Scene) -> None:
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.display.render_aa = "8"
    shading = scene.display.shading
    shading.light, shading.color_type = "FLAT", "VERTEX"
    shading.show_cavity = False
    shading.show_object_outline = shading.show_shadows = shading.show_xray = False
    shading.show_specular_highlight = False


def _eevee(scene: bpy.types.Scene) -> None:
    scene.render.engine = "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = SAMPLES
    scene.eevee.use_shadows = False
