# SPDX-License-Identifier: GPL-3.0-or-later
"""The selected impact, and the table of all."""

from . import operators, panel, properties, table

PARTS = (properties, operators, panel, table)
