# SPDX-License-Identifier: GPL-3.0-or-later
"""Machine code on disk, used as long as nothing that it was made of has changed.

numba's own cache looks at the file of a function and not at the functions that it calls. Here a compiled function is
kept with a digest of its own code and of all functions and constants that it reaches, in whatever module they stand.
"""

import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from .errors import InputError
from .open_folders import is_own
from .output import write_bytes

TREE = Path(__file__).parents[1]
CHECKOUT = TREE / "build" / "kernels"
"""Where the set-up of a checkout leaves what it compiles of ours."""
PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype)


class KeptCode:
    """Where a function compiled by numba looks for its machine code, and leaves it: numba's `_Cache`.

    Notes
    -----
    The directories are numba's: NUMBA_CACHE_DIR, else `CHECKOUT` if it is there, else beside the source, else the
    user's; with none to write to, code is compiled anew in each process. One file for each signature and kind of
    processor begins with a check sum over the digest and the code, and replaces an outdated one in one step: several
    processes may read and write at once, nothing half-written or outdated is used, and nothing piles up. A
    file of another user, in a directory that several write to, is not used.
    """

    def __init__(self, dispatcher: Any) -> None:
        self._function: Callable[..., Any] = dispatcher.py_func
        self._options = _options(dispatcher)

    @property
    def cache_path(self) -> str | None:
        """The directory, None without any."""
        return self._numba.locator.get_cache_path() if self._numba else None

    @cached_property
    def _numba(self) -> Any:
        from numba.core import caching, config

        make: Any = caching.CompileResultCacheImpl
        settings: Any = config
        asked = settings.CACHE_DIR
        if not asked and CHECKOUT.is_dir() and Path(self._function.__code__.co_filename).is_relative_to(TREE):
            settings.CACHE_DIR = str(CHECKOUT)
        try:
            return make(self._function)
        except RuntimeError:  # no directory can be written to
            return None
        finally:
            settings.CACHE_DIR = asked

    @cached_property
    def _digest(self) -> bytes:
        return (
            digest(self._function) + self._options
        ).encode()  # when it is needed: all that the function calls is defined by then

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled function for a signature, or None."""
        if self._numba is None:
            return None
        target.refresh()
        try:
            with self._file(signature, target.codegen()).open("rb") as stream:
                if not self._is_trusted(os.fstat(stream.fileno())):
                    return None
                kept = stream.read()
        except OSError:
            return None
        code = kept[32:]
        if kept[:32] != self._check(code):
            return None
        return self._numba.rebuild(target, pickle.loads(code))

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a compiled function, where that is possible."""
        from numba.core import serialize

        dumps: Any = serialize.dumps
        if self._numba is None or not self._numba.check_cachable(compiled):
            return
        code = dumps(self._numba.reduce(compiled))
        file = self._file(signature, compiled.codegen)
        with suppress(InputError):  # a full disk, or another process that has the file open
            write_bytes(file, self._check(code) + code)

    def flush(self) -> None:
        """Nothing is kept open."""

    def _is_trusted(self, state: os.stat_result) -> bool:
        """Whether it is of this user, of the system or of whom the source belongs to: what is kept is run."""
        source = Path(self._function.__code__.co_filename)
        return is_own(state) or state.st_uid in (0, source.stat().st_uid if source.exists() else 0)

    def _check(self, code: bytes) -> bytes:
        return hashlib.sha256(self._digest + code).digest()

    def _file(self, signature: Any, codegen: Any) -> Path:
        version = sys.implementation.cache_tag
        fields = [getattr(one, "fields", ()) for one in getattr(signature, "args", signature)]  # of named tuples
        key = hashlib.sha256(repr((str(signature), fields, codegen.magic_tuple(), version)).encode()).hexdigest()[:16]
        name = self._function.__qualname__.replace("<", "").replace(">", "")
        return Path(self._numba.locator.get_cache_path(), f"{self._function.__module__}.{name}-{key}.kernel")


def digest(function: Callable[..., Any]) -> str:
    """Of the code and the constants of a function and of all that it calls, and of what compiles it."""
    import numba

    found = hashlib.sha256(f"{sys.version} {numba.__version__} {np.__version__}".encode())
    todo: list[Any] = [function]
    seen = {id(function)}
    while todo:
        one = todo.pop()
        called: list[Any] = []
        for part in _parts(one, called.append):
            found.update(part.encode() + b"\n")
        for other in called:
            if id(other) not in seen:
                seen.add(id(other))
                todo.append(other)
    return found.hexdigest()


def _parts(function: FunctionType, call: Callable[[FunctionType], None]) -> Iterator[str]:
    """What a function is made of, as texts; the functions that it reaches are handed to `call`."""

    def described(value: Any) -> str:
        options = _options(value)
        value = getattr(value, "py_func", value)
        if isinstance(value, FunctionType):
            call(value)
            return f"{value.__qualname__} {options}"
        if isinstance(value, PLAIN):
            return repr(value)
        if isinstance(value, np.ndarray):
            return f"{value.dtype}{value.shape}{value.tobytes().hex()}"
        if isinstance(value, tuple | list):
            return f"({','.join(map(described, value))})"
        return f"{type(value).__qualname__} {getattr(value, '__name__', '')} {getattr(value, '_fields', '')}"

    yield function.__qualname__
    yield described(function.__defaults__)
    for cell in function.__closure__ or ():
        yield described(cell.cell_contents)
    for code in _codes(function.__code__):
        yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {code.co_freevars} {code.co_cellvars}"
        yield ",".join("code" if isinstance(one, CodeType) else _constant(one) for one in code.co_consts)
        used = {name: function.__globals__[name] for name in code.co_names if name in function.__globals__}
        for name, value in sorted(used.items()):
            yield f"{name}={described(value)}"
            if isinstance(value, ModuleType):
                for attribute in sorted(set(code.co_names)):
                    if hasattr(value, attribute):
                        yield f"{name}.{attribute}={described(getattr(value, attribute))}"


def _options(value: Any) -> str:
    """How a function is compiled, where it is one that numba compiles."""
    return repr(sorted(getattr(value, "targetoptions", {}).items())) if hasattr(value, "py_func") else ""


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _constant(value: Any) -> str:
    return repr(sorted(map(repr, value)) if isinstance(value, frozenset) else value)
