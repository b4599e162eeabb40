# SPDX-License-Identifier: GPL-3.0-or-later
"""The models' parameters as properties that a person edits, made from their specifications.

They hold nothing themselves: they read and write the sets of parameters (`models.parameters_of`).
"""

from collections.abc import Callable, Iterable, Mapping

import bpy
from bpy.props import EnumProperty, FloatProperty, PointerProperty

from ....core.errors import RockfallError
from ....core.impact_models.machinery.base import ImpactModel
from ....core.impact_models.machinery.parameters import ParameterSpec, Value
from ....core.impact_models.machinery.sliders import slider_range
from ....core.impact_models.presets import Preset
from ....core.impact_models.registry import MODELS, find_model
from ..footage import sync
from ..storage import store
from . import comparison, models

LARGEST = 1e30  # of a single-precision property


def value_of(scene: bpy.types.Scene, model: str, spec: ParameterSpec, which: str = "A") -> Value:
    """The value of a parameter in a set of parameters."""
    own = models.parameters_of(scene, which).get(model, {})
    if spec.name in own:
        return own[spec.name]
    if spec.follows is not None:
        choice = MODELS[model].parameter(spec.follows[0])
        return spec.follows[1][choice.choices.index(str(value_of(scene, model, choice, which)))]
    return spec.default


def is_own(scene: bpy.types.Scene, model: str, name: str, which: str = "A") -> bool:
    """Whether a set of parameters has another value than the default."""
    return name in models.parameters_of(scene, which).get(model, {})


def keep(scene: bpy.types.Scene, model: str, values: Mapping[str, Value | None], which: str = "A") -> None:
    """Give parameters of a model values; None gives the default again."""
    parameters = models.parameters_of(scene, which)
    own = parameters.setdefault(model, {})
    for name, value in values.items():
        own.pop(name, None)
        spec = find_model(model).parameter(name)
        if value is not None and (value != spec.default or spec.follows is not None):
            own[name] = value
    keep_all(scene, parameters, which, [model])


def keep_all(
    scene: bpy.types.Scene,
    parameters: Mapping[str, Mapping[str, Value]],
    which: str = "A",
    changed: Iterable[str] | None = None,
) -> None:
    """Store a set of parameters, and let the blocks of the models follow.

    changed : models that have changed; None for all.
    """
    models.keep_parameters(scene, {name: values for name, values in parameters.items() if values}, which)
    if which == "A":
        follow(scene, models.shown_models(scene) if changed is None else changed)


def use_preset(scene: bpy.types.Scene, preset: Preset, which: str = "A") -> None:
    """Give a model the published values for a kind of ground; what follows them has its default again."""
    followers = [spec.name for spec in MODELS[preset.model].parameters if spec.follows]
    led = {name: None for name in followers if MODELS[preset.model].parameter(name).follows[0] in preset.values}
    keep(scene, preset.model, {**led, **preset.values}, which)


def has_preset(scene: bpy.types.Scene, preset: Preset, which: str = "A") -> bool:
    """Whether a model has the values of a preset."""
    now = MODELS[preset.model].settings(models.parameters_of(scene, which).get(preset.model))
    wanted = MODELS[preset.model].settings(preset.values)
    led = [spec.name for spec in MODELS[preset.model].parameters if spec.follows and spec.follows[0] in preset.values]
    return all(now[name] == wanted[name] for name in (*preset.values, *led))


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
    name, unit = spec.name.replace("_", " "), f" [{spec.unit}]" if spec.unit else ""
    said = spec.symbol.replace("_", "").lower() == spec.name.replace("_", "")
    return f"{spec.symbol if said else f'{name} {spec.symbol}'.strip()}{unit}"


def group_of(scene: bpy.types.Scene, model: str, which: str = "A") -> bpy.types.PropertyGroup:
    """The parameters of a model in a set, as properties by their names."""
    whole = scene.rockfall_parameters if which == "A" else scene.rockfall_other_parameters
    return getattr(whole, model)


def _group(model: ImpactModel, which: str) -> type[bpy.types.PropertyGroup]:
    fields = {spec.name: _property(model.name, spec, which) for spec in model.parameters}
    name = f"Parameters{which}_{model.name}"
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": fields, "__module__": __name__})


def _property(model: str, spec: ParameterSpec, which: str) -> object:
    get, keep_value = _reader(model, spec, which), _writer(model, spec, which)
    words = {"name": label(spec), "description": tooltip(spec)}
    if spec.choices:
        items = [(choice, choice, "") for choice in spec.choices]
        return EnumProperty(
            **words,
            items=items,
            get=lambda self: spec.choices.index(str(get(self))),
            set=lambda self, place: keep_value(self, spec.choices[place]),
        )
    start, end, step = slider_range(spec)
    return FloatProperty(
        **words,
        min=max(spec.minimum, -LARGEST),
        max=min(spec.maximum, LARGEST),
        soft_min=start,
        soft_max=end,
        step=max(100 * step, 0.001),
        precision=3,
        get=lambda self: float(get(self)),
        set=lambda self, value: keep_value(self, _within(spec, store.double(value))),
    )


def _within(spec: ParameterSpec, value: float) -> float:
    return min(max(value, spec.minimum), spec.maximum)


def _reader(model: str, spec: ParameterSpec, which: str) -> Callable[[bpy.types.PropertyGroup], Value]:
    return lambda group: value_of(group.id_data, model, spec, which)


def _writer(model: str, spec: ParameterSpec, which: str) -> Callable[[bpy.types.PropertyGroup, Value], None]:
    return lambda group, value: keep(group.id_data, model, {spec.name: value}, which)


def _classes(which: str) -> list[type[bpy.types.PropertyGroup]]:
    """A group for each model, and one of all groups."""
    groups = {name: _group(model, which) for name, model in MODELS.items()}
    fields = {name: PointerProperty(type=group) for name, group in groups.items()}
    name = f"Parameters{which}"
    whole = type(name, (bpy.types.PropertyGroup,), {"__annotations__": fields, "__module__": __name__})
    return [*groups.values(), whole]


_of_set = {which: _classes(which) for which in models.PARAMETER_SETS}
CLASSES = tuple(cls for classes in _of_set.values() for cls in classes)


def register() -> None:
    bpy.types.Scene.rockfall_parameters = PointerProperty(type=_of_set["A"][-1])
    bpy.types.Scene.rockfall_other_parameters = PointerProperty(type=_of_set["B"][-1])


def unregister() -> None:
    del bpy.types.Scene.rockfall_other_parameters
    del bpy.types.Scene.rockfall_parameters
