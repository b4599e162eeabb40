# SPDX-License-Identifier: GPL-3.0-or-later
"""Spin from marks of one side of the block."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.reconstruction.spin import measure_spin


def test_two_marks():
    """Three turns in half a second; 15° at either end are 15°·√2/0.5 s."""
    spin = measure_spin([1.0, 1.5], [0, 3])
    assert spin.rate == pytest.approx(12 * np.pi)
    assert spin.sigma_rate == pytest.approx(np.radians(15) * np.sqrt(2) / 0.5)
    assert np.isnan(spin.angular_velocity).all()


def test_a_rolling_block_moves_at_omega_times_radius():
    velocity = np.array([3.0, 4.0, -2.0])
    spin = measure_spin([0, 1.0], [0, 5], velocity=velocity)
    contact = np.cross(spin.angular_velocity, [0, 0, -0.2])
    np.testing.assert_allclose(contact / np.linalg.norm(contact), -np.array([0.6, 0.8, 0]), atol=1e-12)
    assert np.linalg.norm(spin.angular_velocity) == pytest.approx(10 * np.pi)


def test_the_standard_deviation_is_the_spread_of_draws():
    rng = np.random.default_rng(1)
    time, turns = np.array([0, 0.2, 0.41, 0.6]), np.array([0, 1, 2, 3.0])
    rates = [
        measure_spin(time + 0.01 * rng.normal(size=4), turns + 0.04 * rng.normal(size=4)).rate for _ in range(4000)
    ]
    spin = measure_spin(time, turns, sigma_time_s=0.01, sigma_turns=0.04)
    assert np.std(rates) == pytest.approx(spin.sigma_rate, rel=0.05)
    assert np.abs(spin.residual_turns).max() < 0.05


def test_a_given_axis_and_sense():
    spin = measure_spin([0, 1.0], [0, -2], axis=[0, 0, 2.0])
    np.testing.assert_allclose(spin.angular_velocity, [0, 0, -4 * np.pi])
    assert np.isnan(measure_spin([0, 1.0], [0, 1], velocity=np.array([0, 0, -5.0])).axis).all()


@pytest.mark.parametrize(
    ("time", "turns", "more", "said"),
    [
        ([1.0], [0], {}, "two marks or more"),
        ([1.0, 2.0], [0, 1, 2], {}, "two marks or more"),
        ([1.0, 1.0], [0, 1], {}, "are at one time"),
        ([0, 1], [0, np.nan], {}, "are at one time, or not numbers"),
        ([0, 1], [0, 1], {"sigma_turns": -1}, "negative or not a number"),
        ([0, 1], [0, 1], {"sigma_time_s": np.nan}, "negative or not a number"),
        ([0, 1], [0, 1], {"axis": [0, 0, 0]}, "axis of the spin has length zero"),
    ],
)
def test_what_cannot_be_measured(time, turns, more, said):
    with pytest.raises(InputError, match=said):
        measure_spin(time, turns, **more)
