# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis: parameters that runs were made with are found again, and what the runs cannot tell is said."""

from dataclasses import replace

import numpy as np
import pytest
from rockfall.core.analysis.back_analysis import BackAnalysis
from rockfall.core.analysis.completeness import (
    ShortRuns,
    completeness_remarks,
    find_short_runs,
    names_that_fell,
    parse_completeness,
)
from rockfall.core.analysis.fitting import Axis
from rockfall.core.analysis.held_out import Prediction
from rockfall.core.analysis.observed_runs import Observed, observe_stops
from rockfall.core.analysis.paths import Paths, simulated_paths
from rockfall.core.analysis.posterior_checks import FLAT, PredictiveCheck, posterior_remarks
from rockfall.core.analysis.priors import Prior, laws_in, make_priors
from rockfall.core.analysis.run_measures import Limits, measure_rebounds
from rockfall.core.analysis.run_statistics import (
    LEAST_ERROR,
    ObservedValues,
    Scales,
    crps,
    find_scales,
    plain_means,
    statistics_of,
    tails,
    with_errors,
)
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models.registry import find_model
from rockfall.core.progress import CancelledError
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases, placed_on
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow.back_analysis import back_analyse, observe_values, posterior_settings
from scipy.stats import norm

MODEL = "pfeiffer_bowen_1989"
TRUTH = {"rn": 0.45, "rt": 0.78}
BLOCKS = 10


