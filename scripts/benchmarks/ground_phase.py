# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the motion on the ground depends on the triangles: kinks, fillets, crests, meshes, tiles, thresholds.

Each table sets the engine beside what does not depend on a mesh: a closed form, or the same surface sampled otherwise.

kinks       a plane of 45°, then a gentler one, with one sharp concave edge between. A rolling sphere that meets a
            second plane plastically keeps the speed (cos T + c)/(1 + c), with the inertia c m r²; a sliding one cos T.
fillets     a slope of 40° onto the flat, rounded with the radius R by n edges. From R = r on a sphere touches the arc
            at one place at a time: its stop is that of the energy line. Below, it hits as in the sharp kink.
crests      the convex likewise: a block takes off where v² > g cosβ (R + r).
meshes      one smooth rough surface (36°, 14°, flat; waves of 3 m and more) as grids of several spacings.
noise       a plane of 30° that runs out onto the flat, its points off at random: run-out, that without noise as long as
            the noise is below the scale of the block.
tiles       the demo site and scanned slopes as grids of several spacings: run-out, and speed and energy at a screen.
thresholds  constants of the kernels halved and doubled: run-out and impacts on one of the meshes.

Example: ground_phase.py kinks --angles 29 31 --friction 0.45
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
from rockfall.core.constants import GRAVITY_MPS2 as G
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.screens import Screen, blocks_at, hits_at
from rockfall.core.impact_models.registry import FORMULAS
from rockfall.core.simulation.engine import ENDS, FLIES_OFF, IMPACT, ON_GROUND, RELEASED, Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface

ROOT = Path(__file__).parents[2]
NEUTRAL = ("azimi_desvarreux_1977", {"rn": 0.0, "rt": 1.0})
"""An impact takes the speed towards the ground, and no other: the plastic contact of the closed forms that slide."""
INERTIA = {"azzoni_1995": 0.4, "coulomb": 0.0}
MODELS = {name.split("_")[0]: name for name in FORMULAS}
DIAMETER_M = 0.3
WIDTH_M = 4.0


