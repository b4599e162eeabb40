# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits recover what impacts were made with, their intervals hold it, and the verdicts say when the data cannot tell."""

from dataclasses import replace
from math import isnan

import numpy as np
import pytest
from rockfall.core.analysis.calibration import calibrate
from rockfall.core.analysis.clouds import make_contest, measured_target
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.courses import find_courses
from rockfall.core.analysis.equivalence import equivalent
from rockfall.core.analysis.estimation import FitOptions, paired_gain
from rockfall.core.analysis.fitting import Axis, interval
from rockfall.core.errors import InputError
from rockfall.core.exchange.selection import rows_of
from rockfall.core.impact_models.registry import MODELS
from rockfall.core.progress import CancelledError
from rockfall.core.reconstruction.impact import apparent
from rockfall.core.reconstruction.picks import make_picks
from rockfall.core.reconstruction.trajectory import reconstruct

QUICK = FitOptions(resamples=20)


def slope(trajectories=10, each=7, seed=3):
    """Impacts down a slope of 35°; the first and the last of each trajectory lack a velocity."""
    rng = np.random.default_rng(seed)
    n = trajectories * each
    step = rng.uniform(0.4, 1.2, n)
    position = np.cumsum(step[:, None] * [6.0, 0.0, -4.2] + rng.normal(size=(n, 3)) * 0.3, axis=0)
    normal = np.array([0.57, 0, 0.82]) + 0.05 * rng.normal(size=(n, 3))
    names = np.repeat([f"block {k}" for k in range(trajectories)], each)
    return reconstruct(make_picks(names, np.cumsum(step), position, normal=normal)).impacts


def made_by(impacts, model, parameters=None, *, seed=99, noise_mps=0.0):
    """The same impacts, as a model makes them: one draw of its chance, and measured with an error."""
    chance = MODELS[model].is_random
    predictions = compare(impacts, [model], {model: parameters or {}}, replicates=int(chance), seed=seed)
    v2 = impacts.v2.copy()
    v2[predictions.row] = predictions.v2[0, -1]
    v2 += np.random.default_rng(seed).normal(size=v2.shape) * noise_mps
    seen = apparent(impacts.v1, v2, impacts.normal / np.linalg.norm(impacts.normal, axis=1, keepdims=True))
    values = {name: getattr(seen, name) for name in ("vn2", "vt2", "rn", "rt", "r", "theta_dev")}
    flags = {**impacts.flags, "into_ground": np.zeros(len(impacts), dtype=np.bool_)}
    return replace(impacts, v2=v2, flags=flags, **values)


def by_name(result):
    return {one.name: one for one in result.estimates}


def remark_about(remarks, about):
    """(severity, text) of the only remark about something."""
    ((severity, text),) = [(one.severity, one.text) for one in remarks if one.about == about]
    return severity, text


EXACT = {
    "azimi_desvarreux_1977": {"rn": 0.52, "rt": 0.71},
    "pfeiffer_bowen_1989": {"rn": 0.45, "rt": 0.66},
    "wyllie_2014": {"rn_factor": 12.0, "rn_exponent": -0.8},
}


@pytest.mark.parametrize("model", EXACT)
def test_a_model_without_chance_is_recovered_exactly(model):
    truth = EXACT[model]
    result = calibrate(made_by(slope(), model, truth), model, list(truth), options=QUICK, holdout=False)
    for name, value in truth.items():
        assert result.settings[name] == pytest.approx(value, rel=1e-3)
        assert by_name(result)[name].low == pytest.approx(by_name(result)[name].high, rel=2e-2)
    assert result.fitted_score < 1e-3 < result.default_score
    assert isnan(result.held_out_score)


RANDOM = {
    "stevens_1998": {"rn": 0.5, "rn_sd": 0.08, "rt_sd": 0.03},
    "noel_2017": {"rn_exponent": -1.3, "rt": 0.55},
    "dorren_2015": {"rn": 0.6, "rg20": 0.3},
}


