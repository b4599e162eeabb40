# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of Rockfall: plain NumPy functions and dataclasses, no Blender."""
