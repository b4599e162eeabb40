# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of impact models in a TOML file: ``[models.NAME]`` and one line for each, as in comparison.toml."""

import tomllib
from collections.abc import Mapping
from pathlib import Path

import tomli_w

from ..errors import InputError
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..output import write_text


def write_parameters(parameters: Mapping[str, Mapping[str, Value]], path: str | Path) -> None:
    """Write model → parameter → value.

    Raises
    ------
    InputError : the file cannot be written.
    """
    content = {"models": {name: dict(settings) for name, settings in parameters.items()}}
    write_text(path, tomli_w.dumps(content))


def read_parameters(path: str | Path) -> dict[str, dict[str, Value]]:
    """Model → parameter → checked value; what else is in the file is not looked at.

    Raises
    ------
    InputError : the file cannot be read, is no TOML, has no models, an unknown model or parameter, a value out of
        range.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"The parameters cannot be read ({error.strerror})", file=path, advice="Check the path"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"This is no TOML file ({error})", file=path, advice="Correct the line") from error
    return checked_parameters(content.get("models"), path)


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
