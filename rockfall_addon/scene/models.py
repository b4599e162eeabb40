# SPDX-License-Identifier: GPL-3.0-or-later
"""Models in the scene: beside each real block, the block that leaves its impacts as a model says.

Of each model: its flight curves, and for each trajectory a block that appears at an impact, flies, and vanishes soon
after it has landed. Where one still flies when the next one starts, a second block takes over.
"""

import json
from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from ...core.analysis.comparison import compare
from ...core.analysis.predicted_flights import PredictedFlights, fly_predictions
from ...core.errors import RockfallError
from ...core.impact_models.machinery.parameters import Value
from ...core.impact_models.registry import COMPARED, MODELS, find_model
from ...core.reconstruction.trajectory import Reconstruction
from . import keyframes, store, terrain, timing, trails, trajectories

ORDER = (*COMPARED, *(name for name in MODELS if name not in COMPARED))
"""The models as they are listed."""
CHOICES = [
    (name, MODELS[name].title, f"{MODELS[name].title} ({name}): {MODELS[name].reference}", 1 << i)
    for i, name in enumerate(ORDER)
]
"""Items of a property that holds some of the models."""
PARAMETER_SETS = {"A": store.MODEL_PARAMETERS, "B": store.OTHER_PARAMETERS}
"""Where each set of parameters is kept."""
LINGER_S = 0.2
"""How long a predicted block lies where it has landed."""


def shown_models(scene: bpy.types.Scene) -> tuple[str, ...]:
    """The models whose blocks are in the scene."""
    return tuple(filter(None, str(scene.get(store.SHOWN_MODELS, "")).split(" ")))


def parameters_of(scene: bpy.types.Scene, which: str = "A") -> dict[str, dict[str, Value]]:
    """Model → parameter → value, where a set of parameters has another than the default.

    which : "A", the scene's parameters, or "B", the second set that graphs can show.
    """
    return json.loads(scene.get(PARAMETER_SETS[which], "{}"))


def keep_parameters(scene: bpy.types.Scene, parameters: Mapping[str, Mapping[str, Value]], which: str = "A") -> None:
    """Store a set of parameters with the scene: as text, which keeps every digit."""
    scene[PARAMETER_SETS[which]] = json.dumps({name: dict(values) for name, values in parameters.items()})


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
    _remove_objects(scene)
    scene[store.SHOWN_MODELS] = " ".join(predicted.models)
    offsets = timing.shown_offsets(scene, result.picks)
    begin_s = predicted.time_s - np.array([offsets[name] for name in predicted.trajectory.tolist()])
    blocks = {obj[store.TRAJECTORY]: obj for obj in store.with_role(scene, store.BLOCK_ROLE)}
    for model in predicted.models:
        which = np.flatnonzero((predicted.model == model) & (predicted.duration_s > 0))
        if not which.size:
            continue
        _show_flights(scene, model, predicted, which, begin_s)
        for name, block in blocks.items():
            own = which[predicted.trajectory[which] == name]
            for number, lane in enumerate(_lanes(begin_s[own], predicted.duration_s[own])):
                _show_block(scene, block, model, number, predicted, own[lane], begin_s)
    trails.paint_observed(scene)
    trails.set_trails(scene)
    return predicted


def find_predictions(scene: bpy.types.Scene, result: Reconstruction, models: Sequence[str]) -> PredictedFlights:
    """The flights that the models predict, by their means, on the scene's terrain; errors as in `show_models`."""
    surface = terrain.surface_of_scene(scene)
    if surface is None:
        raise RockfallError("The blocks of the models land on the terrain: import one first.")
    own = {name: values for name, values in parameters_of(scene).items() if name in models}
    predictions = compare(result.impacts, models, own)
    return fly_predictions(result.impacts, predictions, surface, gravity_mps2=result.gravity_mps2, drag=result.drag)


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
    _remove_objects(scene)
    if store.SHOWN_MODELS in scene:
        del scene[store.SHOWN_MODELS]
    trails.paint_observed(scene)


