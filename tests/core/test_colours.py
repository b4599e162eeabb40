# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from rockfall.core.colours import SPEED_SCALE, rounded_top, scale_colours, srgb_to_linear


def test_ends_knots_and_clipping():
    values = np.array([0.0, 10.0, 20.0 / 7, -5.0, 25.0])
    np.testing.assert_allclose(
        scale_colours(values, 0.0, 20.0)[[0, 2, 3, 4]], SPEED_SCALE[[0, 1, 0, 7]], rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(scale_colours(values, 0.0, 20.0)[1], SPEED_SCALE[3:5].mean(axis=0), rtol=0, atol=1e-12)


def test_undefined_is_grey():
    assert scale_colours(np.array([np.nan]), 0.0, 1.0).tolist() == [[0.5, 0.5, 0.5]]


def test_faster_is_brighter():
    """Readable without colour vision: relative luminance (Rec. 709) grows all along the scale."""
    colours = srgb_to_linear(scale_colours(np.linspace(0, 1, 50), 0.0, 1.0))
    assert (np.diff(colours @ [0.2126, 0.7152, 0.0722]) > 0).all()


@pytest.mark.parametrize(("srgb", "linear"), [(0.0, 0.0), (0.5, 0.21404114), (1.0, 1.0), (0.04, 0.0030959752)])
def test_transfer_function(srgb, linear):
    assert srgb_to_linear(np.array([srgb]))[0] == pytest.approx(linear, abs=1e-8)


@pytest.mark.parametrize(
    ("value", "top"), [(21.2, 25.0), (20.0, 20.0), (0.13, 0.15), (9.2, 10.0), (0.0, 1.0), (np.nan, 1.0), (11.0, 15.0)]
)
def test_top_of_the_legend_reads_well(value, top):
    assert rounded_top(value) == pytest.approx(top, rel=1e-12)
