# SPDX-License-Identifier: GPL-3.0-or-later
"""``[simulation]`` of project.toml: what falls, from where, with which models.

    [simulation]
    models = ["noel_2017", "stevens_1998"]
    seed = 3
    rolling = "azzoni_1995"          # coulomb, none
    contact = "mesh"                 # points: blocks meet the points of a cloud instead of its meshed surface
    friction = 0.5
    drag = true
    posterior = "posterior.csv"      # of a back-analysis: each block draws its parameters
    record = ["impacts"]             # trajectories; without it the number of blocks decides
    cell_m = 1.0                     # side of the cells of maps; without it there are none
    faces = true                     # maps of the faces of the mesh, for cliffs

    [simulation.releases]
    from = "polygon"                 # measured, table, points, line, polygon, steep
    points_m = [[2600010.0, 1200040.0], [2600030.0, 1200040.0], [2600030.0, 1200060.0]]
    number = 1000
    shape = "box"                    # sphere, cube, ellipsoid
    proportions = [3.0, 2.0, 1.0]
    diameter_m = "lognormal:0.5,0.2" # or a number, "0.3..0.6", "normal:MEAN,SD"
    density_kgpm3 = 2600

    [simulation.trees]               # without it there are none
    file = "trees.csv"               # x_m, y_m, dbh_cm; or in place of it
    # stems_per_hectare = 400
    # dbh_cm = 32
    # dbh_sd_cm = 12
    # within = "forest.geojson"      # polygons; else everywhere on the terrain
    height_m = 10.0                  # up to which a stem is met
    species = "coniferous"           # broadleaved, silver_fir

    [simulation.zones]
    file = "zones.geojson"           # polygons with parameters of their own
    # attribute = "soil"             # of the terrain's PLY file; the file is then a table of its values

    [[simulation.structures]]
    name = "fence"
    file = "fence.ply"

    [[simulation.screens]]
    name = "road"
    points_m = [[2600060.0, 1200030.0], [2600062.0, 1200070.0]]
    height_m = 4.0                   # with a capacity it is a barrier, without one it measures what passes
    capacity_kJ = 1000.0
    # file = "screens.geojson"       # in place of all that: lines of a map

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
from ..simulation.distributions import FORMS, Distribution, parse_distribution
from ..simulation.engine import FRICTION, ROLLING, Rolling
from ..simulation.ground import CONTACTS, Contact
from ..simulation.trees import HEIGHT_M, KIND, SPECIES
from .toml_text import TomlTable, is_number

MEASURED, TABLE, POINTS, LINE, POLYGON, STEEP = "measured", "table", "points", "line", "polygon", "steep"
SOURCES = (MEASURED, TABLE, POINTS, LINE, POLYGON, STEEP)
LEAST_POINTS = {POINTS: 1, LINE: 2, POLYGON: 3}
IMPACTS, TRAJECTORIES = "impacts", "trajectories"
RECORDS = (IMPACTS, TRAJECTORIES)
"""Tables beside runs.csv."""
STEEPER_THAN_DEG = 45.0

Extra = Mapping[str, Any]


@dataclass(frozen=True)
class ReleaseEntry:
    """Where blocks start, and as what.

    Attributes
    ----------
    source : one of `SOURCES`: what the project has measured, the rows of a table, points, anywhere on a line, in a
        polygon, or on terrain steeper than an angle.
    trajectory, time_s : of what was measured only this trajectory, from the pick at this time on.
    file : releases.csv, for a table; a map of lines or polygons in place of their points, see `exchange.map_shapes`.
    points_m : for points, a line and a polygon: survey coordinates, with or without z [m]; without it on the terrain.
    steeper_than_deg : for steep terrain.
    name : of the releases from points, a line or a polygon.
    number : blocks from each measured release, row or point; altogether from a line, polygon or steep terrain.
    shape, diameter, proportions, density : of the blocks, see `Blocks`. Where none of them is given, measured blocks
        are as they were measured, and others like the project's block.
    """

    source: str = MEASURED
    trajectory: str = ""
    time_s: float | None = None
    file: Path | None = None
    points_m: tuple[tuple[float, ...], ...] = ()
    steeper_than_deg: float = STEEPER_THAN_DEG
    name: str = ""
    number: int = 1
    shape: Shape | None = None
    diameter: Distribution | None = None
    proportions: tuple[float, float, float] | None = None
    density: Distribution | None = None
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class StructureEntry:
    """A wall, fence, road or house: a mesh or a cloud in the coordinates of the terrain."""

    name: str
    file: Path
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class ScreenEntry:
    """A line across the slope, at which blocks are measured or held; or a map of such lines.

    Attributes
    ----------
    file : a map of screens, see `exchange.screens`; then nothing else is given.
    points_m : its line: survey coordinates [m].
    height_m, capacity_kj : of a barrier; a screen without a capacity measures.
    """

    name: str = ""
    file: Path | None = None
    points_m: tuple[tuple[float, ...], ...] = ()
    height_m: float | None = None
    capacity_kj: float | None = None
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class ZonesEntry:
    """Parts of the ground with parameters of their own.

    Attributes
    ----------
    file : polygons with their parameters, or a table of what the values of the attribute mean.
    attribute : of the terrain's vertices or faces; empty for polygons.
    """

    file: Path
    attribute: str = ""
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class TreesEntry:
    """Stems that blocks meet: a table of them, or a forest of which only density and diameters are known.

    Attributes
    ----------
    file : see `exchange.trees`; None draws them.
    stems_per_hectare, dbh_cm, dbh_sd_cm : of a forest that is drawn: density, mean and standard deviation of diameters.
    within : polygons outside of which none are drawn.
    height_m, species : where a table does not say.
    """

    file: Path | None = None
    stems_per_hectare: float | None = None
    dbh_cm: float | None = None
    dbh_sd_cm: float = 0.0
    within: Path | None = None
    height_m: float = HEIGHT_M
    species: str = KIND
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class SimulationEntry:
    """A simulation as a project states it.

    Attributes
    ----------
    models : names, in the order in which they run; none takes those that are compared by default.
    releases, structures, screens, zones, trees, rolling, friction, seed : see `workflow.simulation.Scenario`.
    contact : what of the terrain blocks meet, see `simulation.ground.CONTACTS`.
    observed : impacts.csv that the model observed draws from; None takes what the project has measured.
    posterior : posterior.csv of a back-analysis, from which each block of its model draws its parameters.
    drag : of the air, with the coefficient and density of the project's reconstruction.
    record : of `RECORDS`, the tables beside runs.csv; None lets the number of blocks decide.
    cell_m : side of the cells of maps; None makes no maps.
    faces : whether there are maps of the faces of the mesh.
    """

    models: tuple[str, ...] = ()
    releases: ReleaseEntry = field(default_factory=ReleaseEntry)
    structures: tuple[StructureEntry, ...] = ()
    screens: tuple[ScreenEntry, ...] = ()
    contact: Contact = "mesh"
    zones: ZonesEntry | None = None
    trees: TreesEntry | None = None
    rolling: Rolling = "azzoni_1995"
    friction: float = FRICTION
    drag: bool = False
    observed: Path | None = None
    posterior: Path | None = None
    seed: int = 0
    record: tuple[str, ...] | None = None
    cell_m: float | None = None
    faces: bool = False
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
        screens=tuple(map(_read_screen, table.tables("screens"))),
        contact=cast(Contact, table.choice("contact", CONTACTS, "mesh")),
        zones=_read_zones(table.table("zones")) if table.has("zones") else None,
        trees=_read_trees(table.table("trees")) if table.has("trees") else None,
        rolling=cast(Rolling, table.choice("rolling", ROLLING, "azzoni_1995")),
        friction=table.number("friction", FRICTION, zero_allowed=True),
        drag=table.flag("drag", False),
        observed=table.path("observed") if table.has("observed") else None,
        posterior=table.path("posterior") if table.has("posterior") else None,
        seed=table.seed(),
        record=table.choices("record", RECORDS) if table.has("record") else None,
        cell_m=table.number("cell_m", 1.0) if table.has("cell_m") else None,
        faces=table.flag("faces", False),
        extra=table.rest(),
    )


def simulation_content(entry: SimulationEntry, relative: Callable[[Path], str]) -> dict[str, Any]:
    """The section as TOML can hold it; the unknown keys at the end."""
    content: dict[str, Any] = {"models": list(entry.models)} if entry.models else {}
    content |= {
        "seed": entry.seed,
        "contact": entry.contact,
        "rolling": entry.rolling,
        "friction": entry.friction,
        "drag": entry.drag,
    }
    if entry.observed is not None:
        content["observed"] = relative(entry.observed)
    if entry.posterior is not None:
        content["posterior"] = relative(entry.posterior)
    if entry.record is not None:
        content["record"] = list(entry.record)
    if entry.cell_m is not None:
        content["cell_m"] = entry.cell_m
    if entry.faces:
        content["faces"] = True
    content["releases"] = _release_content(entry.releases, relative)
    if entry.zones is not None:
        own = {"attribute": entry.zones.attribute} if entry.zones.attribute else {}
        content["zones"] = {"file": relative(entry.zones.file)} | own | dict(entry.zones.extra)
    if entry.trees is not None:
        content["trees"] = _trees_content(entry.trees, relative)
    if entry.structures:
        content["structures"] = [
            {"name": structure.name, "file": relative(structure.file)} | dict(structure.extra)
            for structure in entry.structures
        ]
    if entry.screens:
        content["screens"] = [_screen_content(screen, relative) for screen in entry.screens]
    return content | dict(entry.extra)


def _trees_content(entry: TreesEntry, relative: Callable[[Path], str]) -> dict[str, Any]:
    content: dict[str, Any] = {} if entry.file is None else {"file": relative(entry.file)}
    for name in ("stems_per_hectare", "dbh_cm"):
        if getattr(entry, name) is not None:
            content[name] = getattr(entry, name)
    if entry.dbh_sd_cm:
        content["dbh_sd_cm"] = entry.dbh_sd_cm
    if entry.within is not None:
        content["within"] = relative(entry.within)
    return content | {"height_m": entry.height_m, "species": entry.species} | dict(entry.extra)


def _screen_content(entry: ScreenEntry, relative: Callable[[Path], str]) -> dict[str, Any]:
    if entry.file is not None:
        return {"file": relative(entry.file)} | dict(entry.extra)
    content: dict[str, Any] = {"name": entry.name, "points_m": [list(point) for point in entry.points_m]}
    for name, value in (("height_m", entry.height_m), ("capacity_kJ", entry.capacity_kj)):
        if value is not None:
            content[name] = value
    return content | dict(entry.extra)


def _release_content(entry: ReleaseEntry, relative: Callable[[Path], str]) -> dict[str, Any]:
    content: dict[str, Any] = {"from": entry.source}
    for name in ("trajectory", "name"):
        if getattr(entry, name):
            content[name] = getattr(entry, name)
    if entry.time_s is not None:
        content["time_s"] = entry.time_s
    if entry.file is not None:
        content["file"] = relative(entry.file)
    if entry.points_m:
        content["points_m"] = [list(point) for point in entry.points_m]
    if entry.source == STEEP:
        content["steeper_than_deg"] = entry.steeper_than_deg
    content["number"] = entry.number
    if entry.shape is not None:
        content["shape"] = entry.shape
    if entry.proportions is not None:
        content["proportions"] = list(entry.proportions)
    for name, law in (("diameter_m", entry.diameter), ("density_kgpm3", entry.density)):
        if law is not None:
            content[name] = law.first if law.law == "fixed" else f"{law.law}:{law.first!r},{law.second!r}"
    return content | dict(entry.extra)


def _read_releases(table: TomlTable) -> ReleaseEntry:
    source = table.choice("from", SOURCES, MEASURED)
    if source == TABLE and not table.has("file"):
        raise table.wrong("file", "is missing", 'Name the table of releases: file = "releases.csv"')
    of_map = source in (LINE, POLYGON) and table.has("file")
    if of_map and table.has("points_m"):
        raise table.wrong("points_m", "is given beside file", "The map has the points: leave out one of them")
    points = table.points("points_m")
    least = 0 if of_map else LEAST_POINTS.get(source, 0)
    if len(points) < least:
        raise table.wrong("points_m", f"has {len(points)} points", f"A source {source!r} needs at least {least}")
    angle = table.number("steeper_than_deg", STEEPER_THAN_DEG, zero_allowed=True)
    if angle >= 180:
        raise table.wrong("steeper_than_deg", f"is {angle:g}", "Give an angle from 0 to 180: 90 is vertical")
    return ReleaseEntry(
        source=source,
        trajectory=table.text("trajectory", ""),
        time_s=table.signed("time_s") if table.has("time_s") else None,
        file=table.path("file") if table.has("file") else None,
        points_m=points,
        steeper_than_deg=angle,
        name=table.text("name", ""),
        number=table.whole("number", 1),
        shape=cast(Shape, table.choice("shape", SHAPES, "sphere")) if table.has("shape") else None,
        diameter=_read_law(table, "diameter_m"),
        proportions=table.optional_vector("proportions"),
        density=_read_law(table, "density_kgpm3"),
        extra=table.rest(),
    )


def _read_law(table: TomlTable, key: str) -> Distribution | None:
    """A number, or a law as a text."""
    if not table.has(key):
        return None
    value = table.take(key)
    if not (isinstance(value, str) or is_number(value)):
        raise table.wrong(key, f"is {value!r}, no number and no law", f"Write {FORMS}")
    try:
        return parse_distribution(value) if isinstance(value, str) else Distribution("fixed", float(value))
    except InputError as error:
        raise table.wrong(key, f"is {value!r}: {error.problem}", error.advice or f"Write {FORMS}") from error


def _read_zones(table: TomlTable) -> ZonesEntry:
    return ZonesEntry(table.path("file"), table.text("attribute", ""), table.rest())


def _read_trees(table: TomlTable) -> TreesEntry:
    drawn = ("stems_per_hectare", "dbh_cm", "dbh_sd_cm", "within")
    if table.has("file"):
        for key in drawn:
            if table.has(key):
                raise table.wrong(key, "is given beside file", "The table has each stem: leave out one of them")
    else:
        for key in drawn[:2]:
            if not table.has(key):
                raise table.wrong(key, "is missing", "Give a file of trees, or stems_per_hectare and dbh_cm")
    return TreesEntry(
        file=table.path("file") if table.has("file") else None,
        stems_per_hectare=table.optional_number("stems_per_hectare"),
        dbh_cm=table.optional_number("dbh_cm"),
        dbh_sd_cm=table.number("dbh_sd_cm", 0.0, zero_allowed=True),
        within=table.path("within") if table.has("within") else None,
        height_m=table.number("height_m", HEIGHT_M),
        species=table.choice("species", tuple(SPECIES), KIND),
        extra=table.rest(),
    )


def _read_screen(table: TomlTable) -> ScreenEntry:
    if table.has("file"):
        for key in ("name", "points_m", "height_m", "capacity_kJ"):
            if table.has(key):
                raise table.wrong(key, "is given beside file", "The lines of the file have their own: leave out one")
        return ScreenEntry(file=table.path("file"), extra=table.rest())
    points = table.points("points_m")
    if len(points) < 2:
        raise table.wrong("points_m", f"has {len(points)} points", "Give a screen two or more, or a file")
    height, capacity = table.optional_number("height_m"), table.optional_number("capacity_kJ")
    if capacity is not None and height is None:
        raise table.wrong("height_m", "is missing", "A barrier has a height beside its capacity_kJ")
    return ScreenEntry(table.text("name"), None, points, height, capacity, table.rest())


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
