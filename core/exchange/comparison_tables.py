# SPDX-License-Identifier: GPL-3.0-or-later
"""predictions.csv, scores.csv, and comparison.toml with what they were computed with."""

from dataclasses import astuple, fields
from math import prod
from pathlib import Path

import numpy as np
import tomli_w

from ..analysis.comparison import Predictions
from ..analysis.scores import Score
from ..errors import InputError
from ..formats.csv_cells import CellWriter
from ..output import output_stream, write_text
from ..reading import reader
from ..reconstruction.impact import RUN, Impacts
from ..vectors import Array
from .csv_text import TextTable, read_table
from .tables import Columns, vector_columns, write_tables

V2 = ("v2x_mps", "v2y_mps", "v2z_mps")
OMEGA2 = ("omega2x_radps", "omega2y_radps", "omega2z_radps")
SCALARS = ("vn2_mps", "vt2_mps", "rn", "rt", "r", "theta_dev_deg")
PREDICTIONS_COLUMNS = ("model", "replicate", "trajectory", "impact", *V2, *OMEGA2, *SCALARS, "flags")
"""The columns of predictions.csv; a table of several sites has one more, site, one of simulated impacts `RUN`."""
INTO_GROUND = "into_ground"


def write_predictions(predictions: Predictions, path: str | Path) -> None:
    """Write predictions.csv, model by model and run by run."""
    last: Columns = {"site": predictions.site} if np.unique(predictions.site).size > 1 else {}
    last |= predictions.runs
    models, runs = range(len(predictions.models)), range(1 + predictions.replicates)
    write_tables(path, (_columns(predictions, i, run) | last for i in models for run in runs))


@reader("table of predictions")
def read_predictions(path: str | Path, impacts: Impacts) -> Predictions:
    """Read predictions.csv, of these impacts.

    Raises
    ------
    InputError : anything that is wrong with the table; a row that belongs to no impact; a model that has not the same
        runs and impacts as the first.
    """
    table = read_table(path, PREDICTIONS_COLUMNS[:4] + V2, (*PREDICTIONS_COLUMNS, "site", *RUN))
    where = _rows_of_impacts(table, impacts)
    names, replicate = table.text("model"), table.numbers("replicate", required=True).astype(np.intp)
    models = tuple(dict.fromkeys(names))
    place = {name: i for i, name in enumerate(models)}
    model = np.array([place[name] for name in names], dtype=np.intp)
    rows = where[(model == 0) & (replicate == 0)]
    shape = (len(models), int(replicate.max()) + 1, rows.size)
    order = np.lexsort((_rank(where, rows), replicate, model))
    found = np.stack([model, replicate, _rank(where, rows)])[:, order]
    if len(table) != prod(shape) or not np.array_equal(found, [index.ravel() for index in np.indices(shape)]):
        raise InputError(
            f"The {len(table)} rows are not {shape[0]} models with runs 0…{shape[1] - 1} of {shape[2]} impacts",
            file=path,
            advice="Every model must have the same runs and impacts, each once",
        )

    def of(values: Array) -> Array:
        return values[order].reshape(*shape, *values.shape[1:])

    flags = np.array([INTO_GROUND in cell.split(";") for cell in table.text("flags")], dtype=np.bool_)
    v2 = of(table.vectors(V2))
    return Predictions(
        models=models,
        row=rows,
        site=impacts.site[rows],
        trajectory=impacts.trajectory[rows],
        impact=impacts.impact[rows],
        v2=v2,
        omega2=of(table.vectors(OMEGA2)),
        omega1=np.full(v2.shape, np.nan),
        into_ground=flags[order].reshape(shape),
        vn2=of(table.numbers("vn2_mps")),
        vt2=of(table.numbers("vt2_mps")),
        rn=of(table.numbers("rn")),
        rt=of(table.numbers("rt")),
        r=of(table.numbers("r")),
        theta_dev=np.radians(of(table.numbers("theta_dev_deg"))),
        runs={name: column[rows] for name, column in impacts.runs.items()},
    )


def write_scores(scores: tuple[Score, ...], path: str | Path) -> None:
    """Write scores.csv."""
    with output_stream(path) as stream:
        writer = CellWriter(stream)
        writer.writerow(field.name for field in fields(Score))
        for score in scores:
            writer.writerow("" if value != value else value for value in astuple(score))


def write_settings(predictions: Predictions, path: str | Path) -> None:
    """Write comparison.toml: the seed, the spin and all parameters of all models."""
    models = {name: dict(settings) for name, settings in predictions.settings.items()}
    content = {
        "seed": predictions.seed,
        "replicates": predictions.replicates,
        "spin": predictions.spin,
        "impacts": int(predictions.row.size),
        "models": models,
    }
    write_text(path, tomli_w.dumps(content))


def _columns(predictions: Predictions, i: int, run: int) -> Columns:
    """The rows of one model and run."""
    n = predictions.row.size
    return {
        "model": np.broadcast_to(np.array(predictions.models[i]), n),
        "replicate": np.broadcast_to(np.array(run), n),
        "trajectory": predictions.trajectory,
        "impact": predictions.impact,
        **vector_columns(V2, predictions.v2[i, run]),
        **vector_columns(OMEGA2, predictions.omega2[i, run]),
        **{name: getattr(predictions, name.removesuffix("_mps"))[i, run] for name in SCALARS[:-1]},
        SCALARS[-1]: np.degrees(predictions.theta_dev[i, run]),
        "flags": np.where(predictions.into_ground[i, run], INTO_GROUND, ""),
    }


def _rows_of_impacts(table: TextTable, impacts: Impacts) -> np.ndarray:
    """(n,) row of the impact that each row of the table belongs to."""
    last = {name: column for name, column in ({"site": impacts.site} | impacts.runs).items() if name in table.columns}
    keys = zip(*(one.tolist() for one in (impacts.impact, impacts.trajectory, *last.values())), strict=True)
    known = {key: i for i, key in enumerate(keys)}
    numbers = table.numbers("impact", required=True)
    where = np.empty(len(table), dtype=np.intp)
    for i, names in enumerate(zip(*map(table.text, ("trajectory", *last)), strict=True)):
        key = (int(numbers[i]), *names)
        if key not in known:
            raise table.error(i, f"There is no impact {key[0]} in the table of impacts", "Give the impacts they are of")
        where[i] = known[key]
    return where


def _rank(where: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """(n,) place of each row among `rows`; −1 where it is not there."""
    place = np.full(int(where.max()) + 1, -1, dtype=np.intp)
    place[rows] = np.arange(rows.size)
    return place[where]
