# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading TOML with a check of every value, and every mistake located."""

import re
import tomllib
from math import inf, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..plausibility import GREATEST_SEED, implausible
from ..reading import reading
from ..vectors import Array

Vector3 = tuple[float, float, float]
MOST = 10**300
"""Whole numbers have no end in TOML, others do."""
REQUIRED: Any = object()
"""The default of a key that must be there."""


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file; `what` it is, for messages.

    Raises
    ------
    InputError : the file is missing, no UTF-8 text or no TOML, with the row.
    """
    with reading(path, what, "Correct it, or write it again"):
        try:
            text = path.read_text(encoding="utf-8-sig")
            return tomllib.loads(text)
        except UnicodeDecodeError as error:
            raise InputError(f"The {what} is not UTF-8 text", file=path, advice="Save it as UTF-8") from error
        except tomllib.TOMLDecodeError as error:
            row = re.search(r"line (\d+)", str(error))
            raise InputError(
                f"This is not valid TOML: {error}",
                file=path,
                row=int(row[1]) if row else text.count("\n") + 1,
                advice="Text stands in quotation marks, a section's name in square brackets",
            ) from error


class TomlTable:
    """One TOML table being read: keys are taken out with a check of their type, what is left over is unknown."""

    def __init__(self, content: dict[str, Any] | None, place: str, file: Path) -> None:
        self.absent = content is None
        self._content, self._place, self._file = dict(content or {}), place, file

    def wrong(self, key: str, problem: str, advice: str) -> InputError:
        return InputError(f"{self._place}{key} {problem}", file=self._file, advice=advice)

    def take(self, key: str) -> Any:
        return self._content.pop(key, None)

    def has(self, key: str) -> bool:
        return key in self._content

    def rest(self) -> dict[str, Any]:
        return dict(self._content)

    def _taken(self, key: str, default: Any, wanted: str) -> Any:
        value = self.take(key)
        if value is None:
            if default is REQUIRED:
                raise self.wrong(key, "is missing", f"Give {wanted}")
            return default
        return value

    def text(self, key: str, default: Any = REQUIRED) -> str:
        value = self._taken(key, default, "a text in quotation marks")
        if not isinstance(value, str):
            raise self.wrong(key, f"is {value!r}, not a text", "Put it in quotation marks")
        if default is REQUIRED and not value:
            raise self.wrong(key, "is empty", "Give a name")
        return value

    def choice(self, key: str, known: tuple[str, ...], default: str) -> str:
        value = self.text(key, default)
        if value not in known:
            raise self.wrong(key, f"is {value!r}", f"Choose one of {', '.join(known)}")
        return value

    def texts(self, key: str, such_as: str) -> tuple[str, ...]:
        value = self._taken(key, [], "a list")
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self.wrong(key, f"is {value!r}, not a list of texts", f'Write a list, such as ["{such_as}"]')
        return tuple(dict.fromkeys(value))

    def choices(self, key: str, known: tuple[str, ...]) -> tuple[str, ...]:
        value = self.texts(key, known[0])
        for item in value:
            if item not in known:
                raise self.wrong(key, f"has {item!r}", f"Choose from {', '.join(known)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self._taken(key, default, "true or false")
        if not isinstance(value, bool):
            raise self.wrong(key, f"is {value!r}", "Write true or false, without quotation marks")
        return value

    def _number(self, key: str, default: float) -> float:
        value = self._taken(key, default, "a number")
        if not is_number(value):
            raise self.wrong(key, f"is {value!r}, not a number", "Write a number without quotation marks")
        return float(value)

    def signed(self, key: str, default: float = REQUIRED) -> float:
        return self._plausible(key, self._number(key, default))

    def _plausible(self, key: str, value: float) -> float:
        if problem := implausible(key, value):
            raise self.wrong(key, problem, "Correct it, or its unit")
        return value

    def number(self, key: str, default: float = REQUIRED, zero_allowed: bool = False) -> float:
        value = self._number(key, default)
        if value < 0.0 or (value == 0.0 and not zero_allowed):
            raise self.wrong(key, f"is {value:g}", f"Give a number {'not below' if zero_allowed else 'above'} zero")
        return self._plausible(key, value)

    def deviation(self, key: str) -> float:
        """Zero when it is missing; infinite where nothing is known."""
        if self._content.get(key) == inf:
            return float(self.take(key))
        return self.number(key, 0.0, zero_allowed=True)

    def optional_number(self, key: str, zero_allowed: bool = False) -> float | None:
        return self.number(key, REQUIRED, zero_allowed) if key in self._content else None

    def seed(self, key: str = "seed") -> int:
        """Of random numbers; 0 when it is missing."""
        value = self.whole(key, 0, zero_allowed=True)
        if value > GREATEST_SEED:
            raise self.wrong(key, "is too large", f"Give a whole number from 0 to {GREATEST_SEED} (2^63 - 1)")
        return value

    def whole(self, key: str, default: int = REQUIRED, zero_allowed: bool = False) -> int:
        value = self._taken(key, default, "a whole number")
        if not isinstance(value, int) or isinstance(value, bool) or value < (0 if zero_allowed else 1):
            raise self.wrong(
                key, f"is {value!r}", f"Give a whole number {'not below' if zero_allowed else 'above'} zero"
            )
        return int(self._plausible(key, value))

    def vector(self, key: str) -> Vector3:
        value = self._taken(key, REQUIRED, "three numbers, [x, y, z]")
        if not isinstance(value, list) or len(value) != 3 or not all(is_number(item) for item in value):
            raise self.wrong(key, f"is {value!r}", "Give three numbers, [x, y, z]")
        x, y, z = (float(self._plausible(key, item)) for item in value)
        return x, y, z

    def points(self, key: str) -> tuple[tuple[float, ...], ...]:
        """A list of points [x, y] or [x, y, z]; empty when it is missing."""
        value = self._taken(key, [], "a list of points")
        rows = value if isinstance(value, list) else [value]
        for row in rows:
            if not (isinstance(row, list) and len(row) in (2, 3) and all(map(is_number, row))):
                raise self.wrong(key, "is not a list of points", "Write [[x, y], [x, y, z]]; without z on the terrain")
        return tuple(tuple(float(self._plausible("position", item)) for item in row) for row in rows)

    def rows(self, key: str, width: int, wanted: str) -> tuple[tuple[float, ...], ...]:
        """Rows of so many finite numbers; empty when it is missing."""
        value = self._taken(key, [], wanted)
        good = isinstance(value, list) and all(isinstance(row, list) and len(row) == width for row in value)
        if not good or not all(is_number(item) for row in value for item in row):
            raise self.wrong(key, f"is {value!r}", f"Write {wanted}")
        return tuple(tuple(float(self._plausible(key, item)) for item in row) for row in value)

    def numbers(self, key: str, shape: tuple[int, ...]) -> Array:
        """An array of this shape; its rows are the inner lists."""
        wanted = " rows of ".join(map(str, shape)) + " numbers"
        value = self._taken(key, REQUIRED, wanted)
        try:
            array = np.array(value)
        except ValueError:
            array = np.empty(0)
        if array.shape != shape or array.dtype.kind not in "if" or not np.isfinite(array).all():
            raise self.wrong(key, f"is not {wanted}", f"Give {wanted}" + (", [x, y, z]" if shape == (3,) else ""))
        for value in array.ravel().tolist():
            self._plausible(key, value)
        return array.astype(np.float64)

    def optional_vector(self, key: str) -> Vector3 | None:
        return self.vector(key) if key in self._content else None

    def path(self, key: str, anywhere: bool = False) -> Path:
        """A file; it must be there unless it may be `anywhere`."""
        return self._file_of(key, self.text(key), anywhere)

    def paths(self, key: str) -> tuple[Path, ...]:
        """One file or several, as a text or a list of texts; all must be there."""
        if not isinstance(self._content.get(key), list):
            return (self.path(key),)
        names = self.texts(key, "a file")
        if not names or "" in names:
            raise self.wrong(key, "names no file", "Give the name of one file, or a list of them")
        return tuple(self._file_of(key, name) for name in names)

    def _file_of(self, key: str, name: str, anywhere: bool = False) -> Path:
        file = self._file.parent / name
        if not (anywhere or file.is_file()):
            raise self.wrong(key, f"names a file that is not there: {file}", "Paths are relative to the project file")
        return file

    def table(self, key: str) -> "TomlTable":
        value = self.take(key)
        if value is not None and not isinstance(value, dict):
            raise self.wrong(key, f"is {value!r}, not a section", f"Write a section: [{self._place}{key}]")
        return TomlTable(value, f"{self._place}{key}.", self._file)

    def tables(self, key: str) -> list["TomlTable"]:
        value = self.take(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self.wrong(key, "is not a list of sections", f"Write one section for each: [[{key}]]")
        return [TomlTable(item, f"{key} {number}: ", self._file) for number, item in enumerate(value, 1)]


def is_number(value: Any) -> bool:
    """A finite number, and no boolean."""
    if isinstance(value, bool):
        return False
    return (isinstance(value, float) and isfinite(value)) or (isinstance(value, int) and abs(value) < MOST)
