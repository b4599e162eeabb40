# SPDX-License-Identifier: GPL-3.0-or-later
"""A simulation as a GeoPackage: paths, impacts, stops and releases, beside those that were measured."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..hazard.screens import Screen
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..reconstruction.impact import Impacts
from ..reconstruction.sampling import TrajectorySamples, sample_trajectories
from ..reconstruction.trajectory import Reconstruction
from ..simulation.engine import Simulation
from ..simulation.ground import Ground
from ..simulation.results import impacts_of, release_names, run_figures
from ..simulation.run_lines import lines_of
from ..simulation.tree_hits import tree_hits_of
from ..simulation.trees import Trees
from ..vectors import Array, norm
from .geopackage import FeatureLayer, write_geopackage
from .qgis_styles import line_style, point_style

GEOPACKAGE = "simulation.gpkg"
BLACK, STOP, RELEASE = (0.0, 0.0, 0.0), (0.2, 0.24, 0.3), (1.0, 1.0, 1.0)
SCREEN, TREE = (0.0, 0.45, 0.70), (0.0, 0.45, 0.25)
MEASURED_STEP_S = 0.05
"""Between the points of a measured trajectory, in which chords are within 3 mm of the parabola."""
FAINT = 0.4
"""Opacity of paths, of which there are many."""


def write_simulation_geopackage(
    simulations: Sequence[Simulation],
    path: str | Path,
    *,
    measured: Reconstruction | None = None,
    screens: Sequence[Screen] = (),
    about: Mapping[str, str] | None = None,
    progress: Progress = silent,
) -> tuple[str, ...]:
    """Write what was recorded of simulations on one ground from the same releases.

    Parameters
    ----------
    measured : of the same site.
    screens : across the slope.
    about : see `write_geopackage`.

    Returns
    -------
    The names of the layers; those of paths and impacts are there where the simulations recorded them.

    Raises
    ------
    InputError : the file cannot be written.
    """

    def layers() -> Iterator[FeatureLayer]:
        yield releases_layer(simulations[0])
        for simulation in simulations:
            progress(f"Writing the paths of {simulation.settings.model}", 0, 0)
            suffix = f"_{simulation.settings.model}" if len(simulations) > 1 else ""
            if simulation.recorded == "all":
                yield paths_layer(simulation, f"trajectories{suffix}")
            if simulation.recorded != "ends":
                yield impacts_layer(
                    impacts_of(simulation), f"impacts{suffix}", find_model(simulation.settings.model).colour
                )
            yield stops_layer(simulation, f"stops{suffix}")
        if measured is not None and len(measured.flights):
            yield measured_layer(sample_trajectories(measured, MEASURED_STEP_S))
        if measured is not None and len(measured.impacts):
            yield impacts_layer(measured.impacts, "measured_impacts", BLACK)
        if screens:
            yield screens_layer(screens, simulations[0].ground)
        if simulations[0].settings.trees is not None:
            yield trees_layer(simulations[0].settings.trees, simulations)

    settings = simulations[0].settings
    said = {"seed": str(settings.seed), "blocks": str(len(simulations[0])), **(about or {})}
    return write_geopackage(path, layers(), simulations[0].ground.shift, said)


def releases_layer(simulation: Simulation) -> FeatureLayer:
    """Where the blocks begin, with their sizes."""
    releases = simulation.releases
    columns = {
        "run": simulation.number,
        "release": release_names(simulation),
        "diameter_m": releases.diameter_m,
        "mass_kg": releases.mass_kg,
        "v_mps": norm(releases.velocity),
    }
    style = point_style(RELEASE, 1.4, "triangle")
    return FeatureLayer(
        "releases", "Centres of the blocks when they are released", releases.position, None, columns, style
    )


def paths_layer(simulation: Simulation, name: str) -> FeatureLayer:
    """The path of each block, with the numbers of its run."""
    lines = lines_of(simulation)
    model = find_model(simulation.settings.model)
    style = line_style(model.colour, 0.2, FAINT)
    said = f"Paths of the blocks' centres with {model.title}"
    return FeatureLayer(name, said, lines.points, lines.first, _of_runs(simulation), style)


def stops_layer(simulation: Simulation, name: str) -> FeatureLayer:
    """Where the blocks end, and how."""
    said = "Centres of the blocks where they end: at rest, held by a structure, or beyond the terrain"
    return FeatureLayer(name, said, simulation.position, None, _of_runs(simulation), point_style(STOP, 1.2))


def _of_runs(simulation: Simulation) -> dict[str, NDArray[Any]]:
    figures, n = run_figures(simulation), len(simulation)
    return {
        "run": simulation.number,
        "release": release_names(simulation),
        "model": np.full(n, simulation.settings.model),
        "diameter_m": simulation.releases.diameter_m,
        "mass_kg": simulation.releases.mass_kg,
        "end": np.array(simulation.ends)[simulation.end],
        "time_s": simulation.time_s,
        "length_m": simulation.length_m,
        "impacts": simulation.impacts,
        **({} if simulation.settings.trees is None else {"tree_hits": simulation.tree_hits}),
        "v_max_mps": simulation.v_max_mps,
        "kinetic_max_kJ": figures.kinetic_max_j / 1000,
        "height_max_m": figures.height_max_m,
        "energy_line_deg": np.degrees(figures.energy_line),
    }


def impacts_layer(impacts: Impacts, name: str, colour: Sequence[float]) -> FeatureLayer:
    """Places of contact, with what happened there."""
    columns: dict[str, NDArray[Any]] = {"trajectory": impacts.trajectory, "impact": impacts.impact}
    if "run" in impacts.extra:
        columns |= {"run": impacts.extra["run"].astype(np.int64), "structure": impacts.extra["structure"]}
    columns |= {
        "time_s": impacts.time_s,
        "v1_mps": norm(impacts.v1),
        "v2_mps": norm(impacts.v2),
        "kinetic1_kJ": impacts.kinetic1_j / 1000,
        "kinetic2_kJ": impacts.kinetic2_j / 1000,
        "rn": impacts.rn,
        "rt": impacts.rt,
        "theta1_deg": np.degrees(impacts.theta1),
        "diameter_m": impacts.diameter_m,
        "mass_kg": impacts.mass_kg,
    }
    kind = "Measured impacts" if name.startswith("measured") else "Simulated impacts"
    return FeatureLayer(name, f"{kind}: places of contact", impacts.position, None, columns, point_style(colour, 1.0))


def measured_layer(samples: TrajectorySamples) -> FeatureLayer:
    """The measured trajectories: a line for each part of one that was seen without a gap."""
    begins = (samples.trajectory[1:] != samples.trajectory[:-1]) | (samples.run[1:] != samples.run[:-1])
    first = np.concatenate([[0], np.flatnonzero(begins) + 1, [len(samples)]])
    start = first[:-1]

    def greatest(values: Array) -> Array:
        found: Array = np.fmax.reduceat(values, start)
        return found

    columns = {
        "trajectory": samples.trajectory[start],
        "part": samples.run[start],
        "v_max_mps": greatest(norm(samples.velocity)),
        "kinetic_max_kJ": greatest(samples.kinetic_j) / 1000,
        "height_max_m": greatest(samples.height_m),
    }
    said = "Measured trajectories of the blocks' centres"
    return FeatureLayer("measured", said, samples.position, first, columns, line_style(BLACK, 0.5))


def trees_layer(trees: Trees, simulations: Sequence[Simulation]) -> FeatureLayer:
    """The stems at their foot, and how often blocks hit each, as far as impacts were recorded."""
    columns: dict[str, NDArray[Any]] = {
        "tree": np.array(trees.labels(np.arange(len(trees)))),
        "dbh_cm": 100 * trees.dbh_m,
        "height_m": trees.height_m,
        "loss_max_kJ": trees.energy_j / 1000,
    }
    for one in simulations:
        if one.recorded != "ends":
            name = f"hits_{one.settings.model}" if len(simulations) > 1 else "hits"
            columns[name] = np.bincount(tree_hits_of(one).tree, minlength=len(trees))
    points = np.column_stack([trees.position, trees.foot_m])
    return FeatureLayer("trees", "Trees that blocks can meet", points, None, columns, point_style(TREE, 0.8))


def screens_layer(screens: Sequence[Screen], ground: Ground) -> FeatureLayer:
    """Lines of screens on the terrain; where it has none below, at its lowest height."""
    plan = np.concatenate([screen.line for screen in screens])
    low, high = ground.terrain.bounds[:, 2].tolist()
    above = ground.heights_above(np.column_stack([plan, np.full(len(plan), high + 1.0)]))
    points = np.column_stack([plan, np.where(np.isnan(above), low, high + 1.0 - above)])
    first = np.cumsum([0, *(len(screen.line) for screen in screens)])
    height = np.array([screen.height_m for screen in screens])
    columns = {
        "name": np.array([screen.name for screen in screens]),
        "height_m": np.where(np.isfinite(height), height, np.nan),
        "capacity_kJ": np.array([np.nan if s.capacity_j is None else s.capacity_j / 1000 for s in screens]),
        "length_m": np.array([screen.length_m for screen in screens]),
    }
    said = "Screens, and barriers with a height and a capacity, at their foot"
    return FeatureLayer("screens", said, points, first, columns, line_style(SCREEN, 0.8))
