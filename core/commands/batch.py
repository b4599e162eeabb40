# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall batch``: a command for each project of a folder, or each combination of a sweep file."""

import argparse
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..children import rockfall_command
from ..errors import InputError
from ..interrupts import Interrupt
from .options import whole
from .progress import PrintedProgress, stopped_by_interrupt

if TYPE_CHECKING:
    from ..exchange.batch import Outcome
    from ..exchange.sweep import Job

EPILOG = """examples:
  rockfall batch sites simulate --number 1000 --out results
  rockfall batch sweep.toml simulate --out results --jobs 4
  rockfall batch sites track '{folder}/run.mp4' --clicks '{folder}/clicks.csv' --out tracks

COMMAND is run once for each project, which it gets as its first argument; where its options have {project} or
{folder}, these stand for the project's file or its folder instead. A batch that was stopped, or in which projects were
mended, goes on where it was when the same command is given again: what is finished is not done again."""
MOST_FAILED = 20
"""So many are said, all are in summary.json."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("source", metavar="FOLDER|SWEEP.toml", help="a folder of projects, or a sweep file")
    _add_own(parser)
    parser.add_argument("each", metavar="COMMAND", help="what is done with each project: simulate, refine, render, …")
    parser.add_argument("options", nargs=argparse.REMAINDER, metavar="…", help="options of COMMAND")


def run(arguments: argparse.Namespace) -> int:
    """Run all jobs, write summary.json, print what failed, then the rest; 1 when a job failed."""
    from ..exchange.batch import SUMMARY, Batch, run_batch, write_batch_summary
    from ..exchange.sweep import find_jobs
    from ..versions import versions

    own = argparse.ArgumentParser(prog="rockfall batch", add_help=False, allow_abbrev=False)
    _add_own(own)
    behind, options = own.parse_known_args(arguments.options)
    out, parallel = behind.out or arguments.out, behind.jobs or arguments.jobs or 1
    if out is None:
        raise InputError("--out is missing", advice="Give a folder for the output of all jobs: --out results")
    jobs = find_jobs(arguments.source)
    folder = Path(out)
    for job in jobs:
        if (folder / job.name).resolve() == job.project.parent.resolve():
            raise InputError("The output would lie in a project's own folder", file=out, advice="Choose another --out")
    _check(arguments.each, jobs, options)
    batch = Batch(arguments.each, tuple(options), jobs, folder, versions())
    program = rockfall_command.get()

    def make_command(job: "Job", draft: Path) -> list[str]:
        return [*program, arguments.each, *_arguments_of(job, options), "--out", str(draft)]

    with PrintedProgress() as progress, stopped_by_interrupt(progress, keeps=True) as counted:
        outcomes = run_batch(batch, make_command, parallel=parallel, progress=counted)
    kept = sum(one.output is not None for one in outcomes)
    _print(outcomes)
    if kept or folder.is_dir():
        write_batch_summary(batch, outcomes)
        print(f"Written: {SUMMARY} in {out}")
    if counted.asked:
        others = "; the same command goes on with the others" if kept < len(jobs) else ""
        raise Interrupt(counted.asked, f"{kept} of {len(jobs)} jobs are finished{others}")
    return 1 if any(one.state == "failed" for one in outcomes) else 0


def _add_own(parser: argparse.ArgumentParser) -> None:
    """What may also stand among the options of the command that is run."""
    parser.add_argument("--out", metavar="DIR", help="folder for the output: in it one for each job, and summary.json")
    parser.add_argument(
        "--jobs", type=whole, metavar="N", help="so many at a time (default 1; most commands use all cores themselves)"
    )


def _arguments_of(job: "Job", options: Sequence[str]) -> list[str]:
    """The project, where the options do not say it themselves, and the options."""
    said = {"{project}": str(job.project), "{folder}": str(job.project.parent)}
    given = [*options, *job.options]
    placed = any(place in option for option in given for place in said)
    for place, text in said.items():
        given = [option.replace(place, text) for option in given]
    return given if placed else [str(job.project), *given]


def _check(command: str, jobs: "Sequence[Job]", options: Sequence[str]) -> None:
    """What the command itself would say of the options of each job, before the first one runs.

    Raises
    ------
    InputError : there is no such command, or it makes no output.
    SystemExit : the options are wrong, as argparse says it.
    """
    try:
        module = import_module(f".{command.replace('-', '_')}", __package__)
        module.run  # noqa: B018
    except (ImportError, AttributeError) as error:
        raise InputError(f"There is no command {command!r}", advice="`rockfall --help` lists all") from error
    parser = argparse.ArgumentParser(prog=f"rockfall {command}", add_help=False)
    module.add_arguments(parser)
    if command == Path(__file__).stem or not any("--out" in action.option_strings for action in parser._actions):
        raise InputError(f"{command} makes nothing of a project", advice="Choose another command")
    for job in jobs:
        parser.parse_args([*_arguments_of(job, options), "--out", job.name])


def _print(outcomes: "Sequence[Outcome]") -> None:
    """What failed, then what is done."""
    failed = [one for one in outcomes if one.state == "failed"]
    if failed:
        print(f"{len(failed)} of {len(outcomes)} jobs failed:")
        for one in failed[:MOST_FAILED]:
            print(f"  {one.job}: {one.message}")
        if len(failed) > MOST_FAILED:
            print(f"  … and {len(failed) - MOST_FAILED} more")
    for state, words in (("not run", "not run"), ("done", "done"), ("already done", "already done before")):
        if count := sum(one.state == state for one in outcomes):
            print(f"{count} of {len(outcomes)} jobs {words}.")
