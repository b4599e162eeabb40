# SPDX-License-Identifier: GPL-3.0-or-later
"""Which render engine works on this machine.

Without a working OpenGL, Workbench and EEVEE do not fail but take the whole process with them, so they are tried in a
process of their own.
"""

import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from tempfile import TemporaryFile

from ..children import child
from ..errors import DependencyError

ENGINES = ("auto", "cycles", "workbench", "eevee")
MEASURED = "measured"
"""Cycles or Workbench without a graphics card, whichever is found quicker by a frame of the film in each."""
PROBE_LIMIT_S = 180.0  # EEVEE compiles its shaders when it is first used
IDENTIFIERS = {"workbench": "BLENDER_WORKBENCH", "eevee": "BLENDER_EEVEE", "cycles": "CYCLES"}
PASSED = "engine works:"

PROBE = """
import os, threading
def watch():
    os.read(0, 1)
    os._exit(1)
threading.Thread(target=watch, daemon=True).start()
import bpy
scene = bpy.data.scenes.new("probe")
camera = bpy.data.objects.new("probe", bpy.data.cameras.new("probe"))
scene.collection.objects.link(camera)
scene.camera = camera
scene.render.engine = "{identifier}"
scene.render.resolution_x = scene.render.resolution_y = 16
bpy.ops.render.render(scene=scene.name)
import gpu
try:
    kind = gpu.platform.device_type_get()
except SystemError:
    kind = "UNKNOWN"
print("{passed}", kind, flush=True)
os._exit(0)
"""
"""What the other process does, as long as this one lives; `os._exit` because Blender may crash at the end after work on
the graphics card."""


@dataclass(frozen=True)
class Probe:
    """Whether an engine works, and whether the processor draws for it because there is no graphics card."""

    works: bool
    software: bool = False


def probe_script(engine: str) -> str:
    """The Python that tries an engine inside Blender."""
    return PROBE.format(identifier=IDENTIFIERS[engine], passed=PASSED)


def probe(command: Sequence[str], limit_s: float = PROBE_LIMIT_S) -> Probe:
    """Run a command that tries an engine; a crash or silence means that it does not work."""
    try:
        with TemporaryFile("w+", encoding="utf-8", errors="replace") as log:
            with child(command, stdout=log, stderr=subprocess.DEVNULL) as process:
                status = process.wait(limit_s)
            log.seek(0)
            lines = log.read().splitlines()
    except (OSError, subprocess.TimeoutExpired):
        return Probe(False)
    said = next((line for line in lines if line.startswith(PASSED)), None)
    if status != 0 or said is None:
        return Probe(False)
    return Probe(True, software=said.removeprefix(PASSED).strip() == "SOFTWARE")


def choose_engine(wanted: str, command: Sequence[str] = (), limit_s: float = PROBE_LIMIT_S) -> str:
    """The engine to render with: "cycles", "workbench", "eevee", or `MEASURED`.

    Parameters
    ----------
    wanted : one of `ENGINES`. "auto" is Workbench on a graphics card; without one `MEASURED`, where Workbench works,
        else Cycles.
    command : what tries an engine in another process; ``{probe}`` stands for the Python to run.

    Raises
    ------
    DependencyError : the engine that is asked for does not work here.
    """
    if wanted in ("cycles", MEASURED):
        return wanted
    engine = "workbench" if wanted == "auto" else wanted
    script = probe_script(engine)
    found = probe([script if part == "{probe}" else part for part in command], limit_s)
    if wanted == "auto":
        return (MEASURED if found.software else "workbench") if found.works else "cycles"
    if not found.works:
        raise DependencyError(
            f"The engine {wanted} does not work on this machine: it needs OpenGL. Use --engine cycles or auto, or "
            "install a graphics driver (on a Debian without a graphics card: libegl1 libgl1-mesa-dri)."
        )
    return engine
