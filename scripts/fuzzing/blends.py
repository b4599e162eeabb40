# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens .blend files that are damaged, or in which another program has stored nonsense where Rockfall keeps its values.

    python scripts/fuzzing/blends.py --cases 60 --seed 1

Blender must open such a file, or refuse it; Rockfall must say in words what it cannot use: no traceback, no end of
the process, within time and memory. Damaged bytes may end Blender itself: such a case counts when it does not end the
same way without Rockfall. Each case runs in a process of its own, with Blender as a Python module.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

import numpy as np
from damage import damaged

ROOT = Path(__file__).resolve().parents[2]
SAVED = ROOT / "tests" / "data" / "saved_by_0.1.0.blend"
LIMIT_S, NO_ANSWER_S, MEMORY_BYTES = 120, 1800, 8_000_000_000
"""Of processor time; until a case is ended; of memory."""
OPERATORS = ("reconstruct", "remove_set_aside", "export_tables")
"""What reads all that is stored."""
PREFIX = "rockfall"
MARK = "Traceback (most recent call last)"
BARE, OURS = "bare", "ours"


def hostile(random: np.random.Generator) -> object:
    """A value that somebody may have stored."""
    values = (
        0, -1, 2**31 - 1, -(2**31), 1e308, float("nan"), float("inf"), "", "x", "\u202e", "[1, 2", "[]", "{}", "null",
        '{"a": NaN}', "[" * 3000, "9" * 5000, True, [1.0, 2.0], [0] * 50, [float("nan")] * 3, {"a": {"b": 1}}, {},
        ["a", "b"], b"\xff\x00".decode("latin-1"),
    )  # fmt: skip
    return values[int(random.integers(len(values)))]


def holders() -> list:
    """Everything in the file that keeps values of Rockfall."""
    import bpy

    found = [
        bpy.data.scenes,
        bpy.data.objects,
        bpy.data.collections,
        bpy.data.actions,
        bpy.data.meshes,
        bpy.data.cameras,
    ]
    return [one for kind in found for one in kind if any(key.startswith(PREFIX) for key in one.keys())]  # noqa: SIM118


def store_nonsense(random: np.random.Generator) -> None:
    """Replace up to six stored values."""
    every = [(one, key) for one in holders() for key in one.keys() if key.startswith(PREFIX)]  # noqa: SIM118
    for at in random.choice(len(every), min(int(random.integers(1, 7)), len(every)), replace=False):
        one, key = every[int(at)]
        try:
            one[key] = hostile(random)
        except (TypeError, ValueError, OverflowError):  # Blender stores no such value
            continue
        print("stored", one.name, key, repr(one[key])[:60])


def operate(folder: Path) -> None:
    """Let operators read what is stored."""
    import bpy

    for name in OPERATORS:
        try:
            options = {"directory": str(folder / name)} if name.startswith("export") else {}
            getattr(bpy.ops.rockfall, name)(**options)
        except (RuntimeError, TypeError, AttributeError) as error:  # an operator that reports an error raises it
            if MARK in str(error):
                print(error)
        except Exception:  # noqa: BLE001 it is what is looked for
            traceback.print_exc()


def one_case(seed: int, number: int, how: str, folder: Path) -> None:
    """One case, in this process."""
    import bpy

    random = np.random.default_rng([seed, number])
    if how == OURS:
        import rockfall

        bpy.context.preferences.addons.new().module = "rockfall"
        rockfall.register()
    file = folder / "case.blend"
    if number % 2:
        bpy.ops.wm.open_mainfile(filepath=str(SAVED))
        bpy.ops.wm.save_as_mainfile(filepath=str(file), compress=False)
        if how == OURS:
            store_nonsense(random)
            bpy.ops.wm.save_as_mainfile(filepath=str(file), compress=False)
    else:
        file.write_bytes(damaged(SAVED.read_bytes(), random))
    try:
        bpy.ops.wm.open_mainfile(filepath=str(file))
    except RuntimeError as error:
        print("refused:", str(error)[:200])
        return
    if how == OURS:
        operate(folder)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S))


def run(seed: int, number: int, how: str) -> tuple[int, str]:
    """Exit status and output of a case in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, __file__, "--one", str(seed), str(number), how, folder]
        try:
            ended = subprocess.run(
                words, capture_output=True, text=True, errors="replace", timeout=NO_ANSWER_S, check=False,
                preexec_fn=_limit,
            )  # fmt: skip
        except subprocess.TimeoutExpired as error:
            return -1, f"too long: {(error.stdout or b'')[-500:]!r}"
        return ended.returncode, ended.stdout + ended.stderr


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        seed, number, how, folder = options.one
        one_case(int(seed), int(number), how, Path(folder))
        return 0
    problems = 0
    for number in range(options.first, options.first + options.cases):
        status, text = run(options.seed, number, OURS)
        problem = "traceback" if MARK in text else f"status {status}" if status else ""
        if status and not number % 2 and run(options.seed, number, BARE)[0]:
            problem = ""  # Blender itself
        if problem:
            problems += 1
            at = text.find(MARK)
            print(
                f"case {number}: {problem}\n{text[max(at - 600, 0) : at + 2500] if at >= 0 else text[-1500:]}",
                flush=True,
            )
    print(f"{options.cases} cases of .blend files, {problems} problems")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
