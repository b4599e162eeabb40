# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps and inverses of normal equations, for unknowns of any units and where something is not determined."""

import numpy as np
import pytest
from rockfall.core.least_squares import believed_scatter, damped_step, inverse, scales, sums_by

UNITS = np.array([1e-9, 1.0, 1e7, 1e3])


def normal_equations(rng: np.random.Generator, problems: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Problems of four unknowns in units that differ by 16 powers of ten."""
    design = rng.normal(size=(problems, 12, 4))
    right = rng.normal(size=(problems, 12))
    normal = np.swapaxes(design, 1, 2) @ design / np.outer(UNITS, UNITS)
    return normal, (np.swapaxes(design, 1, 2) @ right[:, :, None])[..., 0] / UNITS


def test_a_step_is_the_solution_in_any_units():
    """Each unknown is damped by its own part of the diagonal; one problem or many, one damping or one for each."""
    normal, right = normal_equations(np.random.default_rng(1))
    damping = np.array([0.0, 1e-3, 0.5, 2.0, 1e6])
    steps = damped_step(normal, right, damping)
    for n, b, factor, step in zip(normal, right, damping, steps, strict=True):
        own = np.outer(UNITS, UNITS) * (n + factor * np.diag(np.diag(n)))
        expected = UNITS * np.linalg.solve(own, UNITS * b)
        np.testing.assert_allclose(step / UNITS, expected / UNITS, rtol=1e-12)
        np.testing.assert_allclose(damped_step(n, b, factor) / UNITS, expected / UNITS, rtol=1e-12)
    np.testing.assert_allclose(damped_step(normal, right)[0], steps[0], rtol=1e-12)


@pytest.mark.parametrize("damping", [0.0, 1e-3])
def test_what_nothing_is_known_of_does_not_move(damping):
    normal, right = normal_equations(np.random.default_rng(2), 3)
    normal[:, 2], normal[:, :, 2], right[:, 2] = 0.0, 0.0, 0.0
    rest = np.ix_([0, 1, 2], [0, 1, 3], [0, 1, 3])
    for step in (
        damped_step(normal, right, damping),
        np.array([damped_step(n, b, damping) for n, b in zip(normal, right, strict=True)]),
    ):
        assert (step[:, 2] == 0).all()
        np.testing.assert_allclose(step[:, [0, 1, 3]], damped_step(normal[rest], right[:, [0, 1, 3]], damping))
    np.testing.assert_array_equal(scales(normal)[:, 2], 1.0)


def test_singular_equations_give_the_shortest_step():
    direction = np.array([1.0, 1.0])
    np.testing.assert_allclose(damped_step(np.outer(direction, direction), 2 * direction), [1.0, 1.0])


def test_an_inverse_is_a_covariance_in_any_units():
    normal, _ = normal_equations(np.random.default_rng(3))
    for partly in (False, True):
        found = inverse(normal, partly=partly) / np.outer(UNITS, UNITS)
        np.testing.assert_allclose(found, np.linalg.inv(normal * np.outer(UNITS, UNITS)), rtol=1e-10)
        np.testing.assert_allclose(inverse(normal[1], partly=partly) / np.outer(UNITS, UNITS), found[1], rtol=1e-12)


def test_what_is_not_determined_is_infinite_or_left_out():
    normal, _ = normal_equations(np.random.default_rng(4), 2)
    normal[0, 1], normal[0, :, 1] = 0.0, 0.0
    found = inverse(normal)
    assert np.isposinf(found[0]).all()
    assert np.isfinite(found[1]).all()
    part = inverse(normal, partly=True)
    assert np.abs(part[0] / np.outer(UNITS, UNITS))[1].max() < 1e-15
    rest = np.ix_([0, 2, 3], [0, 2, 3])
    np.testing.assert_allclose(part[0][rest], inverse(normal[0][rest]))
    np.testing.assert_array_equal(part[1], found[1])


def test_sums_of_rows():
    values = np.arange(12.0).reshape(3, 2, 2)
    found = sums_by(np.array([2, 0, 2]), values, 4)
    np.testing.assert_array_equal(found, [values[1], np.zeros((2, 2)), values[0] + values[2], np.zeros((2, 2))])


def test_the_scatter_of_what_is_believed():
    """1 for residuals as stated, also with a fifth of wrong ones; larger by the factor that they are."""
    rng = np.random.default_rng(5)
    length = np.linalg.norm(rng.normal(size=(4000, 2)), axis=1)
    assert believed_scatter(length) == pytest.approx(1.0, abs=0.03)
    assert believed_scatter(3 * length) == pytest.approx(3.0, rel=0.03)
    length[:800] *= 50
    assert believed_scatter(3 * length) == pytest.approx(3.0, rel=0.05)
    assert believed_scatter(np.zeros(0)) == believed_scatter(0.1 * length[800:]) == 1.0
