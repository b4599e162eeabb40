# SPDX-License-Identifier: GPL-3.0-or-later
"""What a calibration has found, until it is applied or discarded: meanwhile the second set of parameters shows it.

The proposal is stored with the scene, so an undo takes it back, and a file keeps it. It knows what it was computed from
and says so when that has changed.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite

import bpy

from ....core.analysis.calibration import Calibration, usual_names
from ....core.analysis.equivalence import Equivalence
from ....core.analysis.estimation import FitOptions, FittedModel
from ....core.errors import RockfallError
from ....core.exchange.selection import joined
from ....core.impact_models.machinery.parameters import Value
from ....core.impact_models.registry import MODELS, find_model
from ....core.reconstruction.impact import Impacts
from ....core.remarks import Remark, from_plain, to_plain
from ..storage import databases, store
from . import comparison, model_parameters, models


@dataclass(frozen=True)
class Fitted:
    """One fitted parameter of a proposal: its value in set A, the proposed one, its 95 % interval as text."""

    name: str
    before: Value
    after: Value
    interval: str
    remarks: tuple[Remark, ...]


@dataclass(frozen=True)
class Proposal:
    """What is proposed.

    Attributes
    ----------
    model : whose parameters.
    imitated : model that they make it like; empty for a calibration.
    rows : the fitted parameters.
    impacts, trajectories : that it was fitted to.
    scores : sentence with the scores before and after.
    remarks : what it is worth.
    stale : why it may not be right any more; empty when nothing has changed.
    """

    model: str
    imitated: str
    rows: tuple[Fitted, ...]
    impacts: int
    trajectories: int
    scores: str
    remarks: tuple[Remark, ...]
    stale: str


@dataclass(frozen=True, eq=False)
class Question:
    """What a fit needs, without Blender.

    Attributes
    ----------
    impacts : that it is fitted to.
    model : whose parameters.
    names : of those that are fitted.
    fixed : the others that do not have their default.
    options : of the fit.
    print : fingerprint of all that.
    imitated, like : another model that it is to imitate, and its parameters; empty for a calibration.
    """

    impacts: Impacts
    model: str
    names: tuple[str, ...]
    fixed: dict[str, Value]
    options: FitOptions
    print: str
    imitated: str = ""
    like: Mapping[str, Value] = field(default_factory=dict)


def fitted_names(scene: bpy.types.Scene, model: str) -> tuple[str, ...]:
    """The parameters of a model that are to be fitted, in the order of its table."""
    words = scene.rockfall_comparison.fitted_names.split()
    chosen = [word.partition(".")[2] for word in words if word.partition(".")[0] == model]
    known = find_model(model)
    return tuple(spec.name for spec in known.parameters if spec.name in chosen) or usual_names(known)


def toggle(scene: bpy.types.Scene, model: str, name: str) -> None:
    """Fit a parameter, or leave it; the last one stays."""
    settings = scene.rockfall_comparison
    names = set(fitted_names(scene, model)) ^ {name}
    others = [word for word in settings.fitted_names.split() if word.partition(".")[0] != model]
    if names:
        settings.fitted_names = " ".join([*others, *(f"{model}.{each}" for each in sorted(names))])


def ask(scene: bpy.types.Scene, *, like: bool = False) -> Question:
    """What is to be fitted, as the scene has it now: to the impacts, or to the model that is to be imitated.

    Raises
    ------
    RockfallError : there are no impacts, or the model is to imitate itself.
    """
    settings = scene.rockfall_comparison
    model, imitated = settings.fitted, settings.imitated if like else ""
    if model == imitated:
        raise RockfallError(f"{MODELS[model].title} is like itself: choose another model to imitate.")
    tables = [comparison.measured_of(scene).impacts]
    if settings.fit_with_others:
        tables += [one.impacts for one in databases.of_scene(scene)]
    tables = [table for table in tables if table is not None]
    if not tables:
        raise RockfallError("There are no impacts to fit to: pick some first.")
    names = fitted_names(scene, model)
    fixed = {name: value for name, value in _own(scene, model).items() if name not in names}
    options = FitOptions(seed=settings.seed, spin=settings.spin)
    impacts = tables[0] if len(tables) == 1 else joined(tables)
    return Question(
        impacts, model, names, fixed, options, _print(scene, model, imitated, names), imitated, _own(scene, imitated)
    )


def keep(scene: bpy.types.Scene, question: Question, result: FittedModel) -> None:
    """Store a result as a proposal, and show it as the second set beside the first."""
    settings = scene.rockfall_comparison
    discard(scene)
    now = MODELS[question.model].settings(_own(scene, question.model))
    rows = [
        [one.name, now[one.name], one.value, _interval(one.low, one.high), to_plain(one.remarks)]
        for one in result.estimates
    ]
    imitated = question.imitated
    scene[store.FIT] = json.dumps(
        {
            "model": question.model,
            "imitated": imitated,
            "rows": rows,
            "values": {name: result.settings[name] for name in question.names},
            "impacts": result.impacts,
            "trajectories": result.trajectories,
            "scores": _scores(result),
            "remarks": to_plain(result.remarks),
            "names": question.names,
            "print": question.print,
            "set_b": models.parameters_of(scene, "B"),
            "sets": settings.sets,
            "models": sorted(settings.models),
        }
    )
    own = {**question.fixed, **{name: result.settings[name] for name in question.names}}
    parameters = models.parameters_of(scene)
    model_parameters.keep_all(scene, {**parameters, question.model: own}, "B")
    settings.sets = "BOTH"
    settings.models = set(settings.models) | {question.model} | ({imitated} if imitated else set())


def proposal_of(scene: bpy.types.Scene) -> Proposal | None:
    """What is proposed; None without."""
    if store.FIT not in scene:
        return None
    kept = store.read_json(scene, store.FIT, {})
    stale = ""
    if kept["print"] != _print(scene, kept["model"], kept["imitated"], kept["names"]):
        stale = "Impacts or other parameters have changed since: it may not be right any more. Fit again."
    return Proposal(
        kept["model"],
        kept["imitated"],
        tuple(
            Fitted(name, before, after, interval, tuple(from_plain(remarks, "note")))
            for name, before, after, interval, remarks in kept["rows"]
        ),
        kept["impacts"],
        kept["trajectories"],
        kept["scores"],
        tuple(from_plain(kept["remarks"], "note")),
        stale,
    )


def apply(scene: bpy.types.Scene) -> None:
    """Make the proposed values those of the scene; the second set is again what it was before."""
    kept = store.read_json(scene, store.FIT, {})
    _restore(scene, kept)
    model_parameters.keep(scene, kept["model"], kept["values"])


def discard(scene: bpy.types.Scene) -> None:
    """Forget the proposal, if there is one; the second set is again what it was before."""
    if store.FIT in scene:
        _restore(scene, store.read_json(scene, store.FIT, {}))


def second_set(scene: bpy.types.Scene) -> dict[str, dict[str, Value]]:
    """The second set of parameters, without what is merely proposed."""
    return store.read_json(scene, store.FIT, {})["set_b"] if store.FIT in scene else models.parameters_of(scene, "B")


def forget(scene: bpy.types.Scene) -> None:
    """Another project is shown: a proposal of the last one has nothing to restore."""
    scene.pop(store.FIT, None)


def _restore(scene: bpy.types.Scene, kept: dict) -> None:
    settings = scene.rockfall_comparison
    model_parameters.keep_all(scene, kept["set_b"], "B")
    settings.sets, settings.models = kept["sets"], set(kept["models"])
    del scene[store.FIT]


def _own(scene: bpy.types.Scene, model: str) -> dict[str, Value]:
    return models.parameters_of(scene).get(model, {})


def _print(scene: bpy.types.Scene, model: str, imitated: str, names: Sequence[str]) -> str:
    """Of what a fit depends on: the impacts, and the parameters of the model that are not fitted."""
    fixed = {name: value for name, value in _own(scene, model).items() if name not in names}
    others = [row.digest for row in scene.rockfall_comparison.databases if row.shown]
    with_others = scene.rockfall_comparison.fit_with_others and others
    text = repr(
        (comparison.measured_key(scene), sorted(fixed.items()), sorted(_own(scene, imitated).items()), with_others)
    )
    return hashlib.sha1(text.encode(), usedforsecurity=False).hexdigest()


def _interval(low: float, high: float) -> str:
    return f"{low:.4g} … {high:.4g}" if isfinite(low) else ""


def _scores(result: FittedModel) -> str:
    if isinstance(result, Calibration):
        held = f", {result.held_out_score:.3f} on trajectories held out" if result.folds else ""
        return f"Score (0 is perfect): {result.default_score:.3f} with defaults, {result.fitted_score:.3f} fitted{held}"
    if isinstance(result, Equivalence):
        return f"Energy distance (0 is the same): {result.default_distance:.3f} before, {result.distance:.3f} fitted"
    raise TypeError(f"{type(result).__name__} has no scores")
