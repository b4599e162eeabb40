# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin from marks in a video: a block that is turned by SciPy, seen by a known camera."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.errors import InputError
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.views import View
from rockfall.core.reconstruction.spin_marks import MarkedVideo, SpinMarks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.workflow.spins import measure_spins, with_spins
from scipy.spatial.transform import Rotation

RADIUS = 0.195
BLOCK = Block(2 * RADIUS, 2 * RADIUS, 2 * RADIUS)
UP = np.array([0.0, 0.0, 1.0])
START, SPEED = np.array([0.0, 0.0, 2.0]), np.array([8.0, 0.0, 4.0])
FORWARDS = np.array([0.0, 1.0, 0.0])
"""A block that rolls along +x turns about +y."""
SIDE = look_at(1920, 1080, [3.2, -9.0, 2.5], [3.2, 0.0, 2.5], focal_px=1600)
FRONT = look_at(1920, 1080, [14.0, -2.5, 2.0], [3.0, 0.0, 2.5], focal_px=3000)


def centre(time):
    return START + SPEED * np.asarray(time)[:, None] - 0.5 * 9.81 * UP * np.asarray(time)[:, None] ** 2


def flight(sigma_m=None):
    """One flight of 0.8 s between two impacts, reconstructed."""
    ends = centre([0.0, 0.8]) - RADIUS * UP
    sigma = None if sigma_m is None else [sigma_m, sigma_m]
    picks = make_picks(["B"] * 2, [0.0, 0.8], ends, normal=[UP, UP], sigma_position_m=sigma)
    return reconstruct(picks, block=BLOCK, flights="centres")


def seen(camera, time, omega, start, *, stretch=1.0, off=0.0):
    """Pixels of a point of the block that turns with an angular velocity (3,) [rad/s]."""
    turned = Rotation.from_rotvec(np.outer(time, omega)).apply(start)
    return project(camera, centre(time) + off + RADIUS * stretch * turned)


def video(camera, time, pixel, *, axis="rolling", about=np.nan, sigma_px=1.0):
    n = len(time)
    marks = SpinMarks(
        np.full(n, "B"),
        np.round(30 * np.asarray(time)).astype(int),
        np.asarray(time),
        pixel,
        np.full(n, sigma_px),
        np.full(n, axis),
        np.full(n, about),
    )
    return MarkedVideo(View("side", fixed(camera)), marks)


def towards(camera, time=0.0, up=0.5):
    """A direction from the centre that the camera sees, off its line of sight."""
    way = camera.position - centre([time])[0]
    way = way / np.linalg.norm(way)
    off = np.cross(way, UP)
    mixed = 0.6 * way + up * UP + 0.3 * off
    return mixed / np.linalg.norm(mixed)


@pytest.mark.parametrize(
    ("camera", "start", "axis"), [(SIDE, 0.3, "rolling"), (SIDE, 0.3, "sight"), (FRONT, 0.7, "rolling")]
)
def test_a_block_that_rolls_forwards(camera, start, axis):
    """Four turns a second, in pictures of 1/30 s: about the line of sight the perspective turns with the block."""
    time = 0.4 + np.arange(4) / 30
    omega = 8 * np.pi * FORWARDS
    point = Rotation.from_rotvec(-0.4 * omega).apply(towards(camera, 0.4, start))
    (spin,) = measure_spins(flight(), [video(camera, time, seen(camera, time, omega, point), axis=axis)]).flights
    assert spin.verdict == "measured"
    assert spin.turns_per_s == pytest.approx(4.0, abs=0.3 if axis == "sight" else 1e-6)
    assert (spin.flight, spin.last_pick, spin.others) == (1, 1, ())
    inertia = 0.4 * BLOCK.mass_kg * RADIUS**2
    assert spin.energy_j == pytest.approx(0.5 * inertia * spin.spin.rate**2)
    assert spin.sigma_energy_j == pytest.approx(2 * spin.energy_j * spin.spin.sigma_rate / spin.spin.rate)
    np.testing.assert_allclose(with_spins(flight().picks, measure_spins(flight(), [])).angular_velocity, np.nan)
    given = with_spins(flight().picks, measure_spins(flight(), [video(camera, time, seen(camera, time, omega, point))]))
    np.testing.assert_allclose(given.angular_velocity[1], omega, atol=1e-4)


