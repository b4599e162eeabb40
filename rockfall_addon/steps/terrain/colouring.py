# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: the terrain in the colours of the footage."""

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.film.composed.photographs import photographed
from ....core.outreach.photographs import photographs_of
from ....core.progress import Progress
from ...scene.storage import materials, store
from ...scene.terrain import terrain, terrain_colours, terrain_look
from ...view import job
from ...view.reporting import possible


class ROCKFALL_OT_colour_from_footage(job.InBackground, bpy.types.Operator):
    """Give the terrain the colours of the aligned videos, wherever they show it; pictures are taken over the whole
    video, so that what moves is gone"""

    bl_idname = "rockfall.colour_from_footage"
    bl_label = "Colour from Footage"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        return (
            possible(cls, terrain.tiles(scene), "Import a terrain first")
            and possible(cls, terrain_colours.filmed(scene), "Align a video first, whose file is there")
            and job.is_free(cls)
        )

    def prepare(self, context: bpy.types.Context) -> job.Work:
        scene = context.scene
        whole = terrain.surface_of_scene(scene)
        filmed = terrain_colours.filmed(scene)
        parts = [
            (tile[store.ID], [terrain_colours.bare(mesh, tile, whole) for mesh in terrain_colours.meshes_of(tile)])
            for tile in terrain.tiles(scene)
        ]

        def compute(progress: Progress) -> object:
            pictures, said = photographs_of(filmed, progress=progress)
            if not pictures:
                raise RockfallError(said[0] if said else "No video shows the terrain.")
            found = {}
            for done, (identifier, surfaces) in enumerate(parts):
                progress("Colouring the terrain", done, len(parts))
                found[identifier] = [_seen(*photographed(surface, pictures, whole)) for surface in surfaces]
            return found, said

        def keep(scene: bpy.types.Scene, result: object) -> str:
            found, said = result
            there = {tile[store.ID]: tile for tile in terrain.tiles(scene)}
            vertices = coloured = 0
            for identifier, each in found.items():
                meshes = terrain_colours.meshes_of(there[identifier]) if identifier in there else []
                if [len(mesh.vertices) for mesh in meshes] != [len(colours) for colours in each]:
                    raise RockfallError("The terrain was changed while it was coloured. Colour it again.")
                for mesh, colours in zip(meshes, each, strict=True):
                    terrain_colours.write(mesh, materials.FOOTAGE_COLOURS, colours)
                terrain_colours.remember(scene, there[identifier])
                vertices, coloured = vertices + len(each[0]), coloured + int((each[0][:, 3] > 0).sum())
            terrain_look.apply(scene)
            share = 100 * coloured / max(vertices, 1)
            seen = f"{share:.0f} % of the terrain's points are seen and have the footage's colours."
            return " ".join((seen, *said))

        return job.Work("terrain", compute, keep)


class ROCKFALL_OT_remove_footage_colours(bpy.types.Operator):
    """Take the colours of the footage off the terrain; those of the scan stay"""

    bl_idname = "rockfall.remove_footage_colours"
    bl_label = "Remove Footage Colours"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = terrain_colours.have(context.scene, materials.FOOTAGE_COLOURS)
        return possible(cls, there, "The terrain has no colours of the footage")

    def execute(self, context: bpy.types.Context) -> set[str]:
        terrain_colours.remove(context.scene)
        terrain_look.apply(context.scene)
        return {"FINISHED"}


def _seen(colours: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(n, 4) uint8 of colours and their weight; what is not seen has a usual colour, for the border of what is."""
    seen = weight > 0
    if seen.any():
        colours = np.where(seen[:, None], colours, np.median(colours[seen], axis=0))
    return np.rint(255 * np.clip(np.column_stack([colours, weight]), 0, 1)).astype(np.uint8)


CLASSES = (ROCKFALL_OT_colour_from_footage, ROCKFALL_OT_remove_footage_colours)
