# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis: which parameters make whole falls come out as the observed ones; then blocks can draw from these."""

from math import floor, log10

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, PointerProperty, StringProperty

from ....core.impact_models.registry import MODELS
from ....core.progress import Progress
from ....core.simulation.parameter_draws import FRICTION_NAME
from ....core.workflow.back_analysis import ROUNDS, SETS
from ...scene.models import model_parameters
from ...scene.simulation import back_analysis, posterior, screens
from ...scene.storage import store
from ...scene.terrain import terrain
from ...view import job
from ...view.job import InBackground, Work
from ...view.panel import RockfallPanel, numbers, paragraph, show_remarks
from ...view.reporting import possible, reported

NAMES_PART = 0.26
"""Of the width, for the names of parameters: most have few letters, and their numbers many digits."""


class BackAnalysisSettings(bpy.types.PropertyGroup):
    """What is fitted, and whether blocks draw from what was found."""

    model: EnumProperty(name="Model", description="Whose parameters are fitted", items=back_analysis.CHOICES)
    source: EnumProperty(
        name="Observed", description="What blocks were seen to do. Shift-click takes several together",
        items=[
            ("SCENE", "Measured trajectories", "Those of this scene"),
            ("PICKS", "A table of picks", "Trajectories from elsewhere: picks.csv, reconstructed on this terrain with "
             "the settings of the steps above"),
            ("STOPS", "Releases and stops", "Blocks without footage: where each started, and where it stopped"),
        ],
        options={"ENUM_FLAG"}, default={"SCENE"},
    )  # fmt: skip
    picks: StringProperty(
        name="Picks", description="Trajectories: trajectory, time_s, x_m, y_m, z_m, kind", subtype="FILE_PATH"
    )
    releases: StringProperty(
        name="Releases", description="Blocks: release, x_m, y_m; if known z_m, velocity, diameter, density",
        subtype="FILE_PATH",
    )  # fmt: skip
    stops: StringProperty(
        name="Stops", description="Where each block stopped: release, x_m, y_m; z_m where it is not on the terrain",
        subtype="FILE_PATH",
    )  # fmt: skip
    completeness: EnumProperty(
        name="Record", description="Whether the observed runs are all that fell. Parameters that are fitted to the "
        "longest runs as if they were all make every block come as far",
        items=[
            (back_analysis.UNSTATED, "Not stated", "It is looked for signs of missing short runs"),
            ("COMPLETE", "Complete", "All blocks that fell were observed"),
            ("LONGEST", "Longest of", "The observed runs came farthest of a number of falls; as many are simulated, "
             "and the longest of them compared"),
            ("UNKNOWN", "Unknown", "Nobody knows; it is looked for signs of missing short runs"),
        ],
    )  # fmt: skip
    falls: IntProperty(
        name="Falls", description="So many blocks fell, of which those that came farthest were observed. 0: as many "
        "as the table of releases has", default=0, min=0, soft_max=1000, max=back_analysis.MOST_FALLS,
    )  # fmt: skip
    contours: StringProperty(
        name="Contours [m]", description="Heights in survey coordinates, between commas: speed, height and place are "
        "compared where blocks fall below them. Without any section, three are chosen",
    )  # fmt: skip
    drops: StringProperty(
        name="Drops [m]", description="Heights below each block's own start, between commas: as contours, where "
        "blocks start at different heights",
    )  # fmt: skip
    at_screens: BoolProperty(
        name="Screens", description="What passes the drawn screens is compared there; barriers hold nothing in this"
    )
    names: StringProperty(description="Parameters that are fitted, each behind its model and a point")
    priors: StringProperty(
        name="Before", description="What was thought possible before, for example: rn = 0.2..0.6, friction = "
        "normal:0.5,0.1. Without it anything in a parameter's range",
    )  # fmt: skip
    sets: IntProperty(
        name="Sets", description="Sets of parameters in a round; each lets every observed block fall once",
        default=SETS, min=150, soft_max=10_000, max=100_000,
    )  # fmt: skip
    rounds: IntProperty(
        name="Rounds", description="The first from what was thought possible, the others around what fits",
        default=ROUNDS, min=1, soft_max=5, max=20,
    )  # fmt: skip
    draw: BoolProperty(
        name="Draw Parameters from It", description="Each simulated block of this model draws its parameters from what "
        "fits, so that paths and maps show what is not known of them, too",
    )  # fmt: skip


