# SPDX-License-Identifier: GPL-3.0-or-later
"""From a model's plain Python function to machine code, when it is first needed.

A model is written once, as a plain function of floats, triples of floats and two named tuples. `compiled_model`
compiles it and every plain function that it calls, behind a signature that all models share (`ENTRY`): so
`compiled_driver` compiles one loop, which takes the model as a function pointer. A compiled simulation does the same
with `rebound_type`.
"""

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from ...compiled import kernel

ENTRY = """
def enter(v1, n, omega1, radius, mass, numbers, uniform):
    return rebound(v1, n, omega1, radius, mass, parameters({parameters}), draws({draws}){measured})
"""
"""A model behind the signature that all models share: its numbers come in two arrays and are handed on by name; those
of measured impacts come after the parameters, and stay an array."""


def compiled_model(
    rebound: Callable[..., Any], parameter_type: type[Any], draw_type: type[Any], draws_from_impacts: bool = False
) -> Any:
    """The compiled function of a model; other compiled functions can call it or take it as an argument."""
    text = ENTRY.format(
        parameters=", ".join(f"numbers[{i}]" for i in range(len(parameter_type._fields))),
        draws=", ".join(f"uniform[{i}]" for i in range(len(draw_type._fields))),
        measured=f", numbers[{len(parameter_type._fields)}:]" if draws_from_impacts else "",
    )
    own = {"__name__": rebound.__module__, "rebound": rebound, "parameters": parameter_type, "draws": draw_type}
    exec(compile(text, __file__, "exec"), own)  # in the name of this file, beside which numba keeps the compiled code
    return _compiled(own["enter"], _rebound_signature())


def rebound_type() -> Any:
    """The numba type of every model's compiled function: that of an argument of a compiled caller."""
    from numba import types

    return types.FunctionType(_rebound_signature())


@cache
def compiled_driver() -> Any:
    """`driver.drive`, compiled for any model."""
    from numba import types

    from .driver import drive

    rows, block, numbers = types.float64[:, ::1], types.float64[:, :, ::1], types.float64[::1]
    follows = types.intp[::1]
    return _compiled(
        drive,
        types.void(rebound_type(), rows, rows, rows, follows, numbers, numbers, numbers, block, block, block, block),
    )


@cache
def _rebound_signature() -> Any:
    from numba import types

    numba_types: Any = types  # its annotations stop half-way
    triple, numbers = numba_types.UniTuple(types.float64, 3), types.float64[::1]
    return numba_types.UniTuple(triple, 2)(triple, triple, triple, types.float64, types.float64, numbers, numbers)


@cache
def _compiled(function: FunctionType, signature: Any = None) -> Any:
    """The function and all plain functions that it calls, compiled; at once when its signature is given."""
    used = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    called = {name: _compiled(value) for name, value in used.items() if isinstance(value, FunctionType)}
    copy = FunctionType(function.__code__, {**function.__globals__, **called}, function.__name__)
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    # one function in the end: handing the named numbers from one to the next would take longer than using them
    made = kernel(copy, inline=signature is None)
    if signature is not None:
        made.compile(signature)
        made.disable_compile()
    return made
