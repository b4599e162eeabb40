# SPDX-License-Identifier: GPL-3.0-or-later
"""How near refinement comes to the truth, and to the best that the footage allows, on synthetic rockfalls.

Blocks bounce as spheres down a rough slope. A sphere's distance from the terrain at a contact is off by 2 cm (angular
blocks, errors of the scan). R_N is told by the block-scale normal at the true contact; whether its intervals hold where
the terrain itself is not known is measured in rn_intervals.py.
Cameras stand opposite; the run fills 70 % of the tighter side of the image. Each is solved (`resect`) from 20 pairs of
pixels (1 px: marked with the loupe on a still background) and points (2 cm: a terrestrial scan), with the focal length
known unless said otherwise, and is held by hand, stabilised to 0.2 px. People mark contacts to 3 px in the first view,
at whole frames. The tracker's pixels are off the spot that it follows by 1.5 px, and this spot is off the block's
centre by 15 % of its diameter, another way in each view. Other views' clocks are off by up to 50 ms. The time of a
trajectory is the processor's. Where something stated is untrue, `hard_rows.py` measures.
"""

import argparse
import csv
import statistics
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rockfall.core.camera.model import (
    Camera,
    look_at,
    project,
    project_with_derivatives,
    rays,
    rotation_from_vector,
)
from rockfall.core.camera.path import CameraPath
from rockfall.core.camera.resection.resect import resect
from rockfall.core.footage.clock import Clock
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.placement import terrain_normals
from rockfall.core.reconstruction.refinement.deviations import velocity_rows
from rockfall.core.reconstruction.refinement.problem import Unknowns, evaluate
from rockfall.core.reconstruction.refinement.refine import PixelObservations, Refinement, View, refine
from rockfall.core.reconstruction.refinement.setup import prepare, set_up
from rockfall.core.reconstruction.refinement.solver import normal_equations
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.raycast import cast_rays, closest_points
from rockfall.core.terrain.surface import Surface
from scipy.ndimage import gaussian_filter
from scipy.optimize import least_squares
from synthetic_falls import BLOCK, GRAVITY, GRID, GRID_STEP_M, NONE, RADIUS, SIGMA_TERRAIN, Air, Fall, fall, rough_slope

SIGMA_TRACK, SIGMA_PICK, SIGMA_STEADY = 1.5, 3.0, 0.2
SIGMA_AIM = 0.15
EXACT_M = 1e-4
"""Of a terrain that has no errors but those that differ from contact to contact."""
FILL = 0.7
TERRAIN, CAMERA, SHUTTER = ("terrain",), ("camera",), ("rolling shutter",)
AIR = ("drag", "lift", "acceleration")
ROCK_DRAG = Drag().per_metre(BLOCK)
MAGNUS = 0.15
"""Acceleration by the speed [1/s], up to: a ball's, which spins with its velocity over its radius."""


@dataclass(frozen=True)
class Pairs:
    """What a camera is solved from."""

    count: int = 20
    sigma_px: float = 1.0
    sigma_m: float = 0.02
    free: tuple[str, ...] = ()


@dataclass(frozen=True)
class Case:
    """A footage."""

    name: str
    width: int
    height: int
    rate_hz: float
    distance_m: float
    views: int
    pairs: Pairs = Pairs()
    azimuth_deg: tuple[float, float] = (45.0, 60.0)
    """Of the first camera, from the fall line."""
    fill: float = FILL
    """Part of the tighter side of the image that the run fills: the lens."""
    memory: float = 0.0
    """Correlation of the tracker's noise from one frame to the next."""
    wrong: "Wrong" = field(default_factory=lambda: Wrong())