@pytest.fixture(scope="module")
def ground() -> Ground:
    line = np.arange(70) * 2.0
    x, y = np.meshgrid(line, line)
    z = -0.75 * np.minimum(x, 80) - 0.1 * np.maximum(x - 80, 0) + 0.3 * np.sin(x / 2.3) * np.cos(y / 3.1)
    i = np.arange(line.size**2).reshape(line.size, -1)
    lower = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:]], axis=-1).reshape(-1, 3)
    upper = np.stack([i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1).reshape(-1, 3)
    vertices = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return make_ground(Surface(vertices, np.concatenate([lower, upper]).astype(np.int32), GlobalShift(), "slope"))


@pytest.fixture(scope="module")
def releases(ground: Ground) -> Releases:
    xy = np.column_stack([np.full(BLOCKS, 5.0), 25.0 + 9.0 * np.arange(BLOCKS)])
    place = placed_on(ground, xy, np.full(BLOCKS, 0.4)) + np.array([0.0, 0.0, 2.0])
    names = np.array([f"B{i}" for i in range(BLOCKS)])
    return make_releases(place, name=names, velocity=np.tile([3.0, 0.0, 0.0], (BLOCKS, 1)))


def observed_with(ground: Ground, releases: Releases, settings: Settings) -> Observed:
    paths = simulated_paths(simulate(ground, releases, settings))
    return Observed(paths, np.zeros(len(paths), dtype=np.bool_))


@pytest.fixture(scope="module")
def analysis(ground: Ground, releases: Releases) -> BackAnalysis:
    priors = make_priors(find_model(MODEL), ["rn", "rt"], {})
    observed = observed_with(ground, releases, Settings(MODEL, TRUTH, seed=5))
    return back_analyse(ground, observed, releases, Settings(MODEL), priors, sets=400, rounds=2)


def test_known_parameters_are_found_again(analysis: BackAnalysis) -> None:
    for one in analysis.estimates:
        assert one.low < TRUTH[one.name] < one.high
        assert one.kept < 0.5
        assert one.low < one.half_low < one.median < one.half_high < one.high
        assert one.is_determined
    assert all(check.fits for check in analysis.checks)
    assert analysis.runs == BLOCKS * (2 * 400 + 2 * 500)
    assert analysis.draws.names == ("rn", "rt")
    medians, friction = posterior_settings(analysis)
    assert medians == pytest.approx({one.name: one.median for one in analysis.estimates})
    assert friction == Settings.friction


def test_fitted_parameters_predict_runs_that_were_held_out(analysis: BackAnalysis) -> None:
    told = analysis.prediction
    assert sorted(name for fold in told.folds for name in fold.names) == [f"B{i}" for i in range(BLOCKS)]
    assert told.values == sum(fold.values for fold in told.folds)
    assert told.score("fitted") < told.score("prior")
    assert 0.8 < sum(fold.inside for fold in told.folds) / told.values <= 1.0


def test_what_the_observed_runs_alone_predict_stands_beside_the_verdict(analysis: BackAnalysis) -> None:
    """By hand: the CRPS of each run-out by those of the other four fifths."""
    told = analysis.prediction
    run_out = next(one for one in told.quantities if one.quantity == "runout_m")
    values = analysis.observed.value[:, analysis.observed.keys.index(("", "runout_m"))]
    by_name = dict(zip(analysis.observed.names.tolist(), values.tolist(), strict=True))
    scores = []
    for fold in told.folds:
        others = np.array([value for name, value in by_name.items() if name not in fold.names])
        for name in fold.names:
            apart = np.abs(others[:, None] - others).mean()
            scores.append(np.abs(others - by_name[name]).mean() - apart / 2)
    assert run_out.observed_alone == pytest.approx(np.mean(scores))
    assert told.score("observed_alone") == pytest.approx(1.0)
    verdict = next(str(one) for one in analysis.remarks if one.about == "fit")
    assert f"run-out {run_out.observed_alone:.3g} without it, {run_out.fitted:.3g} m with" in verdict


def test_a_model_that_predicts_worse_than_the_observed_runs_alone_is_told_to(
    ground: Ground, releases: Releases
) -> None:
    """All blocks stop at one place, which no model of chance can know; the runs themselves do."""
    stops = np.column_stack([np.full(BLOCKS, 92.0), releases.position[:, 1], np.full(BLOCKS, -62.0)])
    observed = observe_stops(releases.name, releases.position, stops, releases.mass_kg)
    priors = make_priors(find_model(MODEL), ["friction"], {"friction": "0.2..0.8"})
    found = back_analyse(ground, observed, releases, Settings(MODEL, TRUTH), priors, sets=200, rounds=1)
    assert not found.prediction.helps
    assert found.prediction.is_clear
    verdict = next(one for one in found.remarks if one.about == "fit")
    assert verdict.severity == "warning"
    assert "The other observed runs alone predict the runs held out better than CRSP" in str(verdict)


def test_a_verdict_is_never_without_what_the_observed_runs_alone_predict() -> None:
    nothing = Prediction((), (), np.nan, np.nan, 0)
    check = PredictiveCheck("run-out", "m", "", "runout_m", 9, 50.0, 40.0, 50.0, 60.0, 1.0, 1.0, 1.0, 0.9, 0.9)
    for checks in ([check], [replace(check, p_holm=0.01)]):
        (said,) = (one for one in posterior_remarks("M", 9, [], checks, nothing, 500.0) if one.about == "fit")
        assert "how well it predicts is not known" in str(said)
        assert said.severity == "warning"


# --- whether the observed runs are all that fell ---------------------------------------------------------------------

FALLS, SEEN = 48, 16
FRICTION = 0.5


@pytest.fixture(scope="module")
def inventory(ground: Ground) -> tuple[Releases, Paths, np.ndarray]:
    """Blocks that fell with a known friction, and the longest first."""
    place = placed_on(
        ground, np.column_stack([np.full(FALLS, 5.0), 6.0 + 2.6 * np.arange(FALLS)]), np.full(FALLS, 0.4)
    ) + np.array([0.0, 0.0, 2.0])
    names = np.array([f"B{i}" for i in range(FALLS)])
    fell = make_releases(place, name=names, velocity=np.tile([3.0, 0.0, 0.0], (FALLS, 1)))
    paths = simulated_paths(simulate(ground, fell, Settings("stevens_1998", friction=FRICTION, seed=1003)))
    assert not paths.beyond.any()
    run_out = np.hypot(*(paths.stop - paths.start[paths.first_piece[:-1]])[:, :2].T)
    return fell, paths, np.argsort(-run_out)


def friction_of(
    ground: Ground, inventory: tuple[Releases, Paths, np.ndarray], runs: int, stated: str, releases: Releases
) -> BackAnalysis:
    _, paths, longest = inventory
    rows = longest[:runs]
    start = paths.start[paths.first_piece[:-1]]
    observed = observe_stops(paths.name[rows], start[rows], paths.stop[rows], paths.mass_kg[rows])
    priors = make_priors(find_model("stevens_1998"), ["friction"], {})
    return back_analyse(
        ground, observed, releases, Settings("stevens_1998", seed=3), priors,
        sets=250, rounds=2, completeness=parse_completeness(stated),
    )  # fmt: skip


def test_the_longest_of_a_number_of_falls_give_the_friction_of_all(ground: Ground, inventory) -> None:
    """Stated as the longest, they give the friction; not stated, what they would give then is said, and is more."""
    fell, _, longest = inventory
    third = fell.take(np.sort(longest[:SEEN]))
    bare = friction_of(ground, inventory, SEEN, "", third)
    told = [one for one in bare.remarks if one.about == "completeness"]
    assert [one.severity in ("advice", "warning") for one in told] == [True]
    assert "It is not stated whether all falls were recorded" in str(told[0])
    assert bare.if_longest is not None
    assert bare.if_longest.median[0] > bare.estimates[0].median
    assert f"friction {bare.if_longest.median[0]:.3g}" in str(told[0])
    for stated, releases in ((f"longest:{FALLS}", third), ("longest", fell)):
        found = friction_of(ground, inventory, SEEN, stated, releases)
        (one,) = found.estimates
        assert one.median == pytest.approx(FRICTION, abs=0.01)
        assert found.falls == FALLS
        assert found.runs == FALLS * (2 * 250 + 1000)
        assert f"longest of {FALLS} that fall" in " ".join(map(str, found.remarks))


def test_missing_short_runs_are_seen_where_they_would_be_there() -> None:
    """A normal law of run-outs, and the longest third of three times as many: a closed-form truncation."""
    rng = np.random.default_rng(8)
    simulated = rng.normal(100.0, 10.0, (400, 30, 1))

    def observed(values: np.ndarray) -> ObservedValues:
        column = values[:, None]
        seen = np.ones(column.shape, dtype=np.bool_)
        return ObservedValues(np.array([f"B{i}" for i in range(30)]), (("", "runout_m"),), column, column * 0, seen)

    alarms = []
    for _ in range(40):
        every = rng.normal(100.0, 10.0, 30)
        longest = np.sort(rng.normal(0.0, 10.0, 90))[-30:]
        alarms.append(
            [
                find_short_runs(observed(values), simulated).p < 0.05
                for values in (every, longest - longest.mean() + 100.0)
            ]
        )
    false, right = np.mean(alarms, axis=0)
    assert false <= 0.15
    assert right > 0.9
    assert find_short_runs(observed(np.full(30, np.nan)), simulated) is None


def test_a_record_that_is_stated_to_be_complete_is_held_against_the_runs() -> None:
    missing = ShortRuns(30, 90.0, 60.0, 0.002, 0.2)
    (said,) = completeness_remarks(parse_completeness("complete"), missing, None, 30)
    assert said.severity == "warning"
    assert "the shortest observed run is 90 m, where that of simulated ones is 60 m (p = 0.004)" in str(said)
    assert "stated to be complete" in str(said)
    assert not list(completeness_remarks(parse_completeness("complete"), replace(missing, p_shortest=0.5), None, 30))
    (said,) = completeness_remarks(parse_completeness("unknown"), None, None, 3)
    assert "stated to be unknown" in str(said)
    assert "State the completeness" not in str(said)


@pytest.mark.parametrize("text", ["", "complete", "longest", "longest:80", "unknown"])
def test_a_statement_of_completeness_is_read_as_it_is_written(text: str) -> None:
    assert parse_completeness(text).text == text


@pytest.mark.parametrize(
    "text", ["all", "longest:", "longest:0", "longest:-3", "longest:many", "complete:5", "Longest"]
)
def test_other_statements_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="says nothing of whether all falls were recorded"):
        parse_completeness(text)


