# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: the terrain."""

import bpy

from ...scene.storage import materials, store
from ...scene.terrain import georeference, terrain, terrain_colours, terrain_view
from ...view import job
from ...view.panel import RockfallPanel, State, advise, facts, paragraph


class ROCKFALL_PT_terrain(RockfallPanel, bpy.types.Panel):
    bl_label = "1  Terrain"
    bl_idname = "ROCKFALL_PT_terrain"
    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        scene = context.scene
        if not store.has_role(scene, store.TERRAIN_ROLE):
            return "ATTENTION" if scene.get(store.GROUND) else "TO_DO"
        return "ATTENTION" if terrain.warnings(scene) else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        job.draw(context, layout, "terrain")
        grounds = store.with_role(scene, store.TERRAIN_ROLE)
        if not grounds:
            if scene.get(store.GROUND):
                paragraph(context, layout, "The terrain is gone. Undo, or import it again.", "ERROR")
            else:
                advise(context, layout, False, "Import your scan, or begin with the demo.")
            column = layout.column(align=True)
            column.scale_y = 1.4
            column.operator("rockfall.load_footage_demo", icon="FILE_MOVIE")
            column.operator("rockfall.load_demo", icon="PLAY")
            column.operator("rockfall.import_terrain", icon="IMPORT")
            return
        warnings = terrain.warnings(scene)
        for sentence in warnings:
            paragraph(context, layout, sentence, "ERROR")
        if terrain.displaced(scene):
            layout.operator("rockfall.put_terrain_back", icon="LOOP_BACK")
        for tile in terrain.with_trees(scene):
            again = layout.operator(
                "rockfall.import_terrain", text="Read Again with Ground Filter", icon="FILE_REFRESH"
            )
            again.replaces, again.ground = tile.get(store.ID, ""), "FILTER"
        if not warnings:
            advise(context, layout, True, "Ready.")
        self._list_tiles(grounds)
        for sentence in terrain.remarks(scene):
            paragraph(context, layout, sentence, "INFO")
        if store.has_role(scene, store.LEFT_OUT_ROLE):
            shown = terrain.is_left_out_shown(scene)
            text, icon = ("Hide Points Left Out", "HIDE_OFF") if shown else ("Show Points Left Out", "HIDE_ON")
            layout.operator("rockfall.toggle_left_out", text=text, icon=icon)
        row = layout.row(align=True)
        row.operator("rockfall.show_relief", text="Show relief", icon="SHADING_SOLID")
        row.operator("rockfall.import_terrain", text="Add tile", icon="IMPORT")
        column = layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(scene.rockfall_terrain, "accuracy_m")
        if not scene.rockfall_terrain.accuracy_m:
            column.label(text="0: half the spacing of the points.")
        shift = georeference.read_shift(scene)
        rows = [(f"Shift {axis.upper()}", f"{getattr(shift, axis):.2f} m") for axis in "xyz"]
        facts(layout, [*rows, ("System", shift.crs or "unknown")])

    def _list_tiles(self, grounds: list[bpy.types.Object]) -> None:
        column = self.layout.box().column(align=True)
        for ground in grounds:
            row = column.row(align=True)
            row.label(text=ground.name, icon="MESH_GRID", translate=False)
            icon = "LOCKED" if terrain.is_locked(ground) else "UNLOCKED"
            lock = row.operator("rockfall.lock_terrain", text="", icon=icon, emboss=False)
            other = row.operator("rockfall.import_terrain", text="", icon="FILE_REFRESH", emboss=False)
            gone = row.operator("rockfall.remove_terrain", text="", icon="X", emboss=False)
            lock.identifier = other.replaces = gone.identifier = ground.get(store.ID, "")
            count = terrain.grouped(len(ground.data.polygons) if ground.type == "MESH" else 0)
            file = str(ground.get(store.TERRAIN_FILE, ground.name))
            column.label(text=f"{count} triangles{f' of {file}' if file != ground.name else ''}", icon="BLANK1")


class ROCKFALL_PT_terrain_reading(RockfallPanel, bpy.types.Panel):
    bl_label = "What Was Read"
    bl_idname = "ROCKFALL_PT_terrain_reading"
    bl_parent_id = "ROCKFALL_PT_terrain"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(terrain.readings(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        for name, sentences in terrain.readings(context.scene):
            self.layout.label(text=name, icon="MESH_GRID", translate=False)
            for sentence in sentences:
                paragraph(context, self.layout, sentence)


class ROCKFALL_PT_relief(RockfallPanel, bpy.types.Panel):
    bl_label = "Relief and Colours"
    bl_idname = "ROCKFALL_PT_relief"
    bl_parent_id = "ROCKFALL_PT_terrain"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.TERRAIN_ROLE

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.rockfall_terrain
        layout = self.layout.column()
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        for name in ("hillshade", "eye_dome", "thin"):
            column.prop(settings, name, slider=True)
        column = layout.column(align=True)
        for name in ("brightness", "contrast"):
            column.prop(settings, name)
        self._draw_colours(context, layout)
        layout.operator("rockfall.reset_relief", icon="LOOP_BACK")
        if terrain_view.is_coarse(context.scene):
            self.layout.prop(settings, "full_resolution", toggle=True, icon="MESH_GRID")
            column = self.layout.column()
            column.use_property_split, column.use_property_decorate = True, False
            column.prop(settings, "view_limit")

    def _draw_colours(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        scene = context.scene
        known = [name for name in materials.OWN_COLOURS if terrain_colours.have(scene, name)]
        column = layout.column(align=True)
        for name in known:
            column.prop(scene.rockfall_terrain, name, slider=True)
        from_footage = materials.FOOTAGE_COLOURS in known
        if from_footage and terrain_colours.is_stale(scene):
            paragraph(context, layout, "A camera has moved since it coloured the terrain: colour it again.", "ERROR")
        row = layout.row(align=True)
        text = "Colour Again" if from_footage else "Colour from Footage"
        row.operator("rockfall.colour_from_footage", text=text, icon="BRUSH_DATA")
        if from_footage:
            row.operator("rockfall.remove_footage_colours", text="", icon="X")


CLASSES = (ROCKFALL_PT_terrain, ROCKFALL_PT_terrain_reading, ROCKFALL_PT_relief)
