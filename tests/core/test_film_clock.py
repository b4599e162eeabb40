# SPDX-License-Identifier: GPL-3.0-or-later
"""The time of a film against that of the fall: against quadrature, and seconds counted by hand."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.film.composed.film_clock import Freeze, Slow, film_clock
from scipy.integrate import quad


def test_a_steady_rate() -> None:
    clock = film_clock(10.0, 16.0, rate=0.5)
    assert clock.duration_s == pytest.approx(12.0)
    assert clock.fall_at([-1.0, 0.0, 3.0, 12.0, 99.0]) == pytest.approx([10, 10, 11.5, 16, 16])
    assert clock.rate_at(5.0) == pytest.approx(0.5)


def test_a_freeze_stands_exactly_at_its_moment() -> None:
    clock = film_clock(0.0, 4.0, freezes=[Freeze(1.5, 0.5), Freeze(9.0, 3.0)])
    assert clock.duration_s == pytest.approx(4.5)
    assert clock.fall_at([1.5, 1.7, 1.99]).tolist() == [1.5, 1.5, 1.5]
    assert clock.rate_at(1.75) == 0.0
    assert clock.fall_at([2.25]) == pytest.approx([1.75])


def test_ramps_take_as_long_as_the_integral_says() -> None:
    def rate(t: float) -> float:
        one = np.interp(abs(t - 2.0), [0.15, 0.4], [0.1, 1.0])
        two = np.interp(abs(t - 2.5), [0.1, 0.6], [0.25, 1.0])
        return float(min(one, two))

    clock = film_clock(0.0, 5.0, slow=[Slow(2.0, 0.1), Slow(2.5, 0.25, 0.1, 0.5)])
    expected = quad(lambda t: 1 / rate(t), 0, 5, points=[1.6, 1.85, 2.15, 2.3, 2.4, 2.6, 3.1], limit=400)[0]
    assert clock.duration_s == pytest.approx(expected, rel=1e-6)
    film = np.linspace(0, clock.duration_s, 2001)
    fall = clock.fall_at(film)
    assert (np.diff(fall) > 0).all()
    slope = np.gradient(fall, film)[5:-5:50]
    assert slope == pytest.approx([rate(t) for t in fall[5:-5:50]], abs=0.01)
    assert clock.rate_at(float(np.interp(2.0, fall, film))) == pytest.approx(0.1, rel=1e-3)


def test_bad_times_are_refused() -> None:
    with pytest.raises(InputError, match="shows nothing"):
        film_clock(3.0, 3.0)
    with pytest.raises(InputError, match="times the speed"):
        film_clock(0.0, 1.0, rate=0.0)
    with pytest.raises(InputError, match="negative duration"):
        film_clock(0.0, 1.0, freezes=[Freeze(0.5, -1.0)])
