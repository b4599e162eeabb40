# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole runs against observed ones: what is read off them, by closed forms; the tests, by what they promise."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.observed_runs import Observed, observe_runs, observe_stops
from rockfall.core.analysis.paths import Paths, observed_paths, simulated_paths
from rockfall.core.analysis.ranks import holm, rank_test, reach_test, shared_ranks
from rockfall.core.analysis.sections import (
    Axis,
    Section,
    axis_of,
    crossings,
    default_sections,
    extremes,
    impacts_per_metre,
)
from rockfall.core.analysis.whole_runs import compare_runs
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.machinery.measured import MeasuredRebounds
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct
from rockfall.core.remarks import Remark
from rockfall.core.simulation.engine import Settings, joined, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import make_releases, placed_on
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.whole_runs import ObservedRuns, compare_whole_runs, join_runs, released_as_observed
from scipy.integrate import solve_ivp
from scipy.stats import binom, kstest, rankdata

G = 9.81
EAST = Axis(np.zeros(2), np.array([1.0, 0.0]))


def paths_of(pieces, runs=None, drag=0.0, **others) -> Paths:
    """Pieces (flies, start, velocity, duration) one after the other, or grouped by `runs`."""
    k = len(pieces)
    run = np.zeros(k, dtype=np.intp) if runs is None else np.asarray(runs)
    n = int(run.max()) + 1
    flies = np.array([piece[0] for piece in pieces])
    start, velocity = (np.array([piece[i] for piece in pieces], dtype=np.float64) for i in (1, 2))
    duration = np.array([piece[3] for piece in pieces], dtype=np.float64)
    fall = np.where(flies, G, 0.0)[:, None] * [0.0, 0.0, 1.0]
    end = start + velocity * duration[:, None] - fall * duration[:, None] ** 2 / 2
    first = np.searchsorted(run, run)
    before = np.r_[0.0, np.cumsum(duration)]
    columns = {
        "name": np.array([f"B{i}" for i in range(n)]),
        "mass_kg": np.full(n, 100.0),
        "stop": np.full((n, 3), np.nan),
        "beyond": np.zeros(n, dtype=np.bool_),
        "whole": np.zeros(n, dtype=np.bool_),
        "run": run,
        "flies": flies,
        "time_s": before[:-1] - before[first],
        "duration_s": duration,
        "start": start,
        "end": end,
        "start_velocity": velocity,
        "end_velocity": velocity - fall * duration[:, None],
        "drag_per_m": np.full(k, drag),
        "impact_piece": np.arange(k - 1),
        "gravity_mps2": G,
    }
    return Paths(**(columns | others))


def rough_ground() -> Ground:
    line = np.arange(90) * 1.5
    x, y = np.meshgrid(line, line)
    z = -0.7 * np.minimum(x, 80) - 0.15 * np.maximum(x - 80, 0) + 0.3 * np.sin(x / 2.3) * np.cos(y / 3.1)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    faces = np.concatenate([lower, upper]).astype(np.int32)
    return make_ground(Surface(vertices, faces, GlobalShift(), "slope"))


@pytest.fixture(scope="module")
def ground() -> Ground:
    return rough_ground()


def fallen(ground: Ground, number: int, parameters: dict[str, object], seed: int = 0) -> Paths:
    """Runs of eight releases."""
    xy = np.column_stack([np.full(8, 5.0), 25.0 + 12.0 * np.arange(8)])
    place = placed_on(ground, xy, np.full(8, 0.4)) + np.array([0.0, 0.0, 2.0])
    names = np.array([f"B{i}" for i in range(8)])
    releases = make_releases(place, name=names, velocity=np.tile([3.0, 0.0, 0.0], (8, 1)), number=number)
    return simulated_paths(simulate(ground, releases, Settings("noel_2017", parameters, seed=seed)))


# --- what is read off ------------------------------------------------------------------------------------------------


