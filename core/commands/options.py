# SPDX-License-Identifier: GPL-3.0-or-later
"""Arguments that several commands share."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..constants import UNITS_M
from ..errors import MOST_OF_PATH, DependencyError, InputError, RockfallError, readable
from ..plausibility import GREATEST_SEED

if TYPE_CHECKING:
    from ..exchange.database import Database
    from ..impact_models.machinery.measured import MeasuredRebounds
    from ..progress import Progress
    from ..reconstruction.impact import Impacts
    from ..terrain.opening import HowToRead
    from ..terrain.surface import Surface

FIGURE_FORMATS = ("png", "svg", "pdf")
"""The first is taken where none is asked for."""


def add_terrain_colours(parser: "argparse.ArgumentParser | argparse._ArgumentGroup") -> None:
    """Where a terrain that is shown has its colours from."""
    parser.add_argument(
        "--terrain-colours",
        metavar="auto|footage|scan|none",
        help="where the terrain has its colours from: the footage where that shows it, else the scan if it has colours "
        "(auto, the default); one of them; or light and shade only (none)",
    )


def positive(text: str) -> float:
    """A number above zero."""
    value = float(text)
    if not (isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is not a number above zero")
    return value


def not_negative(text: str) -> float:
    """A number of zero or more."""
    value = float(text)
    if not (isfinite(value) and value >= 0):
        raise argparse.ArgumentTypeError(f"{text} is not a number of zero or more")
    return value


def share(text: str) -> float:
    """A number between 0 and 1."""
    value = float(text)
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number between 0 and 1")
    return value


def whole(text: str) -> int:
    """A whole number of zero or more."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is not a whole number of zero or more")
    return int(text)


def seed(text: str) -> int:
    """A seed of random numbers."""
    if not text.isdecimal() or len(text) > 99 or int(text) > GREATEST_SEED:
        raise argparse.ArgumentTypeError(f"{text:.40} is not a whole number from 0 to {GREATEST_SEED} (2^63 - 1)")
    return int(text)