@dataclass(frozen=True)
class Wrong:
    """What the program is not told, or told wrongly.

    Attributes
    ----------
    terrain_m : standard deviation of smooth errors of the terrain [m]; smooth_m over how far they are alike [m].
    raised_m : by how much the terrain is too high everywhere [m].
    lifted_m : by how much the cameras are too high [m]; their poses are given by hand then, without a covariance.
    readout_s : of the rolling shutter [s], which the program is not told; None for a global one that it knows.
    air : what acts on the blocks.
    cause : words of the warning that names the cause; any of them will do.
    """

    terrain_m: float = 0.0
    smooth_m: float = 4.0
    raised_m: float = 0.0
    lifted_m: float = 0.0
    readout_s: float | None = None
    air: Air = NONE
    cause: tuple[str, ...] = ()

    def terrain(self, surface: Surface, rng: np.random.Generator) -> Surface:
        """The terrain that the program is given."""
        if not (self.terrain_m or self.raised_m):
            return surface
        vertices = surface.vertices.reshape(*GRID, 3).copy()
        if self.terrain_m:
            noise = gaussian_filter(rng.normal(size=GRID), self.smooth_m / GRID_STEP_M)
            vertices[:, :, 2] += self.terrain_m * noise / noise.std()
        vertices[:, :, 2] += self.raised_m
        return Surface(vertices.reshape(-1, 3), surface.faces, surface.shift, surface.name)


CASES = (
    Case("4K, 30 Hz, 150 m, one view", 3840, 2160, 30.0, 150.0, 1),
    Case("4K, 30 Hz, 150 m, two views", 3840, 2160, 30.0, 150.0, 2),
    Case("4K, 30 Hz, 150 m, three views", 3840, 2160, 30.0, 150.0, 3),
    Case("4K, 30 Hz, 150 m, one view, focal length solved too", 3840, 2160, 30.0, 150.0, 1, Pairs(free=("f",))),
    Case("4K, 30 Hz, 150 m, one view, 12 pairs of 1.5 px and 3 cm", 3840, 2160, 30.0, 150.0, 1, Pairs(12, 1.5, 0.03)),
    Case("1080p, 60 Hz, 300 m, one view", 1920, 1080, 60.0, 300.0, 1),
    Case("1080p, 60 Hz, 300 m, three views", 1920, 1080, 60.0, 300.0, 3),
    Case("4K, 30 Hz, 150 m, one view along the slope", 3840, 2160, 30.0, 150.0, 1, azimuth_deg=(80.0, 100.0)),
    Case("4K, 30 Hz, 150 m, one view, noise correlated by 0.9", 3840, 2160, 30.0, 150.0, 1, memory=0.9),
    Case("4K, 30 Hz, 150 m, two views, noise correlated by 0.9", 3840, 2160, 30.0, 150.0, 2, memory=0.9),
    *(
        Case(f"{'two views' if views == 2 else 'one view'}, {name}", 3840, 2160, 30.0, 150.0, views, wrong=wrong)
        for name, views, wrong in (
            ("terrain wrong by 20 cm, its accuracy not stated", 1, Wrong(terrain_m=0.2, cause=TERRAIN)),
            ("terrain wrong by 20 cm, its accuracy not stated", 2, Wrong(terrain_m=0.2, cause=TERRAIN)),
            (
                "terrain wrong by 20 cm over 12 m, its accuracy not stated",
                1,
                Wrong(terrain_m=0.2, smooth_m=12.0, cause=TERRAIN),
            ),
            ("terrain 20 cm too high, its accuracy not stated", 1, Wrong(raised_m=0.2, cause=TERRAIN)),
            ("camera 0.3 m too high, its pose held without a covariance", 1, Wrong(lifted_m=0.3, cause=CAMERA)),
            ("global shutter, not said", 1, Wrong(readout_s=0.0, cause=SHUTTER)),
            ("rolling shutter of 10 ms", 1, Wrong(readout_s=0.01, cause=SHUTTER)),
            ("rolling shutter of 20 ms", 1, Wrong(readout_s=0.02, cause=SHUTTER)),
            ("rolling shutter of 30 ms", 1, Wrong(readout_s=0.03, cause=SHUTTER)),
            ("rolling shutter of 20 ms", 2, Wrong(readout_s=0.02, cause=SHUTTER)),
            ("drag not modelled", 1, Wrong(air=Air(drag_per_m=ROCK_DRAG), cause=AIR)),
            ("Magnus force", 1, Wrong(air=Air(lift_per_s=MAGNUS), cause=AIR)),
            ("Magnus force", 2, Wrong(air=Air(lift_per_s=MAGNUS), cause=AIR)),
        )
    ),
)


