# SPDX-License-Identifier: GPL-3.0-or-later
"""Rockfall: from filmed rockfalls and scanned slopes to trajectories, impacts and films.

The same tree is a Blender extension and the Python package ``rockfall``: nothing here imports Blender.
"""

__version__ = "0.2.0"


def register() -> None:
    """Called by Blender when the extension is enabled."""
    from . import rockfall_addon

    rockfall_addon.register()


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    from . import rockfall_addon

    rockfall_addon.unregister()
    _forget_submodules()


def _forget_submodules() -> None:
    """Drop our submodules so that re-enabling the extension runs the code on disk."""
    import sys

    prefix = f"{__name__}."
    for name in [name for name in sys.modules if name.startswith(prefix)]:
        del sys.modules[name]
        globals().pop(name.removeprefix(prefix), None)  # `from . import x` finds this first
