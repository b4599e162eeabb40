# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables as Parquet files: the columns of the CSV files, numbers as numbers, what is undefined as null."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..extras import PARQUET, demand
from ..memory import check_memory
from ..output import output_file
from ..vectors import Array
from .plain_cells import Cells

SUFFIX = ".parquet"
PACKING = "zstd"


class ParquetCells(Cells):
    """The columns of a Parquet file, as texts of some rows each, and as numbers.

    Parameters
    ----------
    table : a `pyarrow.Table`.
    block, between : rows of a text, and what stands between its cells.
    """

    def __init__(self, table: Any, block: int, between: str) -> None:
        self.table, self.block, self.between = table, block, between

    def __contains__(self, name: object) -> bool:  # without making its texts
        return name in self.table.column_names

    def __iter__(self) -> Iterator[str]:
        return iter(self.table.column_names)

    def __len__(self) -> int:
        return len(self.table.column_names)

    def texts(self, name: str) -> list[str]:
        """(n,) cells of a column, without surrounding blanks."""
        if name not in self.table.column_names:
            raise KeyError(name)
        return [_text(value) for value in self.table.column(name).to_pylist()]

    def numbers(self, name: str, required: bool) -> Array | None:
        """(n,) a column, NaN where it is null; None when it holds anything else, or a null if `required`."""
        column = self.table.column(name)
        if str(column.type) not in _NUMBERS:
            return None
        values = np.array(column.to_numpy(), dtype=np.float64)
        return None if np.isinf(values).any() or (required and np.isnan(values).any()) else values


_NUMBERS = {
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
    *("halffloat", "float", "double"),
}


def _text(value: Any) -> str:
    if value is None or value != value:
        return ""
    return str(value).replace("\0", " ").strip()


def read_cells(path: Path, block: int, between: str) -> ParquetCells:
    """The columns of a Parquet file.

    Raises
    ------
    DependencyError : pyarrow is not installed.
    InputError : a table without rows, or that does not fit into the memory.
    """
    demand(PARQUET)
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        there = file.metadata
        check_memory("The table", 16 * there.num_rows * max(there.num_columns, 1), path)
        table = file.read()
    if not table.num_rows:
        raise InputError("The table has a header but no rows", file=path, advice="Add rows to it")
    return ParquetCells(table, block, between)


def renamed(cells: ParquetCells, header: Sequence[str]) -> ParquetCells:
    """The same columns under other names."""
    return ParquetCells(cells.table.rename_columns(list(header)), cells.block, cells.between)


def write_parquet(path: str | Path, tables: Iterable[Mapping[str, Any]]) -> None:
    """Write tables of the same columns, one below the other; NaN becomes null.

    Raises
    ------
    DependencyError : pyarrow is not installed.
    """
    demand(PARQUET)
    import pyarrow as pa
    from pyarrow import parquet

    with output_file(path) as draft:
        writer: Any = None
        try:
            for columns in tables:
                cells = {name: pa.array(values, from_pandas=True) for name, values in columns.items()}
                table = pa.table(cells) if writer is None else pa.table(cells).cast(writer.schema)
                writer = writer or parquet.ParquetWriter(draft, table.schema, compression=PACKING)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()
