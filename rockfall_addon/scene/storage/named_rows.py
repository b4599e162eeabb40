# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers by the name of a trajectory, kept with an object: the names as text, the rows as doubles."""

import json

import bpy
import numpy as np

from ....core.vectors import Array
from . import store


def tables(obj: bpy.types.Object, names_key: str, rows_key: str, columns: int) -> dict[str, Array]:
    """Name → (m, columns) rows."""
    names = store.read_json(obj, names_key, [])
    rows = np.array(obj.get(rows_key, ()), dtype=np.float64).reshape(-1, columns + 1)
    return {name: rows[rows[:, 0] == i, 1:] for i, name in enumerate(names)}


def keep(obj: bpy.types.Object, names_key: str, rows_key: str, kept: dict[str, Array]) -> None:
    """Keep tables, those without rows left out; the rows in the order of their first column."""
    kept = {name: rows for name, rows in kept.items() if len(rows)}
    if not kept:
        for key in (names_key, rows_key):
            if key in obj:
                del obj[key]
        return
    blocks = [
        np.c_[np.full(len(rows), i), rows[np.argsort(rows[:, 0], kind="stable")]]
        for i, rows in enumerate(kept.values())
    ]
    obj[names_key] = json.dumps(list(kept))
    obj[rows_key] = np.vstack(blocks).ravel().tolist()
