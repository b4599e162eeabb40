# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes, sizes and densities of blocks, against the solids themselves and the laws that they are drawn from."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.simulation.block_shapes import mean_inertia, principal_moments, volumes
from rockfall.core.simulation.blocks import Blocks, MeasuredSizes, block_of, draw_blocks
from rockfall.core.simulation.distributions import Distribution, parse_distribution
from rockfall.core.simulation.release import make_releases
from scipy import stats


def solid(shape: str, axes: np.ndarray, count: int = 400_000) -> tuple[float, np.ndarray]:
    """Volume and principal moments for a density of 1, by points of chance within the box."""
    points = np.random.default_rng(4).uniform(-0.5, 0.5, (count, 3)) * axes
    if shape in ("sphere", "ellipsoid"):
        points = points[((points / (axes / 2)) ** 2).sum(axis=1) <= 1]
    part = axes.prod() / count
    square = (points**2).sum(axis=0) * part
    return len(points) * part, square.sum() - square


@pytest.mark.parametrize(
    ("shape", "axes"),
    [("sphere", (0.7, 0.7, 0.7)), ("cube", (0.7, 0.7, 0.7)), ("box", (1.2, 0.8, 0.5)), ("ellipsoid", (1.2, 0.8, 0.5))],
)
def test_volume_and_inertia_are_those_of_the_solid(shape: str, axes: tuple[float, float, float]) -> None:
    names, rows = np.array([shape]), np.array([axes])
    volume, moments = solid(shape, rows[0])
    assert volumes(names, rows)[0] == pytest.approx(volume, rel=0.005)
    np.testing.assert_allclose(principal_moments(names, rows, volumes(names, rows))[0], moments, rtol=0.01)


def test_sphere_and_cube_have_the_factors_of_the_textbooks() -> None:
    axes = np.full((2, 3), 0.9)
    np.testing.assert_allclose(mean_inertia(np.array(["sphere", "cube"]), axes), [2 / 5, 2 / 3])


def test_contact_is_with_the_mean_diameter_and_round_blocks_take_it() -> None:
    axes = np.array([[1.2, 0.9, 0.6]] * 2)
    made = make_releases(np.zeros((2, 3)), axes_m=axes, shape=np.array(["box", "cube"]), density_kgpm3=2000.0)
    np.testing.assert_allclose(made.radius_m, 0.45)
    np.testing.assert_allclose(made.mass_kg, [2000 * 1.2 * 0.9 * 0.6, 2000 * 0.9**3])
    np.testing.assert_allclose(made.inertia[1], 2 / 3)


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("0.3..0.6", stats.uniform(0.3, 0.3)),
        ("uniform:0.3,0.6", stats.uniform(0.3, 0.3)),
        ("lognormal:0.5,0.2", stats.lognorm(s=np.sqrt(np.log(1.16)), scale=0.5 / np.sqrt(1.16))),
        ("normal:0.5,0.05", stats.norm(0.5, 0.05)),
        ("normal:0.5,0.3", stats.truncnorm(-1.5, np.inf, 0.5, 0.3)),
    ],
)
def test_sizes_follow_their_law(text: str, law) -> None:
    blocks = Blocks(diameter=parse_distribution(text)) if text != "normal:0.5,0.3" else None
    if blocks is None:
        # A tenth of the mean cuts 6.7 % of this law, which is then drawn as what is left of it.
        blocks = Blocks(diameter=Distribution("normal", 0.5, 0.3))
    axes, _ = draw_blocks(blocks, 20_000, 7)
    diameter = axes.mean(axis=1)
    assert diameter.min() > 0
    assert stats.kstest(diameter, law.cdf).pvalue > 1e-3


def test_the_lognormal_law_has_the_mean_and_deviation_that_are_asked() -> None:
    axes, _ = draw_blocks(Blocks(diameter=parse_distribution("lognormal:2,0.5")), 200_000, 1)
    assert axes[:, 0].mean() == pytest.approx(2.0, abs=0.01)
    assert axes[:, 0].std() == pytest.approx(0.5, abs=0.01)


def test_one_more_block_changes_no_other() -> None:
    law = Blocks("box", parse_distribution("0.3..0.6"), (3, 2, 1), parse_distribution("normal:2650,50"))
    few, many = draw_blocks(law, 5, 11), draw_blocks(law, 50, 11)
    for one, other in zip(few, many, strict=True):
        np.testing.assert_array_equal(one, other[:5])
    np.testing.assert_allclose(many[0] / many[0][:, 2:], np.broadcast_to([3, 2, 1], (50, 3)))
    assert np.unique(many[0][:, 0]).size == 50
    assert abs(np.corrcoef(many[0][:, 0], many[1])[0, 1]) < 0.4
    assert (draw_blocks(law, 5, 12)[0] != few[0]).any()


def test_measured_sizes_come_back_as_often_as_each_other() -> None:
    table = MeasuredSizes(np.array([[1.0, 0.8, 0.5], [0.4, 0.4, 0.4], [2.0, 1.0, 1.0]]), np.array([2700, np.nan, 2500]))
    axes, density = draw_blocks(Blocks("ellipsoid", measured=table), 9000, 3)
    rows = np.array([np.flatnonzero((table.axes_m == one).all(axis=1))[0] for one in axes])
    assert abs(np.bincount(rows) - 3000).max() < 4 * np.sqrt(2000)
    np.testing.assert_array_equal(density, np.array([2700, 2650, 2500])[rows])
    cubes, _ = draw_blocks(Blocks("cube", measured=table), 10, 3)
    np.testing.assert_allclose(cubes, cubes[:, :1] * np.ones(3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0", "not above zero"),
        ("-1", "not above zero"),
        ("nan", "not finite"),
        ("normal:-0.5,0.1", "not above zero"),
        ("normal:0.5,0.5", "below a tenth of its mean"),
        ("normal:0.5", "no number and no law"),
        ("norm:0.5,0.1", "Did you mean normal"),
        ("0.6..0.3", "ends below its beginning"),
        ("0..1", "not above zero"),
        ("lognormal:1,-1", "negative"),
        ("large", "no number and no law"),
    ],
)
def test_laws_that_make_no_sense_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_distribution(text)


def test_blocks_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InputError, match="three equal diameters"):
        block_of("sphere", 1, 2, 3)
    with pytest.raises(InputError, match="Did you mean box"):
        Blocks("boxx")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="not above zero"):
        block_of("box", 1, 2, 3, density_kgpm3=0.0)
    with pytest.raises(InputError, match="no proportions"):
        Blocks("box", proportions=(1, 0, 1))
