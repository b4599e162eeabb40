# SPDX-License-Identifier: GPL-3.0-or-later
"""The 80 runs of Tschamut 2014 (Volkwein & Gerber 2018, doi 10.16904/envidat.34) beside those of models.

What this can tell: whether run-outs come out in the right order of magnitude with untuned parameters, and how much the
models differ among each other on one slope. What it cannot: which model is right. The terrain is a proxy, a grid of
5 m put together from the points on which the real blocks were surveyed; blocks of 0.3 to 0.4 m feel none of the real
roughness, which is what stopped them on the meadow. Friction and soil are not known either: all parameters are the
defaults. An open simulator, untuned, stops at 63.4 m (translational) and at 203 m (rotating sphere) here.
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rockfall.core.analysis.observed_runs import Observed, observe_stops
from rockfall.core.analysis.priors import make_priors
from rockfall.core.impact_models.registry import COMPARED, find_model
from rockfall.core.simulation.engine import Settings
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.vectors import Array
from rockfall.core.workflow.back_analysis import BackAnalysis, back_analyse
from rockfall.core.workflow.whole_runs import ComparedSimulations, compare_whole_runs

DATA = Path(__file__).parents[2] / "tests" / "data"
NUMBER = 20
FITTED: tuple[tuple[str, tuple[str, ...], dict[str, str]], ...] = (
    ("stevens_1998", ("rn", "rt", "friction"), {}),
    ("pfeiffer_bowen_1989", ("rn", "rt", "friction"), {}),
    ("dorren_2015", ("rn", "rg70", "friction"), {"rg70": "0..0.5"}),
)
"""Models, what is fitted, and priors that are not the whole range."""
PEER = "an open simulator, untuned: 63.4 m translational, 203 m rotating sphere"


def columns(name: str) -> dict[str, list[str]]:
    """The cells of a table by column."""
    with (DATA / f"tschamut_2014_{name}.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return {column: [row[column] for row in rows] for column in rows[0]}


def vectors(table: dict[str, list[str]], *names: str) -> Array:
    """(n, len(names)) numbers."""
    return np.array([table[name] for name in names], dtype=np.float64).T


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


def observed_stops(ground: Ground) -> Observed:
    """The 80 stops."""
    stops = columns("stops")
    return observe_stops(
        np.array(stops["trajectory_id"]),
        ground.shift.to_local(vectors(stops, "release_x_m", "release_y_m", "release_z_m")),
        ground.shift.to_local(vectors(stops, "x_m", "y_m", "z_m")),
        vectors(stops, "mass_kg")[:, 0],
    )


def compare(number: int = NUMBER, models: tuple[str, ...] = COMPARED) -> ComparedSimulations:
    """The observed stops beside those of the models."""
    ground = make_ground(read_terrain(DATA / "tschamut_2014_terrain.asc"))
    models_as_they_are = [Settings(model) for model in models]
    return compare_whole_runs(ground, observed_stops(ground), blocks(ground, number), models_as_they_are)


def back_analysis(model: str, names: Sequence[str], priors: dict[str, str], sets: int = 2000) -> BackAnalysis:
    """What the 80 stops say of parameters."""
    ground = make_ground(read_terrain(DATA / "tschamut_2014_terrain.asc"))
    laws = make_priors(find_model(model), list(names), priors)
    return back_analyse(ground, observed_stops(ground), blocks(ground, 1), Settings(model), laws, sets=sets)


def tell(analysis: BackAnalysis) -> None:
    """Print intervals, checks and remarks."""
    print(f"\n{analysis.model}: {analysis.runs} runs in {analysis.seconds:.0f} s")
    for one in analysis.estimates:
        print(f"  {one.name:<12}{one.median:>8.3f}   {one.low:.3f} … {one.high:.3f}   {one.verdict}")
    for one in analysis.checks:
        print(f"  {one.title:<28}{one.observed:>8.1f} {one.unit}   {one.low:.1f} … {one.high:.1f}   p = {one.p:.2g}")
    for remark in analysis.remarks:
        print(f"  {remark}")


def main() -> None:
    """Print mean run-outs, and whether the observed stops can come from the simulated ones."""
    done = compare(int(sys.argv[1]) if len(sys.argv) > 1 else NUMBER)
    first = done.comparison.find(COMPARED[0], "", "runout_m")
    observed = first.observed
    print(f"{'':<24}{'mean run-out':>14}{'5 %':>9}{'95 %':>9}{'left':>7}   the observed come from it")
    low, high = np.quantile(observed, [0.05, 0.95])
    print(f"{f'observed, {observed.size} runs':<24}{observed.mean():>12.1f} m{low:>9.1f}{high:>9.1f}")
    for simulation in done.simulations:
        one = done.comparison.find(simulation.settings.model, "", "runout_m")
        runs = done.comparison.simulated[simulation.settings.model]
        mean, (low, high) = one.simulated.mean(), one.all_quantiles[[0, 4]]
        left = f"{100 * runs.beyond.mean():.0f} %"
        print(f"{one.model:<24}{mean:>12.1f} m{low:>9.1f}{high:>9.1f}{left:>7}   {one.verdict}")
    print(f"\n{PEER}. A block that left the terrain counts with its place at the edge.")
    print("The terrain is a 5 m proxy, not a survey: this tells the order of magnitude, not which model is right.")
    for model, names, priors in FITTED:
        tell(back_analysis(model, names, priors))


if __name__ == "__main__":
    main()
