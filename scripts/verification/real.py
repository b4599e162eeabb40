# SPDX-License-Identifier: GPL-3.0-or-later
"""Real footage and real falls, with what is known about them: what the scripts of `scripts/comparisons` print."""

import contextlib
import io
import runpy
import sys
from pathlib import Path

from checks import paragraph

TITLE = "Real data"
SUMMARY = "filmed balls, an instrumented block, a laboratory, and 80 real runs"
SCRIPTS = Path(__file__).parents[1] / "comparisons"
SECTIONS = (
    (
        "bouncing_ball",
        "A filmed ball",
        "A ball of 7 cm in a small video of 187 pictures a second; nobody measured the camera. Known: gravity, and "
        "that the floor is level. Parabolas fitted in the picture, where each flight has a scale of its own, give an "
        "R_N that owes nothing to the camera model. What the assumed focal length and the pitch do to R_N is shown by "
        "varying them: the spread over the lines, not the ± of one line, is what is not known.",
    ),
    (
        "two_cameras",
        "A table tennis ball in two cameras",
        "45 throws. Known: the table's height, the ball's radius, gravity. What one camera tells is compared with the "
        "other one, which it has not seen. Drag and lift of a light ball that spins are the largest of what is not "
        "modelled: g comes out 1.5 to 2.7 % low, one to two of its deviations.",
    ),
    (
        "chant_sura",
        "An instrumented block on a slope",
        "Four impacts at Chant Sura (Lu et al. 2019) with the velocities that sensors in the block gave. Known: places "
        "to decimetres, times to hundredths of a second, scars of 1.4 to 1.8 m. What a contact that is no point does "
        "to eq. 6 is as large as the differences.",
    ),
    (
        "kharaz",
        "A sphere on glass",
        "Kharaz, Gorham & Salman 2001: R_T and spin over the angle of incidence. It tells the form of a model's "
        "tangential law, not its parameters for rock on soil.",
    ),
    (
        "tschamut",
        "80 blocks at Tschamut",
        "Run-outs of real blocks beside those of the models, on a terrain of 5 m cells that feels none of the real "
        "roughness: blind with their defaults; fitted to half of the runs, the other half predicted, beside the half's "
        "own distribution; and the longest third alone. The order of magnitude, not which model is right.",
    ),
)


def page(folder: Path) -> str:
    """The chapter as Markdown; some minutes."""
    lines = [
        f"# {TITLE}",
        "",
        *paragraph(
            "What is known of each, and what came out. Nothing is fitted to what is known. Written by "
            "`scripts/verification/real.py` from the scripts that are named, which can be run one by one."
        ),
    ]
    for name, title, words in SECTIONS:
        lines += [
            "",
            f"## {title}",
            "",
            *paragraph(words),
            "",
            f"`python scripts/comparisons/{name}.py`:",
            "",
            "```text",
        ]
        lines += [line.rstrip() for line in printed(SCRIPTS / f"{name}.py").rstrip().splitlines()]
        lines += ["```"]
    return "\n".join(lines) + "\n"


def printed(script: Path) -> str:
    """What a script prints."""
    before, out = sys.argv, io.StringIO()
    sys.argv = [str(script)]
    try:
        with contextlib.redirect_stdout(out):
            runpy.run_path(str(script), run_name="__main__")
    finally:
        sys.argv = before
    return out.getvalue()
