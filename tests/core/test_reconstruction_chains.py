# SPDX-License-Identifier: GPL-3.0-or-later
"""Which picks are joined: releases, passes, contacts, stops, gaps; and what is sampled between them."""

import numpy as np
import pytest
from rockfall.core.constants import GRAVITY_MPS2
from rockfall.core.errors import InputError, RockfallError
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.flight import flight_states
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.sampling import sample_trajectories
from rockfall.core.reconstruction.trajectory import reconstruct


def run(*kinds, status=None, trajectory=None, **more):
    """Picks of the given kinds, 1 s and (3, 0, −2) m apart."""
    n = len(kinds)
    position = np.arange(n)[:, None] * [3.0, 0, -2]
    return make_picks(trajectory or ["a"] * n, np.arange(n), position, kind=kinds, status=status, **more)


def joined(reconstruction):
    flights = reconstruction.flights
    return list(zip(flights.first_pick.tolist(), flights.last_pick.tolist(), flights.kind.tolist(), strict=True))


def test_a_release_starts_a_flight_and_is_no_impact():
    result = reconstruct(run("release", "impact", "impact"))
    assert joined(result) == [(0, 1, "flight"), (1, 2, "flight")]
    assert result.impacts.flag_text() == ["", "last"]
    assert result.impacts.impact.tolist() == [1, 2]
    np.testing.assert_allclose(result.flights.start_velocity[0], [3, 0, -2 + GRAVITY_MPS2 / 2])


def test_contact_segments_are_straight_and_give_no_coefficients():
    result = reconstruct(run("impact", "impact", "contact", "contact", "impact", "impact", "impact"))
    assert [kind for *_, kind in joined(result)] == ["flight", "contact", "contact", "contact", "flight", "flight"]
    assert result.impacts.flag_text() == ["first", "last;contact", "first;contact", "", "last"]
    np.testing.assert_allclose(result.flights.start_velocity[1:4], [[3, 0, -2]] * 3)
    position, velocity = flight_states(result.flights, np.array([2]), np.array([2.25]))
    np.testing.assert_allclose(position, [[6.75, 0, -4.5]])
    np.testing.assert_allclose(velocity, [[3, 0, -2]])
    assert np.isnan(result.impacts.r[[1, 2]]).all()


def test_a_block_comes_to_rest_on_the_ground_unless_a_pass_shows_it_flying():
    rolled = reconstruct(run("impact", "impact", "stop"))
    assert joined(rolled)[-1] == (1, 2, "contact")
    assert rolled.impacts.flag_text() == ["first", "last;contact"]
    flew = reconstruct(run("impact", "impact", "pass", "stop"))
    assert joined(flew)[-1] == (1, 3, "flight")
    assert flew.impacts.flag_text() == ["first", ""]


def test_a_stop_ends_the_chain():
    result = reconstruct(run("impact", "stop", "impact", "impact", "impact"))
    assert joined(result) == [(0, 1, "contact"), (2, 3, "flight"), (3, 4, "flight")]
    assert result.flights.chain.tolist() == [0, 1, 1]
    assert result.impacts.flag_text()[1:] == ["first", "", "last"]


def test_a_block_may_be_released_again_after_a_stop_but_not_on_the_way():
    assert len(reconstruct(run("release", "stop", "release", "impact")).flights) == 2
    with pytest.raises(InputError, match="release in the middle"):
        run("impact", "release", "impact")


def test_a_discarded_pick_is_used_by_nothing():
    status = ["ok", "ok", "ok", "discarded", "ok", "ok", "ok"]
    result = reconstruct(run(*["impact"] * 7, status=status))
    assert joined(result) == [(0, 1, "flight"), (1, 2, "flight"), (4, 5, "flight"), (5, 6, "flight")]
    flags = ["first", "", "last;gap", "first;last;gap;discarded", "first;gap", "", "last"]
    assert result.impacts.flag_text() == flags
    assert result.impacts.impact.tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_a_block_is_whole_until_it_shatters():
    result = reconstruct(run(*["impact"] * 5, status=["ok", "ok", "shattered", "ok", "ok"]))
    assert joined(result) == [(0, 1, "flight"), (1, 2, "flight"), (3, 4, "flight")]
    assert result.impacts.flag_text() == ["first", "", "last;gap;shattered", "first;gap", "last"]
    assert np.isfinite(result.impacts.v1[2]).all()
    assert np.isnan(result.impacts.v2[2]).all()


