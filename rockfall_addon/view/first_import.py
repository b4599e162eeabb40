# SPDX-License-Identifier: GPL-3.0-or-later
"""The first terrain or video of a file: Blender's start-up objects go out of the way, and the workspace is offered."""

import bpy
from bpy.props import BoolProperty

from ..scene.storage import start_up
from . import arranging, workspace
from .from_file import FromFile


class FirstImport(FromFile):
    """Mix-in: the first import by hand opens the workspace, unless its box is cleared. Scripts keep their window."""

    open_workspace: BoolProperty(
        name="Open the workspace Rockfall", description="The camera's view, a free view, the timeline, the steps",
        default=True, options={"SKIP_SAVE"},
    )  # fmt: skip
    by_hand: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def draw_offer(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        """The box, where there is something to offer."""
        if start_up.is_untouched(context.scene) and not workspace.is_open(context):
            layout.prop(self, "open_workspace")

    @property
    def opens_workspace(self) -> bool:
        """Whether the first import is to open it."""
        return self.by_hand and self.open_workspace


def begin_file(context: bpy.types.Context, *, opens_workspace: bool) -> None:
    """What the first import does besides importing; after it."""
    start_up.put_away(context.scene)
    if opens_workspace:
        arranging.open_workspace(context, arrange=True)
