# SPDX-License-Identifier: GPL-3.0-or-later
"""What falls from where, what carries it, what came out."""

import bpy

from ....core.impact_models.registry import MODELS
from ...scene.models import models
from ...scene.simulation import screens, simulated_sources, simulation, simulation_setup, structures
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view import job, parameters
from ...view.panel import RockfallPanel, State, advise, facts, paragraph, show_remarks

WORDS = {"uniform": ("From", "To"), "normal": ("Mean", "Deviation"), "lognormal": ("Mean", "Deviation")}


class ROCKFALL_PT_simulation(RockfallPanel, bpy.types.Panel):
    bl_label = "7  Simulation"
    bl_idname = "ROCKFALL_PT_simulation"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        roles = (store.TERRAIN_ROLE, store.SIMULATED_BLOCKS_ROLE)  # what is shown can be removed without a terrain
        return any(store.has_role(context.scene, role) for role in roles)

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if not simulation.blocks_of(context.scene):
            return "TO_DO"
        return "ATTENTION" if simulation_setup.is_stale(context.scene) else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_simulation
        lacking = simulation_setup.missing(scene)
        if lacking:
            advise(context, layout, False, lacking)
        elif not simulation.blocks_of(scene):
            advise(context, layout, True, "Simulate whole falls: the same blocks, once for each model.")
        _draw_source(context, layout, settings)
        _draw_models(layout, settings)
        column = layout.column(align=True)
        column.prop(settings, "number")
        column.prop(settings, "seed")
        row = layout.row()
        row.scale_y = 1.4
        row.operator("rockfall.simulate", icon="PHYSICS")
        job.draw(context, layout, "simulation")
        if simulation.blocks_of(scene):
            _draw_result(context, layout, settings)
        else:
            show_remarks(context, layout, simulation_setup.remarks(scene))


class _Sub(RockfallPanel):
    """Mix-in of the panels below."""

    bl_parent_id = "ROCKFALL_PT_simulation"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.TERRAIN_ROLE


class ROCKFALL_PT_simulated_run(_Sub, bpy.types.Panel):
    bl_label = "Selected run"
    bl_idname = "ROCKFALL_PT_simulated_run"
    bl_options = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(simulation.paths_of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        row = layout.row(align=True)
        row.operator("rockfall.select_run", text="Click a Path", icon="EYEDROPPER")
        row.operator("rockfall.next_run", text="", icon="TRIA_LEFT").step = -1
        row.operator("rockfall.next_run", text="", icon="TRIA_RIGHT").step = 1
        found = simulation.selected_run(scene)
        if found is None:
            paragraph(context, layout, "Click a path in the view to see its numbers.", "INFO")
        else:
            facts(layout, found)


class ROCKFALL_PT_simulation_blocks(_Sub, bpy.types.Panel):
    bl_label = "Blocks"
    bl_idname = "ROCKFALL_PT_simulation_blocks"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_simulation
        if settings.source in simulated_sources.FILMED:
            paragraph(context, layout, "Each release has the block of its trajectory, as it was measured.", "INFO")
            return
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "diameter_law")
        column = layout.column(align=True)
        first, second = WORDS.get(settings.diameter_law, ("Diameter", ""))
        column.prop(settings, "diameter_m", text=first)
        if second:
            column.prop(settings, "diameter_second_m", text=second)
        layout.prop(settings, "density_kgpm3")
        layout.prop(settings, "shape")
        if settings.shape in ("box", "ellipsoid"):
            layout.prop(settings, "proportions")


class ROCKFALL_PT_simulation_motion(_Sub, bpy.types.Panel):
    bl_label = "Motion"
    bl_idname = "ROCKFALL_PT_simulation_motion"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_simulation
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.row().prop(settings, "contact", expand=True)
        if settings.contact == "mesh":
            layout.prop(settings, "check_mesh")
        layout.prop(settings, "rolling")
        row = layout.row()
        row.active = settings.rolling != "none"
        row.prop(settings, "friction")
        layout.prop(settings, "use_drag")


