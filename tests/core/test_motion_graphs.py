# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion over time, against parabolas by hand and pixels of a known offset."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.motion_graphs import (
    CLEARANCE,
    HEIGHT,
    KINETIC,
    QUANTITIES,
    RESIDUAL,
    SPEED,
    TOTAL,
    motion_courses,
    shown_quantities,
    time_limits,
)
from rockfall.core.camera.model import look_at, project
from rockfall.core.camera.path import fixed
from rockfall.core.footage.clock import Clock
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.refinement.views import PixelObservations, View
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.surface import Surface

G = 9.81
DIP = np.radians(35)
OUT = np.array([np.sin(DIP), 0.0, np.cos(DIP)])
BLOCK = Block(0.4, 0.4, 0.4, 2500.0)


def slope(half=50.0):
    """A plane that dips by 35° to the east, through the origin."""
    x, y = np.array([-half, half, half, -half]), np.array([-half, -half, half, half])
    corners = np.column_stack([x, y, -np.tan(DIP) * x])
    return Surface(corners, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), GlobalShift(), "slope")


def on_slope(x):
    x = np.asarray(x, dtype=float)
    return np.column_stack([x, np.zeros_like(x), -np.tan(DIP) * x])


def falls(x=(-20.0, -12.0, 0.0, 15.0), time_s=(0.0, 0.8, 1.9, 3.0), **more):
    return make_picks(["a"] * len(x), time_s, on_slope(x), **more)


def by_hand(x, time_s, at_s):
    """Position and velocity of the parabolas that join picks on the slope."""
    place = on_slope(x)
    i = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(x) - 2)
    whole, tau = np.diff(time_s)[i], at_s - np.asarray(time_s)[i]
    v0 = (place[i + 1] - place[i]) / whole[:, None] + np.outer(G * whole / 2, [0, 0, 1])
    fallen = np.outer(0.5 * G * tau**2, [0, 0, 1])
    return place[i] + v0 * tau[:, None] - fallen, v0 - np.outer(G * tau, [0, 0, 1])


def test_speed_and_heights_are_those_of_the_parabolas():
    x, time_s = (-20.0, -12.0, 0.0, 15.0), (0.0, 0.8, 1.9, 3.0)
    (course,) = motion_courses(
        reconstruct(falls(x, time_s), block=BLOCK, surface=slope()), slope(), quantities=QUANTITIES
    )
    for at_s in (0.0, 0.31, 0.8, 1.2, 2.95):
        place, velocity = (part[0] for part in by_hand(x, time_s, np.array([at_s])))
        above = place[2] + np.tan(DIP) * place[0]
        assert course.at(SPEED, at_s) == pytest.approx(np.linalg.norm(velocity), rel=2e-3)
        assert course.at(HEIGHT, at_s) == pytest.approx(above, abs=2e-3)
        assert course.at(CLEARANCE, at_s) == pytest.approx(above * np.cos(DIP), abs=2e-3)
    sampled = np.flatnonzero(course.flight == 1)
    _, velocity = by_hand(x, time_s, course.time_s[sampled][:-1])
    np.testing.assert_allclose(course.values[SPEED.name][sampled][:-1], np.linalg.norm(velocity, axis=1), rtol=1e-12)
    np.testing.assert_array_equal(course.impact_time_s, time_s)
    assert np.isnan([course.at(SPEED, -0.1), course.at(SPEED, 3.1)]).all()


def test_an_impact_is_a_jump():
    (course,) = motion_courses(reconstruct(falls(), block=BLOCK))
    before, after = course.values[SPEED.name][course.time_s == 0.8]
    impact = reconstruct(falls(), block=BLOCK).impacts
    assert before == pytest.approx(np.linalg.norm(impact.v1[1]))
    assert after == pytest.approx(np.linalg.norm(impact.v2[1])) == course.at(SPEED, 0.8)
    assert np.isnan(course.values[HEIGHT.name]).all()  # there is no terrain


def test_where_centres_fly_heights_are_of_the_underside():
    ground = slope()
    (course,) = motion_courses(
        reconstruct(falls(), block=BLOCK, surface=ground, flights="centres"), ground, quantities=QUANTITIES
    )
    assert course.at(CLEARANCE, 0.8) == pytest.approx(0.0, abs=1e-9)
    assert course.at(HEIGHT, 0.8) == pytest.approx(0.2 / np.cos(DIP) - 0.2, abs=1e-9)


def test_energy_is_kept_in_flight_but_for_drag_and_spin_adds_to_it():
    spin = np.full((4, 3), np.nan)
    spin[1] = (3.0, 0.0, 4.0)
    picks = falls(angular_velocity=spin)
    (course,) = motion_courses(reconstruct(picks, block=BLOCK), quantities=QUANTITIES)
    place, _ = by_hand((-20.0, -12.0, 0.0, 15.0), (0.0, 0.8, 1.9, 3.0), course.time_s)
    for flight in range(3):
        own = np.flatnonzero(course.flight == flight)[:-1]  # by hand, the last moment is the next flight's
        whole = course.values[KINETIC.name][own] + 1e-3 * BLOCK.mass_kg * G * place[own, 2]
        np.testing.assert_allclose(whole, whole[0], rtol=1e-12)
    rotation = course.values[TOTAL.name] - course.values[KINETIC.name]
    sphere = 0.5 * 0.4 * BLOCK.mass_kg * 0.2**2 * 25.0
    np.testing.assert_allclose(rotation[course.flight == 0], 1e-3 * sphere)
    assert np.isnan(rotation[course.flight > 0]).all()
    (slowed,) = motion_courses(reconstruct(picks, block=BLOCK, drag=Drag()))
    last = course.flight == 2
    lost = slowed.values[KINETIC.name][last] - slowed.values[KINETIC.name][last][0]
    assert lost[-1] < (course.values[KINETIC.name][last] - course.values[KINETIC.name][last][0])[-1]


