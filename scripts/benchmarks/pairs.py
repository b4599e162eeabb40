# SPDX-License-Identifier: GPL-3.0-or-later
"""How often a wrong pair is found and a good one blamed, and whether a camera's intervals hold, with 4 to 28 pairs.

The truth is OpenCV's: points of a rough slope, projected by cv2.projectPoints, clicked with an error, some of them
wrong. Nothing of Rockfall makes the data.

    python scripts/benchmarks/pairs.py --cases 200
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from rockfall.core.camera.model import pinhole
from rockfall.core.camera.resection.resect import Resection, resect
from rockfall.core.errors import RockfallError
from rockfall.core.vectors import Array

SIZE = (1920, 1080)
CHI2_3 = 7.8147  # 95 % of three components together


@dataclass(frozen=True, eq=False)
class Case:
    """A camera, and the pairs that were clicked with it; `wrong` are those with a gross error."""

    position: Array
    focal: float
    pixels: Array
    points: Array
    wrong: Array


def slope_case(
    seed: int,
    n: int,
    *,
    wrong: int = 0,
    sigma_px: float = 1.0,
    heavy: bool = False,
    lens_error: bool = False,
    gross_px: tuple[float, float] = (15.0, 80.0),
) -> Case:
    """A phone on a tripod before a rough slope, 20 to 120 m away, with n pairs.

    Parameters
    ----------
    heavy : clicks as Student's t with 4 degrees of freedom, of the same scale.
    lens_error : the centre of the lens lies up to 1.2 % of the width off the middle, and k1 is up to 0.025.
    gross_px : from and to which length a wrong pixel is off, in any direction.
    """
    rng = np.random.default_rng([seed, n, wrong])
    focal = SIZE[0] * rng.uniform(0.5, 1.0)
    centre = np.array(SIZE) / 2 + (0.012 * SIZE[0] * rng.uniform(-1, 1, 2) if lens_error else 0.0)
    bend = np.array([0.025 * rng.uniform(-1, 1) if lens_error else 0.0, 0, 0, 0])
    matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]])
    away, steep = rng.uniform(20, 120), rng.uniform(0.4, 1.2)
    place = np.array([rng.uniform(-0.3, 0.3) * away, -away, rng.uniform(0.0, 0.3) * away])
    wavelength = away / rng.uniform(3, 8)
    while True:
        flat = rng.uniform((-1.2 * away, -0.4 * away), (1.2 * away, 1.2 * away), (4000, 2))
        phase = rng.uniform(0, 6.28, 2)
        height = steep * flat[:, 1] + 0.06 * away * (
            np.sin(flat[:, 0] / wavelength + phase[0]) + np.sin(flat[:, 1] / wavelength + phase[1])
        )
        scene = np.column_stack([flat, height])
        forward = np.array([0.0, 0.3 * away, 0.3 * steep * away]) - place
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        turn = np.stack([right, np.cross(forward, right), forward])
        vector = cv2.Rodrigues(turn)[0]
        move = -turn @ place
        pixels = cv2.projectPoints(scene, vector, move, matrix, bend)[0][:, 0]
        depth = (scene - place) @ forward
        inside = (depth > 0.2 * away) & ((pixels > 30) & (pixels < np.array(SIZE) - 30)).all(axis=1)
        candidates = np.flatnonzero(inside)
        if candidates.size < 60:
            continue
        chosen = rng.choice(candidates, n, replace=False)
        extent = np.linalg.svd(pixels[chosen] - pixels[chosen].mean(axis=0), compute_uv=False)
        if extent[1] > 0.3 * extent[0] and extent[0] > 0.25 * SIZE[0] * np.sqrt(n) / 2:
            break
    errors = rng.standard_t(4, (n, 2)) if heavy else rng.normal(size=(n, 2))
    clicked = pixels[chosen] + sigma_px * errors
    off = rng.choice(n, wrong, replace=False)
    angle = rng.uniform(0, 2 * np.pi, wrong)
    length = np.exp(rng.uniform(*np.log(gross_px), wrong))
    clicked[off] += length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Case(place, focal, np.clip(clicked, 1, np.array(SIZE) - 1), scene[chosen], np.sort(off))


def solved(case: Case, *, focal_known: bool = False, **options: object) -> Resection | None:
    """The camera from a case's pairs as they are given: 1 px, points without error."""
    known = pinhole(*SIZE, case.focal) if focal_known else None
    try:
        return resect(case.pixels, case.points, *SIZE, free=() if focal_known else ("f",), camera=known, **options)
    except RockfallError:
        return None


