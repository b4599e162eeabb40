# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks, the trajectories and impacts that follow from them, and their proposed refinement."""
