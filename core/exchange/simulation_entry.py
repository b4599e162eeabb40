# SPDX-License-Identifier: GPL-3.0-or-later
"""``[simulation]`` of project.toml: what falls, from where, with which models.

    [simulation]
    models = ["noel_2017", "stevens_1998"]
    seed = 3
    rolling = "azzoni_1995"          # coulomb, none
    friction = 0.5
    drag = true
    record = ["impacts"]             # trajectories; without it the number of blocks decides

    [simulation.releases]
    from = "polygon"                 # measured, table, points, line, polygon, steep
    points_m = [[2600010.0, 1200040.0], [2600030.0, 1200040.0], [2600030.0, 1200060.0]]
    number = 1000
    diameter_m = 0.5

    [[simulation.structures]]
    name = "fence"
    file = "fence.ply"

The parameters of the models are those of the whole project, ``[models.NAME]``; gravity and the drag of air are those of
its ``[reconstruction]``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from ..errors import InputError
from ..impact_models.registry import find_model
from ..simulation.block_shapes import SHAPES, Shape
from ..simulation.engine import FRICTION, ROLLING, Rolling
from .toml_text import TomlTable

MEASURED, TABLE, POINTS, LINE, POLYGON, STEEP = "measured", "table", "points", "line", "polygon", "steep"
SOURCES = (MEASURED, TABLE, POINTS, LINE, POLYGON, STEEP)
LEAST_POINTS = {POINTS: 1, LINE: 2, POLYGON: 3}
RECORDS = ("impacts", "trajectories")
STEEPER_THAN_DEG = 45.0

Extra = Mapping[str, Any]


@dataclass(frozen=True)
class ReleaseEntry:
    """Where blocks start, and as what.

    Attributes
    ----------
    source : one of `SOURCES`: the project's measured releases, the rows of a table, points, anywhere on a line, in a
        polygon, or on terrain steeper than an angle.
    file : releases.csv, for a table.
    points_m : for points, a line and a polygon: survey coordinates, with or without z [m]; without it on the terrain.
    steeper_than_deg : for steep terrain.
    number : blocks from each measured release, row or point; altogether from a line, polygon or steep terrain.
    shape, diameter_m, density_kgpm3 : of blocks for which the source does not say; None takes the project's block.
    """

    source: str = MEASURED
    file: Path | None = None
    points_m: tuple[tuple[float, ...], ...] = ()
    steeper_than_deg: float = STEEPER_THAN_DEG
    number: int = 1
    shape: Shape = "sphere"
    diameter_m: float | None = None
    density_kgpm3: float | None = None
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class StructureEntry:
    """A wall, fence, road or house: a mesh in the coordinates of the terrain."""

    name: str
    file: Path
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class SimulationEntry:
    """A simulation as a project states it.

    Attributes
    ----------
    models : names, in the order in which they run; none takes those that are compared by default.
    releases, structures, rolling, friction, seed : see `workflow.simulation.Scenario`.
    drag : of the air, with the coefficient and density of the project's reconstruction.
    record : of `RECORDS`, the tables beside runs.csv; None lets the number of blocks decide.
    """

    models: tuple[str, ...] = ()
    releases: ReleaseEntry = field(default_factory=ReleaseEntry)
    structures: tuple[StructureEntry, ...] = ()
    rolling: Rolling = "azzoni_1995"
    friction: float = FRICTION
    drag: bool = False
    seed: int = 0
    record: tuple[str, ...] | None = None
    extra: Extra = field(default_factory=dict)


def read_simulation(table: TomlTable) -> SimulationEntry:
    """The section of a project that is being read.

    Raises
    ------
    InputError : a wrong type, value or name, a file that is not there, with the key.
    """
    models = table.texts("models", "noel_2017")
    for name in models:
        try:
            find_model(name)
        except InputError as error:
            raise table.wrong("models", f"has {name!r}, which is no impact model", error.advice or "") from error
    return SimulationEntry(
        models=models,
        releases=_read_releases(table.table("releases")),
        structures=_read_structures(table),
        rolling=cast(Rolling, table.choice("rolling", ROLLING, "azzoni_1995")),
        friction=table.number("friction", FRICTION, zero_allowed=True),
        drag=table.flag("drag", False),
        seed=table.whole("seed", 0, zero_allowed=True),
        record=table.choices("record", RECORDS) if table.has("record") else None,
        extra=table.rest(),
    )


def simulation_content(entry: SimulationEntry, relative: Callable[[Path], str]) -> dict[str, Any]:
    """The section as TOML can hold it; the unknown keys at the end."""
    content: dict[str, Any] = {"models": list(entry.models)} if entry.models else {}
    content |= {"seed": entry.seed, "rolling": entry.rolling, "friction": entry.friction, "drag": entry.drag}
    if entry.record is not None:
        content["record"] = list(entry.record)
    releases = entry.releases
    content["releases"] = {"from": releases.source}
    if releases.file is not None:
        content["releases"]["file"] = relative(releases.file)
    if releases.points_m:
        content["releases"]["points_m"] = [list(point) for point in releases.points_m]
    if releases.source == STEEP:
        content["releases"]["steeper_than_deg"] = releases.steeper_than_deg
    content["releases"] |= {"number": releases.number, "shape": releases.shape}
    for name in ("diameter_m", "density_kgpm3"):
        value = getattr(releases, name)
        if value is not None:
            content["releases"][name] = value
    content["releases"] |= dict(releases.extra)
    if entry.structures:
        content["structures"] = [
            {"name": structure.name, "file": relative(structure.file)} | dict(structure.extra)
            for structure in entry.structures
        ]
    return content | dict(entry.extra)


def _read_releases(table: TomlTable) -> ReleaseEntry:
    source = table.choice("from", SOURCES, MEASURED)
    if source == TABLE and not table.has("file"):
        raise table.wrong("file", "is missing", 'Name the table of releases: file = "releases.csv"')
    points = table.points("points_m")
    least = LEAST_POINTS.get(source, 0)
    if len(points) < least:
        raise table.wrong("points_m", f"has {len(points)} points", f"A source {source!r} needs at least {least}")
    angle = table.number("steeper_than_deg", STEEPER_THAN_DEG, zero_allowed=True)
    if angle >= 180:
        raise table.wrong("steeper_than_deg", f"is {angle:g}", "Give an angle from 0 to 180: 90 is vertical")
    return ReleaseEntry(
        source=source,
        file=table.path("file") if table.has("file") else None,
        points_m=points,
        steeper_than_deg=angle,
        number=table.whole("number", 1),
        shape=cast(Shape, table.choice("shape", SHAPES, "sphere")),
        diameter_m=table.optional_number("diameter_m"),
        density_kgpm3=table.optional_number("density_kgpm3"),
        extra=table.rest(),
    )


def _read_structures(table: TomlTable) -> tuple[StructureEntry, ...]:
    entries = tuple(
        StructureEntry(structure.text("name"), structure.path("file"), structure.rest())
        for structure in table.tables("structures")
    )
    names = [entry.name for entry in entries]
    for name in names:
        if names.count(name) > 1:
            raise table.wrong("structures", f"names {name!r} twice", "Give each structure a name of its own")
    return entries
