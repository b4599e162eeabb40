# SPDX-License-Identifier: GPL-3.0-or-later
"""Values under whole-number keys, kept as they are while they are few, then as logarithmic bins: compiled kernels.

All of it is in one `pool` of blocks (b, 16) of 32 bits. A slot, that of one key, has either a `raw` run of blocks with
its rows of q single-precision values, or for each of the q columns a run of blocks with the counts of as many bins.
Runs that a slot has outgrown are given to the next that needs as many blocks: `state` has, for each number of blocks,
the first free run, whose first number is the next one; then how many blocks of the pool, and how many slots, are used.

Bins are those of a cubic in place of the logarithm between powers of two (Masson, Rim & Lee 2019, DDSketch), `OCTAVE`
of them to each: nowhere wider than e^0.02, so that the middle of a bin is within 1 % of all that is in it.
"""

from math import nan, sqrt

import numpy as np

from ..compiled import borrowing, kernel

WIDTH = 16
"""Numbers of a block."""
FEW = 256
"""A key that has no more values keeps them as they are."""
OCTAVE, LOWEST, OCTAVES = 35, -10, 50
"""Bins between one power of two and the next; the first power, and how many; below it is the first bin."""
MOST_BINS = OCTAVE * OCTAVES
MOST_BLOCKS = MOST_BINS // WIDTH + 1
"""Of one column; raw runs are shorter."""
USED, SLOTS = MOST_BLOCKS + 1, MOST_BLOCKS + 2
"""Where `state` has them."""
FULL = 2.0**62
"""A sum beyond this is an overflow soon."""
DONE, POOL, OVERFLOW = -1, 0, 1


@borrowing
def bin_of(value):  # type: ignore[no-untyped-def]
    """The bin of a single-precision number."""
    bits = np.float32(value).view(np.int32)
    power = (bits >> 23) - 127 - LOWEST
    if not value > 0.0 or power < 0:
        return 0
    f = (bits & 0x7FFFFF) * 2.0**-23
    place = OCTAVE * (power + f * (10.0 / 7.0 + f * (-0.6 + f * (6.0 / 35.0))))
    return min(np.int64(place), MOST_BINS - 1)


