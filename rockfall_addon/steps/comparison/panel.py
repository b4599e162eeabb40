# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar of the impact graphs."""

import math

import bpy

from ....core.analysis.variables import find_variable
from ....core.impact_models.registry import MODELS
from ...scene.models import comparison, comparison_scores, fit, model_parameters, models
from ...scene.storage import databases, store
from ...view import job, parameters
from ...view.graphs.panel import GraphPanel
from ...view.panel import paragraph, show_remarks

MEASURES = {"rmse": "RMSE", "median_error": "median", "energy_distance": "cloud"}
"""Measure → head of its column."""


class ROCKFALL_PT_compared_models(GraphPanel, bpy.types.Panel):
    bl_label = "Models"
    bl_idname = "ROCKFALL_PT_compared_models"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, found = scene.rockfall_comparison, comparison.comparison_of(scene)
        in_view = models.shown_models(scene)
        column = layout.column(align=True)
        for name in models.ORDER:
            row = column.row(align=True)
            on = name in settings.models
            icon = "CHECKBOX_HLT" if on else "CHECKBOX_DEHLT"
            row.operator("rockfall.compare_model", text=MODELS[name].title, icon=icon, depress=on).model = name
            shown = name in in_view
            button = row.operator(
                "rockfall.show_models", text="", icon="HIDE_OFF" if shown else "HIDE_ON", depress=shown
            )
            button.models = set(in_view) ^ {name}
        for problem in found.problems:
            paragraph(context, layout, problem, "ERROR")
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.row().prop(settings, "points", text="Points", expand=False)
        column = layout.column(align=True)
        column.prop(settings, "replicates")
        column.prop(settings, "seed")
        layout.prop(settings, "spin")


class ROCKFALL_PT_compared_parameters(GraphPanel, bpy.types.Panel):
    bl_label = "Parameters"
    bl_idname = "ROCKFALL_PT_compared_parameters"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings = scene.rockfall_comparison
        row = layout.row(align=True)
        row.prop(settings, "sets", expand=True)
        which = settings.sets
        if which == "BOTH":
            row = layout.row(align=True)
            row.label(text="Change")
            row.prop(settings, "edited", expand=True)
            which = settings.edited
        if store.FIT in scene:
            paragraph(context, layout, "Set B is what was fitted.", "INFO")
            _draw_decision(layout)
        elif settings.sets != "A":
            row = layout.row(align=True)
            for way, text in (("A_TO_B", "A → B"), ("B_TO_A", "B → A"), ("SWAP", "Swap")):
                row.operator("rockfall.copy_parameters", text=text).way = way
        chosen = [name for name in models.ORDER if name in settings.models]
        if not chosen:
            paragraph(context, layout, "Choose a model above.", "INFO")
        for name in chosen:
            header, body = layout.panel(f"ROCKFALL_compared_{name}", default_closed=len(chosen) > 1)
            header.label(text=MODELS[name].title)
            if body is not None:
                parameters.draw(body, scene, name, which)
        row = layout.row(align=True)
        row.operator("rockfall.load_parameters", text="Load", icon="IMPORT")
        row.operator("rockfall.save_parameters", text="Save", icon="EXPORT").which = which


class ROCKFALL_PT_compared_scores(GraphPanel, bpy.types.Panel):
    bl_label = "Scores"
    bl_idname = "ROCKFALL_PT_compared_scores"

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, found = scene.rockfall_comparison, comparison.comparison_of(scene)
        column = layout.column(align=True)
        column.prop(settings, "quantity", text="")
        column.prop(settings, "measure", text="")
        kept = comparison_scores.kept_of(scene, found)
        ranked = comparison_scores.ranking(scene, found, kept)
        if not ranked:
            waits = "The models are being prepared …" if found.waiting else "No model can be scored yet."
            paragraph(context, layout, waits, "INFO")
            return
        several = len(found.predictions) > 1
        box = layout.box().column(align=True)
        measure = "rmse" if settings.measure == "bias" else settings.measure
        _score_row(box, "", "bias", MEASURES[measure])
        for row in ranked:
            title = f"{row.which}  {row.title}" if several else row.title
            _score_row(box, title, _signed(row.score.bias), _number(getattr(row.score, measure)))
        unit = find_variable(settings.quantity).unit
        n = max(row.score.n for row in ranked)
        words = f"Model − measured of {n} impacts" + (f", in {unit}" if unit else "")
        more = f" --replicates {settings.replicates} --seed {settings.seed}"
        if kept is None:
            paragraph(context, layout, f"{words}, as rockfall compare{more} prints it.", "INFO")
        else:
            paragraph(context, layout, f"{words}; the filters hide {int((~kept).sum())} others.", "FILTER")


