# SPDX-License-Identifier: GPL-3.0-or-later
"""What is noticed without being asked: a track off the motion, sizes that cannot be."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.motion_graphs import MotionCourse, VideoResiduals
from rockfall.core.camera.model import Camera
from rockfall.core.footage.background import BackgroundMotion, no_motion
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.noticed import (
    impossible_scan,
    impossible_sizes,
    moved_on,
    moves_at_a_glance,
    no_tripod,
    standing_out,
    tracked_beyond,
    tracks_off_the_motion,
    turn_deg,
    vegetated,
)


def course(offset_px):
    time = np.arange(len(offset_px)) / 30
    offset = np.c_[np.asarray(offset_px, float), np.zeros(len(offset_px))]
    nothing = np.empty(0)
    residuals = VideoResiduals("left", time, time + 2, offset, offset)
    return MotionCourse("a", nothing, nothing, {}, nothing, nothing, nothing, nothing, (residuals,))


def test_a_flight_through_two_is_off_where_the_impact_is_missing():
    # two parabolas of 0.5 s, 1.63 m high each, seen at 30 px/m, and the one flight through their ends
    time = np.arange(30) / 30
    true = 0.5 * 9.81 * (time % 0.5) * (0.5 - time % 0.5)
    single = 0.5 * 9.81 * time * (1 - time)
    (remark,) = tracks_off_the_motion([course(30 * (true - single))])
    assert "37 px off the flights, at 2.50 s" in remark.text  # ½ g 0.5² · 30 px/m, where both halves meet
    assert remark.severity == "warning"


@pytest.mark.parametrize("offset", [[9.0] * 20, [0, 0, 60, 60, 0, 0, 0, 60], [np.nan] * 10])
def test_noise_slips_and_unknown_places_are_not_told(offset):
    assert tracks_off_the_motion([course(offset)]) == ()


def fall(scale=1.0, slower=1.0):
    """A block that gains 5 m/s in each second on its way down a slope of 45°, picked every half second."""
    time = 0.5 * np.arange(9)
    down = 0.5 * 5.0 * time**2 / np.sqrt(2)
    return make_picks(["a"] * 9, slower * time, scale * np.c_[down, np.zeros(9), -down])


def test_a_real_fall_has_nothing_to_be_noticed():
    assert impossible_sizes(reconstruct(fall(), block=Block(0.5, 0.5, 0.5))) == ()


@pytest.mark.parametrize("wrong", [{"scale": 100.0}, {"slower": 0.2}, {"scale": 20.0, "slower": 1.0}])
def test_a_wrong_unit_and_a_wrong_rate_give_speeds_that_cannot_be(wrong):
    (remark,) = impossible_sizes(reconstruct(fall(**wrong), block=Block(0.5, 0.5, 0.5)))
    assert "Check the unit of the terrain, and the capture rate" in remark.text


def test_speeds_of_no_rockfall_are_told_when_the_first_flight_has_them_too():
    time = 0.2 * np.arange(5)
    picks = make_picks(["a"] * 5, time, np.c_[600 * time, np.zeros(5), -600 * time])
    (remark,) = impossible_sizes(reconstruct(picks, block=Block(0.5, 0.5, 0.5)))
    assert "no rockfall" in remark.text


def test_a_block_larger_than_its_flights_is_told():
    (remark,) = impossible_sizes(reconstruct(fall(), block=Block(50.0, 50.0, 50.0)))
    assert "block (50 m) is larger" in remark.text


@pytest.mark.parametrize(("turn", "told"), [(13.6, True), (0.01, False)])
def test_a_background_that_turns_is_no_tripod(turn, told):
    camera = Camera(1920, 1080, 1600.0, 1600.0, 960.0, 540.0)
    matrix = np.array([[1600.0, 0, 960], [0, 1600, 540], [0, 0, 1]])
    a = np.radians([0.0, turn / 2, turn])
    turned = np.array([[[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]] for b in a])
    motion = BackgroundMotion(
        np.arange(3), matrix @ turned @ np.linalg.inv(matrix), np.full(3, 50), np.zeros(3), still=False
    )
    assert turn_deg(motion, camera) == pytest.approx(turn)
    said = no_tripod(motion, camera, "left")
    assert len(said) == told
    assert all("moves by 13.6°" in remark.text for remark in said)
    assert no_tripod(no_motion(0, 2), camera, "left") == ()


def test_a_first_look_asks_whether_it_was_held_by_hand():
    (said,) = moves_at_a_glance(179.4, "left")
    assert "left moves by 179 px" in said.text
    assert "Hand-held in step 3" in said.text
    assert moves_at_a_glance(3.0, "left") == () == moves_at_a_glance(float("nan"), "left")


def slope(lifted):
    """31 × 31 points every metre on a slope of 45°, some of them lifted [m]."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(31.0), np.arange(31.0)))
    corner = np.arange(31 * 31).reshape(31, 31)
    a, b, c, d = (each.ravel() for each in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    faces = np.r_[np.c_[a, b, c], np.c_[a, c, d]].astype(np.int32)
    return Surface(np.c_[x, y, x + lifted], faces, GlobalShift(), "slope")


@pytest.mark.parametrize(("feet", "told"), [(1.0, False), (1 / 0.3048, True)])
def test_feet_taken_for_metres_put_most_flights_into_the_ground(feet, told):
    """Parabolas of 0.9 s rise 0.99 m over their chords, whatever the unit; humps of 0.6 m are then 2 m high."""
    x = np.tile(np.arange(31.0), 31)
    ground = slope(0.3 * (1 - np.cos(2 * np.pi * (x - 4) / 8)))
    ground = Surface(feet * ground.vertices, ground.faces, GlobalShift(), "slope")
    at = np.array([28.0, 20.0, 12.0, 4.0])
    picks = make_picks(["a"] * 4, 0.9 * np.arange(4), feet * np.c_[at, np.full(4, 15.0), at])
    said = impossible_sizes(reconstruct(picks, surface=ground, block=Block(0.5, 0.5, 0.5)))
    assert [remark.text.startswith("Trajectory a: 3 of its 3 flights pass under the terrain") for remark in said] == (
        [True] * told
    )
    assert all("the unit of the terrain" in remark.text for remark in said)


@pytest.mark.parametrize(
    ("extent", "triangles", "told"),
    [
        ((100.0, 200.0, 90.0), 300_000, ""),
        ((30_000.0, 40_000.0, 2500.0), 2 * 300 * 400, ""),  # a coarse model of a whole valley
        ((2000.0, 1000.0, 400.0), 2, ""),  # a plane that was drawn
        ((100e3, 200e3, 90e3), 300_000, "90,000 m high"),
        ((30e3, 30e3, 8000.0), 2 * 60 * 60, "points 500 m apart"),  # 30 m of a scan every 0.5 m, in millimetres
    ],
)
def test_a_scan_in_millimetres_is_no_slope_in_metres(extent, triangles, told):
    said = impossible_scan(np.array(extent), triangles, "scan.ply")
    assert len(said) == bool(told)
    assert all(told in remark.text and "0.001 m for millimetres" in remark.text for remark in said)


def test_leaves_are_told_from_boulders_and_steps():
    x = np.tile(np.arange(31), 31)
    assert standing_out(slope(0.0 * x)) == 0.0
    assert standing_out(slope(np.where(x > 15, 10.0, 0.0))) == 0.0, "a wall is no forest"
    boulders = np.zeros(31 * 31)
    boulders[[100, 300, 500]] = 3.0  # 2 m above the neighbour uphill
    assert standing_out(slope(boulders)) == pytest.approx(3 / 961)
    leaves = np.zeros((31, 31))
    leaves[1:-1:3, 1:-1:3] = -4.0
    assert standing_out(slope(leaves.ravel())) == pytest.approx(100 / 961), "points from below, too"
    assert vegetated(3 / 961, "scan") == ()
    (remark,) = vegetated(100 / 961, "scan.laz")
    assert remark.severity == "warning"
    assert "scan.laz" in remark.text
    assert "10 %" in remark.text
    assert "ground filter" in remark.text


def test_a_track_that_goes_on_after_the_last_pick_is_told():
    (remark,) = tracked_beyond("B01", 10.5, 12.0, 150.0)
    assert remark.severity == "note"
    assert "B01 is tracked until 12.00 s, but its last pick is at 10.50 s" in remark.text
    assert tracked_beyond("B01", 11.5, 12.0, 150.0) == (), "the rest of a flight"
    assert tracked_beyond("B01", 10.5, 12.0, 3.0) == (), "it lies still"
    assert tracked_beyond("B01", 10.5, 12.0, np.nan) == ()


def test_a_turn_of_the_camera_is_no_motion_of_the_block():
    turn = 100 / 1000  # tangent of the angle
    c, s = 1 / np.hypot(1, turn), turn / np.hypot(1, turn)
    first = Camera(1280, 720, 1000.0, 1000.0, 640.0, 360.0)
    turned = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ first.rotation
    last = replace(first, rotation=turned)
    assert moved_on(first, np.array([740.0, 360.0]), last, np.array([640.0, 360.0])) == pytest.approx(0, abs=1e-6)
    assert moved_on(first, np.array([640.0, 360.0]), last, np.array([640.0, 360.0])) == pytest.approx(100, abs=1e-6)
