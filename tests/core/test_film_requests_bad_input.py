# SPDX-License-Identifier: GPL-3.0-or-later
"""What `rockfall render --film` refuses: what is wrong, and what to do; nothing is written."""

from pathlib import Path

import pytest
from rockfall.core.cli import main

DEMO = Path(__file__).parents[2] / "assets" / "demo" / "footage" / "project.toml"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--sun", "315,50"], "--sun is of composed films. Add --film and a name"),
        (["--images"], "--images is of composed films. Add --film and a name"),
        (["--film", "overlay", "--slope"], "--slope is not of composed films. Leave it out"),
        (["--film", "overlay", "--codec", "vp9"], "There is no codec 'vp9'. Codecs: h264, h265, av1"),
        (["--film", "overlay", "--model", "noel_2017", "--number", "0"], "Give --number 1 or more"),
        (["--film", "overlay", "--model", "noel_2017", "--number", "60000"], "Give --number 50000 or less"),
        (["--film", "overlay", "--rate", "1e-9"], "1e-09 seconds of the fall in a second of film"),
        (["--film", "overlay", "--freeze", "1e9"], "A film cannot stand still for 1e+09 s. Give --freeze 0 to 60"),
        (["--film", "overlay", "--terrain-colours", "red"], "Terrain colours cannot be from 'red'. Choose one of"),
    ],
)
def test_requests_that_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(["render", str(DEMO), *words, "--out", str(tmp_path / "out")]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
