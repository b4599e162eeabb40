# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: how a view maps the slope to pixels, and how it is found from marked points."""
