# SPDX-License-Identifier: GPL-3.0-or-later
"""How near the models come to the scene's impacts: the numbers of `rockfall compare`, kept with the predictions."""

from dataclasses import dataclass
from math import isfinite, nan
from weakref import WeakKeyDictionary

import bpy

from ...core.analysis.comparison import Predictions
from ...core.analysis.scores import ABSCISSA, Score, rmse, scores
from ...core.impact_models.registry import MODELS
from ...core.reconstruction.impact import Impacts
from .comparison import SceneComparison

_known: WeakKeyDictionary[Predictions, dict[str, Score]] = WeakKeyDictionary()
_errors: WeakKeyDictionary[Predictions, dict[str, float]] = WeakKeyDictionary()


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


def score_of(impacts: Impacts, predictions: Predictions, quantity: str) -> Score:
    """The score of the predictions of one model."""
    known = _known.setdefault(predictions, {})
    if quantity not in known:
        known[quantity] = scores(impacts, predictions, [quantity])[0]
    return known[quantity]


def rmse_of(comparison: SceneComparison, which: str, model: str, quantity: str) -> float:
    """Root mean square of model − measured, at once; NaN where it is not known, or no score of that quantity."""
    predictions = comparison.predictions.get(which, {}).get(model)
    if comparison.impacts is None or predictions is None or quantity not in ABSCISSA:
        return nan
    known = _errors.setdefault(predictions, {})
    if quantity not in known:
        known[quantity] = rmse(comparison.impacts, predictions, 0, quantity)
    return known[quantity]


def ranking(scene: bpy.types.Scene, comparison: SceneComparison) -> list[Ranked]:
    """The shown models, best first, by the scene's choice of quantity and measure; without a score last."""
    settings = scene.rockfall_comparison
    impacts = comparison.impacts
    if impacts is None:
        return []
    rows = [
        Ranked(which, model, score_of(impacts, predictions, settings.quantity))
        for which, of_model in comparison.predictions.items()
        for model, predictions in of_model.items()
    ]

    def size(row: Ranked) -> float:
        value = abs(float(getattr(row.score, settings.measure)))
        return value if isfinite(value) else float("inf")

    return sorted(rows, key=size)
