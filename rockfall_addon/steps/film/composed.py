# SPDX-License-Identifier: GPL-3.0-or-later
"""Films of footage, reconstruction and models: chosen from a list with pictures, drawn in the background."""

from pathlib import Path
from typing import Any

import bpy
import bpy.utils.previews
from bpy.props import BoolProperty, EnumProperty

from ....core.errors import RockfallError
from ....core.film.composed.kinds import CODECS, KINDS, find_kind
from ....core.film.composed.request import FilmRequest
from ....core.film.presets import BUILT_IN
from ....core.progress import Progress
from ...scene.film_preset import preset_of
from ...scene.footage import camera_paths, videos
from ...scene.models import models
from ...scene.storage import store
from ...view import job
from ...view.job import InBackground, Work
from ...view.panel import RockfallPanel, fields, paragraph
from ...view.reporting import possible
from ...view.terrain_colours import terrain_colours
from . import beside, remembered, stopwatch
from .properties import file_of, graphs_of
from .written import draw_written

PICTURES = Path(__file__).resolve().parents[3] / "assets" / "film" / "previews"
LANGUAGES = (("en", "English", ""), ("fr", "Français", ""), ("de", "Deutsch", ""))
SOLIDS = (
    ("rock", "Angular", "An angular block of rock"),
    ("sphere", "Sphere", ""),
    ("ellipsoid", "Ellipsoid", "With the three diameters of the block"),
    ("box", "Box", "With the three diameters of the block"),
    ("eota_111", "Norm Block 1:1:1", "EAD 340059-00-0106"),
    ("eota_221", "Norm Block 2:2:1", "EAD 340059-00-0106"),
)
PICTURE_SCALE, LIST_SCALE = 6.0, 6.0

_previews: dict[str, Any] = {}
_items: list[tuple[str, str, str, int, int]] = []


