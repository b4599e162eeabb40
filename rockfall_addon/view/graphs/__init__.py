# SPDX-License-Identifier: GPL-3.0-or-later
"""Editors of graphs: how they look, what they draw, and what is under the mouse."""
