# SPDX-License-Identifier: GPL-3.0-or-later
"""The interval of a median of impacts: as often right as it says, though the impacts of a trajectory are alike."""

from pathlib import Path

import numpy as np
import pytest
import rockfall
from rockfall.core import cli
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


def test_medians_name_the_radius_of_their_normals(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A project's own radius, and the one that is taken by default, give other medians: both are said."""
    demo = Path(rockfall.__file__).parent / "assets" / "demo"
    for radius in ("0.6", "1.5"):
        options = ["--terrain", str(demo / "terrain.ply"), "--normal-radius", radius, "--out", str(tmp_path / radius)]
        assert cli.main(["reconstruct", str(demo / "picks.csv"), *options]) == 0
        assert f"The terrain normals are of a radius of {float(radius):.2f} m" in capsys.readouterr().out
    assert cli.main(["statistics", str(tmp_path / "1.5" / "impacts.csv"), "--out", str(tmp_path / "s")]) == 0
    assert "The terrain normals are of a radius of 1.50 m" in capsys.readouterr().out
    given = tmp_path / "given.csv"
    rows = ["trajectory,time_s,x_m,y_m,z_m,nx,ny,nz", *(f"a,{i},{i},0,{-i},0,0,1" for i in range(4))]
    given.write_text("\n".join(rows))
    assert cli.main(["reconstruct", str(given), "--out", str(tmp_path / "given")]) == 0
    assert "The terrain normals" not in capsys.readouterr().out
