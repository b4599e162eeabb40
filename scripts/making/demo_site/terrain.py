# SPDX-License-Identifier: GPL-3.0-or-later
"""The synthetic gully: a height field that a few geomorphic processes have worked on, as a triangle mesh.

Local frame: x runs down the gully, y across it (to the left when looking down), z is up, all in metres; the crest is at
x = 0. The main channel follows a prescribed profile (53°, 40°, 16°) and meanders slightly; its flanks are carved by a
stream-power law (Braun & Willett 2013, implicit scheme, n = 1), beds of harder rock stand out as ledges, a debris fan
with boulders covers the exit.
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

Array = NDArray[np.float64]

ORIGIN_M = (988_412.0, 6_375_655.0, 1_512.0)
CRS = "EPSG:2154"
DOWNHILL_DEG = 232.0
"""Where the synthetic site is put: survey coordinates of the fan's apex, and the way down, from east counter-clockwise.
The place is plausible for the gully that inspired it, but no real terrain looks like this."""

SLOPES_DEG = (53.0, 40.0, 16.0)
DROPS_M = (42.1, 59.9, 10.2)
"""Height of each of the three parts along the channel [m]; flanks above the crest make up the 116 m of the site."""

HALF_WIDTH_M = 43.0
ROWS, COLUMNS = 640, 236
TIE_M = 1e-9
"""Differences of height below this are none."""
GRID_M, FINE_M = 0.5, 0.2


@dataclass(frozen=True)
class Profile:
    """The channel's long profile: nodes of a polyline, corners rounded over a few metres."""

    x: Array
    z: Array
    arc: Array

    @property
    def apex_m(self) -> float:
        """x where the fan begins."""
        return float(
            sum(drop / np.tan(np.radians(slope)) for drop, slope in zip(DROPS_M[:2], SLOPES_DEG[:2], strict=True))
        )

    @property
    def length_m(self) -> float:
        return float(self.x[-1])


def profile() -> Profile:
    """The prescribed long profile at 5 cm."""
    lengths = [drop / np.tan(np.radians(slope)) for drop, slope in zip(DROPS_M, SLOPES_DEG, strict=True)]
    x = np.arange(0.0, sum(lengths) + 0.05, 0.05)
    part = np.searchsorted(np.cumsum(lengths)[:-1], x, side="right")
    gradient = gaussian_filter(np.tan(np.radians(SLOPES_DEG))[part], 1.2 / 0.05, mode="nearest")
    z = sum(DROPS_M) - np.concatenate([[0.0], np.cumsum((gradient[1:] + gradient[:-1]) / 2 * 0.05)])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(z)))])
    return Profile(x, z, arc)


def axis_y(x: Array, apex: float) -> Array:
    """The meandering channel's y [m] at x."""
    quiet = np.clip(x / 12.0, 0.0, 1.0)
    return quiet * (2.6 * np.sin(x / 17.0 + 0.4) + 0.5 * np.sin(x / 6.1 + 2.0) * np.clip((apex - x) / 20.0, 0.25, 1.0))


def fractal(
    rng: np.random.Generator, shape: tuple[int, int], step: float, wavelengths: tuple[float, float], hurst: float
) -> Array:
    """Isotropic fractal noise of unit standard deviation between two wavelengths [m] (spectral synthesis)."""
    spectrum = np.fft.rfft2(rng.standard_normal(shape))
    k = np.hypot(np.fft.fftfreq(shape[0], step)[:, None], np.fft.rfftfreq(shape[1], step)[None, :])
    k[0, 0] = np.inf
    band = (k >= 1.0 / wavelengths[1]) & (k <= 1.0 / wavelengths[0])
    noise = np.fft.irfft2(spectrum * np.where(band, k ** -(hurst + 1.0), 0.0), shape)
    return noise / noise.std()


@njit(cache=True)
def _drain(z, step):
    """Steepest-descent receiver of each cell, and the distance to it; a cell without one is its own receiver."""
    rows, columns = z.shape
    receiver = np.arange(rows * columns)
    distance = np.full(rows * columns, step)
    for i in range(rows):
        for j in range(columns):
            best = 0.0
            for a in range(-1, 2):
                for b in range(-1, 2):
                    m, n = i + a, j + b
                    if (a == 0 and b == 0) or m < 0 or n < 0 or m >= rows or n >= columns:
                        continue
                    length = step * np.sqrt(float(a * a + b * b))
                    slope = (z[i, j] - z[m, n]) / length
                    if slope > best:
                        best = slope
                        receiver[i * columns + j] = m * columns + n
                        distance[i * columns + j] = length
    return receiver, distance


