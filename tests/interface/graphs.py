# SPDX-License-Identifier: GPL-3.0-or-later
"""A person looks at the graphs of the impacts: chooses variables, points, selects, zooms, undoes, saves and reopens."""

import bpy

TREE = "RockfallImpactGraphs"


def open_graphs(window, *, load=True):
    """The graphs beside the 3-D view, with the demo's impacts."""
    with window.override():
        if load:
            assert bpy.ops.rockfall.load_demo() == {"FINISHED"}
            bpy.ops.ed.undo_push(message="demo")
        assert bpy.ops.rockfall.open_graphs() == {"FINISHED"}
    yield 2.0


def canvas(window):
    region = window.region("WINDOW", "NODE_EDITOR")
    return window.part("rockfall_addon.view.graphs.editor")._canvases[region.as_pointer()]


def spot(window, x, y):
    """A pixel of the graphs' region, in the window."""
    region = window.region("WINDOW", "NODE_EDITOR")
    return region.x + x, region.y + y


def theme(name):
    bpy.ops.script.execute_preset(
        filepath=f"{bpy.utils.system_resource('SCRIPTS')}/presets/interface_theme/Blender_{name}.xml",
        menu_idname="USERPREF_MT_interface_theme_presets",
    )


def case_graphs_first_look(window):
    yield from open_graphs(window)
    window.screenshot("dark")
    seen = canvas(window)
    assert sorted(seen.frames) == [0, 1, 2, 3]
