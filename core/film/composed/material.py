# SPDX-License-Identifier: GPL-3.0-or-later
"""What a composed film is made of: a project, read once, and what is computed from it when a shot first needs it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ...analysis.comparison import compare
from ...analysis.predicted_flights import PredictedFlights, fly_predictions
from ...errors import InputError
from ...exchange.project import Project, VideoEntry, read_project
from ...impact_models.registry import COMPARED, find_model
from ...progress import Progress, silent
from ...reconstruction.trajectory import Reconstruction
from ...simulation.measured_releases import start_times
from ...terrain.readers import read_terrain
from ...terrain.surface import Surface
from ...vectors import Array
from ...workflow.footage import UNREFINED, clock_of, measured_in, open_entry
from ...workflow.opening import blocks_of, camera_remarks, open_terrain, read_project_camera
from ...workflow.simulation import remarks_of
from ..falls import fall_beside
from ..job import FilmJob
from .blocks import sun_direction
from .falls import Fall, measured_falls, predicted_falls, simulated_falls
from .filmed import Footage
from .ground import FROM_FOOTAGE, Ground, coloured, lit_ground
from .photographs import Photograph
from .request import FilmRequest
from .scenery import Scene
from .solids import SOLIDS
from .texts import Texts, texts

BEFORE_S, AFTER_S = 0.8, 1.0
"""So much of the footage is shown before the first moment of a block and after its last."""
STORY_MODELS = 3
PHOTOGRAPHS = 7
"""Frames of the footage that colour the terrain."""
CREDITS, DOI = "credits", "doi"
"""Keys of a project's [site] that a film shows."""