def whole_range(text: str) -> tuple[int, int]:
    """Two whole numbers above zero, the second not below the first: "51-100"."""
    first, dash, last = text.partition("-")
    if not (dash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
        raise argparse.ArgumentTypeError(f"{text} is not a range of whole numbers such as 51-100")
    return int(first), int(last)


def unit(text: str) -> float:
    """A unit's name, or its length in metres."""
    if text in UNITS_M:
        return UNITS_M[text]
    try:
        return positive(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is neither {', '.join(UNITS_M)} nor a number of metres") from None


def known_names(text: str, known: Sequence[str], option: str) -> tuple[str, ...]:
    """The names of a comma-separated list, each once; "none" is an empty list.

    Raises
    ------
    InputError : a name that is not among the known ones.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    for name in [] if names == ["none"] else names:
        if name not in known:
            near = get_close_matches(name, known, n=1, cutoff=0.5)
            hint = f"Did you mean {near[0]}? " if near else ""
            raise InputError(f"{option} has '{name}'", advice=f"{hint}Choose from {', '.join(known)}, or none")
    return () if names == ["none"] else tuple(dict.fromkeys(names))


def add_out(parser: argparse.ArgumentParser) -> None:
    """``--out DIR``."""
    parser.add_argument("--out", metavar="DIR", required=True, help="folder for the output; made when it is missing")


def add_fps(parser: Any) -> None:
    """``--fps HZ``."""
    parser.add_argument(
        "--fps", type=positive, metavar="HZ", help="pictures a second of a sequence of pictures; a video has its own"
    )


@contextmanager
def naming(file: str) -> Iterator[None]:
    """Errors about what was read from a file name it."""
    try:
        yield
    except InputError as error:
        if error.file is not None:
            raise
        raise InputError(
            error.problem, file=file, row=error.row, trajectory=error.trajectory, advice=error.advice
        ) from error
    except DependencyError:
        raise
    except RockfallError as error:
        raise RockfallError(f"{readable(file, MOST_OF_PATH)}: {error}") from error


def add_motion_options(group: "argparse._ArgumentGroup") -> None:
    """How simulated blocks move between and after their impacts."""
    group.add_argument("--drag", action="store_true", help="drag of air, in flight and on the ground")
    group.add_argument(
        "--rolling",
        choices=("azzoni_1995", "coulomb", "none"),
        help="on the ground: rolling (default), sliding, or a stop where a block would begin to",
    )
    group.add_argument("--friction", type=not_negative, metavar="MU", help="of either (default 0.5)")


def add_terrain_files(group: "argparse._ActionsContainer", text: str) -> None:
    """``--terrain FILE …``: several files after one another, or the option again."""
    group.add_argument(
        "--terrain",
        action="extend",
        nargs="+",
        default=[],
        metavar="FILE",
        help=f"{text}; several tiles become one terrain",
    )


def add_terrain_options(parser: argparse.ArgumentParser) -> None:
    """How to read a terrain file."""
    group = parser.add_argument_group("reading the terrain")
    group.add_argument("--up", choices=("auto", "z", "y"), default="auto", help="axis of the file that points up")
    group.add_argument(
        "--unit",
        type=unit,
        metavar="UNIT",
        help=f"of the file's coordinates: {', '.join(UNITS_M)}, or its length in metres (default: as the file's "
        "coordinate system says, else m)",
    )
    group.add_argument(
        "--height-unit",
        type=unit,
        metavar="UNIT",
        help="of the file's heights, where it is another one (default: as --unit, or as the file says)",
    )
    group.add_argument(
        "--max-edge",
        type=positive,
        metavar="M",
        help="longest triangle edge where points are meshed [m]",
    )
    points = group.add_mutually_exclusive_group()
    points.add_argument(
        "--ground-only",
        dest="ground_only",
        action="store_true",
        default=None,
        help="use the points that are classified as ground (default: when there are any)",
    )
    points.add_argument(
        "--ground-filter",
        type=positive,
        nargs="?",
        const=1.0,
        metavar="M",
        help="take vegetation out of a cloud that nobody has classified: a cloth with cells of M metres (default 1) "
        "laid on it from below",
    )
    points.add_argument("--all-points", dest="ground_only", action="store_false", help="use the points of every class")


def refuse_terrain_options(arguments: argparse.Namespace, why: str, advice: str) -> None:
    """Refuse the options of `add_terrain_options` where they would change nothing.

    Raises
    ------
    InputError : one is given.
    """
    options = {"--up": ("auto",), "--unit": (1.0,), "--max-edge": (), "--ground-filter": ()}
    given = [
        option
        for option, defaults in options.items()
        if getattr(arguments, option.strip("-").replace("-", "_")) not in (None, *defaults)
    ]
    given += [] if arguments.ground_only is None else ["--ground-only" if arguments.ground_only else "--all-points"]
    if given:
        raise InputError(f"{given[0]} tells how to read a terrain, and {why}", advice=advice)


NO_TERRAIN = "no terrain is read", "Give it with --terrain, or leave the option out"
OF_PROJECT = "a project says itself how to read its own", "Write it into [terrain] of the project"


def terrain_as_asked(arguments: argparse.Namespace, files: Sequence[str], progress: "Progress") -> "Surface":
    """Read a terrain, of one file or several, with the options of `add_terrain_options`.

    Raises
    ------
    InputError : see `read_tiles`.
    """
    from ..terrain.readers import read_tiles

    return read_tiles(files, reading_as_asked(arguments), max_edge_m=arguments.max_edge, progress=progress)


def reading_as_asked(arguments: argparse.Namespace) -> "HowToRead":
    """What the options of `add_terrain_options` say of any file, for the readers."""
    from ..terrain.opening import HowToRead

    return HowToRead(
        arguments.up,
        arguments.unit,
        arguments.ground_only,
        arguments.ground_filter,
        height_unit_m=arguments.height_unit,
    )


def add_incident_options(parser: argparse.ArgumentParser) -> None:
    """What the models are told of the incident block, and the seed of their chance."""
    parser.add_argument("--seed", type=seed, default=0, metavar="S", help="of the random numbers (default 0)")
    parser.add_argument(
        "--spin",
        choices=("rolling", "zero", "table"),
        default="rolling",
        help="of a block before its first impact: rolling (default) or none; table: measured at every impact",
    )
    parser.add_argument(
        "--radius", type=positive, metavar="M", help="of the block [m] (default: half the table's diameter)"
    )


def add_figure_options(parser: argparse.ArgumentParser, without: str = "no figures") -> None:
    """``--format`` and ``--tables-only``."""
    parser.add_argument(
        "--format",
        action="extend",
        nargs="+",
        choices=FIGURE_FORMATS,
        help=f"of the figures, one or several (default: {FIGURE_FORMATS[0]})",
    )
    parser.add_argument("--tables-only", action="store_true", help=without)


def figure_formats(arguments: argparse.Namespace) -> tuple[str, ...]:
    """What ``--format`` says."""
    return tuple(dict.fromkeys(arguments.format or FIGURE_FORMATS[:1]))


def add_site_option(parser: argparse.ArgumentParser) -> None:
    """``--site NAME …``."""
    parser.add_argument(
        "--site", action="extend", nargs="+", default=[], metavar="NAME", help="of each table whose rows name none"
    )


def add_where_option(parser: argparse.ArgumentParser) -> None:
    """``--where CONDITION …``."""
    parser.add_argument(
        "--where",
        action="extend",
        nargs="+",
        default=[],
        metavar="CONDITION",
        help="only rows such as 'theta1_deg<20', 'site=Gully', 'flags!=doubtful'; all must hold",
    )


def for_each(values: list[str], tables: Sequence[str], option: str) -> list[str]:
    """The value of an option for each of some tables.

    Raises
    ------
    InputError : it is given neither once nor once for each.
    """
    if len(values) not in (0, 1, len(tables)):
        raise InputError(
            f"{option} is given {len(values)} times for {len(tables)} tables", advice="Give one, or one each"
        )
    return (values or [""]) * len(tables) if len(values) < 2 else values


def tables_as_asked(
    arguments: argparse.Namespace, tables: Sequence[str], progress: "Progress", licences: Sequence[str] | None = None
) -> "list[Database]":
    """Read tables of impacts, or packages that were merged before, with the option of `add_site_option`.

    Raises
    ------
    InputError : see `read_source` and `read_package`.
    """
    from ..exchange.database import read_source
    from ..exchange.datapackage import read_package

    sites = for_each(arguments.site, tables, "--site")
    parts = []
    for path, site, licence in zip(tables, sites, licences or [""] * len(tables), strict=True):
        progress(f"Reading {path}", 0, 0)
        package = Path(path).is_dir() or Path(path).suffix == ".json"
        parts.append(read_package(path) if package else read_source(path, site, licence))
    return parts


def impacts_as_asked(file: str) -> "Impacts":
    """Read impacts.csv, or reconstruct those of a project.

    Raises
    ------
    RockfallError : see `read_impacts` and `open_project`.
    """
    from ..exchange.project import read_project
    from ..exchange.saved_blend import is_project
    from ..exchange.tables import read_impacts
    from ..workflow.opening import open_project

    if not is_project(file):
        return read_impacts(file)
    with naming(file):
        return open_project(read_project(file))[1].impacts


def add_model_option(parser: argparse.ArgumentParser, text: str, flag: str = "--model") -> None:
    """``--model NAME …``: several names after one another, or the option again."""
    parser.add_argument(
        flag,
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME",
        help=f"{text}; several, or given again. `rockfall models` lists all",
    )


def models_as_asked(names: Sequence[str], default: Sequence[str] = (), flag: str = "--model") -> tuple[str, ...]:
    """The models that `add_model_option` names, each once; without any those of `default`.

    Raises
    ------
    InputError : there is no such model; the nearest is suggested.
    """
    from ..impact_models.registry import find_model

    for name in names:
        if Path(name).suffix:
            raise InputError(f"{flag} takes {name} for a model", advice=f"Write the file before {flag}")
    return tuple(dict.fromkeys(find_model(name).name for name in names or default))


def add_observed_option(parser: argparse.ArgumentParser, default: str) -> None:
    """``--observed FILE``."""
    parser.add_argument(
        "--observed",
        metavar="FILE",
        help=f"impacts.csv, of this site or merged, that the model observed draws from ({default})",
    )


def measured_as_asked(
    arguments: argparse.Namespace, models: Sequence[str], *, needed: bool = False
) -> "MeasuredRebounds | None":
    """What ``--observed`` gives to draw from; None without it.

    Parameters
    ----------
    needed : whether a model that draws from measured impacts cannot do without.

    Raises
    ------
    InputError : the table is wrong or has too few impacts, or no model draws from it; there is none where it is needed.
    """
    from ..analysis.measured_rebounds import measured_rebounds
    from ..exchange.tables import read_impacts
    from ..impact_models.registry import find_model

    drawing = [name for name in models if find_model(name).draws_from_impacts]
    if arguments.observed is None:
        if drawing and needed:
            raise InputError(
                f"The model {drawing[0]} draws from measured impacts, and there are none",
                advice="Give the site's impacts.csv, or a merged one: --observed impacts.csv",
            )
        return None
    if not drawing:
        raise InputError("--observed gives measured impacts, which no model draws from", advice="Add --model observed")
    with naming(arguments.observed):
        return measured_rebounds(read_impacts(arguments.observed))


def add_parameter_options(parser: argparse.ArgumentParser) -> None:
    """``--set`` and ``--parameters``."""
    parser.add_argument(
        "--set",
        action="extend",
        nargs="+",
        default=[],
        metavar="NAME.PARAMETER=VALUE",
        help="a parameter that is not to have its default",
    )
    parser.add_argument(
        "--parameters", metavar="FILE", help="parameters as saved by explore and calibrate; --set goes before them"
    )


def model_parameters(
    arguments: argparse.Namespace, models: Sequence[str], known: "Mapping[str, Mapping[str, Any]] | None" = None
) -> dict[str, dict[str, Any]]:
    """Parameters of the models: from ``--set``, else from ``--parameters``, else those already known.

    Raises
    ------
    InputError : a parameter that is wrong, or of a model that is not among the models.
    """
    from ..exchange.parameters import read_parameters
    from ..impact_models.registry import parse_settings

    typed = parse_settings(arguments.set)
    idle = [name for name in typed if name not in models]
    if idle:
        raise InputError(f"--set gives parameters of {idle[0]}, which is not used", advice=f"Add --model {idle[0]}")
    read = read_parameters(arguments.parameters) if arguments.parameters else {}
    merged: dict[str, dict[str, Any]] = {}
    for layer in (known or {}, read, typed):
        for name in models:
            if name in layer:
                merged.setdefault(name, {}).update(layer[name])
    return merged
