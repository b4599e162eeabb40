# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the 3-D view. Draw handlers never appear in renders: films carry their own legend as geometry."""

from . import legend, pairs


def register() -> None:
    legend.register()
    pairs.register()


def unregister() -> None:
    pairs.unregister()
    legend.unregister()
