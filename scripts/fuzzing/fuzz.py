# SPDX-License-Identifier: GPL-3.0-or-later
"""Damages examples of every format that Rockfall reads, and looks for what it does not say in words.

    python scripts/fuzzing/fuzz.py --cases 2000 --seed 1                # --only terrain, --first N, --keep FOLDER

Each damaged file must be read, or refused by a message that names the file, says what to do, is short and has no
control characters; without a traceback, without lines of libraries, within time and memory, and with nothing
half-written. A case is a number: the same seed and number make the same files.

Every case runs in a process whose memory is limited and which is ended after some time; the next goes on behind it.
"""

import argparse
import contextlib
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from cases import Case, cases
from damage import damaged

LIMIT_S, NO_ANSWER_S, MEMORY_BYTES = 20.0, 100.0, 3_000_000_000
"""Of processor time for a case; until its process is ended; of memory."""
MOST_LETTERS = 400
UNFORESEEN = "in Rockfall itself"
"""What `main` says of an error that no reader has put into words."""
CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


class TooLongError(BaseException):
    """Raised by the alarm."""


def _ring(number: int, frame: object) -> None:
    raise TooLongError


def message_problem(message: str, folder: Path) -> str:
    """What is wrong with a message; empty when it is good."""
    if len(message) >= MOST_LETTERS:
        return f"a message of {len(message)} letters"
    if CONTROL.search(message):
        return "control characters in the message"
    if str(folder) not in message and not any(part in message for part in ("--", ".csv", ".toml")):
        return "the message names no file"
    if UNFORESEEN in message:
        return "unforeseen"
    if not message.endswith((".", "?")) or message.count(". ") < 1:
        return "the message has no advice"
    return ""


def judge(case: Case, folder: Path) -> tuple[str, str]:
    """(problem, what was said) of reading the files in a folder; the problem is empty when all is well."""
    from rockfall.core.errors import RockfallError

    with tempfile.TemporaryFile() as printed, _caught_output(printed):
        problem, said = "", ""
        try:
            result = case.read(folder)
        except RockfallError as error:
            said = str(error)
            problem = message_problem(said, folder)
        except TooLongError:
            problem = "too long"
        except BaseException as error:  # noqa: BLE001 it is what is looked for
            place = traceback.extract_tb(error.__traceback__)
            ours = next(
                (one for one in reversed(place) if "rockfall" in one.filename or "core" in one.filename), place[-1]
            )
            problem = f"traceback {type(error).__name__} at {Path(ours.filename).name}:{ours.lineno}"
            said = str(error)[:300]
        sys.stdout.flush()
        sys.stderr.flush()
        printed.seek(0)
        text = printed.read().decode("utf-8", "replace")
    if case.command and not problem:
        lines = [line for line in text.split("\n") if line and not line.endswith("…")]  # progress
        if result not in (0, 1):
            problem, said = f"status {result}", text[-300:]
        elif result == 1:
            said = lines[-1].removeprefix("rockfall: ") if lines else ""
            problem = message_problem(said, folder)
            if not problem and (folder / "out").exists():
                problem = "half-written"
            if not problem and len(lines) > 1:
                problem = "more than one line"
        elif not (folder / "out").exists():
            problem = "nothing written"
        elif "Traceback" in text or "Warning" in text:
            problem, said = "a library speaks", text[-300:]
        if not problem and any(path.name.endswith(".part") for path in folder.iterdir()):
            problem = "half-written"
    elif not case.command and not problem and text.strip():
        problem, said = "a library speaks", text[-300:]
    return problem, said


@contextlib.contextmanager
def _caught_output(file: object):
    """What is printed, by libraries too, goes to a file."""
    kept = [os.dup(1), os.dup(2)]
    sys.stdout.flush()
    sys.stderr.flush()
    for number in (1, 2):
        os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        for number, old in zip((1, 2), kept, strict=True):
            os.dup2(old, number)
            os.close(old)


