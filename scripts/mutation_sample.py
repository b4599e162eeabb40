# SPDX-License-Identifier: GPL-3.0-or-later
"""Which single changes of the code do the tests not notice? A seeded sample; not part of CI.

    python scripts/mutation_sample.py --count 150 --seed 1 core                 # files or folders
    python scripts/mutation_sample.py --count 20 --seed 2 rockfall_addon/scene

Works on copies of the tree below --work, never in the checkout. First all tests of the level (tests/core, or
tests/blender for the add-on) run once, to learn which of them execute which line. Then each change is made, and the
tests of its line run, the quickest first, until one fails. Lines that no test runs by themselves (outside functions, or
compiled by numba) get the tests that run anything in their file or in those that import it, and those that are called
after the file or its folder, or speak of it.

Started again with the same arguments it goes on where it was; remove --work to begin anew, and after an edit. A change
that ran past its time is counted on its own, not as noticed. Kernels are compiled as always, so a change of one costs
its compilation.
"""

import argparse
import ast
import csv
import fcntl
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LEAST_S, TIMES = 40.0, 4.0
"""A change may take this long, and so many times what its tests took before."""

SWAPS = {
    "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is": "is not", "is not": "is",
    "in": "not in", "not in": "in", "+": "-", "-": "+", "*": "/", "/": "*", "**": "*", "%": "*", "//": "/",
    "and": "or", "or": "and",
}  # fmt: skip
NAMES = {
    "min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin",
    "any": "all", "all": "any", "floor": "ceil", "ceil": "floor", "argmin": "argmax", "argmax": "argmin",
}  # fmt: skip
SYMBOLS = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is",
    ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in", ast.Add: "+", ast.Sub: "-", ast.Mult: "*",
    ast.Div: "/", ast.Pow: "**", ast.Mod: "%", ast.FloorDiv: "//", ast.And: "and", ast.Or: "or",
}  # fmt: skip


@dataclass(frozen=True)
class Change:
    """Text from `start` to `end` of a file (in characters) becomes `after`."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str


def changes_of(file: str, source: str) -> list[Change]:
    """All single changes of one file."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    lines, tree, found = source.splitlines(), ast.parse(source), []

    def at(line: int, column: int) -> int:
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.AST) -> tuple[int, int]:
        return at(node.lineno, node.col_offset), at(node.end_lineno, node.end_col_offset)

    def add(start: int, end: int, after: str) -> None:
        line = source.count("\n", 0, start) + 1
        found.append(Change(file, line, start, end, source[start:end], after))

    def between(left: ast.AST, right: ast.AST, symbol: str) -> None:
        start, end = span(left)[1], span(right)[0]
        place = re.search(r"(?<![*/<>=!])" + r"\s+".join(map(re.escape, symbol.split())), source[start:end])
        if place:
            add(start + place.start(), start + place.end(), SWAPS[symbol])

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.Compare):
            for left, symbol, right in zip([node.left, *node.comparators], node.ops, node.comparators, strict=False):
                between(left, right, SYMBOLS[type(symbol)])
        elif isinstance(node, ast.BinOp) and type(node.op) in SYMBOLS:
            between(node.left, node.right, SYMBOLS[type(node.op)])
        elif isinstance(node, ast.BoolOp):
            between(node.values[0], node.values[1], SYMBOLS[type(node.op)])
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            add(span(node)[0], span(node.operand)[0], "")
        elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
            add(*span(node), str(not node.value))
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            add(*span(node), repr(node.value + 1 if isinstance(node.value, int) else 1.1 * node.value or 0.1))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute):
            name = node.func.id if isinstance(node.func, ast.Name) else node.func.attr
            if name in NAMES:
                end = span(node.func)[1]
                add(end - len(name), end, NAMES[name])
        elif is_dispensable(node):
            add(*span(node), "pass")
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "type_params"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                    visit(child)

    visit(tree)
    return [change for change in found if parses(source, change)]


def is_dispensable(node: ast.AST) -> bool:
    """A call or an addition whose result nothing takes at once, or a check."""
    if isinstance(node, ast.If):
        return not node.orelse and isinstance(node.body[-1], ast.Raise | ast.Return)
    return isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call))


def parses(source: str, change: Change) -> bool:
    try:
        ast.parse(source[: change.start] + change.after + source[change.end :])
    except SyntaxError:
        return False
    return True


