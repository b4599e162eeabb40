# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line ``rockfall COMMAND …``, the same through ``blender --command rockfall COMMAND …``.

A command is a module of `commands` with ``add_arguments(parser)`` and ``run(arguments) -> int``; it is imported only
when it is asked for, so that help is quick.
"""

import argparse
import gc
import logging
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, redirect_stdout
from errno import EINVAL
from importlib import import_module
from pathlib import Path
from traceback import extract_tb
from typing import Any, TextIO

from .children import end_with_parent_if_asked
from .errors import InputError, RockfallError, visible
from .interrupts import Interrupt, handled, interrupt, never_lost
from .output import complete

DONE, BAD_INPUT, USAGE, SIGNALLED = 0, 1, 2, 128
"""The exit status; of a process that a signal has ended it is `SIGNALLED` plus its number: 130 after Ctrl+C."""
TRACEBACK = "ROCKFALL_TRACEBACK"
"""Variable of the environment with which an error that nobody has foreseen is shown as Python shows it."""
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "1")
"""Of linear algebra, unless somebody asks for more, before NumPy is loaded: the matrices are small, and threads that
wait for each other take longer than the work. Rows are spread over the cores by Rockfall itself."""
CLOSED_PIPE = 141
"""What a shell says of a tool that a closed pipe has ended, as in ``rockfall models | head -1``."""

COMMANDS = {
    "demo": "the whole job on the bundled site: tables, statistics, a picture, the film",
    "terrain": "any terrain file, or several tiles → terrain.ply, and what there is to know about it",
    "inspect": "what a video file really contains, with advice",
    "align": "pairs of pixels and terrain points → the camera, camera.toml with residuals",
    "track": "follows the block through a video from one click → track.csv, proposed impacts",
    "refine": "fits picks and times to the pixels of the footage → picks, impacts with standard deviations",
    "reconstruct": "timed picks → impacts.csv and trajectories.csv",
    "spin": "one point of the block marked in two pictures or more → spin.csv, impacts with their angular velocity",
    "motion": "the motion of a project over time → speeds, heights, energies, residuals of tracks: motion.csv, figures",
    "statistics": "measured impacts alone, and groups of them → statistics.csv, groups.csv, figures",
    "compare": "impact models on measured impacts → predictions.csv, scores.csv, figures and a page",
    "explore": "a live page on this machine: a slider for every parameter of every model",
    "calibrate": "parameters of an impact model that fit measured impacts → calibration.csv, parameters.toml",
    "equivalent": "parameters with which one model behaves like another → equivalent.csv, parameters.toml",
    "merge": "impact tables of several sites → one table with its sources, impacts.csv and datapackage.json",
    "simulate": "whole rockfalls on the terrain → runs.csv, impacts.csv, trajectories.csv, hits.csv, summary.json",
    "compare-runs": "whole observed falls beside simulated ones → whole_runs.csv, whole_values.csv, runs.csv, figures",
    "back-analyse": "parameters with which whole falls come out as observed → posterior.csv, parameters.toml, figures",
    "design": "what barriers at screens must have, with the evidence → design.html, design.pdf, screens.csv",
    "batch": "a command for each project of a folder, or each combination of a sweep → a folder each, summary.json",
    "render": "the animation of a project, through Blender",
    "prepare": "compiles now what is compiled when first needed; the set-up and Blender do it themselves",
    "export": "the animation of a project for other programs, through Blender → animation.glb, .usdc, .abc",
    "web": "a page of a project in three dimensions, site and moving blocks in one file without network → site.html",
    "models": "the impact models, their parameters, units, ranges, defaults and sources",
}
"""Name → help, in the order of the work; the module of the same name in `commands`, with _ for -, does it."""
EPILOG = """rockfall COMMAND --help tells more about a command.

examples:
  rockfall demo --out demo
  rockfall reconstruct picks.csv --terrain slope.ply --out result
  rockfall statistics result/impacts.csv --out statistics
  rockfall compare result/impacts.csv --replicates 20 --out comparison
  rockfall simulate releases.csv --terrain slope.ply --model noel_2017 --out simulation"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0 done, 1 bad input, 2 usage, 130 interrupted, 141 output closed."""
    end_with_parent_if_asked()
    os.environ.setdefault(*ONE_THREAD)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # such as where it keeps its list of fonts
    try:
        with handled(interrupt), never_lost():
            status = _run(list(sys.argv[1:] if argv is None else argv))
            sys.stdout.flush()
    except KeyboardInterrupt as error:  # at the very end
        return _interrupted(error)
    except OSError as error:
        closed = _is_closed_pipe(error)
        if not closed:
            print(f"rockfall: What is said here cannot be written ({error.strerror}).", file=sys.stderr)
        for stream in (sys.stdout, sys.stderr) if closed else (sys.stdout,):  # it would fail again when Python ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return CLOSED_PIPE if closed else BAD_INPUT
    return status


