# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7: whole rockfalls, simulated on the terrain."""

from . import (
    back_analysis,
    drawing,
    fences,
    map_overlay,
    map_panel,
    map_probe,
    maps,
    operators,
    overlay,
    panel,
    picking,
    properties,
    screens,
    structures,
    zones,
)

PARTS = (
    properties,
    drawing,
    operators,
    picking,
    zones,
    structures,
    screens,
    maps,
    panel,
    back_analysis,
    map_panel,
    overlay,
    fences,
    map_overlay,
    map_probe,
)
