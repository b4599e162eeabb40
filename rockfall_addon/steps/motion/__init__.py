# SPDX-License-Identifier: GPL-3.0-or-later
"""The editor of motion graphs: its type, header, keys and operators."""

from . import editor, keys, opening, pressing

PARTS = (pressing, opening, editor, keys)