def _run(argv: Sequence[str]) -> int:
    complete.set([])
    try:
        _check_characters(argv)
        arguments = _parser(argv).parse_args(argv)
        with redirect_stdout(VisibleStream(sys.stdout)), _blends(argv):
            status: int = arguments.run(arguments)
    except SystemExit as leaving:  # argparse has printed its help or its complaint
        return leaving.code if isinstance(leaving.code, int) else USAGE
    except RockfallError as error:
        print(f"rockfall: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt as error:
        return _interrupted(error)
    except Exception as error:
        if (isinstance(error, OSError) and _is_closed_pipe(error)) or os.environ.get(TRACEBACK):
            raise
        if isinstance(error.__context__, KeyboardInterrupt):  # a library has made something else of it
            return _interrupted(error.__context__)
        print(f"rockfall: {_in_words(error)}", file=sys.stderr)
        return BAD_INPUT
    return status


def _blends(argv: Sequence[str]) -> AbstractContextManager[None]:
    """Saved .blend files can be read where one is named; other commands do without what that takes to load."""
    if not any(word.lower().endswith(".blend") for word in argv):
        return nullcontext()
    from .exchange.saved_blend import saved_blends

    return saved_blends(print)


def _check_characters(argv: Sequence[str]) -> None:
    """Refuse names whose bytes are no text: what they name could be read, and no table could be written with it."""
    for word in argv:
        try:
            word.encode()
        except UnicodeEncodeError:
            raise InputError(
                f"{word} has bytes that are no characters in UTF-8", advice="Rename it, or write it in other letters"
            ) from None


class VisibleStream:
    """A stream on which names from files cannot command the terminal, nor turn the letters of a line round."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write what of a text is to be seen."""
        return self.stream.write(visible(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def _interrupted(error: KeyboardInterrupt) -> int:
    written = complete.get()
    said = f"{written[-1]} is complete" if written else "nothing was written"
    print(f"rockfall: interrupted, {error if error.args else said}.", file=sys.stderr)
    return SIGNALLED + (error.number if isinstance(error, Interrupt) else signal.SIGINT)


def _in_words(error: Exception) -> InputError:
    """What no reader and no writer has put into words."""
    match error:
        case OSError():
            problem = f"The system refuses a file ({error.strerror or error})"
            return InputError(problem, file=error.filename, advice="Check its permissions, and the room on the disk")
        case MemoryError():
            return InputError("This needs more memory than there is", advice="Give less at once, or a coarser terrain")
    place = extract_tb(error.__traceback__)[-1]
    said = f"{type(error).__name__}: {error}, {Path(place.filename).name} line {place.lineno}"
    return InputError(
        f"Something is wrong in Rockfall itself, and nothing was written ({said})",
        advice=f"Report it with the command and its files; with {TRACEBACK}=1 it says more",
    )


def _is_closed_pipe(error: OSError) -> bool:
    """Whether what reads the output has ended; Windows calls that an invalid argument."""
    return isinstance(error, BrokenPipeError) or (os.name == "nt" and (error.errno, error.filename) == (EINVAL, None))


def _parser(argv: Sequence[str]) -> argparse.ArgumentParser:
    """The parser, with the arguments of the command that `argv` asks for."""
    parser = argparse.ArgumentParser(
        prog="rockfall",
        description="From filmed rockfalls and scanned slopes to trajectories, impacts and films.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rockfall {_version()}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    asked = next((word for word in argv if not word.startswith("-")), None)
    for name, purpose in COMMANDS.items():
        command = commands.add_parser(name, help=purpose, description=purpose[:1].upper() + purpose[1:] + ".")
        if name == asked:
            module = import_module(f".commands.{name.replace('-', '_')}", __package__)
            module.add_arguments(command)
            command.set_defaults(run=module.run)
    return parser


def _version() -> str:
    return str(import_module((__package__ or "").removesuffix(".core")).__version__)


if __name__ == "__main__":
    ended = main()
    gc.freeze()  # see `start`
    sys.exit(ended)