def test_falls_that_cannot_be_are_refused(ground: Ground, releases: Releases) -> None:
    names = np.array(["A", "B"])
    more = np.array(["A", "B", "C"])
    stated = parse_completeness
    assert names_that_fell(stated("longest:5"), names, names).tolist() == ["A", "B", "A", "B", "A"]
    assert names_that_fell(stated("longest"), names, more).tolist() == ["A", "B", "C"]
    assert names_that_fell(stated(""), names, more).tolist() == ["A", "B"]
    for text, released, problem in (
        ("longest", names, "it is not stated of how many falls"),
        ("longest:1", names, "2 observed runs, more than the 1 falls"),
        ("longest:2", more, "3 blocks that were released, more than the 2 falls"),
    ):
        with pytest.raises(InputError, match=problem):
            names_that_fell(stated(text), names, released)
    observed = observed_with(ground, releases, Settings(MODEL, TRUTH, seed=5))
    gone = replace(observed.paths, stop=observed.paths.stop * np.array([[np.nan]] + [[1.0]] * (BLOCKS - 1)))
    priors = make_priors(find_model(MODEL), ["rn"], {})
    with pytest.raises(InputError, match="not seen to its stop") as refused:
        back_analyse(
            ground, replace(observed, paths=gone), releases, Settings(MODEL), priors,
            sets=300, completeness=stated("longest:20"),
        )  # fmt: skip
    assert refused.value.trajectory == "B0"


