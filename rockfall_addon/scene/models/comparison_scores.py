# SPDX-License-Identifier: GPL-3.0-or-later
"""How near the models come to the scene's impacts: the numbers of `rockfall compare`, kept with the predictions."""

from dataclasses import dataclass
from math import isfinite, nan
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ....core.analysis.columns import passing
from ....core.analysis.comparison import Predictions
from ....core.analysis.scores import ABSCISSA, Score, rmse, scores
from ....core.impact_models.registry import MODELS
from ....core.reconstruction.impact import Impacts
from ....core.vectors import Mask
from . import graph_settings
from .comparison import SceneComparison

Filtered = tuple[str, bytes]
"""A quantity, and which impacts pass the filters; no bytes for all."""

DISTANCES = ("wasserstein", "energy_distance")
"""Measures that are computed only where they are shown: they take as long as a picture may."""

_known: WeakKeyDictionary[Predictions, dict[Filtered, Score]] = WeakKeyDictionary()
_without_distances: WeakKeyDictionary[Predictions, dict[Filtered, Score]] = WeakKeyDictionary()
_errors: WeakKeyDictionary[Predictions, dict[Filtered, float]] = WeakKeyDictionary()


@dataclass(frozen=True)
class Ranked:
    """A model with a set of parameters, and its score."""

    which: str
    model: str
    score: Score

    @property
    def title(self) -> str:
        """The model's name for people."""
        return MODELS[self.model].title


def score_of(impacts: Impacts, predictions: Predictions, quantity: str, kept: Mask | None, *, distances: bool) -> Score:
    """The score of the predictions of one model, of the impacts (n,) that are kept; None for all.

    distances : as in `scores`.
    """
    known = (_known if distances else _without_distances).setdefault(predictions, {})
    key = _key(quantity, kept)
    if key not in known:
        _forget_filtered(known)
        known[key] = scores(impacts, predictions, [quantity], kept, distances=distances)[0]
    return known[key]


def rmse_of(comparison: SceneComparison, which: str, model: str, quantity: str, kept: Mask | None = None) -> float:
    """Root mean square of model − measured, at once; NaN where it is not known, or no score of that quantity.

    kept : (n,) the impacts that count; None for all.
    """
    predictions = comparison.predictions.get(which, {}).get(model)
    if comparison.impacts is None or predictions is None or quantity not in ABSCISSA:
        return nan
    known, key = _errors.setdefault(predictions, {}), _key(quantity, kept)
    if key not in known:
        _forget_filtered(known)
        known[key] = rmse(comparison.impacts, predictions, 0, quantity, kept)
    return known[key]


def kept_of(scene: bpy.types.Scene, comparison: SceneComparison) -> Mask | None:
    """(n,) the scene's own impacts that pass the filters of the graphs; None where all do."""
    filters = graph_settings.filters_of(scene)
    if comparison.impacts is None or not filters:
        return None
    kept = passing(comparison.impacts, filters)
    return None if kept.all() else kept


def ranking(scene: bpy.types.Scene, comparison: SceneComparison, kept: Mask | None = None) -> list[Ranked]:
    """The shown models, best first, by the scene's choice of quantity and measure; without a score last.

    kept : (n,) the impacts that count; None for all.
    """
    settings = scene.rockfall_comparison
    impacts = comparison.impacts
    if impacts is None:
        return []
    distances = settings.measure in DISTANCES
    rows = [
        Ranked(which, model, score_of(impacts, predictions, settings.quantity, kept, distances=distances))
        for which, of_model in comparison.predictions.items()
        for model, predictions in of_model.items()
        if predictions.row.size
    ]

    def size(row: Ranked) -> float:
        value = abs(float(getattr(row.score, settings.measure)))
        return value if isfinite(value) else float("inf")

    return sorted(rows, key=size)


def _key(quantity: str, kept: Mask | None) -> Filtered:
    return quantity, b"" if kept is None else np.packbits(kept).tobytes()


def _forget_filtered(known: dict[Filtered, Score] | dict[Filtered, float]) -> None:
    """Of filters that have been, no score is kept: a limit that is dragged makes many."""
    for key in [key for key in known if key[1]]:
        del known[key]
