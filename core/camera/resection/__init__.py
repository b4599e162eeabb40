# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera from pairs of a pixel and a point: its pose, and as much of its lens as they can tell."""
