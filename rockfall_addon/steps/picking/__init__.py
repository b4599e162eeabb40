# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 4: picks in the footage and on the terrain, the track of the block, and the trajectories between picks."""

from . import block, operators, overlay, panel, properties, set_aside, table_operators, tracking

PARTS = (properties, table_operators, set_aside, operators, tracking, overlay, panel, block)