def test_a_flight_falls_below_a_level_where_its_parabola_does() -> None:
    hop = (True, [0.0, 0.0, 10.0], [4.0, 0.0, 3.0], 1.0)
    end = 10.0 + 3.0 - G / 2
    paths = paths_of([hop, (True, [4.0, 0.0, end], [5.0, 1.0, 2.0], 1.5)])
    z = 5.0
    found = crossings(paths, Section("", level_m=z), EAST)
    t = (2.0 + np.sqrt(4.0 + 2 * G * (end - z))) / G
    assert found.crosses.all()
    assert found.passages.tolist() == [1]
    assert found.time_s == pytest.approx(1.0 + t, abs=1e-12)
    assert found.position[0] == pytest.approx([4.0 + 5.0 * t, t, z], abs=1e-12)
    assert found.velocity[0] == pytest.approx([5.0, 1.0, 2.0 - G * t], abs=1e-12)
    assert found.along_m == pytest.approx(t, abs=1e-12)  # to the left of the way, which goes east
    down = crossings(paths, Section("", drop_m=10.0 - z), EAST)
    assert down.time_s == pytest.approx(found.time_s, abs=1e-12)


def test_a_crossing_before_the_first_impact_does_not_count() -> None:
    paths = paths_of([(True, [0.0, 0.0, 10.0], [4.0, 0.0, 0.0], 1.0), (True, [4.0, 0.0, 5.0], [5.0, 0.0, 9.0], 1.0)])
    early = crossings(paths, Section("", level_m=7.0), EAST)
    assert not early.crosses.any()
    assert early.given.all()
    above = crossings(paths, Section("", level_m=11.0), EAST)
    assert above.given.all()
    never = crossings(paths, Section("", level_m=-50.0), EAST)
    assert not never.crosses.any()
    assert not never.given.any()


def test_a_screen_is_crossed_where_the_ways_meet_in_plan() -> None:
    paths = paths_of([(True, [0.0, 0.0, 9.0], [2.0, 0.0, 5.0], 1.0), (True, [2.0, 0.0, 9.0], [4.0, 3.0, 5.0], 1.0)])
    line = np.array([[4.0, -6.0], [4.0, 0.5], [4.0, 8.0]])
    found = crossings(paths, Section("", line=line), EAST)
    assert found.time_s == pytest.approx(1.5)
    assert found.along_m == pytest.approx(7.5)  # y = 1.5
    assert found.position[0] == pytest.approx([4.0, 1.5, 9.0 + 2.5 - G / 8])


@pytest.mark.parametrize("section", [Section("", level_m=1.0), Section("", line=np.array([[25.0, -9.0], [25.0, 9.0]]))])
def test_flights_with_drag_cross_where_the_equation_of_motion_says(section: Section) -> None:
    k, v0, start = 0.02, np.array([20.0, 0.0, 12.0]), np.array([10.0, 0.0, 8.0])

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        v = y[3:]
        return np.r_[v, -k * np.linalg.norm(v) * v - [0.0, 0.0, G]]

    def meets(_: float, y: np.ndarray) -> float:
        return float(y[2] - 1.0 if section.level_m is not None else y[0] - 25.0)

    way = solve_ivp(motion, (0, 3), np.r_[start, v0], rtol=1e-12, atol=1e-12, events=meets)
    hop = (True, [0.0, 0.0, 8.0], [10.0, 0.0, G / 2], 1.0)
    paths = paths_of([hop, (True, start, v0, 3.0)], drag=k)
    end = np.stack([paths.end[0], way.y[:3, -1]])
    found = crossings(replace(paths, end=end), section, EAST)
    assert found.time_s == pytest.approx(1.0 + way.t_events[0][0], abs=1e-8)
    assert found.velocity[0] == pytest.approx(way.y_events[0][0][3:], abs=1e-7)


def test_a_block_that_slows_down_on_the_ground() -> None:
    """6 m/s at first, 2 m/s at the end, 4 m later: the time is 1 s, and v² falls by 8 m²/s² a metre."""
    hop = (True, [0.0, 0.0, 5.0], [1.0, 0.0, G / 2], 1.0)
    paths = paths_of([hop, (False, [1.0, 0.0, 5.0], [6.0, 0.0, 0.0], 1.0)])
    ends = replace(
        paths,
        end=np.array([[1.0, 0.0, 5.0], [5.0, 0.0, 5.0]]),
        end_velocity=np.array([[1.0, 0.0, -G / 2], [2.0, 0.0, 0.0]]),
    )
    found = crossings(ends, Section("", line=np.array([[3.5, -1.0], [3.5, 1.0]])), EAST)
    assert found.velocity[0] == pytest.approx([4.0, 0.0, 0.0])  # 36 − 8·2.5 = 16
    assert found.time_s == pytest.approx(1.5)  # from 6 to 4 m/s at 4 m/s²


