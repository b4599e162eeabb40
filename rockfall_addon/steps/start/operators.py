# SPDX-License-Identifier: GPL-3.0-or-later
"""Load a project into an empty scene: the bundled demo site with its picks or its footage, or one of the user."""

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ...scene import project as scene_project
from ...scene.footage import clocks, footage_blend, sightings, videos
from ...scene.storage import start_up, store
from ...view import arranging, look
from ...view.from_file import FromFile
from ...view.reporting import possible, reported

DEMO = Path(__file__).parents[3] / "assets" / "demo" / "project.toml"
FOOTAGE = DEMO.parent / "footage" / "project.toml"
FIRST_IMPACT_S = 1.71
"""Of the demo's video: the first impact in the picture."""
FOOTAGE_BLEND = 0.9  # the flights behind it still shine through


class _IntoEmptyScene:
    """Mix-in: only a scene without terrain takes a project."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            not store.has_role(context.scene, store.TERRAIN_ROLE),
            "This scene has a terrain already: begin a new scene or file first",
        )


class ROCKFALL_OT_load_demo(_IntoEmptyScene, bpy.types.Operator):
    """Load the demo site: a synthetic gully, fifteen blocks, a hundred timed impacts"""

    bl_idname = "rockfall.load_demo"
    bl_label = "Load Demo"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        start_up.put_away(scene)
        result = scene_project.load_project(scene, DEMO)
        look.show_relief(context, frame_all=True)
        self.report({"INFO"}, f"{len(result.impacts.rn)} impacts on the demo site. Press play to see the blocks fall.")
        return {"FINISHED"}


class ROCKFALL_OT_load_footage_demo(_IntoEmptyScene, bpy.types.Operator):
    """Load the demo site with ten seconds of footage, its aligned camera and the tracked block, ready to be picked"""

    bl_idname = "rockfall.load_footage_demo"
    bl_label = "Load Footage Demo"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        start_up.put_away(scene)
        scene_project.load_project(scene, FOOTAGE)
        camera = videos.active_camera(scene)
        if camera is not None:
            scene.camera = camera
            footage_blend.set_blend(camera, FOOTAGE_BLEND)
            common_s = clocks.clock_of(camera).to_common(FIRST_IMPACT_S)
            scene.rockfall_picking.trajectory = next(iter(sightings.names_in(camera)), "")
            scene.frame_set(round(clocks.frame_at(scene, float(common_s))))
        look.show_relief(context, frame_all=True)
        arranging.open_workspace(context, arrange=True)
        self.report({"INFO"}, "The demo's footage is aligned and its block tracked. Go on with step 4: pick impacts.")
        return {"FINISHED"}


class ROCKFALL_OT_open_project(_IntoEmptyScene, FromFile, bpy.types.Operator):
    """Open a project.toml: its terrain, videos, cameras, picks and settings"""

    bl_idname = "rockfall.open_project"
    bl_label = "Open Project"

    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        result = scene_project.load_project(scene, self.chosen(context))
        start_up.put_away(scene)
        if (camera := videos.active_camera(scene)) is not None:
            scene.camera = camera
        look.show_relief(context, frame_all=True)
        count = 0 if result is None else len(result.picks)
        self.report({"INFO"}, f"{count} picks and {len(videos.cameras(scene))} videos.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_load_demo, ROCKFALL_OT_load_footage_demo, ROCKFALL_OT_open_project)