def test_what_has_no_effect_is_not_told(ground: Ground, releases: Releases) -> None:
    """Where a block stops at its first contact with the ground, friction is not felt."""
    priors = make_priors(find_model(MODEL), ["rn", "friction"], {"friction": "0.2..0.8"})
    settings = Settings(MODEL, {"rt": TRUTH["rt"]}, rolling="none")
    observed = observed_with(ground, releases, replace(settings, parameters=TRUTH, seed=5))
    found = back_analyse(ground, observed, releases, settings, priors, sets=800)
    rn, friction = found.estimates
    assert not friction.is_determined
    assert "cannot tell" in friction.verdict
    assert friction.kept > FLAT
    assert friction.kept > rn.kept
    assert any("cannot tell friction" in str(remark) for remark in found.remarks)


def test_a_model_that_cannot_give_what_was_observed_is_named(ground: Ground, releases: Releases) -> None:
    """Stops twice as far away as any parameters within the prior allow."""
    start, far = releases.position, np.tile([115.0, 0.0, 0.0], (BLOCKS, 1))
    observed = observe_stops(releases.name, start, start + far, releases.mass_kg)
    priors = make_priors(find_model(MODEL), ["rn"], {"rn": "0.05..0.3"})
    found = back_analyse(ground, observed, releases, Settings(MODEL, {"rt": 0.3}), priors, sets=300, rounds=1)
    assert not all(check.fits for check in found.checks)
    assert found.remarks[0].severity == "warning"
    assert "make CRSP (Pfeiffer & Bowen 1989) give" in str(found.remarks[0])


def test_the_same_seed_gives_the_same_posterior(ground: Ground, releases: Releases) -> None:
    start = releases.position
    observed = observe_stops(releases.name, start, start + np.array([80.0, 2.0, -50.0]), releases.mass_kg)
    priors = make_priors(find_model(MODEL), ["rn"], {})
    once, again = (
        back_analyse(ground, observed, releases, Settings(MODEL, seed=3), priors, sets=250, rounds=2, threads=threads)
        for threads in (1, 2)
    )
    np.testing.assert_array_equal(again.draws.values, once.draws.values)
    np.testing.assert_array_equal(again.predicted, once.predicted)


def test_cancelling_ends_it(ground: Ground, releases: Releases) -> None:
    def stop(text: str, done: int = 0, total: int = 0) -> None:
        if done > 100:
            raise CancelledError

    priors = make_priors(find_model(MODEL), ["rn"], {})
    with pytest.raises(CancelledError):
        back_analyse(
            ground,
            observed_with(ground, releases, Settings(MODEL, TRUTH, seed=5)),
            releases,
            Settings(MODEL),
            priors,
            sets=300,
            progress=stop,
        )


def test_runs_that_say_nothing_are_refused(ground: Ground, releases: Releases) -> None:
    observed = observed_with(ground, releases, Settings(MODEL, TRUTH, seed=5))
    paths = observed.paths
    unseen = replace(
        paths, impact_piece=np.zeros(0, dtype=np.intp), stop=np.full((len(paths), 3), np.nan),
        whole=np.zeros(len(paths), dtype=np.bool_),
    )  # fmt: skip
    with pytest.raises(InputError, match="No observed run says anything"):
        observe_values(Observed(unseen, observed.from_impact), (), ground)
    priors = make_priors(find_model(MODEL), ["rn"], {})
    with pytest.raises(InputError, match="No block is released"):
        back_analyse(ground, observed, releases.take(slice(0, 3)), Settings(MODEL), priors, sets=300)