def test_the_stated_error_covers_the_truth():
    """Clicks, the centre, the point's distance and the axis are off as stated: two thirds lie within one sigma."""
    rng = np.random.default_rng(5)
    made, time = flight(sigma_m=0.02), np.array([0.30, 0.36, 0.42])
    away = []
    for _ in range(250):
        rate = rng.uniform(2, 5)
        tilt = np.radians(15) * rng.normal(size=2)
        across = Rotation.from_rotvec([tilt[0], 0.0, tilt[1]])
        omega = 2 * np.pi * rate * across.apply(FORWARDS)
        point = Rotation.from_rotvec(-0.36 * omega).apply(towards(SIDE, 0.36, rng.uniform(0.4, 0.9)))
        clean = seen(SIDE, time, omega, point, stretch=1 + 0.15 * rng.normal(), off=0.02 * rng.normal(size=3))
        pixel = clean + 1.5 * rng.normal(size=clean.shape)
        (spin,) = measure_spins(made, [video(SIDE, time, pixel, sigma_px=1.5)]).flights
        if spin.verdict == "measured":
            away.append((spin.turns_per_s - rate) / spin.sigma_turns_per_s)
    away = np.abs(away)
    print((away < 1).mean(), (away < 2).mean(), (away < 3).mean(), len(away), away.max())
    assert len(away) > 200
    assert 0.58 < (away < 1).mean() < 0.85
    assert (away < 2).mean() > 0.9


def test_what_the_frame_rate_cannot_tell():
    """Marks 0.1 s apart: 7.3 turns/s look like −2.7; a rate that was counted by eye decides."""
    time, omega = np.array([0.3, 0.4]), 2 * np.pi * 7.3 * FORWARDS
    point = Rotation.from_rotvec(-0.35 * omega).apply(towards(SIDE, 0.35))
    pixel = seen(SIDE, time, omega, point)
    (spin,) = measure_spins(flight(), [video(SIDE, time, pixel)]).flights
    assert (spin.spin, spin.verdict) == (None, "ambiguous")
    np.testing.assert_allclose(spin.others, [-2.7, 7.3], atol=1e-6)
    assert np.isnan(spin.energy_j)
    (remark,) = spin.remarks
    assert "-2.7, 7.3 turns/s fit alike (rolling at 8.9 m/s would be 7.3)" in remark.text
    assert remark.severity == "warning"
    assert "Mark the point in pictures less than 0.046 s apart" in remark.text
    slow = video(SIDE, time, pixel)
    slow = replace(slow, marks=replace(slow.marks, frame=np.array([3, 4])))
    assert "Pictures 0.100 s apart cannot tell it" in measure_spins(flight(), [slow]).flights[0].remarks[0].text
    (spin,) = measure_spins(flight(), [video(SIDE, time, pixel, about=7.0)]).flights
    assert spin.verdict == "counted"
    assert spin.turns_per_s == pytest.approx(7.3, abs=1e-6)
    (spin,) = measure_spins(flight(), [video(SIDE, time, pixel, about=-3.0)]).flights
    assert spin.turns_per_s == pytest.approx(-2.7, abs=1e-6)


def test_a_block_that_may_stand_still():
    """Marks on one side in pictures 0.1 s apart: no turn, or one in either sense."""
    time = np.array([0.3, 0.4])
    pixel = seen(SIDE, time, 0 * FORWARDS, towards(SIDE, 0.35))
    (spin,) = measure_spins(flight(), [video(SIDE, time, pixel)]).flights
    assert spin.verdict == "ambiguous"
    assert ": 0.0, " in spin.remarks[0].text


