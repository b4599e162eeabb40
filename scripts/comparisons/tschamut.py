# SPDX-License-Identifier: GPL-3.0-or-later
"""The 80 runs of Tschamut 2014 (Volkwein & Gerber 2018, doi 10.16904/envidat.34) beside those of models.

    python scripts/comparisons/tschamut.py            # blind, halves, the longest third: some minutes on one core
    python scripts/comparisons/tschamut.py --blind    # the first table alone

Blind: each model with its defaults, before anything of the runs is known. Halves: each model is back-analysed on half
of the runs and predicts the other half, as often as the runs are split at random; beside it stands what the first half
predicts without a model, by its own distribution. The longest third: what friction comes out when only these are known,
and what when it is stated that they are the longest of 80.

What this can tell: whether run-outs come out in the right order of magnitude with untuned parameters, how much the
models differ among each other on one slope, and whether a model knows more than the runs themselves. What it cannot:
which model is right. The terrain is a proxy, a grid of 5 m put together from the points on which the real blocks were
surveyed; blocks of 0.3 to 0.4 m feel none of the real roughness, which is what stopped them on the meadow. Friction and
soil are not known either. An open simulator, untuned, stops at 63.4 m (translational) and at 203 m (rotating sphere)
here.
"""

import argparse
import csv
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rockfall.core.analysis.back_analysis import BackAnalysis
from rockfall.core.analysis.completeness import NOT_STATED, Completeness
from rockfall.core.analysis.held_out import PredictedQuantity, halves
from rockfall.core.analysis.observed_runs import Observed, observe_stops
from rockfall.core.analysis.priors import make_priors
from rockfall.core.impact_models.registry import COMPARED, find_model
from rockfall.core.simulation.engine import Settings
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.vectors import Array, Indices
from rockfall.core.workflow.back_analysis import back_analyse
from rockfall.core.workflow.whole_runs import ComparedSimulations, compare_whole_runs

DATA = Path(__file__).parents[2] / "tests" / "data"
NUMBER = 20
SETS, ROUNDS, SPLITS = 500, 2, 5
FITTED: dict[str, tuple[str, ...]] = {
    "azimi_desvarreux_1977": ("rn", "rt", "friction"),
    "dorren_2015": ("rn", "rg70", "friction"),
    "noel_2017": ("rn_exponent", "rt", "friction"),
    "pfeiffer_bowen_1989": ("rn", "rt", "friction"),
    "stevens_1998": ("rn", "rt", "friction"),
    "wyllie_2014": ("rn_exponent", "friction"),
}
PRIORS = {"dorren_2015": {"rg70": "0..0.5"}}
"""That are not the whole range."""
LONGEST = "stevens_1998"
"""The model of the third table."""