# --- priors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "asked", "problem"),
    [
        (["rx"], {}, "has no parameter 'rx'"),
        ([], {}, "No parameter"),
        (["rn"], {"rt": "0.1..0.2"}, "prior is given for rt"),
        (["rn"], {"rn": "0.5..0.1"}, "no part of its range"),
        (["rn"], {"rn": "0.5..1.7"}, "no part of its range"),
        (["rn"], {"rn": "half"}, "is no law"),
        (["rn"], {"rn": "normal:0.5,0"}, "is no law"),
        (["rn"], {"rn": "normal:3,0.5"}, "outside the range"),
    ],
)
def test_priors_that_cannot_be(names: list[str], asked: dict[str, str], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        make_priors(find_model(MODEL), names, asked)


def test_choices_and_measured_rebounds_are_not_fitted() -> None:
    with pytest.raises(InputError, match="is a choice"):
        make_priors(find_model("azimi_desvarreux_1977"), ["definition"], {})
    with pytest.raises(InputError, match="no coefficients to fit"):
        make_priors(find_model("observed"), ["friction"], {})


def test_priors_have_the_law_that_was_asked_for() -> None:
    model = find_model(MODEL)
    place = (np.arange(20_000) + 0.5) / 20_000
    even, normal = make_priors(model, ["rn", "rt"], {"rn": "0.2..0.6", "rt": "normal:0.8,0.1"})
    assert even.values(place) == pytest.approx(0.2 + 0.4 * place)
    drawn = normal.values(place)
    cut = norm.cdf([-8.0, 2.0])
    assert np.searchsorted(drawn, 0.8) / drawn.size == pytest.approx((0.5 - cut[0]) / (cut[1] - cut[0]), abs=1e-3)
    assert drawn.max() <= 1.0
    friction = make_priors(model, ["pfeiffer_bowen_1989.rn", "friction"], {})[1]
    assert friction.values(np.array([0.0, 1.0])).tolist() == [0.0, 1.5]
    wide = Prior("x", "", 1.0, Axis(0.0, 1000.0, 1.0))
    assert wide.values(place) == pytest.approx([wide.axis.value(one) for one in place.tolist()])


# --- statistics of data sets ------------------------------------------------------------------------------------------


def test_statistics_are_means_shares_and_spreads_in_robust_units() -> None:
    scales = Scales(np.full((4, 1), 10.0), np.full((4, 1), 2.0))
    values = np.array([[12.0], [8.0], [np.nan], [1000.0]])
    seen = np.ones((4, 1), dtype=np.bool_)
    mean = (1 - 1 + 4) / 3
    spread = (abs(1 - mean) + abs(-1 - mean) + abs(4 - mean)) / 3
    assert statistics_of(values, scales, seen) == pytest.approx([mean, 0.75, spread])
    seen[3] = False
    assert statistics_of(values, scales, seen) == pytest.approx([0.0, 2 / 3, 1.0])
    assert plain_means(values, seen) == pytest.approx([10.0])


def test_scales_are_robust() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(5.0, 2.0, (4001, 1, 1))
    values[:100] = 1e6
    values[100:200] = np.nan
    found = find_scales(values)
    assert found.centre[0, 0] == pytest.approx(5.0, abs=0.3)
    assert found.spread[0, 0] == pytest.approx(2.0, rel=0.15)
    still = find_scales(np.full((9, 1, 1), 3.0))
    assert (still.centre[0, 0], still.spread[0, 0]) == (3.0, 1.0)


def test_errors_are_added_where_runs_count() -> None:
    seen = np.array([[True], [False]])
    observed = ObservedValues(
        np.array(["a", "b"]), (("", "runout_m"),), np.zeros((2, 1)), np.array([[0.5], [0.5]]), seen
    )
    scales = Scales(np.zeros((2, 1)), np.ones((2, 1)))
    values = with_errors(observed, scales, np.zeros((4000, 2, 1)), np.random.default_rng(2))
    assert values[:, 0].std() == pytest.approx(0.5, rel=0.06)
    assert np.isnan(values[:, 1]).all()
    wide = Scales(np.zeros((2, 1)), np.full((2, 1), 40.0))
    values = with_errors(observed, wide, np.zeros((4000, 2, 1)), np.random.default_rng(2))
    assert values[:, 0].std() == pytest.approx(40 * LEAST_ERROR, rel=0.06)


def test_the_score_is_that_of_its_definition() -> None:
    rng = np.random.default_rng(3)
    values, weight = rng.normal(size=40), rng.random(40)
    w = weight / weight.sum()
    apart = np.abs(values[:, None] - values)
    assert crps(values, weight, 0.3) == pytest.approx(w @ np.abs(values - 0.3) - 0.5 * w @ apart @ w)


def test_tails_are_two_sided() -> None:
    simulated = np.column_stack([np.arange(99.0), np.arange(99.0), np.full(99, np.nan)])
    p = tails(simulated, np.array([49.0, -1.0, 1.0]))
    assert p[:2] == pytest.approx([1.0, 2 * 0.5 / 100])
    assert np.isnan(p[2])


def hops(times: list[float], velocities: list[list[float]]) -> Paths:
    """Flights one after the other from the origin."""
    k, lasted = len(times), np.array(times)
    start_velocity = np.array(velocities)
    fall = np.array([0.0, 0.0, 9.81])
    end = np.cumsum(start_velocity * lasted[:, None] - fall * lasted[:, None] ** 2 / 2, axis=0)
    start = np.vstack([np.zeros(3), end[:-1]])
    return Paths(
        np.array(["A"]), np.ones(1), np.full((1, 3), np.nan), np.zeros(1, np.bool_), np.zeros(1, np.bool_),
        np.zeros(k, np.intp), np.ones(k, np.bool_), np.cumsum(lasted) - lasted, lasted, start, end, start_velocity,
        start_velocity - fall * lasted[:, None], np.zeros(k), np.arange(k), 9.81,
    )  # fmt: skip


def test_rebounds_are_read_without_the_normal() -> None:
    """It arrives at 4 m/s along x and 9.81 m/s down; it goes on at 3 m/s in plan, 60° to the left, and 1 m/s up."""
    paths = hops([1.0, 0.5, 0.5], [[4.0, 0.0, 0.0], [1.5, 2.598076, 1.0], [1.5, 2.598076, 0.0]])
    before = np.hypot(4.0, 9.81)
    one = measure_rebounds(paths, Limits(np.array([2]), np.array([9.0]), 0.2))
    assert one["", "rebound_r"] == pytest.approx([np.hypot(3.0, 1.0) / before], abs=1e-6)
    assert one["", "rebound_rise"] == pytest.approx([1.0 / before], abs=1e-6)
    assert one["", "rebound_turn_deg"] == pytest.approx([60.0], abs=1e-4)
    both = measure_rebounds(paths, Limits(np.array([3]), np.array([9.0]), 0.2))
    assert both["", "rebound_turn_deg"] == pytest.approx([30.0], abs=1e-4)
    assert np.isnan(measure_rebounds(paths, Limits(np.array([1]), np.array([9.0]), 0.2))["", "rebound_r"]).all()
    rolled = replace(paths, flies=np.array([True, True, False]))
    flown = measure_rebounds(rolled, Limits(np.array([3]), np.array([9.0]), 0.2))
    assert flown["", "rebound_r"] == pytest.approx(one["", "rebound_r"])


def test_impacts_that_are_not_told_apart_are_one() -> None:
    """Skipped over, the way between the others is that of one parabola, as a person would see it."""
    paths = hops([1.0, 0.1, 0.9], [[4.0, 0.0, 0.0], [3.0, 0.0, 1.0], [2.0, 0.0, 3.0]])
    found = measure_rebounds(paths, Limits(np.array([3]), np.array([9.0]), 0.2))
    way = paths.end[2] - paths.end[0]
    after = way / 1.0 + [0.0, 0.0, 9.81 / 2]
    assert found["", "rebound_r"] == pytest.approx([np.linalg.norm(after) / np.hypot(4.0, 9.81)])


def test_laws_in_a_text() -> None:
    assert laws_in("") == {}
    assert laws_in("rn = 0.2..0.6, friction = normal:0.5,0.1; rt=0.5..0.9,") == {
        "rn": "0.2..0.6",
        "friction": "normal:0.5,0.1",
        "rt": "0.5..0.9",
    }
    for text, told in (("rn", "gives no law"), ("rn = 1..2, rn = 2..3", "two laws"), ("= 3..4", "gives no law")):
        with pytest.raises(InputError, match=told):
            laws_in(text)