def functions_lines(source: str) -> set[int]:
    """Lines inside functions: those that a test runs, and not the import."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
    nodes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, kinds)]
    return {
        line
        for node in nodes
        for part in (node.body if isinstance(node.body, list) else [node.body])
        for line in range(part.lineno, part.end_lineno + 1)
    }


class Learning:
    """A pytest plugin: which test runs which lines of the tree, and how long it takes."""

    def __init__(self, tree: Path) -> None:
        self.package = f"{package_of(tree)}{os.sep}"
        self.lines: dict[str, dict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
        self.tests: list[tuple[str, float]] = []
        self.failed: set[str] = set()

    def pytest_sessionstart(self) -> None:
        sys.monitoring.use_tool_id(sys.monitoring.COVERAGE_ID, "mutation_sample")
        sys.monitoring.register_callback(sys.monitoring.COVERAGE_ID, sys.monitoring.events.LINE, self.line)
        sys.monitoring.set_events(sys.monitoring.COVERAGE_ID, sys.monitoring.events.LINE)

    def line(self, code: object, number: int) -> object:
        if code.co_filename.startswith(self.package) and self.tests:
            self.lines[code.co_filename.removeprefix(self.package)][number].append(len(self.tests) - 1)
        return sys.monitoring.DISABLE

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self.tests.append((nodeid, time.monotonic()))
        sys.monitoring.restart_events()

    def pytest_runtest_logreport(self, report: object) -> None:
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        self.tests[-1] = (nodeid, time.monotonic() - self.tests[-1][1])


def tests_in(tree: Path, arguments: list[str], plugins: list[object], blender: bool) -> int:
    """Run pytest in this process, on a copy of the tree."""
    import pytest

    os.chdir(tree)
    sys.path.insert(0, str(package_of(tree).parent))
    if blender:
        import bpy  # noqa: F401
    return int(pytest.main(["-q", "-p", "no:cacheprovider", "--import-mode=importlib", *arguments], plugins=plugins))


def forked(work, limit_s: float, log: Path) -> int | None:
    """Exit status of ``work()`` in a child of this warm process; None when it ran past its time."""
    child = os.fork()
    if child == 0:
        os.setsid()
        with log.open("wb") as file:
            for number in (1, 2):
                os.dup2(file.fileno(), number)
        try:
            code = work()
        except BaseException as error:  # noqa: BLE001 - the child ends here, whatever it was
            print(repr(error), flush=True)
            code = 70
        os._exit(code)
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def copy_tree(to: Path) -> None:
    """The files of the checkout, and beside them a folder in which they are the package `rockfall`."""
    shutil.rmtree(to, ignore_errors=True)
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout.split("\0"):
        if name and (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    package = package_of(to)
    package.parent.mkdir(exist_ok=True)
    package.unlink(missing_ok=True)
    package.symlink_to(to)


def package_of(tree: Path) -> Path:
    """A link to a copy of the tree, by the name that Python and the tests import."""
    return tree.parent / f"{tree.name}-path" / "rockfall"


def learn(work: Path, level: str, words: str) -> dict:
    """The map of lines to tests, of one run of all tests; kept in the folder of this work."""
    kept = work / f"{level}.json"
    if not kept.exists():
        tree = work / "tree0"
        plugin = Learning(tree)

        def run() -> int:
            tests_in(tree, [f"tests/{level}", "-k", words], [plugin], level == "blender")
            kept.write_text(
                json.dumps({"tests": plugin.tests, "lines": plugin.lines, "failed": sorted(plugin.failed)}),
                encoding="utf-8",
            )
            return 0

        print(f"running tests/{level} once, to learn which test runs which line", flush=True)
        if forked(run, 3600.0, work / f"{level}.log") != 0:
            raise SystemExit(f"mutation_sample: the tests do not run through, see {work / f'{level}.log'}")
    known = json.loads(kept.read_text(encoding="utf-8"))
    if known["failed"]:
        print(f"left out, since they fail without any change: {', '.join(known['failed'])}", flush=True)
    return known


def word_of(file: str) -> re.Pattern[str]:
    """A line that imports the module of a file."""
    stem = re.escape(Path(file).stem)
    return re.compile(rf"\bimport\b.*\b{stem}\b|\b{stem}\b.*\bimport\b")


def named_after(file: str, known: dict, tree: Path) -> list[int]:
    """Numbers of the tests whose file is called after a file or its folder, or speaks of it."""
    path = Path(file)
    stem = path.stem.removesuffix("_kernels")
    words = {stem, path.parent.name if path.parent.name != "machinery" else path.parent.parent.name}
    found: dict[str, bool] = {}
    for name, _ in known["tests"]:
        place = name.partition("::")[0]
        if place not in found:
            source = tree / place
            speaks = source.is_file() and re.search(rf"\b{re.escape(stem)}\b", source.read_text(encoding="utf-8"))
            found[place] = bool(speaks) or any(word in Path(place).stem for word in words)
    return [number for number, (name, _) in enumerate(known["tests"]) if found[name.partition("::")[0]]]


def tests_for(change: Change, known: dict, tree: Path) -> list[int]:
    """Numbers of the tests that run the changed line, the quickest first."""
    lines, inner = known["lines"], functions_lines((tree / change.file).read_text(encoding="utf-8"))
    found = set(lines.get(change.file, {}).get(str(change.line), ())) if change.line in inner else set()
    is_compiled = "kernels" in change.file or "impact_models" in change.file
    if is_compiled or not found:
        # What numba compiles leaves no trace in the map, nor do modules that are imported by name.
        near = {file for file in lines if word_of(change.file).search((tree / file).read_text(encoding="utf-8"))}
        found = {test for file in (*near, change.file) for tests in lines.get(file, {}).values() for test in tests}
        found |= set(named_after(change.file, known, tree))
    good = [test for test in found if known["tests"][test][0] not in known["failed"]]
    return sorted(good, key=lambda test: known["tests"][test][1])


def try_out(change: Change, known: dict, tree: Path, log: Path) -> str:
    """``noticed``, ``SURVIVED``, ``late``, or ``no test``."""
    chosen = tests_for(change, known, tree)
    if not chosen:
        return "no test"
    level = "blender" if change.file.startswith("rockfall_addon") else "core"
    limit_s = LEAST_S + TIMES * sum(known["tests"][test][1] for test in chosen)
    path = tree / change.file
    source = path.read_text(encoding="utf-8")
    path.write_text(source[: change.start] + change.after + source[change.end :], encoding="utf-8")
    try:
        names = [known["tests"][test][0] for test in chosen]
        status = forked(lambda: tests_in(tree, ["-x", *names], [], level == "blender"), limit_s, log)
    finally:
        path.write_text(source, encoding="utf-8")
    return {None: "late", 0: "SURVIVED", 4: "no test", 5: "no test"}.get(status, "noticed")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", help="files or folders of core/ or rockfall_addon/")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("-k", default="", metavar="WORDS", help="only the tests with these words, as pytest has it")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "rockfall-mutations")
    options = parser.parse_args()
    work = options.work.resolve()
    paths = [
        path
        for name in options.files
        for path in ([ROOT / name] if name.endswith(".py") else (ROOT / name).rglob("*.py"))
    ]
    sources = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in sorted(paths)}
    levels = sorted({"blender" if file.startswith("rockfall_addon") else "core" for file in sources})
    everything = [change for file, source in sources.items() for change in changes_of(file, source)]
    sample = random.Random(options.seed).sample(everything, min(options.count, len(everything)))
    print(f"{len(sample)} of {len(everything)} changes of {len(sources)} files", flush=True)

    work.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ["NUMBA_CACHE_DIR"] = str(work / "kernels")
    for job in range(options.jobs):
        copy_tree(work / f"tree{job}")
    import cv2, numba, numpy, scipy.optimize, scipy.spatial, trimesh, pytest  # noqa: E401, F401, I001 - warm

    known = {level: learn(work, level, options.k) for level in levels}
    results = work / f"results-{options.seed}.csv"
    results.touch()

    def key(change: Change) -> list[str]:
        return [change.file, str(change.line), str(change.start), change.before, change.after]

    def rows() -> list[list[str]]:
        with results.open(encoding="utf-8", newline="") as file:
            return list(csv.reader(file))

    done = {tuple(row[:5]) for row in rows()}
    left = [change for change in sample if tuple(key(change)) not in done]
    children = []
    for job in range(options.jobs):
        if child := os.fork():
            children.append(child)
            continue
        for change in left[job :: options.jobs]:
            level = known["blender" if change.file.startswith("rockfall_addon") else "core"]
            outcome = try_out(change, level, work / f"tree{job}", work / f"job{job}.log")
            with results.open("a", encoding="utf-8", newline="") as file:
                fcntl.flock(file, fcntl.LOCK_EX)
                csv.writer(file).writerow([*key(change), outcome])
            before, after = (" ".join(text.split())[:70] for text in (change.before, change.after))
            print(f"{outcome:9} {change.file}:{change.line}  {before} → {after or 'nothing'}", flush=True)
        os._exit(0)
    for child in children:
        os.waitpid(child, 0)

    wanted = {tuple(key(change)) for change in sample}
    counted = Counter(row[5] for row in rows() if tuple(row[:5]) in wanted)
    print("\n| file | line | before | after | |\n|---|---|---|---|---|")
    for row in sorted(rows()):
        if tuple(row[:5]) in wanted and row[5] != "noticed":
            before, after = (" ".join(text.split())[:90].replace("|", "\\|") for text in row[3:5])
            print(f"| {row[0]} | {row[1]} | `{before}` | `{after}` | {row[5]} |")
    print("\n" + ", ".join(f"{count} {outcome}" for outcome, count in counted.most_common()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
