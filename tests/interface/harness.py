# SPDX-License-Identifier: GPL-3.0-or-later
"""Run cases in the window of a real Blender: simulated clicks, pictures of the screen, assertions.

Blender runs this file, started by scripts/interface_tests.py:

    blender --factory-startup --enable-event-simulate --addons bl_ext.user_default.rockfall \\
        --python tests/interface/harness.py -- SECONDS tests/interface/sidebar.py case_name [FILE CASE ...]

The cases run one after the other, each from a new file and with the time limit SECONDS. The first that fails ends this
Blender, since what it leaves could disturb the next.

A case is a generator function ``case_…(window: Window)``. It yields the seconds that Blender may have for drawing and
for its events, asserts, and takes screenshots, which end up in out/screenshots:

    def case_something(window):
        window.show_sidebar("Rockfall")
        yield 0.5
        bpy.ops.rockfall.load_demo()
        yield 1.0
        yield from window.click(400, 300)
        window.screenshot("demo")
        assert "Terrain" in bpy.data.objects
"""

import faulthandler
import importlib.util
import os
import shutil
import subprocess
import sys
import time
import traceback
from collections import deque
from collections.abc import Generator, Iterator
from pathlib import Path
from types import ModuleType

import bpy

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = "bl_ext.user_default.rockfall"
BEGINS = "harness: "
FIRST_DRAW_S = 1.0
HEADER_PX = 28
"""Height of a folded panel at scale 1."""
BETWEEN_EVENTS_S = 0.2

Steps = Generator[float]


class Window:
    """The one window of this Blender, as a person has it: look, click, type."""

    def __init__(self, case: str) -> None:
        self.case = case

    @property
    def window(self) -> bpy.types.Window:
        return bpy.context.window_manager.windows[0]

    def area(self, kind: str = "VIEW_3D") -> bpy.types.Area:
        return next(area for area in self.window.screen.areas if area.type == kind)

    def region(self, kind: str = "WINDOW", area: str = "VIEW_3D") -> bpy.types.Region:
        return next(region for region in self.area(area).regions if region.type == kind)

    def override(self, area: str = "VIEW_3D") -> object:
        """Context manager in which operators run as if called from that area."""
        return bpy.context.temp_override(window=self.window, area=self.area(area), region=self.region(area=area))

    def part(self, name: str) -> ModuleType:
        """A module of the extension: ``part("core.errors")``."""
        return importlib.import_module(f"{EXTENSION}.{name}")

    def show_sidebar(self, tab: str = "Rockfall", *, width: int | None = None) -> Steps:
        """Open the sidebar of the 3-D view at a tab."""
        self.area().spaces.active.show_region_ui = True
        yield 0.5
        sidebar = self.region("UI")
        sidebar.active_panel_category = tab
        sidebar.tag_redraw()
        yield 0.5
        assert sidebar.active_panel_category == tab, f"the sidebar has no tab {tab}"

    def open_panel(self, name: str, area: str = "VIEW_3D") -> Generator[float, None, tuple[int, int]]:
        """Unfold one of our panels in a sidebar that shows them, and fold the others, by clicks on their headers.

        Returns the place of its header in the window.
        """
        sidebar, header = self.region("UI", area), round(HEADER_PX * bpy.context.preferences.view.ui_scale)
        x, top = sidebar.x + 90, sidebar.y + sidebar.height - header // 2
        yield from self.click(x, top, ctrl=True)  # folds all but the first, however high they were
        yield 0.5
        yield from self.click(x, top)
        with self.override(area):
            panels = [
                panel
                for panel in self.part("rockfall_addon.steps").classes()
                if issubclass(panel, bpy.types.Panel)
                and (panel.bl_space_type, panel.bl_region_type) == (area, "UI")
                and not getattr(panel, "bl_parent_id", "")
                and (not hasattr(panel, "poll") or panel.poll(bpy.context))
            ]
        panels.sort(key=lambda panel: getattr(panel, "bl_order", 0))
        names = [panel.__name__ for panel in panels]
        panel, drawn = panels[names.index(name)], []
        draw = panel.draw
        panel.draw = lambda self, context: (drawn.append(name), draw(self, context))[-1]
        try:
            yield from self.click(x, top - header * names.index(name))
            yield 1.0
        finally:
            panel.draw = draw
        assert drawn, f"{name} is not open"
        return x, top - header * names.index(name)

    def unfold(self, name: str, is_open: bool = True) -> None:
        """Let a panel, also one within another, be open when it is drawn for the first time, or closed."""
        panel = next(one for one in self.part("rockfall_addon.steps").classes() if one.__name__ == name)
        bpy.utils.unregister_class(panel)
        others = getattr(panel, "bl_options", set()) - {"DEFAULT_CLOSED"}
        panel.bl_options = others if is_open else others | {"DEFAULT_CLOSED"}
        bpy.utils.register_class(panel)

    def scroll(self, steps: int, area: str = "VIEW_3D") -> Steps:
        """Turn the wheel over the sidebar: down, or up where it is below zero."""
        sidebar = self.region("UI", area)
        x, y = sidebar.x + sidebar.width // 2, sidebar.y + sidebar.height // 2
        yield from self.move(x, y)
        for _ in range(abs(steps)):
            kind = "WHEELDOWNMOUSE" if steps > 0 else "WHEELUPMOUSE"
            self.window.event_simulate(type=kind, value="PRESS", x=round(x), y=round(y))
            yield BETWEEN_EVENTS_S

    def move(self, x: float, y: float) -> Steps:
        """Move the mouse to a pixel of the window, counted from the bottom left."""
        self.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=round(x), y=round(y))
        yield BETWEEN_EVENTS_S

    def click(self, x: float, y: float, button: str = "LEFTMOUSE", **modifiers: bool) -> Steps:
        yield from self.move(x, y)
        for value in ("PRESS", "RELEASE"):
            self.window.event_simulate(type=button, value=value, x=round(x), y=round(y), **modifiers)
            yield BETWEEN_EVENTS_S

    def press(self, key: str, x: float, y: float, **modifiers: bool) -> Steps:
        """Press a key (``"ESC"``, ``"SPACE"``) with the mouse at a pixel of the window."""
        yield from self.move(x, y)
        for value in ("PRESS", "RELEASE"):
            self.window.event_simulate(type=key, value=value, x=round(x), y=round(y), **modifiers)
            yield BETWEEN_EVENTS_S

    def centre(self, area: str = "VIEW_3D") -> tuple[int, int]:
        region = self.region(area=area)
        return region.x + region.width // 2, region.y + region.height // 2

    def wait_for(self, condition: object, seconds: float = 30.0, what: str = "") -> Steps:
        """Let Blender work until ``condition()`` is true."""
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, f"after {seconds:g} s still not: {what or condition}"
            yield BETWEEN_EVENTS_S

    def redraw(self) -> None:
        for area in self.window.screen.areas:
            area.tag_redraw()

    def theme(self, name: str) -> None:
        """Blender's own theme of a name: "Dark" or "Light"."""
        presets = f"{bpy.utils.system_resource('SCRIPTS')}/presets/interface_theme"
        with bpy.context.temp_override(window=self.window):
            bpy.ops.script.execute_preset(
                filepath=f"{presets}/Blender_{name}.xml", menu_idname="USERPREF_MT_interface_theme_presets"
            )

    def screenshot(self, name: str) -> Path:
        """A picture of the whole screen, as a person sees it."""
        directory = Path(os.environ.get("ROCKFALL_SCREENSHOTS") or ROOT / "out" / "screenshots")
        directory.mkdir(parents=True, exist_ok=True)
        path = directory / f"{self.case.removeprefix('case_')}-{name}.png"
        path.unlink(missing_ok=True)
        if os.environ.get("DISPLAY") and shutil.which("import"):
            # Blender's own screenshot is black with a software renderer.
            subprocess.run(["import", "-silent", "-window", "root", str(path)], check=True)
        else:
            with self.override():
                bpy.ops.screen.screenshot(filepath=str(path))
        assert path.stat().st_size > 5000, f"{path.name} is an empty picture"
        return path


