# SPDX-License-Identifier: GPL-3.0-or-later
"""The interval of a median of impacts: as often right as it says, though the impacts of a trajectory are alike."""

import numpy as np
from rockfall.core.reconstruction.summary import FEWEST_TRAJECTORIES, median_interval


def test_it_holds_the_true_median_as_often_as_it_says() -> None:
    random = np.random.default_rng(5)
    held = naive = 0
    for _ in range(400):
        # 24 trajectories of 6 impacts; what a trajectory's impacts share is as large as what they do not.
        own = np.repeat(random.normal(size=24), 6)
        values = own + random.normal(size=144)
        low, high = median_interval(values, np.repeat([f"t{i}" for i in range(24)], 6))
        held += low <= 0 <= high
        low, high = median_interval(values, np.arange(144).astype(str))  # as if all were independent
        naive += low <= 0 <= high
    assert 0.91 < held / 400 < 0.98  # 0.957 of 9000
    assert naive / 400 < 0.85


def test_few_trajectories_have_none_and_nan_is_left_out() -> None:
    names = np.array([f"t{i}" for i in range(FEWEST_TRAJECTORIES)])
    assert median_interval(np.arange(len(names) - 1.0), names[:-1]) is None
    values = np.arange(float(len(names)))
    assert median_interval(values, names) is not None
    assert median_interval(np.r_[values[:-1], np.nan], names) is None
    assert median_interval(np.full(len(names), 3.5), names) == (3.5, 3.5)