class ROCKFALL_PT_simulation_zones(_Sub, bpy.types.Panel):
    bl_label = "Zones"
    bl_idname = "ROCKFALL_PT_simulation_zones"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        zones = scene.rockfall_simulation.zones
        if not zones:
            paragraph(context, layout, "Parts of the terrain with their own friction and parameters.", "INFO")
        tile = terrain.active_terrain(scene)
        for place, zone in enumerate(zones):
            box = layout.box()
            row = box.row(align=True)
            row.prop_search(
                zone, "name", tile, "vertex_groups", text="", icon="GROUP_VERTEX", results_are_suggestions=True
            )
            row.operator("rockfall.remove_zone", text="", icon="X").place = place
            row = box.row(align=True)
            row.prop(zone, "use_friction")
            column = row.column()
            column.active = zone.use_friction
            column.prop(zone, "friction", text="")
            box.prop(zone, "parameters", text="", icon="OPTIONS", placeholder="rt = 0.4")
        layout.operator("rockfall.add_zone", icon="ADD")
        if zones:
            text = (
                "Assign vertices to the group in Edit Mode, or paint its weights. Where zones overlap the first counts."
            )
            paragraph(context, layout, text, "INFO")


class ROCKFALL_PT_simulation_structures(_Sub, bpy.types.Panel):
    bl_label = "Structures"
    bl_idname = "ROCKFALL_PT_simulation_structures"

    def draw(self, context: bpy.types.Context) -> None:
        layout, found = self.layout, structures.objects_of(context.scene)
        if not found:
            text = (
                "Walls, fences, ditches, roads, houses: meshes of your own that blocks meet, clouds of vertices by "
                "their points. Select them."
            )
            paragraph(context, layout, text, "INFO")
        column = layout.column(align=True)
        for obj in found:
            row = column.row(align=True)
            row.prop(obj, "name", text="", icon="OUTLINER_OB_POINTCLOUD" if structures.is_cloud(obj) else "MESH_CUBE")
            row.operator("rockfall.remove_structure", text="", icon="X").name = obj.name
        layout.operator("rockfall.use_as_structure", icon="ADD")


class ROCKFALL_PT_simulation_trees(_Sub, bpy.types.Panel):
    bl_label = "Trees"
    bl_idname = "ROCKFALL_PT_simulation_trees"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_simulation
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "trees")
        if settings.trees == "NONE":
            text = "Stems that stand in the way: from a table, or a forest of so many stems per hectare."
            paragraph(context, layout, text, "INFO")
            return
        column = layout.column(align=True)
        if settings.trees == "TABLE":
            column.prop(settings, "trees_file")
        else:
            column.prop(settings, "stems_per_hectare", text="Stems per ha")
            column.prop(settings, "dbh_cm")
            column.prop(settings, "dbh_sd_cm")
            column.prop(settings, "trees_within")
        column = layout.column(align=True)
        column.prop(settings, "tree_height_m")
        column.prop(settings, "tree_species")
        paragraph(context, layout, "They take energy by a published law; simulate with and without to compare.", "INFO")


class ROCKFALL_PT_simulation_screens(_Sub, bpy.types.Panel):
    bl_label = "Screens and barriers"
    bl_idname = "ROCKFALL_PT_simulation_screens"
    bl_options = set()

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        found, results = screens.objects_of(scene), simulation_setup.screen_results(scene)
        if not found:
            text = "Draw a line across the slope: how many blocks pass there, how fast, how high; what a barrier holds."
            paragraph(context, layout, text, "INFO")
        for obj in found:
            box = layout.box()
            row = box.row(align=True)
            row.prop(obj, "name", text="", icon="MOD_LATTICE" if obj.rockfall_screen.holds else "IPO_LINEAR")
            row.operator("rockfall.remove_screen", text="", icon="X").name = obj.name
            column = box.column(align=True)
            column.prop(obj.rockfall_screen, "height_m")
            column.prop(obj.rockfall_screen, "holds")
            if obj.rockfall_screen.holds:
                column.prop(obj.rockfall_screen, "capacity_kj")
            models_shown = screens.result_rows(results, obj.name)
            for title, rows in models_shown:
                column = box.column(align=True)
                column.label(text=title, icon="PHYSICS")
                facts(column, rows)
            if results and not models_shown:
                paragraph(context, box, "Simulate again to measure here.", "INFO")
        layout.operator("rockfall.draw_screen", icon="ADD")


