# SPDX-License-Identifier: GPL-3.0-or-later
"""Export the graphs as they are set up in their editors."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from ....core.output import output_folder
from ...scene.storage import store
from ...view.graphs import editor, export
from ...view.reporting import possible, reported
from ...view.to_file import asked_file

KINDS = [
    ("IMPACTS", "Impacts", "The graphs of the impacts, as they are set up in their editor"),
    ("MOTION", "Motion", "Speed, height, energy and residuals over time"),
]
TREES = {"IMPACTS": editor.IMPACTS, "MOTION": editor.MOTION}
NAMES = {"IMPACTS": "graphs", "MOTION": "motion"}


def _follow_format(self: bpy.types.OperatorProperties, context: bpy.types.Context) -> None:
    """The ending of the file is that of the format. Blender calls this with the bare properties, too."""
    if Path(self.filepath).name:
        self.filepath = str(Path(self.filepath).with_suffix(f".{self.file_format}"))


class ROCKFALL_OT_export_graphs(bpy.types.Operator):
    """Write the graphs as they are drawn: SVG or PNG, or their numbers as CSV"""

    bl_idname = "rockfall.export_graphs"
    bl_label = "Export Graphs"
    bl_options = {"REGISTER"}

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.svg;*.png;*.csv", options={"HIDDEN"})
    kind: EnumProperty(name="Graphs", items=KINDS)
    file_format: EnumProperty(
        name="Format",
        items=[
            ("svg", "SVG", "Lines and text that stay sharp, for print"),
            ("png", "PNG", "A picture of pixels"),
            ("csv", "CSV", "The numbers of what is shown"),
        ],
        update=_follow_format,
    )  # fmt: skip
    width: IntProperty(name="Width", description="Of the picture [px]", default=1200, min=200, max=8000)
    height: IntProperty(name="Height", description="Of the picture [px]", default=900, min=150, max=8000)
    scale: FloatProperty(
        name="Resolution", description="Pixels of a PNG for each of these; text and lines grow with them", default=2.0,
        min=0.5, max=8.0,
    )  # fmt: skip
    colours: EnumProperty(
        name="Colours",
        items=[("PAPER", "Paper", "Black on white"), ("SCREEN", "Screen", "As the editor is drawn")],
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(
            cls,
            store.has_role(context.scene, store.PICK_ROLE) or editor.content_of(context) is not None,
            "There is nothing in the graphs: import picks first, or load the demo",
        )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        content = editor.content_of(context)
        if content is not None:
            self.kind = next(name for name, tree in TREES.items() if tree == content.tree)
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
        self.filepath = str(folder / f"{NAMES[self.kind]}.{self.file_format}")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "kind")
        layout.prop(self, "file_format", expand=True)
        if self.file_format == "csv":
            return
        column = layout.column(align=True)
        column.prop(self, "width")
        column.prop(self, "height")
        if self.file_format == "png":
            column.prop(self, "scale")
        layout.prop(self, "colours", expand=True)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        path = asked_file(self.filepath)
        if path.suffix.lower().removeprefix(".") not in export.FORMATS:
            path = path.with_name(f"{path.name}.{self.file_format}")
        with output_folder(path.parent) as folder:
            export.write(
                context, TREES[self.kind], folder / path.name, (self.width, self.height), self.scale,
                dark=self.colours == "SCREEN",
            )  # fmt: skip
        self.report({"INFO"}, f"{path.name} is in {path.parent}.")
        return {"FINISHED"}


CLASSES = (ROCKFALL_OT_export_graphs,)
