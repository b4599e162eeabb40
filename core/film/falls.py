# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks that fall beside the measured ones of a project: from the same starts, as the project says they move."""

from dataclasses import replace

from ..exchange.project import Project
from ..exchange.simulation_entry import ReleaseEntry
from ..progress import Progress, silent
from ..simulation.engine import Simulation
from ..workflow.scenarios import open_simulation
from ..workflow.simulation import run_scenario
from .job import FilmJob
from .simulated import check_number


def fall_beside(job: FilmJob, project: Project, measured: int, progress: Progress = silent) -> tuple[Simulation, ...]:
    """Let the blocks of a film fall, once with each of its models.

    Structures, rolling, friction and drag are those of the project's ``[simulation]``; without it, there is drag where
    the reconstruction has it.

    Parameters
    ----------
    measured : how many blocks start as measured, `number` times each.

    Raises
    ------
    RockfallError : too many blocks or none, no terrain, nothing measured that begins with a flight, a bad file.
    """
    check_number(job.number, len(job.simulate), max(measured, 1))
    stated = project.stated_simulation
    asked = replace(
        stated, models=job.simulate, releases=ReleaseEntry(number=job.number), seed=job.seed, record=("trajectories",)
    )
    scenario, _ = open_simulation(replace(project, simulation=asked), job.source, progress)
    models = {name: job.parameters.get(name, {}) for name in job.simulate}
    return run_scenario(replace(scenario, models=models), progress=progress)
