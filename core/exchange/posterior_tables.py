# SPDX-License-Identifier: GPL-3.0-or-later
"""posterior.csv and back_analysis.json: what observed runs say of the parameters of a model."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ..analysis.back_analysis import BackAnalysis
from ..analysis.posterior_checks import doubts_of
from ..errors import InputError
from ..impact_models.registry import find_model
from ..output import write_text
from ..reading import reader
from ..remarks import from_plain, to_plain
from ..simulation.parameter_draws import ParameterDraws, check_draws
from .csv_text import read_table
from .simulation_tables import inputs_with_digests
from .tables import write_columns

MODEL, WEIGHT = "model", "weight"


def write_posterior(model: str, draws: ParameterDraws, path: str | Path) -> None:
    """Write posterior.csv: one draw a row, with its weight; the columns behind it are the parameters."""
    columns = {name: draws.values[:, i] for i, name in enumerate(draws.names)}
    write_columns(path, {MODEL: [model] * len(draws), WEIGHT: draws.weight, **columns})


@reader("table of a posterior")
def read_posterior(path: str | Path) -> tuple[str, ParameterDraws]:
    """The model, and what its blocks draw their parameters from.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row; a parameter that the model does not have; several
        models; weights that are no weights.

    Notes
    -----
    What was thought possible before, and what speaks against it, stand in the back_analysis.json beside the table,
    where that is of the same model.
    """
    table = read_table(path, (MODEL,), (MODEL, WEIGHT))
    names = [name for name in table.columns if name not in (MODEL, WEIGHT)]
    models = table.text(MODEL)
    for i, name in enumerate(models):
        if name != models[0]:
            raise table.error(
                i, f"The row is of {name!r}, those before it of {models[0]!r}", "Give each model a table of its own"
            )
    model = find_model(models[0])
    if not names:
        raise InputError("The table has no parameter", advice=f"Add a column for one of {model.name}, or friction")
    values = np.column_stack([table.numbers(name, required=True) for name in names])
    weight = table.numbers(WEIGHT, required=True) if WEIGHT in table.columns else np.ones(len(table))
    wrong = np.flatnonzero(~(weight >= 0))
    if wrong.size:
        raise table.error(int(wrong[0]), f"The weight is {weight[wrong[0]]:g}", "Give zero or more")
    before, doubts = _said(Path(path), model.name, names)
    draws = ParameterDraws(tuple(names), values, weight, before=before, doubts=doubts)
    check_draws(draws, model)
    return model.name, draws


def _said(table: Path, model: str, names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What was thought possible of each, and what speaks against the back-analysis; none where it is not known."""
    try:
        said = json.loads((table.parent / "back_analysis.json").read_text(encoding="utf-8"))
        found = {one["name"]: f"{one['prior']}: {one['left']}" for one in said["estimates"]}
        before = tuple(found[name] for name in names)
        return (before, doubts_of(from_plain(said["remarks"]))) if said["model"] == model else ((), ())
    except (OSError, ValueError, KeyError, TypeError):  # of a back-analysis of another kind, or of none
        return (), ()


def posteriors_of(files: Sequence[Path], models: Sequence[str]) -> dict[str, ParameterDraws]:
    """What the blocks of each model draw their parameters from, by model.

    Raises
    ------
    InputError : see `read_posterior`; a posterior of a model that is not among them, or two of one.
    """
    found: dict[str, ParameterDraws] = {}
    for file in files:
        model, draws = read_posterior(file)
        if model not in models:
            raise InputError(
                f"The posterior is of {model}, which is not simulated", file=file, advice=f"Simulate with {model}"
            )
        if model in found:
            raise InputError(f"There are two posteriors of {model}", file=file, advice="Leave out one of them")
        found[model] = draws
    return found


def back_analysis_content(analysis: BackAnalysis, inputs: dict[str, Path]) -> dict[str, Any]:
    """What back_analysis.json says: inputs with their hashes, intervals, checks, runs held out, and the verdict."""
    settings = analysis.settings
    names = [one.name for one in analysis.estimates]
    return {
        "version": str(import_module((__package__ or "").partition(".core")[0]).__version__),
        "inputs": inputs_with_digests(inputs),
        "model": analysis.model,
        "parameters_set": dict(settings.parameters),
        "friction_set": None if "friction" in names else settings.friction,
        "rolling": settings.rolling,
        "drag": settings.drag is not None,
        "gravity_mps2": settings.gravity_mps2,
        "seed": settings.seed,
        "observed_runs": analysis.observed.names.tolist(),
        "completeness": analysis.completeness.text or "not stated",
        "falls": analysis.falls,
        "short_runs": None if analysis.short_runs is None else _plain(asdict(analysis.short_runs)),
        "if_only_the_longest_were_observed": None if analysis.if_longest is None else asdict(analysis.if_longest),
        "simulated_runs": analysis.runs,
        "seconds": round(analysis.seconds, 1),
        "draws": len(analysis.draws),
        "effective_draws": round(analysis.effective, 1),
        "estimates": [
            _plain({**asdict(one), "left": one.left, "remarks": to_plain(one.remarks), "verdict": one.verdict})
            for one in analysis.estimates
        ],
        "correlation": {
            name: dict(zip(names, (round(value, 4) for value in row), strict=True))
            for name, row in zip(names, analysis.correlation.tolist(), strict=True)
        },
        "predictive": [_plain({**asdict(one), "fits": one.fits}) for one in analysis.checks],
        "held_out": [_plain(asdict(fold)) for fold in analysis.prediction.folds],
        "held_out_quantities": [_plain({**asdict(one), "helps": one.helps}) for one in analysis.prediction.quantities],
        "better_than_observed_alone": _plain(
            {
                "gain": analysis.prediction.gain,
                "error": analysis.prediction.error,
                "is_clear": analysis.prediction.is_clear,
            }
        ),
        "remarks": to_plain(analysis.remarks),
    }


def write_back_analysis(content: dict[str, Any], path: str | Path) -> None:
    """Write back_analysis.json."""
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    """For JSON, which has no NaN; six digits."""
    return {name: _number(value) if isinstance(value, float) else value for name, value in values.items()}


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if isfinite(value) else None
