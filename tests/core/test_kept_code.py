# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled code on disk: found again by other processes, and made anew when anything that it calls has changed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit
from rockfall.core.kept_code import digest

INNER = """
from rockfall.core.compiled import kernel

FACTOR = 2.0


@kernel
def scaled(x):
    return FACTOR * x
"""
OUTER = """
from rockfall.core.compiled import kernel
from bench.inner import scaled


@kernel
def shifted(x):
    return scaled(x) + 1.0
"""
READ = "from bench.outer import shifted; print(shifted(3.0), sum(shifted.stats.cache_hits.values()))"


def package(folder: Path, inner: str = INNER, outer: str = OUTER) -> Path:
    (folder / "bench").mkdir(parents=True, exist_ok=True)
    for name, text in (("__init__", ""), ("inner", inner), ("outer", outer)):
        (folder / "bench" / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


def started(folder: Path, cache: Path | None, code: str = READ) -> subprocess.Popen:
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    return subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )


def run(folder: Path, cache: Path | None, code: str = READ) -> str:
    process = started(folder, cache, code)
    out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return out.strip()


def kept(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*.kernel"))


def test_a_kernel_follows_the_module_of_one_that_it_calls(tmp_path):
    """A later process gets the new result; the same number of files is kept, and they are found again."""
    folder, cache = package(tmp_path / "a"), tmp_path / "cache"
    assert run(folder, cache) == "7.0 0"
    assert run(folder, cache) == "7.0 1"
    before = kept(cache)
    for old, new, value in (("FACTOR = 2.0", "FACTOR = 5.0", "16.0"), ("FACTOR * x", "FACTOR - x", "0.0")):
        package(folder, INNER.replace(old, new))
        assert run(folder, cache) == f"{value} 0"
        assert run(folder, cache) == f"{value} 1"
        assert kept(cache) == before == kept(tmp_path)
    assert not list(cache.rglob("*.tmp"))


def test_several_processes_at_once_and_damaged_files(tmp_path):
    """Each gets the result of its own signature, also where a file was cut short."""
    folder, cache = package(tmp_path / "a"), tmp_path / "cache"
    codes = [READ.replace("3.0)", f"{x})") for x in ("3.0", "3", "3.0", "True")]
    all_types = READ.replace("shifted(3.0)", "shifted(3.0), shifted(3), shifted(True)")

    def results(codes: list[str]) -> list[list[str]]:
        processes = [started(folder, cache, code) for code in codes]
        return [process.communicate(timeout=300)[0].split() for process in processes]

    assert [value for value, _ in results(codes)] == ["7.0", "7.0", "7.0", "3.0"]
    assert results([all_types]) == [["7.0", "7.0", "3.0", "3"]]
    for file in cache.rglob("*.kernel"):
        file.write_bytes(file.read_bytes()[:-100])
    assert [values[:3] for values in results([all_types] * 2)] == [["7.0", "7.0", "3.0"]] * 2
    assert len(kept(cache)) == 6  # three types of the argument, two functions


def test_code_is_kept_beside_the_source_or_nowhere(tmp_path):
    """Without a directory that can be written to, everything works, and nothing is kept."""
    folder = package(tmp_path / "a")
    assert [run(folder, None), run(folder, None)] == ["7.0 0", "7.0 1"]
    assert len(kept(folder / "bench" / "__pycache__")) == 2
    for file in (folder / "bench" / "__pycache__").iterdir():
        file.unlink()
    (folder / "bench" / "__pycache__").rmdir()
    (folder / "bench" / "__pycache__").write_text("not a folder", encoding="utf-8")
    nowhere = (
        "import os; os.environ['XDG_CACHE_HOME'] = os.environ['HOME'] = os.environ['LOCALAPPDATA'] = '/dev/null'\n"
    )
    assert run(folder, Path("/dev/null/kernels"), nowhere + READ) == "7.0 0"
    assert run(folder, Path("/dev/null/kernels"), nowhere + READ) == "7.0 0"


def test_what_a_digest_looks_at():
    """Names of functions in modules, constants behind calls, default values, closures; not the place in the file."""

    def made(text: str):
        scope = {}
        exec("import math\nimport numpy as np\n" + text, scope)
        return digest(scope["f"])

    one = made("a = 1.0\ndef g(x): return a * math.sin(x)\ndef f(x, y=2): return g(x) + np.max(x)")
    assert one == made("\n\na = 1.0\ndef f(x, y=2): return g(x) + np.max(x)\ndef g(x): return a * math.sin(x)")
    others = {
        made("a = 2.0\ndef g(x): return a * math.sin(x)\ndef f(x, y=2): return g(x) + np.max(x)"),
        made("a = 1.0\ndef g(x): return a * math.cos(x)\ndef f(x, y=2): return g(x) + np.max(x)"),
        made("a = 1.0\ndef g(x): return a * math.sin(x)\ndef f(x, y=3): return g(x) + np.max(x)"),
        made("a = 1.0\ndef g(x): return a * math.sin(x)\ndef f(x, y=2): return g(x) + np.min(x)"),
        made("a = np.ones(2)\ndef g(x): return a * math.sin(x)\ndef f(x, y=2): return g(x) + np.max(x)"),
        made("a = np.zeros(2)\ndef g(x): return a * math.sin(x)\ndef f(x, y=2): return g(x) + np.max(x)"),
        made("def h(a):\n    def f(x): return a\n    return f\nf = h(1)"),
        made("def h(a):\n    def f(x): return a\n    return f\nf = h(2)"),
    }
    assert len(others - {one}) == 8


def test_a_digest_looks_at_how_a_function_that_is_called_is_compiled():
    def made(**options):
        scope = {"g": njit(**options)(lambda x: x + 1.0)}
        exec("def f(x): return g(x)", scope)
        return digest(scope["f"])

    assert made() == made()
    assert len({made(), made(forceinline=True), made(error_model="numpy")}) == 3


def test_what_the_set_up_of_a_checkout_has_compiled_is_used(tmp_path: Path) -> None:
    """Ours is kept where the set-up leaves it, code of others beside its source."""
    package(tmp_path)
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    code = (
        "import rockfall.core.kept_code as k, pathlib, sys\n"
        f"k.CHECKOUT = pathlib.Path({str(kernels)!r})\n"
        "import numpy as np\n"
        "from rockfall.core.exchange.shortest_kernels import _upper\n"
        "from bench.outer import shifted\n"
        "print([f._cache.cache_path for f in (_upper, shifted)])\n"
        "from numba import config; print(config.CACHE_DIR)"
    )
    ours, others = eval(run(tmp_path, None, code).splitlines()[0])
    assert Path(ours).is_relative_to(kernels)
    assert not Path(others).is_relative_to(kernels)


@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="only root can make files of other users")
def test_code_that_another_user_has_left_is_not_run(tmp_path):
    folder, cache = package(tmp_path / "a"), tmp_path / "cache"
    assert run(folder, cache) == "7.0 0"
    for file in cache.rglob("*.kernel"):
        os.chown(file, 65534, 65534)
    assert run(folder, cache) == "7.0 0"
    assert run(folder, cache) == "7.0 1"
