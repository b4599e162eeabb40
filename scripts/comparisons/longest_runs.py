# SPDX-License-Identifier: GPL-3.0-or-later
"""Friction from the longest third of falls whose friction is known: as if they were all, and as what they are.

    python scripts/comparisons/longest_runs.py [repeats] [first seed]     # some ten seconds of one core each

48 blocks fall down a slope that ends in a flat; the longest 16 are observed. The script prints the 95 % interval of
the friction from all of them, from the longest third with nothing stated, as the tool says it would be if they were
the longest third, and from the longest third that is stated to be it; and how often each holds the truth.
"""

import sys

import numpy as np
from rockfall.core.analysis.completeness import parse_completeness
from rockfall.core.analysis.observed_runs import observe_stops
from rockfall.core.analysis.paths import simulated_paths
from rockfall.core.analysis.priors import make_priors
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import find_model
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.back_analysis import back_analyse

FALLS, SEEN = 48, 16
FRICTION = 0.5
MODEL = "stevens_1998"
SETS, ROUNDS = 300, 2
REPEATS = 10


def site() -> tuple[Ground, Releases]:
    """A rough slope of 37° that ends in one of 6°, and blocks that start 2 m above its upper end."""
    line = np.arange(100) * 2.0
    x, y = np.meshgrid(line, line)
    z = -0.75 * np.minimum(x, 80) - 0.1 * np.maximum(x - 80, 0) + 0.3 * np.sin(x / 2.3) * np.cos(y / 3.1)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices, faces = np.column_stack([x.ravel(), y.ravel(), z.ravel()]), np.concatenate([lower, upper])
    ground = make_ground(Surface(vertices, faces.astype(np.int32), GlobalShift(), "slope"))
    xy = np.column_stack([np.full(FALLS, 5.0), 20.0 + 3.2 * np.arange(FALLS)])
    place = placed_on(ground, xy, np.full(FALLS, 0.4)) + np.array([0.0, 0.0, 2.0])
    names = np.array([f"B{i}" for i in range(FALLS)])
    return ground, make_releases(place, name=names, velocity=np.tile([3.0, 0.0, 0.0], (FALLS, 1)))


def main() -> None:
    """Print a line for each repeat, and how often the truth is held."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    ground, fell = site()
    held: dict[str, list[tuple[bool, float]]] = {}
    for seed in range(first, first + repeats):
        paths = simulated_paths(simulate(ground, fell, Settings(MODEL, friction=FRICTION, seed=1000 + seed)))
        start = paths.start[paths.first_piece[:-1]]
        longest = np.argsort(-np.hypot(*(paths.stop - start)[:, :2].T))[:SEEN]
        cells = []
        for label, rows, stated in (
            ("all", np.arange(FALLS), "complete"),
            ("third, nothing stated", longest, ""),
            ("third, stated", longest, "longest"),
        ):
            observed = observe_stops(paths.name[rows], start[rows], paths.stop[rows], paths.mass_kg[rows])
            found = back_analyse(
                ground, observed, fell, Settings(MODEL, seed=seed),
                make_priors(find_model(MODEL), ["friction"], {}),
                sets=SETS, rounds=ROUNDS, completeness=parse_completeness(stated),
            )  # fmt: skip
            one = found.estimates[0]
            told = [(label, one.low, one.median, one.high)]
            if found.if_longest is not None:
                what = found.if_longest
                told.append(("would be, if third", what.low[0], what.median[0], what.high[0]))
            for name, low, median, high in told:
                held.setdefault(name, []).append((low < FRICTION < high, median - FRICTION))
                cells.append(f"{name} {median:.3f} ({low:.3f}…{high:.3f})")
        print(f"{seed:>3}  {'   '.join(cells)}", flush=True)
    for name, values in held.items():
        right, off = np.array(values).T
        print(f"{name:<24}truth in {right.sum():.0f} of {right.size} intervals, median off by {off.mean():+.3f}")


if __name__ == "__main__":
    main()
