# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of a site: its terrain and the motion of its blocks, measured and simulated, about a near origin."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..exchange.project import Project, Site, read_project
from ..film.composed.falls import Fall, Hits, measured_falls, simulated_falls
from ..film.composed.ground import FROM_FOOTAGE, TerrainColours, coloured
from ..film.composed.photographs import Photograph
from ..film.falls import fall_beside
from ..film.job import FilmJob
from ..film.simulated import NUMBER, group_name
from ..georeference import GlobalShift
from ..impact_models.machinery.parameters import Value
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..reconstruction.trajectory import Reconstruction
from ..simulation.engine import ENDS, STOPPED, Simulation
from ..simulation.measured_releases import start_times
from ..terrain.surface import Surface
from ..vectors import Array
from ..workflow.opening import open_project
from ..workflow.simulation import remarks_of
from .photographs import Filmed, photographs_of, project_videos

CREDITS, DOI = "credits", "doi"
"""Keys of a project's [site] beside its name and description."""
AROUND = 0.6
"""So much of the terrain is shown around the paths, in parts of their greatest extent …"""
"""A row of a path is that of an impact."""
LEAST_AROUND_M = 25.0
"""… and at least so much [m]."""


@dataclass(frozen=True)
class ShowRequest:
    """What of a project is shown.

    Attributes
    ----------
    project : project.toml.
    simulate : impact models whose blocks fall beside the measured ones, from the same starts.
    number, seed : of simulated blocks for each measured one and model, and of their random numbers.
    parameters : model → parameter → value, where it is not the default.
    terrain_colours : where the terrain has its colours from.
    together : whether all blocks start at 0 s, not one after the other as they were observed.
    """

    project: Path
    simulate: tuple[str, ...] = ()
    number: int = NUMBER
    seed: int = 0
    parameters: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    together: bool = True
    terrain_colours: TerrainColours = "auto"


@dataclass(frozen=True, eq=False)
class Show:
    """A site and its blocks, in metres about a near origin, the first one starting at 0 s.

    Attributes
    ----------
    site : name, description, credits and DOI.
    origin : the survey coordinates of the origin.
    surface : the terrain around the paths; None where there is none.
    falls : the blocks.
    rests : names of those that are at rest in the end; the others are lost from sight, or leave the terrain.
    together : whether all start at 0 s.
    remarks : what a user should know.
    photographs : of the slope, whose colours its terrain has where they show it.
    """

    site: Site
    origin: GlobalShift
    surface: Surface | None
    falls: tuple[Fall, ...]
    rests: frozenset[str]
    together: bool = True
    remarks: tuple[str, ...] = ()
    photographs: tuple[Photograph, ...] = ()

    @property
    def duration_s(self) -> float:
        """When the last block ends [s]."""
        return max(float(fall.time_s[-1]) for fall in self.falls)


def open_show(request: ShowRequest, progress: Progress = silent) -> Show:
    """Read a project, and let blocks fall beside the measured ones where that is asked for.

    Raises
    ------
    RockfallError : the project or a file of it is bad; nothing measured can be shown; blocks cannot be simulated.
    """
    progress("Reading the project", 0, 0)
    project = read_project(request.project)
    surface, result = open_project(project)
    surface = None if surface is None else coloured(surface, request.terrain_colours)
    simulations: tuple[Simulation, ...] = ()
    if request.simulate:
        if surface is None:
            raise InputError(
                "Simulated blocks fall on a terrain, and the project names none",
                file=request.project,
                advice='Add [terrain] file = "…" to it',
            )
        simulations = _simulated(request, project, result, progress)
    remarks = [str(remark) for remark in (*result.remarks, *(remarks_of(simulations) if simulations else ()))]
    site = project.site if project.site.name else replace(project.site, name=request.project.absolute().parent.name)
    show = show_of(site, surface, result, simulations, together=request.together, remarks=remarks)
    if request.terrain_colours not in FROM_FOOTAGE or surface is None:
        return show
    videos, unusable = project_videos(project, surface)
    return with_photographs(show, surface, videos, unusable, progress)


