# SPDX-License-Identifier: GPL-3.0-or-later
"""What film is wanted. All of it is in the .blend."""

from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from ....core.film.files import NAME, SUFFIX, film_file
from ....core.film.job import GraphKind
from ....core.film.presets import BUILT_IN
from ...scene.storage import store
from ...view.from_file import last_folder


def _file(self: bpy.types.PropertyGroup) -> str:
    return str(self.id_data.get(store.FILM_FILE, "")) or _suggested()


def _set_file(self: bpy.types.PropertyGroup, value: str) -> None:
    """A folder, or a name without .mp4, is shown at once as the file that it means."""
    value = value.strip()
    if not value:
        self.id_data.pop(store.FILM_FILE, None)
        return
    path = _whole(value)
    if path.name != Path(bpy.path.abspath(value)).name:
        relative = value.startswith("//") and bpy.data.filepath
        value = bpy.path.relpath(str(path)) if relative else str(path)
    self.id_data[store.FILM_FILE] = value


class FilmSettings(bpy.types.PropertyGroup):
    """The film of a scene."""

    size: EnumProperty(
        name="Size", description="Of the picture, in pixels",
        items=[(p.name, f"{p.width} × {p.height}", "") for p in BUILT_IN],
        default="hd",
    )  # fmt: skip
    engine: EnumProperty(
        name="Engine", description="What draws the film; the picture is the same",
        items=[
            ("auto", "Quickest", "Workbench with a graphics card, Cycles without"),
            ("workbench", "Workbench", "Quickest with a graphics card"),
            ("cycles", "Cycles", "Smoothest edges, needs no graphics card"),
            ("eevee", "EEVEE", "Needs a graphics card"),
        ],
        default="auto",
    )  # fmt: skip
    time_scale: FloatProperty(
        name="Time Scale", description="Seconds of the fall in one second of film; below 1 is slow motion",
        default=1.0, min=0.01, soft_max=2.0, max=20.0,
    )  # fmt: skip
    graphs: EnumProperty(
        name="Graphs", description="Graphs in the film, at the right of the picture, that follow its time",
        items=[
            ("NONE", "None", "The slope alone"),
            ("IMPACTS", "Impacts", "The graphs of the impacts, whose points appear as the impacts happen"),
            ("MOTION", "Motion", "Speed, height above ground and energy over time, drawn up to the present"),
        ],
        default="NONE",
    )  # fmt: skip
    file: StringProperty(
        name="File", description="The film's file, an MP4; beside the .blend when nothing else is given",
        subtype="FILE_PATH", options={"PATH_SUPPORTS_BLEND_RELATIVE"}, get=_file, set=_set_file,
    )  # fmt: skip


def file_of(scene: bpy.types.Scene) -> Path:
    """Where the film goes; the name is never empty."""
    return _whole(scene.rockfall_film.file)


def graphs_of(scene: bpy.types.Scene) -> GraphKind | None:
    """The graphs that are wanted."""
    kind = scene.rockfall_film.graphs
    return None if kind == "NONE" else kind.lower()


def _whole(value: str) -> Path:
    return film_file(bpy.path.abspath(value), Path(bpy.path.abspath(_suggested())))


def _suggested() -> str:
    """Beside the .blend and of its name; before it is saved, in the folder of the last file."""
    if bpy.data.filepath:
        return f"//{Path(bpy.data.filepath).stem}{SUFFIX}"
    return str(Path(last_folder(bpy.context) or Path.home()) / NAME)


CLASSES = (FilmSettings,)


def register() -> None:
    bpy.types.Scene.rockfall_film = bpy.props.PointerProperty(type=FilmSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_film
