# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7: whole rockfalls, simulated on the terrain."""

from . import drawing, operators, overlay, panel, picking, properties

PARTS = (properties, drawing, operators, picking, panel, overlay)
