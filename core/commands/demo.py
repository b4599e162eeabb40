# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall demo``: the whole job on the bundled site, from timed picks to tables, a picture and a film."""

import argparse
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ..film.engines import ENGINES
from ..formats.csv_cells import CellWriter
from ..output import output_stream
from ..reconstruction.sampling import STEP_S
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..reconstruction.trajectory import Reconstruction
    from ..terrain.surface import Surface

SITE = Path(__file__).parents[2] / "assets" / "demo"
FILES = {
    "impacts.csv": "each impact: velocities before and after, restitution coefficients, angles",
    "trajectories.csv": f"position, speed and height above ground every {STEP_S:g} s",
    "statistics.csv": "the statistics of Noël et al. 2018 for these impacts",
    "accuracy.csv": "how far all this is from the truth, which is known for this synthetic site",
    "slope.png": "the slope, shaded, with all trajectories coloured by speed",
    "rockfall.mp4": "the film: the blocks bouncing down",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--out", metavar="DIR", default="rockfall-demo", help="folder for the output (default %(default)s)"
    )
    parser.add_argument("--no-film", action="store_true", help="tables only: neither the picture nor the film")
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default="auto",
        help="Blender's render engine (default auto: the quickest that works here)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Do it all, say what comes out, and list the files."""
    from ..analysis.statistics import impact_statistics
    from ..analysis.truth import compare_with_truth, read_truth, truth_sentences
    from ..exchange.project import read_project
    from ..film.job import FilmJob
    from ..film.maker import film_maker
    from ..output import output_folder
    from ..reconstruction.summary import summarise
    from ..workflow.opening import open_project

    maker = None if arguments.no_film else film_maker()  # what is missing is told before the work, not after
    project = read_project(SITE / "project.toml")
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        _say("The site", [f"{project.site.name}. {project.site.description}."])
        surface, result = open_project(project)
        _write_tables(result, surface, folder)
        _say("From timed picks to impacts", summarise(result)[:2])
        statistics = impact_statistics(result.impacts)
        _write(folder / "statistics.csv", ("name", "value", "unit", "note"), statistics.as_rows())
        _say("Statistics, as in Noël et al. 2018", map(str, statistics.remarks()))
        deviations = compare_with_truth(result.impacts, read_truth(SITE / "truth.csv"))
        columns = ("name", "unit", "n", "median", "p90", "bias", "typical")
        rows = ([getattr(one, column) for column in columns] for one in deviations)
        _write(folder / "accuracy.csv", ("quantity", *columns[1:]), rows)
        _say("How good that is", truth_sentences(deviations))
        if maker is not None:
            _say("Picture and film", ["Rendered by Blender; the film takes one to three minutes on two cores."])
            common = {"source": SITE / "project.toml", "engine": arguments.engine}
            done = maker.film(
                FilmJob(kind="slope", out=folder.absolute() / "slope.png", preset="hd", **common), progress
            )
            film = FilmJob(kind="film", out=folder.absolute() / "rockfall.mp4", preset="preview", **common)
            remarks = maker.film(film.with_engine(done.engine), progress).remarks
            if remarks:
                _say("How the film was made", remarks)
        written = [name for name in FILES if (folder / name).exists()]
    print(f"Written to {arguments.out}:")
    for name in written:
        print(f"  {name:<18}{FILES[name]}")
    return 0


def _write_tables(result: "Reconstruction", surface: "Surface | None", folder: Path) -> None:
    from ..exchange.tables import write_impacts, write_trajectories
    from ..reconstruction.sampling import sample_trajectories

    write_impacts(result.impacts, folder / "impacts.csv")
    write_trajectories(sample_trajectories(result, STEP_S, surface), folder / "trajectories.csv")


def _write(path: Path, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    with output_stream(path) as file:
        writer = CellWriter(file)
        writer.writerow(columns)
        writer.writerows(rows)


def _say(title: str, sentences: Iterable[str]) -> None:
    print(f"{title}")
    for sentence in sentences:
        print(textwrap.fill(sentence, 110, initial_indent="  ", subsequent_indent="  "))
    print(flush=True)
