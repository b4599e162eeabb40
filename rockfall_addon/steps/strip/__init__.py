# SPDX-License-Identifier: GPL-3.0-or-later
"""The impact strip under the mouse: a click goes to a pick, dragging moves it in time."""

from . import channels, keys, pressing

PARTS = (pressing, channels, keys)