def with_photographs(
    show: Show, surface: Surface, videos: Iterable[Filmed], unusable: Iterable[str] = (), progress: Progress = silent
) -> Show:
    """The same with the colours of videos on its terrain.

    Parameters
    ----------
    surface : the whole terrain, in whose local coordinates the cameras stand.
    unusable : sentences on videos that are left out.
    """
    photographs, said = photographs_of(videos, show.origin.vector - surface.shift.vector, progress)
    return replace(show, photographs=photographs, remarks=(*show.remarks, *unusable, *said))


def show_of(
    site: Site,
    surface: Surface | None,
    result: Reconstruction,
    simulations: Sequence[Simulation] = (),
    *,
    starts_s: Mapping[str, float] | None = None,
    together: bool = True,
    remarks: Iterable[str] = (),
) -> Show:
    """Show a reconstruction, and simulations beside it.

    Parameters
    ----------
    starts_s : release → when its blocks start [s]; 0 where it is not named. None for those of the measured blocks.

    Raises
    ------
    InputError : nothing measured can be shown.
    """
    measured = tuple(fall for fall in measured_falls(result) if fall.time_s.size > 1)
    if not measured:
        raise InputError("No measured block can be shown: no flight is known", advice="Pick two impacts or more")
    kind = {str(name): str(kind) for name, kind in zip(result.picks.trajectory, result.picks.kind, strict=True)}
    rests = {fall.name for fall in measured if kind[fall.name] == "stop"}
    starts = starts_s if starts_s is not None else start_times(result) if simulations else {}
    falls = list(measured)
    for simulation in simulations:
        model = find_model(simulation.settings.model)
        group = group_name(model)
        own = simulated_falls(simulation, starts, group, model.colour)
        end = simulation.end[np.searchsorted(simulation.number, [int(fall.name.rpartition(" ")[2]) for fall in own])]
        named = [replace(fall, name=f"{fall.name}, {model.name}") for fall in own]
        still = (end == ENDS.index(STOPPED)) | (end >= len(ENDS))  # on the ground, or held by a structure
        rests |= {fall.name for fall, at_rest in zip(named, still, strict=True) if at_rest}
        falls += named
    first = {fall.name: float(fall.time_s[0]) for fall in falls}
    earliest = min(first.values())
    moved = [fall.moved(-(first[fall.name] if together else earliest)) for fall in falls]
    place = np.concatenate([fall.position for fall in moved])
    centre = np.round((place.min(axis=0) + place.max(axis=0)) / 2)
    near = tuple(replace(fall, position=fall.position - centre, hits=_near(fall, centre)) for fall in moved)
    shift = result.picks.shift if surface is None else surface.shift
    x, y, z = (shift.vector + centre).tolist()
    origin = GlobalShift(x, y, z, shift.crs, shift.vertical)
    around = None if surface is None else _around(surface, place, centre, origin)
    return Show(site, origin, around, near, frozenset(rests), together, tuple(remarks))


def _simulated(
    request: ShowRequest, project: Project, result: Reconstruction, progress: Progress
) -> tuple[Simulation, ...]:
    job = FilmJob(
        "film",
        request.project,
        Path("show"),
        simulate=request.simulate,
        number=request.number,
        seed=request.seed,
        parameters=request.parameters,
    )
    return fall_beside(job, project, len(start_times(result)), progress)


def _near(fall: Fall, centre: Array) -> Hits | None:
    return None if fall.hits is None else replace(fall.hits, position=fall.hits.position - centre)


def _around(surface: Surface, place: Array, centre: Array, origin: GlobalShift) -> Surface:
    """The part of a terrain that is shown, about the new origin."""
    low, high = place[:, :2].min(axis=0), place[:, :2].max(axis=0)
    margin = max(AROUND * float((high - low).max()), LEAST_AROUND_M)
    corners = surface.vertices[surface.faces, :2]
    near = (corners.max(axis=1) >= low - margin) & (corners.min(axis=1) <= high + margin)
    faces = surface.faces[near.all(axis=1)]
    used, numbered = np.unique(faces, return_inverse=True)
    vertices = np.ascontiguousarray(surface.vertices[used] - centre)
    colours = None if surface.colours is None else surface.colours[used]
    return Surface(vertices, numbered.reshape(-1, 3).astype(np.int32), origin, surface.name, colours=colours)
