# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis of runs whose parameters are known, on the demo site: how often is the truth in the interval?

Blocks start as the measured ones of the demo site did. In each repeat the parameters are drawn at random, one block for
each start falls with them, and its whole run is given to `back_analyse` as observed. The script prints each truth with
its interval, how many of the 95 % and 50 % intervals hold it, and what a fit with nothing but luck would reach.

    python scripts/comparisons/back_analysis.py [repeats] [sets] [model] [parameter …]
"""

import sys
from pathlib import Path

import numpy as np
from rockfall.core.analysis.back_analysis import BackAnalysis
from rockfall.core.analysis.observed_runs import Observed
from rockfall.core.analysis.paths import simulated_paths
from rockfall.core.analysis.priors import make_priors
from rockfall.core.exchange.project import read_project
from rockfall.core.impact_models.registry import find_model
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.measured_releases import from_reconstruction
from rockfall.core.workflow.back_analysis import back_analyse
from rockfall.core.workflow.opening import open_terrain, reconstruct_project

PROJECT = Path(__file__).parents[2] / "assets" / "demo" / "project.toml"
MODEL, PARAMETERS = "stevens_1998", ("rn", "rt", "friction")
PRIORS = {"rn": "0.1..0.7", "rt": "0.5..0.95", "friction": "0.2..0.9"}
REPEATS, SETS, ROUNDS = 20, 1000, 3
STARTS = 9
"""Of the demo site's fifteen: those that were seen from their release on."""


def repeats(number: int, sets: int, model: str, names: tuple[str, ...], priors: dict[str, str]):
    """(truth, analysis) of each repeat."""
    project = read_project(PROJECT)
    terrain = open_terrain(project)
    ground = make_ground(terrain)
    releases = from_reconstruction(ground, reconstruct_project(project, terrain)).take(slice(0, STARTS))
    laws = make_priors(find_model(model), list(names), {name: priors[name] for name in names if name in priors})
    for repeat in range(number):
        place = np.random.default_rng([repeat, 1]).random((len(laws), 1))
        truth = {law.name: float(law.values(at)[0]) for law, at in zip(laws, place, strict=True)}
        own = {name: value for name, value in truth.items() if name != "friction"}
        friction = {"friction": truth["friction"]} if "friction" in truth else {}
        runs = simulate(ground, releases, Settings(model, own, seed=1000 + repeat, **friction))
        observed = Observed(simulated_paths(runs), np.zeros(len(runs), dtype=np.bool_))
        yield (
            truth,
            back_analyse(ground, observed, releases, Settings(model, seed=repeat), laws, sets=sets, rounds=ROUNDS),
        )


def inside(truth: dict[str, float], analysis: BackAnalysis) -> dict[str, tuple[bool, bool]]:
    """Parameter → whether the 95 % interval has the truth, and the 50 % one."""
    return {
        one.name: (one.low <= truth[one.name] <= one.high, one.half_low <= truth[one.name] <= one.half_high)
        for one in analysis.estimates
    }


def main() -> None:
    """Print the table."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else REPEATS
    sets = int(sys.argv[2]) if len(sys.argv) > 2 else SETS
    model = sys.argv[3] if len(sys.argv) > 3 else MODEL
    names = tuple(sys.argv[4:]) or PARAMETERS
    found, seconds, kept = [], [], []
    print(f"{model}, {STARTS} observed runs, {ROUNDS} rounds of {sets} sets")
    for repeat, (truth, analysis) in enumerate(repeats(number, sets, model, names, PRIORS), 1):
        held = inside(truth, analysis)
        cells = [
            f"{one.name} {truth[one.name]:.3f} in {one.low:.3f} … {one.high:.3f}{'' if held[one.name][0] else ' NO'}"
            for one in analysis.estimates
        ]
        wrong = sum(not check.fits for check in analysis.checks)
        print(
            f"{repeat:>3}  {'   '.join(cells)}   ({analysis.seconds:.0f} s, {wrong} quantities not given)", flush=True
        )
        found.append([held[name] for name in held])
        kept.append([one.kept for one in analysis.estimates])
        seconds.append(analysis.seconds)
    table = np.array(found)
    for i, name in enumerate(names):
        wide, narrow = table[:, i, 0].sum(), table[:, i, 1].sum()
        print(
            f"{name}: {wide} of {number} in the 95 % interval, {narrow} in the 50 % one; "
            f"{100 * np.mean(kept, axis=0)[i]:.0f} % of the prior left"
        )
    print(f"Median time {np.median(seconds):.0f} s.")


if __name__ == "__main__":
    main()
