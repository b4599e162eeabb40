# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 7: how the blocks are played and drawn."""

from . import framing, overlay, panel

PARTS = (overlay, framing, panel)
