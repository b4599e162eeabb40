# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's impacts beside what the models make of them, as the graphs, the scores and the blocks show them.

Computed when asked for, from what the scene stores, so it is right after an undo, too. Kept until something of that
changes, and only what depends on the change is computed again: for a slider, one model with the same draws.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import count

import bpy

from ....core.analysis.comparison import Predictions, predict, random_numbers
from ....core.analysis.courses import Courses, find_courses
from ....core.errors import RockfallError
from ....core.impact_models.registry import MODELS
from ....core.reconstruction.impact import Impacts
from ....core.vectors import Array
from .. import problems
from ..footage import timing
from ..picks import own_impacts, picks, preparation, reconstruction
from ..storage import databases, store
from ..storage.databases import OtherSites
from . import model_blocks, models


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured in the scene.

    Attributes
    ----------
    impacts : n rows; None without a reconstructed trajectory.
    pick : (n,) id of the pick of each row, see `picks.with_id`.
    courses : the impacts that models can be asked about; None without one.
    problems : sentences about what is missing.
    """

    impacts: Impacts | None = None
    pick: tuple[str, ...] = ()
    courses: Courses | None = None
    problems: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SceneComparison:
    """What the graphs show.

    Attributes
    ----------
    version : another one whenever anything in here is another.
    measured : the scene's own impacts.
    models : names of the chosen models, in the order of lists.
    predictions : set of parameters that is shown ("A", "B") → model → its predictions, each of that model alone
        (place 0 on their first axis); a model that cannot be asked is not among them. One that did not change is the
        same object as before.
    runs : which runs of a model's predictions are its points: 0 is the mean.
    others : tables of other sites.
    in_view : models whose blocks are in the 3-D view.
    problems : sentences about what is not shown, and why.
    waiting : chosen models that are still being prepared in the background; they are not among the predictions.
    """

    version: int
    measured: Measured
    models: tuple[str, ...]
    predictions: Mapping[str, Mapping[str, Predictions]]
    runs: tuple[int, ...]
    others: tuple[OtherSites, ...]
    in_view: tuple[str, ...]
    problems: tuple[str, ...]
    waiting: tuple[str, ...] = ()

    @property
    def impacts(self) -> Impacts | None:
        """The scene's own impacts; None without a reconstructed trajectory."""
        return self.measured.impacts

    @property
    def pick(self) -> tuple[str, ...]:
        """(n,) id of the pick of each row of `impacts`."""
        return self.measured.pick


@dataclass(eq=False)
class _Kept:
    """What was found for a scene, and what for."""

    key: object = None
    found: SceneComparison | None = None
    measured_key: object = None
    measured: Measured = field(default_factory=Measured)
    draws: dict[tuple[str, int, int], Array] = field(default_factory=dict)
    predictions: dict[tuple[str, int, int, str], Predictions] = field(default_factory=dict)


MOST_AT_ONCE = 1000
"""The blocks of more impacts do not follow a slider move by move."""
REST_S = 0.3
"""How long a parameter must rest for them to follow."""

_kept: dict[int, _Kept] = {}  # session_uid of a scene
_versions = count(1)


def comparison_of(scene: bpy.types.Scene) -> SceneComparison:
    """The comparison of a scene as it is now."""
    kept, settings = _of(scene), scene.rockfall_comparison
    others = databases.of_scene(scene)
    chosen = tuple(name for name in models.ORDER if name in settings.models)
    sets = tuple(models.PARAMETER_SETS) if settings.sets == "BOTH" else (settings.sets,)
    texts = tuple(scene.get(key, "{}") for key in models.PARAMETER_SETS.values())
    measured, in_view = measured_of(scene), models.shown_models(scene)
    waiting = preparation.pending(chosen)
    key = (measured, chosen, sets, settings.points, settings.replicates, settings.seed, texts, others, in_view, waiting)
    if kept.found is None or kept.key != key:
        problems = [*measured.problems, *(one.problem for one in others if one.problem)]
        ready = tuple(name for name in chosen if name not in waiting)
        predictions = _predictions(scene, kept, measured, ready, sets, problems)
        runs = {"MEAN": (0,), "DRAW": (1,), "ALL": tuple(range(1, 1 + settings.replicates))}[settings.points]
        kept.found = SceneComparison(
            version=next(_versions),
            measured=measured,
            models=chosen,
            predictions=predictions,
            runs=runs if settings.replicates else (0,),
            others=others,
            in_view=in_view,
            problems=tuple(dict.fromkeys(problems)),
            waiting=waiting,
        )
        kept.key = key
    return kept.found


def measured_of(scene: bpy.types.Scene) -> Measured:
    """The scene's own impacts as they are now."""
    kept, key = _of(scene), measured_key(scene)
    if kept.measured_key != key:
        kept.measured, kept.measured_key = _measure(scene), key
        kept.draws.clear()
        kept.predictions.clear()
    return kept.measured


