# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of the measured points by a column of their tables."""

from dataclasses import dataclass

from ....core.analysis.colouring import Colouring, colour_by
from ....core.analysis.columns import Column, column_titles, find_column
from ....core.reconstruction.impact import Impacts
from ....core.vectors import Array, Indices


@dataclass(frozen=True, eq=False)
class PointColours:
    """Colours of the points of each source.

    Attributes
    ----------
    colouring : None when the points have the colour of their source.
    place : source → its place among the coloured tables.
    """

    colouring: Colouring | None
    place: dict[int, int]

    def of(self, source: int, rows: Indices) -> Array | None:
        """(m, 3) of some rows of a source; None for the colour of the source."""
        if self.colouring is None or source not in self.place:
            return None
        return self.colouring.colours[self.place[source]][rows]


def find_colours(tables: dict[int, Impacts], name: str, dark: bool) -> PointColours:
    """Colours by a column; none without its name, or when no table has it.

    tables : source → its impacts.
    """
    columns: dict[int, Column] = {}
    for source, table in tables.items():
        if name and name in column_titles([table]):
            columns[source] = find_column(table, name)
    if not columns:
        return PointColours(None, {})
    return PointColours(colour_by(list(columns.values()), dark), {source: i for i, source in enumerate(columns)})
