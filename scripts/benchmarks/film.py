# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the demo's film takes, with each engine that works here.

python scripts/benchmarks/film.py [frames] [preset]
"""

import sys
import tempfile
import time
from pathlib import Path

from rockfall.core.errors import DependencyError
from rockfall.core.film.engines import choose_engine
from rockfall.core.film.job import FilmJob
from rockfall.core.film.maker import film_maker

PROJECT = Path(__file__).resolve().parents[2] / "assets" / "demo" / "project.toml"
MIDDLE = 200
WHOLE = 452


def measure(engine: str, count: int, preset: str) -> None:
    """Print the time to load and dress the scene, and the time of a frame."""
    maker = film_maker()
    at: dict[int, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        frames = (MIDDLE, MIDDLE + count - 1)
        job = FilmJob("film", PROJECT, Path(folder) / "film.mp4", engine, preset, frames)
        start = time.perf_counter()

        def told(_text: str, done: int = 0, total: int = 0) -> None:
            if total and done:  # said again and again while a frame takes long
                at.setdefault(done, time.perf_counter() - start)

        maker.make(job, told)
    first, last = min(at), max(at)
    each = (at[last] - at[first]) / (last - first)
    print(
        f"{engine:<10} {preset}: first frame after {at[first]:5.1f} s, then {each:.3f} s a frame: "
        f"{at[first] + each * (WHOLE - 1):.0f} s for the film of {WHOLE} frames"
    )


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    preset = sys.argv[2] if len(sys.argv) > 2 else "preview"
    for engine in ("cycles", "workbench"):
        try:
            choose_engine(engine, film_maker().probe)
        except DependencyError as error:
            print(f"{engine:<10} {error}")
            continue
        measure(engine, count, preset)


if __name__ == "__main__":
    main()
