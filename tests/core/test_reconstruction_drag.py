# SPDX-License-Identifier: GPL-3.0-or-later
"""Flights through air, against analytic falls and independent solvers."""

import numpy as np
import pytest
from rockfall.core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2
from rockfall.core.errors import RockfallError
from rockfall.core.reconstruction import drag_kernels
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.flight import flight_states
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from scipy.integrate import solve_bvp, solve_ivp

PEBBLE = Block(0.02, 0.02, 0.02, density=2000)


def motion(drag_per_m):
    def derivative(_, state):
        velocity = state[3:]
        acceleration = -drag_per_m * np.linalg.norm(velocity, axis=0) * velocity
        acceleration[2] -= GRAVITY_MPS2
        return np.concatenate([velocity, acceleration])

    return derivative


def test_the_coefficient_is_half_rho_cd_area_over_mass():
    block = Block(0.3, 0.35, 0.4, density=2600)
    area = np.pi * 0.35**2 / 4
    expected = 0.5 * AIR_DENSITY_KGPM3 * DRAG_COEFFICIENT * area / block.mass_kg
    assert Drag().per_metre(block) == pytest.approx(expected)


def test_a_fall_from_rest_is_the_analytic_one():
    drag = 0.05
    terminal = np.sqrt(GRAVITY_MPS2 / drag)
    time = np.linspace(0.1, 8, 30)
    moved, velocity = fly(np.zeros((30, 3)), np.zeros((30, 3)), time, GRAVITY_MPS2, np.full(30, drag))
    np.testing.assert_allclose(velocity[:, 2], -terminal * np.tanh(GRAVITY_MPS2 * time / terminal), atol=1e-9)
    fallen = terminal**2 / GRAVITY_MPS2 * np.log(np.cosh(GRAVITY_MPS2 * time / terminal))
    np.testing.assert_allclose(moved[:, 2], -fallen, atol=1e-9)


def test_a_long_fall_ends_at_the_terminal_velocity():
    drag = 0.05
    _, velocity = fly(np.zeros((1, 3)), np.zeros((1, 3)), np.array([60.0]), GRAVITY_MPS2, np.array([drag]))
    assert velocity[0, 2] == pytest.approx(-np.sqrt(GRAVITY_MPS2 / drag), abs=1e-9)


