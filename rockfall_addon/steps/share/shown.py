# SPDX-License-Identifier: GPL-3.0-or-later
"""Export what others look at: a web page of the site, and the animation for other programs."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty

from ....core.film.composed.solids import SOLIDS
from ....core.output import write_text
from ....core.outreach.animation import FORMATS, RATE, animate
from ....core.outreach.animator import write_animation
from ....core.outreach.page import make_page, page_texts
from ....core.progress import Progress
from ...scene.picks import shown
from ...view import job
from ...view.from_file import last_folder
from ...view.job import InBackground, Work
from ...view.reporting import possible
from ...view.terrain_colours import terrain_colours
from .animation import check_formats
from .beside import blender_command

LANGUAGES = [(name, said["language"], "") for name, said in page_texts().items()]
KINDS = [
    ("glb", "glTF", "A .glb, for web viewers and most programs"),
    ("usdc", "USD", "A .usdc"),
    ("abc", "Alembic", "An .abc"),
]
TIMES = [
    ("TOGETHER", "Together", "All blocks start at the same moment"),
    ("OBSERVED", "As observed", "Blocks start when they did, one after the other"),
]


class _Shown(InBackground):
    """Mix-in: writes a file of what the scene shows."""

    bl_options = {"REGISTER"}
    ending = ""

    filepath: StringProperty(subtype="FILE_PATH")
    simulated: BoolProperty(
        name="Simulated Blocks",
        description="With the simulated blocks that are shown, beside the measured ones",
        default=True,
    )
    start: EnumProperty(name="Blocks Start", items=TIMES)
    terrain_colours: terrain_colours()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = shown.missing(context.scene)
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path(last_folder(context) or Path.home())
            self.filepath = str(folder / f"{self.stem}{self.ending}")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        return InBackground.execute(self, context) if bpy.app.background else self._begin(context)

    def file(self) -> Path:
        """What is asked for; a folder or nothing is given the usual name."""
        path = Path(bpy.path.abspath(self.filepath))
        return path / f"{self.stem}{self.ending}" if path.is_dir() or not path.name else path

    def asked(self, context: bpy.types.Context) -> shown.Asked:
        return shown.ask(
            context.scene,
            simulated=self.simulated,
            together=self.start == "TOGETHER",
            terrain_colours=self.terrain_colours,
        )


class ROCKFALL_OT_export_web_page(_Shown, bpy.types.Operator):
    """Write a page of the site and its blocks in three dimensions: one file for any browser, which needs no network"""

    bl_idname = "rockfall.export_web_page"
    bl_label = "Export Web Page"
    stem, ending = "site", ".html"

    filter_glob: StringProperty(default="*.html", options={"HIDDEN"})
    language: EnumProperty(
        name="Language", description="In which the page begins; its reader can change it", items=LANGUAGES
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "language")
        layout.prop(self, "simulated")
        layout.prop(self, "start")
        layout.prop(self, "terrain_colours")

    def prepare(self, context: bpy.types.Context) -> Work:
        path, asked, language = self.file(), self.asked(context), self.language
        if path.suffix.lower() not in (".html", ".htm"):
            path = path.with_name(f"{path.name}.html")

        def compute(progress: Progress) -> object:
            page = make_page(shown.show(asked, progress), language, progress=progress)
            write_text(path, page.text)
            return page

        def keep(scene: bpy.types.Scene, page: object) -> str:
            return f"Written: {path}, {page.blocks} blocks, {page.size_bytes / 1e6:.1f} MB. Open it in a browser."

        return Work("share", compute, keep, changes=False, unchanged="No page was written.")


class ROCKFALL_OT_export_animation(_Shown, bpy.types.Operator):
    """Write terrain, paths and moving blocks for other programs: glTF, USD, Alembic, in metres"""

    bl_idname = "rockfall.export_animation"
    bl_label = "Export Animation"
    stem, ending = "animation", ".glb"

    filter_glob: StringProperty(default="*.glb;*.usdc;*.abc", options={"HIDDEN"})
    formats: EnumProperty(name="Formats", items=KINDS, options={"ENUM_FLAG"}, default={"glb"})
    rate: FloatProperty(name="Frames per Second", default=RATE, min=1.0, max=240.0)
    block: EnumProperty(
        name="Block", description="The solid that stands for each block, in its true size",
        items=[(name, name.replace("_", " ").capitalize().replace("Eota", "EOTA"), "") for name in SOLIDS],
        default="rock",
    )  # fmt: skip

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.column().prop(self, "formats")
        layout.prop(self, "rate")
        layout.prop(self, "block")
        layout.prop(self, "simulated")
        layout.prop(self, "start")
        layout.prop(self, "terrain_colours")

    def prepare(self, context: bpy.types.Context) -> Work:
        path, asked, rate, block = self.file(), self.asked(context), self.rate, self.block
        stem = path.with_suffix("") if path.suffix.lower().removeprefix(".") in FORMATS else path
        formats = [name for name in FORMATS if name in self.formats] or [KINDS[0][0]]
        check_formats(formats)
        files, command = [stem.with_name(f"{stem.name}.{name}") for name in formats], blender_command()

        def compute(progress: Progress) -> object:
            animation = animate(shown.show(asked, progress), rate, block, progress)
            write_animation(animation, files, command, progress)
            return animation

        def keep(scene: bpy.types.Scene, animation: object) -> str:
            names = ", ".join(file.name for file in files)
            return f"{names}: {len(animation.names)} blocks, {animation.frames} frames, in {files[0].parent}."

        return Work("share", compute, keep, changes=False, unchanged="No animation was written.")


CLASSES = (ROCKFALL_OT_export_web_page, ROCKFALL_OT_export_animation)
