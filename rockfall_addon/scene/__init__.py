# SPDX-License-Identifier: GPL-3.0-or-later
"""What the .blend stores and shows: between the scene and the plain dataclasses of the core."""
