# SPDX-License-Identifier: GPL-3.0-or-later
"""Step 2: the videos and their times."""

from . import operators, panel, properties

PARTS = (properties, operators, panel)
