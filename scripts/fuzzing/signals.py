# SPDX-License-Identifier: GPL-3.0-or-later
"""Sends signals to commands at random moments, and looks at how they end.

    python scripts/fuzzing/signals.py [--times 9] [--seed 1] [COMMAND …]

After SIGINT, SIGTERM and SIGHUP a command ends with 130, 143 and 129, with one line on standard error, and its output
is whole or not there: nothing half-written, no staging folder, no temporary file. Before Python runs a command the
signal itself ends the process.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "assets" / "demo"
FOOTAGE = DEMO / "footage"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PATIENCE_S = 60.0
LATE_S = 1.0
"""A command that goes on for longer than this and then ends with 0 has lost the signal."""
PARTLY = ("simulate",)
"""Commands that write what is finished."""

COMMANDS = {
    "reconstruct": ["reconstruct", DEMO / "picks.csv", "--terrain", DEMO / "terrain.ply"],
    "terrain": ["terrain", DEMO / "terrain.ply"],
    "align": ["align", FOOTAGE / "pairs.csv", "--video", FOOTAGE / "footage.mp4"],
    "align --moving": [
        "align", FOOTAGE / "pairs.csv", "--video", FOOTAGE / "footage.mp4", "--moving", "rotation",
    ],
    "track": ["track", FOOTAGE / "footage.mp4", "--clicks", FOOTAGE / "clicks.csv"],
    "refine": ["refine", FOOTAGE / "project.toml"],
    "motion": ["motion", DEMO / "project.toml"],
    "statistics": ["statistics", DEMO / "project.toml"],
    "compare": ["compare", DEMO / "project.toml", "--replicates", "50"],
    "calibrate": ["calibrate", DEMO / "project.toml", "--model", "noel_2017", "--fit", "rn_limit"],
    "simulate": ["simulate", DEMO / "project.toml", "--number", "20", "--cell", "2"],
    "simulate --workers": ["simulate", DEMO / "project.toml", "--number", "500", "--workers", "2"],
    "compare-runs": ["compare-runs", DEMO / "project.toml", "--number", "60"],
    "back-analyse": ["back-analyse", DEMO / "project.toml", "--model", "noel_2017", "--fit", "rn_limit"],
    "design": ["design", DEMO / "project.toml", "--number", "20", "--screen", DEMO / "barriers.csv"],
    "batch": ["batch", DEMO, "simulate", "--number", "20"],
    "render": ["render", DEMO / "project.toml", "--still"],
    "web": ["web", DEMO / "project.toml"],
}  # fmt: skip


@dataclass(frozen=True)
class Ended:
    """How a command ended: its status, its words, for how long it went on after the signal, and what it left."""

    status: int
    said: str
    after_s: float
    seconds: float
    written: frozenset[str]
    left: frozenset[str]


def run(words: list[object], at_s: float | None = None, number: signal.Signals = signal.SIGINT) -> Ended:
    """Run a command, with a signal after so many seconds."""
    with tempfile.TemporaryDirectory() as name:
        place, temporary = Path(name) / "place", Path(name) / "temporary"
        place.mkdir(), temporary.mkdir()
        out = place / "out"
        command = [sys.executable, "-m", "rockfall.core.start", *map(str, words), "--out", str(out)]
        if words[0] == "batch":
            command = [*command[:4], "--out", str(out), *command[4:-2]]
        began = time.monotonic()
        with subprocess.Popen(
            command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, start_new_session=True,
            env={**os.environ, "TMPDIR": str(temporary)},
        ) as process:  # fmt: skip
            if at_s is not None:
                try:
                    process.wait(at_s)
                except subprocess.TimeoutExpired:
                    process.send_signal(number)
            sent = time.monotonic()
            try:
                _, said = process.communicate(timeout=None if at_s is None else PATIENCE_S)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                _, said = process.communicate()
        ended = time.monotonic()
        files = frozenset(one.relative_to(out).as_posix() for one in out.rglob("*") if one.is_file())
        left = {one.relative_to(name).as_posix() for one in place.rglob("*") if ".part" in one.name}
        left |= {one.relative_to(name).as_posix() for one in temporary.iterdir()}
        return Ended(process.returncode, said, ended - sent, ended - began, files, frozenset(left))


def judge(words: list[object], whole: Ended, found: Ended, number: int) -> str:
    """What is wrong with how a command ended after a signal; nothing if it was right."""
    if found.status not in (0, 128 + number, -number):
        return f"status {found.status}"
    if found.status == 0 and found.after_s > LATE_S:
        return f"the signal was lost: it went on for {found.after_s:.1f} s"
    if found.status == 128 + number and found.said.count("rockfall: interrupted, ") != 1:
        return "it does not say that it was interrupted"
    if "Traceback" in found.said or "ignored" in found.said:
        return "a traceback"
    if found.status != -number and found.left:
        return f"left: {', '.join(sorted(found.left))}"
    if found.written and found.written != whole.written and words[0] not in (*PARTLY, "batch"):
        return f"half of the output is there: {', '.join(sorted(found.written))}"
    return ""


def main() -> int:
    """Try all commands, or some; 1 when one ended wrongly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=f"of {', '.join(COMMANDS)} (default all)")
    parser.add_argument("--times", type=int, default=9)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    wrong, chance = 0, random.Random(arguments.seed)
    for name in arguments.commands or COMMANDS:
        words = COMMANDS[name]
        whole = run(words)
        if whole.status != 0:
            print(f"{name}: it does not run: {whole.said}", flush=True)
            wrong += 1
            continue
        counted: dict[int, int] = {}
        for place in range(arguments.times):
            number, at_s = SIGNALS[place % len(SIGNALS)], chance.uniform(0.05, 1.0) * whole.seconds
            found = run(words, at_s, number)
            counted[found.status] = counted.get(found.status, 0) + 1
            problem = judge(words, whole, found, number)
            if problem:
                wrong += 1
                print(
                    f"{name}: {number.name} after {at_s:.2f} of {whole.seconds:.2f} s: {problem}\n{found.said}",
                    flush=True,
                )
        print(f"{name}: {whole.seconds:.1f} s, {counted}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
