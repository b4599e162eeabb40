# SPDX-License-Identifier: GPL-3.0-or-later
"""``project.toml``: everything that a run without a window needs.

Paths are relative to the file. Keys and sections that this version does not know are kept when a project is read and
written again, so that an older Rockfall does not lose what a newer one has stored.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..analysis.completeness import NOT_STATED, Completeness, parse_completeness
from ..constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT, GRAVITY_MPS2, ROCK_DENSITY_KGPM3
from ..errors import InputError
from ..georeference import GlobalShift
from ..output import final_path, write_text
from ..reading import reader
from ..reconstruction.block import SHAPES
from ..reconstruction.choices import FLIGHT_ENDS, FREE, LOSSES, SIGMA_AIM, SIGMA_DATUM
from ..terrain.crs import metric_name
from ..terrain.opening import HowToRead
from .saved_blend import BLEND, project_of
from .simulation_entry import SimulationEntry, read_simulation, simulation_content
from .toml_text import TomlTable, Vector3, read_toml

SCHEMA = 1
ENGINES = ("auto", "cycles", "eevee", "workbench")
UP_AXES = ("auto", "z", "y")

Extra = Mapping[str, Any]


@dataclass(frozen=True)
class Site:
    """What is shown as the title, and written into the column ``site`` of impacts.csv."""

    name: str = ""
    description: str = ""
    extra: Extra = field(default_factory=dict)


def terrain_inputs(files: Sequence[str | Path]) -> dict[str, Path]:
    """The files of a terrain by the names that they have in a summary: numbered when they are several."""
    return {f"terrain {i}" if len(files) > 1 else "terrain": Path(file) for i, file in enumerate(files, start=1)}


@dataclass(frozen=True)
class TerrainSource:
    """The files of the terrain, and how their numbers are to be understood.

    Attributes
    ----------
    files : meshes, grids or point clouds, one or more that join; `[terrain] file` is a name or a list of names.
    shift : the survey coordinates of the local origin; None lets the reader propose it.
    crs : coordinate reference system as the survey states it ("EPSG:2154"), empty when unknown.
    vertical_datum : the system of the heights, likewise ("EPSG:5720").
    up : the axis that points up in the files, one of `UP_AXES`.
    unit_m : length of the files' unit [m]; None: as the files or `crs` say, else a metre.
    height_unit_m : that of their heights, where it is another one; None: as `unit_m`, or as the files or
        `vertical_datum` say.
    sigma_m : accuracy of the terrain, as a standard deviation of its height [m]; None: by its point spacing.
    """

    files: tuple[Path, ...]
    shift: Vector3 | None = None
    crs: str = ""
    vertical_datum: str = ""
    up: str = "auto"
    unit_m: float | None = None
    sigma_m: float | None = None
    height_unit_m: float | None = None
    extra: Extra = field(default_factory=dict)

    @property
    def inputs(self) -> dict[str, Path]:
        """The files by the names that they have in a summary."""
        return terrain_inputs(self.files)

    @property
    def how(self) -> HowToRead:
        """How to read the files."""
        return HowToRead(
            self.up, self.unit_m, crs=self.crs, vertical=self.vertical_datum, height_unit_m=self.height_unit_m
        )

    @property
    def global_shift(self) -> GlobalShift | None:
        """The shift as the terrain and table readers take it; None when the project leaves it to the reader."""
        return None if self.shift is None else GlobalShift(*self.shift, metric_name(self.crs), self.vertical_datum)


@dataclass(frozen=True)
class BlockEntry:
    """One block: principal diameters [m], density [kg/m³] and shape; ``name`` is that of its trajectory."""

    name: str = ""
    d1_m: float = 0.35
    d2_m: float = 0.35
    d3_m: float = 0.35
    density_kgpm3: float = ROCK_DENSITY_KGPM3
    shape: str = SHAPES[0]
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class ReconstructionSettings:
    """How flights and impacts are computed.

    Attributes
    ----------
    normal_radius_m : radius within which the terrain normal is fitted; None for the default at block scale.
    gravity_mps2 : acceleration of gravity.
    drag : whether the flights are computed with the drag of air.
    drag_coefficient, air_density_kgpm3 : C_D and ρ, used when ``drag`` is true.
    flights : what the flights join, one of `FLIGHT_ENDS`: the contact points, or the block's centre at each contact.
    """

    normal_radius_m: float | None = None
    gravity_mps2: float = GRAVITY_MPS2
    drag: bool = False
    drag_coefficient: float = DRAG_COEFFICIENT
    air_density_kgpm3: float = AIR_DENSITY_KGPM3
    flights: str = "contacts"
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class VideoEntry:
    """One video, and what is known of it.

    Attributes
    ----------
    file : the video; it may have moved, since its numbers are used without it.
    camera : camera.toml, the solved view.
    track : track.csv, the block in the frames.
    events : events.csv, the impacts seen in the frames; first picks are made from it where the project has none.
    spin_marks : spin_marks.csv, one point of the block in two frames or more of a flight, for its spin.
    offset_s, drift, origin_s, gaps : of the `Clock`: common time = offset + (1 + drift) · rate · (video time − origin),
        the video time with the gaps that its file does not tell.
    capture_rate_hz : pictures per second when filming; None when the file plays at the speed of the fall.
    rate_hz : pictures per second of a sequence of pictures, which has no times of its own; None for a video file.
    row_time_s : readout time of one row of the image [s]: rolling shutter, 0 for a global one; None when not known.
    """

    name: str
    file: Path | None = None
    camera: Path | None = None
    track: Path | None = None
    events: Path | None = None
    spin_marks: Path | None = None
    offset_s: float = 0.0
    drift: float = 0.0
    origin_s: float = 0.0
    gaps: tuple[tuple[float, float], ...] = ()
    capture_rate_hz: float | None = None
    rate_hz: float | None = None
    row_time_s: float | None = None
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class RefinementSettings:
    """How picks are fitted to the footage.

    Attributes
    ----------
    free : what is fitted beside the picks, of `FREE`.
    sigma_terrain_m : accuracy of the terrain [m]; None for that of `TerrainSource`.
    sigma_aim : standard deviation of the tracked spot about the block's centre, in parts of its diameter.
    sigma_datum : of how the cameras lie to the terrain, in parts of the distance.
    loss : one of `LOSSES`, how pixels that do not fit count.
    """

    free: tuple[str, ...] = ()
    sigma_terrain_m: float | None = None
    sigma_aim: float = SIGMA_AIM
    sigma_datum: float = SIGMA_DATUM
    loss: str = "huber"
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class CameraPlacement:
    """Where the film's camera stands and looks, in survey coordinates [m]; ``fov_deg`` is the horizontal angle."""

    position: Vector3
    target: Vector3
    fov_deg: float = 40.0
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class RenderPreset:
    """One way to make the film.

    Attributes
    ----------
    width, height : size of the picture [px].
    fps : frames per second of the film.
    engine : one of `ENGINES`; "auto" takes the quickest that works on the machine.
    stagger_s : the blocks start one after the other with this delay; None keeps the time that was observed.
    time_scale : seconds of the fall shown in one second of film (below 1: slow motion).
    camera : None places it so that the whole of the trajectories is seen.
    """

    name: str
    width: int = 1920
    height: int = 1080
    fps: float = 24.0
    engine: str = "auto"
    stagger_s: float | None = None
    time_scale: float = 1.0
    camera: CameraPlacement | None = None
    extra: Extra = field(default_factory=dict)