def solve_camera(
    camera: Camera, surface: Surface, pairs: Pairs, rng: np.random.Generator
) -> tuple[Camera, np.ndarray, np.ndarray]:
    """The camera as `resect` finds it from noisy pairs on the slope, its covariance (6, 6), and the least there is."""
    points = np.empty((0, 3))
    while len(points) < pairs.count:
        origin, direction = rays(camera, rng.uniform([0, 0], camera.size, (pairs.count, 2)))
        hit = cast_rays(surface, origin, direction)
        found = hit.point[np.isfinite(hit.distance)]
        points = np.concatenate([points, found])[: pairs.count]
    seen = project_with_derivatives(camera, points)
    focal = (seen.d_intrinsics[:, :, :1] + seen.d_intrinsics[:, :, 1:2])[:, :, : len(pairs.free)]
    jacobian = np.concatenate([seen.d_rotation, seen.d_position, focal], axis=2)
    noise = pairs.sigma_px**2 * np.eye(2) + pairs.sigma_m**2 * seen.d_point @ np.swapaxes(seen.d_point, 1, 2)
    least = np.linalg.inv((np.swapaxes(jacobian, 1, 2) @ np.linalg.inv(noise) @ jacobian).sum(axis=0))[:6, :6]
    found = resect(
        np.clip(seen.pixel + pairs.sigma_px * rng.normal(size=seen.pixel.shape), 0, camera.size),
        points + pairs.sigma_m * rng.normal(size=points.shape),
        *camera.size,
        free=pairs.free,
        camera=None if pairs.free else replace(camera, position=camera.position + rng.normal(size=3)),
        sigma_px=pairs.sigma_px,
        sigma_m=pairs.sigma_m,
    )
    return found.camera, found.pose_covariance_given_lens, least


@dataclass(frozen=True, eq=False)
class Footage:
    """What was filmed of one fall: true and solved views, marked picks, tracked pixels."""

    truth: Fall
    true_views: tuple[View, ...]
    views: tuple[View, ...]
    picks: object
    pixels: PixelObservations


