# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 3: the camera's place, from pairs of the footage and the terrain."""

import math

import bpy

from ...scene.footage import alignment, camera_paths, pairs, videos
from ...scene.terrain import georeference
from ...view import job
from ...view.panel import RockfallPanel, Rows, State, advise, facts, paragraph, show_remarks
from . import following

COLOURS = tuple(
    f"COLLECTION_COLOR_{number:02d}" for number in range(1 + pairs.FIRST_COLOUR, 1 + pairs.FIRST_COLOUR + pairs.COLOURS)
)


TRIPOD = "One pose for all frames. If the picture moves, choose Hand-held."


class ROCKFALL_UL_pairs(Rows, bpy.types.UIList):
    """Rows: use, colour, name, residuals."""

    bl_idname = "ROCKFALL_UL_pairs"

    def draw_row(self, layout: bpy.types.UILayout, item: bpy.types.PropertyGroup) -> None:
        row = layout.row(align=True)
        row.prop(item, "enabled", text="")
        row.label(text="", icon="ERROR" if item.is_wrong else COLOURS[item.colour % len(COLOURS)])
        cells = row.split(factor=0.4, align=True)
        cells.prop(item, "name", text="", emboss=False)
        right = cells.row(align=True)
        right.active = item.enabled and not item.agreed
        if item.missing:
            right.label(text="terrain?" if item.missing == pairs.POINT else "picture?")
        elif item.agreed:
            right.label(text="as predicted")
        else:
            for value in (item.residual_px, item.residual_m):
                right.label(text=short(value))


def short(value: float) -> str:
    """A residual with no more digits than it deserves."""
    return "–" if math.isnan(value) else f"{value:.{2 if value < 10 else 0}f}"


class ROCKFALL_PT_alignment(RockfallPanel, bpy.types.Panel):
    bl_label = "3  Alignment"
    bl_idname = "ROCKFALL_PT_alignment"
    bl_options = {"DEFAULT_CLOSED"}

    @staticmethod
    def step_state(context: bpy.types.Context) -> State:
        camera = videos.active_camera(context.scene)
        if camera is None or not camera_paths.is_solved(camera):
            return "TO_DO"
        solution = alignment.solution_of(camera)
        return "ATTENTION" if solution.problem or solution.wrong or following.is_stale(camera) else "READY"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        camera = videos.active_camera(scene)
        if camera is None:
            advise(context, layout, False, "Add a video first (step 2).")
            return
        settings, solution = camera.rockfall_alignment, alignment.solution_of(camera)
        self._state(context, camera, solution)
        job.draw(context, layout, "alignment")
        column = layout.column(align=True)
        column.scale_y = 1.3
        column.operator("rockfall.align_views", icon="SPLIT_VERTICAL")
        layout.operator("rockfall.use_view", icon="VIEW_CAMERA")
        row = layout.row(align=True)
        row.prop(settings, "blend", slider=True)
        row.prop(settings, "use_wipe", text="", icon="MOD_MIRROR")
        if settings.use_wipe:
            layout.prop(settings, "wipe", slider=True)
        self._pairs(context, settings)

    def _state(self, context: bpy.types.Context, camera: bpy.types.Object, solution: alignment.Solution) -> None:
        """How this step stands, and what to do next."""
        layout, scene = self.layout, context.scene
        placed, next_step = alignment.placement(camera), alignment.hint(scene, camera)
        if placed == alignment.BY_EYE:
            paragraph(context, layout, f"{camera.name} is placed by eye: its errors are not known.", "INFO")
        elif placed == alignment.FROM_FILE:
            advise(context, layout, True, f"{camera.name} comes from a file.")
        elif placed and not solution.problem:
            count = sum(pair.counts for pair in pairs.complete_of(camera))
            good = count - len(solution.wrong)
            fit = f"{good} pairs fit to {solution.rmse_px:.2f} px." if math.isfinite(solution.rmse_px) else ""
            advise(context, layout, True, f"{camera.name} is solved. {fit}")
        if solution.problem and not next_step:
            paragraph(context, layout, solution.problem, "ERROR")
        show_remarks(context, layout, solution.remarks)
        if following.is_stale(camera):
            paragraph(
                context, layout, "The focal length has changed since the camera was followed. Follow again.", "ERROR"
            )
        if next_step and (placed != alignment.FROM_FILE or len(camera.rockfall_alignment.rows)):
            advise(context, layout, False, next_step)

    def _pairs(self, context: bpy.types.Context, settings: bpy.types.PropertyGroup) -> None:
        layout = self.layout
        if len(settings.rows):
            head = layout.split(factor=0.46, align=True)
            head.label(text="Pairs")
            for unit in ("px", "m"):
                head.label(text=unit)
            row = layout.row()
            row.template_list("ROCKFALL_UL_pairs", "", settings, "rows", settings, "active", rows=4, maxrows=8)
            column = row.column(align=True)
            column.operator("rockfall.delete_pair", text="", icon="REMOVE")
            column.operator("rockfall.go_to_pair", text="", icon="VIEWZOOM")
            column.separator()
            column.prop(settings, "show_pairs", text="", icon="HIDE_OFF")
            column.prop(settings, "magnify", text="", icon="FULLSCREEN_ENTER")
        agreed = [row.name for row in settings.rows if row.agreed]
        if agreed:
            text = f"As predicted: {', '.join(agreed)}. No measurement, so not counted; drag a mark to measure it."
            paragraph(context, layout, text, "INFO")
        row = layout.row(align=True)
        row.operator("rockfall.import_pairs", text="Import", icon="IMPORT")
        if len(settings.rows):
            row.operator("rockfall.export_pairs", text="Export", icon="EXPORT")
            row.operator("rockfall.delete_pair", text="", icon="TRASH").every = True