@njit(cache=True)
def _carve(z, order, receiver, distance, pinned, erodibility, floor, cell_area, steepest):
    """One implicit step of the stream-power law, channel cells pinned, slopes limited to the rock's strength."""
    area = np.full(z.size, cell_area)
    for position in range(order.size - 1, -1, -1):
        cell = order[position]
        if receiver[cell] != cell:
            area[receiver[cell]] += area[cell]
    for cell in order:
        if pinned[cell] or receiver[cell] == cell:
            continue
        base = z[receiver[cell]]
        factor = erodibility[cell] * np.sqrt(area[cell]) / distance[cell]
        z[cell] = (z[cell] + factor * base) / (1.0 + factor)
        z[cell] = max(min(z[cell], base + steepest[cell] * distance[cell]), floor[cell])


def bedrock(rng: np.random.Generator, line: Profile) -> tuple[Array, Array, Array]:
    """Heights of the eroded rock (rows, columns) on the coarse grid, with its x and y [m]; it runs on below the fan."""
    x = np.arange(-4.0, line.length_m + 4.0, GRID_M)
    y = np.arange(-HALF_WIDTH_M - 4.0, HALF_WIDTH_M + 4.0, GRID_M)
    shape = (x.size, y.size)
    trunk = np.interp(x, line.x, line.z)
    trunk[x < 0] -= x[x < 0] * 0.6
    buried = x > line.apex_m
    trunk[buried] = np.interp(line.apex_m, line.x, line.z) - (x[buried] - line.apex_m) * np.tan(np.radians(38.0))
    away = np.abs(y[None, :] - axis_y(x, line.apex_m)[:, None])
    away = np.maximum(away - np.interp(x, [0.0, line.apex_m], [1.2, 3.4])[:, None], 0.0)
    depth = np.interp(x, [0.0, 6.0, 25.0, 60.0, line.apex_m], [0.4, 3.0, 11.0, 17.0, 18.0])[:, None]
    walls = depth * np.tanh(1.05 * away**2 / (away + 2.5) / depth) + 0.06 * away
    z = trunk[:, None] + walls + 0.7 * fractal(rng, shape, GRID_M, (3.0, 40.0), 0.7) * np.clip(away / 6.0, 0.0, 1.0)
    # no gully beside the channel may cut deeper than it does, or the channel would run along a rib
    floor = np.minimum(0.8 * away**2 / (away + 1.5), 13.0 - 0.3 * away) * np.clip(
        1.0 + 0.35 * fractal(rng, shape, GRID_M, (5.0, 30.0), 0.7), 0.3, 1.7
    )
    floor = (trunk[:, None] + floor * np.clip(x / 12.0, 0.0, 1.0)[:, None]).ravel()
    pinned = (away == 0.0).ravel()
    soft = 0.010 * np.exp(0.6 * fractal(rng, shape, GRID_M, (1.5, 25.0), 0.3)).ravel()
    steepest = np.tan(
        np.radians(np.clip(64.0 + 5.0 * fractal(rng, shape, GRID_M, (4.0, 30.0), 0.5), 50.0, 76.0))
    ).ravel()
    for step in range(40):
        receiver, distance = _drain(z, GRID_M)
        _carve(
            z.ravel(),
            np.argsort(z.ravel(), kind="stable"),
            receiver,
            distance,
            pinned,
            soft,
            floor,
            GRID_M**2,
            steepest,
        )
        if step % 5 == 4:
            np.copyto(z, np.where(pinned.reshape(shape), z, gaussian_filter(z, 0.5, mode="nearest")))
    # scree softens the foot of the walls
    foot = np.clip(1.0 - (away - 0.3) / 2.2, 0.0, 1.0)
    return z + foot * (gaussian_filter(z, 1.7, mode="nearest") - z), x, y


def bedded(rng: np.random.Generator, x: Array, y: Array, z: Array, strength: Array, thinnest: float) -> Array:
    """Hard beds stand out: heights are compressed (ledges) and stretched (risers) along a gently dipping stack."""
    dipping = 0.22 * y + 0.10 * x
    stack = z + dipping + 0.5 * fractal(rng, z.shape, FINE_M, (2.0, 25.0), 0.8)
    low, high = stack.min() - 5.0, stack.max() + 5.0
    thickness = rng.uniform(thinnest, 2.9 * thinnest, int((high - low) / thinnest))
    base = low + np.concatenate([[0.0], np.cumsum(thickness)])
    soft = rng.uniform(0.62, 0.78, thickness.size)
    foot = base[:-1] + soft * thickness
    raised = base[:-1] + (soft - rng.uniform(0.18, 0.32, thickness.size)) * thickness
    nodes = np.column_stack([base[:-1], foot]).ravel()
    heights = np.column_stack([base[:-1], raised]).ravel()
    return z + strength * (np.interp(stack, nodes, heights) - stack)


