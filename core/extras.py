# SPDX-License-Identifier: GPL-3.0-or-later
"""Libraries that only figures, pages and some files need."""

from importlib.util import find_spec

from .errors import DependencyError

FIGURES = ("figures", "Figures", "matplotlib")
PAGES = ("explore", "The interactive graphs", "bokeh")
E57 = ("e57", "E57 files", "pye57")
CLUSTER = ("cluster", "Several workers", "distributed")
PARQUET = ("parquet", "Parquet files", "pyarrow")
"""The optional extra of the package, what it is for, and the import name of its library."""


def is_there(extra: tuple[str, str, str]) -> bool:
    """Whether the library of an extra can be imported."""
    return find_spec(extra[2]) is not None


def install_command(extra: tuple[str, str, str]) -> str:
    """How to get the library of an extra."""
    return f'pip install "rockfall[{extra[0]}]"'


def demand(extra: tuple[str, str, str]) -> None:
    """Do nothing when the library is there.

    Raises
    ------
    DependencyError : it is not; the message names the command that installs it.
    """
    if not is_there(extra):
        _, purpose, library = extra
        raise DependencyError(f"{purpose} need {library}, which is not installed. Install it: {install_command(extra)}")