def _score_row(layout: bpy.types.UILayout, *cells: str) -> None:
    row = layout.split(factor=0.58)
    row.label(text=cells[0])
    part = row.split(factor=0.5)
    for cell in cells[1:]:
        place = part.row()
        place.alignment = "RIGHT"
        place.label(text=cell)


class ROCKFALL_PT_calibration(GraphPanel, bpy.types.Panel):
    bl_label = "Calibrate"
    bl_idname = "ROCKFALL_PT_calibration"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, scene = self.layout, context.scene
        settings, proposal = scene.rockfall_comparison, fit.proposal_of(scene)
        job.draw(context, layout, "comparison")
        if proposal is not None:
            _draw_proposal(context, layout, proposal)
            return
        layout.prop(settings, "fitted", text="")
        names, own = fit.fitted_names(scene, settings.fitted), settings.fitted
        column = layout.column(align=True)
        for spec in MODELS[own].parameters:
            on = spec.name in names
            button = column.operator(
                "rockfall.choose_fitted",
                text=model_parameters.label(spec),
                icon="CHECKBOX_HLT" if on else "CHECKBOX_DEHLT",
                depress=on,
            )
            button.model, button.parameter = own, spec.name
        if len(settings.databases):
            layout.prop(settings, "fit_with_others")
        row = layout.row()
        row.scale_y = 1.4
        row.operator("rockfall.calibrate", icon="PIVOT_CURSOR")
        column = layout.column(align=True)
        column.label(text="Or make it behave like:")
        row = column.row(align=True)
        row.prop(settings, "imitated", text="")
        row.operator("rockfall.find_equivalent", text="Find")


def _draw_proposal(context: bpy.types.Context, layout: bpy.types.UILayout, proposal: fit.Proposal) -> None:
    if proposal.stale:
        paragraph(context, layout, proposal.stale, "ERROR")
    title = MODELS[proposal.model].title
    what = f"like {MODELS[proposal.imitated].title}, on" if proposal.imitated else "fitted to"
    paragraph(
        context, layout, f"{title} {what} {proposal.impacts} impacts of {proposal.trajectories} trajectories:", "GRAPH"
    )
    for row in proposal.rows:
        box = layout.box().column(align=True)
        box.label(text=f"{row.name}: {_value(row.before)} → {_value(row.after)}")
        if row.interval:
            box.label(text=f"95 %: {row.interval}")
        show_remarks(context, box, row.remarks)
    paragraph(context, layout, f"{proposal.scores}.", "INFO")
    show_remarks(context, layout, proposal.remarks)
    paragraph(context, layout, "Graphs and scores show it as set B beside set A.", "INFO")
    _draw_decision(layout)


def _draw_decision(layout: bpy.types.UILayout) -> None:
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.operator("rockfall.apply_fit", text="Apply", icon="CHECKMARK")
    row.operator("rockfall.discard_fit", text="Discard", icon="X")


class ROCKFALL_PT_other_sites(GraphPanel, bpy.types.Panel):
    bl_label = "Other sites"
    bl_idname = "ROCKFALL_PT_other_sites"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.rockfall_comparison
        if not len(settings.databases):
            text = "Impacts of other projects beside your own: impacts.csv, or a database of rockfall merge."
            paragraph(context, layout, text, "INFO")
        else:
            row = layout.row()
            row.template_list("ROCKFALL_UL_databases", "", settings, "databases", settings, "database", rows=3)
            row.column().operator("rockfall.remove_database", text="", icon="REMOVE")
            for item in settings.databases:
                table = databases.of_row(item)
                if table.problem:
                    paragraph(context, layout, table.problem, "ERROR")
            chosen = settings.databases[min(settings.database, len(settings.databases) - 1)]
            layout.prop(chosen, "path", text="")
        layout.operator("rockfall.add_database", icon="ADD")


def _signed(value: float) -> str:
    return f"{value:+.2f}" if math.isfinite(value) else "–"


def _number(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


CLASSES = (
    ROCKFALL_PT_compared_models,
    ROCKFALL_PT_compared_parameters,
    ROCKFALL_PT_compared_scores,
    ROCKFALL_PT_calibration,
    ROCKFALL_PT_other_sites,
)