@kernel
def edges():  # type: ignore[no-untyped-def]
    """(`MOST_BINS` + 1,) the least value of each bin, and the end of the last."""
    found = np.empty(MOST_BINS + 1)
    for i in range(MOST_BINS + 1):
        low, high, part = 0.0, 1.0, (i % OCTAVE) / OCTAVE
        for _ in range(60):
            f = 0.5 * (low + high)
            if f * (10.0 / 7.0 + f * (-0.6 + f * (6.0 / 35.0))) <= part:
                low = f
            else:
                high = f
        found[i] = 2.0 ** (i // OCTAVE + LOWEST) * (1.0 + low)
    return found


@borrowing
def _take(pool, state, blocks):  # type: ignore[no-untyped-def]
    """The first block of a run; its numbers are zero."""
    first = state[blocks]
    if first >= 0:
        state[blocks] = np.int64(pool[first, 0]) - 1
    else:
        first = state[USED]
        state[USED] += blocks
    for i in range(first, first + blocks):
        for k in range(WIDTH):
            pool[i, k] = 0
    return first


@borrowing
def _give(pool, state, first, blocks):  # type: ignore[no-untyped-def]
    pool[first, 0] = state[blocks] + 1
    state[blocks] = first


@borrowing
def _widen(pool, state, runs, slot, column, low, high):  # type: ignore[no-untyped-def]
    """Let the bins of a column reach from block `low` to block `high`, both included."""
    first, least, blocks = runs[slot, column, 0], runs[slot, column, 1], runs[slot, column, 2]
    if blocks:
        low, high = min(low, least), max(high, least + blocks - 1)
    if high - low + 1 == blocks:
        return
    new = _take(pool, state, high - low + 1)
    for i in range(blocks):
        for k in range(WIDTH):
            pool[new + least - low + i, k] = pool[first + i, k]
    if blocks:
        _give(pool, state, first, blocks)
    runs[slot, column, 0], runs[slot, column, 1], runs[slot, column, 2] = new, low, high - low + 1


@borrowing
def _put(pool, state, runs, slot, column, values, start, stop):  # type: ignore[no-untyped-def]
    """Count values of a column in bins; those that are no numbers are left out."""
    least, most = MOST_BINS, -1
    for i in range(start, stop):
        value = values[i, column]
        if value == value:
            place = bin_of(value)
            least, most = min(least, place), max(most, place)
    if most < 0:
        return
    _widen(pool, state, runs, slot, column, least // WIDTH, most // WIDTH)
    first, low = runs[slot, column, 0], WIDTH * runs[slot, column, 1]
    for i in range(start, stop):
        value = values[i, column]
        if value == value:
            place = bin_of(value) - low
            pool[first + place // WIDTH, place % WIDTH] += 1


@borrowing
def _to_bins(pool, floats, state, raw, runs, slot, rows, held):  # type: ignore[no-untyped-def]
    """Turn the rows that a slot has into counts. held : work space (`FEW`, q)."""
    columns = held.shape[1]
    each = WIDTH // columns
    first, blocks = raw[slot, 0], raw[slot, 1]
    for r in range(rows):
        for c in range(columns):
            held[r, c] = floats[first + r // each, r % each * columns + c]
    _give(pool, state, first, blocks)
    raw[slot, 1] = 0
    for c in range(columns):
        _put(pool, state, runs, slot, c, held, 0, rows)


@borrowing
def slot_for(key, slot_of, keys, state):  # type: ignore[no-untyped-def]
    """The slot of a key; a new one has nothing."""
    slot = slot_of[key]
    if slot < 0:
        slot = np.int32(state[SLOTS])
        state[SLOTS] += 1
        slot_of[key], keys[slot] = slot, key
    return slot


@kernel
def count_keys(key, counts):  # type: ignore[no-untyped-def]
    """Add to `counts` (keys, 2) how often each is there, and how often as the first of a run: those are −1 − key."""
    for i in range(len(key)):
        k = key[i]
        if k < 0:
            counts[-1 - k, 1] += 1
            counts[-1 - k, 0] += 1
        else:
            counts[k, 0] += 1


@kernel
def sort_values(key, values, place, out):  # type: ignore[no-untyped-def]
    """Put rows where those of their key go: `place` (keys,) is the next of each."""
    for i in range(len(key)):
        k = key[i]
        if k < 0:
            k = -1 - k
        to = place[k]
        place[k] = to + 1
        for c in range(values.shape[1]):
            out[to, c] = values[i, c]


@kernel
def fold(  # type: ignore[no-untyped-def]
    wanted, begin, reach, values, units, column, limits, start,
    pool, floats, state, slot_of, keys, counts, sums, greatest, over, raw, runs,
):  # fmt: skip
    """Count values under their keys; returns `DONE`, or where it stopped and why: `POOL` too small, or `OVERFLOW`.

    Parameters
    ----------
    wanted : (k,) keys, with the rows from `begin` (k + 1,) on of `values` (p, q); reach : (k,).
    units : (q,) of the sums. column, limits : of which it is counted how many are above.
    start : the first of the keys.
    """
    columns = values.shape[1]
    each = WIDTH // columns
    held = np.empty((FEW, columns), np.float32)
    for i in range(start, len(wanted)):
        if state[USED] + MOST_BLOCKS * (columns + 1) > len(pool):
            return i, POOL
        slot = slot_for(wanted[i], slot_of, keys, state)
        low, high = begin[i], begin[i + 1]
        before = counts[slot, 0]
        for c in range(columns):
            total, most = sums[slot, c], greatest[slot, c]
            for j in range(low, high):
                value = values[j, c]
                if value == value:
                    total += np.int64(np.rint(value / units[c]))
                    most = max(most, value)
            if abs(np.float64(total)) > FULL:
                return i, OVERFLOW
            sums[slot, c], greatest[slot, c] = total, most
        for k in range(len(limits)):
            above = 0
            for j in range(low, high):
                above += values[j, column] > limits[k]
            over[slot, k] += above
        counts[slot, 0] = before + high - low
        counts[slot, 1] += reach[i]
        if counts[slot, 0] <= FEW:
            blocks = raw[slot, 1]
            if counts[slot, 0] > blocks * each:
                more = max(blocks, 1)
                while counts[slot, 0] > more * each:
                    more *= 2
                new = _take(pool, state, more)
                for b in range(blocks):
                    for k in range(WIDTH):
                        pool[new + b, k] = pool[raw[slot, 0] + b, k]
                if blocks:
                    _give(pool, state, raw[slot, 0], blocks)
                raw[slot, 0], raw[slot, 1] = new, more
            for j in range(low, high):
                r = before + j - low
                for c in range(columns):
                    floats[raw[slot, 0] + r // each, r % each * columns + c] = values[j, c]
            continue
        if raw[slot, 1]:
            _to_bins(pool, floats, state, raw, runs, slot, before, held)
        for c in range(columns):
            _put(pool, state, runs, slot, c, values, low, high)
    return len(wanted), DONE


@kernel
def fold_bins(  # type: ignore[no-untyped-def]
    wanted, start, bins, bin_begin, bin_counts, new_counts, new_sums, new_greatest, new_over,
    pool, floats, state, slot_of, keys, counts, sums, greatest, over, raw, runs,
):  # fmt: skip
    """Count what another one has in bins (see `export`) under keys (k,); returns as `fold`."""
    columns = sums.shape[1]
    held = np.empty((FEW, columns), np.float32)
    for i in range(start, len(wanted)):
        if state[USED] + MOST_BLOCKS * (columns + 1) > len(pool):
            return i, POOL
        slot = slot_for(wanted[i], slot_of, keys, state)
        for c in range(columns):
            total = sums[slot, c] + new_sums[i, c]
            if abs(np.float64(sums[slot, c]) + np.float64(new_sums[i, c])) > FULL:
                return i, OVERFLOW
            sums[slot, c], greatest[slot, c] = total, max(greatest[slot, c], new_greatest[i, c])
        if raw[slot, 1]:
            _to_bins(pool, floats, state, raw, runs, slot, counts[slot, 0], held)
        for k in range(2):
            counts[slot, k] += new_counts[i, k]
        for k in range(over.shape[1]):
            over[slot, k] += new_over[i, k]
        for c in range(columns):
            first, stop = bin_begin[i, c], bin_begin[i, c + 1]
            if first == stop:
                continue
            _widen(pool, state, runs, slot, c, bins[first] // WIDTH, bins[stop - 1] // WIDTH)
            here, low = runs[slot, c, 0], WIDTH * runs[slot, c, 1]
            for j in range(first, stop):
                place = bins[j] - low
                pool[here + place // WIDTH, place % WIDTH] += bin_counts[j]
    return len(wanted), DONE


@borrowing
def put_in_order(values, n, out):  # type: ignore[no-untyped-def]
    """Fill `out` with the first n values in rising order, at most `FEW`; then what is no number. Returns how many are.

    Each goes where as many are smaller: n² comparisons, but eight in a step and without a branch, several times as
    quick as to sort so few.
    """
    for j in range(n):
        out[j] = nan
    count = 0
    for i in range(n):
        value = values[i]
        place = np.uint32(0)
        for j in range(n):
            place = np.uint32(place + np.uint32(values[j] < value))
        if value == value:
            while out[place] == value:  # one of the same has come before
                place += np.uint32(1)
            out[place] = value
            count += 1
    return count


@kernel
def count_bins(slots, pool, columns, runs, number):  # type: ignore[no-untyped-def]
    """Fill `number` (k, q): how many bins of each slot have a value."""
    for i in range(len(slots)):
        for c in range(columns):
            first, blocks = runs[slots[i], c, 0], runs[slots[i], c, 2]
            number[i, c] = 0
            for b in range(first, first + blocks):
                for k in range(WIDTH):
                    number[i, c] += pool[b, k] > 0


@kernel
def export(slots, pool, floats, raw, runs, columns, rows_begin, rows, bin_begin, bins, bin_counts):  # type: ignore[no-untyped-def]
    """Fill rows and bins of slots (k,), each column of the rows in rising order.

    Parameters
    ----------
    rows_begin : (k + 1,) of each slot in `rows` (p, q); bin_begin : (k, q + 1) in `bins` and `bin_counts`.
    """
    each = WIDTH // columns
    held, ordered = np.empty(FEW, np.float32), np.empty(FEW, np.float32)
    for i in range(len(slots)):
        slot = slots[i]
        first, n = rows_begin[i], rows_begin[i + 1] - rows_begin[i]
        for c in range(columns):
            for r in range(n):
                held[r] = floats[raw[slot, 0] + r // each, r % each * columns + c]
            put_in_order(held, n, ordered)
            for r in range(n):
                rows[first + r, c] = ordered[r]
            at = bin_begin[i, c]
            for b in range(runs[slot, c, 2]):
                for k in range(WIDTH):
                    count = pool[runs[slot, c, 0] + b, k]
                    if count:
                        bins[at], bin_counts[at] = WIDTH * (runs[slot, c, 1] + b) + k, count
                        at += 1


@borrowing
def _at_rank(values, n, rank):  # type: ignore[no-untyped-def]
    low = min(np.int64(rank), n - 1)
    high = min(low + 1, n - 1)
    a, b = np.float64(values[low]), np.float64(values[high])
    return a + (rank - low) * (b - a)


@borrowing
def _in_bins(pool, run, edge, rank, spread):  # type: ignore[no-untyped-def]
    """The value of a rank: the middle of its bin, between two ranks in proportion; or spread over the bin."""
    below, low, wanted = 0, nan, np.int64(rank)
    for b in range(run[2]):
        for k in range(WIDTH):
            count = int(pool[run[0] + b, k])
            if not count:
                continue
            i = WIDTH * (run[1] + b) + k
            middle = 2.0 * edge[i] * edge[i + 1] / (edge[i] + edge[i + 1])
            if low == low:  # the rank is the last of the bin before
                return low + (rank - wanted) * (middle - low)
            below += count
            if wanted < below:
                if spread:
                    return edge[i] + (edge[i + 1] - edge[i]) * (rank - (below - count) + 0.5) / count
                if wanted + 1 < below or rank == wanted:
                    return middle
                low = middle
    return low


@kernel
def figures(  # type: ignore[no-untyped-def]
    slots, shares, erring, units, edge, pool, floats, counts, sums, greatest, raw, runs, mean, quantiles, error
):
    """Fill `mean` (k, q), `quantiles` (k, q, s) and `error` (k, q), the standard error of the share `erring`.

    Notes
    -----
    The error is half of what the quantile moves by with the rank's own deviation, √(p(1 − p)/n), up and down. n is the
    number of runs, not that of values: those of one run depend on each other. NaN where the ranks have no such room.
    """
    columns = sums.shape[1]
    each = WIDTH // columns
    held, ordered = np.empty(FEW, np.float32), np.empty(FEW, np.float32)
    for i in range(len(slots)):
        slot = slots[i]
        deviation = sqrt(erring * (1.0 - erring) / counts[slot, 1])
        for c in range(columns):
            n = 0
            if raw[slot, 1]:
                for r in range(counts[slot, 0]):
                    held[r] = floats[raw[slot, 0] + r // each, r % each * columns + c]
                n = put_in_order(held, counts[slot, 0], ordered)
            else:
                for b in range(runs[slot, c, 2]):
                    for k in range(WIDTH):
                        n += int(pool[runs[slot, c, 0] + b, k])
            mean[i, c], error[i, c] = nan, nan
            quantiles[i, c, :] = nan
            if not n:
                continue
            mean[i, c] = sums[slot, c] * units[c] / n
            for s in range(len(shares)):
                if raw[slot, 1]:
                    quantiles[i, c, s] = _at_rank(ordered, n, shares[s] * (n - 1))
                else:
                    value = _in_bins(pool, runs[slot, c], edge, shares[s] * (n - 1), False)
                    quantiles[i, c, s] = min(value, np.float64(greatest[slot, c]))
            if erring - deviation > 0.0 and erring + deviation < 1.0:
                low, high = (erring - deviation) * (n - 1), (erring + deviation) * (n - 1)
                if raw[slot, 1]:
                    error[i, c] = 0.5 * (_at_rank(ordered, n, high) - _at_rank(ordered, n, low))
                else:
                    run = runs[slot, c]
                    error[i, c] = 0.5 * (_in_bins(pool, run, edge, high, True) - _in_bins(pool, run, edge, low, True))
