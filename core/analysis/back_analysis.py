# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a back-analysis."""

from dataclasses import dataclass

from ..remarks import Remark
from ..simulation.engine import Settings
from ..simulation.parameter_draws import ParameterDraws
from ..vectors import Array
from .completeness import Completeness, IfLongest, ShortRuns
from .held_out import Prediction
from .posterior_checks import PosteriorEstimate, PredictiveCheck
from .priors import Prior
from .run_statistics import ObservedValues


@dataclass(frozen=True, eq=False)
class BackAnalysis:
    """What observed runs say of the parameters of a model.

    Attributes
    ----------
    model : its name. settings : those that were not fitted.
    priors : k parameters.
    observed : what was read off the runs.
    draws : the posterior, for `Settings`.
    correlation : (k, k) of the draws.
    estimates : one for each parameter. checks : one for each quantity.
    prediction : of runs that were held out.
    predicted : (S, n, Q) values of data sets simulated with draws of the posterior.
    effective : draws of equal weight that say as much.
    runs : how many were simulated. seconds : how long it took.
    completeness : what is stated of the observed runs. falls : how many blocks fell with each set of parameters.
    short_runs : whether the observed runs look as if short ones were missing; None where that cannot be told.
    if_longest : the parameters if they were the longest part of the falls; None where all is stated or nothing known.
    remarks : what it is worth, the gravest first.
    """

    model: str
    settings: Settings
    priors: tuple[Prior, ...]
    observed: ObservedValues
    draws: ParameterDraws
    correlation: Array
    estimates: tuple[PosteriorEstimate, ...]
    checks: tuple[PredictiveCheck, ...]
    prediction: Prediction
    predicted: Array
    effective: float
    runs: int
    seconds: float
    completeness: Completeness
    falls: int
    short_runs: ShortRuns | None
    if_longest: IfLongest | None
    remarks: tuple[Remark, ...]
