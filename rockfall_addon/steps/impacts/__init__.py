# SPDX-License-Identifier: GPL-3.0-or-later
"""The selected impact, and the table of all."""

from . import operators, overlay, panel, properties, table

PARTS = (overlay, properties, operators, panel, table)
