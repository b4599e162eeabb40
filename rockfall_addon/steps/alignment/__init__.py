# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 3: the camera's place, from pairs of a pixel and a point of the terrain."""

from . import file_operators, operators, overlay, panel, properties

PARTS = (properties, operators, file_operators, overlay, panel)
