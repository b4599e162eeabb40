# SPDX-License-Identifier: GPL-3.0-or-later
"""The steps of CI, two at a time: one for each core of the machine that runs them.

A step begins as soon as those that it needs are done; what it says is printed when it ends. What pytest and the other
runners count in their last line is added up; any other step counts as one.
"""

import os
import platform
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SANDBOX = ROOT.parent / "shared" / "tools" / "real_blender.sh"
AT_ONCE = 2
GRACE_S = 20.0

# The pages are tested in Chromium; without it those tests are skipped.
GET_BROWSER = """
if command -v chromium >/dev/null && command -v chromedriver >/dev/null; then
  echo "$(chromium --version) is there"
elif [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium chromium-driver >/dev/null
  chromium --version
else
  echo "no Chromium, and no way to install it here: the pages are not tested in it"
fi
"""

DEMO = """
rm -rf out/demo
"$PYTHON" scripts/run.py demo
echo "out/demo: $(find out/demo -type f | wc -l) files, $(du -sh out/demo | cut -f1)"
for kind in csv mp4 png; do
  [ -n "$(find out/demo -name "*.$kind" -size +1k -print -quit)" ] || { echo "the demo wrote no .$kind"; exit 1; }
done
"""

INSTALL = """
zip=$(find dist -name '*-cp314.zip' | head -n 1)
rm -rf "$BLENDER_USER_RESOURCES"
mkdir -p "$BLENDER_USER_RESOURCES"
.ci/blender --command extension validate "$zip"
.ci/blender --command extension install-file -r user_default -e "$zip"
"""

TESTS_IN_BLENDER = """
.ci/blender --background --factory-startup --addons bl_ext.user_default.rockfall \
  --python-exit-code 5 --python scripts/blender_tests.py -- -q
"""

# The same commands inside Blender, as on a server that has Blender and no Python of its own.
COMMAND_LINE = """
rm -rf out/in_blender
.ci/blender --command rockfall reconstruct assets/examples/chant_sura_lu2019/picks.csv --out out/in_blender/tables
.ci/blender --command rockfall render assets/demo/project.toml --frames 100-101 --out out/in_blender/film
ls -s out/in_blender/tables/impacts.csv out/in_blender/film/rockfall.mp4
status=0
.ci/blender --command rockfall render no_such_project.toml --out out/in_blender/nothing || status=$?
[ "$status" -eq 1 ] && [ ! -e out/in_blender/nothing ]
mkdir -p out/in_blender/sites/good out/in_blender/sites/bad
cp -r assets/demo/. out/in_blender/sites/good
printf 'schema = 1\n[terrain]\nfile = "nowhere.ply"\n' > out/in_blender/sites/bad/project.toml
status=0
.ci/blender --command rockfall batch out/in_blender/sites reconstruct --jobs 2 --out out/in_blender/batch || status=$?
[ "$status" -eq 1 ]
ls -s out/in_blender/batch/good/impacts.csv
grep -q '"failed": 1' out/in_blender/batch/summary.json
"""


def run(words: str) -> str:
    return f'"$PYTHON" scripts/run.py {words}'


@dataclass(frozen=True)
class Step:
    """Shell commands, their time limit, and the names of the steps before them."""

    name: str
    limit_s: float
    commands: str
    after: tuple[str, ...] = ()
    in_blender: bool = False
    """Needs the sandbox with a real Blender."""


SET_UP, BROWSER, BLENDER, ZIPS, INSTALLED = "set-up", "a browser", "a real Blender", "zips", "validate and install"
WINDOWS = 3
STEPS = (  # in the order in which they begin where they can: the longest way first
    Step(SET_UP, 1200, run("setup")),
    Step(BROWSER, 600, GET_BROWSER, (SET_UP,)),
    Step(BLENDER, 1200, f"{SANDBOX} setup", (BROWSER,), in_blender=True),
    Step("lint and types", 300, run("lint"), (SET_UP,)),
    Step(ZIPS, 900, run("extension --with-cp314"), (SET_UP,), in_blender=True),
    Step(INSTALLED, 300, INSTALL, (BLENDER, ZIPS), in_blender=True),
    Step("tests in a real Blender", 1500, TESTS_IN_BLENDER, (INSTALLED,), in_blender=True),
    Step("tests of the core", 2700, run("test core"), (SET_UP,)),
    *(
        Step(f"in a window, part {i} of {WINDOWS}", 1200, run(f"interface --part {i}/{WINDOWS}"), (INSTALLED,), True)
        for i in range(1, WINDOWS + 1)
    ),
    Step("tests in Blender as a module", 1800, run("test blender"), (SET_UP,)),
    Step("as on another machine", 1500, '"$PYTHON" .ci/elsewhere.py .venv/bin/python', (SET_UP,)),
    Step("tests of the pages", 600, run("test browser"), (BROWSER,)),
    Step("from the demo's video to its impacts", 600, run("footage"), (SET_UP,)),
    Step("demo", 600, DEMO, (SET_UP,)),
    Step("command line in a real Blender", 300, COMMAND_LINE, (INSTALLED,), in_blender=True),
)


