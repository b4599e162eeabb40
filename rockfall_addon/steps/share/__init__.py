# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 9: what leaves Blender: tables and the project."""

from . import graphs, operators, panel

PARTS = (graphs, operators, panel)
