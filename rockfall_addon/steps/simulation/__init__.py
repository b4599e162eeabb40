# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7: whole rockfalls, simulated on the terrain."""

from . import drawing, operators, overlay, panel, picking, properties, structures, zones

PARTS = (properties, drawing, operators, picking, zones, structures, panel, overlay)