def test_a_third_mark_at_an_uneven_time_tells_the_turns():
    time, omega = np.array([0.3, 0.4, 0.433]), 2 * np.pi * 7.3 * FORWARDS
    point = Rotation.from_rotvec(-0.35 * omega).apply(towards(SIDE, 0.35))
    (spin,) = measure_spins(flight(), [video(SIDE, time, seen(SIDE, time, omega, point))]).flights
    assert spin.verdict == "measured"
    assert spin.turns_per_s == pytest.approx(7.3, abs=1e-6)


def test_marks_of_two_cameras_are_one_measurement():
    omega = 2 * np.pi * 3 * FORWARDS
    other = look_at(1920, 1080, [5.0, -8.0, 4.0], [3.2, 0.0, 2.5], focal_px=1600)
    point = Rotation.from_rotvec(-0.35 * omega).apply(towards(SIDE, 0.35))
    views = [video(lens, [t], seen(lens, np.array([t]), omega, point)) for lens, t in ((SIDE, 0.30), (other, 0.36))]
    (spin,) = measure_spins(flight(), views).flights
    assert spin.turns_per_s == pytest.approx(3.0, abs=1e-6)
    assert spin.mark_time_s.size == 2


def test_one_mark_and_marks_in_no_flight():
    time, omega = np.array([0.3]), 2 * np.pi * FORWARDS
    pixel = seen(SIDE, time, omega, towards(SIDE, 0.3))
    (spin,) = measure_spins(flight(), [video(SIDE, time, pixel)]).flights
    assert (spin.verdict, spin.spin) == ("unknown", None)
    assert "again in another picture" in spin.remarks[0].text
    late = measure_spins(flight(), [video(SIDE, [3.0], pixel)])
    assert late.flights == ()
    assert "is in no flight" in late.remarks[0].text


def test_a_block_too_small_in_the_picture():
    far = look_at(1920, 1080, [3.2, -150.0, 2.5], [3.2, 0.0, 2.5], focal_px=1600)
    time, omega = np.array([0.3, 0.34]), 2 * np.pi * 2 * FORWARDS
    (spin,) = measure_spins(
        flight(), [video(far, time, seen(far, time, omega, towards(far, 0.3)), sigma_px=2.0)]
    ).flights
    assert spin.spin is None
    assert "too small in the picture" in spin.remarks[0].text


def test_marks_that_are_not_of_one_point():
    time, omega = 0.3 + np.arange(4) / 30, 2 * np.pi * 3 * FORWARDS
    point = Rotation.from_rotvec(-0.35 * omega).apply(towards(SIDE, 0.35))
    pixel = seen(SIDE, time, omega, point)
    pixel[2] = 2 * project(SIDE, centre(time[2:3]))[0] - pixel[2]
    (spin,) = measure_spins(flight(0.01), [video(SIDE, time, pixel)]).flights
    assert "off a steady turn" in "".join(map(str, spin.remarks))
    assert spin.sigma_turns_per_s > 1


def test_a_flight_of_the_contacts_is_taken_to_the_centre():
    time, omega = 0.3 + np.arange(3) / 30, 2 * np.pi * 3 * FORWARDS
    point = Rotation.from_rotvec(-0.33 * omega).apply(towards(SIDE, 0.33))
    made = reconstruct(flight().picks, block=BLOCK, flights="contacts")
    (spin,) = measure_spins(made, [video(SIDE, time, seen(SIDE, time, omega, point))]).flights
    assert spin.turns_per_s == pytest.approx(3.0, abs=1e-6)


def test_an_unknown_axis_is_refused():
    marked = video(SIDE, [0.3], np.array([[900.0, 500.0]]))
    marked = replace(marked, marks=replace(marked.marks, axis=np.array(["x"])))
    with pytest.raises(InputError, match="Unknown axis of spin 'x'"):
        measure_spins(flight(), [marked])