def test_impacts_per_metre_count_as_a_person_does() -> None:
    hops = [0.5, 0.05, 0.5, 0.6, 0.7]
    pieces = [(True, [sum(hops[:i]) * 4.0, 0.0, 0.0], [4.0, 0.0, G / 2 * t], t) for i, t in enumerate(hops)]
    paths = paths_of(pieces, impact_piece=np.arange(5))
    assert impacts_per_metre(paths, np.array([9]), 0.2) == pytest.approx(4 / (4 * sum(hops)))
    assert impacts_per_metre(paths, np.array([9]), 0.3) == pytest.approx(4 / (4 * sum(hops)))
    assert impacts_per_metre(paths, np.array([2]), 0.2) == pytest.approx(2 / (4 * 1.05))
    assert impacts_per_metre(paths, np.array([9]), 0.0) == pytest.approx(5 / (4 * sum(hops)))
    assert np.isnan(impacts_per_metre(paths, np.array([0]), 0.2)).all()


def test_greatest_values_on_the_stretch_that_was_seen(ground: Ground) -> None:
    """Over a plane the height of a parabola above it is greatest in its middle: g T²/8 for a hop that lands level."""
    flat = Surface(
        np.array([[-9.0, -9, 0], [99, -9, 0], [99, 99, 0], [-9, 99, 0]]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        GlobalShift(),
        "flat",
    )
    paths = paths_of([(True, [0, 0, 0], [4.0, 0, G / 2], 1.0), (True, [4.0, 0, 0], [4.0, 0, G], 2.0)], runs=[0, 0])
    whole = extremes(paths, np.array([99.0]), make_ground(flat))
    assert whole.height_max_m == pytest.approx(G * 4 / 8)
    assert whole.v_max_mps == pytest.approx(np.hypot(4.0, G))
    part = extremes(paths, np.array([6.0]), make_ground(flat))  # half a second of the second hop
    assert part.height_max_m == pytest.approx(G * 0.5 - G / 8)
    assert part.v_max_mps == pytest.approx(np.hypot(4.0, G))
    first = extremes(paths, np.array([4.0]), make_ground(flat))  # which is given, and says nothing of a model
    assert np.isnan([first.v_max_mps, first.height_max_m]).all()


def test_simulated_flights_through_air_end_where_the_simulation_says(ground: Ground) -> None:
    place = np.array([[10.0, 60.0, 20.0]])
    releases = make_releases(place, velocity=np.array([[15.0, 0.0, 5.0]]), diameter_m=0.4, number=3)
    paths = simulated_paths(simulate(ground, releases, Settings("noel_2017", drag=Drag())))
    flights = np.flatnonzero(paths.flies)
    end, _ = paths.states(flights, paths.duration_s[flights])
    assert np.abs(end - paths.end[flights]).max() < 5e-3  # the simulation flies chains of parabolas
    still, _ = replace(paths, drag_per_m=0 * paths.drag_per_m).states(flights[:1], paths.duration_s[flights[:1]])
    assert np.abs(still - paths.end[flights[:1]]).max() > 0.05


def observed_table():
    """B0 falls, bounces and stops; B1 is seen from an impact on, and is cut by a discarded pick."""
    return make_picks(
        ["B0"] * 5 + ["B1"] * 5,
        [0.0, 1.0, 2.0, 3.0, 4.0, 10.0, 11.0, 12.0, 13.0, 14.0],
        [[0, 0, 20], [3, 0, 15], [7, 0, 10], [10, 0, 7], [11, 0, 7], *([x, 5, 15 - x] for x in (0, 2, 4, 6, 8))],
        kind=["release", "impact", "impact", "contact", "stop", *(["impact"] * 5)],
        status=[*(["ok"] * 8), "discarded", "ok"],
    )


def test_observed_paths_are_the_first_chains() -> None:
    paths = observed_paths(reconstruct(observed_table()))
    assert paths.name.tolist() == ["B0", "B1"]
    assert paths.run.tolist() == [0, 0, 0, 0, 1, 1]
    assert paths.flies.tolist() == [True, True, False, False, True, True]
    assert paths.time_s.tolist() == [0, 1, 2, 3, 0, 1]
    assert paths.impact_piece.tolist() == [0, 1, 4, 5]
    assert paths.stop[0].tolist() == [11, 0, 7]
    assert np.isnan(paths.stop[1]).all()
    assert paths.whole.tolist() == [True, False]
    assert paths.length_m == pytest.approx([11.0, 4.0])
    back = paths.take(np.array([1, 0, 1]))
    assert back.name.tolist() == ["B1", "B0", "B1"]
    assert back.impact_piece.tolist() == [0, 1, 2, 3, 6, 7]
    assert back.start[2:6].tolist() == paths.start[:4].tolist()


def test_no_flight_is_refused(ground: Ground) -> None:
    picks = make_picks(["B0"], [0.0], [[1.0, 1.0, 0.0]])
    with pytest.raises(InputError, match="no flight"):
        observe_runs(reconstruct(picks), ground)


def test_simulated_paths_are_joined_and_end_where_the_simulation_does(ground: Ground) -> None:
    xy = np.column_stack([np.full(6, 5.0), 30.0 + 10 * np.arange(6)])
    place = placed_on(ground, xy, np.full(6, 0.4)) + np.array([0.0, 0.0, 2.0])
    releases = make_releases(place, diameter_m=0.4, number=5)
    run = simulate(ground, releases, Settings("noel_2017"))
    paths = simulated_paths(run)
    last = paths.first_piece[1:] - 1
    assert paths.end[last] == pytest.approx(run.position - [0, 0, 0.2], abs=1e-12)
    assert (paths.time_s + paths.duration_s)[last] == pytest.approx(run.time_s, abs=1e-9)
    assert np.bincount(paths.run[paths.impact_piece], minlength=len(paths)).tolist() == run.impacts.tolist()
    place, velocity = paths.states(np.arange(paths.run.size), paths.duration_s)
    assert np.abs(place - paths.end).max() < 1e-6
    flying = paths.flies
    assert np.abs(velocity - paths.end_velocity)[flying].max() < 1e-6
    # The run crosses a level once the height of what is sampled densely along it falls below.
    found = crossings(paths, Section("", level_m=-30.0), axis_of(paths))
    assert found.crosses.all()
    for i in range(len(paths)):
        own = np.flatnonzero(paths.run == i)
        t = np.linspace(0, 1, 50)[None] * paths.duration_s[own, None]
        z = paths.states(np.repeat(own, 50), t.ravel())[0][:, 2]
        when = (paths.time_s[own, None] + t).ravel()
        below = np.flatnonzero(z < -30.0)[0]
        assert when[below - 1] - 1e-9 <= found.time_s[i] <= when[below] + 1e-9


# --- the tests -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("whole_numbers", [False, True])
def test_ranks_reject_at_their_rate_where_the_simulation_is_right(whole_numbers: bool) -> None:
    rng = np.random.default_rng(5)

    def drawn(scale: float, size: int) -> np.ndarray:
        values = scale * rng.standard_normal(size)
        return np.round(values) if whole_numbers else values

    p = []
    for _ in range(300):
        scales = rng.uniform(0.5, 5.0, 7)
        sizes = rng.integers(19, 120, 7)
        observed = np.array([drawn(scale, 1)[0] for scale in scales])
        p.append(rank_test(observed, [drawn(*each) for each in zip(scales, sizes, strict=True)], seed=3).p)
    assert kstest(p, "uniform").pvalue > 0.01
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09


def test_equal_values_share_their_place() -> None:
    """Above ten of twenty values and equal to the other nine and itself: from 0.5 to 1."""
    found = rank_test(np.array([1.0]), [np.repeat([0.0, 1.0], [10, 9])])
    assert found.place == pytest.approx([0.75])


def test_equal_values_share_the_mean_of_their_ranks() -> None:
    values = np.random.default_rng(6).integers(0, 30, 100).astype(np.float64)
    np.testing.assert_array_equal(shared_ranks(values), rankdata(values))


def test_ranks_see_a_shift_and_a_wrong_scatter() -> None:
    rng = np.random.default_rng(6)
    simulated = [rng.standard_normal(100) for _ in range(15)]
    assert rank_test(rng.standard_normal(15) + 1.5, simulated).p < 0.001
    assert rank_test(4.0 * rng.standard_normal(15), simulated).p < 0.01
    assert rank_test(0.02 * rng.standard_normal(15), simulated).p < 0.03
    few = rank_test(np.full(4, 9.0), simulated[:4])
    assert np.isnan(few.p)
    assert few.n == 4
    small = rank_test(np.full(15, 9.0), [each[:18] for each in simulated])
    assert small.n == 0


def test_reach_is_the_binomial_where_all_are_alike() -> None:
    reached = np.arange(12) < 9
    assert reach_test(reached, ~reached, np.full(12, 0.4)) == pytest.approx(2 * binom.sf(8, 12, 0.4))
    # With three of which nothing is known: at least 9 of 15, at most 12 of 15.
    more = np.r_[reached, [False] * 3]
    stayed = np.r_[~reached, [False] * 3]
    expected = 2 * min(binom.sf(8, 15, 0.4), binom.cdf(12, 15, 0.4))
    assert reach_test(more, stayed, np.full(15, 0.4)) == pytest.approx(expected)
    assert reach_test(more, stayed, np.full(15, 0.7)) == 1.0


def test_holm() -> None:
    """The example of Holm 1979, in numbers: 4 · 0.005, 3 · 0.01, 2 · 0.03, and not less for what follows."""
    assert holm(np.array([0.01, np.nan, 0.04, 0.03, 0.005])) == pytest.approx(
        [0.03, np.nan, 0.06, 0.06, 0.02], nan_ok=True
    )


def test_observed_runs_that_come_from_the_simulation_are_rejected_at_the_rate_that_is_said(ground: Ground) -> None:
    """One run of each release is drawn as the observed one; the whole comparison then has nothing to find."""
    runs = fallen(ground, 41, {})
    rng = np.random.default_rng(8)
    sections = (Section("half", level_m=-25.0), Section("screen", line=np.array([[60.0, 0.0], [60.0, 130.0]])))
    p: dict[tuple[str, str], list[float]] = {}
    differ = []
    for draw in range(40):
        chosen = np.arange(8) * 41 + rng.integers(41, size=8)
        others = np.setdiff1d(np.arange(8 * 41), chosen)
        observed = Observed(runs.take(chosen), np.zeros(8, dtype=np.bool_))
        found = compare_runs(observed, {"itself": runs.take(others)}, ground, sections, seed=draw)
        for one in found.compared:
            p.setdefault((one.section, one.quantity.name), []).append(one.p)
        differ.append(any(one.differs for one in found.compared))
    for key in (
        ("half", "speed_mps"),
        ("screen", "height_m"),
        ("", "impacts_per_m"),
        ("", "v_max_mps"),
        ("", "runout_m"),
    ):
        assert kstest(p[key], "uniform").pvalue > 0.001, key
    assert np.mean(differ) < 0.2  # 5 % is said, of 40


def test_another_law_is_found_out(ground: Ground) -> None:
    """Observed runs of a slope on which blocks keep more of their speed."""
    observed = Observed(fallen(ground, 1, {"rt": 0.9}, seed=9), np.zeros(8, dtype=np.bool_))
    simulated = {"noel_2017": fallen(ground, 40, {"rt": 0.6})}
    found = compare_runs(observed, simulated, ground, default_sections(observed.paths, 5))
    speed = found.find("noel_2017", "", "v_max_mps")
    assert speed.differs
    assert speed.p_holm >= speed.p
    assert np.median(speed.test.place) > 0.8
    assert "differs" in speed.verdict
    assert found.find("noel_2017", found.sections[0].name, "kinetic_J").verdict == "tested as speed"


# --- from picks to the comparison ------------------------------------------------------------------------------------


def test_blocks_are_released_as_they_were_observed(ground: Ground) -> None:
    z = [-0.7 * x for x in (10.0, 14.0, 19.0)]
    rows = [[10.0, 40.0, z[0]], [14.0, 40.0, z[1]], [19.0, 40.0, z[2]]]
    picks = make_picks(
        ["A"] * 3 + ["B"] * 3,
        [0.0, 0.7, 1.4] * 2,
        rows + [[x, y + 20, h] for x, y, h in rows],
        kind=["release", "impact", "impact", "impact", "impact", "impact"],
        sigma_position_m=[0.05] * 6,
        sigma_time_s=[0.01] * 6,
    )
    made = reconstruct(picks, block=Block(0.6, 0.6, 0.6))
    observed = observe_runs(made, ground, draws=16)
    assert observed.from_impact.tolist() == [False, True]
    releases = released_as_observed(ground, observed, made, number=32)
    assert releases.name.tolist() == ["A"] * 32 + ["B"] * 32
    assert ground.distance(releases.position).min() >= 0.3 - 1e-9
    assert releases.mass_kg == pytest.approx(Block(0.6, 0.6, 0.6).mass_kg)
    first = observed.paths.first_piece[:-1]
    assert releases.velocity[:32].mean(axis=0) == pytest.approx(observed.paths.start_velocity[first[0]], abs=0.1)
    assert 0.02 < releases.velocity[:32, 0].std() < 0.3  # √2 · 0.05 m in 0.7 s, and the time
    assert (releases.angular_velocity[:32] == 0).all()
    speed = np.linalg.norm(releases.velocity[32:], axis=1)
    assert (np.linalg.norm(releases.angular_velocity[32:], axis=1) <= speed / 0.3 + 1e-9).all()
    assert (releases.angular_velocity[32:, 1] > 0).all()  # rolls to the east
    with pytest.raises(InputError, match="0 blocks"):
        released_as_observed(ground, observed, made, number=0)
    done = compare_whole_runs(ground, observed, releases, [Settings("noel_2017")])
    tested = [one for one in done.comparison.compared if one.quantity.tested]
    assert all(one.verdict.startswith("too few observed to tell") for one in tested)
    assert done.comparison.find("noel_2017", "", "v_max_mps").n == 2
    with pytest.raises(InputError, match="trajectory B: No block is released"):
        compare_whole_runs(ground, observed, releases.take(slice(0, 32)), [Settings("noel_2017")])


def test_a_run_is_never_drawn_from_its_own_impacts(ground: Ground) -> None:
    """Another table for its own trajectory changes nothing of a run, and the runs of the others."""
    rng = np.random.default_rng(3)
    k = 14
    names = np.repeat([f"B{i}" for i in range(3)], k)
    rn = rng.uniform(0.2, 0.8, 3 * k)

    angle, speed, rt = rng.uniform(0.3, 1.2, 3 * k), rng.uniform(1.0, 9.0, 3 * k), rng.uniform(0.5, 0.9, 3 * k)

    def table(rebounds: np.ndarray) -> MeasuredRebounds:
        return MeasuredRebounds(
            np.full(3 * k, "site"), names, angle, speed, rebounds, rt, np.full(3 * k, 0.1), np.ones(3 * k)
        )

    xy = np.column_stack([np.full(3, 5.0), 30.0 + 20 * np.arange(3)])
    place = placed_on(ground, xy, np.full(3, 0.4)) + np.array([0.0, 0.0, 2.0])
    releases = make_releases(place, name=np.array(["B0", "B1", "B2"]), diameter_m=0.4, number=4)
    only = observe_stops(np.array(["B0", "B1", "B2"]), place, place + np.array([30.0, 0.0, -20.0]), np.full(3, 90.0))
    other = np.where(names == "B1", 0.9 * rn, rn)
    first, second = (
        compare_whole_runs(ground, only, releases, [Settings("observed", measured=table(each))]).simulations[0]
        for each in (rn, other)
    )
    same = [np.array_equal(first.position[i : i + 4], second.position[i : i + 4]) for i in (0, 4, 8)]
    assert same == [False, True, False]
    assert first.releases is releases
    assert np.unique(first.records.run).tolist() == list(range(12))


def test_parts_of_a_simulation_are_joined_to_the_whole(ground: Ground) -> None:
    xy = np.column_stack([np.full(3, 5.0), 30.0 + 20 * np.arange(3)])
    releases = make_releases(
        placed_on(ground, xy, np.full(3, 0.4)) + np.array([0.0, 0.0, 2.0]), diameter_m=0.4, number=3
    )
    whole = simulate(ground, releases, Settings("noel_2017"))
    parts = [simulate(ground, releases.take(slice(i, i + 3)), whole.settings, first_run=i) for i in (0, 3, 6)]
    again = joined(parts, releases)
    for name in ("end", "time_s", "position", "impacts"):
        assert np.array_equal(getattr(again, name), getattr(whole, name))
    for name in ("run", "what", "time_s", "v2", "face"):
        assert np.array_equal(getattr(again.records, name), getattr(whole.records, name))
    assert again.wanted == 9


def test_errors_of_picks_come_through(ground: Ground) -> None:
    """Half-way between two picks whose times have σ, and since a third: σ √(1/4 + 1/4 + 1). Of a distance: σ √2."""
    z = [-0.7 * x + 0.2 for x in (10.0, 16.0, 22.0, 26.0)]
    rows = [[x, 40.0, h] for x, h in zip((10.0, 16.0, 22.0, 26.0), z, strict=True)]
    kind = ["release", "impact", "impact", "stop"]
    line = (Section("screen", line=np.array([[19.0, 0.0], [19.0, 90.0]])),)
    runs = {"x": paths_of([(True, [0, 0, 0], [1.0, 0, 1.0], 1.0)], name=np.array(["A"]))}
    for sigma, key, expected in (
        ({"sigma_time_s": [0.01] * 4}, ("screen", "time_s"), 0.01 * np.sqrt(1.5)),
        ({"sigma_position_m": [0.05] * 4}, ("", "runout_m"), 0.05 * np.sqrt(2)),
    ):
        made = reconstruct(make_picks(["A"] * 4, [0.0, 1.0, 2.0, 3.0], rows, kind=kind, **sigma))
        found = compare_runs(observe_runs(made, ground, draws=400), runs, ground, line)
        assert found.find("x", *key).sigma == pytest.approx([expected], rel=0.15)


def test_what_was_observed_with_errors_is_compared_with_what_has_them_too(ground: Ground) -> None:
    """Simulated stops without any scatter: nothing but the errors tells the observed ones from them."""
    rng = np.random.default_rng(4)
    names = np.array([f"B{i}" for i in range(12)])
    start = np.column_stack([np.full(12, 5.0), 20.0 + 5 * np.arange(12), np.full(12, 0.0)])
    true = start + np.array([40.0, 0.0, -25.0])
    simulated = observe_stops(np.repeat(names, 40), np.repeat(start, 40, 0), np.repeat(true, 40, 0), np.ones(480)).paths

    def seen() -> np.ndarray:
        return true + 0.5 * rng.standard_normal((12, 1)) * [1.0, 0.0, 0.0]

    exact = observe_stops(names, start, seen(), np.ones(12))
    with_errors = replace(exact, moved=tuple(replace(exact.paths, stop=seen()) for _ in range(64)))
    without, with_them = (
        compare_runs(one, {"x": simulated}, ground, ()).find("x", "", "runout_m") for one in (exact, with_errors)
    )
    assert without.p < 0.001
    assert with_them.p > 0.05
    assert with_them.sigma == pytest.approx(np.full(12, 0.5), rel=0.4)


def test_stops_without_motion(ground: Ground) -> None:
    """Of runs of which only start and stop are known, the stops are compared and nothing else."""
    runs = fallen(ground, 40, {})
    first = runs.first_piece[:-1]
    one = np.arange(8) * 40
    shorter = runs.start[first[one]] + 0.3 * (runs.stop[one] - runs.start[first[one]])
    observed = observe_stops(runs.name[one], runs.start[first[one]], shorter, np.full(8, 90.0))
    found = compare_runs(observed, {"noel_2017": runs}, ground, (), axis=axis_of(runs))
    assert {name for name in ("runout_m", "stop_aside_m") if found.find("noel_2017", "", name).n == 8} == {
        "runout_m",
        "stop_aside_m",
    }
    assert found.find("noel_2017", "", "v_max_mps").n == 0
    runout = found.find("noel_2017", "", "runout_m")
    assert runout.observed == pytest.approx(np.hypot(*(shorter - runs.start[first[one]])[:, :2].T))
    assert runout.differs
    assert runout.test.place.max() < 0.05


def test_remarks_on_the_runs_of_several_sources_say_of_which_they_are() -> None:
    def of(*names: str) -> ObservedRuns:
        place = np.arange(3.0 * len(names)).reshape(-1, 3)
        released = make_releases(place, name=np.array(names), number=2)
        said = Remark(f"{len(names)} of {len(names)} trajectories begin with an impact.")
        return ObservedRuns(
            observe_stops(np.array(names), place, place, np.ones(len(names))), released.with_remarks(said)
        )

    parts = of("A1", "A2", "A3"), of("B1")
    assert parts[0] is join_runs(parts[:1])
    assert [str(one) for one in join_runs(parts).releases.remarks] == [
        "Of A1 and 2 others: 3 of 3 trajectories begin with an impact.",
        "Of B1: 1 of 1 trajectories begin with an impact.",
    ]
