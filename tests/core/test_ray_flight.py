# SPDX-License-Identifier: GPL-3.0-or-later
"""A free flight from one view and one known point."""

import numpy as np
import pytest
from rockfall.core.reconstruction.ray_flight import flight_through_rays
from rockfall.core.vectors import norm, unit

G = 9.81
EYE = np.array([0.0, -80.0, 10.0])
POINT, VELOCITY = np.array([1.0, 2.0, 3.0]), np.array([7.0, -2.5, -6.0])


def rays(times: np.ndarray, acceleration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    place = POINT + VELOCITY * times[:, None] + 0.5 * acceleration * times[:, None] ** 2
    return np.broadcast_to(EYE, place.shape), unit(place - EYE)


@pytest.mark.parametrize("times", [np.linspace(-0.6, -0.03, 15), np.linspace(0.03, 0.9, 25)])
def test_exact_rays_give_the_exact_flight(times: np.ndarray) -> None:
    origins, directions = rays(times, np.array([0.0, 0.0, -G]))
    found = flight_through_rays(POINT, 5.0, origins, directions, times + 5.0, G)
    np.testing.assert_allclose(found.velocity, VELOCITY, atol=1e-9)
    np.testing.assert_allclose(unit(found.position - EYE), directions, atol=1e-12)
    assert found.miss.max() < 1e-12


def test_rolling_is_no_flight() -> None:
    times = np.linspace(0.05, 3.0, 60)
    origins, directions = rays(times, -0.3 * VELOCITY)
    found = flight_through_rays(POINT, 0.0, origins, directions, times, G)
    assert np.sqrt(np.mean(found.miss**2)) > 0.005  # 10 px at a focal length of 2000


def test_noise_shows_in_the_misses() -> None:
    random = np.random.default_rng(4)
    times = np.linspace(0.03, 0.9, 40)
    origins, directions = rays(times, np.array([0.0, 0.0, -G]))
    noisy = unit(directions + 2e-4 * random.standard_normal(directions.shape))
    found = flight_through_rays(POINT, 0.0, origins, noisy, times, G)
    assert norm(found.velocity - VELOCITY) < 0.5
    assert np.sqrt(np.mean(found.miss**2)) == pytest.approx(2e-4 * np.sqrt(2), rel=0.25)
