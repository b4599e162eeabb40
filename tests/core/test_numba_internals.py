# SPDX-License-Identifier: GPL-3.0-or-later
"""Another numba, in which something that Rockfall uses is gone or changed, is refused in words before any kernel."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import pytest
import rockfall
from numba.core import caching, config, cpu, dispatcher
from rockfall.core.errors import DependencyError
from rockfall.core.numba_internals import BELOW, LOWEST, check_numba, differences

CHANGES = {
    "the option _nrt of njit": (cpu.CPUTargetOptions, "_nrt", None),
    "the attribute targetoptions of a compiled function": (dispatcher.Dispatcher, "__init__", lambda *_, **__: None),
    "caching.CompileResultCacheImpl.reduce": (caching.CompileResultCacheImpl, "reduce", lambda self, result, path: b""),
    "caching.CompileResultCacheImpl.locator": (caching.CompileResultCacheImpl, "locator", None),
    "caching._Cache.load_overload": (caching._Cache, "load_overload", lambda self, signature: None),
    "config.CACHE_DIR": (config, "CACHE_DIR", None),
}
"""What is missing (None), or there in another form."""


def test_the_installed_numba_fits() -> None:
    assert differences() == []
    check_numba()


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_part_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, attribute, other = CHANGES[name]
    if other is None:
        holder = next((one for one in getattr(owner, "__mro__", [owner]) if attribute in vars(one)), owner)
        monkeypatch.delattr(holder, attribute)
    else:
        monkeypatch.setattr(owner, attribute, other)
    assert name in differences()


def test_what_a_cache_needs_besides_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caching._Cache, "__abstractmethods__", caching._Cache.__abstractmethods__ | {"prune"})
    assert differences() == ["caching._Cache.prune"]


def test_the_message_says_the_version_and_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rockfall.core.numba_internals.differences", lambda: ["the option _nrt of njit"])
    check_numba.cache_clear()
    try:
        with pytest.raises(DependencyError) as caught:
            check_numba()
    finally:
        check_numba.cache_clear()
    for part in (numba.__version__, "the option _nrt of njit", LOWEST, f'pip install "numba>={LOWEST},<{BELOW}"'):
        assert part in str(caught.value)


def test_a_command_ends_in_words(tmp_path: Path) -> None:
    """No traceback, whatever first needs a kernel."""
    site = Path(rockfall.__file__).parent / "assets" / "demo" / "project.toml"
    code = (
        "import sys; from numba.core import cpu, options; delattr(cpu._options_mixin, '_nrt');"
        "from rockfall.core.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "reconstruct", str(site), "--out", str(tmp_path / "out")],
        capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 1
    words = f"rockfall: numba {numba.__version__} does not fit: the option _nrt of njit changed. Known to work are"
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_the_bounds_are_those_of_the_project() -> None:
    project = tomllib.loads((Path(rockfall.__file__).parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"numba>={LOWEST},<{BELOW}" in project["dependencies"]
    assert tuple(map(int, LOWEST.split("."))) <= tuple(map(int, numba.__version__.split(".")[:2]))