def test_doubtful_picks_are_used_and_marked():
    result = reconstruct(run(*["impact"] * 3, status=["ok", "doubtful", "ok"]))
    assert result.impacts.flag_text() == ["first", "doubtful", "last"]
    assert np.isfinite(result.impacts.r[1])


def test_trajectories_are_grouped_and_a_single_pick_is_mentioned():
    picks = make_picks(["b", "a", "b", "c", "b"], [1, 5, 2, 7, 3], np.arange(15).reshape(5, 3), row=range(2, 7))
    assert picks.trajectory.tolist() == ["b", "b", "b", "a", "c"]
    assert picks.row.tolist() == [2, 4, 6, 3, 5]
    result = reconstruct(picks)
    assert len(result.flights) == 2
    assert [remark.text.split(" has")[0] for remark in result.remarks] == ["Trajectory a", "Trajectory c"]
    assert [(remark.severity, remark.about) for remark in result.remarks] == [("advice", "a"), ("advice", "c")]
    assert result.impacts.flag_text() == ["first", "", "last", "first;last", "first;last"]


def test_a_scene_has_no_order_but_two_picks_at_one_time_are_refused():
    picks = make_picks(["a", "a"], [2, 1], np.zeros((2, 3)), sort=True)
    assert picks.time_s.tolist() == [1, 2]
    with pytest.raises(InputError, match="Two picks at one time"):
        make_picks(["a", "b", "a"], [1, 1, 1], np.zeros((3, 3)), sort=True)
    with pytest.raises(InputError, match="not sorted"):
        make_picks(["a", "a"], [2, 1], np.zeros((2, 3)))


def test_no_picks_are_no_error():
    result = reconstruct(make_picks([], [], np.zeros((0, 3))))
    assert len(result.flights) == len(result.impacts) == len(sample_trajectories(result, 0.1)) == 0


def parabola(time, noise=0.0, seed=1):
    rng = np.random.default_rng(seed)
    position = np.array([1.0, 2, 3]) + np.array([5.0, -2, 6]) * time[:, None]
    position[:, 2] -= GRAVITY_MPS2 / 2 * time**2
    return position + noise * rng.normal(size=position.shape)


def test_passes_are_fitted_by_least_squares():
    time = np.array([0, 0.3, 0.5, 0.9, 1.4])
    position = parabola(time, noise=0.1)
    kinds = ["impact", "pass", "pass", "pass", "impact"]
    flights = reconstruct(make_picks(["a"] * 5, 10 + time, position, kind=kinds)).flights
    design = np.stack([np.ones(5), time], axis=1)
    fallen = position + np.array([0, 0, GRAVITY_MPS2 / 2]) * (time**2)[:, None]
    solution, *_ = np.linalg.lstsq(design, fallen)
    np.testing.assert_allclose(flights.start_position[0], solution[0], atol=1e-10)
    np.testing.assert_allclose(flights.start_velocity[0], solution[1], atol=1e-10)
    misfit = np.linalg.norm(design @ solution - fallen, axis=1)
    assert flights.residual_m[0] == pytest.approx(np.sqrt(np.mean(misfit**2)))


def test_passes_are_weighted_by_their_standard_deviations():
    time = np.array([0, 0.4, 0.8, 1.2])
    position, sigma = parabola(time, noise=0.1), np.array([0.05, 0.3, 0.1, 0.02])
    picks = make_picks(["a"] * 4, time, position, kind=["impact", "pass", "pass", "impact"], sigma_position_m=sigma)
    flights = reconstruct(picks).flights
    design = np.stack([np.ones(4), time], axis=1) / sigma[:, None]
    fallen = (position + np.array([0, 0, GRAVITY_MPS2 / 2]) * (time**2)[:, None]) / sigma[:, None]
    solution, *_ = np.linalg.lstsq(design, fallen)
    np.testing.assert_allclose(flights.start_velocity[0], solution[1], atol=1e-10)


def test_two_picks_leave_no_residual_and_exact_passes_change_nothing():
    time = np.array([0, 0.4, 1.1, 2.0])
    alone = reconstruct(make_picks(["a"] * 2, time[[0, 3]], parabola(time)[[0, 3]])).flights
    picks = make_picks(["a"] * 4, time, parabola(time), kind=["impact", "pass", "pass", "impact"])
    flights = reconstruct(picks).flights
    assert np.isnan(alone.residual_m[0])
    assert flights.residual_m[0] < 1e-12
    np.testing.assert_allclose(flights.start_velocity, alone.start_velocity, atol=1e-11)


def test_chain_ends_that_are_passes_carry_flights():
    result = reconstruct(run("pass", "impact", "pass"))
    assert joined(result) == [(0, 1, "flight"), (1, 2, "flight")]
    assert result.impacts.flag_text() == [""]