def film(case: Case, surface: Surface, given: Surface, truth: Fall, rng: np.random.Generator) -> Footage:
    """Film a fall over a terrain, and mark it on the one that is given."""
    middle = (truth.centre.min(axis=0) + truth.centre.max(axis=0)) / 2
    first = rng.uniform(*case.azimuth_deg)
    azimuths = np.radians([first, first - rng.uniform(60, 90), first - rng.uniform(30, 45)])[: case.views]
    true_views, views, rows = [], [], []
    for number, azimuth in enumerate(azimuths):
        place = middle + case.distance_m * np.array([np.cos(azimuth), np.sin(azimuth), 0.1])
        camera = look_at(case.width, case.height, place, middle, focal_px=1000.0)
        extent = np.ptp(project(camera, truth.centre), axis=0)
        focal = 1000.0 * float(np.min(case.fill * np.array(camera.size) / extent))
        camera = look_at(case.width, case.height, place, middle, focal_px=focal)
        resected, covariance, least = solve_camera(camera, surface, case.pairs, rng)

        offset = float(rng.uniform(-3, 3)) + truth.time_s[0]
        common = (
            truth.time_s[0]
            - 1
            + rng.uniform() / case.rate_hz
            + np.arange(0, np.ptp(truth.time_s) + 2, 1 / case.rate_hz)
        )
        video = common - offset
        shake = np.cumsum(rng.normal(size=(common.size, 3)), axis=0) * 2 / focal
        held = rotation_from_vector(shake) @ camera.rotation
        steady = rotation_from_vector(rng.normal(size=(common.size, 3)) * SIGMA_STEADY / focal)
        still = np.zeros(common.size)
        positions = np.repeat(place[None], common.size, axis=0)
        path = CameraPath(camera, video, positions, held, still, still)
        true_views.append(View(f"camera {number + 1}", path, Clock(offset), 0.0, least))

        lift = np.array([0, 0, case.wrong.lifted_m])
        if case.wrong.lifted_m:
            resected, covariance = replace(camera, position=place + lift), None
        solved = CameraPath(
            resected,
            video,
            positions + resected.position - place,
            steady @ held @ camera.rotation.T @ resected.rotation,
            still,
            np.full(common.size, SIGMA_STEADY / focal),
        )
        guess = offset + (0.0 if number == 0 else float(rng.uniform(-0.05, 0.05)))
        row_time = 0.0 if case.wrong.readout_s is None else None
        views.append(View(f"camera {number + 1}", solved, Clock(guess), row_time, covariance))

        inside = np.flatnonzero((common > truth.time_s[0]) & (common < truth.time_s[-1]))
        late = np.zeros(inside.size)
        for _ in range(4 if case.wrong.readout_s else 1):
            where = truth.seen_at(common[inside] + late)
            pixel = project(camera, where, rotation=held[inside], position=positions[inside])
            late = (case.wrong.readout_s or 0.0) * (pixel[:, 1] / case.height - 0.5)
        size = focal * 2 * RADIUS / np.linalg.norm(where - place, axis=1)
        pixel = pixel + np.outer(size, SIGMA_AIM * rng.normal(size=2)) + SIGMA_TRACK * noise_of(case, len(pixel), rng)
        rows.append((np.full(inside.size, number), video[inside], pixel))

    view, video_s, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
    pixels = PixelObservations(view, np.full(view.size, "a"), video_s, pixel, np.full(view.size, SIGMA_TRACK))
    return Footage(truth, tuple(true_views), tuple(views), marked(given, truth, true_views[0], views[0], rng), pixels)


def noise_of(case: Case, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count, 2) normal numbers with a standard deviation of one, each correlated with the one before."""
    fresh = rng.normal(size=(count, 2))
    for i in range(1, count):
        fresh[i] = case.memory * fresh[i - 1] + np.sqrt(1 - case.memory**2) * fresh[i]
    return fresh


def marked(surface: Surface, truth: Fall, true: View, solved: View, rng: np.random.Generator):
    """Picks in the first view: rays through pixels onto the terrain, at whole frames."""
    path = true.path
    frame = np.abs(np.asarray(true.clock.to_common(path.time_s))[:, None] - truth.time_s).argmin(axis=0)
    exact = project(path.reference, truth.contact, position=path.position[frame], rotation=path.rotation[frame])
    place, open_rows = np.full(truth.contact.shape, np.nan), np.arange(len(frame))
    for _ in range(50):
        origin, direction = rays(
            solved.path.reference,
            exact[open_rows] + SIGMA_PICK * rng.normal(size=(open_rows.size, 2)),
            position=solved.path.position[frame[open_rows]],
            rotation=solved.path.rotation[frame[open_rows]],
        )
        point = cast_rays(surface, origin, direction).point
        found = np.linalg.norm(point - truth.contact[open_rows], axis=1) < 10
        place[open_rows[found]] = point[found]
        open_rows = open_rows[~found]
    if open_rows.size:  # the sky behind: the nearest ground
        place[open_rows] = closest_points(surface, truth.contact[open_rows] + 0.3 * rng.normal(size=3)).point
    times = np.asarray(solved.clock.to_common(path.time_s[frame]))
    sigma = np.full(len(frame), float(np.diff(path.time_s).mean()) / np.sqrt(12))
    return make_picks(["a"] * len(frame), times, place, sigma_time_s=sigma)


def bound(surface: Surface, footage: Footage, free: tuple[str, ...]) -> tuple[np.ndarray, ...]:
    """Cramér–Rao: covariances (n, 3, 3) of v1 and v2 and (v, 3, 3) of the cameras' places, nuisance included."""
    ground = prepare(footage.picks, surface, BLOCK, None, None, EXACT_M)
    ground = replace(ground, sigma_m=np.full(len(footage.picks), SIGMA_TERRAIN))
    setup = set_up(ground, footage.true_views, footage.pixels, ["a"], GRAVITY, frozenset(free), SIGMA_AIM)
    zeros, aim = np.zeros((len(footage.views), 3)), np.zeros((len(footage.views), 1, 2))
    truth = footage.truth
    state = Unknowns(
        truth.centre, truth.time_s, zeros, zeros, zeros[:, 0], zeros[:, 0], aim, 0.0, GRAVITY, np.zeros(len(zeros))
    )
    problem = replace(setup.problem, sigma_px=np.full(len(footage.pixels), np.hypot(SIGMA_TRACK, SIGMA_STEADY)))
    there = evaluate(problem, state)
    information, _ = normal_equations(problem, there, (there.segment >= 0).astype(float))
    covariance = np.linalg.inv(information)
    n = len(truth.time_s)
    segment = np.arange(-1, n - 1), np.r_[np.arange(n - 1), -1]
    slopes = [velocity_rows(problem, there.motion, segment[i], at_end=i == 0) for i in range(2)]
    pose = problem.columns.pose[:, 3:]
    return *(slope @ covariance @ np.swapaxes(slope, 1, 2) for slope in slopes), covariance[
        pose[:, :, None], pose[:, None]
    ]


