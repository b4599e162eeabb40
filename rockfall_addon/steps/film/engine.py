# SPDX-License-Identifier: GPL-3.0-or-later
"""The same picture from every render engine: nothing needs a lamp, all colours are in the meshes."""

import bpy
import gpu

from ....core.film.engines import IDENTIFIERS
from ...scene.storage import materials

FILM_SAMPLES, PICTURE_SAMPLES = 4, 24
"""Per pixel, and only to smooth edges: nothing here is noisy."""

MOST_LAYERS = 64
"""So many simulated paths are seen through each other."""


def use_engine(scene: bpy.types.Scene, engine: str, still: bool = False) -> None:
    """Set a scene up for "cycles", "workbench" or "eevee", once all its materials are there."""
    samples = PICTURE_SAMPLES if still else FILM_SAMPLES
    {"cycles": _cycles, "workbench": _workbench, "eevee": _eevee}[engine](scene, samples)
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.render.film_transparent = False


def engine_of(scene: bpy.types.Scene) -> str:
    """The engine for which a scene is set up."""
    return next(name for name, identifier in IDENTIFIERS.items() if identifier == scene.render.engine)


def quickest_engine() -> str:
    """Of an open Blender with a window, whose OpenGL works; a background process is asked by `core.film.engines`."""
    return "cycles" if bpy.app.background or _drawn_by_the_processor() else "workbench"


def _cycles(scene: bpy.types.Scene, samples: int) -> None:
    scene.render.engine = "CYCLES"
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 0
    cycles.transparent_max_bounces = MOST_LAYERS if bpy.data.materials.get((materials.PATH_MATERIAL, None)) else 0
    cycles.use_auto_tile = False
    for material in bpy.data.materials:
        if material.name.startswith("Rockfall"):
            # else each triangle is a lamp, and the tree of all lamps is built anew for every frame
            material.cycles.emission_sampling = "NONE"


def _workbench(scene: bpy.types.Scene, samples: int) -> None:
    scene.render.engine = "BLENDER_WORKBENCH"
    if samples > FILM_SAMPLES:
        scene.display.render_aa = "32"
    else:  # without a graphics card each of its samples draws all triangles anew, on one core
        scene.display.render_aa = "FXAA" if _drawn_by_the_processor() else "8"
    shading = scene.display.shading
    shading.light, shading.color_type = "FLAT", "VERTEX"
    shading.show_cavity = False
    shading.show_object_outline = shading.show_shadows = shading.show_xray = False
    shading.show_specular_highlight = False


def _drawn_by_the_processor() -> bool:
    """Whether there is no graphics card but a software renderer (llvmpipe)."""
    if bpy.app.background and hasattr(gpu, "init"):
        gpu.init()
    try:
        return gpu.platform.device_type_get() == "SOFTWARE"
    except SystemError:  # background work in a Blender without gpu.init
        return False


def _eevee(scene: bpy.types.Scene, samples: int) -> None:
    scene.render.engine = "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = samples
    scene.eevee.use_shadows = False
