# SPDX-License-Identifier: GPL-3.0-or-later
"""The models' parameters as properties that a person edits, made from their specifications.

They hold nothing themselves: they read and write the scene's one set of parameters (`models.parameters_of`).
"""

from collections.abc import Callable, Iterable

import bpy
from bpy.props import EnumProperty, FloatProperty, PointerProperty

from ...core.errors import RockfallError
from ...core.impact_models.machinery.base import ImpactModel
from ...core.impact_models.machinery.parameters import ParameterSpec, Value
from ...core.impact_models.registry import MODELS
from . import comparison, models, store, sync

LARGEST = 1e30  # of a single-precision property


def value_of(scene: bpy.types.Scene, model: str, spec: ParameterSpec) -> Value:
    """The scene's value of a parameter."""
    own = models.parameters_of(scene).get(model, {})
    if spec.name in own:
        return own[spec.name]
    if spec.follows is not None:
        choice = MODELS[model].parameter(spec.follows[0])
        return spec.follows[1][choice.choices.index(str(value_of(scene, model, choice)))]
    return spec.default


def is_own(scene: bpy.types.Scene, model: str, name: str) -> bool:
    """Whether the scene has another value than the default."""
    return name in models.parameters_of(scene).get(model, {})


def keep(scene: bpy.types.Scene, model: str, name: str, value: Value | None) -> None:
    """Give a parameter a value; None gives it its default again."""
    parameters = models.parameters_of(scene)
    own = parameters.setdefault(model, {})
    own.pop(name, None)
    spec = MODELS[model].parameter(name)
    if value is not None and (value != spec.default or spec.follows is not None):
        own[name] = value
    models.keep_parameters(scene, {name: values for name, values in parameters.items() if values})
    follow(scene, [model])


def follow(scene: bpy.types.Scene, changed: Iterable[str]) -> None:
    """Bring the blocks of these models in the 3-D view in line; where that cannot be, everything, which says why."""
    try:
        for model in changed:
            comparison.follow_parameters(scene, model)
    except RockfallError:
        sync.recompute(scene)


def tooltip(spec: ParameterSpec) -> str:
    """What the parameter is, its range, its default and where that is from."""
    sentences = [f"{spec.description[:1].upper()}{spec.description[1:]}"]
    if not spec.choices:
        unit = f" {spec.unit}" if spec.unit else ""
        sentences.append(f"{spec.range_text}{unit}, default {spec.default:g}{unit}")
    else:
        sentences.append(f"Default: {spec.default}")
    sentences.append(spec.source if spec.verified else f"{spec.source}, not checked against the text")
    return ". ".join(sentences)


def label(spec: ParameterSpec) -> str:
    """The parameter's name for people, with its symbol and unit."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    return f"{spec.symbol or spec.name.replace('_', ' ')}{unit}"


def _group(model: ImpactModel) -> type[bpy.types.PropertyGroup]:
    fields = {spec.name: _property(model.name, spec) for spec in model.parameters}
    name = f"Parameters_{model.name}"
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": fields, "__module__": __name__})


def _property(model: str, spec: ParameterSpec) -> object:
    get, keep_value = _reader(model, spec), _writer(model, spec)
    words = {"name": label(spec), "description": tooltip(spec)}
    if spec.choices:
        items = [(choice, choice, "") for choice in spec.choices]
        return EnumProperty(
            **words,
            items=items,
            get=lambda self: spec.choices.index(str(get(self))),
            set=lambda self, place: keep_value(self, spec.choices[place]),
        )
    return FloatProperty(
        **words,
        min=max(spec.minimum, -LARGEST),
        max=min(spec.maximum, LARGEST),
        step=max(1.0, min(spec.maximum - spec.minimum, 100.0)),
        precision=3,
        get=lambda self: float(get(self)),
        set=lambda self, value: keep_value(self, _within(spec, store.double(value))),
    )


def _within(spec: ParameterSpec, value: float) -> float:
    return min(max(value, spec.minimum), spec.maximum)


def _reader(model: str, spec: ParameterSpec) -> Callable[[bpy.types.PropertyGroup], Value]:
    return lambda group: value_of(group.id_data, model, spec)


def _writer(model: str, spec: ParameterSpec) -> Callable[[bpy.types.PropertyGroup, Value], None]:
    return lambda group, value: keep(group.id_data, model, spec.name, value)


GROUPS = {name: _group(model) for name, model in MODELS.items()}

AllParameters = type(
    "AllParameters",
    (bpy.types.PropertyGroup,),
    {"__annotations__": {name: PointerProperty(type=group) for name, group in GROUPS.items()}, "__module__": __name__},
)

CLASSES = (*GROUPS.values(), AllParameters)


def register() -> None:
    bpy.types.Scene.rockfall_parameters = PointerProperty(type=AllParameters)


def unregister() -> None:
    del bpy.types.Scene.rockfall_parameters
