# SPDX-License-Identifier: GPL-3.0-or-later
"""What a batch consists of: the projects of a folder, or the combinations of a sweep file.

    schema = 1
    projects = ["north/project.toml", "sites/*/project.toml"]

    [options]                        # of the command; of a list each value in turn
    model = ["noel_2017", "stevens_1998"]
    diameter = [0.3, 0.6, "lognormal:0.5,0.2"]
    number = 1000
    seed = [1, 2]

    [parameters.stevens_1998]        # --set stevens_1998.rn=…, of a list each value in turn
    rn = [0.3, 0.35]

Paths are relative to the file. A list within a list is one value: ``model = [["noel_2017", "stevens_1998"]]`` runs both
in the same job.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..reading import reader
from .saved_blend import PROJECT, is_project
from .toml_text import TomlTable, is_number, read_toml

SCHEMA = 1
MOST_JOBS = 100_000
MOST_LETTERS = 120
"""Of the name of a job's folder."""
UNSAFE = re.compile(r"[^\w.,=+ -]+")
"""What not all systems take in the name of a folder."""


@dataclass(frozen=True)
class Job:
    """One run of the command.

    Attributes
    ----------
    name : of its folder; each job of a batch has another.
    project : the file.
    options : for the command, beside those of the whole batch.
    """

    name: str
    project: Path
    options: tuple[str, ...] = ()


@reader("batch")
def find_jobs(source: str | Path) -> tuple[Job, ...]:
    """The jobs of a folder of projects, or of a sweep file.

    Of a folder those are project.toml in each of its folders, and each other TOML file and saved .blend in it.

    Raises
    ------
    InputError : there is no project, the sweep file is wrong, or two projects have the same name. Whether the projects
        themselves are right is not looked at.
    """
    source = Path(source)
    jobs = _of_folder(source) if source.is_dir() else _of_sweep(source)
    named: dict[str, Job] = {}
    for job in jobs:
        other = named.setdefault(job.name.casefold(), job)
        if other is not job:
            raise InputError(
                f"Two jobs would write into the folder {job.name}: of {other.project} and of {job.project}",
                file=source,
                advice="Rename a project, or give other values",
            )
    return jobs


def _of_folder(folder: Path) -> tuple[Job, ...]:
    inner = [one for one in folder.glob(f"*/{PROJECT}") if not one.parent.name.startswith(".")]
    files = sorted(folder.iterdir())
    alone = [one for one in files if is_project(one) and one.is_file() and not one.name.startswith(".")]
    jobs = [Job(_safe(one.parent.name), one) for one in inner] + [Job(_safe(one.stem), one) for one in alone]
    if not jobs:
        raise InputError(
            "There is no project in this folder",
            file=folder,
            advice=f"Each project is a folder with its {PROJECT}, or a saved .blend",
        )
    return tuple(sorted(jobs, key=lambda job: job.name))


def _of_sweep(file: Path) -> tuple[Job, ...]:
    top = TomlTable(read_toml(file, "sweep file"), "", file)
    if not top.has("projects"):
        raise top.wrong(
            "projects", "is missing", f'A sweep names its projects, such as ["north/{PROJECT}"]; or give their folder'
        )
    if (schema := top.take("schema")) != SCHEMA:
        raise top.wrong("schema", f"is {schema!r}", f"Write: schema = {SCHEMA}")
    projects = _projects(top, file)
    options, parameters = top.table("options"), top.take("parameters") or {}
    for key in top.rest():
        raise top.wrong(key, "is not known", "A sweep has schema, projects, [options] and [parameters.MODEL]")
    axes = [_axis(options, key, value) for key, value in options.rest().items()]
    models = next((values for key, values in axes if key == "model"), None)
    own = _parameters(top, parameters)
    if models is not None:
        named = {name for value in models for name in _words(value)}
        for model in own:
            if model not in named:
                raise top.wrong(f"parameters.{model}", "is of a model that does not run", "Add it to options.model")
    return tuple(_combined(projects, axes, own, top))


