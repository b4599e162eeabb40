# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick the reconstruction is: impacts and flights with drag per second, beside a plain loop in the same run."""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import Picks, make_picks
from rockfall.core.reconstruction.trajectory import reconstruct


def made_picks(impacts: int, per_trajectory: int) -> Picks:
    """Random bounces down a slope of 35°, with normals."""
    rng = np.random.default_rng(1)
    number = np.arange(impacts)
    step = rng.uniform(0.3, 1.5, impacts)
    position = np.cumsum(step[:, None] * [7.0, 0, -4.9] + rng.normal(size=(impacts, 3)) * 0.4, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.1 * rng.normal(size=(impacts, 3))
    names = np.char.add("block ", (number // per_trajectory).astype(str))
    return make_picks(names, np.cumsum(step), position, normal=normal)


def plain_loop(times: list[float], positions: list[list[float]], normals: list[list[float]], names: list[str]) -> list:
    """Eq. 5–10 impact by impact, as one would write them down."""
    rows = []
    for i in range(1, len(times) - 1):
        if not names[i - 1] == names[i] == names[i + 1]:
            continue
        before, after = times[i] - times[i - 1], times[i + 1] - times[i]
        v1 = [(b - a) / before for a, b in zip(positions[i - 1], positions[i], strict=True)]
        v2 = [(b - a) / after for a, b in zip(positions[i], positions[i + 1], strict=True)]
        v1[2] -= 0.5 * 9.81 * before
        v2[2] += 0.5 * 9.81 * after
        n = normals[i]
        d1, d2 = sum(a * b for a, b in zip(v1, n, strict=True)), sum(a * b for a, b in zip(v2, n, strict=True))
        t1 = math.sqrt(sum((a - d1 * b) ** 2 for a, b in zip(v1, n, strict=True)))
        t2 = math.sqrt(sum((a - d2 * b) ** 2 for a, b in zip(v2, n, strict=True)))
        s1, s2 = math.sqrt(sum(a * a for a in v1)), math.sqrt(sum(a * a for a in v2))
        along = sum(a * b for a, b in zip(v1, v2, strict=True))
        across = math.hypot(v1[1] * v2[2] - v1[2] * v2[1], v1[2] * v2[0] - v1[0] * v2[2], v1[0] * v2[1] - v1[1] * v2[0])
        if d1 < 0:
            rows.append((abs(d2 / d1), t2 / t1, s2 / s1, math.atan2(abs(d1), t1), math.atan2(across, along)))
        else:
            rows.append((math.nan,) * 5)
    return rows


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least and median time of some runs [s]."""
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        kept = work()  # noqa: F841 — as a caller does; freeing it is not part of the work
        taken.append(time.perf_counter() - start)
    return min(taken), statistics.median(taken)


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=100_000)
    parser.add_argument("--flights-with-drag", type=int, default=5_000)
    arguments = parser.parse_args()
    n = arguments.impacts

    picks = made_picks(n, 20)
    reconstruct(made_picks(100, 20))  # imports
    first, _ = timed(lambda: reconstruct(picks), 1)
    least, median = timed(lambda: reconstruct(picks), 15)
    print(f"reconstruct: {n} impacts in {1e3 * median:.1f} ms (best {1e3 * least:.1f}, first {1e3 * first:.1f} ms)")
    print(f"             {n / median:,.0f} impacts/s")

    columns = picks.time_s.tolist(), picks.position.tolist(), picks.normal.tolist(), picks.trajectory.tolist()
    loop, _ = timed(lambda: plain_loop(*columns), 1)
    impacts = reconstruct(picks).impacts
    inner = ~(impacts.flags["first"] | impacts.flags["last"])
    ours = np.stack([impacts.rn, impacts.rt, impacts.r, impacts.theta1, impacts.theta_dev], axis=1)[inner]
    np.testing.assert_allclose(ours, np.array(plain_loop(*columns)), rtol=1e-6, atol=1e-9)
    print(
        f"plain loop:  {1e3 * loop:.0f} ms, {loop / median:.1f} times as long, for the coefficients alone; same numbers"
    )

    dragged = made_picks(arguments.flights_with_drag + 1, 10**9)
    _, median = timed(lambda: reconstruct(dragged, drag=Drag()), 3)
    print(f"with drag:   {arguments.flights_with_drag / median:,.0f} flights/s")


if __name__ == "__main__":
    main()
