# SPDX-License-Identifier: GPL-3.0-or-later
"""One hash of values as they are, whatever file or command they came from."""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import Any

import numpy as np


def content_digest(*values: Any) -> str:
    """SHA-256 of arrays, numbers, texts, and dataclasses, mappings and sequences of these.

    Raises
    ------
    TypeError : a value of another kind.
    """
    found = hashlib.sha256()
    for part in _parts(values):
        found.update(len(part).to_bytes(8, "little"))
        found.update(part)
    return found.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype.str}{value.shape}".encode()
        yield value.tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        yield type(value).__qualname__.encode()
        for field in fields(value):
            yield field.name.encode()
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}".encode()
        for key in sorted(value, key=repr):
            yield repr(key).encode()
            yield from _parts(value[key])
    elif isinstance(value, list | tuple):
        yield f"sequence {len(value)}".encode()
        for one in value:
            yield from _parts(one)
    elif value is None or isinstance(value, bool | int | float | str | np.generic | PurePath):
        yield repr(value).encode()
    else:
        raise TypeError(f"{type(value).__qualname__} has no digest")
