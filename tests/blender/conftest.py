# SPDX-License-Identifier: GPL-3.0-or-later
"""Each test gets an empty scene and a freshly registered Rockfall, and fails when unregistering leaves something."""

import importlib
import sys
from collections.abc import Callable, Iterator
from types import ModuleType

import addon_utils
import bpy
import pytest

NAME = "bl_ext.user_default.rockfall" if bpy.app.binary_path else "rockfall"
"""The installed extension in a real Blender, the package of the checkout in Blender as a module."""


class Installation:
    """Rockfall in this Blender, to be switched on and off."""

    name = NAME

    def enable(self) -> ModuleType:
        """Register as ticking the box in the preferences does; the libraries stay unpacked between tests."""
        if bpy.app.binary_path:
            module = addon_utils.enable(NAME, default_set=True, refresh_handled=True)
            assert module is not None, "the extension could not be enabled: see the traceback above"
            return module
        module = importlib.import_module(NAME)
        if NAME not in bpy.context.preferences.addons:
            bpy.context.preferences.addons.new().module = NAME
        module.register()
        return module

    def disable(self) -> None:
        if bpy.app.binary_path:
            addon_utils.disable(NAME, refresh_handled=True)
        else:
            importlib.import_module(NAME).unregister()

    def part(self, name: str) -> ModuleType:
        """A module of the package: ``part("core.terrain.readers")``."""
        return importlib.import_module(f"{NAME}.{name}")

    def traces(self) -> dict[str, list[str]]:
        """What registering leaves in Blender: handlers, types, properties, menu entries, key map items."""
        handlers = [
            f"{name}: {function.__module__}.{function.__qualname__}"
            for name in dir(bpy.app.handlers)
            if isinstance(functions := getattr(bpy.app.handlers, name), list)
            for function in functions
        ]
        entries = [
            f"{each.__name__}: {function.__module__}.{function.__qualname__}"
            for kind in (bpy.types.Menu, bpy.types.Panel, bpy.types.Header)
            for each in kind.__subclasses__()
            for function in getattr(getattr(each, "draw", None), "_draw_funcs", ())
        ]
        owners = (bpy.types.ID, *bpy.types.ID.__subclasses__())
        properties = [f"{owner.__name__}.{name}" for owner in owners for name in dir(owner)]
        key_config = bpy.context.window_manager.keyconfigs.addon
        keys = [
            f"{keymap.name}: {item.idname}"
            for keymap in (key_config.keymaps if key_config else ())
            for item in keymap.keymap_items
        ]
        types = [
            f"{each.__module__}.{each.__name__}"
            for each in _subclasses(bpy.types.bpy_struct)
            if getattr(each, "is_registered", False)
        ]
        found = {"handlers": handlers, "types": types, "properties": properties, "menus": entries, "keys": keys}
        return {kind: sorted(name for name in names if "rockfall" in name.lower()) for kind, names in found.items()}


def _subclasses(base: type) -> Iterator[type]:
    for each in base.__subclasses__():
        yield each
        yield from _subclasses(each)


@pytest.fixture
def installation() -> Installation:
    return Installation()


@pytest.fixture
def draw_handlers(monkeypatch: pytest.MonkeyPatch) -> set[object]:
    """The draw handlers that were added and not yet removed; Blender itself does not list them."""
    alive: set[object] = set()

    def watch(space: type) -> None:
        add, remove = space.draw_handler_add, space.draw_handler_remove

        def adding(*arguments: object) -> object:
            handle = add(*arguments)
            alive.add(handle)
            return handle

        def removing(handle: object, region: str) -> None:
            remove(handle, region)
            alive.discard(handle)

        monkeypatch.setattr(space, "draw_handler_add", adding)
        monkeypatch.setattr(space, "draw_handler_remove", removing)

    for space in (bpy.types.SpaceView3D, bpy.types.SpaceClipEditor, bpy.types.SpaceNodeEditor):
        watch(space)
    return alive


@pytest.fixture
def empty_scene() -> None:
    """A new file without objects; unlike factory settings, this leaves the enabled extensions alone."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)


@pytest.fixture
def clean_blender(empty_scene: None, installation: Installation, draw_handlers: set[object]) -> Iterator[None]:
    """Rockfall is disabled before the test, and must have left no trace after it."""
    if getattr(sys.modules.get(NAME), "__addon_enabled__", False):
        installation.disable()
    left_before = {kind: names for kind, names in installation.traces().items() if names}
    assert not left_before, f"something of Rockfall is there before the test: {left_before}"
    yield
    left = {kind: names for kind, names in installation.traces().items() if names}
    assert not left, f"disabling leaves {left}"
    assert not draw_handlers, "disabling leaves draw handlers"


@pytest.fixture
def rockfall(clean_blender: None, installation: Installation) -> Iterator[ModuleType]:
    """The registered package, under whichever name Blender knows it."""
    yield installation.enable()
    installation.disable()


@pytest.fixture
def part(rockfall: ModuleType, installation: Installation) -> Callable[[str], ModuleType]:
    """``part("core.terrain.readers")`` is that module of the registered package."""
    return installation.part
