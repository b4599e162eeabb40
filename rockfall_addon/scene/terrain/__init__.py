# SPDX-License-Identifier: GPL-3.0-or-later
"""The terrain as Blender shows it, and where it lies."""
