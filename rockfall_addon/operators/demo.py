# SPDX-License-Identifier: GPL-3.0-or-later
"""Load the bundled demo site: with its campaign of picks, or with its footage."""

from pathlib import Path

import bpy

from ..bridge import footage_blend, observations, state, videos
from ..bridge import project as project_bridge
from . import look, workspace
from .reporting import reported

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "project.toml"
FOOTAGE = DEMO.parent / "footage" / "project.toml"
FIRST_IMPACT_S = 1.71
"""Of the demo's video: the first impact in the picture."""
FOOTAGE_BLEND = 0.9  # the flights behind it still shine through


class _OfDemo:
    """Mix-in: only a scene without terrain takes a demo."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not state.with_role(context.scene, state.TERRAIN_ROLE):
            return True
        cls.poll_message_set("This scene has a terrain already: open a new scene or file for the demo")
        return False


class ROCKFALL_OT_load_demo(_OfDemo, bpy.types.Operator):
    """Load the demo site: a synthetic gully, fifteen blocks, a hundred timed impacts"""

    bl_idname = "rockfall.load_demo"
    bl_label = "Load Demo"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        _hide_start_up(scene)
        result = project_bridge.load_project(scene, DEMO)
        look.show_relief(context, frame_all=True)
        self.report({"INFO"}, f"{len(result.impacts.rn)} impacts on the demo site. Press play to see the blocks fall.")
        return {"FINISHED"}


class ROCKFALL_OT_load_footage_demo(_OfDemo, bpy.types.Operator):
    """Load the demo site with ten seconds of footage, its aligned camera and the tracked block, ready to be picked"""

    bl_idname = "rockfall.load_footage_demo"
    bl_label = "Load Footage Demo"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        _hide_start_up(scene)
        project_bridge.load_project(scene, FOOTAGE)
        camera = videos.active_camera(scene)
        if camera is not None:
            scene.camera = camera
            footage_blend.set_blend(camera, FOOTAGE_BLEND)
            common_s = videos.clock_of(camera).to_common(FIRST_IMPACT_S)
            scene.rockfall_picking.trajectory = next(iter(observations.names_in(camera)), "")
            scene.frame_set(round(videos.frame_at(scene, float(common_s))))
        look.show_relief(context, frame_all=True)
        workspace.open_workspace(context, arrange=True)
        self.report({"INFO"}, "The demo's footage is aligned and its block tracked. Go on with step 4: pick impacts.")
        return {"FINISHED"}


def _hide_start_up(scene: bpy.types.Scene) -> None:
    """Put away what Blender's own start-up scene holds."""
    for thing in [o for o in scene.objects if o.name in ("Cube", "Light")]:
        thing.hide_set(True)
        thing.hide_render = True


CLASSES = (ROCKFALL_OT_load_demo, ROCKFALL_OT_load_footage_demo)
