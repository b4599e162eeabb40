# SPDX-License-Identifier: GPL-3.0-or-later
"""Part of step 4: one point of the block marked in pictures of a flight, for its spin."""

from . import operators, panel

PARTS = (operators, panel)