class ROCKFALL_PT_simulation_parameters(_Sub, bpy.types.Panel):
    bl_label = "Parameters of the models"
    bl_idname = "ROCKFALL_PT_simulation_parameters"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        chosen = [name for name in models.ORDER if name in scene.rockfall_simulation.models]
        for name in chosen:
            header, body = layout.panel(f"ROCKFALL_parameters_{name}", default_closed=len(chosen) > 1)
            header.label(text=MODELS[name].title)
            if body is not None:
                parameters.draw(body, scene, name)
        layout.operator("rockfall.load_parameters", icon="IMPORT")


class ROCKFALL_PT_simulation_look(_Sub, bpy.types.Panel):
    bl_label = "Look"
    bl_idname = "ROCKFALL_PT_simulation_look"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_simulation
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "colour_by")
        column = layout.column(heading="Show", align=True)
        column.prop(settings, "show_paths")
        column.prop(settings, "show_blocks")
        if store.has_role(context.scene, store.SIMULATED_TREES_ROLE):
            column.prop(settings, "show_trees")
        layout.prop(context.scene.rockfall, "block_scale")
        layout.prop(context.scene.rockfall, "show_legend")


def _draw_source(context: bpy.types.Context, layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    column = layout.column()
    column.label(text="Release from:")
    column.prop(settings, "source", text="")
    if settings.source == "PICK":
        chosen = simulated_sources.selected_pick(context.scene)
        if chosen is not None:
            column.label(text=f"{chosen[store.TRAJECTORY]}: {chosen[store.KIND]}", icon="OBJECT_DATA")
    elif settings.source == "STEEP":
        column.prop(settings, "steeper_than_deg")
    elif settings.source == "DRAWN":
        column.prop(settings, "drawn", text="")
    if settings.source == "DRAWN" or not store.has_role(context.scene, store.PICK_ROLE):
        row = column.row(align=True)
        for kind, text, icon in (
            ("line", "Line", "IPO_LINEAR"), ("polygon", "Area", "MESH_PLANE"), ("points", "Points", "DOT"),
        ):  # fmt: skip
            row.operator("rockfall.draw_release", text=text, icon=icon).kind = kind


def _draw_models(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    layout.label(text="Models:")
    column = layout.column(align=True)
    for name in models.ORDER:
        on = name in settings.models
        button = column.operator(
            "rockfall.choose_simulated_model",
            text=MODELS[name].title,
            icon="CHECKBOX_HLT" if on else "CHECKBOX_DEHLT",
            depress=on,
        )
        button.model = name


def _draw_result(context: bpy.types.Context, layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    box = layout.box()
    show_remarks(context, box, simulation_setup.remarks(context.scene))
    row = box.row(align=True)
    playing = context.screen is not None and context.screen.is_animation_playing
    row.operator("screen.animation_play", text="Pause" if playing else "Play", icon="PAUSE" if playing else "PLAY")
    row.operator("rockfall.remove_simulation", text="Remove", icon="X")


CLASSES = (
    ROCKFALL_PT_simulation,
    ROCKFALL_PT_simulated_run,
    ROCKFALL_PT_simulation_screens,
    ROCKFALL_PT_simulation_parameters,
    ROCKFALL_PT_simulation_blocks,
    ROCKFALL_PT_simulation_motion,
    ROCKFALL_PT_simulation_zones,
    ROCKFALL_PT_simulation_structures,
    ROCKFALL_PT_simulation_trees,
    ROCKFALL_PT_simulation_look,
)
