# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 1: the terrain."""

from . import colouring, operators, panel, properties, removing

PARTS = (properties, operators, colouring, removing, panel)
