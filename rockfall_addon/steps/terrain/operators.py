# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: the terrain."""

import textwrap
from dataclasses import replace

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, StringProperty

from ....core.errors import InputError, RockfallError
from ....core.georeference import GlobalShift
from ....core.progress import Progress, silent
from ....core.terrain.advice import sentences
from ....core.terrain.opening import EXTENSIONS
from ....core.terrain.readers import TerrainInfo, inspect_terrain, read_terrain
from ....core.terrain.shading import Shading, shade
from ....core.terrain.surface import Surface
from ...scene.footage import camera_paths, pairs, sync, videos
from ...scene.next_step import MILLIMETRE_M
from ...scene.storage import materials, start_up, store
from ...scene.terrain import georeference, terrain, terrain_look
from ...view import job, look
from ...view.first_import import FirstImport, begin_file
from ...view.reporting import possible, reported
from . import file_unit
from .removing import tiles_of, what_stays

ACCURACY_M = {"TERRESTRIAL": 0.02, "DRONE": 0.05, "AIRBORNE": 0.2}
"""Standard deviation of a terrain's height by its source."""
TEXT_TABLES = (".txt", ".csv")  # are picks more often than clouds, so dropping them is left to the picks
SMALLEST_M = 1.0
"""Of a terrain: a file that is smaller in millimetres is not in millimetres."""
LARGE_BYTES = 5_000_000
"""Larger files, and the ground filter, are read beside Blender."""


