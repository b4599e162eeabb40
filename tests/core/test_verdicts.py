# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a fit: every sentence on its side of every limit, with what it is about and how grave it is."""

import pytest
from rockfall.core.analysis.verdicts import (
    about_choice,
    about_holdout,
    about_likeness,
    about_number,
    about_use,
    clear_errors,
)
from rockfall.core.impact_models.machinery.parameters import ParameterSpec

SPEC = ParameterSpec("rn", 0.3, 0.0, 2.0, (), "a number", "nowhere")
SAME, OUTSIDE = "Not clearly different from the default 0.3.", "The default 0.3 lies outside."
RIM = "limit of its range, {}: the best value may lie beyond."
ROUGH = "Only roughly determined: anything from 0.4 to 1 fits about as well."


def said(value, low, high, idle=False, correlations=()):
    """[(severity, sentence)] about a value and its interval, in a range from 0 to 2."""
    places = value / 2, low / 2, high / 2
    remarks = list(about_number(SPEC, 0.3, value, (low, high), places, idle, correlations))
    assert {one.about for one in remarks} == {"rn"}
    return [(one.severity, one.text) for one in remarks]


def test_widths_of_an_interval():
    assert said(0.5, 0.451, 0.549) == [("note", "Well determined, to ±9.8 %."), ("note", OUTSIDE)]
    assert said(0.5, 0.449, 0.551)[0] == ("note", "Fairly determined, to ±10 %.")
    assert said(0.5, 0.351, 0.649)[0] == ("note", "Fairly determined, to ±30 %.")
    assert said(0.6, 0.4, 1.0)[0] == ("note", ROUGH)
    assert said(0.6, 0.4, 1.41) == [("problem", "The data cannot tell: the interval covers 50 % of the range.")]
    exact = [("note", "Determined exactly, as by outcomes without any scatter."), ("note", OUTSIDE)]
    assert said(0.5, 0.5, 0.5, correlations=[("rt", 1.0)]) == exact


def test_whether_the_default_is_inside():
    assert said(0.4, 0.3, 0.5)[-1] == ("note", SAME)
    assert said(0.25, 0.2, 0.3)[-1] == ("note", SAME)
    assert said(0.4, 0.301, 0.5)[-1] == ("note", OUTSIDE)
    assert said(0.25, 0.2, 0.299)[-1] == ("note", OUTSIDE)


def test_ends_of_the_range():
    assert said(0.003, 0.003, 0.1) == [("warning", f"It ended at the lower {RIM.format('0.003')}"), ("note", OUTSIDE)]
    assert said(2.0, 1.9, 2.0) == [("warning", f"It ended at the upper {RIM.format('2')}"), ("note", OUTSIDE)]
    assert said(0.005, 0.0, 0.1)[0][0] == "note"
    wide = "The data cannot tell: the interval covers 75 % of the range."
    assert said(2.0, 0.5, 2.0) == [("problem", wide), ("warning", f"It ended at the upper {RIM.format('2')}")]


def test_parameters_that_move_together():
    found = said(0.5, 0.451, 0.549, correlations=[("rt", -0.91), ("rn_sd", 0.89)])
    pair = ("warning", "It moves with rt (correlation -0.91): only the pair is determined.")
    assert found == [("note", "Well determined, to ±9.8 %."), pair, ("note", OUTSIDE)]


def test_a_parameter_without_effect():
    text = "The data cannot tell: it has no effect on these impacts with these settings; left at its default."
    assert said(0.3, 0.0, 2.0, idle=True) == [("problem", text)]


@pytest.mark.parametrize(
    ("gain", "error", "severity", "text"),
    [
        (0.0, 0.1, "problem", "The data cannot tell: cube fits exactly as well."),
        (0.23, 0.1, "problem", "The data cannot tell: cube fits about as well (score 0.230 ± 0.100 more)."),
        (0.24, 0.1, "note", "sphere fits clearly better than cube (score 0.240 ± 0.100 less)."),
    ],
)
def test_choices(gain, error, severity, text):
    remark = about_choice("inertia", "sphere", "cube", gain, error, 9)  # 2.31 errors, Student's t
    assert (remark.text, remark.severity, remark.about) == (text, severity, "inertia")


SEEN = "On impacts it was not fitted to, the"


@pytest.mark.parametrize(
    ("default", "gain", "severity", "text"),
    [
        (0.0, 0.0, "note", "The defaults already agree exactly."),
        (2.0, 0.24, "note", f"{SEEN} model is 12 % nearer than with its defaults (better in 7 of 9)."),
        (2.0, -0.24, "warning", f"{SEEN} model is 12 % farther than with its defaults: keep the defaults."),
        (
            2.0,
            0.23,
            "warning",
            f"{SEEN} fit is not clearly better than the defaults (score 1.770 against 2.000, better in 7 of 9).",
        ),
        (
            2.0,
            -0.23,
            "warning",
            f"{SEEN} fit is not clearly better than the defaults (score 2.230 against 2.000, better in 7 of 9).",
        ),
    ],
)
def test_hold_out(default, gain, severity, text):
    remark = about_holdout(default, default - gain, gain, 0.1, 7, 9)
    assert (remark.text, remark.severity, remark.about) == (text, severity, "hold-out")


def test_use():
    one, guess = "one and the same outcome for all impacts", "drawing one of the measured outcomes at random"
    good, bad = about_use(0.9, 1.2, chance=True), about_use(1.2, 1.2, chance=False)
    assert good.text == f"The model is 25 % nearer than {guess} (score 0.900 against 1.200)."
    assert bad.text == f"Beware: with a score of 1.200 the model is no better than {one} (1.200)."
    assert (good.severity, bad.severity) == ("note", "warning")
    assert guess in about_use(1.3, 1.2, chance=True).text
    assert one in about_use(0.9, 1.2, chance=False).text


AMOUNTS = "(v_N2 to 0.12 m/s, v_T2 to 2.3 m/s, deviation to 4.6° on average)"


@pytest.mark.parametrize(
    ("distance", "scatter", "severity", "text"),
    [
        (0.009, 1.0, "note", f"The two behave the same on these impacts {AMOUNTS}."),
        (0.011, 1.0, "note", f"The two behave nearly alike {AMOUNTS}."),
        (0.11, 1.0, "note", f"The two behave somewhat alike {AMOUNTS}: similar trends, visible differences."),
        (
            0.41,
            1.0,
            "warning",
            f"The two stay different {AMOUNTS}: no parameters among those fitted make one stand for the other.",
        ),
        (0.0, 0.0, "note", f"The two behave the same on these impacts {AMOUNTS}."),
        (
            1e-9,
            0.0,
            "warning",
            f"The two stay different {AMOUNTS}: no parameters among those fitted make one stand for the other.",
        ),
    ],
)
def test_likeness(distance, scatter, severity, text):
    remark = about_likeness(distance, scatter, (0.123, 2.34, 4.56))
    assert (remark.text, remark.severity, remark.about) == (text, severity, "likeness")


def test_few_trajectories_take_a_clearer_difference():
    """Student's t of a table: 12.71 for one degree of freedom, 2.776 for four, 2.000 for sixty."""
    found = [clear_errors(clusters) for clusters in (2, 5, 61)]
    assert found == pytest.approx([12.706, 2.776, 2.000], abs=1e-3)
    assert about_holdout(2.0, 1.7, 0.3, 0.1, 2, 2).severity == "warning"
    assert about_holdout(2.0, 1.7, 0.3, 0.1, 4, 5).severity == "note"
    assert about_choice("inertia", "sphere", "cube", 1.0, float("inf"), 1).severity == "problem"
