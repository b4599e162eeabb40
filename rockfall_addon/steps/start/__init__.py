# SPDX-License-Identifier: GPL-3.0-or-later
"""Before the steps: the workspace, the demos, an opened project, and what to do next."""

from . import operators, panel, workspace

PARTS = (operators, workspace, panel)
