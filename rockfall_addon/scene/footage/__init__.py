# SPDX-License-Identifier: GPL-3.0-or-later
"""Videos, their clocks and cameras, their alignment, and what was seen in them."""
