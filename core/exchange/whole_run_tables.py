# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of observed and simulated whole runs: sections and stops in; whole_runs.csv and whole_values.csv out."""

from pathlib import Path

import numpy as np

from ..analysis.observed_runs import Observed, observe_stops
from ..analysis.sections import Section
from ..analysis.whole_runs import QUANTILES, Compared, WholeRuns
from ..errors import InputError
from ..reading import reader
from ..simulation.ground import Ground
from ..simulation.release import Releases
from .csv_text import read_table
from .map_shapes import read_lines
from .tables import Columns, write_columns, write_tables

QUANTILE_NAMES = tuple(f"q{round(100 * part):02d}" for part in QUANTILES)


@reader("table of a section")
def read_section(path: str | Path, name: str, ground: Ground) -> Section:
    """Read a line in plan, of a map or of a table of its points in order: see `map_shapes`.

    Raises
    ------
    InputError : anything that is wrong with the file; several lines, a line of less than two points, or beside the
        terrain.
    """
    shapes = read_lines(path, ground.shift)
    if len(shapes) > 1:
        raise InputError(f"There are {len(shapes)} lines, and a section is one", file=path, advice="Give one of them")
    line = shapes[0].parts[0][:, :2]
    apart = np.hypot(*np.diff(line, axis=0).T) > 0
    if not apart.size or not apart.all():
        raise InputError(
            "A section needs two points or more, each at a place of its own", file=path, advice="Correct its points"
        )
    low, high = ground.terrain.bounds
    if (line.max(axis=0) < low[:2]).any() or (line.min(axis=0) > high[:2]).any():
        raise InputError(
            f"The section {name} is beside the terrain", file=path, advice="Give it in the coordinates of the terrain"
        )
    return Section(name, line=line)


@reader("table of stops")
def read_stops(path: str | Path, releases: Releases, ground: Ground) -> Observed:
    """Read where real blocks stopped: release, x_m, y_m and, if not on the terrain, z_m, in survey coordinates.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row; a release that is not among the releases.
    """
    known = ("release", "x_m", "y_m", "z_m")
    table = read_table(path, known[:3], known)
    names = np.array(table.text("release"), dtype=np.str_)
    rows = []
    for i, name in enumerate(names.tolist()):
        found = np.flatnonzero(releases.name == name)
        if not found.size:
            raise table.error(
                i, f"There is no release {name!r}", "Give it in the table of releases, or correct its name"
            )
        rows.append(int(found[0]))
    survey = np.column_stack(
        [table.numbers("x_m", required=True), table.numbers("y_m", required=True), table.numbers("z_m")]
    )
    stop = ground.shift.to_local(np.where(np.isnan(survey), 0.0, survey))
    bare = np.flatnonzero(np.isnan(survey[:, 2]))
    stop[bare, 2] = ground.highest_m
    stop[bare, 2] -= ground.heights_above(stop[bare])
    for i in bare[np.isnan(stop[bare, 2])][:1].tolist():
        raise table.error(
            i, "There is no terrain under this stop", "Correct it, give its z_m, or give a larger terrain"
        )
    start = releases.position[rows]
    start = start - releases.radius_m[rows][:, None] * [0.0, 0.0, 1.0]
    return observe_stops(names, start, stop, releases.mass_kg[rows])


def write_whole_runs(comparison: WholeRuns, path: str | Path) -> None:
    """Write whole_runs.csv: one row per model, section and quantity."""
    rows = comparison.compared
    quantiles = np.stack([one.all_quantiles for one in rows])
    columns: Columns = {
        "model": [one.model for one in rows],
        "section": [one.section for one in rows],
        "quantity": [one.quantity.name for one in rows],
        "observed_n": [str(one.n) for one in rows],
        "observed": np.array([_middle(one) for one in rows]),
        "simulated_n": [str(int(one.count[np.isfinite(one.observed)].sum())) for one in rows],
        **{f"simulated_{name}": quantiles[:, i] for i, name in enumerate(QUANTILE_NAMES)},
        "crps": np.array([one.score for one in rows]),
        "crps_observed_alone": np.array([one.alone for one in rows]),
        "ranked_n": [str(one.test.n) if one.test else "" for one in rows],
        "a2": np.array([one.test.statistic if one.test else np.nan for one in rows]),
        "p": np.array([one.p for one in rows]),
        "p_holm": np.array([one.p_holm for one in rows]),
        "verdict": [one.verdict for one in rows],
    }
    write_columns(path, columns)


def write_whole_values(comparison: WholeRuns, path: str | Path) -> None:
    """Write whole_values.csv: what was observed of each run, with its standard deviation, beside its simulated runs."""
    write_tables(path, (_values(comparison, one) for one in comparison.compared))


def _values(comparison: WholeRuns, one: Compared) -> Columns:
    there = np.flatnonzero(np.isfinite(one.observed))
    place = np.full(one.observed.size, np.nan) if one.test is None else one.test.place
    return {
        "model": [one.model] * there.size,
        "trajectory": comparison.names[there].tolist(),
        "section": [one.section] * there.size,
        "quantity": [one.quantity.name] * there.size,
        "observed": one.observed[there],
        "sigma_observed": one.sigma[there],
        "simulated_n": [str(count) for count in one.count[there].tolist()],
        **{f"simulated_{name}": one.quantiles[there, i] for i, name in enumerate(QUANTILE_NAMES)},
        "place": place[there],
    }


def _middle(one: Compared) -> float:
    """The median observed; of a share, the mean."""
    known = one.observed[np.isfinite(one.observed)]
    if not known.size:
        return np.nan
    return float(known.mean() if one.quantity.name == "reach" else np.median(known))
