# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 6: impact models beside the real blocks."""

from . import operators, panel

PARTS = (operators, panel)
