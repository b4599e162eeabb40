# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the intervals of R_N, R_T, R, θ1 and the deviation hold, over a terrain whose normal is known.

The terrain is a formula: a slope of 38° with waves of 0.7 to 14 m. Blocks bounce down it as in refinement.py and are
filmed alike. The program is given points of it 0.4 m apart, each off by the scanner's noise, and nothing else. The
true normal is that of the plane of least squares through the formula's surface within the block's scale of the true
contact. It does not come from anything that the program states.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from refinement import Case, film
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.impact import Impacts, apparent
from rockfall.core.reconstruction.intervals import JUDGED
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import refine
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.orientation import default_normal_radius
from rockfall.core.terrain.surface import Surface
from synthetic_falls import BLOCK, DIP, Fall, fall

LENGTH_M, WIDTH_M = 76.0, 44.0
TRUE_STEP_M, GIVEN_STEP_M = 0.1, 0.4
WAVES = ((0.25, 6.0, 14.0, 8), (0.08, 2.0, 5.0, 12), (0.02, 0.7, 1.6, 24))
"""Root mean square height [m], shortest and longest wave [m], number of waves."""
SIGMA_PLACE_M, SIGMA_TIME_S = 0.05, 0.005
"""Of picks that are not refined."""


@dataclass(frozen=True, eq=False)
class Slope:
    """A slope of waves: wave vectors (w, 2) [rad/m], heights (w,) [m] and phases (w,)."""

    wave: np.ndarray
    height: np.ndarray
    phase: np.ndarray

    def z(self, xy: np.ndarray) -> np.ndarray:
        """Heights at places (..., 2)."""
        return -np.tan(DIP) * xy[..., 0] + np.sin(xy @ self.wave.T + self.phase) @ self.height

    def mesh(self, step: float, sigma_m: float, rng: np.random.Generator) -> Surface:
        """Points of it on a grid, off by noise, as a terrain."""
        x, y = np.arange(0, LENGTH_M, step), np.arange(-WIDTH_M / 2, WIDTH_M / 2, step)
        plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        z = np.concatenate([self.z(part) for part in np.array_split(plan, 50)]) + sigma_m * rng.normal(size=len(plan))
        corner = (np.arange(x.size - 1)[:, None] * y.size + np.arange(y.size - 1)).ravel()
        here, beside, across, ahead = corner, corner + 1, corner + y.size + 1, corner + y.size
        faces = np.concatenate([np.stack([here, ahead, across], 1), np.stack([here, across, beside], 1)])
        return Surface(np.column_stack([plan, z]), faces.astype(np.int32), GlobalShift(), "slope of waves")

    def normals(self, points: np.ndarray, radius_m: float) -> np.ndarray:
        """(n, 3) normals of the planes through the surface within a sphere, by many points of it."""
        grid = np.linspace(-radius_m, radius_m, 61)
        offsets = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        found = np.empty((len(points), 3))
        for i, point in enumerate(points):
            plan = point[:2] + offsets
            places = np.column_stack([plan, self.z(plan)])
            slopes = np.gradient(places[:, 2].reshape(61, 61), grid[1] - grid[0])
            weight = np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2).ravel()  # area over that in plan
            inside = np.linalg.norm(places - [*point[:2], self.z(point[:2])], axis=1) < radius_m
            away = places[inside] - np.average(places[inside], axis=0, weights=weight[inside])
            normal = np.linalg.svd(away * np.sqrt(weight[inside, None]), full_matrices=False)[2][2]
            found[i] = normal * np.sign(normal[2])
        return found


def make_slope(rng: np.random.Generator) -> Slope:
    """Waves drawn at random."""
    waves, heights = [], []
    for size, shortest, longest, count in WAVES:
        length, angle = rng.uniform(shortest, longest, count), rng.uniform(0, np.pi, count)
        waves.append(2 * np.pi / length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        heights.append(np.full(count, size * np.sqrt(2 / count)))
    wave, height = np.concatenate(waves), np.concatenate(heights)
    return Slope(wave, height, rng.uniform(0, 2 * np.pi, len(wave)))


def truth_of(truth: Fall, slope: Slope, radius_m: float) -> dict[str, np.ndarray]:
    """The true values of all intervals."""
    values = apparent(truth.v1, truth.v2, slope.normals(truth.contact, radius_m))
    return {name: getattr(values, name) for name in JUDGED}


def picked(truth: Fall, rng: np.random.Generator):
    """Picks with a stated noise, not refined."""
    n = len(truth.time_s)
    return make_picks(
        ["a"] * n,
        truth.time_s + SIGMA_TIME_S * rng.normal(size=n),
        truth.contact + SIGMA_PLACE_M * rng.normal(size=(n, 3)),
        sigma_time_s=np.full(n, SIGMA_TIME_S),
        sigma_position_m=np.full(n, SIGMA_PLACE_M),
    )


def impacts_of(
    views: int, fine: Surface, given: Surface, sigma_m: float, truth: Fall, rng: np.random.Generator
) -> Impacts:
    """What the program makes of a fall: refined from some views, or reconstructed from picks without one.

    Parameters
    ----------
    sigma_m : noise of the given surface's points, which is what is stated as the terrain's accuracy.
    """
    if not views:
        return reconstruct(picked(truth, rng), surface=given, block=BLOCK, flights="centres").impacts
    footage = film(Case("", 3840, 2160, 30.0, 150.0, views), fine, given, truth, rng)
    free = ("camera", "clock")[:views]
    return refine(
        footage.picks,
        footage.views,
        footage.pixels,
        surface=given,
        block=BLOCK,
        free=free,
        sigma_terrain_m=sigma_m,
    ).reconstruction.impacts


def row_of(name: str, found: list[Impacts], true: list[dict[str, np.ndarray]]) -> list[str]:
    """A line of the table."""
    cells = [name]
    for key in JUDGED:
        ends = np.concatenate([one.intervals[key] for one in found])
        value = np.concatenate([one[key] for one in true])
        used = np.isfinite(ends[:, 0]) & np.isfinite(value)
        if key == "rn":
            width = float(np.median((ends[used, 1] - ends[used, 0]) / 2))
        cells.append(f"{100 * np.mean((ends[used, 0] <= value[used]) & (value[used] <= ends[used, 1])):.1f}")
    error = np.concatenate([one.rn for one in found]) - np.concatenate([one["rn"] for one in true])
    return [*cells, f"{np.nanmedian(np.abs(error)):.3f}", f"{width:.3f}"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--falls", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    slope = make_slope(rng)
    fine = slope.mesh(TRUE_STEP_M, 0.0, rng)
    falls = [fall(fine, rng) for _ in range(arguments.falls)]
    heads = ["95 % intervals", *JUDGED, "R_N error", "half width"]
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for sigma_m in (0.005, 0.02, 0.05):
        given = slope.mesh(GIVEN_STEP_M, sigma_m, rng)
        radius = default_normal_radius(given, BLOCK.diameter_m)
        true = [truth_of(one, slope, radius) for one in falls]
        for views, name in ((0, "picks"), (1, "one view"), (2, "two views")):
            found = [impacts_of(views, fine, given, sigma_m, one, rng) for one in falls]
            print("| " + " | ".join(row_of(f"{name}, scan to {1e3 * sigma_m:.0f} mm", found, true)) + " |", flush=True)


if __name__ == "__main__":
    main()