def test_samples_hold_both_velocities_of_an_impact_and_the_rest_after_a_stop():
    result = reconstruct(run("release", "impact", "stop"))
    samples = sample_trajectories(result, 0.4)
    np.testing.assert_allclose(samples.time_s, [0, 0.4, 0.8, 1, 1, 1.2, 1.6, 2, 2])
    np.testing.assert_allclose(samples.position[[3, 4, 8]], [[3, 0, -2], [3, 0, -2], [6, 0, -4]], atol=1e-12)
    np.testing.assert_allclose(samples.velocity[[3, 4, 8]], [[3, 0, -2 - GRAVITY_MPS2 / 2], [3, 0, -2], [0, 0, 0]])
    assert samples.kinetic_j[8] == 0
    mass = Block().mass_kg
    assert samples.kinetic_j[4] == pytest.approx(mass / 2 * 13)


def test_runs_count_the_chains_of_each_trajectory():
    picks = run(*["impact"] * 7, trajectory=list("aaaabbb"), status=["ok", "shattered", *["ok"] * 5])
    samples = sample_trajectories(reconstruct(picks), 10.0)
    assert list(zip(samples.trajectory.tolist(), samples.run.tolist(), strict=True))[::2] == [
        ("a", 1),
        ("a", 2),
        ("b", 1),
        ("b", 1),
    ]


def test_energies_of_a_known_block():
    ball = Block(0.4, 0.4, 0.4, density=2500)
    assert ball.mass_kg == pytest.approx(2500 * 4 / 3 * np.pi * 0.2**3)
    assert ball.inertia_kgm2 == pytest.approx(2 / 5 * ball.mass_kg * 0.2**2)
    cube = Block(0.4, 0.4, 0.4, density=2500, shape="box")
    assert cube.inertia_kgm2 == pytest.approx(cube.mass_kg * 0.4**2 / 6)
    spin = np.array([(0, 10, 0), (0, 3, 4), (1, 0, 0)])
    result = reconstruct(run(*["impact"] * 3, angular_velocity=spin), block=ball).impacts
    assert result.kinetic1_j[1] == pytest.approx(ball.mass_kg / 2 * (3**2 + (2 + GRAVITY_MPS2 / 2) ** 2))
    assert result.rotational1_j[1] == pytest.approx(ball.inertia_kgm2 / 2 * 25)
    assert result.rotational2_j[1] == pytest.approx(ball.inertia_kgm2 / 2)
    assert np.isnan(result.rotational2_j[2])


def test_each_trajectory_may_have_its_own_block():
    picks = run(*["impact"] * 4, trajectory=list("aabb"))
    blocks = {"a": Block(), "b": Block(0.5, 0.6, 0.7)}
    np.testing.assert_allclose(reconstruct(picks, block=blocks).impacts.diameter_m, [0.35, 0.35, 0.6, 0.6])
    with pytest.raises(RockfallError, match="No block is given for trajectory b"):
        reconstruct(picks, block={"a": Block()})


def test_a_density_that_was_meant_in_grams_is_told():
    picks = run(*["impact"] * 6, trajectory=list("aabbcc"))
    assert reconstruct(picks, block=Block(density=80.6)).remarks == (), "a ball of plastic"
    (remark,) = reconstruct(picks, block=Block(density=2.7)).remarks
    assert (remark.about, remark.severity) == ("a", "warning")
    said = "a block of 2.7 kg/m³, which no rock has. In g/cm³? Then give 2700 kg/m³."
    assert remark.text == f"Trajectory a and 2 more: {said}"
    (remark,) = reconstruct(picks, block={"a": Block(), "b": Block(density=2.7), "c": Block()}).remarks
    assert (remark.about, remark.text) == ("b", f"Trajectory b: {said}")


def test_height_above_the_chord_is_an_eighth_of_g_t_squared_on_the_level():
    level = make_picks(["a"] * 2, [0, 1.2], [(0, 0, 0), (6, 0, 0)])
    slope = make_picks(["a"] * 2, [0, 1.2], [(0, 0, 0), (6, 0, -6)])
    flat = GRAVITY_MPS2 * 1.2**2 / 8
    assert reconstruct(level).impacts.chord_height_m[0] == pytest.approx(flat)
    assert reconstruct(slope).impacts.chord_height_m[0] == pytest.approx(flat * np.sqrt(0.5))
    assert reconstruct(slope, drag=Drag()).impacts.chord_height_m[0] == pytest.approx(flat * np.sqrt(0.5), rel=1e-2)
