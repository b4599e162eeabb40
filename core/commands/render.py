# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall render``: a project → its film, through Blender."""

import argparse
from pathlib import Path

from ..errors import InputError
from ..film.engines import ENGINES, MEASURED
from ..film.job import AS_SET_UP, BLEND, GRAPH_KINDS, Kind
from ..film.presets import parse_frames
from ..film.simulated import NUMBER, check_number
from . import render_film
from .options import add_model_option, add_parameter_options, model_parameters, models_as_asked, naming, seed, whole
from .progress import PrintedProgress

FILES = {"film": "rockfall.mp4", "still": "rockfall.png", "slope": "slope.png"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "project", metavar="PROJECT", type=Path, help="project.toml; or a .blend, for the film as its step Film says"
    )
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help="of the project, or: preview (640×360, the default), 720p, hd (1920×1080), 4k",
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
    add_model_option(parser, "show beside the real blocks those of impact models, from the same impacts")
    add_model_option(
        parser,
        "let blocks of impact models fall beside the real ones, from the same starts to their ends",
        "--simulate",
    )
    parser.add_argument(
        "--number", type=whole, metavar="N", help=f"simulated blocks for each real one and model (default {NUMBER})"
    )
    parser.add_argument("--seed", type=seed, metavar="S", help="of the simulation's random numbers (default 0)")
    add_parameter_options(parser)
    parser.add_argument(
        "--graphs",
        choices=GRAPH_KINDS,
        help="graphs beside the slope that follow the film's time: of the impacts, whose points appear as they happen, "
        "or of the motion (speed, height above ground, energy)",
    )
    parser.add_argument("--frames", metavar="A-B", type=_frames, help="only these frames; the first one is 0")
    render_film.add_arguments(parser)
    picture = parser.add_mutually_exclusive_group()
    picture.add_argument(
        "--still",
        action="store_true",
        help="one picture instead: of the last frame (with --film of the middle one), or of frame A",
    )
    picture.add_argument("--slope", action="store_true", help="one picture instead: of the whole slope with all paths")


def run(arguments: argparse.Namespace) -> int:
    """Render the film or the still; the models have the project's parameters where the command line gives none."""
    from ..exchange.parameters import checked_parameters
    from ..exchange.project import read_project
    from ..film.job import FilmJob
    from ..film.maker import film_maker
    from ..film.presets import PREVIEW, find_preset
    from ..output import output_folder

    if arguments.film is not None:
        return render_film.run(arguments)
    render_film.refuse_without_film(arguments)
    if arguments.project.suffix.lower() == BLEND:
        return _render_scene(arguments)
    models = models_as_asked(arguments.model)
    simulate = models_as_asked(arguments.simulate, flag="--simulate")
    if models and simulate:
        raise InputError(
            "--model and --simulate would show two kinds of blocks in the same colours",
            advice="Make a film of each: --model flies from impact to impact, --simulate falls to the end",
        )
    if arguments.graphs and arguments.slope:
        raise InputError(
            "--graphs follow the time of a film, and --slope is a picture of all moments",
            advice="Leave out one of them; --still makes a picture of a moment, with graphs",
        )
    if not simulate and (arguments.number is not None or arguments.seed is not None):
        raise InputError("--number and --seed are of simulated blocks", advice="Add --simulate and a model")
    number = NUMBER if arguments.number is None else arguments.number
    check_number(number, len(simulate))
    project = read_project(arguments.project)
    if simulate and project.terrain is None:
        raise InputError(
            "Simulated blocks fall on a terrain, and the project names none",
            file=arguments.project,
            advice='Add [terrain] file = "…" to it',
        )
    known = checked_parameters(project.extra["models"], arguments.project) if "models" in project.extra else None
    parameters = model_parameters(arguments, models or simulate, known)
    with naming(str(arguments.project)):
        preset = find_preset(project, arguments.preset or PREVIEW.name)
    maker = film_maker()
    kind: Kind = "slope" if arguments.slope else "still" if arguments.still else "film"
    name = FILES[kind]
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        job = FilmJob(
            kind=kind,
            source=arguments.project,
            out=folder.absolute() / name,
            engine=arguments.engine or preset.engine,
            preset=preset.name,
            frames=arguments.frames,
            models=models,
            simulate=simulate,
            number=number,
            seed=arguments.seed or 0,
            parameters=parameters,
            graphs=arguments.graphs,
        )
        done = maker.film(job, progress)
    for remark in done.remarks:
        print(remark)
    engine = "cycles" if done.engine == MEASURED and kind != "film" else done.engine
    said = "" if engine == MEASURED else f", rendered with {engine.capitalize()}"
    print(f"{preset.width}×{preset.height}{said}")
    print(f"Written: {Path(arguments.out) / name}")
    return 0


def _frames(text: str) -> tuple[int, int]:
    try:
        return parse_frames(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text} is no frame, and no range of frames such as 25-50") from error


def _render_scene(arguments: argparse.Namespace) -> int:
    """Render the film, or a still of it, that a .blend says."""
    from ..film.job import FilmJob
    from ..film.maker import film_maker
    from ..output import output_folder

    source = arguments.project
    others = ("preset", "model", "simulate", "number", "seed", "set", "parameters", "graphs", "slope")
    given = [f"--{name}" for name in others if getattr(arguments, name, None)]
    if given:
        raise InputError(
            f"{given[0]} is of a project; a .blend has its own film", file=source, advice="Set it in Blender, and save"
        )
    if not source.is_file():
        raise InputError("There is no such file", file=source)
    kind: Kind = "still" if arguments.still else "film"
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        out = folder.absolute() / FILES[kind]
        job = FilmJob(kind, source, out, arguments.engine or AS_SET_UP, frames=arguments.frames)
        film_maker().film(job, progress)
    print(f"Written: {Path(arguments.out) / FILES[kind]}")
    return 0
