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


def case_statistics_beside_the_graphs(window):
    yield from open_graphs(window)
    window.area("NODE_EDITOR").spaces.active.show_region_ui = True
    yield 0.5
    sidebar = window.region("UI", "NODE_EDITOR")
    sidebar.active_panel_category = "Rockfall"
    with window.override():
        bpy.ops.rockfall.colour_graphs(column="theta1_deg")
    yield 1.0
    x, top = sidebar.x + 60, sidebar.y + sidebar.height - 15
    yield from window.click(x, top, ctrl=True)  # folds the other panels
    yield from window.click(x, top)
    panels = [
        cls.__name__
        for cls in window.part("rockfall_addon.steps").classes()
        if issubclass(cls, bpy.types.Panel) and cls.bl_space_type == "NODE_EDITOR" and cls.bl_region_type == "UI"
    ]
    kept = window.part("rockfall_addon.scene.statistics")._kept
    assert not kept, "a folded panel computes nothing"
    yield from window.click(x, top - 28 * panels.index("ROCKFALL_PT_graph_statistics"))
    yield 1.0
    window.screenshot("dark")
    (_, found), *_ = kept.values()
    assert [one.used for one in found.groups.values()] == [30, 29, 24]
    theme("Light")
    yield 1.0
    window.screenshot("light")
