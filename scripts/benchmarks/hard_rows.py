# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether intervals hold, and a cause is named, where something that is stated is not so.

The terrain is a formula (the slope of waves of rn_intervals.py), down which spheres bounce; the program is given points
of it 0.4 m apart. Cameras, marks and tracks are those of refinement.py: 4K, 30 Hz, 150 m away, solved from 20 pairs by
`resect`, with the covariance that it gives. Each row changes one thing that the program is not told.

A row is a function of the scene, of a fall and of a generator of random numbers that returns a `Trial`; `ROWS` has
them by their names.
"""

import argparse
import csv
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from refinement import CAMERA, TERRAIN, Case, film
from rn_intervals import GIVEN_STEP_M, TRUE_STEP_M, Slope, make_slope, truth_of
from rockfall.core.camera.model import project, rays
from rockfall.core.reconstruction.picks import Picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, Refinement, View, refine
from rockfall.core.terrain.orientation import default_normal_radius
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.surface import Surface
from synthetic_falls import BLOCK, SIGMA_TERRAIN, Fall, fall

FALLS_A_SLOPE = 10
GIVEN_WAVES_M, WRONG_M, WRONG_WAVES_M = (5.0, 40.0), 0.2, (3.0, 12.0)
"""Shortest and longest waves of the errors of a terrain that is as accurate as is stated [m]; root mean square height,
and shortest and longest, of those of one that is wrong."""
LIFTED_M = 0.3
STATED_CLICK_M = 0.13
OUTLIERS, OUTLIER_PX = 0.08, 60.0
"""Part of the pixels that are on something else, and how far off they are at most."""
STEADY_PX = 0.6
"""By how much each frame of stabilised footage is off, of which its stabiliser says a third."""

RATE_HZ, LOST, STATED_HZ, ZOOM = 30.0, 3, 25.0 * 30 / 29.97, 0.06
GONE_M, GONE_INNER_M, GONE_OUTER_M = 0.3, 0.8, 1.6
"""What is gone of the ground within a distance, less and less to the next one."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A slope of waves, its surface, and what a scan that is as accurate as is stated makes of it."""

    slope: Slope
    fine: Surface
    given: Surface


@dataclass(frozen=True, eq=False)
class Trial:
    """What the program is given of a fall.

    Attributes
    ----------
    truth : the fall.
    options : further arguments of `refine`.
    cause : words of which a warning has one if it names what is wrong; empty where nothing is.
    """

    truth: Fall
    picks: Picks
    views: tuple[View, ...]
    pixels: PixelObservations
    surface: Surface
    options: Mapping[str, Any]
    cause: tuple[str, ...] = ()

    def refined(self) -> Refinement:
        """As the program refines it."""
        return refine(self.picks, self.views, self.pixels, surface=self.surface, block=BLOCK, **self.options)


type RowOf = Callable[[Scene, Fall, np.random.Generator], Trial]


def filmed(
    scene: Scene,
    truth: Fall,
    rng: np.random.Generator,
    *,
    views: int = 1,
    surface: Surface | None = None,
    sigma_terrain_m: float | None = SIGMA_TERRAIN,
    cause: tuple[str, ...] = (),
    **case: Any,
) -> Trial:
    """A fall as filmed, with nothing untrue but the surface, if one is given.

    Parameters
    ----------
    case : further fields of `Case`.
    """
    surface = scene.given if surface is None else surface
    footage = film(Case("", 3840, 2160, 30.0, 150.0, views, **case), scene.fine, surface, truth, rng)
    options = {"free": ("camera", "clock")[:views], "sigma_terrain_m": sigma_terrain_m}
    return Trial(truth, footage.picks, footage.views, footage.pixels, surface, options, cause)


def moved(view: View, by: np.ndarray) -> View:
    """A view whose camera is stated elsewhere, its direction and its covariance kept."""
    path = view.path
    reference = replace(path.reference, position=path.reference.position + by)
    return replace(view, path=replace(path, reference=reference, position=path.position + by))


def camera(scene: Scene, truth: Fall, rng: np.random.Generator, *, views: int = 1) -> Trial:
    """The first camera is stated too high."""
    trial = filmed(scene, truth, rng, views=views, cause=CAMERA)
    return replace(trial, views=(moved(trial.views[0], np.array([0, 0, LIFTED_M])), *trial.views[1:]))