class ROCKFALL_OT_back_analyse(InBackground, bpy.types.Operator):
    """Find, in the background, with which parameters whole simulated falls come out as the observed ones"""

    bl_idname = "rockfall.back_analyse"
    bl_label = "Back-Analyse"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        lacking = back_analysis.missing(context.scene)
        return possible(cls, not lacking, lacking) and job.is_free(cls)

    def prepare(self, context: bpy.types.Context) -> Work:
        question = back_analysis.ask(context.scene)

        def compute(progress: Progress) -> object:
            return back_analysis.run(question, progress)

        def keep(scene: bpy.types.Scene, found: object) -> str:
            back_analysis.keep(scene, question, found)
            kept = posterior.kept_of(scene)
            told = f"{MODELS[kept.model].title}, from {len(found.observed)} observed runs."
            return " ".join((*(str(one) for one in kept.remarks[:1]), told))

        return Work("back_analysis", compute, keep)


class ROCKFALL_OT_choose_back_analysed(bpy.types.Operator):
    """Fit this parameter, or leave it as it is"""

    bl_idname = "rockfall.choose_back_analysed"
    bl_label = "Choose Parameter to Back-Analyse"
    bl_options = {"INTERNAL", "UNDO"}

    model: StringProperty()
    parameter: StringProperty()

    @classmethod
    def description(cls, context: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        if properties.parameter == FRICTION_NAME:
            return "Coefficient μ of rolling or sliding on the ground"
        return model_parameters.tooltip(MODELS[properties.model].parameter(properties.parameter))

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        back_analysis.toggle(context.scene, self.model, self.parameter)
        return {"FINISHED"}


class _OfResult:
    """Mix-in: does something with what was found."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return possible(cls, store.BACK_ANALYSIS in context.scene, "There is no back-analysis: run one first")


class ROCKFALL_OT_use_medians(_OfResult, bpy.types.Operator):
    """Give the model, and the friction, the medians of the back-analysis as their values"""

    bl_idname = "rockfall.use_medians"
    bl_label = "Use Medians"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        back_analysis.use_medians(context.scene)
        return {"FINISHED"}


class ROCKFALL_OT_remove_back_analysis(_OfResult, bpy.types.Operator):
    """Forget what the back-analysis found"""

    bl_idname = "rockfall.remove_back_analysis"
    bl_label = "Remove Back-Analysis"

    @reported
    def execute(self, context: bpy.types.Context) -> set[str]:
        posterior.forget(context.scene)
        return {"FINISHED"}


class ROCKFALL_PT_back_analysis(RockfallPanel, bpy.types.Panel):
    bl_label = "Back-analysis"
    bl_idname = "ROCKFALL_PT_back_analysis"
    bl_parent_id = "ROCKFALL_PT_simulation"
    bl_options = {"DEFAULT_CLOSED"}
    needs = store.TERRAIN_ROLE

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, kept = scene.rockfall_back_analysis, posterior.kept_of(scene)
        lacking = back_analysis.missing(scene)
        if lacking:
            paragraph(context, layout, lacking, "INFO")
        elif kept is None:
            text = "Which parameters make whole falls come out as the observed ones? All that fit, not only the best."
            paragraph(context, layout, text, "INFO")
        if terrain.tiles(scene):
            _draw_observed(layout, settings)
        if not lacking:
            _draw_sections(layout, scene, settings)
            _draw_question(layout, scene, settings)
        job.draw(context, layout, "back_analysis")
        if kept is not None:
            _draw_result(context, layout, kept, settings)


def _draw_observed(layout: bpy.types.UILayout, settings: BackAnalysisSettings) -> None:
    column = layout.column(align=True)
    column.use_property_split, column.use_property_decorate = True, False
    column.prop(settings, "source")
    column.separator(factor=0.5)
    if "PICKS" in settings.source:
        column.prop(settings, "picks")
    if "STOPS" in settings.source:
        column.prop(settings, "releases")
        column.prop(settings, "stops")
    column.prop(settings, "completeness")
    if settings.completeness == "LONGEST":
        column.prop(settings, "falls")


def _draw_sections(layout: bpy.types.UILayout, scene: bpy.types.Scene, settings: BackAnalysisSettings) -> None:
    column = layout.column(align=True)
    column.use_property_split, column.use_property_decorate = True, False
    if screens.objects_of(scene):
        row = column.row(heading="Compared at")
        row.prop(settings, "at_screens", text="Drawn Screens")
    column.prop(settings, "contours", placeholder="1540, 1520")
    column.prop(settings, "drops", placeholder="5, 10")


def _draw_question(layout: bpy.types.UILayout, scene: bpy.types.Scene, settings: BackAnalysisSettings) -> None:
    layout.prop(settings, "model", text="")
    names = back_analysis.fitted_names(scene, settings.model)
    column = layout.column(align=True)
    units = {spec.name: spec.unit for spec in MODELS[settings.model].parameters if not spec.choices}
    for name, unit in (units | {FRICTION_NAME: ""}).items():
        on = name in names
        icon = "CHECKBOX_HLT" if on else "CHECKBOX_DEHLT"
        button = column.operator("rockfall.choose_back_analysed", text=_named(name, unit), icon=icon, depress=on)
        button.model, button.parameter = settings.model, name
    column = layout.column(align=True)
    column.label(text="Thought possible before:")
    column.prop(settings, "priors", text="", placeholder="rn = 0.2..0.6")
    column = layout.column(align=True)
    column.use_property_split, column.use_property_decorate = True, False
    column.prop(settings, "sets")
    column.prop(settings, "rounds")
    row = layout.row()
    row.scale_y = 1.4
    row.operator("rockfall.back_analyse", icon="LOOP_BACK")


def _draw_result(
    context: bpy.types.Context, layout: bpy.types.UILayout, kept: posterior.Kept, settings: BackAnalysisSettings
) -> None:
    box = layout.box()
    box.label(text=MODELS[kept.model].title, icon="PHYSICS")
    if back_analysis.is_stale(context.scene, kept):
        paragraph(context, box, back_analysis.STALE, "ERROR")
    grave = [one for one in kept.remarks if one.severity in ("problem", "warning")]
    show_remarks(context, box, grave)
    column = box.column(align=True)
    numbers(column, "", ("median", "95 %"), NAMES_PART)
    for row in kept.rows:
        low, median, high = _rounded(row.low, row.median, row.high)
        numbers(column, _named(row.name, row.unit), (median, f"{low} … {high}"), NAMES_PART)
        if row.prior:
            paragraph(context, column, f"before {row.prior}" + (f": {row.left}" if row.left else ""))
            column.separator()
    for row in kept.rows:
        said = [one for one in row.remarks if one.severity != "note"]
        if said:
            column = box.column(align=True)
            column.label(text=f"{row.name}:")
            show_remarks(context, column, said)
    box.prop(settings, "draw", toggle=True, icon="MOD_ARRAY")
    if settings.draw and kept.model not in context.scene.rockfall_simulation.models:
        paragraph(context, box, f"{MODELS[kept.model].title} is not among the simulated models above.", "ERROR")
    row = box.row(align=True)
    row.operator("rockfall.use_medians", icon="CHECKMARK")
    row.operator("rockfall.remove_back_analysis", text="", icon="X")
    show_remarks(context, box, [one for one in kept.remarks if one not in grave])
    if kept.said:
        paragraph(context, box, kept.said, "INFO")


def _rounded(low: float, median: float, high: float) -> list[str]:
    """With as many decimals as the width of the interval is worth, so that a row has room."""
    decimals = min(max(2 - floor(log10(high - low)), 0), 9) if high > low else 3
    return [f"{value:.{decimals}f}" for value in (low, median, high)]


def _named(name: str, unit: str) -> str:
    """A parameter as it is typed in front of what was thought possible."""
    return f"{name} [{unit}]" if unit else name


CLASSES = (
    BackAnalysisSettings,
    ROCKFALL_OT_back_analyse,
    ROCKFALL_OT_choose_back_analysed,
    ROCKFALL_OT_use_medians,
    ROCKFALL_OT_remove_back_analysis,
    ROCKFALL_PT_back_analysis,
)


def register() -> None:
    bpy.types.Scene.rockfall_back_analysis = PointerProperty(type=BackAnalysisSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_back_analysis