@dataclass(eq=False)
class Material:
    """All that shots draw.

    Attributes
    ----------
    request : what is asked.
    project, surface, result : the project, its terrain if any, its reconstruction.
    falls : the measured blocks that are shown, on the clock of the footage.
    footage : None without.
    words : in the film's language.
    progress : what is told while something is computed.
    remarks : what a user should know of the film.
    """

    request: FilmRequest
    project: Project
    surface: Surface | None
    result: Reconstruction
    falls: tuple[Fall, ...]
    footage: Footage | None
    words: Texts
    progress: Progress = silent
    remarks: list[str] = field(default_factory=list)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the film [px]."""
        return self.request.width, self.request.height

    @property
    def title(self) -> str:
        """The site's name, or the project's."""
        return self.project.site.name or self.request.project.absolute().parent.name

    @property
    def is_unrefined(self) -> bool:
        """Whether the paths join impacts as they were seen in the videos, so that numbers are approximate."""
        return UNREFINED in self.remarks

    @property
    def credit_lines(self) -> list[str]:
        """Who is to be named, as the project says."""
        extra = self.project.site.extra
        lines = [str(extra[CREDITS])] if extra.get(CREDITS) else []
        return [*lines, f"doi:{str(extra[DOI]).removeprefix('https://doi.org/')}"] if extra.get(DOI) else lines

    @cached_property
    def sun(self) -> Array:
        """(3,) towards it."""
        return sun_direction(*self.request.sun_deg)

    @property
    def terrain(self) -> Surface:
        """The terrain.

        Raises
        ------
        InputError : there is none.
        """
        if self.surface is None:
            raise InputError(
                f"The film {self.request.film!r} shows the terrain, and the project names none",
                file=self.request.project, advice='Add [terrain] file = "…" to it, or make the film overlay',
            )  # fmt: skip
        return self.surface

    @property
    def filmed(self) -> Footage:
        """The footage.

        Raises
        ------
        InputError : there is none.
        """
        if self.footage is None:
            raise InputError(
                f"The film {self.request.film!r} shows footage, and the project has no video with a file and a camera",
                file=self.request.project,
                advice="Add [[videos]] with file and camera (rockfall align), or make the film turntable or fly_along",
            )
        return self.footage

    @cached_property
    def ground(self) -> Ground:
        """The terrain, lit, with the colours of the footage where it shows it."""
        self.progress("Lighting the terrain", 0, 0)
        photographs: tuple[Photograph, ...] = ()
        if self.footage is not None and self.request.terrain_colours in FROM_FOOTAGE:
            first, last = (self.footage.frame(moment) for moment in self.span_s)
            frames = np.unique(np.linspace(first, last, PHOTOGRAPHS).astype(np.intp)).tolist()
            photographs = tuple(
                Photograph(self.footage.picture(frame), self.footage.camera(self.footage.moment(frame)))
                for frame in frames
            )
        return lit_ground(coloured(self.terrain, self.request.terrain_colours), self.sun, photographs)

    @cached_property
    def body(self) -> Surface | None:
        """The scanned block that stands for all, about the middle of its volume; None for a solid made by rule."""
        if self.request.solid in SOLIDS:
            return None
        scan = read_terrain(Path(self.request.solid))
        return replace(scan, vertices=scan.vertices - scan.vertices.mean(axis=0), name="scan")

    @property
    def span_s(self) -> tuple[float, float]:
        """First and last moment of what is measured, with a little before and after if there is footage of it."""
        first, last = min(fall.time_s[0] for fall in self.falls), max(fall.time_s[-1] for fall in self.falls)
        if self.footage is None:
            return float(first), float(last)
        begin, end = self.footage.span_s
        return max(float(first) - BEFORE_S, begin), min(float(last) + AFTER_S, end)

    @cached_property
    def together(self) -> tuple[Fall, ...]:
        """The measured blocks, all of which start at 0."""
        return tuple(fall.moved(-float(fall.time_s[0])) for fall in self.falls)

    @cached_property
    def models(self) -> tuple[str, ...]:
        """Those that are asked for; a few where none is."""
        return self.request.models or COMPARED[:STORY_MODELS]

    @cached_property
    def predictions(self) -> PredictedFlights:
        """What the models make of each measured impact."""
        self.progress("Flying what the models say", 0, 0)
        own = {name: values for name, values in self.request.parameters.items() if name in self.models}
        predictions = compare(self.result.impacts, self.models, own)
        return fly_predictions(
            self.result.impacts, predictions, self.terrain,
            gravity_mps2=self.result.gravity_mps2, drag=self.result.drag, beside=False,
        )  # fmt: skip

    def predicted(self, trajectory: str, impacts: Sequence[int]) -> tuple[Fall, ...]:
        """The blocks that leave some impacts of a trajectory as the models say."""
        flights = self.predictions
        rows = np.flatnonzero((flights.trajectory == trajectory) & np.isin(flights.impact, np.asarray(impacts)))
        models = [find_model(name) for name in self.models]
        return predicted_falls(
            flights, rows, blocks_of(self.project, self.result.picks),
            {model.name: model.title for model in models}, {model.name: model.colour for model in models},
        )  # fmt: skip

    @cached_property
    def simulated(self) -> tuple[Fall, ...]:
        """Whole falls by the models, from the measured starts, on the clock of the measured ones."""
        starts = {name: t for name, t in start_times(self.result).items() if name in {fall.name for fall in self.falls}}
        request = self.request
        job = FilmJob(
            "film", request.project, Path("film"), simulate=self.models, number=request.number, seed=request.seed,
            parameters=request.parameters,
        )  # fmt: skip
        simulations = fall_beside(job, self.project, len(starts), self.progress)
        self.remarks += [str(remark) for remark in remarks_of(simulations)]
        falls: list[Fall] = []
        for simulation in simulations:
            model = find_model(simulation.settings.model)
            group = model.title if model.is_random else self.words.say("without_chance", model=model.title)
            falls += simulated_falls(simulation, starts, group, model.colour)
        return tuple(fall for fall in falls if fall.name.rpartition(" ")[0] in starts)

    def scene(self, falls: Sequence[Fall]) -> Scene:
        """What is drawn of some blocks."""
        return Scene(self.surface, falls, self.request.solid, self.sun, self.request.seed, self.body)

    def block_words(self) -> str:
        """How large the block is, and how heavy."""
        fall = self.falls[0]
        size = self.words.number(2 * fall.radius_m, 2)
        return self.words.say("block", size=size, mass=self.words.mass(fall.mass_kg))

    def frame_s(self, rate: float) -> float:
        """Seconds of the fall in a frame."""
        return rate / self.request.fps


def open_material(request: FilmRequest, progress: Progress = silent) -> Material:
    """Read what a film is made of.

    Raises
    ------
    RockfallError : the project, a file of it or the request is bad; there is nothing measured to show.
    """
    progress("Reading the project", 0, 0)
    project = read_project(request.project)
    surface = open_terrain(project)
    result = measured_in(project, surface)
    unrefined = any(remark.text == UNREFINED for remark in result.remarks)
    remarks = [UNREFINED] if unrefined else []
    remarks += map(str, camera_remarks(project))
    words = texts(request.language).measured_roughly() if unrefined else texts(request.language)
    footage = _footage(project, surface, request.video, progress)
    known = list(dict.fromkeys(result.picks.trajectory.tolist()))
    wrong = [name for name in request.trajectories if name not in known]
    if wrong:
        raise InputError(
            f"There is no trajectory {wrong[0]!r}", file=request.project, advice=f"There are: {', '.join(known[:12])}"
        )
    falls = tuple(fall for fall in measured_falls(result, request.trajectories or None) if len(fall.time_s) > 1)
    if footage is not None and not request.trajectories:
        begin, end = footage.span_s
        falls = tuple(fall for fall in falls if fall.time_s[0] < end and fall.time_s[-1] > begin) or falls
    if not falls:
        raise InputError("Nothing measured can be shown", file=request.project, advice="Pick impacts first")
    if request.solid not in SOLIDS and not Path(request.solid).is_file():
        raise InputError(
            f"There is no solid and no file {request.solid!r}",
            advice=f"Give --block one of {', '.join(SOLIDS)}, or the file of a scanned block",
        )
    material = Material(request, project, surface, result, falls, footage, words, progress, remarks)
    if footage is not None and not any(overlaps(fall, footage) for fall in falls):
        raise InputError(
            f"The video {footage.name!r} shows none of the measured blocks: it lasts from {footage.span_s[0]:.2f} to "
            f"{footage.span_s[1]:.2f} s, and they fall from {falls[0].time_s[0]:.2f} s on",
            file=request.project,
            advice="Set offset_s of the video, or choose another one with --video",
        )
    return material


def overlaps(fall: Fall, footage: Footage) -> bool:
    """Whether a block moves while a video lasts."""
    begin, end = footage.span_s
    return bool(fall.time_s[0] < end and fall.time_s[-1] > begin)


def _footage(project: Project, surface: Surface | None, asked: str, progress: Progress) -> Footage | None:
    entries = [video for video in project.videos if video.file is not None and video.camera is not None]
    if asked:
        if asked not in [video.name for video in project.videos]:
            known = ", ".join(video.name for video in project.videos) or "none"
            raise InputError(f"There is no video {asked!r}", advice=f"Videos of the project: {known}")
        entries = [video for video in entries if video.name == asked]
        if not entries:
            raise InputError(f"The video {asked!r} has no file or no camera", advice="Align it: rockfall align")
    if not entries:
        return None
    entry: VideoEntry = entries[0]
    assert entry.camera is not None
    video = open_entry(entry, progress)
    camera, _ = read_project_camera(entry.camera, surface)
    if (camera.path.reference.width, camera.path.reference.height) != (video.width, video.height):
        ours = camera.path.reference
        raise InputError(
            f"The camera is of a picture of {ours.width} × {ours.height} pixels, "
            f"the video has {video.width} × {video.height}",
            file=entry.camera, advice="Align the video again, or name the other file",
        )  # fmt: skip
    return Footage(entry.name, video, camera.path, clock_of(entry, np.arange(video.frames), video.time_s))