def test_gaps_are_gaps_and_a_stop_is_at_rest():
    status = ["ok", "ok", "discarded", "ok", "ok"]
    picks = make_picks(
        ["a"] * 5, [0.0, 1.0, 2.0, 3.0, 4.0], on_slope([-20, -12, -5, 5, 10]), status=status,
        kind=["impact", "impact", "impact", "impact", "stop"],
    )  # fmt: skip
    (course,) = motion_courses(reconstruct(picks, block=BLOCK))
    assert np.count_nonzero(np.isnan(course.time_s)) == 1
    assert np.isnan([course.at(SPEED, 1.5), course.at(SPEED, 2.5)]).all()
    assert np.isfinite([course.at(SPEED, 1.0), course.at(SPEED, 3.0)]).all()
    assert course.at(SPEED, 4.0) == 0.0 < course.at(SPEED, 3.9)


def test_beside_the_terrain_there_is_no_height():
    small = slope(half=14.0)
    picks = falls((-12.0, 0.0, 10.0), (0.0, 1.0, 1.9))
    through = reconstruct(
        make_picks(["a"] * 2, [0.0, 2.0], [[0, 0, 0], [30, 0, -10]], kind=["impact", "pass"]), surface=small
    )
    (course,) = motion_courses(through, small)
    assert np.isfinite(course.at(HEIGHT, 0.5))
    assert np.isnan(course.at(HEIGHT, 1.5))
    assert np.isfinite(course.at(SPEED, 1.5))
    assert len(motion_courses(reconstruct(picks, surface=small), small)) == 1


CAMERA = look_at(1920, 1080, (20, -80, 20), (0, 0, 0), focal_px=1500.0)


def seen(course_times, offset_px, *, lift=0.0, clock=None, number=0):
    """Pixels of the parabolas by hand, off by a known offset, in video time."""
    place, _ = by_hand((-20.0, -12.0, 0.0, 15.0), (0.0, 0.8, 1.9, 3.0), course_times)
    pixel = project(CAMERA, place + lift * OUT) + offset_px
    clock = clock or Clock()
    m = course_times.size
    return PixelObservations(
        np.full(m, number), np.full(m, "a"), clock.to_video(course_times), pixel, np.full(m, 1.0)
    )  # fmt: skip


def test_the_residual_is_the_known_offset_of_a_track():
    """On the clock of a video of 240 pictures a second kept at 30, which began 12 s earlier."""
    clock = Clock(offset_s=-12.0, rate=1 / 8)
    times = np.linspace(-0.5, 3.5, 41)
    observed = seen(times, (3.0, -4.0), lift=0.2, clock=clock)
    view = View("camera 1", fixed(CAMERA), clock)
    ground = slope()
    (course,) = motion_courses(reconstruct(falls(), block=BLOCK, surface=ground), ground, [view], observed)
    (track,) = course.residuals
    there = (times >= 0) & (times <= 3)
    np.testing.assert_allclose(track.offset_px[there], np.tile([3.0, -4.0], (there.sum(), 1)), atol=1e-6)
    assert np.isnan(track.offset_px[~there]).all()
    np.testing.assert_allclose(track.time_s, times, atol=1e-12)
    assert course.at(RESIDUAL, 1.05) == pytest.approx(5.0)
    assert track.video == "camera 1"


def test_without_normals_the_contact_points_have_to_do():
    times = np.linspace(0.0, 3.0, 31)
    view = View("camera 1", fixed(CAMERA))
    (course,) = motion_courses(reconstruct(falls(), block=BLOCK), None, [view], seen(times, (0.0, 2.0)))
    np.testing.assert_allclose(course.residuals[0].distance_px, 2.0, atol=1e-6)


def test_a_track_of_a_rolling_shutter_is_met_row_by_row():
    view = View("camera 1", fixed(CAMERA), row_time_s=2e-5)
    times = np.linspace(0.2, 2.8, 27)
    observed = seen(times, (0.0, 0.0))
    late = replace(observed, time_s=times - 2e-5 * (observed.pixel[:, 1] - 540))
    (course,) = motion_courses(reconstruct(falls(), block=BLOCK), None, [view], late)
    np.testing.assert_allclose(course.residuals[0].distance_px, 0.0, atol=1e-6)


def test_one_pick_and_no_track_show_what_there_is():
    picks = make_picks(["a", "b", "b"], [5.0, 0.0, 1.0], on_slope([0, -10, 0]))
    alone, other = motion_courses(reconstruct(picks, block=BLOCK))
    assert alone.time_s.size == 0
    assert alone.impact_time_s.tolist() == [5.0]
    assert not alone.has(SPEED)
    assert other.has(SPEED)
    assert not other.has(RESIDUAL)
    assert np.isnan([alone.at(SPEED, 5.0), alone.at(RESIDUAL, 5.0)]).all()
    assert shown_quantities([alone, other], QUANTITIES) == (SPEED, KINETIC)
    assert time_limits([alone, other]) == (0.0, 5.0)
    assert time_limits([]) == (0.0, 1.0)
    assert other.series(RESIDUAL)[0].size == 0
