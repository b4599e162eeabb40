# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the cases of tests/interface in the window of a real Blender.

Each begins with a new file. They share a Blender until one fails or crashes; the next ones get a fresh one.

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
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CASES = ROOT / "tests" / "interface"
EXTENSION = "bl_ext.user_default.rockfall"
WINDOW = ("0", "0", "1600", "1000")
BEGINS = "harness: "
"""With this and its name a case begins in Blender's output."""
START_S, GRACE_S = 240.0, 30.0
"""How long Blender may take to start, and to end by itself when a case has taken too long."""


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


def command(blender: list[str], cases: list[tuple[Path, str]], seconds: float) -> list[str]:
    """What runs these cases one after the other in one Blender, each for so many seconds at most."""
    options = ["--factory-startup", "--enable-event-simulate", "--window-geometry", *WINDOW]
    options += ["--addons", EXTENSION, "--python-exit-code", "5", "--python", str(CASES / "harness.py")]
    return [*blender, *options, "--", str(seconds), *(str(part) for case in cases for part in case)]


def run_together(blender: list[str], cases: list[tuple[Path, str]], seconds: float) -> tuple[int, bool]:
    """Run cases in one Blender until one fails; how many have passed, and whether the one after those has failed."""
    begun, output, started = 0, [], time.monotonic()

    def report(word: str) -> None:
        file, name = cases[max(begun, 1) - 1]
        print(f"{word} {file.stem}::{name} in {time.monotonic() - started:.1f} s", flush=True)

    process = subprocess.Popen(
        command(blender, cases, seconds), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, errors="replace",
    )  # fmt: skip
    watchdog = threading.Timer(START_S, process.kill)
    watchdog.start()
    with process:
        for line in process.stdout:
            output.append(line)
            if line.startswith(BEGINS):
                watchdog.cancel()
                if begun:
                    report("PASSED")
                begun, output, started = begun + 1, [], time.monotonic()
                watchdog = threading.Timer(seconds + GRACE_S, process.kill)
                watchdog.start()
    watchdog.cancel()
    failed = process.returncode != 0
    report("FAILED" if failed else "PASSED")
    if failed:
        print(f"{''.join(output).rstrip()}\nstatus {process.returncode}", flush=True)
    return max(begun, 1) - failed, failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="only one of N parts, which can run side by side")
    parser.add_argument("--timeout", type=float, default=480.0, help="seconds that one case may take")
    options = parser.parse_args()
    part, parts = map(int, options.part.split("/"))
    cases = find_cases(options.words)[part - 1 :: parts]
    if options.list:
        print("\n".join(f"{file.stem}::{name}" for file, name in cases))
        return 0
    if not cases:
        raise SystemExit("interface_tests: no such case")
    blender = find_blender()
    if "BLENDER_USER_RESOURCES" not in os.environ:
        use_checkout(blender)
    started = time.monotonic()
    passed, done = 0, 0
    while done < len(cases):
        good, failed = run_together(blender, cases[done:], options.timeout)
        passed, done = passed + good, done + good + failed
    print(f"{passed} passed, {len(cases) - passed} failed in {time.monotonic() - started:.1f}s")
    return int(passed < len(cases))


if __name__ == "__main__":
    sys.exit(main())
