# SPDX-License-Identifier: GPL-3.0-or-later
"""Observed runs beside simulated ones: blocks are released as those that were observed, and what becomes of both is
compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..analysis.completeness import (
    NOT_STATED,
    Completeness,
    compared_completeness,
    names_that_fell,
    unseen_stop,
)
from ..analysis.observed_runs import Observed, join_observed, observe_runs
from ..analysis.paths import Paths, simulated_paths
from ..analysis.ranks import FEWEST
from ..analysis.sections import Section, default_sections
from ..analysis.whole_runs import WholeRuns, compare_runs
from ..errors import InputError
from ..exchange.whole_run_tables import read_stops
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..reconstruction.trajectory import Reconstruction
from ..remarks import Remark
from ..simulation.engine import Settings, Simulation, joined, simulate
from ..simulation.ground import Ground
from ..simulation.measured_releases import from_reconstruction
from ..simulation.release import Releases, join_releases, standing_on
from ..terrain.raycast import closest_points
from ..vectors import Array, Indices, Mask
from .simulation import ReleaseSource, remarks_of, run_models


class ObservedRuns(NamedTuple):
    """What was observed, and blocks that start as the observed ones did: one or several of the name of each."""

    observed: Observed
    releases: Releases


def stopped_runs(ground: Ground, source: ReleaseSource, stops: str | Path) -> ObservedRuns:
    """Blocks of which it is known where they started and stopped; see `read_stops`."""
    releases = source(ground)
    return ObservedRuns(read_stops(stops, releases, ground), releases)


def join_runs(parts: Sequence[ObservedRuns]) -> ObservedRuns:
    """The runs of several sources, as of trajectories that were filmed and of blocks of which the stop is known.

    Remarks on the releases of one source name its first run.

    Raises
    ------
    InputError : runs of two sources have one name.
    """
    if len(parts) == 1:
        return parts[0]
    observed, releases = zip(*parts, strict=True)
    return ObservedRuns(join_observed(observed), join_releases([_told_apart(one) for one in releases]))


def _told_apart(releases: Releases) -> Releases:
    """Its remarks say of which runs they are."""
    first, *others = dict.fromkeys(releases.name.tolist())
    which = f"{first} and {len(others)} other{'s' * (len(others) > 1)}" if others else first
    return replace(releases, remarks=tuple(replace(one, text=f"Of {which}: {one.text}") for one in releases.remarks))


NUMBER = 100
"""Blocks for each observed run."""


@dataclass(frozen=True, eq=False)
class ComparedSimulations:
    """The comparison, the simulations that it is of, and what there is to know of these."""

    comparison: WholeRuns
    simulations: tuple[Simulation, ...]
    remarks: tuple[Remark, ...]


def compare_whole_runs(
    ground: Ground,
    observed: Observed,
    releases: Releases,
    settings: Sequence[Settings],
    sections: Sequence[Section] = (),
    *,
    completeness: Completeness = NOT_STATED,
    seed: int = 0,
    threads: int | None = None,
    progress: Progress = silent,
) -> ComparedSimulations:
    """Let the releases fall with each model, and compare.

    Parameters
    ----------
    releases : several for each observed run, of its name; see `released_as_observed`.
    settings : one for each model. What is drawn from measured impacts is never drawn from the run's own.
    sections : none takes the default ones of the observed runs.
    completeness : whether the observed runs are all that fell. Of the longest of a number of falls as many blocks fall
        in each repeat, and only the longest of them are compared, each with the observed run of its own release.

    Raises
    ------
    InputError : settings that cannot be, observed runs without a release, a completeness that cannot be.
    CancelledError : the work was ended before all models were finished.
    """
    for name in observed.paths.name.tolist():
        if name not in releases.name:
            raise InputError("No block is released for this run", trajectory=name, advice="Give its release")
    repeat = None
    if completeness.kind == "longest":
        releases, repeat, completeness = _as_many_as_fell(observed, releases, completeness)
    simulations = _simulations(ground, releases, settings, threads, progress)
    if len(simulations) < len(settings) or any(len(one) < one.wanted for one in simulations):
        raise CancelledError
    progress("Comparing", 0, 0)
    paths = {one.settings.model: simulated_paths(one) for one in simulations}
    if repeat is not None:
        paths = {model: _longest(runs, repeat, len(observed.paths)) for model, runs in paths.items()}
    if not sections and observed.paths.impact_piece.size:
        sections = default_sections(observed.paths, FEWEST, ground.shift.z)
    told = [one for one in remarks_of(simulations) if one.severity != "note"]
    found = compare_runs(observed, paths, ground, sections, seed=seed)
    stated = compared_completeness(completeness, len(observed.paths))
    return ComparedSimulations(found, simulations, (*releases.remarks, *told, *stated))


def _as_many_as_fell(
    observed: Observed, releases: Releases, stated: Completeness
) -> tuple[Releases, Indices, Completeness]:
    """The releases of all falls, each as often as that of a run is there, and of which repeat each is."""
    paths = observed.paths
    for name in paths.name[np.isnan(paths.stop[:, 0])].tolist():
        raise unseen_stop(name)
    fell = names_that_fell(stated, paths.name, releases.name)
    repeats = int((releases.name == paths.name[0]).sum())
    rows, repeat = [], []
    for name in dict.fromkeys(fell.tolist()):
        own, times = np.flatnonzero(releases.name == name), int((fell == name).sum())
        rows.append(np.resize(own, repeats * times))
        repeat.append(np.arange(repeats * times) % repeats)
    return releases.take(np.concatenate(rows)), np.concatenate(repeat), replace(stated, falls=fell.size)


def _longest(runs: Paths, repeat: Indices, number: int) -> Paths:
    """Of each repeat the runs that come farthest."""
    run_out = np.hypot(*(runs.stop - runs.start[runs.first_piece[:-1]])[:, :2].T)
    order = np.lexsort((-np.nan_to_num(run_out, nan=-np.inf), repeat))
    place = np.arange(order.size) - np.searchsorted(repeat[order], repeat[order])
    return runs.take(np.sort(order[place < number]))


def _simulations(
    ground: Ground, releases: Releases, settings: Sequence[Settings], threads: int | None, progress: Progress
) -> tuple[Simulation, ...]:
    """As `run_models`; a model that draws from measured impacts does so from those of the other trajectories."""
    plain = [one for one in settings if one.measured is None or not find_model(one.model).draws_from_impacts]
    drawing = [one for one in settings if one not in plain]
    done: list[Simulation] = []
    if plain or not drawing:
        done += run_models(ground, releases, plain, threads=threads, progress=progress)
    if all(len(one) == one.wanted for one in done):
        done += [_from_others(ground, releases, one, threads, progress) for one in drawing]
    models = [one.model for one in settings]
    return tuple(sorted(done, key=lambda one: models.index(one.settings.model)))


def _from_others(
    ground: Ground, releases: Releases, settings: Settings, threads: int | None, progress: Progress
) -> Simulation:
    """Simulate each release without the measured impacts of the trajectory of its name."""
    measured = settings.measured
    assert measured is not None
    parts, ends = [], np.flatnonzero(np.r_[releases.name[1:] != releases.name[:-1], True]) + 1
    for first, last in zip(np.r_[0, ends[:-1]].tolist(), ends.tolist(), strict=True):
        name = str(releases.name[first])
        progress(f"Simulating {find_model(settings.model).title}", first, len(releases))
        others = replace(settings, measured=measured.without(measured.trajectory == name))
        part = releases.take(slice(first, last))
        simulation = simulate(ground, part, others, first_run=first, threads=threads)
        parts.append(replace(simulation, settings=settings))
    return joined(parts, releases)


def stated_sections(
    ground: Ground, contours: str = "", drops: str = "", lines: Sequence[Section] = ()
) -> tuple[Section, ...]:
    """The sections that somebody has stated.

    Parameters
    ----------
    contours : heights in survey coordinates, between commas, below which blocks fall [m].
    drops : heights below each block's own start [m].
    lines : sections with a line in plan.

    Raises
    ------
    InputError : what is no number, a contour beside the terrain, a drop that is not positive, two of one name.
    """
    low, high = ground.shift.to_survey(ground.terrain.bounds)[:, 2].tolist()
    sections = []
    for z in _numbers(contours, "contours"):
        if not low <= z <= high:
            raise InputError(
                f"The contour {z:g} m is where there is no terrain",
                advice=f"It reaches from {low:.0f} to {high:.0f} m",
            )
        sections.append(Section(f"{z:g} m", level_m=z - ground.shift.z))
    for height in _numbers(drops, "drops"):
        if height <= 0:
            raise InputError(f"A drop is {height:g} m", advice="Give heights above zero: so far below the start")
        sections.append(Section(f"{height:g} m below the start", drop_m=height))
    sections += lines
    names = [section.name for section in sections]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"The section {name} is given twice", advice="Give each section once, with its own name")
    return tuple(sections)


def _numbers(text: str, what: str) -> list[float]:
    values = []
    for part in (one.strip() for one in text.split(",") if one.strip()):
        try:
            values.append(float(part))
        except ValueError:
            raise InputError(f"One of the {what} is '{part}'", advice="Give numbers between commas") from None
        if not np.isfinite(values[-1]):
            raise InputError(f"One of the {what} is '{part}'", advice="Give finite numbers between commas")
    return values


def measured_runs(ground: Ground, made: Reconstruction, number: int = NUMBER) -> ObservedRuns:
    """The runs that were reconstructed, and `number` blocks that start as each; see `released_as_observed`."""
    observed = observe_runs(made, ground)
    return ObservedRuns(observed, released_as_observed(ground, observed, made, number))


def released_as_observed(
    ground: Ground, observed: Observed, reconstruction: Reconstruction, number: int = NUMBER
) -> Releases:
    """Blocks that start as the observed ones did, `number` for each: see `from_reconstruction`.

    Raises
    ------
    InputError : a number of zero; a start that is not on the terrain; a terrain that is a cloud of points.

    Notes
    -----
    Where the picks have standard deviations, each block starts as one of the runs with picks moved by their errors, so
    that what is not known of the start is in the simulation too.
    """
    releases = from_reconstruction(ground, reconstruction, number=number)
    variants = [one for one in observed.moved if np.array_equal(one.name, observed.paths.name)]
    if not variants:
        return releases
    own = {name: i for i, name in enumerate(observed.paths.name.tolist())}
    row = np.array([own[name] for name in releases.name.tolist()])
    variant = (np.arange(len(releases)) - np.searchsorted(row, row)) % len(variants)
    place, velocity = _starts(observed.paths)
    places, velocities = (np.stack(each) for each in zip(*map(_starts, variants), strict=True))
    centre = releases.position + (places[variant, row] - place[row])
    radius = releases.radius_m
    lay: Mask = ground.distance(releases.position) < 1.001 * radius
    near = closest_points(ground.surface, centre[lay])
    normal = ground.surface.face_normals[near.face]
    stands, fits = standing_on(ground, near.point, normal, 2 * radius[lay])
    centre[lay] = np.where(fits[:, None], stands, releases.position[lay])
    return replace(releases, position=centre, velocity=releases.velocity + (velocities[variant, row] - velocity[row]))


def _starts(paths: Paths) -> tuple[Array, Array]:
    first = paths.first_piece[:-1]
    return paths.start[first], paths.start_velocity[first]