@pytest.mark.parametrize("model", RANDOM)
def test_a_random_model_is_recovered_within_its_intervals(model):
    """Means and standard deviations alike; other random numbers than those that made the impacts."""
    truth = RANDOM[model]
    impacts = made_by(slope(14, 9), model, truth)
    result = calibrate(
        impacts, model, list(truth), options=FitOptions(resamples=30, replicates=12, seed=4), holdout=False
    )
    for name, value in truth.items():
        one = by_name(result)[name]
        assert one.low <= value <= one.high
        assert one.low <= one.value <= one.high
        assert one.high - one.low < abs(value)
    assert result.fitted_score < result.default_score


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    """20 sets of impacts, measured with an error of 0.5 m/s; two parameters each."""
    base, truth, inside = slope(10, 6), {"rn": 0.45, "rt": 0.7}, 0
    wide = []
    for seed in range(20):
        impacts = made_by(base, "azimi_desvarreux_1977", truth, seed=seed, noise_mps=0.5)
        result = calibrate(
            impacts, "azimi_desvarreux_1977", list(truth), options=FitOptions(resamples=40, starts=1), holdout=False
        )
        for name, value in truth.items():
            inside += by_name(result)[name].low <= value <= by_name(result)[name].high
            wide.append(by_name(result)[name].high - by_name(result)[name].low)
    assert inside >= 34
    assert np.median(wide) < 0.2


def test_the_energy_score_of_a_single_outcome_is_the_distance():
    impacts = slope(3)
    courses = find_courses(impacts)
    target = measured_target(impacts, courses)
    contest = make_contest(MODELS["azimi_desvarreux_1977"], impacts, target, 20, 0)
    predictions = compare(impacts, ["azimi_desvarreux_1977"])
    away = [
        getattr(predictions, name)[0, 0] - getattr(impacts, name)[courses.row] for name in ("vn2", "vt2", "theta_dev")
    ]
    expected = np.linalg.norm(np.stack(away, axis=1) / target.scale, axis=1)[target.counted]
    assert contest.sums(contest.model.numbers()).sum() == pytest.approx(expected.sum(), rel=1e-9)


def test_the_energy_score_is_that_of_its_definition():
    impacts = slope(6)
    target = measured_target(impacts, find_courses(impacts))
    contest = make_contest(MODELS["noel_2017"], impacts, target, 7, 1)
    numbers = contest.model.numbers()
    x, y = contest.points(numbers)[:, target.counted], target.points[0, target.counted]
    apart = np.linalg.norm(x[:, None] - x[None], axis=-1).sum(axis=(0, 1)) / (7 * 6)
    expected = np.linalg.norm(x - y, axis=-1).mean(axis=0) - apart / 2
    assert contest.sums(numbers).sum() == pytest.approx(expected.sum(), rel=1e-9)
    assert target.clusters == 6
    assert contest.sums(numbers)[0] == pytest.approx(expected[: int(target.counts[0])].sum(), rel=1e-9)


def test_held_out_trajectories_know_a_real_gain_from_a_vain_one():
    impacts = made_by(slope(12, 8), "stevens_1998", {"rn": 0.6})
    gain = calibrate(impacts, "stevens_1998", ["rn"], options=QUICK)
    assert gain.fitted_score <= gain.held_out_score < gain.default_score
    nearer = 100 * (1 - gain.held_out_score / gain.default_score)
    better = sum(fold.fitted < fold.default for fold in gain.folds)
    severity, text = remark_about(gain.remarks, "hold-out")
    assert better == len(gain.folds) == 5
    assert severity == "note"
    assert text.startswith(
        f"On impacts it was not fitted to, the model is {nearer:.0f} % nearer than with its defaults ("
    )
    severity, text = remark_about(gain.remarks, "score")
    assert severity == "note"
    assert text.startswith("The model is ")
    assert f"(score {gain.held_out_score:.3f} against " in text
    assert {one.about for one in gain.remarks} == {"hold-out", "score"}
    assert sum(fold.impacts for fold in gain.folds) == gain.impacts
    assert sorted(name for fold in gain.folds for name in fold.trajectories) == sorted(set(impacts.trajectory.tolist()))
    vain = calibrate(made_by(slope(12, 8), "stevens_1998"), "stevens_1998", ["rn"], options=QUICK)
    assert vain.held_out_score == pytest.approx(vain.default_score, rel=0.02)
    severity, text = remark_about(vain.remarks, "hold-out")
    scores = f"(score {vain.held_out_score:.3f} against {vain.default_score:.3f}, better in "
    assert severity == "warning"
    assert text.startswith(f"On impacts it was not fitted to, the fit is not clearly better than the defaults {scores}")


