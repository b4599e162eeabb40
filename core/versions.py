# SPDX-License-Identifier: GPL-3.0-or-later
"""The versions on which the bits of a result depend."""

from importlib import import_module
from importlib.metadata import version

LIBRARIES = ("numpy", "numba")


def versions() -> dict[str, str]:
    """Of Rockfall and of the libraries that compute with it."""
    own = import_module((__package__ or "").removesuffix(".core")).__version__
    return {"rockfall": str(own), **{name: version(name) for name in LIBRARIES}}
