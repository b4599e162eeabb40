# SPDX-License-Identifier: GPL-3.0-or-later
"""Set everything up in .venv, then run something.

    python3.13 scripts/run.py demo [rockfall arguments]            # the whole job on the bundled site, into out/demo
    python3.13 scripts/run.py test [core|blender|browser] [pytest arguments]
    python3.13 scripts/run.py rockfall COMMAND ...                 # any command of Rockfall
    python3.13 scripts/run.py footage                              # the demo's video to impacts, against the truth
    python3.13 scripts/run.py lint                                 # ruff and mypy
    python3.13 scripts/run.py extension [arguments]                # the zips for Blender, see build_extension.py
    python3.13 scripts/run.py interface [cases]                    # clicks in a real window, see interface_tests.py
    python3.13 scripts/run.py setup

The set-up is done again only when pyproject.toml, constraints.txt, the Python or the place of this checkout changes.
"""

from __future__ import annotations  # so that an older Python gets as far as being told

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import NoReturn

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
SCRIPTS = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")
STAMP = VENV / "rockfall-setup"
WANTED = (3, 13)


def say(text: str) -> None:
    print(f"rockfall: {text}", flush=True)


def fail(text: str) -> NoReturn:
    sys.exit(f"rockfall: {text}")


def check_python() -> None:
    """Blender 5.2 and its module are made for one Python; any other has no bpy to install."""
    if sys.version_info[:2] != WANTED or sys.maxsize < 2**32:
        found = "{}.{}.{}, {}".format(*sys.version_info[:3], sys.executable)
        start = "py -3.13" if os.name == "nt" else "python3.13"
        fail(
            f"needs a 64-bit Python 3.13, the one in Blender 5.2; this is {found}.\n"
            f"Install Python 3.13 beside it and start again with: {start} {' '.join(sys.argv)}"
        )


def dependencies() -> ModuleType:
    """The module core/dependencies.py, before anything is installed."""
    if "rockfall" not in sys.modules:
        spec = importlib.util.spec_from_file_location(
            "rockfall", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
        )
        sys.modules["rockfall"] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules["rockfall"])
    return importlib.import_module("rockfall.core.dependencies")


def check_system() -> None:
    """What comes from the system: install it where that is ours to do (as root or in CI, with apt), or name it."""
    asked = dependencies()
    missing = asked.missing_system_libraries()
    if missing:
        say(asked.explain_missing_libraries(missing))
    packages = asked.install_command(asked.missing_system_libraries(graphics=True), "apt").split() if missing else []
    if importlib.util.find_spec("ensurepip") is None:
        say("this Python has no venv. On Debian and Ubuntu it comes with: apt-get install python3.13-venv")
        packages = [*(packages or ["apt-get", "install", "-y", "--no-install-recommends"]), "python3.13-venv"]
    if not packages:
        return
    root = sys.platform != "win32" and os.geteuid() == 0
    in_ci = os.environ.get("CI", "").lower() in ("1", "true")
    if asked.package_manager() != "apt" or not (root or (in_ci and shutil.which("sudo"))):
        fail("install what is missing, then start this again.")
    sudo = [] if root else ["sudo", "-n"]
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    say(f"installing it now: {' '.join([*sudo, *packages])}")
    for command in (["apt-get", "update", "-qq"], packages):
        done = subprocess.run([*sudo, *command], check=False, env=environment, stdout=subprocess.DEVNULL)
    missing = asked.missing_system_libraries()
    if done.returncode or missing:
        names = ", ".join(library.file for library in missing) or "nothing"
        fail(f"apt-get ended with status {done.returncode}; system libraries still missing: {names}")


