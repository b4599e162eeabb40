# SPDX-License-Identifier: GPL-3.0-or-later
"""What decides the result of a job: its command, the content of its files, and the versions that compute it."""

import hashlib
import json
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

BESIDE = (".prj", ".PRJ", ".tfw", ".dbf", ".shx", ".cpg", ".mtl", ".aux.xml")
"""Files that readers look for beside another one of the same name."""


def input_files(project: Path, options: Sequence[str]) -> dict[str, Path]:
    """All files that a project or the options of a command name, the project itself first.

    Parameters
    ----------
    project : read as far as it can be; one that is damaged names none.

    Returns
    -------
    Name → file: as seen from the project, or as it is typed.
    """
    found = {project.name: project}
    try:
        content: Any = tomllib.loads(project.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError):  # no text, no TOML, nested too deeply
        content = None
    for text in _texts(content):
        if (file := _file(project.parent, text)) is not None:
            found[text] = file
    for option in options:
        for text in (option, option.partition("=")[2]):
            if text and (file := _file(Path(), text)) is not None:
                found[text] = file
    for name, file in list(found.items()):
        for suffix in BESIDE:
            for beside in (file.with_suffix(suffix), file.with_name(file.name + suffix)):
                if beside != file and beside.is_file():
                    found[f"{name} {beside.name}"] = beside
    return found


def input_hashes(files: Mapping[str, Path]) -> dict[str, str]:
    """Name → SHA-256 of the content, or what the system says where it cannot be read."""
    return {name: _hash(file) for name, file in files.items()}


def digest_of(command: str, options: Sequence[str], hashes: Mapping[str, str], made_by: Mapping[str, str]) -> str:
    """One hash of all that decides a result."""
    content = json.dumps([command, list(options), dict(sorted(hashes.items())), dict(sorted(made_by.items()))])
    return hashlib.sha256(content.encode()).hexdigest()


def _texts(content: Any) -> Iterator[str]:
    """All texts in a TOML document, wherever they stand."""
    if isinstance(content, str):
        yield content
    elif isinstance(content, dict | list):
        for one in content.values() if isinstance(content, dict) else content:
            yield from _texts(one)


def _file(folder: Path, text: str) -> Path | None:
    try:
        file = folder / text
        return file if text and file.is_file() else None
    except (OSError, ValueError):  # no name of a file
        return None


def _hash(file: Path) -> str:
    try:
        state = os.stat(file)
        return _hash_of(str(file.resolve()), state.st_size, state.st_mtime_ns)
    except OSError as error:
        return f"not readable: {error.strerror}"


@cache
def _hash_of(file: str, size: int, changed_ns: int) -> str:
    """Many jobs share a terrain."""
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
