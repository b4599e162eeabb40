# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenarios of simulations: the one place where what is stated becomes one, and the scenario of a project.

The command line without a project, observed runs and Blender read the parts themselves, and hand them to
`make_scenario`.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..analysis.measured_rebounds import measured_rebounds
from ..errors import InputError
from ..exchange.map_shapes import polygon_of, read_lines, read_polygons
from ..exchange.parameters import checked_parameters
from ..exchange.posterior_tables import posteriors_of
from ..exchange.project import BlockEntry, Project, ReconstructionSettings
from ..exchange.screens import screens_of
from ..exchange.simulation_entry import LINE, MEASURED, POINTS, POLYGON, STEEP, TABLE, ReleaseEntry, SimulationEntry
from ..exchange.simulation_tables import read_releases
from ..exchange.tables import read_impacts
from ..exchange.trees import open_trees
from ..exchange.zones import open_zones
from ..hazard.screens import Screen
from ..impact_models.machinery.measured import MeasuredRebounds
from ..impact_models.registry import COMPARED, find_model
from ..progress import Progress, silent
from ..reconstruction.drag import Drag
from ..reconstruction.picks import take
from ..reconstruction.trajectory import Reconstruction
from ..simulation.block_shapes import ROUND, Shape
from ..simulation.blocks import Blocks
from ..simulation.distributions import Distribution
from ..simulation.ground import Ground
from ..simulation.measured_releases import from_reconstruction
from ..simulation.parameter_draws import ParameterDraws
from ..simulation.polygons import Polygon
from ..simulation.release import Releases
from ..simulation.release_sources import in_polygon, on_line, on_points, steeper_than
from ..simulation.zones import Zones
from ..terrain.cloud import Cloud
from ..terrain.readers import read_structure, read_tile_points
from ..terrain.surface import Surface
from .footage import measured_in
from .opening import open_terrain, read_project_picks, reconstruct_project
from .simulation import ReleaseSource, Scenario
from .simulation_output import recorded_for

SAME_TIME_S = 1e-6


def make_scenario(
    entry: SimulationEntry,
    how: ReconstructionSettings,
    met: Surface | Cloud,
    releases: ReleaseSource,
    parameters: Mapping[str, Mapping[str, object]],
    *,
    measured: MeasuredRebounds | None = None,
    structures: Mapping[str, Surface | Cloud] | None = None,
    screens: tuple[Screen, ...] = (),
    zones: Zones | None = None,
    draws: Mapping[str, ParameterDraws] | None = None,
    more_releases: Callable[[int], ReleaseSource] | None = None,
    progress: Progress = silent,
) -> tuple[Scenario, dict[str, Path]]:
    """The scenario of an entry, whose parts have been read, and the files of its trees.

    Parameters
    ----------
    entry : models, motion, trees, seed, tables. Its files of releases, structures, screens, zones, posterior and
        observed impacts are given as they were read.
    how : gravity, and the drag of air.
    met : the terrain that blocks meet: its surface, or its points.
    parameters : model → parameters that do not have their default; those of other models are left out.
    releases, measured, structures, screens, zones, draws, more_releases : see `Scenario`.

    Raises
    ------
    InputError : see `open_trees`.
    """
    trees, files = None, dict[str, Path]()
    if entry.trees is not None:
        progress("Placing the trees", 0, 0)
        trees, files = open_trees(entry.trees, met, entry.seed)
    scenario = Scenario(
        met,
        releases,
        {name: parameters.get(name, {}) for name in entry.models},
        measured,
        structures=structures or {},
        screens=screens,
        zones=zones,
        trees=trees,
        rolling=entry.rolling,
        friction=entry.friction,
        drag=Drag(how.air_density_kgpm3, how.drag_coefficient) if entry.drag else None,
        gravity_mps2=how.gravity_mps2,
        seed=entry.seed,
        record="all" if entry.record is None else recorded_for(entry.record, bool(structures), bool(screens)),
        draws=draws or {},
        more_releases=more_releases,
    )
    return scenario, files


