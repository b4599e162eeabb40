# SPDX-License-Identifier: GPL-3.0-or-later
"""Make assets/intervals/draws.npy: the points that the intervals of impacts are drawn at.

They are those of SciPy's scrambled Sobol sequence. In a file they need no `scipy.stats`, which takes a third of the
time of `rockfall reconstruct` to load, and they stay the same when SciPy changes.
"""

from pathlib import Path

import numpy as np
from rockfall.core.reconstruction.intervals import DRAWS_FILE, DRAWS_LOG2
from rockfall.core.reconstruction.uncertainty import ERRORS
from scipy.stats import qmc

BITS = 30
"""Of a number of SciPy's sequence."""
BESIDE_ERRORS = 4
"""Dimensions for the tilt of the normal (2) and for the roughness (2)."""


def points() -> np.ndarray:
    """(2^DRAWS_LOG2, 13) in [0, 1)."""
    return qmc.Sobol(ERRORS + BESIDE_ERRORS, rng=np.random.default_rng(0), bits=BITS).random_base2(DRAWS_LOG2)


def main() -> None:
    DRAWS_FILE.parent.mkdir(exist_ok=True)
    np.save(DRAWS_FILE, (points() * 2.0**32).astype(np.uint32))
    print(f"{Path(DRAWS_FILE.parent.name, DRAWS_FILE.name)}: {DRAWS_FILE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
