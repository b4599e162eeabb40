# SPDX-License-Identifier: GPL-3.0-or-later
"""The model `observed`: it gives back the table that it draws from, and cannot win by memorising."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.calibration import calibrate
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.equivalence import equivalent
from rockfall.core.analysis.measured_rebounds import measured_rebounds, without_own
from rockfall.core.analysis.scores import scores
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.exchange.selection import rows_of
from rockfall.core.exchange.tables import write_impacts
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.machinery.base import Incident
from rockfall.core.impact_models.machinery.measured import MeasuredRebounds
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.reconstruction.impact import FLAGS, Impacts, apparent
from rockfall.core.simulation import engine
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.raycast import closest_points
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply
from rockfall.core.vectors import cross, dot, norm, unit
from rockfall.core.workflow.simulation import remarks_of, run_models
from scipy.stats import ks_1samp, ks_2samp

MODEL = MODELS["observed"]
UP = np.array([0.0, 0.0, 1.0])


def table(
    k: int = 40, seed: int = 3, theta_deg: float = 25.0, vn: float = 4.0, spread: float = 0.0
) -> MeasuredRebounds:
    """R_N and R_T that exclude each other (correlation about −0.9), deviations up to 40°, all weights 1."""
    rng = np.random.default_rng(seed)
    rn = rng.uniform(0.2, 0.9, k)
    return MeasuredRebounds(
        site=np.full(k, "s"),
        trajectory=np.array([f"t{i // 4}" for i in range(k)]),
        theta1=np.radians(theta_deg) * np.exp(spread * rng.normal(size=k)),
        vn1=vn * np.exp(spread * rng.normal(size=k)),
        rn=rn,
        rt=1.0 - 0.7 * rn + rng.normal(0, 0.05, k),
        turn=np.radians(rng.uniform(0, 40, k)),
        weight=np.ones(k),
    )


def blocks(n: int, theta_deg: float = 25.0, vn: float = 4.0, normal=UP, azimuth: float = 0.3) -> Incident:
    """n equal blocks that meet a plane at this angle and normal speed."""
    normal = unit(np.array([normal], dtype=float))
    first = unit(cross(normal, np.array([[0.3, 1.0, 0.2]])))
    ahead = np.cos(azimuth) * first + np.sin(azimuth) * cross(normal, first)
    v = vn / np.tan(np.radians(theta_deg)) * ahead - vn * normal
    return Incident(np.tile(v, (n, 1)), np.tile(normal, (n, 1)), np.zeros((n, 3)), np.full(n, 0.2), np.full(n, 60.0))


def outcomes(state: Incident, v2: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R_N, R_T and the signed deviation about the normal, by the definitions."""
    seen = apparent(state.velocity, v2, state.normal)
    tangential = state.velocity - dot(state.velocity, state.normal)[:, None] * state.normal
    side = np.arctan2(dot(v2, cross(state.normal, tangential)), dot(v2, tangential))
    return seen.escape / seen.vn1, seen.rt, side


def test_it_gives_back_the_table_on_the_plane_it_was_measured_on():
    """All impacts of the table were measured under the same conditions, so that each is drawn as often as another."""
    given = table()
    state = blocks(40_000, normal=(0.4, -0.3, 0.8))
    v2 = MODEL.rebound(state, rng=np.random.default_rng(1), measured=given).velocity
    rn, rt, side = outcomes(state, v2)
    found = np.stack([rn, rt, np.abs(side)], axis=1)
    rows = np.stack([given.rn, given.rt, given.turn], axis=1)
    away = np.abs(found[:, None] - rows).max(axis=2)
    drawn = away.argmin(axis=1)
    assert away.min(axis=1).max() < 1e-9, "every drawn triple is one measured triple"
    counts = np.bincount(drawn, minlength=len(given))
    expected = len(state) / len(given)
    chi2 = ((counts - expected) ** 2 / expected).sum()
    assert chi2 < 39 + 4 * np.sqrt(2 * 39), "each as often as another: χ² with 39 degrees of freedom"
    assert np.corrcoef(rn, rt)[0, 1] == pytest.approx(np.corrcoef(given.rn, given.rt)[0, 1], abs=0.01)


