# SPDX-License-Identifier: GPL-3.0-or-later
"""Each test gets an empty scene and the registered Rockfall, and must leave Blender as it found it.

Rockfall is registered once, and again after a test that has failed or that enables and disables it. Disabling it must
leave nothing behind: that is looked at whenever it is disabled, at the latest after the last test.
"""

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import addon_utils
import bpy
import numpy as np
import pytest

sys.path.append(str(Path(__file__).parent))  # what several test files share
pytest.register_assert_rewrite("two_runs")

from two_runs import scene, slope, table, terrain_file  # noqa: E402, F401

NAME = "bl_ext.user_default.rockfall" if bpy.app.binary_path else "rockfall"
"""The installed extension in a real Blender, the package of the checkout in Blender as a module."""


class Installation:
    """Rockfall in this Blender, to be switched on and off.

    Attributes
    ----------
    draw_handlers : those that were added and not yet removed; Blender itself does not list them.
    failed : a test has failed since Rockfall was enabled.
    """

    name = NAME

    def __init__(self, draw_handlers: set[object]) -> None:
        self.draw_handlers = draw_handlers
        self.failed = False
        self.registered: dict[str, list] | None = None

    def shared(self) -> ModuleType:
        """The registered package, enabled now if it is not, or if what a failed test has left may be in its way."""
        if self.failed or self.registered is None:
            self.end()
            self.enable()
            self.registered = self.traces()
        return importlib.import_module(NAME)

    def end(self) -> None:
        """Disable it if it is enabled; nothing may remain."""
        self.registered, self.failed = None, False
        if self.is_enabled():
            self.disable()
        left = {kind: names for kind, names in self.traces().items() if names}
        assert not left, f"disabling leaves {left}"

    def is_enabled(self) -> bool:
        return hasattr(bpy.types, "ROCKFALL_PT_installation")

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

    def traces(self) -> dict[str, list]:
        """What registering leaves in Blender: handlers, types, properties, menu entries, key map items, drawing."""
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
        ours = {kind: sorted(name for name in names if "rockfall" in name.lower()) for kind, names in found.items()}
        return ours | {"drawing": sorted(self.draw_handlers, key=id)}


def _subclasses(base: type) -> Iterator[type]:
    for each in base.__subclasses__():
        yield each
        yield from _subclasses(each)


@pytest.fixture(scope="session")
def installation() -> Iterator[Installation]:
    with watched_drawing() as draw_handlers:
        found = Installation(draw_handlers)
        yield found
        found.end()


@contextmanager
def watched_drawing() -> Iterator[set[object]]:
    """The draw handlers that are added and not yet removed."""
    alive: set[object] = set()

    def watch(patch: pytest.MonkeyPatch, space: type) -> None:
        add, remove = space.draw_handler_add, space.draw_handler_remove

        def adding(*arguments: object) -> object:
            handle = add(*arguments)
            alive.add(handle)
            return handle

        def removing(handle: object, region: str) -> None:
            remove(handle, region)
            alive.discard(handle)

        patch.setattr(space, "draw_handler_add", adding)
        patch.setattr(space, "draw_handler_remove", removing)

    with pytest.MonkeyPatch.context() as patch:
        for space in (bpy.types.SpaceView3D, bpy.types.SpaceClipEditor, bpy.types.SpaceNodeEditor):
            watch(patch, space)
        yield alive


@pytest.fixture
def empty_scene() -> None:
    """A new file without objects; unlike factory settings, this leaves the enabled extensions alone."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True, load_ui=False)


@pytest.fixture
def clean_blender(empty_scene: None, installation: Installation) -> Iterator[None]:
    """Rockfall is disabled before the test, and must have left no trace after it."""
    installation.end()
    yield
    left = {kind: names for kind, names in installation.traces().items() if names}
    assert not left, f"disabling leaves {left}"


@pytest.fixture
def rockfall(installation: Installation, empty_scene: None) -> Iterator[ModuleType]:
    """The registered package, under whichever name Blender knows it."""
    yield installation.shared()
    registered, left = installation.registered, installation.traces()
    changed = {kind: (registered[kind], names) for kind, names in left.items() if names != registered[kind]}
    installation.failed |= bool(changed)
    assert not changed, f"the test leaves Rockfall registered otherwise than it was: {changed}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.failed and (found := getattr(item, "funcargs", {}).get("installation")):
        found.failed = True
    return report


@pytest.fixture
def part(rockfall: ModuleType, installation: Installation) -> Callable[[str], ModuleType]:
    """``part("core.terrain.readers")`` is that module of the registered package."""
    return installation.part


@pytest.fixture
def numbers(part) -> Callable[[bpy.types.Object], dict | None]:
    """``numbers(pick)["rn"]`` is what the pick's object keeps of its impact."""
    return part("rockfall_addon.scene.impact_numbers").of


@pytest.fixture
def scan(part) -> bpy.types.Scene:
    """A rough slope that runs out, without any footage."""
    line = np.linspace(0.0, 118.0, 60)
    x, y = (values.ravel() for values in np.meshgrid(line, line, indexing="ij"))
    z = 100 - 1.4 * np.minimum(x, 60) + 0.02 * np.maximum(x - 60, 0) + 0.4 * np.sin(x / 3) * np.cos(y / 4)
    z = np.round(1024 * z) / 1024  # which single precision holds
    corner = (np.arange(59)[:, None] * 60 + np.arange(59)).ravel()
    ring = np.column_stack([corner, corner + 60, corner + 61, corner + 1])
    faces = np.vstack([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]]).astype(np.int32)
    shift = part("core.georeference").GlobalShift(2_600_000.0, 1_200_000.0, 0.0)
    surface = part("core.terrain.surface").Surface(np.column_stack([x, y, z]), faces, shift, "scan", ())
    part("rockfall_addon.scene.terrain").add_terrain(
        bpy.context.scene, surface, part("core.terrain.shading").shade(surface)
    )
    return bpy.context.scene
