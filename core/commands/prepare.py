# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall prepare``: compile what is compiled when it is first needed, so that nobody waits for it later."""

import argparse
import io
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from ..progress import Progress, silent
from .demo import SITE
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..terrain.surface import Surface


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has none."""


def run(arguments: argparse.Namespace) -> int:
    """Prepare everything."""
    with PrintedProgress() as progress:
        prepare(progress=progress)
    _simulate()
    print("Everything is compiled; it is kept on the disk for the commands to come.")
    return 0


def _simulate() -> None:
    """What `simulate` runs besides the simulation itself: releases, heights, tables."""
    from . import simulate

    parser = argparse.ArgumentParser()
    simulate.add_arguments(parser)
    with TemporaryDirectory(prefix="rockfall-") as folder, redirect_stdout(io.StringIO()):
        out = str(Path(folder) / "out")
        simulate.run(parser.parse_args([str(SITE / "project.toml"), "--model", "noel_2017", "--out", out]))


def prepare(
    models: Sequence[str] | None = None,
    ready: Callable[[str], None] | None = None,
    progress: Progress = silent,
) -> None:
    """Run a little of everything that is compiled, the parts that are needed first before the others.

    The bundled site is read, reconstructed and written as its files are by the commands, because code is compiled for
    the kind of arrays that it gets.

    Parameters
    ----------
    models : the impact models to prepare; all that are compared by default without.
    ready : called with the name of each model when nothing that it runs needs to be compiled any more.
    """
    from ..analysis.preparation import prepare_fits, prepare_model
    from ..impact_models.registry import COMPARED

    names = COMPARED if models is None else tuple(models)
    total = len(names) + 4
    progress("Compiling", 0, total)
    plane = _prepare_places()
    progress("Compiling", 1, total)
    _prepare_tables()
    progress("Compiling", 2, total)
    prepare_fits()
    for done, name in enumerate(names, start=3):
        progress("Compiling", done, total)
        prepare_model(name)
        if ready is not None:
            ready(name)
    progress("Compiling", total - 1, total)
    _prepare_simulation(plane, names[0])


def _prepare_places() -> "Surface":
    import numpy as np

    from ..constants import GRAVITY_MPS2
    from ..georeference import GlobalShift
    from ..reconstruction.free_flight import fly
    from ..terrain.orientation import block_scale_normals
    from ..terrain.raycast import cast_ray, cast_rays, closest_point, closest_points
    from ..terrain.surface import Surface

    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    plane = Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), GlobalShift(), "plane", ())
    above = np.array([[0.5, 0.4, 1.0]])
    cast_rays(plane, above, np.array([[0.0, 0.0, -1.0]]))
    closest_points(plane, above)
    cast_ray(plane, above[0], (0.0, 0.0, -1.0))
    closest_point(plane, above[0])
    block_scale_normals(plane, above, 0.3)
    fly(above, above, np.ones(1), GRAVITY_MPS2, np.ones(1))
    return plane


def _prepare_tables() -> None:
    from ..exchange.project import read_project
    from ..exchange.tables import read_impacts, write_impacts, write_trajectories
    from ..reconstruction.sampling import STEP_S, sample_trajectories
    from ..workflow.opening import open_project

    surface, result = open_project(read_project(SITE / "project.toml"))
    with TemporaryDirectory(prefix="rockfall-") as folder:
        impacts = Path(folder) / "impacts.csv"
        write_impacts(result.impacts, impacts)
        read_impacts(impacts)
        write_trajectories(sample_trajectories(result, STEP_S, surface), Path(folder) / "trajectories.csv")


def _prepare_simulation(plane: "Surface", model: str) -> None:
    import numpy as np

    from ..simulation.engine import Settings, simulate
    from ..simulation.ground import make_ground
    from ..simulation.release import make_releases, placed_on

    ground = make_ground(plane)
    place = placed_on(ground, np.array([[0.5, 0.4]]), np.array([0.1]))
    simulate(ground, make_releases(place, diameter_m=0.1), Settings(model), threads=1)
