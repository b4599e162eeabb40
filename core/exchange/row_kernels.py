# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of a table with all digits of its numbers: compiled kernel."""

from ..compiled import kernel
from .shortest_kernels import write_double

COMMA, LINE = 44, 10


@kernel
def write_full_rows(bits, texts, places, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the text of n rows; returns how many bytes.

    Parameters
    ----------
    bits : (numbers, n) of the columns of numbers.
    texts : of the columns of text, one behind the other: the bytes of their cells, each with a new line behind it.
    places : (columns,) row of `bits`; or −1 − k where the column's text begins at the byte k, of which each row that is
        written moves on.
    """
    k = 0
    for i in range(bits.shape[1]):
        for j in range(places.size):
            if places[j] >= 0:
                k = write_double(out, k, bits[places[j], i])
            else:
                b = -1 - places[j]
                while texts[b] != LINE:
                    out[k] = texts[b]
                    k += 1
                    b += 1
                places[j] = -2 - b
            out[k] = COMMA
            k += 1
        out[k - 1] = LINE
    return k