def away(found: Resection, case: Case) -> tuple[Array, float]:
    """The position's error in standard deviations, of each component, and of all together (χ² with 3)."""
    error = found.camera.position - case.position
    covariance = found.covariance[3:6, 3:6]
    if not np.isfinite(covariance).all():
        return np.zeros(3), 0.0
    return error / np.sqrt(np.diagonal(covariance)), float(error @ np.linalg.solve(covariance, error))


@dataclass
class Tally:
    """What became of many cases of one kind."""

    lost: int = 0
    found: int = 0
    asked: int = 0
    missed: int = 0
    falsely_asked: int = 0
    inside: list[bool] = field(default_factory=list)
    together: list[bool] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)


def tallied(cases: Iterable[Case], *, focal_known: bool = False) -> Tally:
    """Solve cases and count.

    `lost` are cases in which a good pair was left out; `found`, `asked`, `missed` are wrong pairs that were left out,
    that are used and named, and that are used without a word; `falsely_asked` are cases in which a good one was named.
    """
    tally = Tally()
    for case in cases:
        found = solved(case, focal_known=focal_known)
        if found is None:
            tally.missed += len(case.wrong)
            continue
        rows = np.arange(len(case.pixels))
        wrong, asked = np.isin(rows, case.wrong), np.isin(rows, [int(name) - 1 for name in found.asked])
        tally.lost += bool((~found.used & ~wrong).any())
        tally.found += int((~found.used & wrong).sum())
        tally.asked += int((asked & wrong).sum())
        tally.missed += int((found.used & wrong & ~asked).sum())
        tally.falsely_asked += bool((asked & ~wrong).any())
        parts, whole = away(found, case)
        tally.inside += (np.abs(parts) < 1.96).tolist()
        tally.together.append(whole < CHI2_3)
        tally.error.append(float(np.linalg.norm(found.camera.position - case.position)))
        tally.sigma.append(float(np.sqrt(np.trace(found.covariance[3:6, 3:6]))))
    return tally


def table(numbers: Sequence[int], wrong: Sequence[int], cases: int, first: int, **how: object) -> None:
    """A row for each number of pairs and of wrong ones, with the focal length known and free."""
    print(
        "| pairs | wrong | f | good lost | found | asked | missed | falsely asked | error m: median, 90 % | σ m "
        "| 95 %: components | position |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for n in numbers:
        for bad in wrong:
            for known in (True, False):
                if n - bad < (4 if known else 5):
                    continue
                made = (slope_case(first + number, n, wrong=bad, **how) for number in range(cases))
                t = tallied(made, focal_known=known)
                of = max(1, bad) * cases
                cells = [str(n), str(bad), "known" if known else "free", f"{100 * t.lost / cases:.0f} %"]
                cells += [f"{100 * count / of:.0f} %" for count in (t.found, t.asked, t.missed)]
                cells += [f"{100 * t.falsely_asked / cases:.0f} %"]
                cells += [f"{np.median(t.error):.2f}, {np.quantile(t.error, 0.9):.2f}", f"{np.median(t.sigma):.2f}"]
                cells += [f"{100 * np.mean(t.inside):.0f} %", f"{100 * np.mean(t.together):.0f} %"]
                print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    parser.add_argument("--pairs", type=int, nargs="+", default=[4, 5, 6, 8, 12, 28])
    parser.add_argument("--wrong", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--sigma", type=float, default=1.0, help="of the clicks [px]; 1 px is stated")
    parser.add_argument("--heavy", action="store_true", help="clicks with heavy tails")
    parser.add_argument("--lens", action="store_true", help="lenses that are not what is assumed of them")
    arguments = parser.parse_args()
    how = {"sigma_px": arguments.sigma, "heavy": arguments.heavy, "lens_error": arguments.lens}
    table(arguments.pairs, arguments.wrong, arguments.cases, arguments.first, **how)


if __name__ == "__main__":
    main()
