# SPDX-License-Identifier: GPL-3.0-or-later
"""How long calibration takes on a table of the usual size, and reading, merging, filtering, grouping on a large one."""

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from rockfall.core.analysis.calibration import calibrate
from rockfall.core.analysis.estimation import FitOptions
from rockfall.core.exchange.database import Database, merge, read_source
from rockfall.core.exchange.datapackage import write_package
from rockfall.core.exchange.selection import group_medians, matching
from rockfall.core.exchange.tables import write_impacts
from rockfall.core.reconstruction.impact import Impacts
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

FITTED = {
    "azimi_desvarreux_1977": ("rn", "rt"),
    "dorren_2015": ("rn", "rg20"),
    "noel_2017": ("rn_exponent", "rt"),
    "pfeiffer_bowen_1989": ("rn", "rt"),
    "stevens_1998": ("rn", "rt"),
    "wyllie_2014": ("rn_factor", "rn_exponent"),
}


def made_impacts(trajectories: int, each: int, site: str = "gully", seed: int = 3) -> Impacts:
    """Impacts down a slope of 35°."""
    rng = np.random.default_rng(seed)
    n = trajectories * each
    step = rng.uniform(0.4, 1.2, n)
    position = np.cumsum(step[:, None] * [6.0, 0, -4.2] + rng.normal(size=(n, 3)) * 0.3, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.05 * rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    names = np.repeat([f"block {k}" for k in range(trajectories)], each)
    return reconstruct(make_picks(names, np.cumsum(step), position, normal=normal), site=site).impacts


def repeated(impacts: Impacts, times: int) -> Impacts:
    """The same impacts again and again, under other names, a little quicker each time."""
    taken: dict[str, Any] = {}
    for field in fields(Impacts):
        value = getattr(impacts, field.name)
        if isinstance(value, np.ndarray):
            taken[field.name] = np.concatenate([value] * times)
    taken["flags"] = {name: np.concatenate([mask] * times) for name, mask in impacts.flags.items()}
    run = np.repeat(np.arange(times), len(impacts)).astype(np.str_)
    taken["trajectory"] = np.char.add(np.char.add(taken["trajectory"], " of "), run)
    taken["v2"] = taken["v2"] * np.repeat(1 + 1e-4 * np.arange(times), len(impacts))[:, None]
    return replace(impacts, **taken)


def timed(what: str, work: Callable[[], Any]) -> Any:
    """Say how long it takes, by the clock and in the processor, and return what it gives."""
    clock, processor = time.perf_counter(), time.process_time()
    result = work()
    print(f"  {what:<44}{time.perf_counter() - clock:>8.2f} s{time.process_time() - processor:>8.2f} s", flush=True)
    return result


def main() -> None:
    """Print the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=1_000_000)
    arguments = parser.parse_args()
    print(f"{'':<46}{'clock':>8}{'CPU':>12}   ({os.process_cpu_count()} cores, load {os.getloadavg()[0]:.1f})")

    impacts = made_impacts(15, 9)
    calibrate(impacts, "noel_2017", ["rt"], options=FitOptions(resamples=20))  # compiles
    used = calibrate(impacts, "noel_2017", ["rt"], options=FitOptions(resamples=20)).impacts
    print(f"Calibration on {used} impacts, two parameters, 200 resamples, hold-out:")
    timed("six models", lambda: [timed(name, lambda n=name: calibrate(impacts, n, FITTED[n])) for name in FITTED])

    base = made_impacts(1000, 10)
    half = max(arguments.impacts // 2 // len(base), 1)
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{site}.csv" for site in ("gully", "quarry")]
        print(f"Two tables of {half * len(base):,} impacts each:")
        for path, seed in zip(paths, (3, 4), strict=True):
            made = repeated(made_impacts(1000, 10, path.stem, seed), half)
            timed(f"write {path.name} ({len(made):,})", lambda made=made, path=path: write_impacts(made, path))
        parts: list[Database] = [
            timed(f"read {path.name}, units checked", lambda p=path: read_source(p)) for path in paths
        ]
        database = timed("merge, duplicates found", lambda: merge(parts)).database
        found = timed("filter by two conditions", lambda: matching(database.impacts, ["theta1_deg<20", "rn>1"]))
        groups = timed("group by site, medians", lambda: group_medians(database.impacts, ["site"]))
        timed("group by trajectory, medians", lambda: group_medians(database.impacts, ["site", "trajectory"]))
        timed("write the package", lambda: write_package(database, folder))
        print(f"  {len(database):,} impacts, {found.sum():,} match, {len(groups)} sites")
    print(f"Peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.1f} GB")


if __name__ == "__main__":
    main()
