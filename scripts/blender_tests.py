# SPDX-License-Identifier: GPL-3.0-or-later
"""Run tests/blender with pytest inside Blender: the same tests at two levels.

    python scripts/blender_tests.py [pytest arguments]        # Blender as a module (the bpy wheel), package `rockfall`
    blender --background --factory-startup --addons bl_ext.user_default.rockfall \\
        --python-exit-code 5 --python scripts/blender_tests.py -- [pytest arguments]     # the installed extension
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXTENSION = "bl_ext.user_default.rockfall"


def main() -> int:
    import bpy
    import pytest

    arguments = sys.argv[1:]
    if bpy.app.binary_path:
        arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
        if "bl_ext.user_default.rockfall" not in sys.modules:
            print(
                "blender_tests: the extension bl_ext.user_default.rockfall is not enabled in this Blender",
                file=sys.stderr,
            )
            return 4
    where = f"Blender {bpy.app.version_string}, Python {sys.version.split()[0]}"
    print(f"{where}, {'installed extension' if bpy.app.binary_path else 'bpy module'}", flush=True)
    os.chdir(ROOT)
    return int(pytest.main(["-p", "no:cacheprovider", "tests/blender", *arguments]))


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # a regular exit can crash after GPU work