def grid(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Surface:
    """Two triangles a cell; `z` is [y, x]. Cells with a NaN are left out."""
    x, y = np.meshgrid(x, y)
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    faces = faces[np.isfinite(z.ravel()[faces]).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)[used]
    return Surface(vertices, faces.reshape(-1, 3).astype(np.int32), GlobalShift(), "grid")


def strip(profile: np.ndarray) -> Ground:
    """A profile (k, 2) of x and z, the same all across."""
    return make_ground(grid(profile[:, 0], np.array([0.0, WIDTH_M]), np.tile(profile[:, 1], (2, 1))))


def bent(first: float, last: float, radius: float, edges: int, before: float, behind: float) -> np.ndarray:
    """(k, 2) a line that falls at `first`, then at `last` [rad], with an arc between of so many chords; 0 is a kink.

    The sharp edge of both lines is at (0, 0); they are as long as `before` and `behind`, less what the arc takes.
    """
    way = lambda angle: np.array([np.cos(angle), -np.sin(angle)])  # noqa: E731
    start, end = -before * way(first), behind * way(last)
    if not edges:
        return np.array([start, [0.0, 0.0], end])
    turn = abs(last - first)
    tangent = radius * np.tan(turn / 2)
    angle = np.linspace(first, last, edges + 1)
    side = 1.0 if last < first else -1.0  # concave: the centre of the arc is above
    centre = -tangent * way(first) + side * radius * np.array([np.sin(first), np.cos(first)])
    arc = centre - side * radius * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return np.vstack([start, arc, end])


def rolling(profile: np.ndarray, first: float, speed: float, diameter: float, along: float) -> Releases:
    """One block that touches the first line of a profile, `along` behind its start, at a speed along it."""
    way, up = np.array([np.cos(first), 0.0, -np.sin(first)]), np.array([np.sin(first), 0.0, np.cos(first)])
    place = np.array([profile[0, 0], 0.47 * WIDTH_M, profile[0, 1]]) + along * way + diameter / 2 * up
    return make_releases(place[None], velocity=(speed * way - 1e-4 * up)[None], diameter_m=diameter)


def contacts(run: object) -> tuple[int, int]:
    """Impacts after the first touch, and take-offs."""
    what, time = run.records.what, run.records.time_s
    return int(((what == IMPACT) & (time > 0.02)).sum()), int((what == FLIES_OFF).sum())


# ------------------------------------------------------------------------------------------------------------- kinks


def kinks(options: argparse.Namespace) -> None:
    first, before, along = np.radians(45.0), 20.0, 2.0
    print(f"sharp concave kink below 45°; block of {options.diameter:.2f} m")
    print(f"{'law':<12}{'model':<10}{'mu':>5}{'kink':>6}{'v before':>10}{'v behind':>10}{'kept v²':>9}{'plastic':>9}"
          f"{'off by':>8}{'stop m':>9}{'impacts':>9}{'offs':>6}")  # fmt: skip
    r = options.diameter / 2
    for law in options.laws:
        c = INERTIA[law]
        pull = 2 * G / (1 + c)
        for model in options.models:
            for mu in options.friction:
                for degrees in options.angles:
                    turn = np.radians(degrees)
                    last = first - turn
                    profile = bent(first, last, 0.0, 0, before, 400.0)
                    start = 1.0
                    # The centre comes to the corner of the two planes moved by r, r tan(T/2) before the edge.
                    way = before - along - r * np.tan(turn / 2)
                    square = start**2 + pull * way * (np.sin(first) - mu * np.cos(first))
                    if square <= 0:
                        continue
                    parameters = NEUTRAL[1] if MODELS[model] == NEUTRAL[0] and not options.own else {}
                    releases = rolling(profile, first, start, options.diameter, along)
                    run = simulate(
                        strip(profile), releases, Settings(MODELS[model], parameters, rolling=law, friction=mu)
                    )
                    records = run.records
                    downhill = np.array([np.cos(last), 0.0, -np.sin(last)])
                    s = records.position @ downhill - r * np.tan(turn / 2)
                    late = records.position[:, 0] > r * np.sin(last) + 1e-6
                    behind = np.flatnonzero((records.what == ON_GROUND) & (s > 1e-4) & late)
                    came = first_speed2(records, r, first, pull, mu)
                    kept, speed = np.nan, np.nan
                    if behind.size:
                        k = behind[0]
                        square2 = (records.v2[k] ** 2).sum() - pull * s[k] * (np.sin(last) - mu * np.cos(last))
                        kept, speed = square2 / came, np.sqrt(max(square2, 0.0))
                    plastic = ((np.cos(turn) + c) / (1 + c)) ** 2
                    stop = run.position[0, 0] if ENDS[run.end[0]] == "stopped" else np.nan
                    impacts, offs = contacts(run)
                    print(f"{law:<12}{model:<10}{mu:>5.2f}{degrees:>5.0f}°{np.sqrt(came):>10.2f}{speed:>10.2f}{kept:>9.3f}"
                          f"{plastic:>9.3f}{kept - plastic:>+8.3f}{stop:>9.1f}{impacts:>9}{offs:>6}")  # fmt: skip


def first_speed2(records: object, r: float, first: float, pull: float, mu: float) -> float:
    """v² at the kink, of the last record on the first plane in closed form: models may take some at the first touch."""
    way, up = np.array([np.cos(first), 0.0, -np.sin(first)]), np.array([np.sin(first), 0.0, np.cos(first)])
    on = (np.abs(records.position @ up - r) < 1e-3 * r) & (records.what != IMPACT) & (records.what != RELEASED)
    before = np.flatnonzero(on & (records.position @ way < -1.0))
    k = before[-1] if before.size else int(np.flatnonzero(records.what == ON_GROUND)[0])
    s = -(records.position[k] @ way)
    return float((records.v2[k] ** 2).sum() + pull * s * (np.sin(first) - mu * np.cos(first)))


# ----------------------------------------------------------------------------------------------------------- fillets


def fillets(options: argparse.Namespace) -> None:
    r, first, last, along, before = options.diameter / 2, np.radians(40.0), 0.0, 1.0, 8.0
    model, parameters = NEUTRAL
    print(f"40° onto the flat, rounded with R by n edges; block of {options.diameter:.2f} m; run-out beyond the kink,")
    print("as a part of the energy line's (below R = r: of a block that hits both planes plastically)")
    for law in options.laws:
        c = INERTIA[law]
        pull = 2 * G / (1 + c)
        for mu in options.friction:
            print(
                f"\n{law}, mu {mu:g}\n{'R/r':>6}"
                + "".join(f"{n:>8}" for n in options.edges)
                + "   edges; sharp kink: 0"
            )
            for ratio in options.ratios:
                cells = []
                for edges in options.edges:
                    profile = bent(first, last, ratio * r, edges, before, 300.0)
                    releases = rolling(profile, first, 1.0, options.diameter, along)
                    run = simulate(strip(profile), releases, Settings(model, parameters, rolling=law, friction=mu))
                    start = releases.position[0]
                    if ratio >= 1 and edges:
                        square = 1.0 + pull * (start[2] - r)  # on the flat, less the friction of the way
                        stop = start[0] + square / (pull * mu)
                        foot = 0.0
                    else:
                        foot = r * np.tan((first - last) / 2)
                        kept = ((np.cos(first - last) + c) / (1 + c)) ** 2
                        square = 1.0 + pull * (start[2] - r) - pull * mu * (foot - start[0])
                        stop = foot + kept * square / (pull * mu)
                    cells.append((run.position[0, 0] - foot) / (stop - foot))
                print(f"{ratio:>6.2f}" + "".join(f"{cell:>8.3f}" for cell in cells), flush=True)


def crests(options: argparse.Namespace) -> None:
    r, first, last, along, before = options.diameter / 2, np.radians(5.0), np.radians(35.0), 0.5, 4.0
    model, parameters = NEUTRAL
    print(
        f"5° onto 35°, rounded with R by n edges; block of {options.diameter:.2f} m; "
        "s² = v²/(g cosβ (R + r)) at the begin of the arc"
    )
    print("each cell: take-offs, the angle β of the first [°], and how far v behind is from the energy line's")
    for law in options.laws:
        c = INERTIA[law]
        pull = 2 * G / (1 + c)
        for mu in options.friction:
            print(
                f"\n{law}, mu {mu:g}\n{'R/r':>6}{'s':>6}{'due at':>8}"
                + "".join(f"{n:>17}" for n in options.edges)
                + "   edges"
            )
            for ratio in options.ratios:
                for s in options.speeds:
                    way = (ratio + 1) * r
                    square = s**2 * G * np.cos(first) * way
                    angle = np.linspace(first, last, 2001)
                    on_arc = square + pull * way * (
                        np.cos(first) - np.cos(angle) - mu * (np.sin(angle) - np.sin(first))
                    )
                    off = np.flatnonzero(on_arc > G * np.cos(angle) * way)
                    due = np.degrees(angle[off[0]]) if off.size else np.nan
                    cells = []
                    for edges in options.edges:
                        profile = bent(first, last, ratio * r, edges, before, 300.0)
                        tangent = ratio * r * np.tan((last - first) / 2)
                        start2 = square - pull * (before - along - tangent) * (np.sin(first) - mu * np.cos(first))
                        if start2 <= 0.01:
                            cells.append(f"{'too slow':>17}")
                            continue
                        releases = rolling(profile, first, np.sqrt(start2), options.diameter, along)
                        settings = Settings(model, parameters, rolling=law, friction=mu, most_s=8.0)
                        run = simulate(strip(profile), releases, settings)
                        records = run.records
                        offs = np.flatnonzero(records.what == FLIES_OFF)
                        offs = offs[records.position[offs, 0] < 40 * r + 2 * tangent]
                        at = np.nan
                        if offs.size:
                            at = np.degrees(np.arctan2(records.normal[offs[0], 0], records.normal[offs[0], 2]))
                        far = np.flatnonzero(
                            (records.what == ON_GROUND) & (records.position[:, 0] > 60 * r + 2 * tangent)
                        )
                        change = np.nan
                        if far.size:
                            begin, k = releases.position[0], far[0]
                            drop, run_m = begin[2] - records.position[k, 2], records.position[k, 0] - begin[0]
                            change = np.sqrt((records.v2[k] ** 2).sum() / (start2 + pull * (drop - mu * run_m))) - 1
                        cells.append(f"{offs.size:>4}{at:>6.1f}{100 * change:>+6.1f}%")
                    print(f"{ratio:>6.2f}{s:>6.2f}{due:>8.1f}" + "".join(cells), flush=True)


# ------------------------------------------------------------------------------------------------------------ meshes


def smooth_rough(x: np.ndarray, y: np.ndarray, roughness: float, seed: int) -> np.ndarray:
    """Heights of a smooth rough slope: 36°, 14° from x = 44 m, flat from x = 79 m, waves of 3 m and more."""
    above = lambda x, at: 2.0 * np.logaddexp(0.0, (x - at) / 2.0)  # noqa: E731  a kink rounded over some metres
    steep, gentle = np.tan(np.radians(36.0)), np.tan(np.radians(14.0))
    z = -steep * x + (steep - gentle) * above(x, 44.0) + gentle * above(x, 79.0)
    rng = np.random.default_rng(seed)
    for length in (3.0, 4.0, 5.5, 8.0, 12.0, 20.0):
        for _ in range(2):
            turn, phase = rng.uniform(0, 2 * np.pi, 2)
            z = z + roughness * length * np.sin(2 * np.pi / length * (np.cos(turn) * x + np.sin(turn) * y) + phase)
    return z


def rough_ground(spacing: float, roughness: float, seed: int) -> Ground:
    """The slope as a grid."""
    x, y = np.arange(0.0, 130.0 + spacing / 2, spacing), np.arange(0.0, 40.0 + spacing / 2, spacing)
    return make_ground(grid(x, y, smooth_rough(*np.meshgrid(x, y), roughness, seed)))


def started(ground: Ground, blocks: int, diameter: float) -> Releases:
    """Blocks near the top that start rolling at 1 m/s, straight down."""
    places = np.random.default_rng(5).uniform([3, 15], [6, 25], (blocks, 2))
    centre = placed_on(ground, places, np.full(blocks, diameter))
    way = np.array([np.cos(np.radians(36)), 0.0, -np.sin(np.radians(36))])
    return make_releases(centre, velocity=np.tile(way, (blocks, 1)), diameter_m=diameter)


def _error(values: np.ndarray) -> float:
    """Standard error of the mean."""
    return float(values.std() / np.sqrt(values.size))


def meshes(options: argparse.Namespace) -> None:
    print(f"smooth rough slope, roughness {options.roughness:g} of the wave length, {options.blocks} blocks, ", end="")
    print(f"{options.law}, mu {options.friction[0]:g}: mean run-out in m ± standard error (impacts a block)")
    spacings = options.spacings
    grounds = {spacing: rough_ground(spacing, options.roughness, options.surface) for spacing in spacings}
    print(
        f"{'model':<12}{'diameter':>9}"
        + "".join(f"{f'{spacing:g} m':>20}" for spacing in spacings)
        + "  largest/smallest"
    )
    for model in options.models:
        for diameter in options.diameters:
            cells, means = [], []
            for spacing in spacings:
                releases = started(grounds[spacing], options.blocks, diameter)
                settings = Settings(MODELS[model], rolling=options.law, friction=options.friction[0], seed=1)
                run = simulate(grounds[spacing], releases, settings, record="ends", threads=1)
                way = np.hypot(*(run.position - releases.position)[:, :2].T)
                means.append(way.mean())
                cells.append(f"{way.mean():>8.1f} ±{_error(way):>4.1f} ({run.impacts.mean():>4.1f})")
            print(f"{model:<12}{diameter:>8.2f}m" + "".join(cells) + f"{max(means) / min(means):>12.3f}", flush=True)


def noisy_ground(spacing: float, sigma: float, seed: int) -> Ground:
    """30°, from x = 30 m on flat, with normal errors of the heights [m]."""
    x, y = np.arange(0.0, 66.0 + spacing / 2, spacing), np.arange(0.0, 40.0 + spacing / 2, spacing)
    steep = np.tan(np.radians(30.0))
    z = steep * (2.0 * np.logaddexp(0.0, (x - 30.0) / 2.0) - x)
    return make_ground(grid(x, y, z + np.random.default_rng(seed).normal(0.0, sigma, (y.size, x.size))))


def noise(options: argparse.Namespace) -> None:
    print(f"30° onto the flat, {options.blocks} blocks that start at 1 m/s, {options.law}, mu {options.friction[0]:g}:")
    print("mean run-out in m (impacts a block, the first touch is one)")
    print(f"{'model':<10}{'diameter':>9}{'spacing':>9}" + "".join(f"{f'{1000 * s:g} mm':>14}" for s in options.sigmas))
    for spacing in options.spacings:
        grounds = [noisy_ground(spacing, sigma, options.surface) for sigma in options.sigmas]
        for model in options.models:
            for diameter in options.diameters:
                cells = []
                for ground in grounds:
                    places = np.random.default_rng(5).uniform([2, 17], [4, 23], (options.blocks, 2))
                    centre = placed_on(ground, places, np.full(options.blocks, diameter))
                    way = np.array([np.cos(np.radians(30)), 0.0, -np.sin(np.radians(30))])
                    releases = make_releases(centre, velocity=np.tile(way, (options.blocks, 1)), diameter_m=diameter)
                    settings = Settings(MODELS[model], rolling=options.law, friction=options.friction[0], seed=1)
                    run = simulate(ground, releases, settings, record="ends", threads=1)
                    out = np.hypot(*(run.position - releases.position)[:, :2].T)
                    cells.append(f"{out.mean():>8.1f} ({run.impacts.mean():>3.1f})")
                print(
                    f"{model:<10}{diameter:>8.2f}m{spacing:>8.2f}m" + "".join(f"{one:>14}" for one in cells), flush=True
                )


# ------------------------------------------------------------------------------------------------------------- tiles

TILES = {
    "demo": (0.12, 0.50, 2.0, 0.45),
    "chablais": (0.35, 0.70, 5.0, 0.35),
    "lareunion": (0.25, 0.65, 3.0, 0.45),
    "tschamut": (0.33, 0.53, 2.0, 0.45),
}
"""Where blocks start and are measured, as parts of the way down the tile; their speed [m/s]; friction."""
LOWEST_M = 2.0
"""A scan whose ground is not classified: the lowest point of each cell of this side."""


def cloud_of(name: str) -> np.ndarray:
    """(n, 3) points of a tile, from 0; ground points where they are classified."""
    import laspy

    files = {"chablais": "las_chablais3.laz", "lareunion": "sample_lareunion_epsg2975.laz"}
    if name == "demo":
        surface = read_terrain(ROOT / "assets" / "demo" / "terrain.ply")
        points = surface.vertices
    elif name == "tschamut":
        points = read_terrain(ROOT / "tests" / "data" / "tschamut_2014_terrain.asc").vertices
    else:
        with laspy.open(ROOT / "tests" / "data" / files[name]) as opened:
            las = opened.read()
        points = np.asarray(las.xyz)
        if name == "chablais":
            points = points[np.asarray(las.classification) == 2]
        else:  # not classified
            cell = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / LOWEST_M).astype(int)
            order = np.lexsort((points[:, 2], cell[:, 1], cell[:, 0]))
            _, lowest = np.unique(cell[order], axis=0, return_index=True)
            points = points[order][lowest]
    return points - points.min(axis=0)


