# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling, disabling, and what a person sees when a library is missing."""

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import bpy
import pytest

PANEL = "ROCKFALL_PT_installation"


def test_enable_disable_and_enable_again(clean_blender: None, installation) -> None:
    registered = []
    for _ in range(3):
        installation.enable()
        registered.append(installation.traces())
        assert hasattr(bpy.types, PANEL)
        installation.disable()
        assert not any(installation.traces().values())
    assert registered[0] == registered[1] == registered[2]


def test_the_keys_of_tools_find_their_operators(clean_blender: None, installation, capfd) -> None:
    """A tool whose keys are made before the operators of another step loses their properties, with a warning."""
    installation.enable()
    installation.disable()
    printed = capfd.readouterr()
    assert "not found in item" not in printed.out + printed.err


def test_every_module_is_registered(rockfall: ModuleType, part) -> None:
    addon = part("rockfall_addon")
    assert part("rockfall_addon.preferences").problem == ""
    registered = [module.__name__.removeprefix(f"{addon.__name__}.") for module in addon._registered]
    assert registered == ["preferences", *addon.MODULES]


def test_the_preferences_belong_to_the_extension(rockfall: ModuleType) -> None:
    preferences = bpy.context.preferences.addons[rockfall.__name__].preferences
    assert preferences is not None
    assert type(preferences).bl_idname == rockfall.__name__


def test_disabling_forgets_the_modules(clean_blender: None, installation) -> None:
    installation.enable()
    first = installation.part("core.errors")
    installation.disable()
    assert not [name for name in sys.modules if name.startswith(f"{installation.name}.")]
    installation.enable()
    assert installation.part("core.errors") is not first
    installation.disable()


def test_registering_loads_no_large_library() -> None:
    """Each takes a good part of a second, at every start of Blender, whether Rockfall is used or not."""
    large = {"numba", "scipy", "cv2", "trimesh", "laspy", "tifffile", "matplotlib", "startinpy"}
    name = "bl_ext.user_default.rockfall" if bpy.app.binary_path else "rockfall"
    look = f"print('loaded:', sorted({large!r} & sys.modules.keys()), flush=True)"
    if bpy.app.binary_path:
        code = f"import sys; assert {name!r} in sys.modules; {look}"
        start = [bpy.app.binary_path, "--background", "--factory-startup", "--addons", name, "--python-expr", code]
    else:
        code = (
            "import os, sys, bpy, rockfall\n"
            f"bpy.context.preferences.addons.new().module = {name!r}\n"
            f"rockfall.register()\nassert hasattr(bpy.types, {PANEL!r})\n{look}\nos._exit(0)"
        )
        start = [sys.executable, "-c", code]
    done = subprocess.run(start, capture_output=True, text=True, check=False, cwd=Path(__file__).parent)
    assert "loaded: []" in done.stdout, done.stdout + done.stderr


@pytest.mark.parametrize("kind", ["package not found", "library cannot be loaded"])
def test_a_missing_library_is_named_in_one_panel(
    clean_blender: None, installation, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    addon = installation.part("rockfall_addon")
    if kind == "package not found":
        monkeypatch.setattr(addon, "missing_packages", lambda: ("scipy", "numba"))
        expected = "Missing Python packages: scipy, numba"
    else:
        monkeypatch.setattr(addon, "MODULES", ("no_such_module",))
        expected = f"A library cannot be loaded: No module named '{addon.__name__}.no_such_module'"
    installation.enable()
    try:
        module = addon.preferences.__name__
        traces = {kind: names for kind, names in installation.traces().items() if names}
        assert traces == {"types": [f"{module}.InstallationPanel", f"{module}.RockfallPreferences"]}
        assert addon.preferences.problem == expected
        assert "DEFAULT_CLOSED" not in getattr(bpy.types, PANEL).bl_options
        lines: list[str] = []
        addon.preferences.draw_state(_RecordingLayout(lines), width=60)
        assert expected in " ".join(lines)
        assert "Install from Disk" in " ".join(lines)
    finally:
        installation.disable()


class _RecordingLayout:
    """Stands in for a Blender layout, which exists only while a window is drawn."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = lines

    def column(self, **_: object) -> "_RecordingLayout":
        return self

    def separator(self) -> None:
        pass

    def label(self, *, text: str, **_: object) -> None:
        self.lines.append(text)
