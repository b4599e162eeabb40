# SPDX-License-Identifier: GPL-3.0-or-later
"""Models in the scene: their parameters, and beside each real block one that leaves its impacts as a model says."""

import json
from collections.abc import Mapping, Sequence

import bpy

from ....core.analysis.comparison import Predictions, compare
from ....core.analysis.predicted_flights import PredictedFlights, fly_predictions
from ....core.errors import RockfallError, readable
from ....core.impact_models.machinery.parameters import Value
from ....core.impact_models.registry import COMPARED, MODELS
from ....core.reconstruction.drag import Drag
from ....core.reconstruction.impact import Impacts
from ....core.reconstruction.trajectory import Reconstruction
from ..footage import timing
from ..picks import trails
from ..storage import store
from ..terrain import terrain
from . import model_blocks

ORDER = (*COMPARED, *(name for name in MODELS if name not in COMPARED))
"""The models as they are listed."""
CHOICES = [
    (name, MODELS[name].title, f"{MODELS[name].title} ({name}): {MODELS[name].reference}", 1 << i)
    for i, name in enumerate(ORDER)
]
"""Items of a property that holds some of the models."""
PARAMETER_SETS = {"A": store.MODEL_PARAMETERS, "B": store.OTHER_PARAMETERS}
"""Where each set of parameters is kept."""


def shown_models(scene: bpy.types.Scene) -> tuple[str, ...]:
    """The models whose blocks are in the scene."""
    return tuple(filter(None, str(scene.get(store.SHOWN_MODELS, "")).split(" ")))


def parameters_of(scene: bpy.types.Scene, which: str = "A") -> dict[str, dict[str, Value]]:
    """Model → parameter → value, where a set of parameters has another than the default.

    which : "A", the scene's parameters, or "B", the second set that graphs can show.
    """
    return store.read_json(scene, _key_of(which), {})


def _key_of(which: str) -> str:
    if which not in PARAMETER_SETS:
        raise RockfallError(f"There is no set of parameters {readable(repr(which), 60)}. There are A and B.")
    return PARAMETER_SETS[which]


def keep_parameters(scene: bpy.types.Scene, parameters: Mapping[str, Mapping[str, Value]], which: str = "A") -> None:
    """Store a set of parameters with the scene: as text, which keeps every digit."""
    scene[_key_of(which)] = json.dumps({name: dict(values) for name, values in parameters.items()})


def show_models(
    scene: bpy.types.Scene,
    result: Reconstruction,
    models: Sequence[str],
    parameters: Mapping[str, Mapping[str, Value]] | None = None,
) -> PredictedFlights:
    """Show the blocks of these models, and of no others; with these parameters, which are kept, or those of the scene.

    Raises
    ------
    RockfallError : there is no terrain for them to land on, or no impact that a model can be asked about.
    """
    if parameters is not None:
        keep_parameters(scene, parameters)
    predicted = find_predictions(scene, result, models)
    model_blocks.remove(scene, predicted.models)
    scene[store.SHOWN_MODELS] = " ".join(predicted.models)
    model_blocks.show(scene, predicted, timing.shown_offsets(scene, result.picks))
    trails.paint_observed(scene)
    return predicted


def find_predictions(scene: bpy.types.Scene, result: Reconstruction, models: Sequence[str]) -> PredictedFlights:
    """The flights that the models predict, by their means, on the scene's terrain; errors as in `show_models`."""
    own = {name: values for name, values in parameters_of(scene).items() if name in models}
    predictions = compare(result.impacts, models, own, spin=scene.rockfall_comparison.spin)
    return fly(scene, result.impacts, predictions, result.gravity_mps2, result.drag)


def fly(
    scene: bpy.types.Scene,
    impacts: Impacts,
    predictions: Predictions,
    gravity_mps2: float,
    drag: Drag | None,
    *,
    beside: bool = True,
) -> PredictedFlights:
    """The flights of the means of predictions for these impacts, on the scene's terrain.

    beside : see `fly_predictions`.

    Raises
    ------
    RockfallError : there is no terrain for them to land on.
    """
    surface = terrain.surface_of_scene(scene)
    if surface is None:
        raise RockfallError("The blocks of the models land on the terrain: import one first.")
    return fly_predictions(impacts, predictions, surface, gravity_mps2=gravity_mps2, drag=drag, beside=beside)


def follow(scene: bpy.types.Scene, result: Reconstruction) -> None:
    """Bring the blocks that are shown in line with a changed reconstruction."""
    models = shown_models(scene)
    if not models:
        return
    try:
        show_models(scene, result, models)
    except RockfallError:
        remove_models(scene)
        raise


def remove_models(scene: bpy.types.Scene) -> None:
    """Show the real blocks only, coloured by speed again."""
    model_blocks.remove(scene)
    if store.SHOWN_MODELS in scene:
        del scene[store.SHOWN_MODELS]
    trails.paint_observed(scene)
