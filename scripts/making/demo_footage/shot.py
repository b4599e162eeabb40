# SPDX-License-Identifier: GPL-3.0-or-later
"""What is filmed and from where: the block's true motion and the hand-held camera's, by time on the video's clock.

Nothing here uses `rockfall.core`: this is the truth against which the reconstruction is measured. Positions are in the
project's local frame (survey coordinates minus the shift), z up, metres; pixels have their origin at the top-left
corner, v down.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from ..demo_site import blocks, campaign, terrain

Array = NDArray[np.float64]

BLOCK = "B10"
START_S = 9.2
"""Time since the block's release that video time 0 is."""

WIDTH, HEIGHT, FPS, FRAMES = 1280, 720, 30, 300
FOCAL_PX = 2100.0
SHUTTER_S = 1.0 / 100.0
EYE_GULLY = (140.0, 60.0, 60.0)
"""The opposite side of the valley, in the gully's frame."""

SHAKE_DEG = (0.30, 0.30, 0.20)
"""Root mean square of pitch, yaw and roll of the hand at 0.3-3 Hz; at 5-10 Hz it trembles by a twelfth of that."""

JITTER_DEG = 0.03
SWAY_M = 0.015
FOLLOWING = 0.32
"""Share of the block's way that the hand follows."""

SEED = 74


@dataclass(frozen=True, eq=False)
class Shot:
    """The block and the camera of one take.

    Attributes
    ----------
    run : the true fall in the gully's frame.
    start_s : its release on the campaign's common clock [s].
    impacts : all of its merged impacts while the camera runs.
    known : the numbers that `assets/demo/truth.csv` gives them, 0 for those it does not hold.
    """

    site: terrain.Terrain
    ground: blocks.Ground
    run: blocks.Run
    start_s: float
    diameters: Array
    impacts: tuple[blocks.Impact, ...]
    known: tuple[int, ...]
    shift: Array

    @property
    def radius(self) -> float:
        return self.run.radius

    @property
    def offset_s(self) -> float:
        """Common time at video time 0 [s]."""
        return self.start_s + START_S

    def local(self, gully: Array) -> Array:
        """Gully frame → project's local frame, (..., 3)."""
        return terrain.to_survey(gully, self.site.line) - self.shift

    def turned(self, gully: Array) -> Array:
        """Directions of the gully's frame in the local one, (..., 3)."""
        return terrain.turned(gully, self.site.line)


def shot(seed: int, shift: tuple[float, float, float]) -> Shot:
    """The take of the chosen block of a campaign."""
    field = campaign.Campaign(seed)
    seen = field.observed(int(BLOCK[1:]) - 1)
    end = START_S + (FRAMES - 1) / FPS
    impacts = tuple(
        one for one in blocks.merged(seen.run.impacts, campaign.MERGE_S) if one.time >= START_S and one.leave_time < end
    )
    numbers = {one.time: number for number, one in enumerate(seen.impacts, 1)}
    known = tuple(numbers.get(one.time, 0) for one in impacts)
    return Shot(
        field.terrain, field.ground, seen.run, seen.start_s, seen.diameters, impacts, known, np.array(shift, float)
    )


def block_centre(take: Shot, times_s: Array) -> Array:
    """The block's centre (n, 3) at video times [s]: parabolas between all contacts, then rolling to the stop."""
    return take.local(np.array([_centre(take, t + START_S) for t in times_s]))


def _centre(take: Shot, time: float) -> Array:
    contacts = take.run.impacts
    number = int(np.searchsorted([one.time for one in contacts], time, side="right")) - 1
    if number == len(contacts) - 1:
        return _rolling(take, time)
    if number < 0:
        start, velocity, place = 0.0, take.run.release_velocity, take.run.release_centre
    else:
        start, velocity, place = contacts[number].time, contacts[number].v2, contacts[number].centre
    t = max(time - start, 0.0)
    return place + velocity * t - np.array([0.0, 0.0, 0.5 * blocks.GRAVITY_MPS2 * t**2])