def predictions_of(scene: bpy.types.Scene, model: str, which: str = "A") -> Predictions | None:
    """What a model makes of the scene's impacts with a set of parameters, with the graphs' replicates and seed.

    Raises
    ------
    RockfallError : a parameter that cannot be, too few impacts to draw from.
    """
    kept, measured, settings = _of(scene), measured_of(scene), scene.rockfall_comparison
    impacts, courses = measured.impacts, measured.courses
    if impacts is None or courses is None:
        return None
    replicates, seed = settings.replicates, settings.seed
    given = models.parameters_of(scene, which).get(model, {})
    key = model, replicates, seed, json.dumps(given, sort_keys=True)
    if key not in kept.predictions:
        drawn = model, replicates, seed
        if drawn not in kept.draws:
            for other in [one for one in kept.draws if one[0] == model]:
                del kept.draws[other]
            kept.draws[drawn] = random_numbers(MODELS[model], courses, impacts, replicates, seed)
        draws = {model: kept.draws[drawn]}
        for other in [one for one in kept.predictions if one[0] == model and not _is_used(scene, one)]:
            del kept.predictions[other]
        kept.predictions[key] = predict(
            impacts, courses, [model], {model: given}, replicates=replicates, seed=seed, draws=draws
        )
    return kept.predictions[key]


def follow_parameters(scene: bpy.types.Scene, model: str) -> None:
    """Bring the blocks of a model, if it has any in the 3-D view, in line with its parameters.

    Those of many impacts follow as soon as the parameter rests: to move them takes longer than a picture should.

    Raises
    ------
    RockfallError : as `predictions_of`, and without a terrain.
    """
    measured = measured_of(scene)
    if model not in models.shown_models(scene) or measured.impacts is None or measured.problems:
        return
    if len(measured.impacts) > MOST_AT_ONCE and not bpy.app.background:
        if bpy.app.timers.is_registered(follow_later):
            bpy.app.timers.unregister(follow_later)
        model_blocks.mark(scene, model, "")
        bpy.app.timers.register(follow_later, first_interval=REST_S)
        return
    _move_blocks(scene, model, measured.impacts)


def catch_up(scene: bpy.types.Scene) -> None:
    """Bring the blocks in line that were moved for other parameters than the scene has now, as after an undo."""
    if not store.is_own(scene):
        return
    measured = measured_of(scene)
    if measured.impacts is None or measured.problems:
        return
    for model, text in model_blocks.marks(scene).items():
        if text != _print(scene, model):
            _move_blocks(scene, model, measured.impacts)


@problems.guarded
def follow_later() -> None:
    """Move the blocks that waited for a parameter to rest; a timer calls it."""
    for scene in bpy.data.scenes:
        catch_up(scene)


def _move_blocks(scene: bpy.types.Scene, model: str, impacts: Impacts) -> None:
    predictions = predictions_of(scene, model)
    if predictions is not None:
        flights = models.fly(scene, impacts, predictions, *reconstruction.forces_of(scene), beside=False)
        model_blocks.show(scene, flights, timing.kept_offsets(scene), keep_blocks=True)
        model_blocks.mark(scene, model, _print(scene, model))


def _print(scene: bpy.types.Scene, model: str) -> str:
    """Of what a model's blocks are computed from."""
    text = repr((measured_key(scene), sorted(models.parameters_of(scene).get(model, {}).items())))
    return hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()


def _is_used(scene: bpy.types.Scene, key: tuple[str, int, int, str]) -> bool:
    """Whether one of the sets has these parameters."""
    texts = [
        json.dumps(models.parameters_of(scene, which).get(key[0], {}), sort_keys=True)
        for which in models.PARAMETER_SETS
    ]
    return key[3] in texts


def _predictions(
    scene: bpy.types.Scene,
    kept: _Kept,
    measured: Measured,
    chosen: tuple[str, ...],
    sets: tuple[str, ...],
    problems: list[str],
) -> Mapping[str, Mapping[str, Predictions]]:
    found: dict[str, dict[str, Predictions]] = {which: {} for which in sets}
    for which in sets:
        for model in chosen:
            try:
                predictions = predictions_of(scene, model, which)
            except RockfallError as error:
                problems.append(f"{MODELS[model].title}: {error}")
                continue
            if predictions is not None:
                found[which][model] = predictions
    return found


def _measure(scene: bpy.types.Scene) -> Measured:
    """Of each trajectory that can be reconstructed its impacts."""
    impacts, problems = own_impacts.impacts_of(scene)
    if impacts is None:
        return Measured(problems=problems)
    try:
        courses = find_courses(impacts, scene.rockfall_comparison.spin)
    except RockfallError as error:
        return Measured(impacts, _pick_ids(scene, impacts), None, (*problems, str(error)))
    return Measured(impacts, _pick_ids(scene, impacts), courses, problems)


def _pick_ids(scene: bpy.types.Scene, impacts: Impacts) -> tuple[str, ...]:
    """(n,) the pick of each impact, found by trajectory and time."""
    rate = timing.keyed_rate(scene)
    known = {(o[store.TRAJECTORY], picks.time_of(o, rate)): str(o.get(store.ID, "")) for o in picks.objects_of(scene)}
    places = zip(impacts.trajectory.tolist(), impacts.time_s.tolist(), strict=True)
    return tuple(known.get(place, "") for place in places)


def measured_key(scene: bpy.types.Scene) -> object:
    """All that the scene's impacts depend on: what is shown of the picks, and the settings."""
    return scene.get(store.SHOWN), own_impacts.settings_key(scene), scene.rockfall_comparison.spin


def _of(scene: bpy.types.Scene) -> _Kept:
    if scene.session_uid not in _kept:
        for gone in _kept.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _kept[gone]
        _kept[scene.session_uid] = _Kept()
    return _kept[scene.session_uid]
