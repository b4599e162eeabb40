# SPDX-License-Identifier: GPL-3.0-or-later
"""What stays the same to the bit on another processor, and what does not.

    python scripts/verification/processors.py             # all commands: some minutes
    python scripts/verification/processors.py reconstruct simulate

Each command runs as on this processor, and again with what other processors choose: code of the kernels for any x86-64
(`NUMBA_CPU_NAME=generic`), the linear algebra of an old one (`OPENBLAS_CORETYPE=Prescott`) and of a newer one
(`Haswell`), NumPy and the system's mathematics without AVX2 and FMA, one core; and all of these at once. Each file that
it writes is compared with that of the first run: the same bytes, or how many numbers differ in what is written, and by
how much of the number (of the greatest in its column, where that is more).
"""

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "assets" / "demo"
KERNELS = ROOT / "build" / "kernels_of_processors"
START = "import sys; from rockfall.core.cli import main; sys.exit(main(sys.argv[1:]))"
TIMES = ("seconds", "blocks_per_s", "version", "inputs", "remarks")
"""Of JSON files: keys that do not belong to the result, or are told in words."""
SMALL = 1e-9
"""Of the greatest number of a column: what differs by less of it is counted as rounding."""


def commands(folder: Path) -> dict[str, list[str]]:
    """The words of each command behind `rockfall`, without its output folder; `folder` has what earlier ones wrote."""
    project = str(DEMO / "project.toml")
    many = ["simulate", str(folder / "demo.toml"), "--model", "noel_2017", "stevens_1998", "dorren_2015"]
    return {
        "reconstruct": ["reconstruct", project],
        "demo": ["demo", "--no-film"],
        "refine": ["refine", str(DEMO / "footage" / "project.toml")],
        "align": ["align", str(DEMO / "footage" / "pairs.csv"), "--size", "1280x720"],
        "simulate": many,
        "simulate with maps": [*many, "--cell", "1", "--record", "none"],
        "back-analyse": [
            "back-analyse", project, "--model", "stevens_1998", "--fit", "rn", "friction", "--sets", "200",
            "--rounds", "2", "--tables-only",
        ],
    }  # fmt: skip


def processors() -> dict[str, dict[str, str]]:
    """Variables of the environment by what they stand for; the first has none."""
    slow = {"NPY_DISABLE_CPU_FEATURES": " ".join(_dispatched()), "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX"}
    generic, prescott = {"NUMBA_CPU_NAME": "generic"}, {"OPENBLAS_CORETYPE": "Prescott"}
    one = {"PYTHON_CPU_COUNT": "1", "NUMBA_NUM_THREADS": "1"}
    return {
        "again": {},
        "one core": one,
        "kernels: generic": generic,
        "OpenBLAS: Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
        "OpenBLAS: Prescott": prescott,
        "NumPy, libm: no AVX2": slow,
        "all": one | generic | prescott | slow,
    }


