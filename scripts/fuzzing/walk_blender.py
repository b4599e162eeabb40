# SPDX-License-Identifier: GPL-3.0-or-later
"""Random walks over all that can be done to a scene in Blender, each in a process of its own: a night's work.

    python scripts/fuzzing/walk_blender.py [--seeds 1,2,3,4,5] [--steps 1000] [--blender PATH]

Without --blender, Blender is the module of this Python; with it, the installed extension is walked. A walk that ends in
an error or in a crash is printed with its last steps, and can be walked again by its seed.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

WALK = Path(__file__).resolve().parents[2] / "tests" / "blender" / "random_walk.py"
EXTENSION = "bl_ext.user_default.rockfall"
LAST = 15


def walked(seed: int, steps: int, blender: str = "") -> str:
    """Walk; empty where all went well, else what was printed and the last steps."""
    with tempfile.TemporaryDirectory() as folder:
        told = [str(seed), str(steps), folder]
        command = [sys.executable, str(WALK), *told]
        if blender:
            command = [blender, "--background", "--factory-startup", "--addons", EXTENSION]
            command += ["--python-exit-code", "5", "--python", str(WALK), "--", *told]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=environment, check=False)
        if not done.returncode:
            return ""
        steps_file = Path(folder) / "steps.txt"
        lines = steps_file.read_text(encoding="utf-8").splitlines() if steps_file.is_file() else []
        ended = f"ended by signal {-done.returncode}" if done.returncode < 0 else f"exit status {done.returncode}"
        return "\n".join([f"seed {seed}: {ended}", done.stderr[-6000:], done.stdout[-1500:], *lines[-LAST:]])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="1,2,3,4,5")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--blender", default="", help="a Blender in which the extension is installed")
    asked = parser.parse_args()
    failed = 0
    for seed in map(int, asked.seeds.split(",")):
        problem = walked(seed, asked.steps, asked.blender)
        failed += bool(problem)
        print(problem or f"seed {seed}: {asked.steps} steps, all well", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