class ROCKFALL_OT_import_terrain(FirstImport, bpy.types.Operator):
    """Import a scanned slope: a mesh, a grid or a point cloud, in survey coordinates"""

    bl_idname = "rockfall.import_terrain"
    bl_label = "Import Terrain"
    bl_options = {"REGISTER", "UNDO"}

    filter_glob: StringProperty(default=";".join(f"*{e}" for e in EXTENSIONS), options={"HIDDEN"})
    shift_x: StringProperty(name="Shift X", description="Subtracted from the file's coordinates [m]")
    shift_y: StringProperty(name="Y", description="Subtracted from the file's coordinates [m]")
    shift_z: StringProperty(name="Z", description="Subtracted from the file's coordinates [m]")
    up: EnumProperty(
        name="Up", description="The axis that points up in the file",
        items=[("auto", "Automatic", "Z, but Y for glTF"), ("z", "Z", ""), ("y", "Y", "")],
    )  # fmt: skip
    unit_m: FloatProperty(
        name="Its length [m]", description="Length of the file's unit in metres: 0.001 when it is in millimetres. "
        "0: as the file says, else metres",
        default=0.0, min=0.0, precision=4,
    )  # fmt: skip
    unit: EnumProperty(
        name="File unit", description="The unit of the file's coordinates; all becomes metres",
        items=file_unit.ITEMS, get=file_unit.get, set=file_unit.set_by_name, options={"SKIP_SAVE"},
    )  # fmt: skip
    height_unit: EnumProperty(
        name="Height unit", description="The unit of the file's heights, where it is another one",
        items=file_unit.HEIGHT_ITEMS, default="SAME",
    )  # fmt: skip
    types_unit: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})
    source: EnumProperty(
        name="Source", description="How accurate the terrain's height is: what the refinement's intervals rest on",
        items=[
            ("UNKNOWN", "Not said", "Accuracy as the terrain's panel says, else half the point spacing"),
            ("TERRESTRIAL", "Terrestrial scan, 2 cm", "Laser scan from the ground"),
            ("DRONE", "Drone, 5 cm", "Pictures or laser scan from a drone"),
            ("AIRBORNE", "Airborne scan, 20 cm", "Laser scan from an aeroplane or helicopter"),
        ],
    )  # fmt: skip
    ground: EnumProperty(
        name="Points", description="Which points of a cloud are meshed",
        items=[
            ("AUTO", "Ground if classified", "The ground class when the file has one, else all points"),
            ("GROUND", "Ground only", "Only points of the class ground"),
            ("ALL", "All", "All points, vegetation and noise too"),
            ("FILTER", "Ground filter", "What lies on a cloth laid from below, whatever its classes: no vegetation"),
        ],
    )  # fmt: skip
    filter_m: FloatProperty(
        name="Cloth cell", description="Spacing of the ground filter's cloth: wider than the gaps without ground under "
        "bushes and trees. Boulders and steps smaller than this may be left out",
        default=1.0, min=0.05, soft_max=5.0, unit="LENGTH",
    )  # fmt: skip
    max_edge_m: FloatProperty(
        name="Longest edge", description="Longer edges of a meshed cloud are left out. 0: from the points' spacing",
        default=0.0, min=0.0, unit="LENGTH",
    )  # fmt: skip
    replaces: StringProperty(description="Id of a tile that it takes the place of", options={"HIDDEN", "SKIP_SAVE"})
    asked: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})
    y_up: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})
    proposed: StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    asked_unit_m: FloatProperty(default=0.0, options={"HIDDEN", "SKIP_SAVE"})
    asked_height_unit: StringProperty(default="SAME", options={"HIDDEN", "SKIP_SAVE"})
    browsing: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})
    is_cloud: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if properties.replaces:
            return "Import another scan in the place of this one. What was picked and paired stays where it is"
        return str(cls.__doc__)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.by_hand = True
        if not self.filepath:
            self.browsing = True
            return super().invoke(context, event)
        return self._ask(context)

    @reported
    def _ask(self, context: bpy.types.Context) -> set[str]:
        found = self._inspected()
        shift = georeference.read_shift(context.scene) if self._is_bound(context.scene) else found.shift
        self.shift_x, self.shift_y, self.shift_z = repr(shift.x), repr(shift.y), repr(shift.z)
        self.proposed = " ".join((self.shift_x, self.shift_y, self.shift_z))
        self.asked, self.y_up, self.asked_unit_m = True, found.y_up, self.unit_m
        self.is_cloud = found.kind == "cloud"
        self.asked_height_unit = self.height_unit
        extent, (flat, height) = (found.maximum - found.minimum).tolist(), found.units_m
        self.extent = [extent[0] / flat, extent[1] / flat, extent[2] / height]
        self.stated_units_m = found.stated_units_m
        self.facts = [found.name, *found.summary]
        self.facts += [said for said in sentences(found.minimum, found.maximum, shift) if said not in self.facts]
        return context.window_manager.invoke_props_dialog(
            self, width=420, title="Import Terrain", confirm_text="Import"
        )

    def _inspected(self) -> TerrainInfo:
        """What the file holds; where that cannot be metres, millimetres are proposed, and can be changed."""
        try:
            return inspect_terrain(self.filepath, **self._units())
        except InputError as error:
            if self.unit_m not in (0.0, 1.0):
                raise
            found = inspect_terrain(self.filepath, unit_m=MILLIMETRE_M)
            if np.max(found.maximum - found.minimum) < SMALLEST_M:
                raise error from None  # not millimetres: something else is wrong
        self.unit_m = MILLIMETRE_M
        said = "In metres it would be beyond every survey: millimetres are proposed."
        return replace(found, summary=(said, *found.summary))

    def _units(self) -> dict[str, float | None]:
        """The units of the file that were asked for, as `read_terrain` takes them."""
        return {
            "unit_m": file_unit.exact(self.unit_m) or None,
            "height_unit_m": file_unit.height_m(self.height_unit),
        }

    def draw(self, context: bpy.types.Context) -> None:
        if not self.asked:
            return
        layout = self.layout
        box = layout.column(align=True)
        for line in (part for sentence in self.facts for part in textwrap.wrap(sentence, 70)):
            box.label(text=line)
        layout.separator()
        layout.use_property_split = True
        column = layout.column(align=True)
        known = self._is_bound(context.scene)
        column.enabled = not known
        for name in ("shift_x", "shift_y", "shift_z"):
            column.prop(self, name)
        said = "The project's shift, shared by all its files." if known else "Proposed: kept for the project."
        anew = "Proposed anew for Y up." if self.up == "y" else "Proposed anew for this unit."
        column.label(text=anew if self._changed_since(context.scene) else said)
        if self.y_up:
            column = layout.column(align=True)
            column.label(text="The surface stands upright: does Y point up in this file?", icon="QUESTION")
            row = column.row(align=True)
            row.alert = self.up == "auto"
            row.prop(self, "up", expand=True)
        for name in (*(() if self.y_up else ("up",)), "unit", *(("unit_m",) if self.unit == "OTHER" else ())):
            layout.prop(self, name)
        layout.prop(self, "height_unit")
        flat = file_unit.exact(self.unit_m) or self.stated_units_m[0]
        height = file_unit.height_m(self.height_unit) or (flat if self.unit_m else self.stated_units_m[1])
        layout.column().label(text=file_unit.size(self.extent, (flat, flat, height)))
        layout.prop(self, "source")
        if self.is_cloud:
            self._draw_meshing(layout)
        self.draw_offer(context, layout)

    def _draw_meshing(self, layout: bpy.types.UILayout) -> None:
        """How a surface is made of a cloud."""
        layout.separator()
        layout.prop(self, "ground")
        if self.ground == "FILTER":
            layout.prop(self, "filter_m")
        layout.prop(self, "max_edge_m")
        if not self.max_edge_m:
            layout.column().label(text="0: chosen from the spacing of the points.")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        if self.browsing:
            self.browsing = False
            return self._ask_again()
        path, work = self.chosen(context), self._work(context)
        takes_long = self.ground == "FILTER" or (path.is_file() and path.stat().st_size > LARGE_BYTES)
        if takes_long and self.by_hand and not bpy.app.background:
            job.begin(work, self.bl_label, context.scene)
            return {"INTERFACE"}  # the result is an undo step of its own
        self.report({"INFO"}, work.keep(context.scene, work.compute(silent)))
        return {"FINISHED"}

    def _work(self, context: bpy.types.Context) -> job.Work:
        """What there is to read, and how it is shown. Blender may have forgotten the operator by then."""
        path, replaces, opens_workspace = self.chosen(context), self.replaces, self.opens_workspace
        is_bound = self._is_bound(context.scene)
        accuracy_m = ACCURACY_M.get(self.source)
        told = {
            "shift": None if self._changed_since(context.scene) else self._shift(context.scene),
            "up": self.up,
            **self._units(),
            "max_edge_m": self.max_edge_m or None,
            "ground_only": {"AUTO": None, "GROUND": True, "ALL": False, "FILTER": None}[self.ground],
            "ground_filter_m": self.filter_m if self.ground == "FILTER" else None,
        }

        def compute(progress: Progress) -> tuple[Surface, Shading]:
            surface = read_terrain(path, **told, progress=progress)
            progress("Shading", 0, 0)
            return surface, shade(surface)

        def keep(scene: bpy.types.Scene, found: object) -> str:
            surface, shading = found
            first = start_up.is_untouched(scene)
            old = tiles_of(scene, replaces) if replaces else []
            replaced = [f"Replaced {', '.join(tile.name for tile in old)}.", what_stays(scene, old)] if old else []
            terrain.remove(scene, old)
            if not is_bound:
                georeference.forget_shift(scene)
            terrain.add_terrain(scene, surface, shading)
            if accuracy_m is not None:
                scene.rockfall_terrain.accuracy_m = accuracy_m
            sync.recompute(scene)
            with job.in_window_of(scene) as there:
                look.show_relief(there, frame_all=True)
                if first:
                    begin_file(there, opens_workspace=opens_workspace)
            said = f"{surface.name}: {len(surface.faces):,} triangles. Terrain > What Was Read tells the rest."
            return " ".join(filter(None, (*replaced, said)))

        return job.Work("terrain", compute, keep)

    def _ask_again(self) -> set[str]:
        """The dialog after the file browser, whose operator ends with it. An error in an operator that is called by
        another is an exception, which Blender would show as a traceback."""
        try:
            told = {"filepath": self.filepath, "replaces": self.replaces, "ground": self.ground}
            return bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", **told)
        except RuntimeError as error:
            raise RockfallError(str(error).removeprefix("Error: ").strip()) from None

    def _is_bound(self, scene: bpy.types.Scene) -> bool:
        """Whether the project keeps its shift: it is not that of the replaced tile alone."""
        if store.SHIFT not in scene or not self.replaces:
            return georeference.has_shift(scene)
        others = [tile for tile in store.with_role(scene, store.TERRAIN_ROLE) if tile.get(store.ID) != self.replaces]
        cameras = videos.cameras(scene)
        placed = [camera for camera in cameras if camera_paths.is_solved(camera) or pairs.pairs_of(camera)]
        own = (store.TERRAIN_ROLE, store.LEFT_OUT_ROLE)
        made = [obj for obj in scene.objects if store.ROLE in obj and obj[store.ROLE] not in own and obj not in cameras]
        return bool(others or placed or made)

    def _changed_since(self, scene: bpy.types.Scene) -> bool:
        """Whether the shift was proposed for z up and another unit than the file is read with: then it is of no use."""
        texts = " ".join((self.shift_x, self.shift_y, self.shift_z))
        read_as, asked_as = (self.unit_m, self.height_unit), (self.asked_unit_m, self.asked_height_unit)
        otherwise = self.up == "y" or read_as != asked_as
        return self.asked and otherwise and texts == self.proposed and not self._is_bound(scene)

    def _shift(self, scene: bpy.types.Scene) -> GlobalShift | None:
        """The project's shift, else the one that was given, else None: one is proposed.

        Raises
        ------
        RockfallError : the shift is no shift, or not that of the project.
        """
        texts = (self.shift_x, self.shift_y, self.shift_z)
        try:
            given = GlobalShift(*(float(text or "0") for text in texts)) if any(texts) else None
        except ValueError:
            raise RockfallError(
                f"The shift {', '.join(texts)} is not three numbers. Write metres, like 2600000.0."
            ) from None
        if not self._is_bound(scene):
            return given
        shift = georeference.read_shift(scene)
        if given is not None and (given.x, given.y, given.z) != (shift.x, shift.y, shift.z):
            raise RockfallError(
                f"This project has the shift ({shift.x:.10g}, {shift.y:.10g}, {shift.z:.10g}) m, so a terrain with the "
                f"shift ({given.x:.10g}, {given.y:.10g}, {given.z:.10g}) m would not fit to it. Leave the shift empty: "
                "all files share the project's."
            )
        return shift


