# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the 3-D view. Draw handlers never appear in renders: films carry their own legend as geometry."""

from . import footage, legend, loupe, pairs


def register() -> None:
    legend.register()
    footage.register()
    loupe.register()
    pairs.register()


def unregister() -> None:
    pairs.unregister()
    loupe.unregister()
    footage.unregister()
    legend.unregister()
