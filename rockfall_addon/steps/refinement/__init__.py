# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 5: refinement, before and after."""

from . import operators, panel

PARTS = (operators, panel)
