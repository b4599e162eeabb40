# SPDX-License-Identifier: GPL-3.0-or-later
"""What is prepared is what is needed: afterwards nothing is compiled, or read from the disk, any more."""

import os
import subprocess
import sys
from pathlib import Path

ASKED = """
from rockfall.core.analysis.comparison import compare
from rockfall.core.analysis.curves import fit_curve
from rockfall.core.analysis.graph_series import measured_series
from rockfall.core.analysis.graphs import PAPER_GRAPHS
from rockfall.core.analysis.preparation import prepare_fits, prepare_model
from rockfall.core.workflow.opening import open_project
from rockfall.core.exchange.project import read_project
from rockfall.core.impact_models.registry import COMPARED
from rockfall.core.kept_code import KeptCode
import numpy as np

_, result = open_project(read_project({project!r}))
prepare_fits()
for name in COMPARED:
    prepare_model(name)
needed, load = [], KeptCode.load_overload


def counted(kept, *arguments):
    needed.append(kept._function.__qualname__)
    return load(kept, *arguments)


KeptCode.load_overload = counted
compare(result.impacts, COMPARED, replicates=2)
for spec in PAPER_GRAPHS:
    points = measured_series(result.impacts, spec.x, spec.y, np.arange(len(result.impacts))).points
    fit_curve(spec.fitted, points[np.isfinite(points).all(axis=1)], (0.0, 90.0), (0.0, 5.0), interval=False)
print(needed)
"""


def test_what_is_prepared_is_not_compiled_again() -> None:
    project = Path(__file__).resolve().parents[2] / "assets" / "demo" / "project.toml"
    code = ASKED.format(project=str(project))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ, check=False)
    assert done.stdout.strip().endswith("[]"), done.stdout + done.stderr
