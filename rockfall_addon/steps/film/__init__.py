# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 8: films, set up in Blender and rendered with or without a window."""

from . import composed, operators, panel, properties

PARTS = (properties, operators, panel, composed)