def test_a_flat_valley_is_told():
    """At one incident angle, factor and exponent of Wyllie's law cannot be told apart; nor a scale that is off."""
    base = slope(8, 6)
    n = base.normal / np.linalg.norm(base.normal, axis=1, keepdims=True)
    along = np.cross([0.0, 1.0, 0.0], n)
    v1 = 10 * (along / np.linalg.norm(along, axis=1, keepdims=True) * np.cos(0.5) - n * np.sin(0.5))
    base = replace(base, v1=np.where(np.isfinite(base.v1), v1, np.nan), normal=n)
    impacts = made_by(base, "wyllie_2014", noise_mps=0.2)
    result = calibrate(impacts, "wyllie_2014", ["rn_factor", "rn_exponent"], options=FitOptions(resamples=40))
    factor, exponent = result.estimates
    assert not factor.is_determined
    assert "The data cannot tell: the interval covers " in factor.verdict
    for one, other in ((factor, exponent), (exponent, factor)):
        assert f"It moves with {other.name} (correlation -" in one.verdict
        assert ("warning", one.name) in {(remark.severity, remark.about) for remark in one.remarks}
    unsure = ", ".join(one.name for one in result.estimates if not one.is_determined)
    text = f"These impacts cannot tell {unsure}: set a value, or fit fewer parameters together."
    assert remark_about(result.remarks, "parameters") == ("advice", text)
    idle = calibrate(impacts, "stevens_1998", ["mass_scale"], options=QUICK, holdout=False).estimates[0]
    assert (idle.value, idle.low, idle.high) == (1000.0, 1.0, 1e7)
    assert [(one.severity, one.about) for one in idle.remarks] == [("problem", "mass_scale")]
    assert "no effect" in idle.verdict


def test_a_parameter_at_its_limit_is_told():
    impacts = made_by(slope(), "azimi_desvarreux_1977", {"rn": 0.9})
    grown = replace(impacts, vn2=impacts.vn2 * 1.5)
    result = calibrate(grown, "azimi_desvarreux_1977", ["rn"], options=QUICK, holdout=False)
    assert result.settings["rn"] == pytest.approx(1.0, abs=1e-3)
    severity, about = result.estimates[0].remarks[0].severity, result.estimates[0].remarks[0].about
    assert (severity, about) == ("warning", "rn")
    assert result.estimates[0].verdict.startswith("It ended at the upper limit of its range, 1: the best value may lie")


def test_choices_are_tried():
    impacts = made_by(slope(), "wyllie_2014", {"inertia": "sphere"}, noise_mps=0.05)
    one = calibrate(impacts, "wyllie_2014", ["inertia"], options=QUICK).estimates[0]
    assert (one.value, one.default) == ("sphere", "cube")
    assert one.verdict.startswith("sphere fits clearly better than cube (score ")
    assert one.is_determined
    impacts = made_by(slope(), "azimi_desvarreux_1977", {"rn": 0.36}, noise_mps=0.05)
    both = by_name(calibrate(impacts, "azimi_desvarreux_1977", ["rn", "rt", "definition"], options=QUICK))
    assert both["definition"].verdict.startswith("The data cannot tell: ")
    assert not both["definition"].is_determined


def test_the_same_seed_gives_the_same_result_whatever_the_order_of_rows():
    impacts = made_by(slope(6), "noel_2017")
    mixed = rows_of(impacts, np.random.default_rng(0).permutation(len(impacts)))
    one, again, other = (
        calibrate(which, "noel_2017", ["rt"], options=FitOptions(resamples=20, seed=seed))
        for which, seed in ((impacts, 1), (impacts, 1), (mixed, 1))
    )
    assert one.estimates == again.estimates
    assert one.remarks == again.remarks
    assert other.estimates[0].value == pytest.approx(one.estimates[0].value, abs=1e-3)


