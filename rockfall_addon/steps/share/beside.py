# SPDX-License-Identifier: GPL-3.0-or-later
"""Another Blender of this kind, which does a job while this one goes on."""

import sys

import bpy

from .... import __package__ as PACKAGE  # noqa: N812

RUN = "import sys; from {package}.rockfall_addon.steps.share.__main__ import main; main(sys.argv[-1])"


def blender_command() -> tuple[str, ...]:
    """What runs `__main__` there; the job follows it."""
    if not bpy.app.binary_path:
        return sys.executable, "-m", f"{PACKAGE}.rockfall_addon.steps.share"
    script = RUN.format(package=PACKAGE)
    options = ("--background", "--addons", PACKAGE, "--python-exit-code", "1", "--python-expr", script)
    return bpy.app.binary_path, *options, "--"