def open_simulation(project: Project, file: Path, progress: Progress = silent) -> tuple[Scenario, dict[str, Path]]:
    """What a project simulates, and the files that decide it, by what they are.

    Parameters
    ----------
    file : the project's own, for messages.

    Notes
    -----
    A project that says nothing of a simulation releases each measured block once, with the models that are compared by
    default.

    Raises
    ------
    RockfallError : the project has no terrain, or nothing measured where that is asked for; a file is bad.
    """
    progress("Reading the terrain", 0, 0)
    source, terrain = project.terrain, open_terrain(project)
    if source is None or terrain is None:
        raise InputError(
            "The project names no terrain", file=file, advice='Add [terrain] file = "terrain.ply" to simulate on it'
        )
    entry = project.stated_simulation
    known = checked_parameters(project.extra["models"], file) if "models" in project.extra else {}
    entry = replace(entry, models=entry.models or COMPARED)
    models = entry.models
    inputs = {"project": file, **source.inputs}
    drawing = any(find_model(name).draws_from_impacts for name in models)
    if drawing and entry.observed is not None:
        inputs["observed"] = entry.observed
    if project.picks is not None and (entry.releases.source == MEASURED or (drawing and entry.observed is None)):
        inputs["picks"] = project.picks
    if entry.releases.source in (TABLE, LINE, POLYGON) and entry.releases.file is not None:
        inputs["releases"] = entry.releases.file
    draws = {}
    if entry.posterior is not None:
        draws = posteriors_of([entry.posterior], models)
        inputs["posterior"] = entry.posterior
    structures: dict[str, Surface | Cloud] = {}
    for structure in entry.structures:
        progress(f"Reading {structure.file.name}", 0, 0)
        structures[structure.name] = read_structure(structure.file, source.how)
        inputs[structure.name] = structure.file
    for screens in entry.screens:
        if screens.file is not None:
            inputs[f"screens:{screens.file.name}"] = screens.file
    met: Surface | Cloud = terrain
    if entry.contact == "points":
        met = read_tile_points(source.files, source.how, shift=terrain.shift)
    zones = None
    if entry.zones is not None:
        progress(f"Reading {entry.zones.file.name}", 0, 0)
        inputs["zones"] = entry.zones.file
        zones = open_zones(
            entry.zones.file, entry.zones.attribute, met, models,
            terrain_files=source.files, how=source.how,
        )  # fmt: skip
    scenario, tree_files = make_scenario(
        entry,
        project.reconstruction,
        met,
        _named_source(project, terrain, entry, file),
        known,
        measured=_drawn_from(project, terrain, entry) if drawing else None,
        structures=structures,
        screens=screens_of(entry.screens, terrain.shift),
        zones=zones,
        draws=draws,
        more_releases=lambda times: _named_source(project, terrain, times_as_many(entry, times), file),
        progress=progress,
    )
    return scenario, inputs | tree_files


def times_as_many(entry: SimulationEntry, times: int) -> SimulationEntry:
    """The same with so many times as many blocks, as far as no table says how many."""
    return replace(entry, releases=replace(entry.releases, number=times * entry.releases.number))


def _drawn_from(project: Project, terrain: Surface, entry: SimulationEntry) -> MeasuredRebounds:
    """The measured impacts that the model observed draws from."""
    if entry.observed is not None:
        return measured_rebounds(read_impacts(entry.observed))
    return measured_rebounds(reconstruct_project(project, terrain).impacts)


def _named_source(project: Project, terrain: Surface, entry: SimulationEntry, file: Path) -> ReleaseSource:
    """`release_source`, whose errors name the project."""
    with _naming(file):
        source = release_source(project, terrain, entry)

    def release(ground: Ground) -> Releases:
        with _naming(file):
            return source(ground)

    return release


@contextmanager
def _naming(file: Path) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        place = error.file or file
        raise InputError(
            error.problem, file=place, row=error.row, trajectory=error.trajectory, advice=error.advice
        ) from error


def release_source(project: Project, terrain: Surface, entry: SimulationEntry) -> ReleaseSource:
    """What puts the blocks of a project on its ground.

    Raises
    ------
    RockfallError : nothing is measured where that is asked for; blocks that cannot be.
    """
    if entry.releases.source == MEASURED:
        return measured_source(entry, project.block, _measured(project, terrain, entry.releases))
    return placed_source(entry, project.block)