def _kinds(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> list[tuple[str, str, str, int, int]]:
    """The films with their pictures; the list is kept, since Blender does not keep its texts."""
    if not _items:
        shown = _previews["films"] = bpy.utils.previews.new()
        for i, kind in enumerate(KINDS):
            picture = shown.load(kind.name, str(PICTURES / f"{kind.name}.jpg"), "IMAGE")
            _items.append((kind.name, kind.title, kind.description, picture.icon_id, i))
    return _items


class ComposedFilmSettings(bpy.types.PropertyGroup):
    """Which film is wanted, and how."""

    kind: EnumProperty(name="Film", description="What is seen", items=_kinds)
    language: EnumProperty(name="Language", description="Of the texts in the film", items=LANGUAGES)
    solid: EnumProperty(name="Block", description="What stands for the blocks", items=SOLIDS)
    codec: EnumProperty(
        name="Codec", description="How the film is compressed; H.264 plays everywhere",
        items=[(name, title, "") for name, title in CODECS.items()],
    )  # fmt: skip
    terrain_colours: terrain_colours()
    dust: BoolProperty(name="Dust", description="Impacts raise dust: drawn, not measured, as the last card says")


def path_of(scene: bpy.types.Scene) -> Path:
    """Where the film or the picture goes: beside the other film, named after what it is."""
    kind, film = find_kind(scene.rockfall_composed_film.kind), file_of(scene)
    return film.with_name(f"{film.stem}_{kind.name}.{'png' if kind.is_picture else 'mp4'}")


def lacking(scene: bpy.types.Scene) -> str:
    """What the chosen film needs and the scene has not; empty when it can be made."""
    kind = find_kind(scene.rockfall_composed_film.kind)
    if not store.has_role(scene, store.FLIGHTS_ROLE):
        return "There are no trajectories to film: import picks first"
    if kind.needs_terrain and not store.has_role(scene, store.TERRAIN_ROLE):
        return f"{kind.title} shows the terrain: import it first, in step 1"
    if kind.needs_footage and not any(camera_paths.is_solved(camera) for camera in videos.cameras(scene)):
        return f"{kind.title} shows footage: add a video in step 2, and align its camera in step 3"
    return ""


class ROCKFALL_OT_make_film(InBackground, bpy.types.Operator):
    """Draw the chosen film of footage, reconstruction and models, in the background. Finished frames are kept beside it
    when it is stopped, and used when it is made again"""

    bl_idname = "rockfall.make_film"
    bl_label = "Make Film of the Footage"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        missing = lacking(context.scene)
        return possible(cls, not missing, missing) and job.is_free(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        path = path_of(context.scene)
        if not path.exists():
            return self.execute(context)
        return context.window_manager.invoke_confirm(
            self, event, title=f"Replace {path.name}?", message=str(path), confirm_text="Replace", icon="WARNING"
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        return super().execute(context) if bpy.app.background else self._begin(context)

    def prepare(self, context: bpy.types.Context) -> Work:
        scene, path = context.scene, path_of(context.scene)
        make = beside.composed_of(scene, request_of(scene), path, scene.rockfall_composed_film.codec)
        unchanged = f"The old {path.name} is as it was." if path.exists() else f"There is no {path.name} yet."

        def compute(progress: Progress) -> tuple[str, ...]:
            try:
                return make(stopwatch.with_time_left(progress))
            except RockfallError as error:
                raise RockfallError(f"{error} {unchanged}") from error

        def keep(scene: bpy.types.Scene, remarks: object) -> str:
            beside.written[scene.session_uid] = path
            return f"Written: {path}, checked."

        return Work("film", compute, keep, changes=False, unchanged=f"{unchanged} Finished frames are kept.")


def request_of(scene: bpy.types.Scene) -> FilmRequest:
    """What the panel asks for; its project is not set."""
    asked, film, preset = scene.rockfall_composed_film, scene.rockfall_film, preset_of(scene)
    size = next(one for one in BUILT_IN if one.name == film.size)
    chosen = models.shown_models(scene)
    return FilmRequest(
        asked.kind, Path("project.toml"), size.width, size.height, language=asked.language,
        rate=None if abs(preset.time_scale - 1.0) < 1e-6 else preset.time_scale, models=chosen,
        parameters={name: values for name, values in models.parameters_of(scene).items() if name in chosen},
        graphs=graphs_of(scene) or "", solid=asked.solid, dust=asked.dust,
        terrain_colours=asked.terrain_colours,
    )  # fmt: skip


class ROCKFALL_PT_composed_film(RockfallPanel, bpy.types.Panel):
    bl_label = "Films of the Footage"
    bl_idname = "ROCKFALL_PT_composed_film"
    bl_parent_id = "ROCKFALL_PT_film"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_composed_film
        layout.template_icon_view(settings, "kind", show_labels=True, scale=PICTURE_SCALE, scale_popup=LIST_SCALE)
        kind = find_kind(settings.kind)
        layout.label(text=kind.title)
        paragraph(context, layout, f"{kind.description}.")
        fields(
            layout, settings, ("language", "solid", "terrain_colours", *(() if kind.is_picture else ("codec", "dust")))
        )
        missing = lacking(scene)
        if missing:
            paragraph(context, layout, f"{missing}.", "INFO")
        else:
            layout.label(text=path_of(scene).name, icon="IMAGE_DATA" if kind.is_picture else "FILE_MOVIE")
        row = layout.row()
        row.scale_y = 1.4
        text = "Make Picture" if kind.is_picture else "Make Film"
        row.operator("rockfall.make_film", text=text, icon="RENDER_STILL" if kind.is_picture else "RENDER_ANIMATION")
        if not remembered.is_set_up(scene):  # else the panel above shows both
            job.draw(context, layout, "film")
            draw_written(layout, scene)


CLASSES = (ComposedFilmSettings, ROCKFALL_OT_make_film, ROCKFALL_PT_composed_film)


def register() -> None:
    bpy.types.Scene.rockfall_composed_film = bpy.props.PointerProperty(type=ComposedFilmSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_composed_film
    _items.clear()
    for shown in _previews.values():
        bpy.utils.previews.remove(shown)
    _previews.clear()
