# SPDX-License-Identifier: GPL-3.0-or-later
"""A person opens the instrumented impacts of Chant Sura, which have no terrain."""

from pathlib import Path

import bpy

PICKS = Path(__file__).resolve().parents[2] / "assets" / "examples" / "chant_sura_lu2019" / "picks.csv"


def case_instrumented_impacts_without_terrain(window):
    yield from window.show_sidebar()
    with window.override():
        assert bpy.ops.rockfall.import_picks(filepath=str(PICKS)) == {"FINISHED"}
    scene = bpy.context.scene
    pick = next(o for o in scene.objects if o.name.endswith(" impact 2"))
    bpy.context.view_layer.objects.active = pick
    yield 3.0
    window.screenshot("chant-sura")
    speed = sum(v * v for v in window.part("rockfall_addon.scene.picks.impact_numbers").of(pick)["incident_mps"]) ** 0.5
    assert abs(speed / 17.46 - 1) < 0.11, "the instrument said 17.46 m/s"