def set_up() -> None:
    """Make .venv and install Rockfall into it, unless that is done already."""
    where = f"{sys.version}\n{sys.base_prefix}\n{ROOT}\n"
    files = b"".join((ROOT / name).read_bytes() for name in ("pyproject.toml", "scripts/constraints.txt"))
    wanted = where + hashlib.sha256(files).hexdigest()
    found = STAMP.read_text(encoding="utf-8") if STAMP.exists() else ""
    if found == wanted:
        return
    started = time.monotonic()
    STAMP.unlink(missing_ok=True)
    environment = {**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    if not found.startswith(where):
        say("making .venv with Python {}.{}.{}".format(*sys.version_info[:3]))
        made = subprocess.run([sys.executable, "-m", "venv", "--clear", str(VENV)], check=False)
        if made.returncode:
            fail("could not make .venv; the message above says why")
    say("installing Rockfall and what it needs; the first time this downloads about 600 MB")
    command = [
        str(PYTHON),
        "-m",
        "pip",
        "install",
        "--quiet",
        "--editable",
        ".[blender,figures,explore,e57,parquet,cluster,dev]",
    ]
    command += ["--constraint", str(ROOT / "scripts" / "constraints.txt")]
    for attempt in (1, 2):
        if subprocess.run(command, check=False, cwd=ROOT, env=environment).returncode == 0:
            break
        if attempt == 2:
            fail(
                "pip could not install. Is the network there, and right what `pip config list` says? Then start again."
            )
        say("pip failed; trying once more, in case the network was at fault")
    STAMP.write_text(wanted, encoding="utf-8")
    say("compiling what would be compiled when first needed")
    start(PYTHON, "-m", "rockfall.core.cli", "prepare")  # without it only the first commands take longer
    say(f"set up in {time.monotonic() - started:.0f} s")


def start(*command: str | Path, show: re.Pattern | None = None) -> tuple[int, str]:
    """Run a command in the checkout with the environment of .venv.

    Returns its exit status, and the last line of its output in which `show` is found.
    """
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "VIRTUAL_ENV": str(VENV)}
    environment["PATH"] = str(SCRIPTS) + os.pathsep + environment.get("PATH", "")
    environment.setdefault("NUMBA_CACHE_DIR", str(ROOT / "build" / "kernels"))
    arguments = [str(each) for each in command]
    if show is None:
        return subprocess.run(arguments, check=False, cwd=ROOT, env=environment).returncode, ""
    with subprocess.Popen(
        arguments, cwd=ROOT, env=environment, stdout=subprocess.PIPE, encoding="utf-8", errors="replace"
    ) as process:
        shown = ""
        for line in process.stdout:
            print(line, end="", flush=True)
            shown = line.strip() if show.search(line) else shown
    return process.returncode, shown


def rockfall(arguments: list[str]) -> int:
    return start(PYTHON, "-m", "rockfall.core.cli", *arguments)[0]


def demo(arguments: list[str]) -> int:
    return rockfall(["demo", *([] if "--out" in arguments else ["--out", os.path.join("out", "demo")]), *arguments])


def test(arguments: list[str]) -> int:
    """All levels, each in a process of its own: the core is tested without Blender in it."""
    levels = {
        "core": [PYTHON, "-m", "pytest", "tests/core"],
        "blender": [PYTHON, "scripts/blender_tests.py"],
        "browser": [PYTHON, "-m", "pytest", "tests/browser"],
    }
    purposes = {
        "core": "tests of the core",
        "blender": "tests of the add-on, in Blender as a module",
        "browser": "tests of the pages, in Chromium (skipped where there is none)",
    }
    chosen = [arguments[0]] if arguments and arguments[0] in levels else list(levels)
    options = arguments[1:] if chosen == arguments[:1] else arguments
    closing_line = re.compile(r"\b\d+ (passed|failed|errors?|skipped|deselected)\b.* in [\d.]+s")
    closing_lines, failed = [], False
    for level in chosen:
        say(purposes[level])
        code, line = start(*levels[level], *options, show=closing_line)
        nothing_selected = code == 5 and options and len(chosen) > 1
        failed |= bool(code) and not nothing_selected
        closing_lines.append(f"{level}: {line.strip('= ') or f'1 failed: it stopped with status {code}'}")
    text = "\n".join(closing_lines)
    passed = sum(map(int, re.findall(r"(\d+) passed", text)))
    broken = sum(map(int, re.findall(r"(\d+) (?:failed|errors?)", text)))
    print(f"\n{text}\n{passed} passed, {broken} failed", flush=True)
    return int(failed)


def footage(arguments: list[str]) -> int:
    return start(PYTHON, "scripts/comparisons/demo_footage.py", *arguments)[0]


def lint(arguments: list[str]) -> int:
    checks = ([SCRIPTS / "ruff", "check"], [SCRIPTS / "ruff", "format", "--check"], [PYTHON, "-m", "mypy"])
    return max([abs(start(*check, *arguments)[0]) for check in checks])


def extension(arguments: list[str]) -> int:
    return start(PYTHON, "scripts/build_extension.py", *arguments)[0]


def interface(arguments: list[str]) -> int:
    return start(PYTHON, "scripts/interface_tests.py", *arguments)[0]


def setup(arguments: list[str]) -> int:
    say(f"Python: {PYTHON}")
    return 0


COMMANDS = (demo, test, rockfall, footage, lint, extension, interface, setup)


def main() -> int:
    commands = {command.__name__: command for command in COMMANDS}
    if len(sys.argv) < 2 or sys.argv[1] not in commands:
        print(__doc__)
        return 2
    check_python()
    check_system()
    set_up()
    return commands[sys.argv[1]](sys.argv[2:])


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        fail("interrupted")
