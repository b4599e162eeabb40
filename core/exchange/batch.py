# SPDX-License-Identifier: GPL-3.0-or-later
"""Running many jobs, each a process of its own with its own folder; a job that is finished is not done again.

A job's folder appears in one step, with ``job.json`` in it, which tells what it was made of, and the SHA-256 of each of
its files. Where that is still so, the job is finished. Whatever ends the batch, half a job leaves nothing.
"""

import hashlib
import json
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event
from typing import Any, Literal

from ..children import TIED, child
from ..errors import RockfallError
from ..output import LOCK, output_folder, write_text
from ..progress import CancelledError, Progress, silent
from .job_inputs import digest_of, input_files, input_hashes
from .sweep import Job

RECORD = "job.json"
SUMMARY = "summary.json"
State = Literal["done", "already done", "failed", "not run"]
SAYS = "rockfall: "
"""Begins the message of a command that fails."""
LOOK_S, PATIENCE_S = 0.1, 10.0
"""Between two looks whether a job is to end; until one that was asked to end is ended."""
INTERRUPTED = (-15, -2, -1, 129, 130, 143)
"""Status of a process that a signal has ended."""
MOST_LINES = 200
"""Of what a command says that is kept."""

type MakeCommand = Callable[[Job, Path], Sequence[str]]
"""How a job is run, with the folder for its output."""


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes
    ----------
    job : its name.
    state : done now, or by an earlier batch from the same inputs; failed; not run, when the batch was ended before.
    message : what the command said: what is wrong, or its summary.
    seconds : how long it took, also when that was earlier.
    output : its folder as seen from the batch's; None without any.
    digest : of all that decides its result, see `digest_of`.
    inputs : name → SHA-256 of each file.
    """

    job: str
    project: str
    state: State
    message: str = ""
    seconds: float = 0.0
    output: str | None = None
    digest: str = ""
    inputs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Batch:
    """Jobs of one command.

    Attributes
    ----------
    command, options : of all jobs; each has its own options besides.
    jobs : with different names.
    out : the folder in which each job's is.
    made_by : versions on which the result depends.
    """

    command: str
    options: tuple[str, ...]
    jobs: tuple[Job, ...]
    out: Path
    made_by: Mapping[str, str]


def run_batch(
    batch: Batch, make_command: MakeCommand, *, parallel: int = 1, progress: Progress = silent
) -> tuple[Outcome, ...]:
    """Run all jobs that are not finished; one that fails does not hinder the others.

    Parameters
    ----------
    parallel : so many processes at a time.
    progress : counts the jobs. A `CancelledError` raised in it ends the batch: those that run are ended and leave
        nothing, finished ones are kept.

    Returns
    -------
    One for each job, in their order.
    """
    total, stop = len(batch.jobs), Event()
    found: dict[int, Outcome] = {}
    text = f"Running {batch.command}"
    progress(text, 0, total)
    with ThreadPoolExecutor(max(parallel, 1)) as pool:
        waiting: dict[Future[Outcome], int] = {
            pool.submit(_run_job, batch, job, make_command, stop): place for place, job in enumerate(batch.jobs)
        }
        try:
            while waiting:
                ready, _ = wait(waiting, timeout=LOOK_S, return_when=FIRST_COMPLETED)
                found |= {waiting.pop(one): one.result() for one in ready}
                progress(text, len(found), total)
        except CancelledError:
            stop.set()
            found |= {place: one.result() for one, place in waiting.items()}
        except BaseException:
            stop.set()
            raise
    return tuple(found[place] for place in range(total))


def write_batch_summary(batch: Batch, outcomes: Sequence[Outcome]) -> None:
    """Write summary.json: how many jobs are in each state, then each of them.

    Raises
    ------
    InputError : it cannot be written.
    """
    counts = {state: sum(one.state == state for one in outcomes) for state in ("failed", "not run", "done")}
    content = {
        "command": batch.command,
        "options": list(batch.options),
        "versions": dict(batch.made_by),
        **counts,
        "already done": sum(one.state == "already done" for one in outcomes),
        "jobs": [asdict(one) for one in outcomes],
    }
    write_text(batch.out / SUMMARY, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def _run_job(batch: Batch, job: Job, make_command: MakeCommand, stop: Event) -> Outcome:
    """One job, in a thread of its own."""
    place: dict[str, Any] = {"job": job.name, "project": str(job.project)}
    if stop.is_set():
        return Outcome(**place, state="not run")
    options = (*batch.options, *job.options)
    inputs = input_hashes(input_files(job.project, options))
    digest = digest_of(batch.command, options, inputs, batch.made_by)
    known: dict[str, Any] = {**place, "digest": digest, "inputs": inputs}
    folder = batch.out / job.name
    earlier = _record_of(folder)
    differs = "" if earlier is None or earlier.get("digest") != digest else _difference(folder, earlier)
    if earlier is not None and earlier.get("digest") == digest and not differs:
        return Outcome(
            **known,
            state="already done",
            message=str(earlier.get("message", "")),
            seconds=float(earlier.get("seconds", 0.0)),
            output=job.name,
        )
    started = time.monotonic()
    try:
        with output_folder(folder) as draft:
            status, said, problem = _finished(make_command(job, draft), stop)
            seconds = round(time.monotonic() - started, 3)
            if status != 0:
                raise _JobError(problem or f"It ended with the status {status} and said nothing")
            files = sorted(
                one.relative_to(draft).as_posix() for one in draft.rglob("*") if one.is_file() and one.name != LOCK
            )
            said = said.replace(str(draft), str(folder))
            if differs:
                said = f"{differs}, so it was done again.\n{said}"
            record = {
                "command": batch.command,
                "options": options,
                "versions": dict(batch.made_by),
                "inputs": inputs,
                "digest": digest,
                "seconds": seconds,
                "message": said,
                "files": {file: _digest(draft / file) for file in files},
            }
            write_text(draft / RECORD, json.dumps(record, indent=2, ensure_ascii=False) + "\n")
            _remove_outdated(folder, earlier)
    except CancelledError:
        return Outcome(**known, state="not run")
    except (RockfallError, OSError) as error:
        seconds = round(time.monotonic() - started, 3)
        return Outcome(**known, state="failed", message=_told(error, earlier), seconds=seconds)
    return Outcome(**known, state="done", message=said, seconds=seconds, output=job.name)


class _JobError(RockfallError):
    """What a command says is wrong."""


def _told(error: Exception, earlier: Any) -> str:
    message = str(error)
    if earlier is not None:
        message += " The output that is there was made of other inputs."
    return message


def _finished(command: Sequence[str], stop: Event) -> tuple[int, str, str]:
    """Wait for a command: its status, what it said, and what is wrong.

    Raises
    ------
    CancelledError : the batch is to end; the command was ended.
    """
    with TemporaryFile("w+", encoding="utf-8", errors="replace") as said, TemporaryFile("w+b") as problems:
        with child(command, stdout=said, stderr=problems, variables={TIED: "1"}) as process:  # type: ignore[arg-type]
            while process.poll() is None:
                with suppress(subprocess.TimeoutExpired):
                    process.wait(LOOK_S)
                if stop.is_set() and process.poll() is None:
                    process.terminate()
                    with suppress(subprocess.TimeoutExpired):
                        process.wait(PATIENCE_S)
                    raise CancelledError
        if process.returncode in INTERRUPTED and stop.wait(PATIENCE_S / 10):  # Ctrl+C reaches it before us
            raise CancelledError
        said.seek(0)
        problems.seek(0)
        lines = problems.read().decode("utf-8", "replace").splitlines()
        text = "\n".join(said.read().splitlines()[-MOST_LINES:])
    told = [line.removeprefix(SAYS) for line in lines if line.startswith(SAYS)]
    return process.returncode, text, " ".join(told or [line for line in lines if line.strip()][-1:])


def _record_of(folder: Path) -> dict[str, Any] | None:
    """What a finished job has left; None where there is none, or one that is damaged.

    Its files are in the folder, whatever somebody has written into it: they are removed when the job is done again.
    """
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        files, _ = [Path(name) for name in record["files"]], float(record["seconds"])
        inside = not any(file.is_absolute() or file.drive or ".." in file.parts for file in files)
        return record if inside else None
    except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError):
        return None


def _difference(folder: Path, record: dict[str, Any]) -> str:
    """What of the output of a job is not as it was written; empty where all is."""
    files = record["files"]
    if not isinstance(files, dict):  # as before version 0.3
        return "Its record does not say what was in its files"
    for name, digest in files.items():
        try:
            if _digest(folder / name) != digest:
                return f"{name} was not as it had been written"
        except OSError:
            return f"{name} was missing"
    return ""


def _digest(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _remove_outdated(folder: Path, record: dict[str, Any] | None) -> None:
    """Remove what the same job has made of other inputs, so that the new folder appears in one step."""
    if record is None:
        return
    inner = {(folder / name).parent for name in record["files"]} - {folder}
    inner |= {above for one in inner for above in one.parents if above.is_relative_to(folder) and above != folder}
    if any(one.is_symlink() for one in (folder, *inner)):
        return
    for name in (RECORD, *record["files"]):
        with suppress(OSError):
            (folder / name).unlink()
    for one in sorted(inner, reverse=True):
        with suppress(OSError):
            one.rmdir()
    with suppress(OSError):
        folder.rmdir()
