# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 10: what leaves Blender: tables, the project, a web page, the animation."""

from . import graphs, operators, panel, shown

PARTS = (graphs, operators, shown, panel)