def test_an_impact_with_a_wrong_velocity_does_not_count():
    impacts = made_by(slope(8), "pfeiffer_bowen_1989", {"rn": 0.5})
    wild = impacts.vn2.copy()
    wild[3] = 1e6
    flags = {**impacts.flags, "below_terrain": np.arange(len(impacts)) == 3}
    result = calibrate(
        replace(impacts, vn2=wild, flags=flags), "pfeiffer_bowen_1989", ["rn"], options=QUICK, holdout=False
    )
    assert result.settings["rn"] == pytest.approx(0.5, rel=1e-3)
    assert result.impacts == calibrate(impacts, "pfeiffer_bowen_1989", ["rn"], options=QUICK, holdout=False).impacts - 1


def test_few_trajectories_are_told():
    result = calibrate(made_by(slope(2, 12), "noel_2017"), "noel_2017", ["rt"], options=QUICK)
    severity, text = remark_about(result.remarks, "trajectories")
    assert severity == "warning"
    assert text.startswith("With 2 trajectories single impacts were resampled as if independent: ")


def test_cancelling_stops():
    for most in (30, 200):
        calls = []

        def progress(*said, calls=calls, most=most):
            calls.append(said)
            if len(calls) > most:
                raise CancelledError

        with pytest.raises(CancelledError):
            calibrate(slope(5), "noel_2017", ["rt"], progress=progress)
        assert most < len(calls) < most + 250, "other threads end at their next word"


def test_progress_is_told():
    said = []
    calibrate(slope(5), "noel_2017", ["rt"], options=QUICK, progress=lambda *one: said.append(one))
    assert said[0] == ("Fitting noel_2017", 0, 1)
    assert ("Resampling the trajectories", 16, 20) in said
    assert said[-1] == ("Predicting trajectories that were held out", 4, 5)