def wavy(surface: Surface, size_m: float, waves_m: tuple[float, float], rng: np.random.Generator) -> Surface:
    """A surface with waves that are not there."""
    count = 30
    length, angle = rng.uniform(*waves_m, count), rng.uniform(0, np.pi, count)
    wave = 2 * np.pi / length[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    phase = surface.vertices[:, :2] @ wave.T + rng.uniform(0, 2 * np.pi, count)
    error = size_m * np.sqrt(2 / count) * np.sin(phase).sum(axis=1)
    return Surface(surface.vertices + np.outer(error, [0, 0, 1]), surface.faces, surface.shift, surface.name)


def terrain(
    scene: Scene, truth: Fall, rng: np.random.Generator, *, sigma_m: float | None = SIGMA_TERRAIN, views: int = 1
) -> Trial:
    """The terrain is wrong by much more than is stated, or nothing is stated."""
    surface = wavy(scene.given, WRONG_M, WRONG_WAVES_M, rng)
    return filmed(scene, truth, rng, views=views, surface=surface, sigma_terrain_m=sigma_m, cause=TERRAIN)


def clicks(scene: Scene, truth: Fall, rng: np.random.Generator) -> Trial:
    """Marks are stated as good in all directions as they are across the ray."""
    trial = filmed(scene, truth, rng)
    stated = np.full(len(trial.picks), STATED_CLICK_M)
    return replace(trial, picks=replace(trial.picks, sigma_position_m=stated))


def outliers(scene: Scene, truth: Fall, rng: np.random.Generator) -> Trial:
    """Some pixels, in runs of one to three frames, are on something else."""
    trial = filmed(scene, truth, rng)
    pixel = trial.pixels.pixel.copy()
    for start in np.flatnonzero(rng.random(len(pixel)) < OUTLIERS / 2):
        pixel[start : start + rng.integers(1, 4)] += rng.uniform(-OUTLIER_PX, OUTLIER_PX, 2)
    return replace(trial, pixels=replace(trial.pixels, pixel=pixel))


def stabilised(scene: Scene, truth: Fall, rng: np.random.Generator) -> Trial:
    """Each frame's direction is off by more than the stabiliser says, slowly as it drifts and from frame to frame."""
    trial = filmed(scene, truth, rng)
    time_s, index = np.unique(trial.pixels.time_s, return_inverse=True)
    slow = np.cumsum(rng.normal(size=(time_s.size, 2)), axis=0)
    slow *= STEADY_PX / max(float(np.sqrt((slow**2).mean())), 1e-9)
    off = slow + STEADY_PX * rng.normal(size=slow.shape)
    return replace(trial, pixels=replace(trial.pixels, pixel=trial.pixels.pixel + off[index]))


def dropped(scene: Scene, truth: Fall, rng: np.random.Generator, *, views: int = 1) -> Trial:
    """The first video lost three frames somewhere; the times of those that are left are even."""
    trial = filmed(scene, truth, rng, views=views, cause=("are missing",))
    view, pixels = trial.views[0], trial.pixels
    mine = pixels.view == 0
    inside = np.unique(pixels.time_s[mine])
    first = float(rng.choice(inside[len(inside) // 7 : -len(inside) // 7]))
    lost = LOST / RATE_HZ

    def even(time_s: np.ndarray) -> np.ndarray:
        return np.where(time_s > first, np.maximum(time_s - lost, first), time_s)

    def gone(time_s: np.ndarray) -> np.ndarray:
        return (time_s > first + 1e-6) & (time_s < first + lost + 1e-6)

    path, kept = view.path, ~gone(view.path.time_s)
    path = replace(
        path,
        time_s=even(path.time_s[kept]),
        position=path.position[kept],
        rotation=path.rotation[kept],
        sigma_position_m=path.sigma_position_m[kept],
        sigma_rotation=path.sigma_rotation[kept],
    )
    pixels = replace(pixels, time_s=np.where(mine, even(pixels.time_s), pixels.time_s))
    pixels = pixels.take(~(mine & gone(trial.pixels.time_s)))
    marked_s = view.clock.to_common(even(view.clock.to_video(trial.picks.time_s)))
    picks = replace(trial.picks, time_s=marked_s)
    return replace(trial, views=(replace(view, path=path), *trial.views[1:]), pixels=pixels, picks=picks)


def eroded(scene: Scene, truth: Fall, rng: np.random.Generator, *, views: int = 1) -> Trial:
    """At one impact 0.3 m of ground are gone since the scan."""
    contact = truth.contact[int(rng.integers(1, len(truth.contact) - 1))]
    vertices = scene.given.vertices.copy()
    away = np.linalg.norm(vertices[:, :2] - contact[:2], axis=1)
    vertices[:, 2] += GONE_M * np.clip((GONE_OUTER_M - away) / (GONE_OUTER_M - GONE_INNER_M), 0, 1)
    surface = Surface(vertices, scene.given.faces, scene.given.shift, "before")
    return filmed(scene, truth, rng, views=views, surface=surface, cause=("lower than the terrain",))


def wrong_rate(scene: Scene, truth: Fall, rng: np.random.Generator) -> Trial:
    """A video of 29.97 frames per second is taken for one of 25."""
    trial = filmed(scene, truth, rng, cause=("capture rate",))
    view, longer = trial.views[0], RATE_HZ / STATED_HZ
    path, clock = replace(view.path, time_s=longer * view.path.time_s), view.clock
    picks = replace(trial.picks, time_s=clock.to_common(longer * np.asarray(clock.to_video(trial.picks.time_s))))
    pixels = replace(trial.pixels, time_s=longer * trial.pixels.time_s)
    return replace(trial, views=(replace(view, path=path),), picks=picks, pixels=pixels)


def zoomed(scene: Scene, truth: Fall, rng: np.random.Generator) -> Trial:
    """The focal length changes by 6 % up and down over the fall; the camera was solved where it was in the middle."""
    trial = filmed(scene, truth, rng, cause=("zoom",))
    view, camera_ = trial.views[0], trial.views[0].path.reference
    span = np.ptp(trial.pixels.time_s)
    phase, periods = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.0)

    def larger(time_s: np.ndarray) -> np.ndarray:
        return 1 + ZOOM * np.sin(2 * np.pi * periods * (time_s - trial.pixels.time_s[0]) / span + phase)[:, None]

    middle = np.array([camera_.cx, camera_.cy])
    pixel = middle + (trial.pixels.pixel - middle) * larger(trial.pixels.time_s)
    video_s = np.asarray(view.clock.to_video(trial.picks.time_s))
    position, rotation = view.path.poses_at(video_s)
    clicked = project(camera_, trial.picks.position, position=position, rotation=rotation)
    origin, direction = rays(
        camera_, middle + (clicked - middle) * larger(video_s), position=position, rotation=rotation
    )
    point = cast_rays(trial.surface, origin, direction).point
    near = closest_points(trial.surface, trial.picks.position).point
    point = np.where(np.isfinite(point) & (np.linalg.norm(point - near, axis=1) < 20)[:, None], point, near)
    return replace(trial, pixels=replace(trial.pixels, pixel=pixel), picks=replace(trial.picks, position=point))


ROWS: dict[str, RowOf] = {
    "nothing untrue, one view": filmed,
    "nothing untrue, two views": partial(filmed, views=2),
    "camera 0.3 m too high, with its covariance": camera,
    "one camera of two 0.3 m too high": partial(camera, views=2),
    "terrain wrong by 20 cm, stated at 2 cm": terrain,
    "terrain wrong by 20 cm, not stated": partial(terrain, sigma_m=None),
    "terrain wrong by 20 cm, stated at 2 cm, two views": partial(terrain, views=2),
    "clicks stated at 13 cm": clicks,
    "azimuth 70°": partial(filmed, azimuth_deg=(68.0, 72.0)),
    "side view": partial(filmed, azimuth_deg=(80.0, 100.0)),
    "stabilised": stabilised,
    "outliers": outliers,
    "three frames lost": dropped,
    "three frames lost in the first of two views": partial(dropped, views=2),
    "0.3 m of ground gone at one impact": eroded,
    "0.3 m of ground gone at one impact, two views": partial(eroded, views=2),
    "25 frames per second for 29.97": wrong_rate,
    "zoom of ± 6 %": zoomed,
}


@dataclass
class Tally:
    """Numbers of a row: relative errors of speeds and their deviations; errors of R_N and R, and whether they are in
    their intervals; widths; whether the cause was named, and what was said."""

    error: list = field(default_factory=list)
    sigma: list = field(default_factory=list)
    hits: dict[str, list] = field(default_factory=lambda: {"rn": [], "r": []})
    rn_width: list = field(default_factory=list)
    named: list = field(default_factory=list)
    warned: list = field(default_factory=list)
    said: Counter = field(default_factory=Counter)

    def add(self, trial: Trial, scene: Scene) -> None:
        """Refine one fall, and compare."""
        result, truth = trial.refined(), trial.truth
        impacts = result.reconstruction.impacts
        for name, energy, own in (("v1", "kinetic1_j", slice(1, None)), ("v2", "kinetic2_j", slice(-1))):
            true = np.linalg.norm(getattr(truth, name)[own], axis=1)
            found = np.linalg.norm(getattr(impacts, name)[own], axis=1)
            self.error += (found / true - 1).tolist()
            self.sigma += (impacts.sigma[energy][own] / (impacts.mass_kg[own] * found * true)).tolist()
        true = truth_of(truth, scene.slope, default_normal_radius(trial.surface, BLOCK.diameter_m))
        for name, hits in self.hits.items():
            ends, value = impacts.intervals[name], true[name]
            used = np.isfinite(value) & np.isfinite(ends[:, 0])
            hits += ((ends[:, 0] <= value) & (value <= ends[:, 1]))[used].tolist()
        self.rn_width += (np.diff(impacts.intervals["rn"])[1:-1, 0] / 2).tolist()
        grave = [one for one in result.remarks if one.severity in ("warning", "problem")]
        self.warned.append(bool(grave))
        self.named.append(any(word in one.text for one in grave for word in trial.cause))
        self.said.update(f"{one.severity}: {one.text[:110]}" for one in result.remarks if one.severity != "note")

    def cells(self, name: str, cause: bool) -> dict[str, str]:
        """The row as text."""
        error, sigma = np.abs(self.error), np.array(self.sigma)
        return {
            "row": name,
            "speed error %": f"{100 * np.median(error):.2f}",
            "in 95 %": f"{100 * np.mean(error < 1.96 * sigma):.0f}",
            "R_N in 95 %": f"{100 * np.mean(self.hits['rn']):.0f}",
            "R in 95 %": f"{100 * np.mean(self.hits['r']):.0f}",
            "deviation of speeds %": f"{100 * np.median(sigma):.2f}",
            "deviation / error (rms)": f"{np.sqrt(np.mean(sigma**2) / np.mean(error**2)):.2f}",
            "half width of R_N": f"{np.nanmedian(self.rn_width):.3f}",
            "cause named %": f"{100 * np.mean(self.named):.0f}" if cause else "–",
            "warned %": f"{100 * np.mean(self.warned):.0f}",
        }


def scenes(falls: int, seed: int) -> list[tuple[Scene, Fall]]:
    """Falls, ten to a slope."""
    rng, found = np.random.default_rng(seed), list[tuple[Scene, Fall]]()
    while len(found) < falls:
        slope = make_slope(rng)
        fine, given = slope.mesh(TRUE_STEP_M, 0.0, rng), slope.mesh(GIVEN_STEP_M, 0.005, rng)
        half = SIGMA_TERRAIN * np.sqrt(0.5)  # of the variance is in the height of all of it, and half in waves
        raised = Surface(given.vertices + np.array([0, 0, half * rng.normal()]), given.faces, given.shift, given.name)
        scene = Scene(slope, fine, wavy(raised, half, GIVEN_WAVES_M, rng))
        found += [(scene, fall(fine, rng)) for _ in range(min(FALLS_A_SLOPE, falls - len(found)))]
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--falls", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--row", nargs="*", default=[""], help="parts of their names; all if not given")
    parser.add_argument("--said", action="store_true", help="what was said, too")
    parser.add_argument("--out", type=Path, help="CSV file")
    arguments = parser.parse_args()
    drawn, rows = scenes(arguments.falls, arguments.seed), []
    for number, (name, make) in enumerate(ROWS.items()):
        if not any(part in name for part in arguments.row):
            continue
        rng, tally, cause = np.random.default_rng([arguments.seed, number]), Tally(), False
        for scene, truth in drawn:
            trial = make(scene, truth, rng)
            tally.add(trial, scene)
            cause = bool(trial.cause)
        row = tally.cells(name, cause)
        if not rows:
            print("| " + " | ".join(row) + " |\n|" + "---|" * len(row))
        print("| " + " | ".join(row.values()) + " |", flush=True)
        if arguments.said:
            print("\n".join(f"    {count} × {text}" for text, count in tally.said.most_common(8)), flush=True)
        rows.append(row)
    if arguments.out:
        with arguments.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
