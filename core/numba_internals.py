# SPDX-License-Identifier: GPL-3.0-or-later
"""What Rockfall uses of numba beyond its documented interface, and whether the installed numba still has it.

Kept code replaces numba's own cache, and kernels that make no arrays do without its counting of references. Neither is
a part of numba's interface, so another version may change it. A kernel must not give wrong results or pile up files
then.
"""

from functools import lru_cache
from inspect import signature
from typing import Any

from .errors import DependencyError

LOWEST, BELOW = "0.65", "0.69"
"""The versions that are known to work, as in pyproject.toml: from the first on, below the second."""
OPTIONS = ("nogil", "error_model", "forceinline", "_nrt")
"""Those of numba's compiler that kernels are made with."""
KEEPING = {"reduce": 1, "rebuild": 2, "check_cachable": 1}
"""What makes bytes of compiled code and back: the methods of numba's class, and how many arguments they take."""
CACHE = {"load_overload": 2, "save_overload": 2, "flush": 0}
"""The methods of a cache that numba calls."""


@lru_cache(maxsize=1)
def check_numba() -> None:
    """Before the first kernel is made.

    Raises
    ------
    DependencyError : a part is missing or has another form; the message names the version, and those that work.
    """
    import numba

    wrong = differences()
    if wrong:
        raise DependencyError(
            f"numba {numba.__version__} does not fit: {', '.join(wrong)} changed. Known to work are versions from "
            f'{LOWEST}, below {BELOW}. Install one: pip install "numba>={LOWEST},<{BELOW}"; '
            "in Blender, install the Rockfall extension again, which brings its own"
        )


def differences() -> list[str]:
    """The parts of numba that are not as Rockfall uses them."""
    from numba import njit
    from numba.core import caching, codegen, config, cpu, serialize

    parts: dict[str, Any] = {"caching": caching, "codegen": codegen, "config": config, "serialize": serialize}
    keep, cache = (getattr(parts["caching"], name, None) for name in ("CompileResultCacheImpl", "_Cache"))
    asked: frozenset[str] = getattr(cache, "__abstractmethods__", frozenset()) - {
        "enable",
        "disable",
    }  # of the option cache=True
    options = getattr(cpu, "CPUTargetOptions", None)
    function: Any = njit(_nothing)
    found = {
        **{f"the option {name} of njit": hasattr(options, name) for name in OPTIONS},
        **{f"caching.CompileResultCacheImpl.{name}": _takes(keep, name, count) for name, count in KEEPING.items()},
        **{f"caching._Cache.{name}": _takes(cache, name, count) for name, count in CACHE.items()},
        **{f"caching._Cache.{name}": False for name in sorted(asked - {*CACHE, "cache_path"})},
        "caching.CompileResultCacheImpl.locator": hasattr(keep, "locator"),
        "the attribute _cache of a compiled function": hasattr(function, "_cache"),
        "the attribute targetoptions of a compiled function": hasattr(function, "targetoptions"),
        "config.CACHE_DIR": hasattr(parts["config"], "CACHE_DIR"),
        "serialize.dumps": callable(getattr(parts["serialize"], "dumps", None)),
        "codegen.CPUCodegen.magic_tuple": hasattr(getattr(parts["codegen"], "CPUCodegen", None), "magic_tuple"),
    }
    return [name for name, good in found.items() if not good]


def _takes(owner: Any, name: str, arguments: int) -> bool:
    """Whether a class has a method with so many arguments."""
    method = getattr(owner, name, None)
    return callable(method) and len(signature(method).parameters) == 1 + arguments


def _nothing() -> None:
    """To be wrapped, not compiled."""
