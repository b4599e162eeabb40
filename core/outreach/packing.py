# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers for a web page: tables in one compressed text, which the page's viewer takes apart again."""

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {"uint8": "u1", "uint16": "<u2", "uint32": "<u4", "float32": "<f4"}


@dataclass(eq=False)
class Packing:
    """Tables one after the other.

    Attributes
    ----------
    tables : name → kind of number, shape, and whether rows are stored as differences.
    parts : their bytes, all first bytes of the numbers before all second ones: that compresses better.
    """

    tables: dict[str, dict[str, Any]] = field(default_factory=dict)
    parts: list[bytes] = field(default_factory=list)

    def add(self, name: str, values: Any, kind: str, *, differences: bool = False) -> None:
        """Add a table of whole numbers or floats; `differences`, of whole numbers, wrap around."""
        table: NDArray[Any] = np.ascontiguousarray(values, dtype=KINDS[kind])
        stored = table
        if differences and len(table):
            stored = np.concatenate([table[:1], table[1:] - table[:-1]])  # unsigned: wraps as it should
        self.tables[name] = {"kind": kind, "shape": list(table.shape), "differences": differences}
        self.parts.append(stored.reshape(-1).view(np.uint8).reshape(-1, table.itemsize).T.tobytes())

    def text(self) -> str:
        """All tables, compressed, as letters."""
        return base64.b64encode(zlib.compress(b"".join(self.parts), 9)).decode("ascii")


@dataclass(frozen=True, eq=False)
class Quantised:
    """Places as whole numbers: place = low + step · number.

    Attributes
    ----------
    number : (n, 3) 0…65535.
    low, step : (3,) [m].
    """

    number: NDArray[np.uint16]
    low: NDArray[np.float64]
    step: NDArray[np.float64]


def quantise(places: NDArray[np.float64]) -> Quantised:
    """Places (n, 3) in 65535 steps across their box."""
    low = places.min(axis=0)
    step = np.maximum((places.max(axis=0) - low) / 65535.0, 1e-9)
    return Quantised(np.round((places - low) / step).astype(np.uint16), low, step)


def in_reading_order(faces: NDArray[np.int32]) -> NDArray[np.int64]:
    """The same triangles, each from its lowest corner on and the lowest first: neighbours then differ little."""
    turn = faces.argmin(axis=1)
    rows = np.arange(len(faces))
    turned = np.stack([faces[rows, (turn + k) % 3] for k in range(3)], axis=1).astype(np.int64)
    return turned[np.lexsort((turned[:, 1], turned[:, 0]))]
