# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that show what a model predicts: its flight curves, and blocks that appear, fly and vanish.

Of each trajectory a block, and where one still flies when the next one starts, a second block takes over. Objects that
are there already are brought in line, so that a parameter can be changed while one looks.
"""

from collections.abc import Collection, Mapping

import bpy
import numpy as np

from ....core.analysis.predicted_flights import PredictedFlights
from ....core.impact_models.registry import find_model
from ....core.vectors import Array, Indices, norm
from ..footage import timing
from ..picks import keyframes, trails, trajectories
from ..storage import store

LINGER_S = 0.2
"""How long a predicted block lies where it has landed."""
COLLECTION = "Twins"


def show(
    scene: bpy.types.Scene, predicted: PredictedFlights, offsets: Mapping[str, float], *, keep_blocks: bool = False
) -> None:
    """Bring the objects of the models that `predicted` is of in line.

    offsets : see `timing.shown_offsets`.
    keep_blocks : those that are not needed now are hidden, not removed: more may be needed in a moment.
    """
    begin_s = _begins(predicted, offsets)
    real, blocks, flights = store.by_role(scene, store.BLOCK_ROLE, store.MODEL_BLOCK_ROLE, store.MODEL_FLIGHTS_ROLE)
    reals, there = {obj[store.TRAJECTORY]: obj for obj in real}, {_name_of(obj): obj for obj in blocks}
    curves, rate = {obj[store.MODEL]: obj for obj in flights}, timing.keyed_rate(scene)
    for model in predicted.models:
        which = np.flatnonzero((predicted.model == model) & (predicted.duration_s > 0))
        _show_flights(scene, model, predicted, which, begin_s, curves.get(model))
        lanes = {
            (model, name, number): own[lane]
            for name, own in _by_trajectory(predicted, which).items()
            if name in reals
            for number, lane in enumerate(_lanes(begin_s[own], predicted.duration_s[own]))
        }
        for (key, lane), keys in zip(lanes.items(), _keys(predicted, list(lanes.values()), begin_s), strict=True):
            block = there.get(key) or _new_block(scene, *key)
            _key_block(block, reals[key[1]], keys, begin_s[lane], predicted.duration_s[lane], rate)
        spare = [obj for key, obj in there.items() if key[0] == model and key not in lanes]
        if keep_blocks:
            for obj in spare:
                keyframes.write_visibility_keys(obj, [], rate)
        else:
            store.remove_objects(spare)


def remove(scene: bpy.types.Scene, but: Collection[str] = ()) -> None:
    """Remove the objects of all models but these."""
    objects = store.with_role(scene, store.MODEL_BLOCK_ROLE) + store.with_role(scene, store.MODEL_FLIGHTS_ROLE)
    store.remove_objects([obj for obj in objects if obj[store.MODEL] not in but])
    store.remove_collection(scene, COLLECTION, [find_model(name).title for name in but])


def mark(scene: bpy.types.Scene, model: str, text: str) -> None:
    """Remember with a model's flights what they were computed from."""
    for obj in store.with_role(scene, store.MODEL_FLIGHTS_ROLE):
        if obj[store.MODEL] == model:
            obj[store.PRINT] = text


def marks(scene: bpy.types.Scene) -> dict[str, str]:
    """Model → what its flights were computed from, where that is remembered."""
    curves = store.with_role(scene, store.MODEL_FLIGHTS_ROLE)
    return {obj[store.MODEL]: obj[store.PRINT] for obj in curves if store.PRINT in obj}


def _name_of(obj: bpy.types.Object) -> tuple[str, str, int]:
    return obj[store.MODEL], obj[store.TRAJECTORY], int(obj.get(store.LANE, 0))


def _begins(predicted: PredictedFlights, offsets: Mapping[str, float]) -> Array:
    """(n,) when the flights begin in the scene [s]."""
    return predicted.time_s - np.array([offsets[name] for name in predicted.trajectory.tolist()], dtype=np.float64)


def _by_trajectory(predicted: PredictedFlights, which: Indices) -> dict[str, Indices]:
    """Trajectory → its flights among `which`."""
    found: dict[str, list[int]] = {}
    for place, name in zip(which.tolist(), predicted.trajectory[which].tolist(), strict=True):
        found.setdefault(name, []).append(place)
    return {name: np.array(places, dtype=np.intp) for name, places in found.items()}


