# SPDX-License-Identifier: GPL-3.0-or-later
"""SQLite databases that came from somebody else: opened so that nothing in them can take much memory or time."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import count
from pathlib import Path

STEPS, LEAST_STEPS, STEPS_A_BYTE = 100_000, 10_000_000, 10
"""Of SQLite's machine: between two looks, and so many that a file may take. A row of a table takes some ten."""
MOST_BYTES = 50_000_000
"""Of one text or blob, also while it is computed: a polygon of a million corners has 24 MB."""
HEAP_BYTES = 200_000_000
"""SQLite's own memory, all its connections together."""
LIMITS = {
    sqlite3.SQLITE_LIMIT_LENGTH: MOST_BYTES,
    sqlite3.SQLITE_LIMIT_SQL_LENGTH: 1_000_000,
    sqlite3.SQLITE_LIMIT_COLUMN: 2000,
    sqlite3.SQLITE_LIMIT_EXPR_DEPTH: 100,
    sqlite3.SQLITE_LIMIT_COMPOUND_SELECT: 50,
    sqlite3.SQLITE_LIMIT_VDBE_OP: 100_000,
    sqlite3.SQLITE_LIMIT_FUNCTION_ARG: 20,
    sqlite3.SQLITE_LIMIT_ATTACHED: 0,
    sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH: 10,
}


@contextmanager
def foreign_database(path: Path) -> Iterator[sqlite3.Connection]:
    """A database that is only read, whose functions, views and triggers are not trusted.

    Raises
    ------
    sqlite3.Error : it is no database, is damaged, or takes more than it may; see `endless`.
    """
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
        for limit, most in LIMITS.items():
            database.setlimit(limit, most)
        looks, most_steps = count(1), LEAST_STEPS + STEPS_A_BYTE * path.stat().st_size
        database.set_progress_handler(lambda: STEPS * next(looks) > most_steps, STEPS)
        database.execute("PRAGMA trusted_schema = OFF")
        database.execute("PRAGMA cell_size_check = ON")
        database.execute("PRAGMA mmap_size = 0")
        database.execute(f"PRAGMA soft_heap_limit = {HEAP_BYTES}")
        database.row_factory = sqlite3.Row
        yield database


def endless(error: BaseException) -> bool:
    """Whether it was ended since it took more steps than it may."""
    return getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_INTERRUPT


def is_plain_table(database: sqlite3.Connection, name: str) -> bool:
    """Whether this is a table whose columns are stored: no view, no virtual table, no column that is computed."""
    row = database.execute("SELECT type, sql FROM sqlite_schema WHERE name = ? COLLATE NOCASE", (name,)).fetchone()
    if row is None or row["type"] != "table" or str(row["sql"]).lstrip().upper().startswith("CREATE VIRTUAL"):
        return False
    quoted = name.replace('"', '""')
    return all(column["hidden"] == 0 for column in database.execute(f'PRAGMA table_xinfo("{quoted}")'))
