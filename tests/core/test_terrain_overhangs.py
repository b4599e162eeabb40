# SPDX-License-Identifier: GPL-3.0-or-later
"""Clouds with an overhang of known size, and clouds that only look as if they had one."""

from pathlib import Path

import numpy as np
import pytest
from rockfall.core.terrain.clouds import read_las
from rockfall.core.terrain.overhangs import find_overhangs
from rockfall.core.terrain.readers import read_terrain

DATA = Path(__file__).parents[1] / "data"
NOISE_M = pytest.mark.parametrize("noise_m", [0.0, 0.02])


def slope(rng, dip_deg, noise_m, count=60_000, side=40.0):
    """A plane of side × side metres, counted along it."""
    along, y = side * rng.random(count), side * rng.random(count)
    dip = np.radians(dip_deg)
    points = np.column_stack([along * np.cos(dip), y, along * np.sin(dip)])
    return points + rng.normal(0, noise_m, points.shape) if noise_m else points


def with_roof(rng, noise_m, dip_deg=30.0):
    """That slope, and 6 m above it a level roof from x = 10 to 16 m, y = 20 to 30 m."""
    count = 3_000
    roof = np.column_stack(
        [rng.uniform(10, 16, count), rng.uniform(20, 30, count), np.full(count, 16 * np.tan(np.radians(dip_deg)) + 6)]
    )
    return np.vstack([slope(rng, dip_deg, noise_m), roof + rng.normal(0, noise_m, roof.shape)])


@NOISE_M
def test_an_overhang_is_found_with_its_size(noise_m):
    found = find_overhangs(with_roof(np.random.default_rng(0), noise_m))
    assert found.patches == 1
    assert found.area_m2 == pytest.approx(60, rel=0.15)
    assert found.share == pytest.approx(60 / (40 * 40 * np.cos(np.radians(30))), rel=0.15)
    assert found.height_m == pytest.approx(6 + 6 * np.tan(np.radians(30)), abs=0.5)
    assert 10 < found.place[0] < 16
    assert 20 < found.place[1] < 30


@NOISE_M
@pytest.mark.parametrize("dip_deg", [0, 45, 70, 85, 89])
def test_a_slope_has_none_however_steep(dip_deg, noise_m):
    assert find_overhangs(slope(np.random.default_rng(1), dip_deg, noise_m)) is None


@NOISE_M
def test_walls_with_holes_above_level_ground_have_none(noise_m):
    rng, parts = np.random.default_rng(2), []
    for i in range(5):
        parts.append(np.column_stack([5 * (i + rng.random(8_000)), 40 * rng.random(8_000), np.full(8_000, 6.0 * i)]))
        y, z = 40 * rng.random(10_000), 6 * rng.random(10_000)
        seen = (np.abs(y - 20) > 4) | (np.abs(z - 3) > 2)
        parts.append(np.column_stack([np.full(10_000, 5.0 * i + 5), y, 6 * i + z])[seen])
    points = np.vstack(parts)
    assert find_overhangs(points + rng.normal(0, noise_m, points.shape)) is None


@pytest.mark.parametrize("name", ["las_chablais3.laz", "sample_lareunion_epsg2975.laz"])
def test_trees_are_no_overhangs(name):
    points = read_las(DATA / name, ground_only=False).points
    assert find_overhangs(points - points.min(axis=0)) is None


def test_points_that_are_stored_many_times_have_none():
    points = slope(np.random.default_rng(4), 30, 0.0, count=400)
    assert find_overhangs(np.vstack([points, np.repeat(points[:5], 60, axis=0)])) is None
    assert find_overhangs(np.repeat(points[:1], 200, axis=0)) is None


def test_it_is_said_first_with_a_place_in_survey_coordinates(tmp_path):
    points = with_roof(np.random.default_rng(3), 0.0) + np.array([2_600_000, 1_200_000, 0])
    np.savetxt(tmp_path / "roof.xyz", points, fmt="%.4f")
    first = read_terrain(tmp_path / "roof.xyz").summary[0]
    assert first.startswith("The cloud has an overhang over")
    x, y = (float(number) for number in first.partition("near (")[2].partition(")")[0].split(","))
    assert 2_600_010 < x < 2_600_016
    assert 1_200_020 < y < 1_200_030