def test_the_deviation_has_no_side():
    state = blocks(40_000)
    _, _, side = outcomes(state, MODEL.rebound(state, rng=np.random.default_rng(2), measured=table()).velocity)
    left, right = (np.round(side[sign * side > 0] * sign, 9) for sign in (1, -1))
    assert abs(left.size - right.size) < 4 * np.sqrt(len(state))
    assert ks_2samp(left, right).pvalue > 1e-3


def test_the_kernel_is_the_stated_one():
    """How often each impact is drawn, against the formula of the model's page written anew, with unequal weights."""
    given = table(60, spread=0.5)
    given = replace(given, weight=np.linspace(0.1, 1.0, 60))
    state = blocks(60_000, 30.0, 5.0)
    rn = outcomes(state, MODEL.rebound(state, rng=np.random.default_rng(3), measured=given).velocity)[0]
    drawn = np.abs(rn[:, None] - given.rn).argmin(axis=1)

    def spread(x):
        return min(np.std(x, ddof=1), (np.quantile(x, 0.75) - np.quantile(x, 0.25)) / 1.349)

    n = given.weight.sum() ** 2 / (given.weight**2).sum()
    angle, speed = np.log(given.theta1), np.log(given.vn1)
    d2 = ((angle - np.log(np.radians(30))) / (spread(angle) * n ** (-1 / 6))) ** 2
    d2 += ((speed - np.log(5.0)) / (spread(speed) * n ** (-1 / 6))) ** 2
    share = given.weight * np.maximum(0, 1 - d2 / 6)
    share /= share.sum()
    assert 10 < (share > 0).sum() < 60, "some impacts are out of reach"
    counts = np.bincount(drawn, minlength=60)
    assert (counts[share == 0] == 0).all()
    error = np.sqrt(len(state) * share * (1 - share)) + 1
    assert (np.abs(counts - len(state) * share) < 4.5 * error).all()

    mean = outcomes(blocks(1, 30.0, 5.0), MODEL.rebound(blocks(1, 30.0, 5.0), measured=given).velocity)
    assert mean[0][0] == pytest.approx(share @ given.rn, rel=1e-9)
    assert mean[1][0] == pytest.approx(share @ given.rt, rel=1e-9)
    assert abs(mean[2][0]) < 1e-9


def test_an_impact_with_a_huge_error_is_hardly_drawn():
    impacts = field(6, 8, seed=5)
    sigma = {"rn": np.full(len(impacts), 0.05), "rt": np.full(len(impacts), 0.05)}
    sigma["rn"][7] = 60.0
    given = measured_rebounds(replace(impacts, sigma=sigma))
    assert given.weight[7] < 1e-4
    assert np.delete(given.weight, 7).min() > 0.8
    none = measured_rebounds(impacts)
    assert (none.weight == 1).all()
    sigma["rn"][3] = np.nan
    assert measured_rebounds(replace(impacts, sigma=sigma)).weight[3] == pytest.approx(
        np.median(np.delete(given.weight, 3)), rel=0.01
    )


def test_it_turns_with_the_frame():
    given, rng = table(60, spread=0.4), np.random.default_rng(4)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    state, draws = blocks(500, 32.0, 3.0, normal=(0.2, 0.5, 0.7)), rng.random((500, 2))
    turned = Incident(
        state.velocity @ turn.T, state.normal @ turn.T, state.angular_velocity, state.radius_m, state.mass_kg
    )
    one = MODEL.rebound(state, draws=draws, measured=given)
    other = MODEL.rebound(turned, draws=draws, measured=given)
    np.testing.assert_allclose(other.velocity, one.velocity @ turn.T, atol=1e-12)
    np.testing.assert_allclose(other.angular_velocity, one.angular_velocity @ turn.T, atol=1e-11)


