# SPDX-License-Identifier: GPL-3.0-or-later
"""Make docs/manual/images/trees.jpg: reach probability of the demo site without and with a forest.

python scripts/making/trees_picture.py
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from rockfall.core import cli

ROOT = Path(__file__).resolve().parents[2]
FOREST = ("--stems-per-hectare", "400", "--dbh-cm", "30,10")
WIDTH = 1000
"""Of each map in the picture [px]."""


def reach(folder: str, *forest: str) -> Image.Image:
    """The map of reach probability."""
    demo = str(ROOT / "assets" / "demo" / "project.toml")
    asked = ["--model", "noel_2017", "--number", "300", "--cell", "1", "--record", "none", *forest]
    assert cli.main(["simulate", demo, *asked, "--out", folder]) == 0
    picture = Image.open(Path(folder) / "maps" / "Reach_probability.png").convert("RGB")
    return picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.Resampling.LANCZOS)


def main() -> None:
    with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
        both = np.hstack([np.asarray(reach(one)), np.asarray(reach(other, *FOREST))])
    Image.fromarray(both).save(ROOT / "docs" / "manual" / "images" / "trees.jpg", quality=85, optimize=True)


if __name__ == "__main__":
    main()