def test_integration_agrees_with_scipy():
    rng = np.random.default_rng(4)
    velocity, time, drag = rng.normal(size=(20, 3)) * 15, rng.uniform(0.1, 6, 20), rng.uniform(1e-4, 0.1, 20)
    moved, final = fly(np.zeros((20, 3)), velocity, time, GRAVITY_MPS2, drag)
    for i in range(20):
        start = np.concatenate([np.zeros(3), velocity[i]])
        end = solve_ivp(motion(drag[i]), (0, time[i]), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        np.testing.assert_allclose(np.concatenate([moved[i], final[i]]), end, atol=2e-9)


def test_flights_meet_their_picks_and_are_the_solution_of_the_boundary_problem():
    ends, duration = np.array([(0, 0, 0), (20, 5, -15.0)]), 1.8
    picks = make_picks(["a", "a"], [0, duration], ends)
    flights = reconstruct(picks, block=PEBBLE, drag=Drag()).flights
    drag = flights.drag_per_m[0]
    mesh = np.linspace(0, duration, 60)
    guess = np.concatenate([np.outer(ends[1] / duration, mesh), np.tile((ends[1] / duration)[:, None], 60)])

    def at_the_ends(start, end):
        return np.concatenate([start[:3] - ends[0], end[:3] - ends[1]])

    solution = solve_bvp(motion(drag), at_the_ends, mesh, guess, tol=1e-9, max_nodes=50_000)
    assert solution.success
    np.testing.assert_allclose(flights.start_velocity[0], solution.sol(0)[3:], atol=1e-6)
    np.testing.assert_allclose(flights.end_velocity[0], solution.sol(duration)[3:], atol=1e-6)
    np.testing.assert_allclose(flights.end_position[0], ends[1], atol=1e-9)
    middle, _ = flight_states(flights, np.array([0]), np.array([0.7]))
    np.testing.assert_allclose(middle[0], solution.sol(0.7)[:3], atol=1e-6)


def test_end_points_are_met_for_many_flights_however_fast():
    rng = np.random.default_rng(2)
    n = 300
    position = np.cumsum(rng.normal(size=(n, 3)) * [12, 12, 6], axis=0)
    time = np.cumsum(rng.uniform(0.15, 2.5, n))
    picks = make_picks(["a"] * n, time, position)
    for block in (Block(), PEBBLE):
        flights = reconstruct(picks, block=block, drag=Drag()).flights
        reached, _ = flight_states(flights, np.arange(n - 1), flights.end_time_s)
        np.testing.assert_allclose(reached, position[1:], atol=1e-9)
        np.testing.assert_allclose(flights.start_position, position[:-1], atol=1e-9)


def test_without_air_the_closed_form_comes_back():
    picks = make_picks(["a"] * 3, [0, 1, 2.5], [(0, 0, 0), (6, 1, -3), (12, 0, -9)])
    without = reconstruct(picks).flights
    thin = reconstruct(picks, drag=Drag(air_density=1e-9)).flights
    np.testing.assert_allclose(thin.start_velocity, without.start_velocity, atol=1e-8)
    assert (without.drag_per_m == 0).all()


def test_contacts_have_no_drag():
    picks = make_picks(["a"] * 3, [0, 1, 2], [(0, 0, 0), (6, 1, -3), (8, 0, -4)], kind=["impact", "contact", "contact"])
    flights = reconstruct(picks, drag=Drag()).flights
    assert flights.drag_per_m.tolist() == [0, 0]
    np.testing.assert_allclose(flights.start_velocity[1], [2, -1, -1])


def test_a_fit_through_passes_finds_the_flight_that_made_them():
    time = np.array([0, 0.3, 0.8, 1.1, 1.5])
    velocity = np.array([12.0, -3, 6])
    drag = Drag().per_metre(PEBBLE)
    moved, _ = fly(np.zeros((5, 3)), np.tile(velocity, (5, 1)), time, GRAVITY_MPS2, np.full(5, drag))
    kinds = ["impact", "pass", "pass", "pass", "impact"]
    exact = reconstruct(make_picks(["a"] * 5, time, moved, kind=kinds), block=PEBBLE, drag=Drag()).flights
    np.testing.assert_allclose(exact.start_velocity[0], velocity, atol=1e-7)
    assert exact.residual_m[0] < 1e-9


def test_noisy_passes_are_at_the_least_squares():
    rng = np.random.default_rng(7)
    time = np.array([0, 0.3, 0.8, 1.1, 1.5])
    drag = Drag().per_metre(PEBBLE)
    clean, _ = fly(np.zeros((5, 3)), np.tile([12.0, -3, 6], (5, 1)), time, GRAVITY_MPS2, np.full(5, drag))
    seen = clean + 0.1 * rng.normal(size=clean.shape)
    kinds = ["impact", "pass", "pass", "pass", "impact"]
    flights = reconstruct(make_picks(["a"] * 5, time, seen, kind=kinds), block=PEBBLE, drag=Drag()).flights

    def squares(change):
        velocity = flights.start_velocity[0] + change[3:]
        moved, _ = fly(np.zeros((5, 3)), np.tile(velocity, (5, 1)), time, GRAVITY_MPS2, np.full(5, drag))
        return np.sum((flights.start_position[0] + change[:3] + moved - seen) ** 2)

    least = squares(np.zeros(6))
    assert flights.residual_m[0] == pytest.approx(np.sqrt(least / 5), rel=1e-9)
    for axis in range(6):
        for step in (-1e-3, 1e-3):
            assert squares(np.eye(6)[axis] * step) > least


def test_drag_makes_a_block_leave_faster_and_arrive_slower():
    picks = make_picks(["a"] * 2, [0, 2], [(0, 0, 0), (40, 0, -20)])
    without, drag = reconstruct(picks).flights, reconstruct(picks, drag=Drag()).flights
    speed = np.linalg.norm
    assert speed(drag.start_velocity[0]) > speed(without.start_velocity[0])
    assert speed(drag.end_velocity[0]) < speed(without.end_velocity[0])


def test_a_vertical_throw_turns_at_its_top_without_error():
    """Where the block stands still for an instant, |v| has a corner: up and down are tan and tanh, joined there."""
    drag, speed = 0.02, 15.0
    pace, limit = np.sqrt(GRAVITY_MPS2 * drag), np.sqrt(GRAVITY_MPS2 / drag)
    top = np.arctan(speed / limit) / pace
    time = np.linspace(0.1, 3.0, 30)
    moved, velocity = fly(np.zeros((30, 3)), np.tile([0, 0, speed], (30, 1)), time, GRAVITY_MPS2, np.full(30, drag))
    rising = limit / pace * np.log(np.cos(pace * (top - np.minimum(time, top))) / np.cos(pace * top))
    height = rising - limit / pace * np.log(np.cosh(pace * np.maximum(time - top, 0)))
    np.testing.assert_allclose(moved, np.outer(height, [0, 0, 1]), atol=1e-10)
    expected = np.where(time < top, np.tan(pace * (top - time)), -np.tanh(pace * (time - top)))
    np.testing.assert_allclose(velocity[:, 2], limit * expected, atol=1e-10)


def test_the_derivatives_are_those_of_the_flight():
    """By the start velocity, by k and by g: central differences of the displacement and of the velocity."""
    velocity, law = np.array([12.0, -3.0, 6.0]), np.array([0.02, GRAVITY_MPS2])

    def state(change, size=drag_kernels.MOTION):
        states = np.empty((1, size))
        drag, gravity = (law + change[3:])[:, None]
        start = np.ascontiguousarray((velocity + change[:3])[None])
        drag_kernels.states_along(np.zeros(1, dtype=np.intp), np.array([1.7]), start, drag, gravity, states)
        return states[0]

    found = state(np.zeros(5), drag_kernels.STATE)
    np.testing.assert_array_equal(found[:6], state(np.zeros(5)))
    for axis, step in enumerate((1e-4, 1e-4, 1e-4, 1e-6, 1e-4)):
        change = step * np.eye(5)[axis]
        expected = (state(change) - state(-change)) / (2 * step)
        np.testing.assert_allclose(found[6:].reshape(6, 5)[:, axis], expected, rtol=1e-7, atol=1e-7)


def test_a_flight_that_cannot_be_integrated():
    """Backwards in time, drag drives a block to any speed within seconds."""
    start = np.array([[10.0, 0, -5]])
    moved, _ = fly(np.zeros((1, 3)), start, np.array([-2.0]), GRAVITY_MPS2, np.array([0.02]))
    assert np.isfinite(moved).all()
    with pytest.raises(RockfallError) as caught:
        fly(np.zeros((1, 3)), start, np.array([-4.0]), GRAVITY_MPS2, np.array([0.02]))
    expected = "A flight with drag cannot be integrated. Check its duration, and the block's size and density."
    assert str(caught.value) == expected


def test_an_impossible_flight_is_named():
    """The one that fails among others, by its trajectory and its start."""
    names = np.repeat(["stone", "dust", "pebble"], 3)
    time = [0, 1, 2, 0, 3.25, 4, 0, 1, 2]
    place = np.tile([(0, 0, 0), (8, 0, -2), (16, 0, -4)], (3, 1)) + np.zeros((9, 3))
    place[3:6] = (0, 0, 0), (0, 0.01, -52.0), (5000, 0, 0)
    blocks = {"stone": Block(), "dust": Block(1e-3, 1e-3, 1e-3, density=100), "pebble": PEBBLE}
    with pytest.raises(RockfallError) as caught:
        reconstruct(make_picks(names, time, place), block=blocks, drag=Drag())
    assert str(caught.value) == (
        "No flight with drag joins the picks of trajectory dust, the flight that starts at 3.250 s. "
        "Check the times, and the block's size and density."
    )
