# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain's look: the sliders of a scene → the colours of its meshes and the values of its material.

The 3-D view's solid mode shows a colour attribute, the material computes the same from the shading attributes.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import bpy
import numpy as np

from ....core.colours import srgb_to_linear
from ..storage import materials, store
from . import terrain_colours, terrain_mesh

PLAIN_THIN = 5 / 7
"""Where the material hatches half of the thin data, colours are mixed everywhere, somewhat less."""


LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
LINEAR_PART = (np.arange(256) / 255).astype(np.float32)


@dataclass(frozen=True)
class Look:
    """Strengths 0 … 1 of hillshade, eye-dome, the mark of thin data and colours; brightness and contrast about 1."""

    hillshade: float
    eye_dome: float
    thin: float
    brightness: float
    contrast: float
    scan_colours: float = 1.0
    footage_colours: float = 1.0


def look_of(scene: bpy.types.Scene) -> Look:
    """What the scene's sliders say."""
    settings = scene.rockfall_terrain
    return Look(**{name: store.double(getattr(settings, name)) for name in Look.__dataclass_fields__})


def apply(scene: bpy.types.Scene) -> None:
    """Show all terrain of a scene as its sliders say."""
    look = look_of(scene)
    paint(meshes(scene), look)
    material = bpy.data.materials.get((materials.TERRAIN_MATERIAL, None))
    if material is not None:
        materials.set_terrain_values(material, asdict(look))


def meshes(scene: bpy.types.Scene) -> list[bpy.types.Mesh]:
    """The meshes of the scene's tiles, and those that stand in for them in the 3-D view."""
    tiles = [obj for obj in store.with_role(scene, store.TERRAIN_ROLE) if obj.type == "MESH"]
    stand_ins = [stand_in for tile in tiles if (stand_in := terrain_mesh.stand_in(tile)) is not None]
    return list({obj.data.name: obj.data for obj in (*tiles, *stand_ins)}.values())


def paint(which: Iterable[bpy.types.Mesh], look: Look) -> None:
    """Compute the relief colours of meshes anew; a mesh without the shading attributes stays as it is."""
    for mesh in which:
        relief = mesh.attributes.get(materials.RELIEF_COLOUR)
        if relief is None or any(name not in mesh.attributes for name in terrain_mesh.SHADING):
            continue
        values = np.empty((len(terrain_mesh.SHADING), len(mesh.vertices)), dtype=np.float32)
        for row, name in zip(values, terrain_mesh.SHADING, strict=True):
            mesh.attributes[name].data.foreach_get("value", row)
        own = [terrain_colours.read(mesh, name) for name in materials.OWN_COLOURS]
        relief.data.foreach_set("color", relief_colours(*values, look, *own).ravel())
        mesh.update_tag()


def relief_colours(
    hillshade: np.ndarray,
    eye_dome: np.ndarray,
    thin: np.ndarray,
    look: Look,
    scan: np.ndarray | None = None,
    footage: np.ndarray | None = None,
) -> np.ndarray:
    """(n, 4) linear colours: rock × light of hillshade and eye-dome, thin data bluish; single precision.

    Parameters
    ----------
    scan, footage : (n, 4) sRGB and how much it counts, in the place of rock.
    """
    light = _lit(hillshade, look.hillshade) * _lit(eye_dome, look.eye_dome)
    if look.contrast != 1.0:
        light = materials.RELIEF_MIDDLE * (light / materials.RELIEF_MIDDLE) ** np.float32(look.contrast)
    own = [(found, part) for found, part in ((scan, look.scan_colours), (footage, look.footage_colours))
           if found is not None and part > 0]  # fmt: skip
    of_rock = np.float32(materials.RELIEF_BRIGHTNESS) * light
    of_own = np.float32(materials.OWN_LIGHT) + np.float32((1 - materials.OWN_LIGHT) / materials.RELIEF_MIDDLE) * light
    parts = [LINEAR_PART[found[:, 3] * found[:, :3].any(axis=1)] * np.float32(part) for found, part in own]
    for part in parts:
        of_rock += part * (of_own - of_rock)
    of_rock *= np.float32(look.brightness)
    mixed = np.asarray(thin, dtype=np.float32) * np.float32(PLAIN_THIN * look.thin)
    colours = np.empty((len(light), 4), dtype=np.float32)
    for axis in range(3):
        rock: np.ndarray | np.float32 = np.float32(materials.ROCK_COLOUR[axis])
        for (found, _), part in zip(own, parts, strict=True):
            rock = rock + part * (LINEAR[found[:, axis]] - rock)
        np.multiply(mixed, np.float32(materials.THIN_COLOUR[axis]) - rock, out=colours[:, axis])
        colours[:, axis] += rock
        colours[:, axis] *= of_rock
    np.minimum(colours, 1.0, out=colours)
    colours[:, 3] = 1.0
    return colours


def _lit(value: np.ndarray, strength: float) -> np.ndarray:
    return np.asarray(value, dtype=np.float32) * np.float32(strength) + np.float32(1.0 - strength)
