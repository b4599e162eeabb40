# SPDX-License-Identifier: GPL-3.0-or-later
"""A person types the density of a block, reads the tool's header, and corrects the unit of a scan in feet."""

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))

import workspace

DIGITS = ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
KEYS = {**{str(digit): name for digit, name in enumerate(DIGITS)}, ".": "PERIOD", "-": "MINUS"}
DENSITY = 342
"""How far below the panel's header the field for a density of one's own is [px]."""
FOOT_M = 0.3048


def pictures(window, name):
    for theme in ("Light", "Dark"):
        window.theme(theme)
        yield 0.8
        window.screenshot(f"{name}-{theme.lower()}")


def with_picks(window):
    with window.override():
        assert bpy.ops.rockfall.load_footage_demo() == {"FINISHED"}
    yield from workspace.arranged(window)
    with window.override():
        assert bpy.ops.rockfall.propose_impacts() == {"FINISHED"}
    yield 1.0
    scene = bpy.context.scene
    picks = sorted((o for o in scene.objects if o.get("rockfall_role") == "pick"), key=lambda o: o["rockfall_time_s"])
    window.part("rockfall_addon.scene.picks.impact_rows").go_to(bpy.context, scene, picks[3])
    with window.override():
        bpy.ops.wm.tool_set_by_id(name="rockfall.pick_tool")
    yield 1.0


def enter(window, text, x, y):
    """Click a field, and type what takes the place of what is in it."""
    yield from window.click(x, y)
    yield from window.press("A", x, y, ctrl=True)
    for letter in text:
        for value in ("PRESS", "RELEASE"):
            said = {"unicode": letter} if value == "PRESS" else {}
            window.window.event_simulate(type=KEYS[letter], value=value, x=x, y=y, **said)
            yield 0.1
    yield from window.press("RET", x, y)
    yield 0.5


def case_words_of_the_tools_header(window):
    """At both scales, over dark footage: the words of each tool have a ground of their own."""
    yield from with_picks(window)
    for scale in (1.0, 2.0):
        bpy.context.preferences.view.ui_scale = scale
        yield 1.5
        for tool in ("pick", "align", "spin"):
            with window.override():
                bpy.ops.wm.tool_set_by_id(name=f"rockfall.{tool}_tool")
            window.area().spaces.active.overlay.show_overlays = tool != "align"
            yield from pictures(window, f"{tool}-{scale:g}")


def case_type_a_density(window):
    """The mass follows at once; what was meant in g/cm³ is told, and what cannot be ends at the range of the field."""
    for panel in ("picking", "tracking"):
        window.unfold(f"ROCKFALL_PT_{panel}", False)
    yield from with_picks(window)
    x, header = yield from window.open_panel("ROCKFALL_PT_picks")
    block_of = window.part("rockfall_addon.scene.picks.places").block_of
    before = block_of(bpy.context.scene, "B10")
    bpy.context.scene.rockfall_block.own = True
    with window.override():
        bpy.ops.ed.undo_push(message="own block")
    yield 0.5
    for text, density in (("3100", 3100.0), ("2700.5", 2700.5), ("-5", 0.1), ("2.7", 2.7)):
        yield from enter(window, text, x + 110, header - DENSITY)
        yield 0.5
        window.screenshot(f"density-{text}")
        block = block_of(bpy.context.scene, "B10")
        assert block.density == density, (text, block)
        assert np.isclose(block.mass_kg, before.mass_kg * density / before.density)
        said = " ".join(one.text for one in window.part("rockfall_addon.scene.problems").remarks(bpy.context.scene))
        assert ("In g/cm³?" in said) == (density < 500.0)
        if density < 500.0:  # what is said moves the field
            with window.override():
                bpy.ops.ed.undo()
            yield 0.5
            assert block_of(bpy.context.scene, "B10").density == 2700.5, "each entry is a step"


def case_a_scan_in_feet_is_read_again(window):
    """Nothing tells feet from metres but the size, which the dialog says; the unit is chosen by its name."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 41, 2.0), np.arange(0, 41, 2.0)))
    corners = np.arange(441).reshape(21, 21)
    corners = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=-1).reshape(-1, 4)
    points = np.column_stack([x + 2.6e6, y + 1.2e6, 30 - 0.5 * x]) / FOOT_M
    file = Path(tempfile.mkdtemp()) / "feet.obj"
    rows = ["v {:.4f} {:.4f} {:.4f}".format(*point) for point in points]
    file.write_text("\n".join([*rows, *("f {} {} {} {}".format(*face) for face in corners + 1)]) + "\n")
    scene = bpy.context.scene

    def ground():
        return next((obj for obj in scene.objects if obj.get("rockfall_role") == "terrain"), None)

    with window.override():
        assert bpy.ops.rockfall.import_terrain(filepath=str(file)) == {"FINISHED"}
    assert abs(ground().dimensions.x - 40 / FOOT_M) < 0.01
    with window.override():
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(file), replaces=ground()["rockfall_id"])
    yield 1.5
    yield from pictures(window, "1-in-metres")
    yield from window.press("ESC", *window.centre())
    with window.override():
        again = {"replaces": ground()["rockfall_id"], "unit_m": FOOT_M}
        bpy.ops.rockfall.import_terrain("INVOKE_DEFAULT", filepath=str(file), **again)
    yield 1.5
    yield from pictures(window, "2-in-feet")
    yield from window.press("RET", *window.centre())
    yield from window.wait_for(lambda: ground() is not None and ground().dimensions.x < 50, what="read again")
    yield 1.0
    window.screenshot("3-again")
    assert abs(ground().dimensions.x - 40) < 0.001
    shift = window.part("rockfall_addon.scene.terrain.georeference").read_shift(scene)
    assert abs(shift.x - 2.6e6) < 1000, "the shift is that of the right place"