def measured_source(entry: SimulationEntry, block: BlockEntry, measured: Reconstruction) -> ReleaseSource:
    """Blocks that start as it was measured. block : the project's, for what the entry does not say."""
    releases = entry.releases
    given = (releases.shape, releases.diameter, releases.proportions, releases.density)
    own = None if given == (None,) * len(given) else _blocks(releases, block)
    return lambda ground: from_reconstruction(ground, measured, own, releases.number, entry.seed)


def placed_source(entry: SimulationEntry, block: BlockEntry) -> ReleaseSource:
    """Blocks from points, a line, a polygon, steep terrain or a table.

    Raises
    ------
    InputError : blocks that cannot be.
    """
    releases, seed = entry.releases, entry.seed
    blocks = _blocks(releases, block)
    if releases.source == STEEP:
        angle = np.radians(releases.steeper_than_deg)
        return lambda ground: steeper_than(ground, angle, blocks, releases.number, seed)
    if releases.source == TABLE:
        return lambda ground: _from_table(ground, releases, blocks, seed)
    return lambda ground: _from_drawing(ground, releases, blocks, seed)


def _measured(project: Project, terrain: Surface, entry: ReleaseEntry) -> Reconstruction:
    if not entry.trajectory:
        return measured_in(project, terrain)
    picks, _ = read_project_picks(project, terrain)
    onward = picks.trajectory == entry.trajectory
    if not onward.any():
        known = ", ".join(dict.fromkeys(picks.trajectory.tolist()))
        raise InputError(
            f"There is no trajectory {entry.trajectory!r} to release blocks from", advice=f"Known: {known}"
        )
    if entry.time_s is not None:
        onward &= picks.time_s >= entry.time_s - SAME_TIME_S
    return reconstruct_project(project, terrain, take(picks, onward))


def _from_drawing(ground: Ground, entry: ReleaseEntry, blocks: Blocks, seed: int) -> Releases:
    """From points, lines or polygons."""
    if entry.file is not None and entry.source != POINTS:
        return _from_map(ground, entry, entry.file, blocks, seed)
    survey = np.array([[*point, np.nan][:3] for point in entry.points_m])
    points = ground.shift.to_local(survey)
    if entry.source == POINTS:
        several = len(points) > 1
        names = [f"{entry.name} {i + 1}".strip() if several else entry.name for i in range(len(points))]
        return on_points(ground, points, blocks, entry.number, seed, np.array(names, dtype=np.str_))
    if entry.source == LINE:
        return on_line(ground, [points], blocks, entry.number, seed, names=[entry.name])
    return in_polygon(ground, [Polygon(entry.name, (points[:, :2],))], blocks, entry.number, seed)


def _from_map(ground: Ground, entry: ReleaseEntry, file: Path, blocks: Blocks, seed: int) -> Releases:
    """From the lines or polygons of a file; those without a name have the entry's."""
    with _naming(file):
        if entry.source == LINE:
            shapes = read_lines(file, ground.shift)
            names = [shape.name or entry.name for shape in shapes]
            placed = on_line(ground, [shape.parts[0] for shape in shapes], blocks, entry.number, seed, names=names)
        else:
            shapes = read_polygons(file, ground.shift)
            polygons = [polygon_of(replace(shape, name=shape.name or entry.name), file) for shape in shapes]
            placed = in_polygon(ground, polygons, blocks, entry.number, seed)
    return placed.with_remarks(*shapes.remarks)


def _from_table(ground: Ground, entry: ReleaseEntry, blocks: Blocks, seed: int) -> Releases:
    assert entry.file is not None
    return read_releases(entry.file, ground, blocks, entry.number, seed)


def _blocks(entry: ReleaseEntry, block: BlockEntry) -> Blocks:
    """The law of the blocks: what is not given is as in the project's block."""
    three = (block.d1_m, block.d2_m, block.d3_m)
    even: Shape = "cube" if block.shape == "box" else "sphere"
    uneven: Shape = "box" if block.shape == "box" else "ellipsoid"
    shape = entry.shape or (even if len(set(three)) == 1 else uneven)
    own = (1.0, 1.0, 1.0) if shape in ROUND else three
    return Blocks(
        shape,
        entry.diameter or Distribution("fixed", sum(three) / 3),
        entry.proportions or own,
        entry.density or Distribution("fixed", block.density_kgpm3),
    )
