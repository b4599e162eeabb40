# SPDX-License-Identifier: GPL-3.0-or-later
"""Observed runs beside simulated ones: blocks are released as those that were observed, and what becomes of both is
compared.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..analysis.paths import Paths, simulated_paths
from ..analysis.ranks import FEWEST
from ..analysis.sections import Section, default_sections
from ..analysis.whole_runs import Observed, WholeRuns, compare_runs
from ..errors import InputError
from ..progress import CancelledError, Progress, silent
from ..reconstruction.block import Block
from ..simulation.engine import Settings, Simulation
from ..simulation.ground import Ground
from ..simulation.release import Releases, make_releases, overlapping
from ..terrain.raycast import closest_points
from ..vectors import Array, Names, cross
from .simulation import run_models

NUMBER = 100
"""Blocks for each observed run."""
LIFTS, CLEAR_M = 40, 1e-3


@dataclass(frozen=True, eq=False)
class ComparedSimulations:
    """The comparison, and the simulations that it is of."""

    comparison: WholeRuns
    simulations: tuple[Simulation, ...]


def compare_whole_runs(
    ground: Ground,
    observed: Observed,
    releases: Releases,
    settings: Sequence[Settings],
    sections: Sequence[Section] = (),
    *,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress = silent,
) -> ComparedSimulations:
    """Let the releases fall with each model, and compare.

    Parameters
    ----------
    releases : several for each observed run, of its name; see `released_as_observed`.
    sections : none takes the default ones of the observed runs.

    Raises
    ------
    InputError : settings that cannot be, observed runs without a release.
    CancelledError : the work was ended before the first model was finished. Later, the finished ones are compared.
    """
    for name in observed.paths.name.tolist():
        if name not in releases.name:
            raise InputError("No block is released for this run", trajectory=name, advice="Give its release")
    simulations = run_models(ground, releases, settings, record=True, threads=threads, progress=progress)
    finished = tuple(one for one in simulations if len(one) == one.wanted)
    if not finished:
        raise CancelledError
    progress("Comparing", 0, 0)
    paths = {one.settings.model: simulated_paths(one) for one in finished}
    if not sections and observed.paths.impact_piece.size:
        sections = default_sections(observed.paths, FEWEST, ground.shift.z)
    return ComparedSimulations(compare_runs(observed, paths, ground, sections, seed=seed), finished)


def released_as_observed(
    ground: Ground, observed: Observed, blocks: Mapping[str, Block], number: int = NUMBER
) -> Releases:
    """Blocks that start as the observed ones did, `number` for each.

    Parameters
    ----------
    blocks : by name of the run.

    Raises
    ------
    InputError : a number of zero; a start beside the terrain; a terrain that is a cloud of points.

    Notes
    -----
    A run starts at its release, with the velocity that its first flight begins with; a run whose release was not seen,
    where its first flight begins. Where the picks have standard deviations, each block starts as one of the runs with
    picks moved by their errors. A block starts without spin from a release, and rolling (ω = n × v/r) from an impact,
    since its spin is not seen. It is put on the ground if it would be in it.
    """
    if number < 1:
        raise InputError(f"{number} blocks cannot be released", advice="Release at least one for each run")
    paths = observed.paths
    variants = [one for one in observed.moved if np.array_equal(one.name, paths.name)] or [paths]
    starts, velocities = (np.stack(each) for each in zip(*(_starts(one) for one in variants), strict=True))
    chosen = np.arange(number) % len(variants)
    start = starts[chosen].swapaxes(0, 1).reshape(-1, 3)
    velocity = velocities[chosen].swapaxes(0, 1).reshape(-1, 3)
    name = np.repeat(paths.name, number)
    radius = np.array([blocks[one].radius_m for one in name.tolist()])
    density = np.repeat(paths.mass_kg, number) / (np.pi / 6 * (2 * radius) ** 3)
    centre, normal = _placed(ground, start, radius, name)
    rolling = cross(normal, velocity) / radius[:, None]
    moving = np.repeat(observed.from_impact, number)
    return make_releases(
        centre,
        name=name,
        velocity=velocity,
        angular_velocity=np.where(moving[:, None], rolling, 0.0),
        diameter_m=2 * radius,
        density_kgpm3=density,
    )


def _starts(paths: Paths) -> tuple[Array, Array]:
    first = paths.first_piece[:-1]
    return paths.start[first], paths.start_velocity[first]


def _placed(ground: Ground, start: Array, radius: Array, name: Names) -> tuple[Array, Array]:
    """Centres (m, 3) of blocks whose undersides start at places (m, 3), clear of the ground, and its normals there."""
    near = closest_points(ground.surface, start)
    normal = ground.surface.face_normals[near.face]
    on_ground = (near.distance < radius)[:, None]
    centre = np.where(on_ground, near.point + radius[:, None] * normal, start + radius[:, None] * [0.0, 0.0, 1.0])
    for _ in range(LIFTS):
        depth = overlapping(ground, make_releases(centre, name=name, diameter_m=2 * radius))
        if not (deep := depth > 0).any():
            break
        centre[:, 2] += np.where(deep, depth + CLEAR_M, 0.0)
    return centre, normal