def _projects(top: TomlTable, file: Path) -> list[tuple[str, Path]]:
    """Names and files, in their order."""
    found: dict[Path, None] = {}
    for pattern in top.texts("projects", f"north/{PROJECT}"):
        matches = [file.parent / pattern]
        if re.search(r"[*?\[]", pattern):
            matches = sorted(one for one in file.parent.glob(pattern) if one.is_file())
            if not matches:
                raise top.wrong("projects", f"has {pattern!r}, which no file is like", "Correct the pattern")
        found.update(dict.fromkeys(matches))
    if not found:
        raise top.wrong("projects", "is empty", f'Name at least one, such as ["north/{PROJECT}"]')
    return [(one.parent.name if one.name == PROJECT else one.stem, one) for one in found]


def _axis(table: TomlTable, key: str, value: Any) -> tuple[str, list[Any]]:
    """An option with its values."""
    values = value if isinstance(value, list) else [value]
    if not values:
        raise table.wrong(key, "is an empty list", "Give a value, or leave it out")
    for one in values:
        parts = one if isinstance(one, list) else [one]
        if not parts or not all(isinstance(part, str | bool) or is_number(part) for part in parts):
            raise table.wrong(key, f"has {one!r}", "Give numbers, texts, true or false, or a list of them")
    return key, values


def _parameters(top: TomlTable, parameters: Any) -> dict[str, list[tuple[str, list[Any]]]]:
    """Model → its parameters with their values."""
    wrong = top.wrong("parameters", "are not sections of models", "Write [parameters.stevens_1998], then rn = [0.3]")
    if not isinstance(parameters, dict) or not all(isinstance(one, dict) for one in parameters.values()):
        raise wrong
    return {model: [_axis(top, key, value) for key, value in own.items()] for model, own in parameters.items()}


def _combined(
    projects: Sequence[tuple[str, Path]],
    axes: Sequence[tuple[str, list[Any]]],
    parameters: dict[str, list[tuple[str, list[Any]]]],
    top: TomlTable,
) -> Iterator[Job]:
    """All combinations: the last option changes first."""
    most = len(projects) * prod(len(values) for _, values in axes)
    most *= prod(len(values) for own in parameters.values() for _, values in own)
    if most > MOST_JOBS:
        raise top.wrong("options", f"make {most} combinations", f"A sweep has {MOST_JOBS} jobs at the most")
    once = {key for key, values in axes if len(values) == 1}
    for name, project in projects:
        for chosen in product(*(values for _, values in axes)):
            given = dict(zip((key for key, _ in axes), chosen, strict=True))
            models = _words(given["model"]) if "model" in given else list(parameters)
            inner = [(model, key, values) for model in models for key, values in parameters.get(model, [])]
            once_inner = {(model, key) for model, key, values in inner if len(values) == 1}
            for picked in product(*(values for _, _, values in inner)):
                options, parts = list[str](), [name]
                for key, value in given.items():
                    options += _option(key, value)
                    parts += [] if key in once else [f"{key}={_said(value)}"]
                for (model, key, _), value in zip(inner, picked, strict=True):
                    options += ["--set", f"{model}.{key}={_said(value)}"]
                    parts += [] if (model, key) in once_inner else [f"{key}={_said(value)}"]
                yield Job(_safe(",".join(parts)), project, tuple(options))


def _option(key: str, value: Any) -> list[str]:
    """As it is typed: nothing where it is false."""
    if isinstance(value, bool):
        return [f"--{key}"] if value else []
    return [f"--{key}", *_words(value)]


def _words(value: Any) -> list[str]:
    return [_said(one) for one in value] if isinstance(value, list) else [_said(value)]


def _said(value: Any) -> str:
    if isinstance(value, list):
        return "+".join(map(_said, value))
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)


def _safe(name: str) -> str:
    """A name that every system takes for a folder; what is left out of a long one is told by a hash of it."""
    safe = UNSAFE.sub("-", name).strip(". ") or "job"
    if len(safe) <= MOST_LETTERS:
        return safe
    return f"{safe[: MOST_LETTERS - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
