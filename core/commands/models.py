# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall models``: the impact models, their parameters, units, ranges, defaults and sources."""

import argparse
from textwrap import wrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..impact_models.machinery.base import ImpactModel
    from ..impact_models.machinery.parameters import ParameterSpec

WIDTH = 96
NAME_WIDTH, VALUE_WIDTH, RANGE_WIDTH = 22, 12, 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("model", metavar="NAME", nargs="*", help="only these models (default: all)")


def run(arguments: argparse.Namespace) -> int:
    """Print the models."""
    from ..impact_models.registry import MODELS, find_model

    chosen = [find_model(name) for name in arguments.model] or list(MODELS.values())
    print(f"  {'parameter':<{NAME_WIDTH}}{'default':<{VALUE_WIDTH}}range\n")
    print("\n\n".join("\n".join(_sheet(model)) for model in chosen))
    print("\n* not verified against a text that was read")
    return 0


def _sheet(model: "ImpactModel") -> list[str]:
    traits = [
        "random parts" if model.is_random else "no random parts",
        "energy never grows" if model.energy_never_grows else "energy may grow",
        *(["needs measured impacts"] if model.draws_from_impacts else []),
    ]
    lines = [f"{model.name}: {model.title} ({', '.join(traits)})", *_wrapped(model.reference, 2)]
    for spec in model.parameters:
        lines += _rows(spec)
    return lines


def _rows(spec: "ParameterSpec") -> list[str]:
    unit = f" {spec.unit}" if spec.unit else ""
    default = f"{spec.default:g}{unit}" if isinstance(spec.default, float) else str(spec.default)
    mark = "" if spec.verified else "*"
    head = f"  {spec.name + mark:<{NAME_WIDTH}}{default:<{VALUE_WIDTH}}{spec.range_text:<{RANGE_WIDTH}}".rstrip()
    symbol = f"{spec.symbol}: " if spec.symbol else ""
    return [head, *_wrapped(f"{symbol}{spec.description} [{spec.source}]", 6)]


def _wrapped(text: str, indent: int) -> list[str]:
    return wrap(text, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * indent)