class ROCKFALL_OT_reset_relief(bpy.types.Operator):
    """Give the sliders of the terrain's relief their usual values"""

    bl_idname = "rockfall.reset_relief"
    bl_label = "Reset Relief"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_terrain(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        for name in materials.TERRAIN_VALUES:
            context.scene.rockfall_terrain.property_unset(name)
        terrain_look.apply(context.scene)
        return {"FINISHED"}


class ROCKFALL_OT_toggle_full_terrain(bpy.types.Operator):
    """Draw every triangle of a large terrain in the 3-D view, or a coarse copy that is quick to draw"""

    bl_idname = "rockfall.toggle_full_terrain"
    bl_label = "Switch Between Coarse and Full Terrain"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_terrain(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.rockfall_terrain
        settings.full_resolution = not settings.full_resolution
        return {"FINISHED"}


class ROCKFALL_OT_lock_terrain(bpy.types.Operator):
    """Keep the scan from being selected and moved by hand, or allow it"""

    bl_idname = "rockfall.lock_terrain"
    bl_label = "Lock or Unlock the Scan"
    bl_options = {"REGISTER", "UNDO"}

    identifier: StringProperty(description="Id of the tile; all without", options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_terrain(cls, context)

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        every = store.with_role(context.scene, store.TERRAIN_ROLE)
        tiles = [tile for tile in every if self.identifier in ("", tile.get(store.ID))]
        locked = not all(map(terrain.is_locked, tiles))
        for tile in tiles:
            terrain.set_locked(tile, locked)
        return {"FINISHED"}


class ROCKFALL_OT_toggle_left_out(bpy.types.Operator):
    """Show or hide the points that the ground filter left out"""

    bl_idname = "rockfall.toggle_left_out"
    bl_label = "Show or Hide Points Left Out"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, store.has_role(context.scene, store.LEFT_OUT_ROLE), "The ground filter left nothing out")

    def execute(self, context: bpy.types.Context) -> set[str]:
        terrain.show_left_out(context.scene, not terrain.is_left_out_shown(context.scene))
        return {"FINISHED"}


class ROCKFALL_OT_put_terrain_back(bpy.types.Operator):
    """Return the scan to where it was surveyed"""

    bl_idname = "rockfall.put_terrain_back"
    bl_label = "Put the Scan Back"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, terrain.displaced(context.scene), "No locked scan was moved")

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        for tile in terrain.displaced(context.scene):
            terrain.put_back(tile)
        sync.touch(context.scene)
        return {"FINISHED"}


def _has_terrain(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    return possible(cls, store.has_role(context.scene, store.TERRAIN_ROLE), "Import a terrain first")


class ROCKFALL_FH_terrain(bpy.types.FileHandler):
    """Drop a scanned slope into the 3-D view"""

    bl_idname = "ROCKFALL_FH_terrain"
    bl_label = "Rockfall terrain"
    bl_import_operator = "rockfall.import_terrain"
    bl_file_extensions = ";".join(e for e in EXTENSIONS if e not in TEXT_TABLES)

    @classmethod
    def poll_drop(cls, context: bpy.types.Context) -> bool:
        return context.area is not None and context.area.type == "VIEW_3D"


class ROCKFALL_OT_show_relief(bpy.types.Operator):
    """Show the slope's relief and everything on it in the 3-D views"""

    bl_idname = "rockfall.show_relief"
    bl_label = "Relief View"
    bl_options = {"REGISTER", "UNDO"}
    looks_only = True

    frame_all: BoolProperty(name="Frame all", default=True)

    def execute(self, context: bpy.types.Context) -> set[str]:
        look.show_relief(context, self.frame_all)
        return {"FINISHED"}


CLASSES = (
    ROCKFALL_OT_import_terrain,
    ROCKFALL_OT_show_relief,
    ROCKFALL_OT_reset_relief,
    ROCKFALL_OT_toggle_full_terrain,
    ROCKFALL_OT_lock_terrain,
    ROCKFALL_OT_toggle_left_out,
    ROCKFALL_OT_put_terrain_back,
    ROCKFALL_FH_terrain,
)