@dataclass(frozen=True)
class Project:
    """A whole project; all paths are absolute or relative to the working directory, as `read_project` resolves them.

    Attributes
    ----------
    completeness : whether the picked trajectories are all that fell; `completeness` of [picks].
    block : what holds for every trajectory that ``blocks`` does not name.
    simulation : None where nothing is said of one.
    """

    site: Site = field(default_factory=Site)
    terrain: TerrainSource | None = None
    picks: Path | None = None
    completeness: Completeness = NOT_STATED
    block: BlockEntry = field(default_factory=BlockEntry)
    blocks: tuple[BlockEntry, ...] = ()
    reconstruction: ReconstructionSettings = field(default_factory=ReconstructionSettings)
    render: tuple[RenderPreset, ...] = ()
    videos: tuple[VideoEntry, ...] = ()
    refinement: RefinementSettings = field(default_factory=RefinementSettings)
    simulation: SimulationEntry | None = None
    extra: Extra = field(default_factory=dict)

    @property
    def stated_simulation(self) -> SimulationEntry:
        """What it says of a simulation; else one of its measured releases, with the drag of its reconstruction."""
        return self.simulation or SimulationEntry(drag=self.reconstruction.drag)

    def block_of(self, trajectory: str) -> BlockEntry:
        """The block of a trajectory, or the project's default block."""
        return next((block for block in self.blocks if block.name == trajectory), self.block)


def _completeness(picks: TomlTable) -> Completeness:
    text = picks.text("completeness", "")
    try:
        return parse_completeness(text)
    except InputError as error:
        raise picks.wrong("completeness", f"is {text!r}", error.advice or "") from error


NO_PROJECT = (".csv", ".tsv", ".txt", ".parquet", ".ply", ".obj", ".las", ".laz", ".mp4", ".mov", ".json")
"""Endings of files that people give in the place of a project."""


