# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps: what they are of, which one is painted on the terrain, and what there is to say about them."""

import bpy

from ...scene.simulation import hazard_maps, simulation_setup
from ...scene.storage import store
from ...view import job
from ...view.panel import RockfallPanel, advise, paragraph, show_remarks


class ROCKFALL_PT_simulation_maps(RockfallPanel, bpy.types.Panel):
    bl_label = "Maps"
    bl_idname = "ROCKFALL_PT_simulation_maps"
    bl_parent_id = "ROCKFALL_PT_simulation"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.TERRAIN_ROLE

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_simulation
        lacking = simulation_setup.missing(scene, [settings.map_model])
        if lacking:
            advise(context, layout, False, lacking)
        elif hazard_maps.maps_of(scene) is None:
            text = "What many blocks from the same releases mean for each cell of the terrain."
            paragraph(context, layout, text, "INFO")
        column = layout.column(align=True)
        column.prop(settings, "map_model", text="")
        column.prop(settings, "map_number")
        column.prop(settings, "map_cell_m")
        if hazard_maps.has_barriers(scene):
            layout.prop(settings, "map_with_barriers")
        row = layout.row()
        row.scale_y = 1.4
        row.operator("rockfall.compute_maps", icon="MESH_GRID")
        job.draw(context, layout, "maps")
        if hazard_maps.maps_of(scene) is None:
            return
        box = layout.box()
        show_remarks(context, box, hazard_maps.remarks(scene))
        of_faces = hazard_maps.faces_of(scene) is not None
        if of_faces:
            box.row().prop(settings, "map_on", expand=True)
        box.prop(settings, "face_layer" if of_faces and settings.map_on == "FACES" else "map_layer", text="")
        column = box.column(align=True)
        column.prop(settings, "show_map")
        row = column.row()
        row.active = settings.show_map
        row.prop(settings, "probe_map")
        row = box.row(align=True)
        row.operator("rockfall.export_maps", text="Export", icon="EXPORT")
        row.operator("rockfall.remove_maps", text="Remove", icon="X")


CLASSES = (ROCKFALL_PT_simulation_maps,)
