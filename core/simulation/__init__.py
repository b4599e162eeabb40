# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole rockfalls: blocks that fly, hit, roll and stop on the terrain, with any impact model."""