BAD = {
    "unknown": (["rnn"], {}, "has no parameter 'rnn'. Did you mean rn"),
    "none": ([], {}, "No parameter of stevens_1998 is to be fitted. Name some of rn, rt"),
    "both": (["rn"], {"fixed": {"rn": 0.3}}, "stevens_1998.rn is both fitted and set"),
    "range": (["rn"], {"fixed": {"rt": 3}}, "outside its range"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_questions_are_refused(case):
    names, options, message = BAD[case]
    with pytest.raises(InputError, match=message):
        calibrate(slope(5), "stevens_1998", names, **options)


@pytest.mark.parametrize("few", [{"starts": 0}, {"seed": -1}, {"replicates": 1}, {"resamples": 19}])
def test_too_little_effort_is_refused(few):
    with pytest.raises(InputError, match="2 replicates or more, 20 resamples or more, and a seed from 0"):
        FitOptions(**few)
    assert FitOptions(starts=1, seed=0, replicates=2, resamples=20)


def test_bad_questions_about_equivalence_are_refused():
    with pytest.raises(InputError, match=r"noel_2017\.rt is 4, outside its range"):
        equivalent(slope(3), "noel_2017", {"rt": 4}, "stevens_1998", ["rn"])


def test_bad_impacts_are_refused():
    few = slope(1, 6)
    with pytest.raises(InputError, match=r"4 impacts can be used, which is too few to fit 2 .*at least 10"):
        calibrate(few, "stevens_1998", ["rn", "rt"])
    flagged = replace(few, flags={**few.flags, "below_terrain": np.ones(6, dtype=np.bool_)})
    with pytest.raises(InputError, match=r"No impact can be compared: .* with the flag departing, into_ground, below"):
        calibrate(flagged, "stevens_1998", ["rn"])
    with pytest.raises(InputError, match=r"None of the 6 impacts can be used: .* have no restituted velocity"):
        calibrate(replace(few, vn2=np.full(6, np.nan)), "stevens_1998", ["rn"])
    with pytest.raises(InputError, match="combinations of choices, too many to try"):
        calibrate(slope(5), "dorren_2015", ["soil_type", "block_shape", "deviation_axis"])


def test_crsp_and_rocfall_have_equal_parameters():
    """Stevens 1998 with both switches on and without scatter is Pfeiffer & Bowen's law of a sphere."""
    truth, quiet = {"rn": 0.42, "rt": 0.78}, {"rn_sd": 0.0, "rt_sd": 0.0}
    there = equivalent(
        slope(),
        "pfeiffer_bowen_1989",
        truth,
        "stevens_1998",
        ["rn", "rt"],
        fixed=quiet,
        options=FitOptions(replicates=2, resamples=20),
    )
    back = equivalent(
        slope(),
        "stevens_1998",
        truth | quiet,
        "pfeiffer_bowen_1989",
        ["rn", "rt"],
        options=FitOptions(replicates=2, resamples=20),
    )
    for result in (there, back):
        for name, value in truth.items():
            assert result.settings[name] == pytest.approx(value, rel=1e-4)
        assert result.distance < 0.02 < result.default_distance
        assert result.remarks[0].text.startswith("The two behave the same on these impacts (v_N2 to ")
        assert max(result.rms) < 1e-3


def test_a_random_model_finds_itself():
    truth = {"rn": 0.5, "rt": 0.75}
    result = equivalent(slope(), "stevens_1998", truth, "stevens_1998", ["rn", "rt"], options=QUICK)
    for name, value in truth.items():
        assert result.settings[name] == pytest.approx(value, rel=0.03)
    assert result.distance < 0.15
    assert remark_about(result.remarks, "likeness")[0] == "note"
    assert result.remarks[0].text.startswith("The two behave the same on these impacts (v_N2 to ")


def test_models_that_cannot_be_alike_are_told():
    result = equivalent(slope(), "noel_2017", None, "wyllie_2014", ["rn_factor"], options=QUICK)
    assert result.distance > 0.5
    assert result.remarks[0].text.startswith(f"The two stay different (v_N2 to {result.rms[0]:.2g} m/s, v_T2 to ")
    assert remark_about(result.remarks, "likeness")[0] == "warning"


def test_equivalence_needs_no_measured_outcomes():
    base = slope()
    blank = replace(base, **{name: np.full_like(getattr(base, name), np.nan) for name in ("vn2", "vt2", "theta_dev")})
    result = equivalent(blank, "azimi_desvarreux_1977", {"rn": 0.5}, "azimi_desvarreux_1977", ["rn"], options=QUICK)
    assert result.settings["rn"] == pytest.approx(0.5, rel=1e-4)


def test_the_gain_of_two_fits_and_its_error():
    """Four trajectories of three impacts: the mean of four gains of an impact, and the error of that mean by hand."""
    before, after = np.array([6.0, 9.0, 3.0, 12.0]), np.array([3.0, 3.0, 3.0, 9.0])
    gains = np.array([1.0, 2.0, 0.0, 1.0])
    found = paired_gain(before, after, np.full(4, 3.0))
    assert found == pytest.approx((gains.mean(), gains.std(ddof=1) / np.sqrt(4)), rel=1e-12)
    assert paired_gain(after, before, np.full(4, 3.0))[0] == -found[0]
    assert paired_gain(before[:1], after[:1], np.array([3.0])) == (1.0, np.inf)


def test_axes_and_intervals():
    for spec in (spec for model in MODELS.values() for spec in model.parameters if not spec.choices):
        axis = Axis.of(spec)
        for place in (0.0, 0.2, 0.7, 1.0):
            assert axis.place(axis.value(place)) == pytest.approx(place, abs=1e-12)
        assert (axis.value(0.0), axis.value(1.0)) == pytest.approx((spec.minimum, spec.maximum), rel=1e-12)
        assert 0.0 <= axis.place(float(spec.default)) <= 1.0
    values = np.random.default_rng(0).normal(size=200_000)
    assert interval(values, 10_000) == pytest.approx((-1.96, 1.96), abs=0.03)
    assert interval(values, 14) == pytest.approx((-2.242, 2.242), abs=0.03)  # √(14/13) · t(0.975; 13) = 2.2419


@pytest.mark.parametrize(
    ("roughness", "guess"), [(0.0, "one and the same outcome"), (0.3, "drawing one of the measured outcomes")]
)
def test_crsp_without_roughness_is_measured_as_a_model_without_chance(roughness, guess):
    result = calibrate(slope(), "pfeiffer_bowen_1989", ["rn"], {"roughness": roughness}, QUICK, holdout=False)
    assert guess in remark_about(result.remarks, "score")[1]
