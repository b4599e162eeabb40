# SPDX-License-Identifier: GPL-3.0-or-later
"""The ground filter against a surveyor's classes, and against slopes that are made here."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.progress import CancelledError
from rockfall.core.terrain.clouds import read_las
from rockfall.core.terrain.ground_filter import filter_ground
from scipy.interpolate import LinearNDInterpolator

DATA = Path(__file__).parent.parent / "data"


def forest(slope_deg, rng, width=40.0, density=6.0):
    """A slope with ripples, half of it under plants of 0.5 to 12 m: points, and which are ground."""
    count = int(width * width * density)
    plan = rng.random((count, 2)) * width
    x, y = plan.T
    ground = np.tan(np.radians(slope_deg)) * x + 0.3 * np.sin(x / 3) * np.cos(y / 4) + rng.normal(0, 0.02, count)
    plants = (rng.random(count) < 0.7) & (np.sin(x / 4) * np.sin(y / 5) > 0)
    return np.column_stack([plan, ground + np.where(plants, rng.uniform(0.5, 12, count), 0)]), ~plants


def test_a_classified_tile_gets_its_surveyors_ground_back():
    every = read_las(DATA / "las_chablais3.laz", ground_only=False).points
    classed = read_las(DATA / "las_chablais3.laz", ground_only=True).points
    every, classed = every - every.min(axis=0), classed - every.min(axis=0)
    found = filter_ground(every).ground
    truth = np.isin(every.view("f8,f8,f8"), classed.view("f8,f8,f8")).ravel()
    assert truth.sum() == 8_047
    assert found[truth].mean() > 0.98
    assert found[~truth].mean() < 0.12
    x, y = np.mgrid[3:79:1, 3:80:1]
    above = [LinearNDInterpolator(part[:, :2], part[:, 2])(x, y) for part in (every[found], every[truth])]
    apart = (above[0] - above[1])[np.isfinite(above[0] - above[1])]
    assert abs(np.mean(apart)) < 0.05
    assert np.std(apart) < 0.1


@pytest.mark.parametrize("slope_deg", [0, 35, 60])
def test_plants_go_and_the_ground_stays_however_steep(slope_deg):
    points, truth = forest(slope_deg, np.random.default_rng(slope_deg))
    found = filter_ground(points).ground
    assert found[truth].mean() > 0.95
    assert found[~truth].mean() < 0.02


def test_bare_ground_stays_whole():
    points, truth = forest(40, np.random.default_rng(1))
    assert filter_ground(points[truth]).ground.mean() > 0.99


def test_a_return_from_far_below_does_not_pull_the_cloth_down():
    points, truth = forest(30, np.random.default_rng(2))
    low = points[truth][100] - [0, 0, 30]
    result = filter_ground(np.vstack([points, low]))
    np.testing.assert_array_equal(result.ground[:-1], filter_ground(points).ground)
    assert not result.ground[-1]
    assert any("1 cell " in note for note in result.notes)


def test_the_same_at_survey_coordinates_and_from_the_other_side():
    points, _ = forest(30, np.random.default_rng(3))
    expected = filter_ground(points).ground
    far = filter_ground(points + np.array([2_600_000, 1_200_000, 2_000])).ground
    assert (far == expected).mean() > 0.9999


@pytest.mark.parametrize(("cell_m", "words"), [(20.0, "too small"), (0.0, "no length"), (1e-4, "more than")])
def test_cells_that_cannot_be(cell_m, words):
    points, _ = forest(30, np.random.default_rng(4))
    with pytest.raises(InputError, match=words):
        filter_ground(points, cell_m)


def test_it_says_how_far_it_is_and_ends_when_asked():
    points, _ = forest(20.0, np.random.default_rng(3))
    told = []

    def progress(text, done, total):
        told.append((text, done, total))
        if done >= 20:
            raise CancelledError

    with pytest.raises(CancelledError):
        filter_ground(points, progress=progress)
    steps = [done for text, done, _ in told if "cloth" in text]
    assert steps == [0, 10, 20]
    assert all(done <= total for _, done, total in told)