def _dispatched() -> list[str]:
    """The features of this processor that NumPy chooses code by."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]


def run(words: Sequence[str], out: Path, variables: Mapping[str, str], kernels: Path | None = KERNELS) -> None:
    """Run a command; its kernels are kept apart for each kind of code, or where they always are without a folder."""
    kept = {} if kernels is None else {"NUMBA_CACHE_DIR": str(kernels / (variables.get("NUMBA_CPU_NAME") or "own"))}
    environment = os.environ | kept | dict(variables)
    done = subprocess.run(
        [sys.executable, "-c", START, *words, "--out", str(out)],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr}")


def numbers(file: Path) -> list[list[float | str]]:
    """The cells of a file: of a table by rows, of JSON and TOML one row, of a grid its rows."""
    if file.suffix in (".tif", ".tiff"):
        import tifffile

        return [[float(value) for value in row] for row in np.atleast_2d(tifffile.imread(file))]
    if file.suffix == ".json":
        return [list(_leaves(json.loads(file.read_text(encoding="utf-8"))))]
    with file.open(encoding="utf-8", newline="") as stream:
        return [[_number(cell) for cell in row] for row in csv.reader(stream)]


def _leaves(value: object, key: str = "") -> Iterator[float | str]:
    if key in TIMES:
        return
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, name)
    elif isinstance(value, list):
        for inner in value:
            yield from _leaves(inner)
    else:
        yield _number(str(value))


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def difference(first: Path, second: Path) -> tuple[int, int, float]:
    """How many cells of two files differ, of how many, and the largest relative difference; infinite of texts."""
    a, b = numbers(first), numbers(second)
    if [len(row) for row in a] != [len(row) for row in b]:
        return 1, 1, math.inf
    width = max(len(row) for row in a)
    greatest = [0.0] * width
    if len(a) > 1:
        for row in a:
            for i, cell in enumerate(row):
                if isinstance(cell, float) and math.isfinite(cell):
                    greatest[i] = max(greatest[i], abs(cell))
    differ, total, worst = 0, 0, 0.0
    for row, other in zip(a, b, strict=True):
        for i, (x, y) in enumerate(zip(row, other, strict=True)):
            total += 1
            if x == y or (isinstance(x, float) and isinstance(y, float) and math.isnan(x) and math.isnan(y)):
                continue
            differ += 1
            if isinstance(x, float) and isinstance(y, float) and math.isfinite(x) and math.isfinite(y):
                worst = max(worst, abs(x - y) / max(abs(x), abs(y), SMALL * greatest[i], 1e-300))
            else:
                worst = math.inf
    return differ, total, worst


def compared(first: Path, second: Path) -> str:
    """What differs between two folders, in a cell of the table."""
    files = sorted(file.relative_to(first) for file in first.rglob("*") if file.is_file())
    others = sorted(file.relative_to(second) for file in second.rglob("*") if file.is_file())
    if files != others:
        return "other files"
    texts: list[str] = []
    differ = total = 0
    worst = 0.0
    for file in files:
        if (first / file).read_bytes() == (second / file).read_bytes():
            continue
        if file.suffix in (".csv", ".json", ".tif"):
            some, of, most = difference(first / file, second / file)
            differ, total, worst = differ + some, total + of, max(worst, most)
        elif file.suffix == ".toml":
            continue
        else:
            texts.append(file.suffix)
    pictures = f"; {len(texts)} pictures" if texts else ""
    if not differ:
        return "same" + pictures
    size = "some another way" if math.isinf(worst) else f"≤ {worst:.0e}"
    return f"{differ} of {total}, {size}{pictures}"


def table(rows: Mapping[str, Mapping[str, str]], heads: Sequence[str]) -> list[str]:
    """As Markdown."""
    lines = [f"| | {' | '.join(heads)} |", "|" + "---|" * (len(heads) + 1)]
    return lines + [f"| `{name}` | {' | '.join(row.get(head, '') for head in heads)} |" for name, row in rows.items()]


def prepared(folder: Path) -> None:
    """The project of the simulations: the demo's, with twenty blocks from each measured release."""
    text = (DEMO / "project.toml").read_text(encoding="utf-8")
    for name in ("terrain.ply", "picks.csv"):
        text = text.replace(f'"{name}"', f'"{(DEMO / name).as_posix()}"')
    (folder / "demo.toml").write_text(
        text + '\n[simulation]\nseed = 1\n[simulation.releases]\nfrom = "measured"\nnumber = 20\n', encoding="utf-8"
    )


def measured(names: Sequence[str], said: Callable[[str], None]) -> dict[str, dict[str, str]]:
    """What differs, by command and kind of processor."""
    found: dict[str, dict[str, str]] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        prepared(folder)
        for name, words in commands(folder).items():
            if name not in names:
                continue
            first = folder / "first" / name
            run(words, first, {})
            found[name] = {}
            for kind, variables in processors().items():
                other = folder / kind / name
                run(words, other, variables)
                found[name][kind] = compared(first, other)
                said(f"{name}, {kind}: {found[name][kind]}")
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = list(commands(Path()))
    parser.add_argument("commands", nargs="*", choices=[*known, []], help="default: all")
    chosen = parser.parse_args(arguments).commands or known
    found = measured(chosen, lambda text: print(text, file=sys.stderr, flush=True))
    print("\n".join(table(found, list(processors()))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
