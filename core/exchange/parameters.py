# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of impact models in a TOML file: ``[models.NAME]`` and one line for each, as in comparison.toml."""

from collections.abc import Mapping
from pathlib import Path

import tomli_w

from ..errors import InputError
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..output import write_text
from ..reading import reader
from .toml_text import read_toml


def write_parameters(parameters: Mapping[str, Mapping[str, Value]], path: str | Path) -> None:
    """Write model → parameter → value.

    Raises
    ------
    InputError : the file cannot be written.
    """
    content = {"models": {name: dict(settings) for name, settings in parameters.items()}}
    write_text(path, tomli_w.dumps(content))


@reader("file of parameters")
def read_parameters(path: str | Path) -> dict[str, dict[str, Value]]:
    """Model → parameter → checked value; what else is in the file is not looked at.

    Raises
    ------
    InputError : the file cannot be read, is no TOML, has no models, an unknown model or parameter, a value out of
        range.
    """
    return checked_parameters(read_toml(Path(path), "file of parameters").get("models"), path)


def checked_parameters(models: object, path: str | Path) -> dict[str, dict[str, Value]]:
    """The tables [models.NAME] of a file, each value checked.

    Raises
    ------
    InputError : no such tables, an unknown model or parameter, a value out of range.
    """
    if not (isinstance(models, dict) and models and all(isinstance(table, dict) for table in models.values())):
        raise InputError("The file has no parameters", file=path, advice="It needs tables like [models.noel_2017]")
    try:
        return {
            name: {key: find_model(name).parameter(key).checked(value, name) for key, value in table.items()}
            for name, table in models.items()
        }
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error
