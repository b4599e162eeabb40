# SPDX-License-Identifier: GPL-3.0-or-later
"""The editor of impact graphs: its type, header, sidebar, keys and operators."""

from . import editor, keys, menus, moving, opening, panel, pointing, selecting, showing, statistics

PARTS = (moving, pointing, selecting, showing, opening, menus, panel, statistics, editor, keys)