def _remove_objects(scene: bpy.types.Scene) -> None:
    store.remove_objects(
        store.with_role(scene, store.MODEL_BLOCK_ROLE) + store.with_role(scene, store.MODEL_FLIGHTS_ROLE)
    )
    store.remove_collection(scene, "Twins")


def _show_flights(
    scene: bpy.types.Scene, model: str, predicted: PredictedFlights, which: np.ndarray, begin_s: np.ndarray
) -> None:
    pieces = []
    for index in which:
        clock = trails.moments(0.0, float(predicted.duration_s[index]))
        position, velocity = predicted.launches.states(np.full(len(clock), index), clock)
        pieces.append((begin_s[index] + clock, position, np.linalg.norm(velocity, axis=1)))
    obj = trails.trail(f"{model} flights", store.MODEL_FLIGHTS_ROLE, pieces)
    obj[store.MODEL] = model
    trails.paint(obj.data, np.array(find_model(model).colour))
    _link(scene, obj, model)


def _show_block(
    scene: bpy.types.Scene,
    real: bpy.types.Object,
    model: str,
    number: int,
    predicted: PredictedFlights,
    which: np.ndarray,
    begin_s: np.ndarray,
) -> None:
    """A block for the flights `which`, which follow each other without overlap."""
    name = real[store.TRAJECTORY]
    obj = bpy.data.objects.new(
        f"{name} {model}{f' {number + 1}' if number else ''}",
        trajectories.block_mesh(f"Rockfall twin {model}", find_model(model).colour),
    )
    obj[store.ROLE], obj[store.MODEL], obj[store.TRAJECTORY] = store.MODEL_BLOCK_ROLE, model, name
    obj.scale, obj.delta_location = real.scale, real.delta_location
    _link(scene, obj, model)
    rate = timing.keyed_rate(scene)
    keyframes.write_location_keys(obj, _keys(predicted, which, begin_s), rate)
    ends = begin_s[which] + predicted.duration_s[which] + LINGER_S
    ends[:-1] = np.minimum(ends[:-1], begin_s[which[1:]])
    keyframes.write_visibility_keys(obj, list(zip(begin_s[which].tolist(), ends.tolist(), strict=True)), rate)


def _keys(predicted: PredictedFlights, which: np.ndarray, begin_s: np.ndarray) -> keyframes.Keys:
    """Of each flight its ends, which make the parabola; with drag, more of them."""
    times, places, speeds, held = [], [], [], []
    for index in which:
        duration = float(predicted.duration_s[index])
        dragged = predicted.launches.drag_per_m[index] > 0
        knots = np.linspace(0.0, duration, (int(np.ceil(duration / keyframes.DRAG_KEY_STEP_S)) if dragged else 1) + 1)
        position, velocity = predicted.launches.states(np.full(len(knots), index), knots)
        times.append(begin_s[index] + knots)
        places.append(position)
        speeds.append(velocity)
        held.append(np.arange(len(knots)) == len(knots) - 1)
    velocity = np.vstack(speeds)
    return keyframes.Keys(np.concatenate(times), np.vstack(places), velocity, velocity, np.concatenate(held))


def _lanes(begin_s: np.ndarray, duration_s: np.ndarray) -> list[list[int]]:
    """The flights of each block, so that no block flies twice at a time and there are as few blocks as can be."""
    lanes: list[list[int]] = []
    free_at: list[float] = []
    for i in np.argsort(begin_s).tolist():
        lane = next((j for j, free in enumerate(free_at) if free <= begin_s[i]), len(lanes))
        if lane == len(lanes):
            lanes.append([])
            free_at.append(0.0)
        lanes[lane].append(i)
        free_at[lane] = float(begin_s[i] + duration_s[i])
    return lanes


def _link(scene: bpy.types.Scene, obj: bpy.types.Object, model: str) -> None:
    store.collection(scene, "Twins", find_model(model).title).objects.link(obj)
