# SPDX-License-Identifier: GPL-3.0-or-later
"""Eq. 5–10 of Noël et al. 2018 against worked vectors, and properties that hold for any picks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rockfall.core.constants import GRAVITY_MPS2
from rockfall.core.reconstruction.flight import flight_states
from rockfall.core.reconstruction.impact import apparent
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

SLOPE = np.radians(40)
VECTORS = {
    "parabola": {
        "position": [(0, 0, 0), (4, 0, 2.77375), (8, 0, 3.095)],
        "time_s": [0.0, 0.5, 1.0],
        "normal": (0, 0, 1),
        "v1": (8, 0, 3.095),
        "v2": (8, 0, 3.095),
        "numbers": (1, 1, 1, 21.150208, 0, 0, 3.095),
    },
    "flat bounce": {
        "position": [(0, 0, 0), (4, 0, 0), (7, 1, 0)],
        "time_s": [0.0, 0.8, 1.3],
        "normal": (0, 0, 1),
        "v1": (5, 0, -3.924),
        "v2": (6, 2, 2.4525),
        "numbers": (0.625, 1.264911, 1.067259, 38.124823, 61.796358, 61.796358, 2.4525),
    },
    "40 degree slope": {
        "position": [(0, 0, 100), (6, 0.5, 93.5), (13, 0.2, 87)],
        "time_s": [10.0, 10.9, 11.7],
        "normal": (np.sin(SLOPE), 0, np.cos(SLOPE)),
        "v1": (6.666667, 0.555556, -11.636722),
        "v2": (8.75, -0.375, -4.201),
        "numbers": (0.519819, 0.746932, 0.723665, 20.173592, 34.838987, 34.838987, 2.406239),
    },
}


@pytest.fixture(params=VECTORS, ids=str)
def vector(request):
    return VECTORS[request.param]


def picks_of(vector):
    return make_picks(["a"] * 3, vector["time_s"], vector["position"], normal=[vector["normal"]] * 3)


def test_velocities_of_the_worked_vectors(vector):
    impacts = reconstruct(picks_of(vector)).impacts
    np.testing.assert_allclose(impacts.v1[1], vector["v1"], atol=1e-6)
    np.testing.assert_allclose(impacts.v2[1], vector["v2"], atol=1e-6)


def test_coefficients_and_angles_of_the_worked_vectors(vector):
    impacts = reconstruct(picks_of(vector)).impacts
    values = apparent(impacts.v1, impacts.v2, impacts.normal)
    printed = apparent(impacts.v1, impacts.v2, impacts.normal, eq10="as_printed")
    got = [column[1] for column in (values.rn, values.rt, values.r)]
    got += [np.degrees(column[1]) for column in (values.theta1, values.theta_dev, printed.theta_dev)]
    np.testing.assert_allclose([*got, values.escape[1]], vector["numbers"], atol=1e-6)


def test_a_departing_impact_keeps_its_velocities_but_has_no_coefficients():
    impacts = reconstruct(picks_of(VECTORS["parabola"])).impacts
    assert impacts.flags["departing"].tolist() == [False, True, False]
    for column in (impacts.rn, impacts.rt, impacts.r, impacts.theta1, impacts.theta_dev):
        assert np.isnan(column[1])
    assert impacts.vn1[1] == pytest.approx(3.095)
    assert not impacts.complete.any()


def test_first_and_last_impacts_have_no_coefficients():
    impacts = reconstruct(picks_of(VECTORS["flat bounce"])).impacts
    assert impacts.flag_text() == ["first", "", "last"]
    assert impacts.impact.tolist() == [1, 2, 3]
    for end in (0, 2):
        assert np.isnan([impacts.rn[end], impacts.rt[end], impacts.r[end], impacts.theta_dev[end]]).all()


def test_without_normals_velocities_r_and_deviation_remain():
    vector = VECTORS["40 degree slope"]
    impacts = reconstruct(make_picks(["a"] * 3, vector["time_s"], vector["position"])).impacts
    np.testing.assert_allclose(impacts.v2[1], vector["v2"], atol=1e-6)
    assert impacts.r[1] == pytest.approx(0.723665, abs=1e-6)
    assert np.degrees(impacts.theta_dev[1]) == pytest.approx(34.838987, abs=1e-6)
    assert np.isnan([impacts.rn[1], impacts.rt[1], impacts.theta1[1], impacts.vn1[1]]).all()


def test_eq10_as_printed_folds_angles_beyond_90_degrees():
    v1, v2, n = np.array([[5.0, 0, -3]]), np.array([[-4.0, 1, 2]]), np.array([[0.0, 0, 1]])
    signed = np.degrees(apparent(v1, v2, n).theta_dev[0])
    cosine = v1[0] @ v2[0] / np.linalg.norm(v1) / np.linalg.norm(v2)
    assert signed == pytest.approx(np.degrees(np.arccos(cosine)))
    assert signed > 90
    assert np.degrees(apparent(v1, v2, n, eq10="as_printed").theta_dev[0]) == pytest.approx(180 - signed)


def test_grazing_angles_are_resolved_where_the_arc_sine_of_eq9_is_not():
    for degrees in (1e-6, 0.01, 0.1):
        angle = np.radians(degrees)
        v1 = np.array([[np.cos(angle), 0, -np.sin(angle)]])
        value = np.degrees(apparent(v1, v1, np.array([[0.0, 0, 1]])).theta1[0])
        assert value == pytest.approx(degrees, rel=1e-9)


def test_a_restituted_velocity_into_the_ground_is_flagged():
    picks = make_picks(["a"] * 3, [0, 1, 1.2], [(0, 0, 10), (5, 0, 8), (6, 0, 7)], normal=[(0, 0, 1)] * 3)
    impacts = reconstruct(picks).impacts
    assert impacts.v2[1, 2] < 0
    assert impacts.flag_text()[1] == "into_ground"
    assert np.isfinite(impacts.rn[1])


coordinate = st.floats(-50, 50)
triple = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=4, max_size=4)
steps = st.lists(st.floats(0.2, 3.0), min_size=4, max_size=4)


def columns(impacts):
    return np.stack([impacts.rn, impacts.rt, impacts.r, impacts.theta1, impacts.theta_dev], axis=1)


@settings(max_examples=40, deadline=None)
@given(triple, steps, st.floats(-np.pi, np.pi))
def test_a_turn_about_the_vertical_changes_no_coefficient(position, step, angle):
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    position, time = np.array(position), np.cumsum(step)
    normal = np.array([[0.3, -0.2, 0.9]] * 4)
    one = reconstruct(make_picks(["a"] * 4, time, position, normal=normal)).impacts
    other = reconstruct(make_picks(["a"] * 4, time, position @ turn.T, normal=normal @ turn.T)).impacts
    sharp = (
        np.abs(apparent(one.v1, one.v2, one.normal).approach) > 1e-6
    )  # the sense of a grazing one may round either way
    sharp &= (one.vt1 > 1e-3) & (np.linalg.norm(one.v1, axis=1) > 1e-3)
    np.testing.assert_allclose(columns(other)[sharp], columns(one)[sharp], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(other.v2, one.v2 @ turn.T, atol=1e-9)


@settings(max_examples=40, deadline=None)
@given(triple, steps, st.integers(-4096, 4096))
def test_a_shift_of_the_clock_changes_nothing(position, step, shift):
    time = np.round(np.cumsum(step) * 1024) / 1024  # exact in binary, also when shifted
    one = reconstruct(make_picks(["a"] * 4, time, position)).impacts
    other = reconstruct(make_picks(["a"] * 4, time + shift, position)).impacts
    np.testing.assert_array_equal(other.v1, one.v1)
    np.testing.assert_array_equal(other.theta_dev, one.theta_dev)


@settings(max_examples=60, deadline=None)
@given(st.tuples(*[st.floats(-20, 20)] * 3), st.floats(0.2, 2), st.floats(0.2, 2))
def test_free_flight_through_a_pick_is_no_impact(velocity, first, second):
    velocity = np.array(velocity)
    time = np.array([0, first, first + second])
    position = velocity * time[:, None]
    position[:, 2] -= GRAVITY_MPS2 / 2 * time**2
    impacts = reconstruct(make_picks(["a"] * 3, time, position, normal=[(0, 0, 1)] * 3)).impacts
    vertical = velocity[2] - GRAVITY_MPS2 * first
    values = apparent(impacts.v1, impacts.v2, impacts.normal)
    if abs(vertical) > 1e-6:
        assert impacts.flags["departing"][1] == (vertical > 0)
        assert impacts.flags["into_ground"][1] == (vertical < 0)
    if np.linalg.norm(impacts.v1[1]) > 1e-3:
        assert values.r[1] == pytest.approx(1, abs=1e-8)
        assert values.theta_dev[1] == pytest.approx(0, abs=1e-6)


def test_states_of_a_flight_follow_its_parabola():
    reconstruction = reconstruct(picks_of(VECTORS["flat bounce"]))
    position, velocity = flight_states(reconstruction.flights, np.array([0, 0, 1]), np.array([0.0, 0.4, 1.3]))
    np.testing.assert_allclose(position, [(0, 0, 0), (2, 0, GRAVITY_MPS2 * 0.8**2 / 8), (7, 1, 0)], atol=1e-12)
    np.testing.assert_allclose(velocity, [(5, 0, 3.924), (5, 0, 0), (6, 2, -2.4525)], atol=1e-12)
