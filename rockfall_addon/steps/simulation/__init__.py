# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7: whole rockfalls, simulated on the terrain."""

from . import drawing, fences, operators, overlay, panel, picking, properties, screens, structures, zones

PARTS = (properties, drawing, operators, picking, zones, structures, screens, panel, overlay, fences)