@dataclass
class Tally:
    """Numbers of all the velocities of a case."""

    raw: list
    refined: list
    sigma: list
    best: list
    speed: list
    component_hits: list
    speed_hits: list
    rn: list
    rn_sigma: list
    camera: list
    camera_before: list
    camera_best: list
    place: list
    place_sigma: list
    seconds: list
    iterations: list
    named: list
    unsettled: int = 0


def measure(case: Case, surface: Surface, falls: list[Fall], seed: int) -> Tally:
    """Film, mark, refine and compare all falls."""
    rng = np.random.default_rng(seed)
    tally = Tally(*([] for _ in range(17)))
    free = () if case.wrong.lifted_m else ("camera",)
    if case.views > 1:
        free = (*free, "clock")
    stated = None if case.wrong.terrain_m or case.wrong.raised_m else SIGMA_TERRAIN
    for truth in falls:
        given = case.wrong.terrain(surface, rng)
        footage = film(case, surface, given, truth, rng)
        raw = reconstruct(footage.picks, surface=given, block=BLOCK).impacts
        start = time.thread_time()
        result = refine(
            footage.picks, footage.views, footage.pixels, surface=given, block=BLOCK, free=free, sigma_terrain_m=stated
        )
        tally.seconds.append(time.thread_time() - start)
        tally.iterations.append(result.iterations)
        add(tally, truth, raw, result, footage, bound(surface, footage, ("camera", *free[-1:])), case)
    return tally


