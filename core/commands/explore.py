# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall explore``: the live page on this machine, with a slider for every parameter."""

import argparse
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from signal import SIGINT
from typing import TYPE_CHECKING

from ..errors import InputError
from ..interrupts import Interrupt
from .options import add_incident_options, add_model_option, models_as_asked, naming, whole
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..impact_models.machinery.parameters import Value


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("impacts", metavar="IMPACTS", help="impacts.csv")
    add_model_option(parser, "models to offer (default: the six of Noël et al. 2018)")
    parser.add_argument("--parameters", metavar="FILE", help="parameters to start with, as saved by this command")
    parser.add_argument(
        "--save", metavar="FILE", help="where Save writes the parameters (default: parameters.toml beside IMPACTS)"
    )
    add_incident_options(parser)
    parser.add_argument(
        "--port", type=whole, default=0, metavar="N", help="on this machine (default: one that is free)"
    )
    parser.add_argument("--title", default="", metavar="TEXT", help="heading of the page")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until interrupted or asked to end."""
    from ..analysis.courses import find_courses
    from ..analysis.explorer import Exploration, serve
    from ..exchange.parameters import read_parameters, write_parameters
    from ..exchange.tables import read_impacts
    from ..extras import PAGES, demand
    from ..impact_models.registry import COMPARED

    demand(PAGES)
    if arguments.port > 65535:
        raise InputError(f"There is no port {arguments.port}", advice="Take one up to 65535, or leave --port out")
    given = read_parameters(arguments.parameters) if arguments.parameters else {}
    models = models_as_asked(arguments.model, (*COMPARED, *given))
    target = Path(arguments.save or Path(arguments.impacts).with_name("parameters.toml")).absolute()

    def save(settings: "Mapping[str, Mapping[str, Value]]") -> str:
        write_parameters(settings, target)
        return str(target)

    def ready(address: str) -> None:
        print(f"Explore the impact models at {address}\nStop with Ctrl-C.", flush=True)
        if not arguments.no_browser:
            webbrowser.open(address)

    with PrintedProgress() as progress, naming(arguments.impacts):
        progress(f"Reading {arguments.impacts}")
        impacts = read_impacts(arguments.impacts)
        courses = find_courses(impacts, arguments.spin, arguments.radius)
    try:
        serve(
            Exploration(
                impacts,
                courses,
                models,
                save,
                given,
                arguments.seed,
                Path(arguments.impacts).name,
                arguments.title,
                shown=models if arguments.model else (),
            ),
            arguments.port,
            ready,
        )
    except KeyboardInterrupt as error:
        if isinstance(error, Interrupt) and error.number != SIGINT:
            raise
        print("\nStopped.")
    return 0
