# SPDX-License-Identifier: GPL-3.0-or-later
"""Eq. 5–6 against four instrumented impacts: Lu et al. 2019, table 2, shipped as an example."""

import csv
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.exchange.tables import read_picks
from rockfall.core.reconstruction.block import Block
from rockfall.core.reconstruction.trajectory import reconstruct

EXAMPLE = Path(__file__).parents[2] / "assets" / "examples" / "chant_sura_lu2019"


@pytest.fixture(scope="module")
def impacts():
    block = Block(0.8, 0.8, 0.8)
    block = Block(0.8, 0.8, 0.8, density=780 / block.volume_m3)
    return reconstruct(read_picks(EXAMPLE / "picks.csv"), block=block).impacts


@pytest.fixture(scope="module")
def instrument():
    with (EXAMPLE / "instrument.csv").open(encoding="utf-8") as stream:
        return [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(stream)]


def test_the_picks_are_those_of_the_table(impacts, instrument):
    table = [(row["t_start_s"], row["x_start_m"], row["y_start_m"], row["z_start_m"]) for row in instrument]
    survey = impacts.shift.to_survey(impacts.position)
    np.testing.assert_array_equal(np.column_stack([impacts.time_s, survey]), table)


def test_speeds_agree_within_11_percent_but_are_too_steep(impacts, instrument):
    measured = np.array([[row["vx_mps"], row["vy_mps"], row["vz_mps"]] for row in instrument])[1:]
    ratio = np.linalg.norm(impacts.v1[1:], axis=1) / np.linalg.norm(measured, axis=1)
    np.testing.assert_allclose(ratio, [0.943, 1.104, 1.025], atol=1e-3)
    np.testing.assert_allclose(impacts.v1[1:, 2] - measured[:, 2], [-1.853, -3.213, -3.015], atol=1e-3)
    level = np.linalg.norm(impacts.v1[1:, :2], axis=1) - np.linalg.norm(measured[:, :2], axis=1)
    np.testing.assert_allclose(level, [-3.159, -0.545, -1.568], atol=1e-3)


def test_r_and_deviation_need_no_normal(impacts):
    assert np.isfinite(impacts.r).tolist() == [False, True, True, False]
    np.testing.assert_allclose(impacts.r[1:3], [0.8845, 0.7618], atol=1e-4)
    np.testing.assert_allclose(np.degrees(impacts.theta_dev[1:3]), [22.052, 29.055], atol=1e-3)
    assert np.isnan(impacts.rn).all()
    assert impacts.kinetic1_j[1] == pytest.approx(390 * np.sum(impacts.v1[1] ** 2))