def columns(name: str) -> dict[str, list[str]]:
    """The cells of a table by column."""
    with (DATA / f"tschamut_2014_{name}.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {column: [row[column] for row in rows] for column in rows[0]}


def vectors(table: dict[str, list[str]], *names: str) -> Array:
    """(n, len(names)) numbers."""
    return np.array([table[name] for name in names], dtype=np.float64).T


def proxy() -> Ground:
    """The terrain."""
    return make_ground(read_terrain(DATA / "tschamut_2014_terrain.asc"))


def blocks(ground: Ground, number: int) -> Releases:
    """The released blocks as spheres of their mean radius and weighed mass, on the terrain, as fast as they were."""
    table = columns("releases")
    diameter, mass = 2 * vectors(table, "radius_m")[:, 0], vectors(table, "mass_kg")[:, 0]
    return make_releases(
        placed_on(ground, vectors(table, "x_m", "y_m"), diameter),
        name=np.array(table["trajectory_id"]),
        velocity=vectors(table, "vx_mps", "vy_mps", "vz_mps"),
        diameter_m=diameter,
        density_kgpm3=mass / (np.pi / 6 * diameter**3),
        number=number,
    )


def observed_stops(ground: Ground, rows: Indices | slice = slice(None)) -> Observed:
    """The 80 stops, or some of them."""
    stops = columns("stops")
    return observe_stops(
        np.array(stops["trajectory_id"])[rows],
        ground.shift.to_local(vectors(stops, "release_x_m", "release_y_m", "release_z_m"))[rows],
        ground.shift.to_local(vectors(stops, "x_m", "y_m", "z_m"))[rows],
        vectors(stops, "mass_kg")[rows, 0],
    )


def compare(number: int = NUMBER, models: tuple[str, ...] = COMPARED) -> ComparedSimulations:
    """The observed stops beside those of the models."""
    ground = proxy()
    models_as_they_are = [Settings(model) for model in models]
    return compare_whole_runs(
        ground,
        observed_stops(ground),
        blocks(ground, number),
        models_as_they_are,
        completeness=Completeness("complete"),
    )


def back_analysis(
    ground: Ground, model: str, observed: Observed, stated: Completeness, splits: int, sets: int = SETS
) -> BackAnalysis:
    """What observed stops say of parameters, and how each half of them predicts the other."""
    laws = make_priors(find_model(model), list(FITTED[model]), PRIORS.get(model, {}))
    parts = halves(len(observed.paths), splits, 0) if splits else None
    return back_analyse(
        ground, observed, blocks(ground, 1), Settings(model), laws,
        sets=sets, rounds=ROUNDS, completeness=stated, parts=parts,
    )  # fmt: skip


def run_out(analysis: BackAnalysis) -> PredictedQuantity:
    """How the run-out of runs held out is predicted."""
    return next(one for one in analysis.prediction.quantities if one.quantity == "runout_m")


def print_blind(number: int) -> None:
    """Run-outs with the defaults of each model."""
    done = compare(number)
    observed = done.comparison.find(COMPARED[0], "", "runout_m").observed
    print("Blind: run-out with the defaults of each model [m]")
    print(f"{'':<24}{'mean':>8}{'5 %':>8}{'95 %':>8}{'left':>7}{'CRPS':>8}   the observed come from it")
    low, high = np.quantile(observed, [0.05, 0.95])
    alone = done.comparison.find(COMPARED[0], "", "runout_m").alone
    print(f"{f'observed, {observed.size} runs':<24}{observed.mean():>8.1f}{low:>8.1f}{high:>8.1f}{'':>7}{alone:>8.1f}")
    for simulation in done.simulations:
        one = done.comparison.find(simulation.settings.model, "", "runout_m")
        runs = done.comparison.simulated[simulation.settings.model]
        mean, (low, high) = one.simulated.mean(), one.all_quantiles[[0, 4]]
        cells = f"{mean:>8.1f}{low:>8.1f}{high:>8.1f}{f'{100 * runs.beyond.mean():.0f} %':>7}{one.score:>8.1f}"
        print(f"{one.model:<24}{cells}   {one.verdict.partition(';')[0]}")
    print("CRPS of the observed: each run by the other 79, without a model. A block that left the terrain counts with")
    print("its place at the edge.", flush=True)


def print_halves(models: Sequence[str], splits: int, sets: int) -> None:
    """Back-analysis on half of the runs, the other half predicted."""
    ground = proxy()
    observed = observed_stops(ground)
    print(f"\nHalves: back-analysis on half of the runs, the other half predicted; {splits} random splits")
    print("CRPS of the run-out [m] with the defaults, fitted, and by the distribution of the half alone; in the 90 %")
    print("interval; score of all quantities (half alone: 1); parameters of all 80 runs")
    print(f"{'':<24}{'defaults':>9}{'fitted':>8}{'half':>7}{'90 %':>7}{'score':>7}")
    for model in models:
        done = back_analysis(ground, model, observed, Completeness("complete"), splits, sets)
        one, told = run_out(done), done.prediction
        inside = f"{100 * sum(fold.inside for fold in told.folds) / told.values:.0f} %"
        scores = f"{one.default:>9.1f}{one.fitted:>8.1f}{one.observed_alone:>7.1f}"
        print(f"{model:<24}{scores}{inside:>7}{told.score('fitted'):>7.2f}   {parameters(done)}", flush=True)
        if any(not check.fits for check in done.checks):
            wrong = ", ".join(check.title for check in done.checks if not check.fits)
            print(f"{'':<24}cannot give: {wrong}", flush=True)


def parameters(analysis: BackAnalysis) -> str:
    """Medians and 95 % intervals."""
    return ", ".join(f"{one.name} {one.median:.2f} ({one.low:.2f}…{one.high:.2f})" for one in analysis.estimates)


def print_longest(sets: int) -> None:
    """The longest third of the runs alone, with and without its being said."""
    ground = proxy()
    stops = observed_stops(ground).paths
    far = np.hypot(*(stops.stop - stops.start)[:, :2].T)
    third = np.sort(np.argsort(-far, kind="stable")[: far.size // 3])
    cases = (
        ("all 80, complete", slice(None), Completeness("complete")),
        (f"longest {third.size}, nothing stated", third, NOT_STATED),
        (f"longest {third.size}, longest:80", third, Completeness("longest", 80)),
    )
    print(f"\nThe longest third alone, {find_model(LONGEST).title}")
    for label, rows, stated in cases:
        done = back_analysis(ground, LONGEST, observed_stops(ground, rows), stated, 0, sets)
        print(f"{label:<30}{parameters(done)}")
        for remark in done.remarks:
            if remark.about in ("fit", "completeness"):
                print(textwrap.fill(str(remark), 116, initial_indent="    ", subsequent_indent="    "), flush=True)


def main(words: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", choices=[*FITTED, []], help="that are back-analysed (default: all)")
    parser.add_argument("--blind", action="store_true", help="the first table alone")
    parser.add_argument("--number", type=int, default=NUMBER, help="blocks for each run (default %(default)s)")
    parser.add_argument("--splits", type=int, default=SPLITS, help="into halves (default %(default)s)")
    parser.add_argument("--sets", type=int, default=SETS, help="of parameters in a round (default %(default)s)")
    arguments = parser.parse_args(words)
    print_blind(arguments.number)
    if not arguments.blind:
        print_halves(arguments.models or list(FITTED), arguments.splits, arguments.sets)
        print_longest(arguments.sets)
    print("\nThe terrain is a 5 m proxy, not a survey: this tells the order of magnitude, not which model is right.")


if __name__ == "__main__":
    main(sys.argv[1:])
