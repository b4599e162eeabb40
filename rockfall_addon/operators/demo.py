# SPDX-License-Identifier: GPL-3.0-or-later
"""Load the bundled demo site."""

from pathlib import Path

import bpy

from ..bridge import project as project_bridge
from ..bridge import state
from . import look
from .reporting import reported

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "project.toml"


class ROCKFALL_OT_load_demo(bpy.types.Operator):
    """Load the demo site: a synthetic gully, fifteen blocks, a hundred timed impacts"""

    bl_idname = "rockfall.load_demo"
    bl_label = "Load Demo"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not state.with_role(context.scene, state.TERRAIN_ROLE):
            return True
        cls.poll_message_set("This scene has a terrain already: open a new scene or file for the demo")
        return False

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        for thing in [o for o in scene.objects if o.name in ("Cube", "Light")]:  # of Blender's own start-up scene
            thing.hide_set(True)
            thing.hide_render = True
        result = project_bridge.load_project(scene, DEMO)
        look.show_relief(context, frame_all=True)
        self.report({"INFO"}, f"{len(result.impacts.rn)} impacts on the demo site. Press play to see the blocks fall.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_load_demo,)
