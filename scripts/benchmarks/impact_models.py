# SPDX-License-Identifier: GPL-3.0-or-later
"""How quick the impact models are: evaluations per second on one core, beside the same functions in plain Python."""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from rockfall.core.analysis.comparison import compare, predict
from rockfall.core.analysis.courses import find_courses
from rockfall.core.impact_models.machinery.base import ImpactModel, Incident
from rockfall.core.impact_models.machinery.measured import MeasuredRebounds
from rockfall.core.impact_models.registry import FORMULAS, MODELS
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.vectors import dot, norm

PLAIN_ROWS = 20_000


def made_impacts(n: int) -> Incident:
    """Blocks of 0.35 m on a slope of 40°, with any spin."""
    rng = np.random.default_rng(1)
    dip = np.radians(40)
    normal = np.tile([np.sin(dip), 0.0, np.cos(dip)], (n, 1))
    velocity = np.array([8.0, 0.0, -9.0]) + rng.normal(size=(n, 3)) * 2
    return Incident(velocity, normal, rng.normal(size=(n, 3)) * 20, np.full(n, 0.175), np.full(n, 60.0))


def plain_loop(model: ImpactModel, rows: list[tuple], numbers: list[float], draws: list[list[float]]) -> list:
    """The same function, not compiled, impact by impact on Python's own floats."""
    named = model.parameter_type(*numbers)
    return [model.function(*row, named, model.draw_type(*here)) for row, here in zip(rows, draws, strict=True)]


def timed(work: Callable[[], object], repeats: int) -> float:
    """Median time of some runs [s]."""
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        kept = work()  # noqa: F841 — as a caller does; freeing it is not part of the work
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)


def made_rebounds(k: int) -> MeasuredRebounds:
    """A table of k impacts over the conditions that are asked about."""
    rng, state = np.random.default_rng(2), made_impacts(k)
    vn1 = -dot(state.velocity, state.normal)
    theta1 = np.arcsin(np.clip(vn1 / norm(state.velocity), 1e-3, 1.0))
    names, half = np.array([f"b{i // 8}" for i in range(k)]), rng.uniform(0.3, 0.9, (2, k))
    turn = np.radians(rng.uniform(0, 40, k))
    return MeasuredRebounds(names, names, theta1, np.abs(vn1) + 0.1, half[0], half[1], turn, np.ones(k))


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--impacts", type=int, default=1_000_000)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    state = made_impacts(arguments.impacts)
    few = min(arguments.impacts, PLAIN_ROWS)
    columns = (state.velocity, state.normal, state.angular_velocity)
    triples = [[tuple(row) for row in column[:few].tolist()] for column in columns]
    rows = list(zip(*triples, state.radius_m[:few].tolist(), state.mass_kg[:few].tolist(), strict=True))

    print(f"{'model':<24}{'compiling':>12}{'mean':>14}{'random':>14}{'plain Python':>16}{'ratio':>8}")
    for name, model in ((name, MODELS[name]) for name in FORMULAS):
        first = timed(lambda model=model: model.rebound(made_impacts(1)), 1)
        mean = timed(lambda model=model: model.rebound(state), arguments.repeats)
        rng = np.random.default_rng(1)
        chance = timed(lambda model=model, rng=rng: model.rebound(state, rng=rng), arguments.repeats)
        draws, numbers = rng.random((few, model.draws)).tolist(), model.numbers().tolist()
        plain = timed(lambda model=model, draws=draws, numbers=numbers: plain_loop(model, rows, numbers, draws), 3)
        rate, plain_rate = arguments.impacts / chance, few / plain
        print(
            f"{name:<24}{first:>10.2f} s{arguments.impacts / mean / 1e6:>12.1f} M{rate / 1e6:>12.1f} M"
            f"{plain_rate / 1e6:>14.3f} M{rate / plain_rate:>8.0f}"
        )
    for measured in map(made_rebounds, (100, 1000)):
        model, rng = MODELS["observed"], np.random.default_rng(1)
        model.rebound(made_impacts(1), measured=measured)
        mean = timed(lambda model=model, measured=measured: model.rebound(state, measured=measured), arguments.repeats)
        chance = timed(
            lambda model=model, measured=measured, rng=rng: model.rebound(state, rng=rng, measured=measured),
            arguments.repeats,
        )
        rates = [arguments.impacts / seconds / 1e6 for seconds in (mean, chance)]
        print(f"{f'{model.name}, table of {len(measured)}':<24}{'':>12}{rates[0]:>12.1f} M{rates[1]:>12.1f} M")
    print("evaluations per second on one core; random: with the drawing of the numbers; ratio: random by plain Python")

    rng = np.random.default_rng(3)
    names = np.repeat([f"block {k}" for k in range(14)], 9)[:117]
    step = rng.uniform(0.4, 1.2, names.size)
    position = np.cumsum(step[:, None] * [6.0, 0, -4.2] + rng.normal(size=(names.size, 3)) * 0.3, axis=0)
    normal = np.tile([0.57, 0, 0.82], (names.size, 1))
    impacts = reconstruct(make_picks(names, np.cumsum(step), position, normal=normal)).impacts
    courses = find_courses(impacts)
    print(f"six models on {len(courses)} impacts of a table:")
    print(f"  compare  {1e3 * timed(lambda: compare(impacts), 200):.2f} ms")
    print(f"  predict  {1e3 * timed(lambda: predict(impacts, courses), 200):.2f} ms (courses found before: a slider)")
    print(f"  compare with 1000 replicates  {1e3 * timed(lambda: compare(impacts, replicates=1000), 5):.0f} ms")


if __name__ == "__main__":
    main()