@njit(cache=True)
def _filled(z, rise):
    """Closed hollows filled to their rim, as scree does, with a slight fall (priority flood, Barnes et al. 2014)."""
    rows, columns = z.shape
    done = np.zeros(z.shape, dtype=np.bool_)
    queue = [(0.0, 0, 0)]
    queue.pop()
    for i in range(rows):
        for j in range(columns):
            if i in (0, rows - 1) or j in (0, columns - 1):
                done[i, j] = True
                heapq.heappush(queue, (z[i, j], i, j))
    filled = z.copy()
    while queue:
        level, i, j = heapq.heappop(queue)
        for a in range(-1, 2):
            for b in range(-1, 2):
                m, n = i + a, j + b
                if 0 <= m < rows and 0 <= n < columns and not done[m, n]:
                    done[m, n] = True
                    filled[m, n] = max(filled[m, n], level + rise)
                    heapq.heappush(queue, (filled[m, n], m, n))
    return filled


def with_boulders(rng: np.random.Generator, x: Array, y: Array, z: Array, line: Profile) -> Array:
    """Angular boulders, each the upper side of a small convex polyhedron, on the fan and along the lower channel."""
    z = z.copy()
    for _ in range(420):
        along = line.apex_m - 22.0 + (line.length_m - line.apex_m + 22.0) * rng.beta(2.4, 1.5)
        spread = 1.5 + 0.62 * max(along - line.apex_m, 0.0)
        across = axis_y(np.array(along), line.apex_m) + spread * rng.standard_normal()
        radius = min(0.22 * rng.pareto(1.9) + 0.22, 1.5)
        tilts = np.radians(rng.uniform(8.0, 68.0, 9))
        turns = np.sort(rng.uniform(0.0, 2 * np.pi, 9))
        sizes = radius * rng.uniform(0.75, 1.1, 9)
        rows = slice(*np.searchsorted(x, [along - 2 * radius, along + 2 * radius]))
        columns = slice(*np.searchsorted(y, [across - 2 * radius, across + 2 * radius]))
        if not z[rows, columns].size:
            continue
        dx, dy = x[rows, None] - along, y[None, columns] - across
        foot = float(np.median(z[rows, columns])) - 0.25 * radius
        top = np.full(np.broadcast_shapes(dx.shape, dy.shape), np.inf)
        for tilt, turn, size in zip(tilts, turns, sizes, strict=True):
            top = np.minimum(top, (size - np.sin(tilt) * (np.cos(turn) * dx + np.sin(turn) * dy)) / np.cos(tilt))
        inside = np.hypot(dx, dy) < 1.25 * radius
        z[rows, columns] = np.where(inside, np.maximum(z[rows, columns], foot + top), z[rows, columns])
    return z


def heights(rng: np.random.Generator) -> tuple[Array, Array, Array, Profile]:
    """The finished height field on the fine grid, with its x and y [m]."""
    line = profile()
    rock, coarse_x, coarse_y = bedrock(rng, line)
    x = np.arange(coarse_x[0] + 2.0, coarse_x[-1] - 2.0, FINE_M)
    y = np.arange(coarse_y[0] + 2.0, coarse_y[-1] - 2.0, FINE_M)
    shape = (x.size, y.size)
    grid_x, grid_y = np.broadcast_to(x[:, None], shape), np.broadcast_to(y[None, :], shape)
    # the grid's own directions, which flow routing prefers, are hidden by bending the plan
    bend = [fractal(rng, shape, FINE_M, (2.5, 16.0), 1.0) * 0.55 for _ in range(2)]
    position = [(grid_x + bend[0] - coarse_x[0]) / GRID_M, (grid_y + bend[1] - coarse_y[0]) / GRID_M]
    z = map_coordinates(rock - np.interp(coarse_x, line.x, line.z)[:, None], position, order=3, mode="nearest")
    z += np.interp(grid_x, line.x, line.z)

    apex_y = float(axis_y(np.array(line.apex_m), line.apex_m))
    apex_z = float(np.interp(line.apex_m, line.x, line.z))
    away = np.hypot(grid_x - line.apex_m, 0.5 * (grid_y - apex_y))
    downstream = np.interp(np.clip(grid_x, line.apex_m, None), line.x, line.z)
    lobes = (
        0.35 * np.sin(9.0 * np.arctan2(grid_y - apex_y, grid_x - line.apex_m + 6.0)) * np.clip(away / 15.0, 0.0, 1.0)
    )
    cone = np.where(grid_x > line.apex_m, downstream, apex_z)
    cone = cone - (away - np.clip(grid_x - line.apex_m, 0.0, None)) * np.tan(np.radians(16.0)) + 0.35 * lobes
    cone = cone + 0.10 * fractal(rng, shape, FINE_M, (0.6, 9.0), 0.6)

    channel = np.abs(grid_y - axis_y(grid_x, line.apex_m)) / np.interp(grid_x, [0.0, line.apex_m], [1.8, 4.4])
    strength = np.clip(0.12 + 0.88 * (channel - 0.8), 0.12, 1.0)
    strength = strength * np.clip(0.75 + 0.35 * fractal(rng, shape, FINE_M, (6.0, 40.0), 0.8), 0.1, 1.1)
    rough = fractal(rng, shape, FINE_M, (0.5, 7.0), 0.75)
    creased = np.abs(fractal(rng, shape, FINE_M, (0.8, 9.0), 0.8))
    for thinnest in (1.6, 0.55):
        z = bedded(rng, x[:, None], y[None, :], z, strength, thinnest)
    z += (0.09 * rough - 0.22 * creased) * np.clip(channel - 0.2, 0.25, 1.0)
    z = _filled(np.maximum(z, cone), 0.02)
    z = with_boulders(rng, x, y, z, line)
    return z, x, y, line


