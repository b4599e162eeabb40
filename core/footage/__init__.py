# SPDX-License-Identifier: GPL-3.0-or-later
"""Footage: what a video file really contains, when its frames were taken, and what moves in them."""