def test_speed_grows_only_where_it_was_measured_to():
    """A table without a gain in speed gives none, under whatever conditions; with one, at most that."""
    given, rng = table(60, spread=0.6), np.random.default_rng(6)
    given = replace(given, rn=given.rn * 2.5)
    measured_r = np.hypot(given.rn * np.sin(given.theta1), given.rt * np.cos(given.theta1))
    most = max(1.0, measured_r.max())
    for theta, vn in ((2, 0.1), (15, 2), (45, 9), (88, 30)):
        state = blocks(2000, theta, vn)
        v2 = MODEL.rebound(state, rng=rng, measured=given).velocity
        assert (norm(v2) <= norm(state.velocity) * most * (1 + 1e-12)).all()


def test_the_plain_function_is_the_compiled_one():
    given, rng = table(30, spread=0.5), np.random.default_rng(7)
    numbers = MODEL.numbers(None, given)
    for draws in (np.full((1, 2), np.nan), rng.random((1, 2))):
        for theta, vn in ((5, 0.02), (25, 4), (70, 20)):
            state = blocks(1, theta, vn)
            out = MODEL.rebound(state, draws=draws, measured=given)
            v, n = tuple(state.velocity[0]), tuple(state.normal[0])
            named = MODEL.parameter_type(*numbers[:2]), MODEL.draw_type(*draws[0])
            plain = MODEL.function(v, n, (0.0, 0.0, 0.0), 0.2, 60.0, *named, numbers[2:])
            np.testing.assert_allclose(out.velocity[0], plain[0], rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(out.angular_velocity[0], plain[1], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("vn", [400.0, 11.0])
def test_conditions_beyond_the_measured_ones_are_served_by_the_nearest(vn):
    """Far away, and where the kernel still holds one to four impacts."""
    given = table(40, spread=0.3)
    angle, speed = given.bandwidths
    d = np.hypot(np.log(given.theta1 / np.radians(20)) / angle, np.log(given.vn1 / vn) / speed)
    assert (d < np.sqrt(6)).sum() in ((0,) if vn == 400.0 else (1, 2, 3, 4))
    assert given.beyond(np.radians([20.0]), np.array([vn])).all()
    state = blocks(20_000, 20.0, vn)
    rn = outcomes(state, MODEL.rebound(state, rng=np.random.default_rng(8), measured=given).velocity)[0]
    counts = np.bincount(np.abs(rn[:, None] - given.rn).argmin(axis=1), minlength=40)
    share = np.maximum(0, 1 - (d / (1 + np.sort(d)[4])) ** 2)
    share /= share.sum()
    assert 5 <= (share > 0).sum() < 25
    assert given.vn1[share > 0].mean() > given.vn1.mean() + np.std(given.vn1) / 2
    assert (np.abs(counts - 20_000 * share) < 4.5 * np.sqrt(20_000 * share * (1 - share)) + 1).all()


def test_conditions_beyond_the_measured_ones_are_told():
    given = table(40, spread=0.3)
    assert not given.beyond(np.radians([25.0]), np.array([4.0])).any()
    far = np.radians([25.0, 0.3, 25.0]), np.array([0.05, 4.0, 400.0])
    assert given.beyond(*far).all()
    assert not given.beyond(*far, 10.0, 10.0)[:2].any(), "wider bandwidths reach further"


def test_a_block_rolls_afterwards():
    """Without slip where it touches, v_T + r n × ω = 0, also where its speed was limited, and without spin about n."""
    given, rng = table(60, spread=0.4), np.random.default_rng(9)
    for theta, vn in ((25, 4), (80, 20)):
        state = blocks(500, theta, vn, normal=(0.1, 0.3, 0.9))
        out = MODEL.rebound(state, rng=rng, measured=replace(given, rn=given.rn * 3))
        tangential = out.velocity - dot(out.velocity, state.normal)[:, None] * state.normal
        slip = tangential + 0.2 * cross(state.normal, out.angular_velocity)
        assert norm(tangential).min() > 0.1
        assert norm(slip).max() < 1e-9
        assert np.abs(dot(out.angular_velocity, state.normal)).max() < 1e-9


# --- In compare ------------------------------------------------------------------------------------------------------


def field(trajectories: int, each: int, seed: int = 0, law=None) -> Impacts:
    """Impacts on planes, whose rebounds follow `law(theta1_deg, rng) -> (R_N, R_T)`."""
    rng = np.random.default_rng(seed)
    n = trajectories * each
    normal = unit(np.stack([rng.normal(0, 0.3, n), rng.normal(0, 0.3, n), np.ones(n)], axis=1))
    theta, speed = np.radians(rng.uniform(8, 50, n)), rng.uniform(4, 15, n)
    ahead = unit(cross(normal, unit(rng.normal(size=(n, 3)))))
    v1 = speed[:, None] * (np.cos(theta)[:, None] * ahead - np.sin(theta)[:, None] * normal)
    rn, rt = law(np.degrees(theta), rng) if law else (rng.uniform(0.3, 0.9, n), rng.uniform(0.4, 0.9, n))
    side = np.radians(rng.normal(0, 12, n))
    turned = np.cos(side)[:, None] * ahead + np.sin(side)[:, None] * cross(normal, ahead)
    v2 = (rt * speed * np.cos(theta))[:, None] * turned + (rn * speed * np.sin(theta))[:, None] * normal
    seen, none = apparent(v1, v2, normal), np.full(n, np.nan)
    names = ("vn1", "vt1", "vn2", "vt2", "rn", "rt", "r", "theta1", "theta_dev")
    return Impacts(
        site=np.full(n, "here"),
        trajectory=np.repeat([f"b{i:02}" for i in range(trajectories)], each),
        impact=np.tile(np.arange(1, each + 1), trajectories),
        time_s=np.arange(n, dtype=float),
        position=np.zeros((n, 3)),
        normal=normal,
        normal_radius_m=none,
        normal_spread=none,
        v1=v1,
        v2=v2,
        **{name: getattr(seen, name) for name in names},
        diameter_m=np.full(n, 0.4),
        mass_kg=np.full(n, 80.0),
        flags={name: np.zeros(n, dtype=bool) for name in FLAGS},
        angular_velocity=np.full((n, 3), np.nan),
        kinetic1_j=none,
        kinetic2_j=none,
        rotational1_j=none,
        rotational2_j=none,
        bounce_height_m=none,
        chord_height_m=none,
    )


def test_a_trajectory_is_not_predicted_from_its_own_impacts():
    """One trajectory of absurd rebounds: its prediction is what the others do, and theirs knows it."""
    impacts = field(6, 8, seed=1)
    absurd = impacts.trajectory == "b03"
    v2 = np.where(absurd[:, None], 30.0 * impacts.normal, impacts.v2)
    seen = apparent(impacts.v1, v2, impacts.normal)
    changed = replace(
        impacts, v2=v2, **{name: getattr(seen, name) for name in ("vn2", "vt2", "rn", "rt", "r", "theta_dev")}
    )
    before = compare(impacts, ["observed"], replicates=20)
    after = compare(changed, ["observed"], replicates=20)
    own = before.trajectory == "b03"
    np.testing.assert_array_equal(after.v2[:, :, own], before.v2[:, :, own])
    assert not np.array_equal(after.v2[:, :, ~own], before.v2[:, :, ~own])


def test_a_database_that_holds_the_trajectory_under_another_name_does_not_help():
    impacts = field(6, 8, seed=2)
    renamed = replace(impacts, site=np.full(len(impacts), "database"), trajectory=np.char.add(impacts.trajectory, "x"))
    one = compare(impacts, ["observed"], replicates=5)
    other = compare(impacts, ["observed"], replicates=5, measured=measured_rebounds(renamed))
    np.testing.assert_array_equal(one.v2, other.v2)
    few = rows_of(impacts, np.flatnonzero((impacts.trajectory != "b03") | (impacts.impact == 4)))
    at = few.trajectory == "b03"
    others = measured_rebounds(rows_of(renamed, np.flatnonzero(impacts.trajectory != "b03")))
    whole = compare(few, ["observed"], replicates=5, measured=measured_rebounds(renamed))
    without = compare(few, ["observed"], replicates=5, measured=others)
    np.testing.assert_array_equal(whole.v2[:, :, at], without.v2[:, :, at], "nor does its impact that is not compared")


def test_pure_noise_is_not_memorised():
    """Where R_N does not depend on anything, no prediction can be better than its mean: the RMSE is its scatter."""
    impacts = field(30, 10, seed=3)
    mark = next(s for s in scores(impacts, compare(impacts, ["observed"])) if s.quantity == "rn")
    scatter = np.std(impacts.rn)
    assert scatter * 0.97 < mark.rmse < scatter * 1.15


def test_what_depends_on_the_angle_is_learnt():
    """R_N = 8/θ1 with a scatter of 0.05: the RMSE of the mean is much nearer to that than to the spread of R_N."""
    law = lambda theta, rng: (8 / theta + rng.normal(0, 0.05, theta.size), rng.uniform(0.5, 0.8, theta.size))  # noqa: E731
    impacts = field(30, 10, seed=4, law=law)
    predictions = compare(impacts, ["observed"], replicates=50)
    mark = next(s for s in scores(impacts, predictions) if s.quantity == "rn")
    assert mark.rmse < 0.5 * np.std(impacts.rn)
    assert predictions.beyond is not None
    assert predictions.beyond.mean() < 0.1
    rt = next(s for s in scores(impacts, predictions) if s.quantity == "rt")
    assert (rt.coverage50, rt.coverage90) == (pytest.approx(0.5, abs=0.1), pytest.approx(0.9, abs=0.06))


def test_flags_are_left_out_and_counted():
    impacts = field(4, 8, seed=5)
    for row, flag in enumerate(("discarded", "doubtful", "below_terrain", "gap", "departing")):
        impacts.flags[flag][row] = True
    impacts.rt[20] = np.nan
    given = measured_rebounds(impacts)
    assert len(given) == 32 - 4
    assert given.left_out == {"departing": 1, "below_terrain": 1, "discarded": 1, "without R_N and R_T": 1}


def test_too_few_impacts_are_refused():
    with pytest.raises(InputError, match="Only 9 measured impacts can be drawn from"):
        measured_rebounds(field(3, 3))
    with pytest.raises(InputError, match=r"Only 0 measured impacts .* trajectory b00, which must not be predicted"):
        compare(field(1, 20), ["observed"])
    with pytest.raises(InputError, match="observed draws from measured impacts, and there are none"):
        MODEL.numbers()
    given = measured_rebounds(field(2, 10))
    with pytest.raises(InputError, match="Only 6 measured impacts"):
        without_own(measured_rebounds(field(2, 6)), "here", "b00", np.empty(0), np.empty(0))
    assert len(without_own(given, "here", "b00", np.empty(0), np.empty(0))) == 10


# --- In the simulation -----------------------------------------------------------------------------------------------


def slope(degrees: float) -> Surface:
    line = np.arange(61) * 4.0
    x, y = np.meshgrid(line, line)
    vertices = np.column_stack([x.ravel(), y.ravel(), (-np.tan(np.radians(degrees)) * x).ravel()])
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    return Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "slope")


def thrown(n: int):
    """Blocks that meet a slope of 35° at 25° and 4 m/s along its normal, each in its place."""
    ground = make_ground(slope(35.0))
    normal = np.array([np.sin(np.radians(35.0)), 0.0, np.cos(np.radians(35.0))])
    down = np.array([normal[2], 0.0, -normal[0]])
    x = np.linspace(30, 60, n)
    feet = np.stack([x, np.linspace(60, 180, n), -np.tan(np.radians(35.0)) * x], axis=1)
    velocity = 4.0 / np.tan(np.radians(25.0)) * down - 4.0 * normal
    return ground, make_releases(feet + (0.2 + 1e-4) * normal, velocity=np.tile(velocity, (n, 1)), diameter_m=0.4)


def test_on_the_plane_it_was_measured_on_the_simulation_gives_back_the_table():
    given = table()
    ground, releases = thrown(4000)
    records = simulate(ground, releases, Settings("observed", measured=given, rolling="none")).records
    hits = np.flatnonzero(records.what == engine.IMPACT)
    first = hits[np.unique(records.run[hits], return_index=True)[1]]
    assert first.size == 4000
    seen = apparent(records.v1[first], records.v2[first], records.normal[first])
    drawn = np.abs(seen.rn[:, None] - given.rn).argmin(axis=1)
    np.testing.assert_allclose(seen.rn, given.rn[drawn], atol=1e-4)
    np.testing.assert_allclose(seen.rt, given.rt[drawn], atol=1e-4)
    counts = np.bincount(drawn, minlength=len(given))
    chi2 = ((counts - 100) ** 2 / 100).sum()
    assert chi2 < 39 + 4 * np.sqrt(2 * 39)
    assert ks_1samp(drawn + np.random.default_rng(0).random(4000), lambda x: x / 40).pvalue > 1e-3


def test_a_measured_block_that_went_on_into_the_ground_stays_on_it():
    """R_N below zero is kept as it was measured; a simulated block then moves along the ground, never below it."""
    impacts = field(4, 8, seed=7, law=lambda theta, rng: (np.full(theta.size, -0.1), np.full(theta.size, 0.8)))
    given = measured_rebounds(impacts)
    np.testing.assert_allclose(given.rn, -0.1, rtol=1e-9)
    state = blocks(20)
    v2 = MODEL.rebound(state, rng=np.random.default_rng(1), measured=given).velocity
    np.testing.assert_allclose(v2[:, 2], -0.4, rtol=1e-9)
    ground, releases = thrown(20)
    run = simulate(ground, releases, Settings("observed", measured=given, rolling="coulomb", friction=1.0))
    assert run.at_rest.all()
    assert closest_points(ground.surface, run.records.position).distance.min() > 0.2 - 1e-6


def test_the_same_bits_for_any_threads_and_in_any_company():
    given = table(80, spread=0.5)
    ground, releases = thrown(150)
    one, two, seven = (
        simulate(ground, releases, Settings("observed", measured=given, rolling="none"), threads=t) for t in (1, 2, 7)
    )
    for other in (two, seven):
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(one.records.v2, other.records.v2)
    alone = simulate(ground, releases.take(slice(0, 10)), Settings("observed", measured=given, rolling="none"))
    np.testing.assert_array_equal(alone.position, one.position[:10])


def test_the_simulation_rebounds_as_the_model_does():
    """The moments of a run put to the model itself with the simulation's random numbers: the same bits."""
    from rockfall.core.simulation.chance_kernels import fill_uniform

    given = table(80, spread=0.5)
    ground, releases = thrown(60)
    records = simulate(ground, releases, Settings("observed", measured=given, rolling="none", seed=5)).records
    hits = np.flatnonzero(records.what == engine.IMPACT)
    draws, counted = np.empty((hits.size, 2)), dict.fromkeys(range(60), 0)
    for row, hit in enumerate(hits):
        run = int(records.run[hit])
        fill_uniform(5, run, counted[run], draws[row])
        counted[run] += 1
    state = Incident(
        records.v1[hits], records.normal[hits], records.omega1[hits], np.full(hits.size, 0.2), np.full(hits.size, 1.0)
    )
    out = MODEL.rebound(state, draws=draws, measured=given)
    assert hits.size > 100
    np.testing.assert_allclose(out.velocity, records.v2[hits], rtol=1e-12, atol=1e-12)


def test_what_is_beyond_the_measured_conditions_is_said():
    given = table(80, spread=0.2)
    ground, releases = thrown(40)
    (run,) = run_models(ground, releases, [Settings("observed", measured=given, rolling="none")])
    said = [remark.text for remark in remarks_of([run])]
    assert any("observed draws from 80 measured impacts" in text for text in said)
    records = run.records
    hits = records.what == engine.IMPACT
    seen = apparent(records.v1[hits], records.v2[hits], records.normal[hits])
    count = int(given.beyond(seen.theta1, seen.vn1).sum())
    assert 0 < count < hits.sum()
    assert any(f"{count} of {hits.sum()} impacts looked at" in text for text in said)
    bare = run_models(ground, releases, [Settings("observed", measured=given, rolling="none")], record="ends")
    assert any("No impacts were recorded" in remark.text for remark in remarks_of(bare))


def test_without_measured_impacts_there_is_no_simulation():
    ground, releases = thrown(2)
    with pytest.raises(InputError, match="observed draws from measured impacts, and there are none"):
        simulate(ground, releases, Settings("observed"))


# --- On the command line ---------------------------------------------------------------------------------------------


def test_simulate_and_compare_draw_from_a_table(tmp_path, capsys):
    write_impacts(field(6, 8, seed=1), tmp_path / "impacts.csv")
    write_ply(slope(35.0), tmp_path / "slope.ply")
    (tmp_path / "releases.csv").write_text("x_m,y_m,vx_mps,vz_mps\n30,100,5,-6\n40,120,6,-5\n", encoding="utf-8")
    asked = ["simulate", str(tmp_path / "releases.csv"), "--terrain", str(tmp_path / "slope.ply"), "--rolling", "none"]
    asked += ["--model", "observed", "--number", "3"]
    drawn = ["--observed", str(tmp_path / "impacts.csv")]
    assert main([*asked, *drawn, "--out", str(tmp_path / "runs")]) == 0
    assert "observed draws from 48 measured impacts" in capsys.readouterr().out
    summary = json.loads((tmp_path / "runs" / "summary.json").read_text(encoding="utf-8"))
    assert summary["inputs"]["observed"]["file"] == "impacts.csv"
    assert summary["models"]["observed"]["measured_impacts"] == 48
    assert main([*asked, "--out", str(tmp_path / "none")]) == 1
    assert "there are none. Give the site's impacts.csv, or a merged one: --observed" in capsys.readouterr().err
    assert main([*asked, "--out", str(tmp_path / "no"), "--observed", str(tmp_path / "nothing.csv")]) == 1
    assert "nothing.csv" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()

    compared = ["compare", str(tmp_path / "impacts.csv"), "--tables-only", "--model"]
    assert main([*compared, "observed", "--out", str(tmp_path / "own")]) == 0
    assert "observed draws from 48 measured impacts" in capsys.readouterr().out
    assert main([*compared, "observed", *drawn, "--out", str(tmp_path / "given")]) == 0
    for name in ("predictions.csv", "scores.csv"):
        assert (tmp_path / "own" / name).read_bytes() == (tmp_path / "given" / name).read_bytes()
    assert main([*compared, "noel_2017", *drawn, "--out", str(tmp_path / "idle")]) == 1
    assert "which no model draws from. Add --model observed" in capsys.readouterr().err


def test_what_is_measured_is_not_fitted():
    impacts = field(6, 8, seed=1)
    with pytest.raises(InputError, match="observed has no coefficients to fit"):
        calibrate(impacts, "observed", ["angle_bandwidth"])
    with pytest.raises(InputError, match="observed has no coefficients to fit"):
        equivalent(impacts, "observed", {}, "noel_2017", ["rt"])