class ROCKFALL_PT_alignment_lens(RockfallPanel, bpy.types.Panel):
    bl_label = "Lens"
    bl_idname = "ROCKFALL_PT_alignment_lens"
    bl_parent_id = "ROCKFALL_PT_alignment"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return videos.active_camera(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, camera = self.layout, videos.active_camera(context.scene)
        settings, solution = camera.rockfall_alignment, alignment.solution_of(camera)
        sigma, lens = solution.sigma or {}, alignment.lens_of(camera)
        row = layout.row(align=True)
        row.prop(settings, "free_focal", text="", icon="UNLOCKED" if settings.free_focal else "LOCKED")
        fields = row.row(align=True)
        fields.enabled = not settings.free_focal
        fields.prop(settings, "focal_px", text="f [px]")
        fields.prop(settings, "focal_mm", text="[mm]")
        if settings.free_focal and "fx" in sigma:
            layout.label(text=f"Found: {lens[0]:.1f} ± {sigma['fx']:.1f} px", icon="BLANK1")
        self._box(layout, settings, "free_centre", "Centre", _values(lens[2:4], sigma, ("cx", "cy"), ".1f", " px"))
        for name, index in (("k1", 4), ("k2", 5)):
            self._box(layout, settings, f"free_{name}", name, _values(lens[index : index + 1], sigma, (name,), ".4f"))
        header, body = layout.panel("rockfall_more_of_the_lens", default_closed=True)
        header.label(text="More of the lens")
        if body is not None:
            for name, index in (("k3", 6), ("p1", 7), ("p2", 8)):
                text = _values(lens[index : index + 1], sigma, (name,), ".5f")
                self._box(body, settings, f"free_{name}", name, text)

    @staticmethod
    def _box(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, box: str, name: str, value: str) -> None:
        row = layout.split(factor=0.4, align=True)
        free = getattr(settings, box)
        row.prop(settings, box, text=name, icon="UNLOCKED" if free else "LOCKED", toggle=True)
        row.label(text=value)


def _values(numbers: object, sigma: dict[str, float], names: tuple[str, ...], digits: str, unit: str = "") -> str:
    text = ", ".join(f"{number:{digits}}" for number in numbers)
    spread = [f"{sigma[name]:{digits}}" for name in names if name in sigma]
    return f"{text}{' ± ' + ', '.join(spread) if spread else ''}{unit}"


class ROCKFALL_PT_alignment_motion(RockfallPanel, bpy.types.Panel):
    bl_label = "Hand-held Camera"
    bl_idname = "ROCKFALL_PT_alignment_motion"
    bl_parent_id = "ROCKFALL_PT_alignment"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return videos.active_camera(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, camera = self.layout, videos.active_camera(context.scene)
        settings = camera.rockfall_alignment
        layout.row(align=True).prop(settings, "motion", expand=True)
        if settings.motion == "FIXED":
            fixed = camera_paths.camera_path(camera).is_fixed
            text = TRIPOD if fixed else "It moves as its file says, a pose for each frame."
            paragraph(context, layout, text, "INFO")
            show_remarks(context, layout, alignment.background_remarks(camera))
            return
        known = following.followed(camera)
        if known is None:
            advise(context, layout, False, "Solve the camera in one frame, then follow the background from there.")
        else:
            self._said(context, camera, known)
        row = layout.row()
        row.scale_y = 1.2
        row.operator(
            "rockfall.follow_background",
            text="Follow the Background" if known is None else "Follow Again",
            icon="TRACKING_FORWARDS",
        )
        if known is not None:
            layout.operator("rockfall.propose_pairs", icon="PINNED")

    def _said(self, context: bpy.types.Context, camera: bpy.types.Object, known: dict) -> None:
        layout, keys = self.layout, alignment.solution_of(camera).keys
        corrected = f", corrected at {', '.join(map(str, keys))}" if keys else ""
        text = f"Solved at frame {known['reference']}, followed through {known['frames']} frames{corrected}."
        advise(context, layout, True, text)
        rows = [("Turns by up to", f"{known['turn_deg']:.2f}°")]
        if known["features"]:
            rows.append(("Features a frame", f"{known['features']:.0f}"))
        if known["residual_px"] is not None:
            rows.append(("They fit to", f"{known['residual_px']:.2f} px"))
        if known["sigma_px"] is not None:
            rows.append(("Poses known to", f"{known['sigma_px']:.2f} px"))
        facts(layout, rows)
        show_remarks(context, layout, known["remarks"])


class ROCKFALL_PT_alignment_files(RockfallPanel, bpy.types.Panel):
    bl_label = "Camera File"
    bl_idname = "ROCKFALL_PT_alignment_files"
    bl_parent_id = "ROCKFALL_PT_alignment"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return videos.active_camera(context.scene) is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, camera = self.layout, videos.active_camera(context.scene)
        if camera_paths.is_solved(camera):
            local = camera_paths.camera_path(camera).reference.position
            place = georeference.read_shift(context.scene).to_survey(local)
            sigma = alignment.solution_of(camera).sigma or {}
            rows = []
            for axis, value in zip("xyz", place.tolist(), strict=True):
                spread = f" ± {sigma[axis]:.2f}" if axis in sigma else ""
                rows.append((f"Position {axis.upper()}", f"{value:.2f}{spread} m"))
            facts(layout, rows)
        row = layout.row(align=True)
        row.operator("rockfall.import_camera", text="Import", icon="IMPORT")
        row.operator("rockfall.export_camera", text="Export", icon="EXPORT")


CLASSES = (
    ROCKFALL_UL_pairs,
    ROCKFALL_PT_alignment,
    ROCKFALL_PT_alignment_lens,
    ROCKFALL_PT_alignment_motion,
    ROCKFALL_PT_alignment_files,
)
