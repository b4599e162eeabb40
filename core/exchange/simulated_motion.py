# SPDX-License-Identifier: GPL-3.0-or-later
"""impacts.csv and trajectories.csv of simulations: millions of rows, in parts, with fixed decimals."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from ..progress import Progress, silent
from ..reconstruction.impact import FLAGS, Impacts
from ..reconstruction.sampling import STEP_S
from ..simulation.engine import IMPACT, Simulation
from ..simulation.results import impacts_of, release_names, sample_runs
from ..vectors import Array, Indices
from .decimal_tables import DecimalColumns, Words, write_decimal_table
from .simulation_parts import all_digits, in_parts
from .tables import POSITION, VELOCITY, impact_numbers, spin_and_energies, vector_columns

NORMAL_DECIMALS = 9


def write_simulated_impacts(
    simulations: Sequence[Simulation], path: str | Path, site: str = "", progress: Progress = silent
) -> None:
    """Write impacts.csv with the columns of `write_impacts` and the decimals of `decimal_tables`.

    Normals have 9 decimals, sizes and masses all their digits.

    Raises
    ------
    OSError : the file cannot be written.
    """
    parts = in_parts(simulations, lambda one: one.impacts, partial(_impact_columns, site=site))
    write_decimal_table(
        path, parts, {"impact": 0, "run": 0} | dict.fromkeys(("nx", "ny", "nz"), NORMAL_DECIMALS), progress
    )


def write_simulated_trajectories(
    simulations: Sequence[Simulation], path: str | Path, step_s: float = STEP_S, progress: Progress = silent
) -> None:
    """Write trajectories.csv, sampled every `step_s` in flight, to the micrometre and microsecond.

    The last column is the seed, which measured trajectories have not: one of the models is called `observed`, too.

    Raises
    ------
    OSError : the file cannot be written.
    """

    def rows(one: Simulation) -> Indices:
        moments: Indices = np.bincount(one.records.run, minlength=len(one))
        return moments + np.ceil(one.time_s / step_s).astype(np.intp)

    write_decimal_table(
        path, in_parts(simulations, rows, partial(_sample_columns, step_s=step_s)), {"run": 0}, progress
    )


def _impact_columns(simulation: Simulation, site: str) -> DecimalColumns:
    records, releases, ground = simulation.records, simulation.releases, simulation.ground
    impacts = impacts_of(simulation, site)
    rows = np.flatnonzero(records.what == IMPACT)
    run = records.run[rows]
    none = np.zeros(rows.size, np.intp)
    owner = ground.owner[records.face[rows]].astype(np.intp)
    numbers: dict[str, Array | Words] = {**impact_numbers(impacts)}
    for name, values in (("diameter_m", releases.diameter_m), ("mass_kg", releases.mass_kg)):
        numbers[name] = all_digits(run, values)
    return {
        "site": Words(none, (site,)),
        "trajectory": Words(run, tuple(release_names(simulation).tolist())),
        "impact": impacts.impact,
        **numbers,
        "flags": _flags(impacts),
        **spin_and_energies(impacts),
        "run": simulation.number[run],
        "structure": Words(owner, ("", *ground.structures)),
        "source": Words(none, (simulation.settings.model,)),
        "seed": Words(none, (str(simulation.settings.seed),)),
    }


def _flags(impacts: Impacts) -> Words:
    """The flags as words: few of their combinations occur."""
    bits = np.zeros(len(impacts), np.intp)
    for place, name in enumerate(FLAGS):
        bits |= impacts.flags[name].astype(np.intp) << place
    found, which = np.unique(bits, return_inverse=True)
    texts = (";".join(name for place, name in enumerate(FLAGS) if bit >> place & 1) for bit in found.tolist())
    return Words(which, tuple(texts))


def _sample_columns(simulation: Simulation, step_s: float) -> DecimalColumns:
    samples = sample_runs(simulation, step_s)
    run, none = simulation.place_of(samples.run), np.zeros(len(samples), np.intp)
    return {
        "source": Words(none, (simulation.settings.model,)),
        "trajectory": Words(run, tuple(release_names(simulation).tolist())),
        "run": samples.run,
        "time_s": samples.time_s,
        **vector_columns(POSITION, samples.shift.to_survey(samples.position)),
        **vector_columns(VELOCITY, samples.velocity),
        "height_m": samples.height_m,
        "kinetic_J": samples.kinetic_j,
        "seed": Words(none, (str(simulation.settings.seed),)),
    }