class Board:
    """What waits, runs and has ended, for the threads that take steps from it."""

    def __init__(self, steps: tuple[Step, ...]) -> None:
        self.started = time.monotonic()
        self.waiting = list(steps)
        self.good: dict[str, bool] = {}
        self.passed = self.failed = 0
        self.times: list[str] = []
        self.running: list[subprocess.Popen[bytes]] = []
        self.changed = threading.Condition()

    def next(self) -> Step | None:
        """A step whose predecessors have ended, as soon as there is one; None when nothing waits."""
        with self.changed:
            while self.waiting:
                ready = [step for step in self.waiting if all(name in self.good for name in step.after)]
                if ready:
                    self.waiting.remove(ready[0])
                    return ready[0]
                self.changed.wait()
            return None

    def take(self) -> None:
        while (step := self.next()) is not None:
            started = time.monotonic()
            missing = [name for name in step.after if not self.good[name]]
            try:
                status, said = (1, f"not run: {missing[0]} has failed\n") if missing else self.execute(step)
            except OSError as error:
                status, said = 1, f"{error}\n"
            self.ended(step, status, said, time.monotonic() - started)

    def execute(self, step: Step) -> tuple[int, str]:
        """Exit status and output."""
        with self.changed:
            print(f"--- {step.name}", flush=True)
        with tempfile.TemporaryFile() as log:
            # A session of its own, so that all it has started can be ended.
            process = subprocess.Popen(
                ["bash", "-euo", "pipefail", "-c", step.commands], cwd=ROOT, start_new_session=True,
                stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip
            self.running.append(process)
            try:
                status, late = process.wait(step.limit_s), ""
            except subprocess.TimeoutExpired:
                end(process)
                status, late = 124, f"stopped after {step.limit_s:.0f} s\n"
            self.running.remove(process)
            log.seek(0)
            return status, log.read().decode(errors="replace") + late

    def ended(self, step: Step, status: int, said: str, seconds: float) -> None:
        good, bad = counted(said, status)
        with self.changed:
            self.passed, self.failed = self.passed + good, self.failed + bad
            self.good[step.name] = status == 0
            mark = f": FAILED with status {status}" if status else ""
            self.times.append(f"{seconds:5.0f} s  {step.name}{mark}")
            print(f"\n=== {step.name}\n{said}", end="", flush=True)
            self.changed.notify_all()


def counted(said: str, status: int) -> tuple[int, int]:
    """How many have passed and failed, by the last lines of a step or else by its exit status."""
    lines = [line for line in said.splitlines()[-5:] if re.search(r"\d+ (passed|failed|error)", line)]
    good = re.findall(r"(\d+) passed", lines[-1]) if lines else []
    bad = re.findall(r"(\d+) (?:failed|errors?)", lines[-1]) if lines else []
    if status == 0:
        return (int(good[-1]) if good else 1), sum(map(int, bad))
    return (int(good[-1]) if good else 0), max(1, sum(map(int, bad)))


def end(process: subprocess.Popen[bytes]) -> None:
    """End a step and all that it has started."""
    for name in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, name)
            process.wait(GRACE_S)
        except ProcessLookupError:
            return
        except subprocess.TimeoutExpired:
            pass


def main() -> int:
    os.chdir(ROOT)
    os.environ |= {
        "PYTHON": sys.executable,
        "CI": "true",
        "NUMBA_CACHE_DIR": str(ROOT / "build" / "kernels"),
        "BLENDER_USER_RESOURCES": str(ROOT / "build" / "installed"),
        "ROCKFALL_BLENDER": str(ROOT / ".ci" / "blender"),
    }
    os.environ.setdefault("REAL_BLENDER_ROOT", "/opt/real-blender")
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    where = f"{platform.system()} {platform.machine()}, {os.process_cpu_count()} cores"
    print(f"Python {platform.python_version()}, {where}, {commit.stdout.strip() or 'no git'}", flush=True)
    why_not = "" if os.access(SANDBOX, os.X_OK) else "There is no sandbox with a real Blender beside this checkout"
    if not why_not and os.geteuid():
        why_not = "The sandbox with a real Blender needs root"
    if why_not:
        print(f"{why_not}: the extension and its interface are not tested.")
    board = Board(tuple(step for step in STEPS if not (why_not and step.in_blender)))
    # A machine may start this with signals ignored, as nohup does, and tests that send them would inherit that.
    for name in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(name, signal.default_int_handler)
    workers = [threading.Thread(target=board.take, daemon=True) for _ in range(AT_ONCE)]
    try:
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    finally:
        for process in list(board.running):
            end(process)
    times = "\n".join(board.times)
    print(f"\n{times}\n{time.monotonic() - board.started:5.0f} s  in all")
    print(f"{board.passed} passed, {board.failed} failed", flush=True)
    return int(board.failed > 0)


if __name__ == "__main__":
    sys.exit(main())
