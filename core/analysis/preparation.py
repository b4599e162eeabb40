# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile what comparing models needs, or read it from the disk, before somebody waits for it."""

from functools import cache

import numpy as np

from ..reconstruction.impact import Impacts
from ..reconstruction.picks import make_picks
from ..reconstruction.trajectory import reconstruct
from .comparison import compare
from .curves import fit_curve

RUNS, TIMES_S = 6, (0.0, 0.7, 1.3, 2.2, 2.9)


def prepare_model(name: str) -> None:
    """All that a model on measured impacts runs."""
    compare(_some_impacts(), [name], replicates=1)


def prepare_fits() -> None:
    """All that curves through points run."""
    x = np.linspace(1.0, 9.0, 12)
    for trend in ("origin", "line", "power"):
        fit_curve(trend, np.stack([x, 1.0 + x + np.sin(5.0 * x)], axis=1), (0.0, 10.0), (0.0, 12.0), interval=False)


@cache
def _some_impacts() -> Impacts:
    """A few runs down a plane: enough for the models that draw from the impacts of other runs."""
    time_s, run = np.tile(TIMES_S, RUNS), np.repeat(np.arange(RUNS), len(TIMES_S))
    place = np.column_stack([6.0 * time_s, run, (run / 9 - 4.0) * time_s])
    normal = np.tile([0.5, 0.0, np.sqrt(0.75)], (run.size, 1))
    return reconstruct(make_picks([str(number) for number in run.tolist()], time_s, place, normal=normal)).impacts
