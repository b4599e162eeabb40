# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar of the impact graphs: models, their parameters, scores, fits, impacts of other sites."""

from . import databases, fitting, operators, panel

PARTS = (operators, fitting, databases, panel)
