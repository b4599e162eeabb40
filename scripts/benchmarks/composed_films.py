# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a frame of each composed film takes, of the demo's footage, and the whole film by that.

python scripts/benchmarks/composed_films.py [frames of each] [width height]
"""

import os
import resource
import sys
import time
from pathlib import Path

import numpy as np
from rockfall.core.film.composed.catalogue import compose
from rockfall.core.film.composed.kinds import KINDS
from rockfall.core.film.composed.material import open_material
from rockfall.core.film.composed.request import FilmRequest

PROJECT = Path(__file__).resolve().parents[2] / "assets" / "demo" / "footage" / "project.toml"


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    size = (int(sys.argv[2]), int(sys.argv[3])) if len(sys.argv) > 3 else (1280, 720)
    load = f"load {os.getloadavg()[0]:.1f} on {os.process_cpu_count()} cores"
    print(f"{size[0]} × {size[1]}, {load}; seconds, CPU in brackets")
    print("film            before the first   a frame (median)   whole film   frames")
    for kind in KINDS:
        start, cpu = time.perf_counter(), time.process_time()
        film = compose(kind, open_material(FilmRequest(kind.name, PROJECT, *size)))
        film.canvas(film.frames // 2)
        ready, ready_cpu = time.perf_counter() - start, time.process_time() - cpu
        taken, used = [], []
        for frame in np.linspace(0, film.frames - 1, count).astype(int).tolist():
            start, cpu = time.perf_counter(), time.process_time()
            film.canvas(frame)
            taken.append(time.perf_counter() - start)
            used.append(time.process_time() - cpu)
        whole = ready + film.frames * float(np.mean(taken))
        print(
            f"{kind.name:<15} {ready:8.1f} ({ready_cpu:5.1f})   {np.median(taken):8.3f} ({np.median(used):.3f})   "
            f"{whole:8.0f}   {film.frames:8d}"
        )
    print(f"most memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
