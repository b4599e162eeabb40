# SPDX-License-Identifier: GPL-3.0-or-later
"""Balls that spin, as in table tennis, in two noisy views: the deviations of velocities contain the lift.

The truth is integrated in small steps with drag and Magnus' force; the fit knows of the drag alone, or of neither.
"""

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.footage.clock import Clock
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.refine import PixelObservations, View, refine
from rockfall.core.terrain.surface import Surface

RADIUS_M, MASS_KG, AIR_KGPM3, DRAG, LIFT = 0.02, 0.0027, 1.2, 0.42, 0.3
"""A ball of table tennis; a lift of 0.3 is that of one whose surface turns about as fast as it flies."""
BALL = Block(2 * RADIUS_M, 2 * RADIUS_M, 2 * RADIUS_M, density=MASS_KG / (4 / 3 * np.pi * RADIUS_M**3))
TABLE = Surface(
    np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
    GlobalShift(),
    "table",
)
STEP_S, RATE_HZ, BOUNCES = 2e-3, 30.0, 5
COVARIANCE = np.diag([1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3]) ** 2


def flight(place, velocity, spin):
    """Places and velocities at steps until the ball is a radius above the table again; the last one interpolated."""
    per_m = AIR_KGPM3 * np.pi * RADIUS_M**2 / (2 * MASS_KG)

    def push(velocity):
        pace = np.linalg.norm(velocity)
        return per_m * pace * (LIFT * np.cross(spin, velocity) - DRAG * velocity) - [0, 0, 9.81]

    places, velocities = [place], [velocity]
    while len(places) < 3 or places[-1][2] > RADIUS_M:
        middle = velocities[-1] + STEP_S / 2 * push(velocities[-1])
        places.append(places[-1] + STEP_S * middle)
        velocities.append(velocities[-1] + STEP_S * push(middle))
    part = (places[-2][2] - RADIUS_M) / (places[-2][2] - places[-1][2])
    for rows in (places, velocities):
        rows[-1] = rows[-2] + part * (rows[-1] - rows[-2])
    return np.array(places), np.array(velocities), (len(places) - 2 + part) * STEP_S


def played(rng):
    """Times and places of bounces, the velocities after and before them, and where the ball is at any time."""
    place, velocity = np.array([-2.0, 0.0, RADIUS_M]), np.array([rng.uniform(2, 4), rng.normal() * 0.3, 3.0])
    times, bounces, after, before, pieces = [0.0], [place], [], [], []
    for _ in range(BOUNCES - 1):
        spin = np.array([0.3, 1.0, 0.3]) * rng.uniform(-1, 1, 3)  # about the axis of top spin, for the most part
        places, velocities, whole = flight(place, velocity, spin)
        steps = times[-1] + np.append(np.arange(len(places) - 1) * STEP_S, whole)
        pieces.append((steps, places))
        after.append(velocity)
        before.append(velocities[-1])
        place = places[-1]
        velocity = velocities[-1] * [0.8, 0.8, 0] + [0.3 * rng.normal(), 0.2 * rng.normal(), rng.uniform(2.0, 3.2)]
        times.append(times[-1] + whole)
        bounces.append(place)
    return np.array(times), np.array(bounces), np.array(after), np.array(before), pieces


def seen(pieces, time):
    which = np.clip(np.searchsorted([steps[0] for steps, _ in pieces], time, side="right") - 1, 0, len(pieces) - 1)
    result = np.empty((time.size, 3))
    for i, (steps, places) in enumerate(pieces):
        for axis in range(3):
            result[which == i, axis] = np.interp(time[which == i], steps, places[:, axis])
    return result


def coverage(seed, sigma_px, *, told):
    """Relative errors of speeds after and before bounces, whether they are in their intervals, and the warnings."""
    rng = np.random.default_rng(seed)
    times, bounces, after, before, pieces = played(rng)
    middle = bounces.mean(axis=0) + np.array([0, 0, 0.2])
    views, rows = [], []
    for number, away in enumerate(([0.6, -4.2, 1.6], [1.0, 4.4, 1.5])):
        camera = look_at(1280, 720, middle + away, middle, focal_px=1250.0)
        common = np.arange(0.002 + 0.013 * number, times[-1], 1 / RATE_HZ)
        pixel = project(camera, seen(pieces, common)) + sigma_px * rng.normal(size=(common.size, 2))
        inside = ((pixel > 0) & (pixel < camera.size)).all(axis=1)
        rows.append((np.full(inside.sum(), number), common[inside], pixel[inside]))
        views.append(View(f"camera {number + 1}", fixed(camera), Clock(), pose_covariance=COVARIANCE))
    index, video_s, pixel = (np.concatenate(column) for column in zip(*rows, strict=True))
    pixels = PixelObservations(index, np.full(index.size, "a"), video_s, pixel, np.full(index.size, sigma_px))
    marked = np.round(times * RATE_HZ) / RATE_HZ
    place = bounces * [1, 1, 0] + 0.03 * rng.normal(size=bounces.shape) * [1, 1, 0]
    picks = make_picks(["a"] * BOUNCES, marked, place, sigma_time_s=np.full(BOUNCES, 0.012))
    known = Drag(air_density=AIR_KGPM3, coefficient=DRAG) if told else None
    result = refine(picks, views, pixels, surface=TABLE, block=BALL, drag=known, sigma_terrain_m=0.003, sigma_aim=0.05)
    impacts, error, hits = result.reconstruction.impacts, [], []
    for name, energy, true, own in (
        ("v2", "kinetic2_j", after, slice(-1)),
        ("v1", "kinetic1_j", before, slice(1, None)),
    ):
        speed = np.linalg.norm(true, axis=1)
        found = np.linalg.norm(getattr(impacts, name)[own], axis=1)
        sigma = impacts.sigma[energy][own] / (impacts.mass_kg[own] * found)
        error.append(np.abs(found / speed - 1))
        hits.append(np.abs(found - speed) < 1.96 * sigma)
    return np.array(error), np.array(hits), [one.text for one in result.remarks if one.severity == "warning"]


@pytest.mark.parametrize("sigma_px", [1.0, 4.0, 8.0])
def test_speeds_of_balls_that_spin_are_in_their_intervals(sigma_px):
    """Where the pixels ask for the lift, and where they are too noisy to."""
    tried = [coverage(seed, sigma_px, told=True) for seed in range(16)]
    assert np.mean([hits for _, hits, _ in tried]) > 0.9
    asked = np.mean([any("further acceleration" in text for text in said) for _, _, said in tried])
    assert asked > 0.8 if sigma_px == 1.0 else asked < 0.5


def test_drag_that_was_left_out_is_named_with_its_coefficient():
    tried = [coverage(seed, 2.0, told=False) for seed in range(12)]
    found = [text for _, _, said in tried for text in said if "coefficient of drag" in text]
    assert len(found) >= 10
    values = [float(text.split("coefficient of drag of ")[1].split(" ")[0]) for text in found]
    assert np.median(values) == pytest.approx(DRAG, rel=0.25)
    assert np.mean([hits for _, hits, _ in tried]) > 0.8
