# SPDX-License-Identifier: GPL-3.0-or-later
"""Refinement: whole trajectories fitted to the block's pixels in every frame of every view."""
