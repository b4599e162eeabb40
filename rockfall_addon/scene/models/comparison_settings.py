# SPDX-License-Identifier: GPL-3.0-or-later
"""What is compared with the scene's impacts: models, draws, sets of parameters, impacts of other sites."""

from collections.abc import Collection

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty, StringProperty

from ....core.analysis.courses import SPINS
from ....core.analysis.scores import ABSCISSA
from ....core.analysis.variables import find_variable
from ....core.impact_models.registry import FORMULAS, MODELS
from . import models

SPIN_WORDS = {
    "rolling": ("Rolling", "A block whose spin is not known rolls, with the velocity it has after the impact before"),
    "zero": ("None", "A block whose spin is not known does not spin"),
    "table": ("Measured", "Impacts whose spin was measured, and no others"),
}
MOST_REPLICATES = 200


def model_items(names: Collection[str]) -> list[tuple[str, str, str]]:
    """Items of a property that is one of these models."""
    return [(name, MODELS[name].title, MODELS[name].reference) for name in models.ORDER if name in names]


def _redraw(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    redraw()


def _spin_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from . import model_parameters

    model_parameters.follow(self.id_data, models.shown_models(self.id_data))
    redraw()


def redraw() -> None:
    """Draw graphs and panels again."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type in ("NODE_EDITOR", "VIEW_3D"):
                area.tag_redraw()


class ComparedDatabase(bpy.types.PropertyGroup):
    """A table with impacts of other sites."""

    path: StringProperty(
        name="File", description="impacts.csv of another project, or of rockfall merge", subtype="FILE_PATH",
        update=_redraw,
    )  # fmt: skip
    digest: StringProperty(description="SHA-256 of the file when it was added: tells whether it has changed")
    shown: BoolProperty(name="Show", description="Show its impacts in the graphs", default=True, update=_redraw)


class ComparisonSettings(bpy.types.PropertyGroup):
    """What the graphs compare with the measured impacts."""

    models: EnumProperty(
        name="Models", description="Models in the graphs", items=models.CHOICES, options={"ENUM_FLAG"},
        default={"noel_2017"}, update=_redraw,
    )  # fmt: skip
    points: EnumProperty(
        name="Points of a model", description="What a point of a model with chance is",
        items=[
            ("MEAN", "Mean", "The model at the mean of its random parameters"),
            ("DRAW", "One draw", "One draw for each impact: it scatters as the model says single impacts do"),
            ("ALL", "All draws", "Every replicate of each impact"),
        ],
        default="MEAN", update=_redraw,
    )  # fmt: skip
    replicates: IntProperty(
        name="Replicates", description="Draws for each impact, for the scores and the graphs, besides the mean",
        default=6, min=0, soft_max=50, max=MOST_REPLICATES, update=_redraw,
    )  # fmt: skip
    seed: IntProperty(
        name="Seed", description="Of the random numbers. They stay while a parameter changes, so the points do not "
        "dance; another seed draws others", min=0, update=_redraw,
    )  # fmt: skip
    spin: EnumProperty(
        name="First spin", description="The spin before an impact when none is known from the impact before",
        items=[(name, *SPIN_WORDS[name]) for name in SPINS], default="rolling", update=_spin_changed,
    )  # fmt: skip
    sets: EnumProperty(
        name="Parameters", description="Which set of parameters the graphs show",
        items=[
            ("A", "A", "The scene's parameters, which the blocks in the 3-D view and the simulation have, too"),
            ("B", "B", "The second set, for the graphs alone"),
            ("BOTH", "Both", "Both sets, one beside the other"),
        ],
        default="A", update=_redraw,
    )  # fmt: skip
    edited: EnumProperty(
        name="Edit", description="Which set of parameters the sliders change",
        items=[("A", "A", "The scene's parameters"), ("B", "B", "The second set")], default="A",
    )  # fmt: skip
    quantity: EnumProperty(
        name="Quantity", description="What the scores are of",
        items=[(name, find_variable(name).label, "") for name in ABSCISSA], default="rn", update=_redraw,
    )  # fmt: skip
    measure: EnumProperty(
        name="Rank by", description="Which score ranks the models; 0 is best",
        items=[
            ("rmse", "RMSE", "Root mean square of model − measured, impact by impact"),
            ("bias", "Bias", "Mean of model − measured, without its sign"),
            ("median_error", "Median error", "Median size of model − measured, which a few outliers do not move"),
            ("energy_distance", "Cloud", "Energy distance between the clouds of the graph, the scatter included"),
        ],
        default="rmse", update=_redraw,
    )  # fmt: skip
    fitted: EnumProperty(name="Model", description="Model whose parameters are fitted", items=model_items(FORMULAS))
    imitated: EnumProperty(
        name="Like", description="Model that is imitated, with the parameters of set A", items=model_items(FORMULAS),
    )  # fmt: skip
    fitted_names: StringProperty(
        name="Fit", description="Parameters that are fitted, as MODEL.PARAMETER; the usual ones of a model without any"
    )
    fit_with_others: BoolProperty(
        name="Impacts of Other Sites, Too", description="Fit to the shown tables of other sites as well", default=False
    )
    databases: CollectionProperty(type=ComparedDatabase)
    database: IntProperty(name="Database", description="Row of the list", options={"SKIP_SAVE"})


CLASSES = (ComparedDatabase, ComparisonSettings)


def register() -> None:
    bpy.types.Scene.rockfall_comparison = bpy.props.PointerProperty(type=ComparisonSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall_comparison