def _show_flights(
    scene: bpy.types.Scene,
    model: str,
    predicted: PredictedFlights,
    which: Indices,
    begin_s: Array,
    obj: bpy.types.Object | None,
) -> None:
    if not which.size:
        store.remove_objects([obj] if obj is not None else [])
        return
    count, clock = trails.parts(predicted.duration_s[which], trails.SAMPLE_STEP_S)
    flight = np.repeat(which, count)
    position, velocity = predicted.launches.states(flight, clock)
    lines = trails.Lines(count, begin_s[flight] + clock, position, norm(velocity))
    new = obj is None
    obj = trails.trail(f"{model} flights", store.MODEL_FLIGHTS_ROLE, lines, obj=obj)
    trails.paint(obj.data, np.array(find_model(model).colour))
    obj.pop(store.PRINT, None)
    if new:
        obj[store.MODEL] = model
        _link(scene, obj, model)
        trails.set_trail(scene.rockfall, obj)


def _new_block(scene: bpy.types.Scene, model: str, trajectory: str, number: int) -> bpy.types.Object:
    obj = bpy.data.objects.new(
        f"{trajectory} {model}{f' {number + 1}' if number else ''}",
        trajectories.block_mesh(f"Rockfall twin {model}", find_model(model).colour),
    )
    obj[store.ROLE], obj[store.MODEL], obj[store.TRAJECTORY] = store.MODEL_BLOCK_ROLE, model, trajectory
    obj[store.LANE] = number
    _link(scene, obj, model)
    return obj


def _key_block(
    obj: bpy.types.Object, real: bpy.types.Object, keys: keyframes.Keys, begin_s: Array, duration_s: Array, rate: float
) -> None:
    """Let a block fly flights that follow each other without overlap."""
    if obj.scale != real.scale or obj.delta_location != real.delta_location:
        obj.scale, obj.delta_location = real.scale, real.delta_location
    keyframes.write_location_keys(obj, keys, rate)
    ends = begin_s + duration_s + LINGER_S
    ends[:-1] = np.minimum(ends[:-1], begin_s[1:])
    keyframes.write_visibility_keys(obj, list(zip(begin_s.tolist(), ends.tolist(), strict=True)), rate)


def _keys(predicted: PredictedFlights, lanes: list[Indices], begin_s: Array) -> list[keyframes.Keys]:
    """Keys of each lane: of each flight its ends, which make the parabola; with drag, more of them."""
    if not lanes:
        return []
    which = np.concatenate(lanes)
    dragged = predicted.launches.drag_per_m[which] > 0
    count, clock = trails.parts(predicted.duration_s[which], np.where(dragged, keyframes.DRAG_KEY_STEP_S, np.inf))
    flight = np.repeat(which, count)
    position, velocity = predicted.launches.states(flight, clock)
    held = np.zeros(flight.size, dtype=np.bool_)
    held[np.cumsum(count) - 1] = True
    cuts = np.cumsum(count)[np.cumsum([lane.size for lane in lanes])[:-1] - 1]
    parts = (np.split(values, cuts) for values in (begin_s[flight] + clock, position, velocity, velocity, held))
    return [keyframes.Keys(*part) for part in zip(*parts, strict=True)]


def _lanes(begin_s: Array, duration_s: Array) -> list[list[int]]:
    """The flights of each block, so that no block flies twice at a time and there are as few blocks as can be."""
    lanes: list[list[int]] = []
    free_at: list[float] = []
    begins, durations = begin_s.tolist(), duration_s.tolist()
    for i in np.argsort(begin_s, kind="stable").tolist():
        lane = next((j for j, free in enumerate(free_at) if free <= begins[i]), len(lanes))
        if lane == len(lanes):
            lanes.append([])
            free_at.append(0.0)
        lanes[lane].append(i)
        free_at[lane] = begins[i] + durations[i]
    return lanes


def _link(scene: bpy.types.Scene, obj: bpy.types.Object, model: str) -> None:
    store.link(store.collection(scene, COLLECTION, find_model(model).title), obj)