@dataclass(frozen=True, eq=False)
class Terrain:
    """The mesh, in the gully's frame and in survey coordinates.

    Attributes
    ----------
    vertices : (ROWS · COLUMNS, 3) in the gully's frame [m], row by row.
    survey : the same in survey coordinates [m], to the millimetre; this is what the file holds.
    faces : (m, 3) counter-clockwise from above, two for each cell.
    rows_x, columns_y : where the rows and columns lie in plan [m].
    line : the channel's long profile.
    """

    vertices: Array
    survey: Array
    faces: NDArray[np.int32]
    rows_x: Array
    columns_y: Array
    line: Profile


def terrain(seed: int) -> Terrain:
    """The whole mesh; rows are spaced evenly along the slope, not in plan, and columns are denser near the channel."""
    z, x, y, line = heights(np.random.default_rng(seed))
    rows_x = np.interp(np.linspace(0.0, line.arc[-1], ROWS), line.arc, line.x)
    u = np.linspace(-1.0, 1.0, COLUMNS)
    columns_y = HALF_WIDTH_M * (0.68 * u + 0.32 * u**3)
    grid_x, grid_y = (grid.ravel() for grid in np.meshgrid(rows_x, columns_y, indexing="ij"))
    grid_z = map_coordinates(z, [(grid_x - x[0]) / FINE_M, (grid_y - y[0]) / FINE_M], order=1)
    survey = np.round(to_survey(np.column_stack([grid_x, grid_y, grid_z]), line), 3)
    return Terrain(to_local(survey, line), survey, _faces(grid_z), rows_x, columns_y, line)


def _faces(grid_z: Array) -> NDArray[np.int32]:
    corner = (np.arange(ROWS - 1)[:, None] * COLUMNS + np.arange(COLUMNS - 1)[None, :]).ravel()
    right, below, across = corner + 1, corner + COLUMNS, corner + COLUMNS + 1
    # The diagonal with the smaller step keeps ridges and creases sharp. Both steps are equal where hollows were filled:
    # there the last bit, which differs between processors, must not choose.
    steps = np.abs(grid_z[corner] - grid_z[across]), np.abs(grid_z[right] - grid_z[below])
    falling = (steps[0] < steps[1] - TIE_M)[:, None]
    first = np.where(falling, np.column_stack([corner, below, across]), np.column_stack([corner, below, right]))
    second = np.where(falling, np.column_stack([corner, across, right]), np.column_stack([right, below, across]))
    return np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int32)


def _frame(line: Profile) -> tuple[Array, Array]:
    """Rows down, left, up as survey directions (3, 3), and the survey coordinates of the gully frame's origin (3,)."""
    turn = np.radians(DOWNHILL_DEG)
    axes = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return axes, np.array(ORIGIN_M) - np.array([line.apex_m, 0.0, DROPS_M[2]]) @ axes


def to_survey(local: Array, line: Profile) -> Array:
    """Gully frame → survey coordinates, (..., 3) [m]."""
    axes, origin = _frame(line)
    return origin + local @ axes


def to_local(survey: Array, line: Profile) -> Array:
    """Survey coordinates → gully frame, (..., 3) [m]."""
    axes, origin = _frame(line)
    return (survey - origin) @ axes.T


def turned(vectors: Array, line: Profile) -> Array:
    """Directions of the gully frame in survey axes, (..., 3)."""
    return vectors @ _frame(line)[0]