def _work(connection: Connection, options: argparse.Namespace) -> None:
    """Do cases as they are asked for."""
    root = Path(tempfile.mkdtemp(prefix="fuzz"))
    (root / "made").mkdir()
    with tempfile.TemporaryFile() as nowhere, _caught_output(nowhere):
        every = chosen(cases(root / "made", options.quick), options)
        for case in every.values():  # what is whole is read, and everything is imported and compiled
            _place(root / "case", case.files)
            problem = judge(case, root / "case")
            if problem[0]:
                connection.send(("whole", problem))
    signal.signal(signal.SIGPROF, _ring)
    connection.send(list(every))
    resource.setrlimit(resource.RLIMIT_AS, (_used_bytes() + MEMORY_BYTES,) * 2)
    names = list(every)
    try:
        while (number := connection.recv()) is not None:
            case = every[names[number % len(names)]]
            _place(root / "case", files_of(case, options.seed, number))
            began = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
            try:
                problem, said = judge(case, root / "case")
            except TooLongError:
                problem, said = "too long", ""
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            took = time.process_time() - began
            if took > LIMIT_S / 2 and not problem:
                problem = "slow"
            connection.send((problem, said, took))
    finally:
        shutil.rmtree(root, ignore_errors=True)


def chosen(every: dict[str, Case], options: argparse.Namespace) -> dict[str, Case]:
    """The cases that are asked for."""
    return {
        name: case
        for name, case in every.items()
        if any(word in name for word in options.only) and not (options.quick and case.slow)
    }


def files_of(case: Case, seed: int, number: int) -> dict[str, bytes]:
    """The files of one case, one of them damaged."""
    random = np.random.default_rng([seed, number])
    files = dict(case.files)
    which = case.damaged[int(random.integers(len(case.damaged)))]
    files[which] = damaged(files[which], random)
    return files


def _place(folder: Path, files: dict[str, bytes]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def _used_bytes() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()


class Worker:
    """A process that does cases."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.connection, theirs = multiprocessing.Pipe()
        self.process = multiprocessing.get_context("spawn").Process(target=_work, args=(theirs, options), daemon=True)
        self.process.start()
        theirs.close()
        self.names = self.connection.recv()
        if isinstance(self.names, tuple):
            sys.exit(f"A file that is whole: {self.names[1]}")

    def do(self, number: int) -> tuple[str, str, float]:
        """The result of a case, where the process may end or not answer."""
        self.connection.send(number)
        try:
            if self.connection.poll(NO_ANSWER_S):
                return self.connection.recv()
            problem = "too long, and nothing stops it"
        except EOFError:
            self.process.join()
            problem = f"the process ended with {self.process.exitcode}"
        self.process.kill()
        self.process.join()
        return problem, "", NO_ANSWER_S


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--cases", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], help="cases whose name has one of these in it")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    parser.add_argument("--seconds", type=float, default=np.inf, help="end after so long")
    parser.add_argument("--keep", type=Path, help="folder for the files of cases that fail")
    options = parser.parse_args()
    worker, found, slowest, done = Worker(options), Counter[str](), 0.0, 0
    end = time.perf_counter() + options.seconds
    for number in range(options.first, options.first + options.cases):
        if time.perf_counter() > end:
            break
        problem, said, took = worker.do(number)
        done, slowest = done + 1, max(slowest, took)
        if not worker.process.is_alive():
            worker = Worker(options)
        if problem:
            name = worker.names[number % len(worker.names)]
            found[problem] += 1
            print(json.dumps({"case": number, "name": name, "problem": problem, "said": said[:500]}), flush=True)
            if options.keep:
                (options.keep / str(number)).mkdir(parents=True, exist_ok=True)
                _keep(options, number)
    worker.connection.send(None)
    worker.process.join(10)
    print(f"{done} cases of {len(worker.names)} kinds, {found.total()} problems, slowest {slowest:.1f} s")
    for problem, count in found.most_common():
        print(f"{count:6d}  {problem}")
    return int(bool(found))


def _keep(options: argparse.Namespace, number: int) -> None:
    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        (Path(folder) / "made").mkdir()
        every = chosen(cases(Path(folder) / "made", options.quick), options)
    names = list(every)
    _place(options.keep / str(number), files_of(every[names[number % len(names)]], options.seed, number))


if __name__ == "__main__":
    sys.exit(main())
