# SPDX-License-Identifier: GPL-3.0-or-later
"""Set the scene up for a film, render it, take the set-up away."""

from dataclasses import replace
from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ....core.film.presets import BUILT_IN
from ...scene import store, timing
from ...view.reporting import possible, reported
from . import dressing, remembered
from .engine import quickest_engine
from .render import use_movie


class ROCKFALL_OT_set_up_film(bpy.types.Operator):
    """Camera, captions and trails that grow with time: everything that a film of these trajectories needs.
    Press it again after a change"""

    bl_idname = "rockfall.set_up_film"
    bl_label = "Set Up Film"
    bl_options = {"REGISTER", "UNDO"}

    size: EnumProperty(
        name="Size",
        items=[(p.name, f"{p.width} × {p.height}", "") for p in BUILT_IN],
        default="hd",
    )
    engine: EnumProperty(
        name="Engine",
        items=[
            ("auto", "Quickest", "Workbench with a graphics card, Cycles without"),
            ("workbench", "Workbench", "Quickest with a graphics card"),
            ("cycles", "Cycles", "Smoothest edges, needs no graphics card"),
            ("eevee", "EEVEE", "Needs a graphics card"),
        ],
        default="auto",
    )
    time_scale: FloatProperty(
        name="Time", description="Seconds of the fall in one second of film; below 1 is slow motion",
        default=1.0, min=0.01, soft_max=2.0, max=20.0,
    )  # fmt: skip

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            store.has_role(context.scene, store.FLIGHTS_ROLE),
            "There are no trajectories to film: import picks first",
        )

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, settings = context.scene, context.scene.rockfall
        preset = replace(
            next(preset for preset in BUILT_IN if preset.name == self.size),
            fps=timing.frame_rate(scene),
            stagger_s=settings.stagger_s if settings.playback == "TOGETHER" else None,
            time_scale=float(f"{self.time_scale:.6g}"),
        )
        graphs = None if settings.film_graphs == "NONE" else settings.film_graphs.lower()
        engine = quickest_engine() if self.engine == "auto" else self.engine
        dressing.set_up_film(scene, preset, engine, graphs)
        for area in context.screen.areas if context.screen else ():
            if area.type == "VIEW_3D":
                area.spaces.active.region_3d.view_perspective = "CAMERA"
        self.report({"INFO"}, "Press Render Film, or play: the camera view shows the film")
        return {"FINISHED"}


class ROCKFALL_OT_render_film(bpy.types.Operator):
    """Render the film to an MP4 file"""

    bl_idname = "rockfall.render_film"
    bl_label = "Render Film"
    bl_options = {"REGISTER"}

    filepath: StringProperty(subtype="FILE_PATH", default="rockfall.mp4")
    filter_glob: StringProperty(default="*.mp4", options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, remembered.is_set_up(context.scene), "Set up the film first")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.data.filepath:
            self.filepath = str(Path(bpy.data.filepath).with_suffix(".mp4"))
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        use_movie(scene, Path(bpy.path.abspath(self.filepath)).with_suffix(".mp4"))
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        bpy.ops.render.render(how, animation=True, scene=scene.name)
        return {"FINISHED"}


class ROCKFALL_OT_remove_film(bpy.types.Operator):
    """Take camera, captions and growing trails away: the scene is as it was before"""

    bl_idname = "rockfall.remove_film"
    bl_label = "Remove Film Set-up"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return remembered.is_set_up(context.scene)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        dressing.remove_film(context.scene)
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_set_up_film, ROCKFALL_OT_render_film, ROCKFALL_OT_remove_film)