def load_case(file: str, name: str) -> Iterator[float]:
    spec = importlib.util.spec_from_file_location(Path(file).stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)(Window(name))


def is_preparing() -> bool:
    """Whether models are compiled in the background, which takes long in a Blender that never ran them."""
    scene = f"{EXTENSION}.rockfall_addon.scene"
    preparation, models = (
        importlib.import_module(f"{scene}.{name}") for name in ("picks.preparation", "models.models")
    )
    return bool(preparation.pending(models.ORDER))


def draw_quickly() -> None:
    """Views without smoothed edges: where they are drawn by software, smoothing takes as long as all the rest."""
    bpy.context.preferences.system.viewport_aa = "OFF"


def new_file() -> None:
    """What a person has who has just started Blender."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.context.preferences.view.ui_scale = 1.0
    draw_quickly()


def leave(code: int) -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # a regular exit asks whether to save


def main() -> None:
    seconds, *cases = sys.argv[sys.argv.index("--") + 1 :]
    waiting = deque(zip(cases[::2], cases[1::2], strict=True))
    bpy.context.preferences.view.show_splash = False  # it would eat the first click
    draw_quickly()
    if EXTENSION not in sys.modules:
        print(f"harness: {EXTENSION} is not enabled in this Blender", file=sys.stderr)
        leave(4)
    steps: list[Iterator[float]] = []

    def step() -> float | None:
        try:
            if not steps and is_preparing():
                return BETWEEN_EVENTS_S
            if not steps:
                print(f"{BEGINS}{waiting[0][1]}", flush=True)
                faulthandler.dump_traceback_later(float(seconds), exit=True)
                steps.append(load_case(*waiting[0]))
            return next(steps[0])
        except StopIteration:
            steps.clear()
            waiting.popleft()
            if not waiting:
                leave(0)
            new_file()
            return FIRST_DRAW_S
        except BaseException:  # noqa: BLE001 - whatever it was, it goes to the log and ends this Blender
            traceback.print_exc()
            leave(1)

    bpy.app.timers.register(step, first_interval=FIRST_DRAW_S, persistent=True)  # a case may open a file


if __name__ == "__main__":
    main()
