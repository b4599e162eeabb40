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
USED, DIMENSIONS = ERRORS + 2, ERRORS + 4
"""Two are for the tilt of the normal. The last two are not used: without them all points would be other ones."""


def points() -> np.ndarray:
    """(2^DRAWS_LOG2, 11) in [0, 1)."""
    sequence = qmc.Sobol(DIMENSIONS, rng=np.random.default_rng(0), bits=BITS)
    return sequence.random_base2(DRAWS_LOG2)[:, :USED]


def main() -> None:
    DRAWS_FILE.parent.mkdir(exist_ok=True)
    np.save(DRAWS_FILE, (points() * 2.0**32).astype(np.uint32))
    print(f"{Path(DRAWS_FILE.parent.name, DRAWS_FILE.name)}: {DRAWS_FILE.stat().st_size} bytes")


if __name__ == "__main__":
    main()
