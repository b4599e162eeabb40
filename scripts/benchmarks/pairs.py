# SPDX-License-Identifier: GPL-3.0-or-later
"""How often a wrong pair is found and a good one blamed, and whether a camera's intervals hold, with few pairs and many.

The truth is OpenCV's: points of a rough slope, projected by cv2.projectPoints, clicked with an error, some of them
wrong. Nothing of Rockfall makes the data.

    python scripts/benchmarks/pairs.py --cases 200
"""

import argparse
from dataclasses import dataclass

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


def intervals(cases: int, first: int = 0, **how: object) -> None:
    """Whether the intervals of the position hold."""
    print(
        f"{'pairs':>6} {'wrong':>6} {'f':>6} {'components':>11} {'position':>9} {'in doubt':>9} {'σ m':>7} {'error m':>8}"
    )
    for n in (4, 5, 6, 8, 12, 28):
        for wrong in (0, 1):
            for known in (True, False):
                if n - wrong < (4 if known else 5):
                    continue
                inside, together, sigma, error, doubt = [], [], [], [], []
                for number in range(cases):
                    case = slope_case(first + number, n, wrong=wrong, **how)
                    found = solved(case, focal_known=known)
                    if found is None:
                        continue
                    if not found.used[case.wrong].any() or not wrong:
                        parts, whole = away(found, case)
                        inside += (np.abs(parts) < 1.96).tolist()
                        together.append(whole < CHI2_3)
                        with np.errstate(all="ignore"):
                            sigma.append(np.sqrt(np.trace(np.nan_to_num(found.covariance[3:6, 3:6], posinf=1e6))))
                        error.append(np.linalg.norm(found.camera.position - case.position))
                print(
                    f"{n:>6} {wrong:>6} {'known' if known else 'free':>6} {100 * np.mean(inside):>9.1f} % "
                    f"{100 * np.mean(together):>7.1f} % {len(together):>9} {np.median(sigma):>7.2f} {np.median(error):>8.2f}"
                )


def verdicts(cases: int, first: int = 0, **how: object) -> None:
    """Good pairs that were left out, wrong ones that were found, and what the position is off."""
    print(
        f"{'pairs':>6} {'wrong':>6} {'f':>6} {'good lost':>10} {'found':>7} {'asked':>7} {'missed':>7} {'falsely asked':>14} "
        f"{'error m, median':>16} {'90 %':>6} {'σ holds':>8}"
    )
    for n in (6, 8, 12, 28):
        for wrong in (0, 1, 2):
            for known in (True, False):
                if n - wrong < (4 if known else 5):
                    continue
                lost = found_wrong = asked = missed = false_asked = 0
                error, holds = [], []
                for number in range(cases):
                    case = slope_case(first + number, n, wrong=wrong, **how)
                    found = solved(case, focal_known=known)
                    if found is None:
                        missed += wrong
                        continue
                    bad = np.isin(np.arange(n), case.wrong)
                    doubted = {int(name) - 1 for name in found.asked}
                    is_doubted = np.isin(np.arange(n), list(doubted))
                    lost += bool((~found.used & ~bad).any())
                    found_wrong += int((~found.used & bad).sum())
                    asked += int((found.used & bad & is_doubted).sum())
                    missed += int((found.used & bad & ~is_doubted).sum())
                    false_asked += bool((is_doubted & ~bad).any())
                    error.append(np.linalg.norm(found.camera.position - case.position))
                    holds.append(away(found, case)[1] < CHI2_3)
                of = max(1, wrong) * cases
                print(
                    f"{n:>6} {wrong:>6} {'known' if known else 'free':>6} {100 * lost / cases:>8.1f} % {100 * found_wrong / of:>5.0f} % "
                    f"{100 * asked / of:>5.0f} % {100 * missed / of:>5.0f} % {100 * false_asked / cases:>12.1f} % "
                    f"{np.median(error):>16.2f} {np.quantile(error, 0.9):>6.2f} {100 * np.mean(holds):>6.1f} %"
                )


def main() -> None:
    """Both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    parser.add_argument("--sigma", type=float, default=1.0, help="of the clicks [px]; 1 px is stated")
    parser.add_argument("--heavy", action="store_true", help="clicks with heavy tails")
    parser.add_argument("--lens", action="store_true", help="lenses as those of telephones")
    parser.add_argument("--only", choices=("intervals", "verdicts"))
    arguments = parser.parse_args()
    how = {"sigma_px": arguments.sigma, "heavy": arguments.heavy, "lens_error": arguments.lens}
    if arguments.only != "verdicts":
        intervals(arguments.cases, arguments.first, **how)
    if arguments.only != "intervals":
        verdicts(arguments.cases, arguments.first, **how)


if __name__ == "__main__":
    main()
