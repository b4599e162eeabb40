# SPDX-License-Identifier: GPL-3.0-or-later
"""Make assets/page/three.min.js and its licence from the packages that package.json names.

    python3.13 scripts/making/page_library/make.py

Needs npm. Run it again after a change of package.json or library.js, and look at the page in a browser.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__).resolve().parent
ASSETS = HERE.parents[2] / "assets" / "page"
NEEDED = ("package.json", "library.js")
FFLATE = "fflate, as it comes with three.js: the MIT License as above, Copyright (c) 2020-2026 Arjun Barrett\n"


def main() -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        for file in NEEDED:
            shutil.copy(HERE / file, folder)
        subprocess.run(["npm", "install", "--no-audit", "--no-fund"], cwd=folder, check=True)
        program = next((folder / "node_modules" / "@esbuild").glob("*/bin/esbuild"))
        os.chmod(program, 0o755)
        made = ASSETS / "three.min.js"
        options = ["--bundle", "--minify", "--format=iife", "--global-name=THREE", "--target=es2020"]
        subprocess.run(
            [program, "library.js", *options, "--legal-comments=none", f"--outfile={made}"], cwd=folder, check=True
        )
        three = folder / "node_modules" / "three"
        version = re.search(r'"version": "([^"]+)"', (three / "package.json").read_text(encoding="utf-8"))
        parts = [f"three.js {version[1] if version else ''}\n\n{(three / 'LICENSE').read_text(encoding='utf-8')}"]
        parts.append(FFLATE)
        (ASSETS / "LICENSE-three.txt").write_text("\n".join(parts), encoding="utf-8")
    print(f"{made}: {made.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    sys.exit(main())
