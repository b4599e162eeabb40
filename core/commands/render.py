# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall render``: a project → its film, through Blender."""

import argparse
from pathlib import Path

from ..film.engines import ENGINES
from ..film.presets import parse_frames
from .options import add_parameter_options, model_parameters
from .progress import PrintedProgress

FILM, STILL = "rockfall.mp4", "rockfall.png"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("project", metavar="PROJECT", type=Path, help="project.toml")
    parser.add_argument(
        "--preset",
        metavar="NAME",
        default="preview",
        help="of the project, or: preview (640×360, the default), hd (1920×1080)",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        default="film",
        help="folder for the film; made when it is missing (default %(default)s)",
    )
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default=None,
        help="Blender's render engine (default: the preset's; auto takes the quickest that works here)",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        action="append",
        default=[],
        help="show beside the real blocks those of an impact model, from the same impacts; may be given several times",
    )
    add_parameter_options(parser)
    parser.add_argument("--frames", metavar="A-B", type=parse_frames, help="only these frames; the first one is 0")
    parser.add_argument("--still", action="store_true", help="one picture instead: of the last frame, or of frame A")


def run(arguments: argparse.Namespace) -> int:
    """Render the film or the still; the models have the project's parameters where the command line gives none."""
    from ..exchange.output import output_folder
    from ..exchange.parameters import checked_parameters
    from ..exchange.project import read_project
    from ..film.job import FilmJob
    from ..film.maker import film_maker
    from ..film.presets import find_preset
    from ..impact_models.registry import find_model

    models = tuple(dict.fromkeys(find_model(name).name for name in arguments.model))
    project = read_project(arguments.project)
    known = checked_parameters(project.extra["models"], arguments.project) if "models" in project.extra else None
    parameters = model_parameters(arguments, models, known)
    preset = find_preset(project, arguments.preset)
    maker = film_maker()
    name = STILL if arguments.still else FILM
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        job = FilmJob(
            kind="still" if arguments.still else "film",
            source=arguments.project,
            out=folder.absolute() / name,
            engine=arguments.engine or preset.engine,
            preset=preset.name,
            frames=arguments.frames,
            models=models,
            parameters=parameters,
        )
        done = maker.film(job, progress)
    print(f"{preset.width}×{preset.height}, rendered with {done.engine.capitalize()}")
    print(f"Written: {Path(arguments.out) / name}")
    return 0
