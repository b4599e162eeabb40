# SPDX-License-Identifier: GPL-3.0-or-later
"""Make docs/images/maps.jpg: two maps of the demo site beside each other.

python scripts/making/maps_picture.py
"""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from rockfall.core import cli

ROOT = Path(__file__).resolve().parents[2]
MAPS = ("Reach_probability", "E_95CI")
WIDTH = 1000
"""Of each map in the picture [px]."""


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        demo = str(ROOT / "assets" / "demo" / "project.toml")
        asked = ["--model", "noel_2017", "--number", "500", "--cell", "1", "--record", "none"]
        assert cli.main(["simulate", demo, *asked, "--out", folder]) == 0
        pictures = [Image.open(Path(folder) / "maps" / f"{name}.png").convert("RGB") for name in MAPS]
    small = [one.resize((WIDTH, round(one.height * WIDTH / one.width)), Image.Resampling.LANCZOS) for one in pictures]
    height = max(one.height for one in small)
    sheet = np.full((height, WIDTH * len(small), 3), 255, np.uint8)
    for place, one in enumerate(small):
        sheet[: one.height, WIDTH * place : WIDTH * (place + 1)] = np.asarray(one)
    Image.fromarray(sheet).save(ROOT / "docs" / "images" / "maps.jpg", quality=88, optimize=True)


if __name__ == "__main__":
    main()