def _rolling(take: Shot, time: float) -> Array:
    """From the last contact to the stop: evenly slowed down in plan, the sphere resting on the mesh."""
    (first, _, _), *_, (last, stop, _) = take.run.rolling
    start = take.run.impacts[-1].centre
    share = np.clip((time - first) / (last - first), 0.0, 1.0)
    way = share * (2.0 - share)
    centre = start + way * (stop - start)
    if way == 0.0:
        return start
    low, high = centre[2] - 1.0, centre[2] + 1.0
    while high - low > 1e-6:
        middle = (low + high) / 2.0
        point = np.array([centre[0], centre[1], middle])
        above = middle - take.ground.height(centre[0], centre[1])
        free = above > 0.0 and take.ground.closest(point, take.radius + 0.5)[0] >= take.radius
        low, high = (low, middle) if free else (middle, high)
    return np.array([centre[0], centre[1], high])


def block_turns(take: Shot, times_s: Array) -> Rotation:
    """The block's orientation (n): its spin is constant between contacts, and it rolls at the end."""
    contacts = take.run.impacts
    step = 1.0 / 600.0
    fine = np.arange(times_s[0], times_s[-1] + step, step)
    instants = [one.time for one in contacts]
    place = block_centre(take, fine)
    turns = [Rotation.identity()]
    for t, before, after in zip(fine[:-1], place[:-1], place[1:], strict=True):
        number = int(np.searchsorted(instants, t + START_S, side="right")) - 1
        if number == len(contacts) - 1:
            turn = np.cross([0.0, 0.0, 1.0], after - before) / take.radius
        else:
            turn = take.turned(contacts[number].omega2) * step if number >= 0 else np.zeros(3)
        turns.append(Rotation.from_rotvec(turn) * turns[-1])
    return Rotation.concatenate(turns)[np.clip(np.rint((times_s - fine[0]) / step).astype(int), 0, len(fine) - 1)]


def camera_path(take: Shot, times_s: Array) -> tuple[Array, Array]:
    """Positions (n, 3) and rotations world → camera (n, 3, 3) of the hand-held camera (x right, y down, z forward)."""
    rng = np.random.default_rng(SEED)
    eye = take.local(np.array(EYE_GULLY))
    hand = [_wobble(rng, times_s, 0.3, 3.0, np.radians(rms)) for rms in SHAKE_DEG]
    tremble = [_wobble(rng, times_s, 5.0, 10.0, np.radians(JITTER_DEG)) for _ in range(3)]
    angles = np.column_stack(hand) + np.column_stack(tremble)
    sway = np.column_stack([_wobble(rng, times_s, 0.2, 1.2, SWAY_M) for _ in range(3)])
    aim = _aim(take, times_s)
    looking = np.stack([_look(point - eye) for point in aim])
    return eye + sway, Rotation.from_rotvec(angles).as_matrix() @ looking


def _aim(take: Shot, times_s: Array) -> Array:
    """Where the hand points: the middle of the run, drawn a little and late towards the block."""
    fine = np.arange(-3.0, FRAMES / FPS + 3.0, 1.0 / FPS)
    visible = np.clip(fine, 1.5, FRAMES / FPS)
    path = block_centre(take, visible)
    middle = (path.min(axis=0) + path.max(axis=0)) / 2.0
    slow = gaussian_filter1d(path, 0.7 * FPS, axis=0, mode="nearest")
    aim = middle + FOLLOWING * (slow - middle)
    return np.column_stack([np.interp(times_s - 0.25, fine, aim[:, axis]) for axis in range(3)])


def _look(forward: Array) -> Array:
    z = forward / np.linalg.norm(forward)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _wobble(rng: np.random.Generator, times_s: Array, low_hz: float, high_hz: float, rms: float) -> Array:
    """Smooth noise in a band: waves whose amplitude falls with their frequency, as that of a hand."""
    hz = np.exp(rng.uniform(np.log(low_hz), np.log(high_hz), 24))
    phase = rng.uniform(0.0, 2.0 * np.pi, 24)
    size = hz**-0.5
    waves = np.sin(2.0 * np.pi * np.outer(times_s, hz) + phase) @ size
    return rms * waves / np.sqrt((size**2).sum() / 2.0)


def projected(points: Array, position: Array, rotation: Array) -> Array:
    """Pixels (n, 2) of points (n, 3) in pinhole cameras; one pose, or one for each point."""
    seen = np.einsum("...ij,...j->...i", rotation, points - position)
    return FOCAL_PX * seen[..., :2] / seen[..., 2:] + np.array([WIDTH / 2.0, HEIGHT / 2.0])


def frame_times() -> Array:
    """The instants of the frames (FRAMES,) [s]: the middle of each exposure."""
    return np.arange(FRAMES) / FPS
