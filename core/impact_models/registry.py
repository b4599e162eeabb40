# SPDX-License-Identifier: GPL-3.0-or-later
"""The models by name. A module of this package that defines ``MODEL`` is one: a new model is one file.

Only models that go from an imposed incident velocity to an outgoing one belong here. A contact law that needs the
block's shape and the time that the contact takes (RAMMS::ROCKFALL; Leine et al. 2014) is no such model: the velocity
after the impact depends on what the block's corners touch meanwhile.
"""

from collections.abc import Iterable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from ..errors import InputError
from .machinery.base import ImpactModel
from .machinery.parameters import suggestion


def _found() -> dict[str, ImpactModel]:
    package = __package__ or ""
    path = import_module(package).__path__
    names = sorted(module.name for module in iter_modules(path) if module.name != __name__.rpartition(".")[2])
    models = [getattr(import_module(f"{package}.{name}"), "MODEL", None) for name in names]
    return {model.name: model for model in models if isinstance(model, ImpactModel)}


MODELS: Mapping[str, ImpactModel] = MappingProxyType(_found())
"""Name → model, by name."""

COMPARED = tuple(model.name for model in MODELS.values() if model.compared)
"""The models that are compared when none are chosen, by name: the six that Noël et al. 2018 compare, in their order."""

FORMULAS = tuple(model.name for model in MODELS.values() if not model.draws_from_impacts)
"""The models that need no measured impacts, by name."""


def find_model(name: str) -> ImpactModel:
    """The model of a name.

    Raises
    ------
    InputError : there is none; the nearest is suggested.
    """
    if name in MODELS:
        return MODELS[name]
    raise InputError(f"There is no impact model {name!r}", advice=suggestion(name, MODELS))


def parse_settings(texts: Iterable[str]) -> dict[str, dict[str, object]]:
    """``NAME.PARAMETER=VALUE`` texts as model → parameter → checked value.

    Raises
    ------
    InputError : another form, unknown model or parameter, value out of range.
    """
    settings: dict[str, dict[str, object]] = {}
    for text in texts:
        place, equals, value = text.partition("=")
        name, point, parameter = place.strip().partition(".")
        if not (equals and point and name and parameter and value.strip()):
            raise InputError(
                f"{text!r} does not set a parameter",
                advice="Write NAME.PARAMETER=VALUE, for example azimi_desvarreux_1977.rn=0.35",
            )
        model = find_model(name)
        settings.setdefault(name, {})[parameter] = model.parameter(parameter).checked(value.strip(), name)
    return settings
