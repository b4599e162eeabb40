# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``rockfall calibrate`` and ``rockfall equivalent`` share: arguments, and the summary of fitted parameters."""

import argparse
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from .options import add_incident_options, whole

if TYPE_CHECKING:
    from ..analysis.estimation import Estimate, FitOptions, FittedModel
    from ..impact_models.machinery.base import ImpactModel

WIDTH = 100


def add_fit_arguments(parser: argparse.ArgumentParser, *, resamples: int, metavar: str, setting: str) -> None:
    """What is fitted, and how: `resamples` by default; `metavar` and `setting` describe ``--set``."""
    parser.add_argument(
        "--fit",
        action="extend",
        nargs="+",
        required=True,
        metavar="PARAMETER",
        help="parameters to fit; choices and switches by trying all (`rockfall models NAME` lists them)",
    )
    parser.add_argument(
        "--replicates", type=whole, default=16, metavar="N", help="draws of a random model per impact (default 16)"
    )
    parser.add_argument(
        "--resamples",
        type=whole,
        default=resamples,
        metavar="N",
        help="of the trajectories, for the intervals (default %(default)s)",
    )
    add_incident_options(parser)
    parser.add_argument("--set", action="extend", nargs="+", default=[], metavar=metavar, help=setting)


def fit_options(arguments: argparse.Namespace) -> "FitOptions":
    """From the arguments.

    Raises
    ------
    InputError : too few of anything.
    """
    from ..analysis.estimation import FitOptions

    return FitOptions(
        seed=arguments.seed,
        replicates=arguments.replicates,
        resamples=arguments.resamples,
        spin=arguments.spin,
        radius_m=arguments.radius,
    )


def parameter_names(model: "ImpactModel", texts: Iterable[str]) -> list[str]:
    """``PARAMETER`` or ``NAME.PARAMETER`` texts as names of parameters.

    Raises
    ------
    InputError : the model has none of this name.
    """
    return [model.parameter(text.removeprefix(f"{model.name}.")).name for text in texts]


def parameter_values(model: "ImpactModel", texts: Iterable[str]) -> dict[str, object]:
    """``PARAMETER=VALUE`` or ``NAME.PARAMETER=VALUE`` texts as parameter → checked value.

    Raises
    ------
    InputError : another form, unknown parameter, value out of range.
    """
    from ..impact_models.registry import parse_settings

    full = [text if text.startswith(f"{model.name}.") else f"{model.name}.{text}" for text in texts]
    return parse_settings(full).get(model.name, {})


def table_of(estimates: "Sequence[Estimate]") -> list[str]:
    """Fitted parameters for people: a line of numbers and the verdict below."""
    lines = [f"{'parameter':<22}{'default':>12}{'fitted':>12}   95 % interval"]
    for one in estimates:
        unit = f" {one.unit}" if one.unit else ""
        interval = "" if one.low != one.low else f"   {one.low:.4g} … {one.high:.4g}{unit}"
        lines.append(f"{one.name:<22}{_short(one.default):>12}{_short(one.value):>12}{interval}")
        lines += wrapped(one.verdict, "    ")
    return lines


def remarks_of(result: "FittedModel") -> list[str]:
    """What the result is worth, for people."""
    return [line for remark in result.remarks for line in wrapped(remark.text)]


def wrapped(text: str, indent: str = "") -> list[str]:
    """Lines of at most `WIDTH`."""
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent)


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"