def add(tally: Tally, truth: Fall, raw, result: Refinement, footage: Footage, best, case: Case) -> None:
    """Add one fall's numbers."""
    impacts = result.reconstruction.impacts
    for name, true, covariance, own in (
        ("v1", truth.v1, best[0], slice(1, None)),
        ("v2", truth.v2, best[1], slice(-1)),
    ):
        true, found, marked_v = true[own], getattr(impacts, name)[own], getattr(raw, name)[own]
        speed = np.linalg.norm(true, axis=1)
        direction = true / speed[:, None]
        tally.speed += speed.tolist()
        tally.raw += (np.linalg.norm(marked_v, axis=1) / speed - 1).tolist()
        error = np.linalg.norm(found, axis=1) - speed
        tally.refined += (error / speed).tolist()
        tally.best += (np.sqrt(np.einsum("ni,nij,nj->n", direction, covariance[own], direction)) / speed).tolist()
        tally.component_hits += (np.abs(found - true) < 1.96 * impacts.sigma[name][own]).ravel().tolist()
        energy = "kinetic1_j" if name == "v1" else "kinetic2_j"
        sigma = impacts.sigma[energy][own] / (impacts.mass_kg[own] * np.linalg.norm(found, axis=1))
        tally.speed_hits += (np.abs(error) < 1.96 * sigma).tolist()
    inner = slice(1, -1)
    tally.rn += (impacts.rn - truth.rn)[inner].tolist()
    tally.rn_sigma += impacts.sigma["rn"][inner].tolist()
    for true, solved, refined in zip(footage.true_views, footage.views, result.views, strict=True):
        place = true.path.reference.position
        tally.camera_before.append(np.linalg.norm(solved.path.reference.position - place) / case.distance_m)
        tally.camera.append(np.linalg.norm(refined.path.reference.position - place) / case.distance_m)
    away = result.picks.position - truth.centre + RADIUS * result.picks.normal
    tally.place += np.linalg.norm(away, axis=1)[inner].tolist()
    tally.place_sigma += result.picks.sigma_position_m[inner].tolist()
    draws = np.random.default_rng(0).normal(size=(100, 3))
    solved = case.pairs.free  # the fit holds the lens, so that its bound is not one
    for covariance in [view.pose_covariance[3:, 3:] for view in footage.true_views] if solved else best[2]:
        away = draws @ np.linalg.cholesky(covariance).T
        tally.camera_best += (np.linalg.norm(away, axis=1) / case.distance_m).tolist()
    said = " ".join(remark.text for remark in result.remarks if remark.severity in ("warning", "advice"))
    tally.named.append(any(word in said for word in case.wrong.cause))
    tally.unsettled += not result.converged


def row_of(case: Case, tally: Tally, rng: np.random.Generator) -> dict[str, str]:
    """The numbers of a case as text."""
    best = np.array(tally.best)
    refined, rn, rn_sigma = np.array(tally.refined), np.array(tally.rn), np.array(tally.rn_sigma)
    least = float(np.median(np.abs(rng.normal(size=(200, best.size)) * best)))
    reached = float(np.median(np.abs(refined)))
    known = np.isfinite(rn)
    place, place_sigma = np.array(tally.place), np.array(tally.place_sigma)
    return {
        "footage": case.name,
        "speed error, raw picks %": f"{100 * np.median(np.abs(tally.raw)):.1f}",
        "speed error, refined %": f"{100 * reached:.2f}",
        "Cramér–Rao %": "–" if case.pairs.free else f"{100 * least:.2f}",
        "R_N error": f"{np.median(np.abs(rn[known])):.3f}",
        "coverage speed %": f"{100 * np.mean(tally.speed_hits):.1f}",
        "coverage R_N %": f"{100 * np.mean(np.abs(rn[known]) < 1.96 * rn_sigma[known]):.1f}",
        "camera %": f"{100 * np.median(tally.camera):.3f}",
        "camera's bound %": f"{100 * np.median(tally.camera_best):.3f}",
        "cause named %": f"{100 * np.mean(tally.named):.0f}" if case.wrong.cause else "–",
        "ms per trajectory": f"{1e3 * statistics.median(tally.seconds):.0f}",
        "ratio": "–" if case.pairs.free else f"{reached / least:.2f}",
        "rms / Cramér–Rao": "–" if case.pairs.free else f"{np.sqrt(np.mean((refined / best) ** 2)):.2f}",
        "coverage v %": f"{100 * np.mean(tally.component_hits):.1f}",
        "camera before %": f"{100 * np.median(tally.camera_before):.3f}",
        "place cm": f"{100 * np.median(place):.1f}",
        "place rms / deviation": f"{np.sqrt(np.mean((place / place_sigma) ** 2) / 3):.2f}",
        "iterations": f"{statistics.median(tally.iterations):.0f}",
        "unsettled": str(tally.unsettled),
    }


