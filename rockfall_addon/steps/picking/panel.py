# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: picks and trajectories, picking in the footage, and the track of the block."""

import bpy

from ...scene import problems
from ...scene.footage import camera_paths, sightings, videos
from ...scene.picks import places
from ...scene.storage import store
from ...view import job, pointing
from ...view.panel import RockfallPanel, State, advise, fields, is_grave, paragraph, show_remarks
from . import editing, set_aside


class ROCKFALL_PT_picks(RockfallPanel, bpy.types.Panel):
    bl_label = "4  Picking"
    bl_idname = "ROCKFALL_PT_picks"

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        if not store.has_role(context.scene, store.PICK_ROLE):
            return "TO_DO"
        return "ATTENTION" if any(map(is_grave, problems.remarks(context.scene))) else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        picks = store.with_role(scene, store.PICK_ROLE)
        flights = store.with_role(scene, store.FLIGHTS_ROLE)
        if not picks:
            show_remarks(context, layout, problems.remarks(scene))
            set_aside.draw(layout, scene)
            with_video = store.has_role(scene, store.CAMERA_ROLE)
            on_terrain = "Click the impacts on the terrain, each at its time in the timeline,"
            way = "Click the block at its impacts in the footage" if with_video else on_terrain
            if not store.has_role(scene, store.TERRAIN_ROLE):
                way = "Import the terrain first (step 1),"
            advise(context, layout, False, f"{way} or import a table of timed picks (picks.csv).")
            if store.has_role(scene, store.TERRAIN_ROLE) and not with_video:
                layout.operator("wm.tool_set_by_id", text="Pick Impacts", icon="CURSOR").name = "rockfall.pick_tool"
            layout.operator("rockfall.import_picks", icon="IMPORT")
            return
        show_remarks(context, layout, problems.remarks(scene))
        set_aside.draw(layout, scene)
        runs = "trajectory" if len(flights) == 1 else "trajectories"
        advise(context, layout, True, f"{len(picks)} picks, {len(flights)} {runs}.")
        names = ("block_diameter_m", "density_kgpm3", "block_shape", "normal_radius_m", "use_drag", "flights_join")
        fields(layout.column(align=True), scene.rockfall, names)
        layout.operator("rockfall.reconstruct", icon="FILE_REFRESH")


class ROCKFALL_PT_picking(RockfallPanel, bpy.types.Panel):
    bl_label = "Pick in the Footage"
    bl_idname = "ROCKFALL_PT_picking"
    bl_parent_id = "ROCKFALL_PT_picks"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(videos.cameras(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, camera = scene.rockfall_picking, videos.active_camera(scene)
        layout.operator("wm.tool_set_by_id", text="Pick Impacts", icon="CURSOR").name = "rockfall.pick_tool"
        advise(context, layout, False, _advice(scene, camera))
        fields(layout.column(), settings, ("trajectory", "kind", "aim", "sigma_px"))
        pick = pointing.active_pick(context)
        if pick is not None:
            warning = editing.grazing_warning(pick)
            if warning:
                paragraph(context, layout, warning, "ERROR")
            if len(videos.cameras(scene)) > 1:
                layout.operator("rockfall.use_triangulated", icon="EMPTY_AXIS")
        row = layout.row(align=True)
        row.prop(settings, "show_loupe", toggle=True)
        row.prop(settings, "show_paths", text="Paths", toggle=True)
        row.prop(settings, "show_track", text="Track", toggle=True)
        if settings.show_loupe:
            layout.prop(settings, "loupe_zoom")


class ROCKFALL_PT_tracking(RockfallPanel, bpy.types.Panel):
    bl_label = "Track the Block"
    bl_idname = "ROCKFALL_PT_tracking"
    bl_parent_id = "ROCKFALL_PT_picks"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(videos.cameras(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, camera = scene.rockfall_picking, videos.active_camera(scene)
        name = places.trajectory(scene)
        seen = sightings.seen_in(camera, name)
        if len(seen):
            text = f"{name} was seen in {len(seen)} pictures of {camera.name}, {int(seen.by_hand.sum())} by hand."
        else:
            text = f"Click the block of {name} in flight (kind “Block here”), then track it."
        advise(context, layout, bool(len(seen)), text)
        column = layout.column(align=True)
        column.prop(settings, "whole_video")
        if not settings.whole_video:
            column.prop(settings, "track_frames")
        layout.operator("rockfall.track_block", icon="TRACKING")
        job.draw(context, layout, "picking")
        row = layout.row(align=True)
        row.operator("rockfall.propose_impacts", icon="OUTLINER_OB_LIGHTPROBE")
        row.operator("rockfall.clear_track", text="", icon="X")


def _advice(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    if not store.has_role(scene, store.TERRAIN_ROLE):
        return "Import the terrain first: picks lie on it."
    if not camera_paths.is_solved(camera):
        return (
            f"{camera.name} is not aligned: clicks are taken as in a free view, at the time of the picture. "
            "Align it to pick in its pixels."
        )
    return "Step to the picture of an impact (← →), look through the camera, and click the block."


CLASSES = (ROCKFALL_PT_picks, ROCKFALL_PT_picking, ROCKFALL_PT_tracking)
