# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rockfall.core.errors import RockfallError
from rockfall.core.georeference import GlobalShift

metres = st.floats(-4e6, 8e6)


@given(st.tuples(metres, metres, metres))
def test_survey_coordinates_come_back(point):
    survey = np.array([point, [2_600_000.123456, 1_200_000.654321, 512.75]])
    shift = GlobalShift(2_600_000.0, 1_200_000.0, 500.0)
    np.testing.assert_allclose(shift.to_survey(shift.to_local(survey)), survey, rtol=0, atol=2e-9)


def test_single_precision_keeps_a_tenth_of_a_millimetre_after_the_shift():
    survey = np.array([2_600_123.4567, 1_200_987.6543, 731.2345])
    shift = GlobalShift.proposed(survey - 500, survey + 500)
    back = shift.to_survey(shift.to_local(survey).astype(np.float32))
    np.testing.assert_allclose(back, survey, rtol=0, atol=1e-4)
    assert abs(float(np.float32(survey[0])) - survey[0]) > 0.01, "which single precision alone does not"


def test_proposed_shift_is_round_and_only_where_needed():
    shift = GlobalShift.proposed([2_599_940.0, 1_200_010.0, 450.0], [2_600_020.0, 1_200_260.0, 700.0], "EPSG:2056")
    assert shift == GlobalShift(2_600_000.0, 1_200_100.0, 0.0, "EPSG:2056")
    assert GlobalShift.proposed([-50.0, -50, 0], [50.0, 50, 90]) == GlobalShift()


def test_no_shift_for_what_is_not_finite():
    with pytest.raises(RockfallError, match="not finite"):
        GlobalShift.proposed([np.nan, 0, 0], [1, 1, 1])