TABLE = 11
"""So many columns are printed; the file has all."""


def compare_speed(surface: Surface, truth: Fall, seed: int) -> None:
    """Time of refine, and of scipy's least squares with a numeric Jacobian on the same residuals."""
    from rockfall.core.reconstruction.refinement.problem import moved
    from rockfall.core.reconstruction.refinement.solver import solve

    case = Case("two views", 3840, 2160, 30.0, 150.0, 2)
    footage = film(case, surface, surface, truth, np.random.default_rng(seed))
    free = frozenset({"camera"})
    views = tuple(replace(view, clock=true.clock) for view, true in zip(footage.views, footage.true_views, strict=True))
    ground = prepare(footage.picks, surface, BLOCK, None, None, SIGMA_TERRAIN)
    setup = set_up(ground, views, footage.pixels, ["a"], GRAVITY, free)
    start = time.perf_counter()
    ours = solve(setup.problem, setup.state, "linear")
    own = time.perf_counter() - start
    scale = 1 / np.sqrt(np.diag(ours.information))

    def residuals(step: np.ndarray) -> np.ndarray:
        there = evaluate(setup.problem, moved(setup.problem, setup.state, step * scale))
        return np.concatenate([there.pixels.residual.ravel(), *(rows.residual.ravel() for rows in there.others)])

    start = time.perf_counter()
    theirs = least_squares(residuals, np.zeros(setup.problem.columns.size), method="trf", xtol=1e-10)
    taken = time.perf_counter() - start
    squares = (ours.evaluation.pixels.residual**2).sum() + sum((r.residual**2).sum() for r in ours.evaluation.others)
    print(
        f"\n{len(truth.time_s)} impacts, {len(footage.pixels)} pixels, {setup.problem.columns.size} unknowns: "
        f"{1e3 * own:.0f} ms, {ours.iterations} iterations, cost {squares / 2:.3f}; scipy's least_squares with a "
        f"numeric Jacobian {taken:.2f} s, {taken / own:.0f} times as long, cost {theirs.cost:.3f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--falls", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int, nargs="*", default=list(range(len(CASES))), help="their numbers, from 0")
    parser.add_argument("--speed", action="store_true", help="against scipy's least squares, too")
    parser.add_argument("--out", type=Path, help="CSV file")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    surface = rough_slope(rng)
    falls = [fall(surface, rng) for _ in range(arguments.falls)]
    speeds = np.concatenate([np.linalg.norm(one.v1[1:], axis=1) for one in falls])
    flights = np.concatenate([np.diff(one.time_s) for one in falls])
    places = np.concatenate([one.contact for one in falls])
    spread = np.degrees(terrain_normals(surface, places, np.full(len(places), 2 * RADIUS), None).spread)
    print(
        f"{len(falls)} falls, {len(places)} contacts, median flight {np.median(flights):.2f} s, median incident speed "
        f"{np.median(speeds):.1f} m/s, normal's spread {np.median(spread):.0f}°\n"
    )
    rows = []
    for number in arguments.case:
        case, own = CASES[number], falls
        if case.wrong.air != NONE:
            drawn = np.random.default_rng(arguments.seed)
            own = [fall(surface, drawn, case.wrong.air) for _ in falls]
        row = row_of(case, measure(case, surface, own, arguments.seed + 1), np.random.default_rng(0))
        if not rows:
            print("| " + " | ".join(list(row)[:TABLE]) + " |\n|" + "---|" * TABLE)
        print("| " + " | ".join(list(row.values())[:TABLE]) + " |", flush=True)
        rows.append(row)
    if arguments.speed:
        compare_speed(surface, max(falls, key=lambda one: len(one.time_s)), arguments.seed)
    if arguments.out:
        with arguments.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