def tile(name: str, spacing: float, smooth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y and heights [y, x] of a grid: means of the heights, by triangles between the points, over each node's cell.

    smooth : standard deviation in metres of a filter before, 0 for none: then the surface is the same for all spacings.
    """
    from scipy.interpolate import LinearNDInterpolator
    from scipy.ndimage import gaussian_filter

    points, fine = cloud_of(name), 0.05
    size = np.floor(points[:, :2].max(axis=0) / fine).astype(int)
    x, y = np.arange(size[0]) * fine, np.arange(size[1]) * fine
    z = LinearNDInterpolator(points[:, :2], points[:, 2])(*np.meshgrid(x, y))
    known = np.isfinite(z)
    sigma = smooth / fine if smooth else (0.5 * spacing / fine / np.sqrt(3) if spacing > fine else 0.0)
    if sigma:
        weight = gaussian_filter(known.astype(float), sigma)
        z = np.where(known, gaussian_filter(np.where(known, z, 0.0), sigma) / np.maximum(weight, 1e-9), np.nan)
    step = round(spacing / fine)
    return x[::step], y[::step], z[::step, ::step]


def tiles(options: argparse.Namespace) -> None:
    for name in options.tiles:
        release, measured, speed, mu = TILES[name]
        mu = options.friction[0] if options.friction else mu
        print(f"\n{name}, {options.blocks} blocks that start with {speed:g} m/s, mu {mu:g}"
              + (f", smoothed over {options.smooth:g} m" if options.smooth else ", cells as they come"))  # fmt: skip
        print(f"{'model':<10}{'diameter':>9}{'grid':>7}{'run-out':>14}{'impacts':>9}{'reach':>7}{'v mean':>8}", end="")
        print(f"{'v 95%':>8}{'E mean':>9}{'E 95%':>9}{'left':>6}")
        grounds = {}
        for spacing in options.spacings:
            x, y, z = tile(name, spacing, options.smooth)
            grounds[spacing] = (make_ground(grid(x, y, z)), x, y, z)
        ground, x, y, z = grounds[min(options.spacings)]
        # Downhill in plan by a plane through the finest grid: release at the upper fifth, screen at two thirds.
        xx, yy = np.meshgrid(x, y)
        on = np.isfinite(z)
        plane = np.linalg.lstsq(np.column_stack([xx[on], yy[on], np.ones(on.sum())]), z[on], rcond=None)[0]
        down = -plane[:2] / np.hypot(*plane[:2])
        along = np.column_stack([xx[on], yy[on]]) @ down
        low, high = np.quantile(along, [0.02, 0.98])
        middle = np.array([xx[on].mean(), yy[on].mean()])
        across = np.array([-down[1], down[0]])
        rng = np.random.default_rng(3)
        span = high - low
        top = middle + down * (low + release * span - middle @ down)
        places = (
            top
            + rng.uniform(-0.15, 0.15, (options.blocks, 1)) * span * across
            + rng.uniform(0, 0.05, (options.blocks, 1)) * span * down
        )
        here = middle + down * (low + measured * span - middle @ down)
        screen = Screen("screen", np.array([here - 0.6 * span * across, here + 0.6 * span * across]))
        for model in options.models:
            for diameter in options.diameters:
                for spacing in options.spacings:
                    ground = grounds[spacing][0]
                    centre = placed_on(ground, places, np.full(len(places), diameter))
                    good = np.isfinite(centre).all(axis=1)
                    releases = make_releases(
                        centre[good], velocity=np.tile([*(speed * down), 0.0], (good.sum(), 1)), diameter_m=diameter
                    )
                    settings = Settings(MODELS[model], rolling=options.law, friction=mu, seed=1)
                    run = simulate(ground, releases, settings, threads=1)
                    way = np.hypot(*(run.position - releases.position)[:, :2].T)
                    at = blocks_at(hits_at(run, [screen]))
                    v, energy = (at.speed_mps, at.energy_j / 1000) if len(at) else (np.full(1, np.nan),) * 2
                    left = (run.end == ENDS.index("left_terrain")).mean()
                    print(
                        f"{model:<10}{diameter:>8.2f}m{spacing:>6.2f}m{way.mean():>7.1f} ±{_error(way):>4.1f}", end=""
                    )
                    print(f"{run.impacts.mean():>9.1f}{len(at) / len(run):>7.2f}{v.mean():>8.2f}", end="")
                    print(f"{np.quantile(v, 0.95):>8.2f}{energy.mean():>9.3g}{np.quantile(energy, 0.95):>9.3g}", end="")
                    print(f"{left:>6.2f}", flush=True)


# -------------------------------------------------------------------------------------------------------- thresholds

CHILD = """
import sys
sys.argv = sys.argv[1:]
name, value = sys.argv.pop(1), float(sys.argv.pop(1))
import rockfall.core.simulation as package, importlib, pkgutil
modules = [importlib.import_module(f"{package.__name__}.{one.name}") for one in pkgutil.iter_modules(package.__path__)]
if name != "none":
    there = [module for module in modules if hasattr(module, name)]
    if not there:
        raise SystemExit(f"no constant {name}")
    for module in there:
        setattr(module, name, type(getattr(module, name))(value))
sys.path.insert(0, sys.argv[0])
import ground_phase
ground_phase.meshes(ground_phase.parser().parse_args(sys.argv[1:]))
"""
"""Kernels take constants in when they are compiled: in a process of its own, before anything is."""


def constants() -> dict[str, float]:
    """The thresholds of the ground phase, whichever of them the kernels have."""
    import importlib
    import pkgutil

    import rockfall.core.simulation as package

    wanted = ("HOP", "STEP", "FALL", "LEAST_STEP", "FREE", "GENTLE", "SLIGHT", "DISTINCT", "OWN", "WIDE", "NOISY")
    found = {}
    for one in pkgutil.iter_modules(package.__path__):
        if one.name.endswith("_kernels") or one.name == "block_scale":
            module = importlib.import_module(f"{package.__name__}.{one.name}")
            found |= {name: getattr(module, name) for name in wanted if hasattr(module, name)}
    return found


def thresholds(options: argparse.Namespace) -> None:
    there = constants()
    names = options.only or list(there)
    more = ["meshes", "--blocks", str(options.blocks), "--spacings", *map(str, options.spacings)]
    more += ["--models", *options.models, "--diameters", *map(str, options.diameters)]
    for name, value in [("none", 0.0), *((name, factor * there[name]) for name in names for factor in (0.5, 2.0))]:
        print(f"\n{name} = {value:g}" + (f" (is {there[name]:g})" if name != "none" else ""), flush=True)
        command = [sys.executable, "-c", CHILD, str(Path(__file__).parent), name, repr(value), *more]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        print("\n".join(done.stdout.splitlines()[1:]) or done.stderr[-500:], flush=True)


def parser() -> argparse.ArgumentParser:
    """All tables."""
    whole = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tables = whole.add_subparsers(required=True)

    def table(name: str, work: object) -> argparse.ArgumentParser:
        one = tables.add_parser(name)
        one.set_defaults(work=work)
        return one

    number = {"type": float, "nargs": "+"}
    one = table("kinks", kinks)
    one.add_argument("--angles", **number, default=[5, 10, 15, 20, 25, 29, 30, 31, 35, 40, 45, 60])
    one.add_argument("--friction", **number, default=[0.1, 0.45])
    one.add_argument("--laws", nargs="+", default=["azzoni_1995", "coulomb"])
    one.add_argument("--models", nargs="+", choices=list(MODELS), default=["azimi"])
    one.add_argument("--own", action="store_true", help="azimi with its own R_N and R_T, not 0 and 1")
    one.add_argument("--diameter", type=float, default=DIAMETER_M)
    for name, work, ratios, mu in (
        ("fillets", fillets, [0.25, 0.5, 0.9, 1.05, 1.2, 1.4, 1.67, 2, 5, 10], [0.3]),
        ("crests", crests, [0.25, 1, 2, 5, 10], [0.3]),
    ):
        one = table(name, work)
        one.add_argument("--ratios", **number, default=ratios, help="R/r")
        one.add_argument("--edges", type=int, nargs="+", default=[0, 1, 2, 4, 8, 16, 32][name == "crests" :])
        one.add_argument("--friction", **number, default=mu)
        one.add_argument("--laws", nargs="+", default=["azzoni_1995"])
        one.add_argument("--diameter", type=float, default=DIAMETER_M)
    one.add_argument("--speeds", **number, default=[0.5, 0.8, 0.95, 1.05, 1.5], help="s")
    one = table("meshes", meshes)
    one.add_argument("--spacings", **number, default=[0.1, 0.25, 0.5, 1.0, 2.0])
    one.add_argument("--models", nargs="+", choices=list(MODELS), default=["azimi", "noel"])
    one.add_argument("--diameters", **number, default=[0.3, 1.0])
    one.add_argument("--blocks", type=int, default=300)
    one.add_argument("--friction", **number, default=[0.45])
    one.add_argument("--law", default="azzoni_1995")
    one.add_argument("--roughness", type=float, default=0.005, help="amplitude as a part of the wave length")
    one.add_argument("--surface", type=int, default=1, help="seed of the surface")
    one = table("noise", noise)
    one.add_argument("--spacings", **number, default=[0.05, 0.1, 0.2, 0.5])
    one.add_argument("--sigmas", **number, default=[0.0, 0.002, 0.005, 0.01], help="[m]")
    one.add_argument("--models", nargs="+", choices=list(MODELS), default=["azimi", "noel"])
    one.add_argument("--diameters", **number, default=[0.3, 1.0])
    one.add_argument("--blocks", type=int, default=20)
    one.add_argument("--friction", **number, default=[0.35])
    one.add_argument("--law", default="azzoni_1995")
    one.add_argument("--surface", type=int, default=1, help="seed of the noise")
    one = table("tiles", tiles)
    one.add_argument("--tiles", nargs="+", choices=list(TILES), default=list(TILES))
    one.add_argument("--spacings", **number, default=[0.1, 0.25, 0.5, 1.0], help="multiples of 0.05 m")
    one.add_argument("--models", nargs="+", choices=list(MODELS), default=["azimi", "noel"])
    one.add_argument("--diameters", **number, default=[0.3, 1.0])
    one.add_argument("--blocks", type=int, default=200)
    one.add_argument("--friction", **number, default=[], help="for all tiles")
    one.add_argument("--law", default="azzoni_1995")
    one.add_argument("--smooth", type=float, default=0.0)
    one = table("thresholds", thresholds)
    one.add_argument("--only", nargs="+")
    one.add_argument("--blocks", type=int, default=100)
    one.add_argument("--spacings", **number, default=[0.25, 1.0])
    one.add_argument("--models", nargs="+", choices=list(MODELS), default=["noel"])
    one.add_argument("--diameters", **number, default=[0.3])
    return whole


def main() -> None:
    """Print one table."""
    options = parser().parse_args()
    options.work(options)


if __name__ == "__main__":
    main()