@reader("project")
def read_project(path: str | Path) -> Project:
    """Read ``project.toml``, or a saved .blend on the command line (see `saved_blends`).

    Raises
    ------
    InputError : the file is missing or no TOML, has another schema, a wrong type, value or name, or points to a
        terrain or table that is not there. The message names the file, the key and what to do.
    """
    path = Path(path)
    if path.suffix.lower() in NO_PROJECT and path.is_file():
        raise InputError(
            f"This is a {path.suffix} file, and a project is needed: a TOML file that names terrain, picks and videos",
            file=path,
            advice="Give project.toml; Blender writes one (Share > Export Project), and `rockfall demo` an example",
        )
    if path.suffix.lower() == BLEND and path.is_file():
        written = project_of(path)
        if written is None:
            raise InputError("A .blend is read by the command line only", file=path, advice="Export the project")
        path = written
    top = TomlTable(read_toml(path, "project"), "", path)
    _check_schema(top)
    site, terrain, picks = top.table("site"), top.table("terrain"), top.table("picks")
    simulation, completeness = top.table("simulation"), _completeness(picks)
    block = _block(top.table("block"), BlockEntry(), named=False)
    blocks = tuple(_block(table, block, named=True) for table in top.tables("blocks"))
    render = tuple(_preset(table) for table in top.tables("render"))
    videos = tuple(_video(table) for table in top.tables("videos"))
    for key, entries in (("blocks", blocks), ("render", render), ("videos", videos)):
        names = [entry.name for entry in entries]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise top.wrong(key, f"names {repeated[0]!r} twice", "Give each entry a name of its own")
    return Project(
        site=Site(site.text("name", ""), site.text("description", ""), site.rest()),
        terrain=None if terrain.absent else _terrain(terrain),
        picks=None if picks.absent else picks.path("file"),
        completeness=completeness,
        block=block,
        blocks=blocks,
        reconstruction=_reconstruction(top.table("reconstruction")),
        render=render,
        videos=videos,
        refinement=_refinement(top.table("refinement")),
        simulation=None if simulation.absent else read_simulation(simulation),
        extra=top.rest() | ({"picks": picks.rest()} if picks.rest() else {}),
    )


def write_project(project: Project, path: str | Path) -> None:
    """Write ``project.toml``; files inside its folder, or beside it, are named relative to it."""
    import tomli_w

    path = Path(path)
    folder = final_path(path.resolve()).parent

    def relative(file: Path) -> str:
        try:
            return final_path(file.resolve()).relative_to(folder, walk_up=True).as_posix()
        except ValueError:  # another drive
            return file.resolve().as_posix()

    extra = dict(project.extra)
    picks_extra = extra.pop("picks", {})
    content: dict[str, Any] = {"schema": SCHEMA, "site": _plain(project.site)}
    if project.terrain is not None:
        files = [relative(file) for file in project.terrain.files]
        stated = {key: value for key, value in _plain(project.terrain).items() if key != "files"}
        content["terrain"] = {"file": files[0] if len(files) == 1 else files} | stated
    own = {} if project.picks is None else {"file": relative(project.picks)}
    if project.completeness.kind:
        own["completeness"] = project.completeness.text
    if own or picks_extra:
        content["picks"] = own | picks_extra
    content["block"] = {key: value for key, value in _plain(project.block).items() if key != "name"}
    content["blocks"] = [_plain(block) for block in project.blocks]
    content["reconstruction"] = _plain(project.reconstruction)
    content["videos"] = [_files_as(relative, _plain(video)) for video in project.videos]
    if project.videos or project.refinement != RefinementSettings():
        content["refinement"] = _plain(project.refinement)
    if project.simulation is not None:
        content["simulation"] = simulation_content(project.simulation, relative)
    content["render"] = [_plain(preset) for preset in project.render]
    content = {key: value for key, value in content.items() if value not in ({}, [])} | extra
    write_text(path, tomli_w.dumps(content))


def _plain(part: Any) -> dict[str, Any]:
    """A part as TOML can hold it: None left out, the unknown keys at the end."""
    values: dict[str, Any] = {}
    for key, value in vars(part).items():
        if key == "extra" or value is None or (key == "gaps" and not value):
            continue
        if isinstance(value, tuple):
            values[key] = list(value)
        elif isinstance(value, CameraPlacement):
            values[key] = _plain(value)
        else:
            values[key] = value
    return values | dict(part.extra)


def _files_as(relative: Callable[[Path], str], values: dict[str, Any]) -> dict[str, Any]:
    return {key: relative(value) if isinstance(value, Path) else value for key, value in values.items()}


