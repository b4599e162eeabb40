# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the cases of tests/interface, each in the window of a Blender of its own.

    python scripts/interface_tests.py                     # all
    python scripts/interface_tests.py sidebar demo        # those with one of these words in file or name
    python scripts/interface_tests.py --list

Which Blender: the command in ROCKFALL_BLENDER, else `blender` on the path, else .ci/blender. Which extension: the one
installed in BLENDER_USER_RESOURCES; without that variable, this checkout (see build_extension.py --develop).
The pictures are in out/screenshots.
"""

import argparse
import ast
import os
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CASES = ROOT / "tests" / "interface"
EXTENSION = "bl_ext.user_default.rockfall"
WINDOW = ("0", "0", "1600", "1000")


def find_cases(words: list[str]) -> list[tuple[Path, str]]:
    """File and name of the functions called ``case_…``, found without importing them: only Blender can."""
    cases = [
        (path, node.name)
        for path in sorted(CASES.glob("*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name.startswith("case_")
    ]
    return [case for case in cases if not words or any(word in f"{case[0].stem} {case[1]}" for word in words)]


def find_blender() -> list[str]:
    if os.environ.get("ROCKFALL_BLENDER"):
        return shlex.split(os.environ["ROCKFALL_BLENDER"])
    return [shutil.which("blender") or str(ROOT / ".ci" / "blender")]


def use_checkout(blender: list[str]) -> None:
    """Make a Blender user directory of this checkout, with the wheels for the Python of that Blender."""
    asked = [*blender, "--background", "--factory-startup", "--python-expr"]
    code = "import sys; print('python=%d.%d' % sys.version_info[:2])"
    output = subprocess.run([*asked, code], capture_output=True, text=True, check=False).stdout
    found = [line.removeprefix("python=") for line in output.splitlines() if line.startswith("python=")]
    if not found:
        raise SystemExit(f"interface_tests: {' '.join(blender)} does not start; name yours in ROCKFALL_BLENDER")
    directory = ROOT / "build" / "develop"
    command = [sys.executable, ROOT / "scripts" / "build_extension.py", "--develop", directory, "--python", found[0]]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    os.environ["BLENDER_USER_RESOURCES"] = str(directory)


def run_case(blender: list[str], file: Path, name: str, seconds: float) -> bool:
    command = [*blender, "--factory-startup", "--enable-event-simulate", "--window-geometry", *WINDOW]
    command += ["--addons", EXTENSION, "--python-exit-code", "5"]
    command += ["--python", str(CASES / "harness.py"), "--", str(file), name]
    started = time.monotonic()
    try:
        done = subprocess.run(
            command, cwd=ROOT, timeout=seconds, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        code, output = done.returncode, done.stdout
    except subprocess.TimeoutExpired as error:
        code, output = 124, error.stdout.decode(errors="replace") if error.stdout else ""
    passed = code == 0
    print(f"{'PASSED' if passed else 'FAILED'} {file.stem}::{name} in {time.monotonic() - started:.1f} s", flush=True)
    if not passed:
        print(f"{output.rstrip()}\nstatus {code}", flush=True)
    return passed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--timeout", type=float, default=480.0, help="seconds that one case may take")
    options = parser.parse_args()
    cases = find_cases(options.words)
    if options.list:
        print("\n".join(f"{file.stem}::{name}" for file, name in cases))
        return 0
    if not cases:
        raise SystemExit("interface_tests: no such case")
    blender = find_blender()
    if "BLENDER_USER_RESOURCES" not in os.environ:
        use_checkout(blender)
    started = time.monotonic()
    passed = sum([run_case(blender, file, name, options.timeout) for file, name in cases])
    print(f"{passed} passed, {len(cases) - passed} failed in {time.monotonic() - started:.1f}s")
    return int(passed < len(cases))


if __name__ == "__main__":
    sys.exit(main())