def _check_schema(top: TomlTable) -> None:
    schema = top.take("schema")
    if schema is None:
        raise top.wrong("schema", "is missing", f"Start the file with: schema = {SCHEMA}")
    if not isinstance(schema, int) or isinstance(schema, bool) or schema < 1:
        raise top.wrong("schema", f"is {schema!r}", f"Write: schema = {SCHEMA}")
    if schema != SCHEMA:
        raise top.wrong(
            "schema",
            f"is {schema}, but this Rockfall reads version {SCHEMA}",
            "The project was written by a newer Rockfall: update, or write the project again with this version",
        )


def _terrain(table: TomlTable) -> TerrainSource:
    return TerrainSource(
        files=table.paths("file"),
        shift=table.optional_vector("shift"),
        crs=table.text("crs", ""),
        vertical_datum=table.text("vertical_datum", ""),
        up=table.choice("up", UP_AXES, "auto"),
        unit_m=table.optional_number("unit_m"),
        height_unit_m=table.optional_number("height_unit_m"),
        sigma_m=table.optional_number("sigma_m"),
        extra=table.rest(),
    )


def _block(table: TomlTable, default: BlockEntry, named: bool) -> BlockEntry:
    return BlockEntry(
        name=table.text("name") if named else "",
        d1_m=table.number("d1_m", default.d1_m),
        d2_m=table.number("d2_m", default.d2_m),
        d3_m=table.number("d3_m", default.d3_m),
        density_kgpm3=table.number("density_kgpm3", default.density_kgpm3),
        shape=table.choice("shape", SHAPES, default.shape),
        extra=table.rest(),
    )


def _reconstruction(table: TomlTable) -> ReconstructionSettings:
    return ReconstructionSettings(
        normal_radius_m=table.optional_number("normal_radius_m"),
        gravity_mps2=table.number("gravity_mps2", GRAVITY_MPS2),
        drag=table.flag("drag", False),
        drag_coefficient=table.number("drag_coefficient", DRAG_COEFFICIENT),
        air_density_kgpm3=table.number("air_density_kgpm3", AIR_DENSITY_KGPM3),
        flights=table.choice("flights", FLIGHT_ENDS, "contacts"),
        extra=table.rest(),
    )


def _video(table: TomlTable) -> VideoEntry:
    file = table.path("file", anywhere=True) if table.has("file") else None
    entry = VideoEntry(
        name=table.text("name") if file is None or table.has("name") else file.stem,
        file=file,
        camera=table.path("camera") if table.has("camera") else None,
        track=table.path("track") if table.has("track") else None,
        events=table.path("events") if table.has("events") else None,
        spin_marks=table.path("spin_marks") if table.has("spin_marks") else None,
        offset_s=table.signed("offset_s", 0.0),
        drift=table.signed("drift", 0.0),
        origin_s=table.signed("origin_s", 0.0),
        gaps=tuple((row[0], row[1]) for row in table.rows("gaps", 2, "[[video time of the last frame, seconds lost]]")),
        capture_rate_hz=table.optional_number("capture_rate_hz"),
        rate_hz=table.optional_number("rate_hz"),
        row_time_s=table.optional_number("row_time_s", zero_allowed=True),
        extra=table.rest(),
    )
    if abs(entry.drift) >= 1.0:
        advice = "It is relative: 1e-5 is 36 ms per hour; a slow-motion file has capture_rate_hz instead"
        raise table.wrong("drift", f"is {entry.drift:g}", advice)
    return entry


def _refinement(table: TomlTable) -> RefinementSettings:
    return RefinementSettings(
        free=table.choices("free", FREE),
        sigma_terrain_m=table.optional_number("sigma_terrain_m"),
        sigma_aim=table.number("sigma_aim", SIGMA_AIM, zero_allowed=True),
        sigma_datum=table.number("sigma_datum", SIGMA_DATUM, zero_allowed=True),
        loss=table.choice("loss", LOSSES, "huber"),
        extra=table.rest(),
    )


def _preset(table: TomlTable) -> RenderPreset:
    camera = table.table("camera")
    return RenderPreset(
        name=table.text("name"),
        width=table.whole("width", 1920),
        height=table.whole("height", 1080),
        fps=table.number("fps", 24.0),
        engine=table.choice("engine", ENGINES, "auto"),
        stagger_s=table.optional_number("stagger_s", zero_allowed=True),
        time_scale=table.number("time_scale", 1.0),
        camera=None if camera.absent else _camera(camera),
        extra=table.rest(),
    )


def _camera(table: TomlTable) -> CameraPlacement:
    fov_deg = table.number("fov_deg", 40.0)
    if fov_deg >= 180.0:
        raise table.wrong("fov_deg", f"is {fov_deg:g}", "Give the horizontal angle of view, below 180")
    return CameraPlacement(table.vector("position"), table.vector("target"), fov_deg, table.rest())
