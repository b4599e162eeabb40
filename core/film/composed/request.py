# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked of a composed film."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

from ...errors import InputError
from ...impact_models.machinery.parameters import Value
from ..simulated import NUMBER, check_number
from .ground import TerrainColours

SUN_DEG = (315.0, 50.0)
RATES, MOST_FREEZE_S = (0.005, 100.0), 60.0


@dataclass(frozen=True)
class FilmRequest:
    """A film and how it is to be.

    Attributes
    ----------
    film : its name in the catalogue.
    project : project.toml.
    width, height : of the picture [px].
    fps : frames per second.
    language : "en", "fr" or "de".
    rate : seconds of the fall in a second of film; None for the film's own.
    slow_at : impacts at which it slows down and stands still; None for the film's own.
    freeze_s : how long it stands there [s].
    video : which of the project's; empty for the first that has a camera.
    trajectories : which are shown; none for all, in footage those that fall while it lasts.
    models : impact models whose blocks fly beside the real ones, and fall.
    number, seed : of simulated blocks for each measured one and model, and of their random numbers.
    parameters : model → parameter → value, where it is not the default.
    graphs : "impacts", "motion" or empty.
    solid : what stands for the block, see `solids`; or the file of a scanned one.
    sun_deg : azimuth from north and elevation.
    dust : whether impacts raise some; it is drawn, not measured.
    terrain_colours : where the terrain has its colours from.

    Raises
    ------
    InputError : a number that no film can have.
    """

    film: str
    project: Path
    width: int = 1280
    height: int = 720
    fps: float = 25.0
    language: str = "en"
    rate: float | None = None
    slow_at: tuple[int, ...] | None = None
    freeze_s: float = 0.5
    video: str = ""
    trajectories: tuple[str, ...] = ()
    models: tuple[str, ...] = ()
    number: int = NUMBER
    seed: int = 0
    parameters: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    graphs: str = ""
    solid: str = "rock"
    sun_deg: tuple[float, float] = SUN_DEG
    dust: bool = False
    terrain_colours: TerrainColours = "auto"

    def __post_init__(self) -> None:
        check_number(self.number, max(len(self.models), 1))
        if self.rate is not None and not RATES[0] <= self.rate <= RATES[1]:
            raise InputError(
                f"{self.rate:g} seconds of the fall in a second of film are beyond what can be watched",
                advice=f"Give --rate {RATES[0]:g} to {RATES[1]:g}; 0.25 is four times slower",
            )
        if not 0.0 <= self.freeze_s <= MOST_FREEZE_S:
            raise InputError(
                f"A film cannot stand still for {self.freeze_s:g} s", advice=f"Give --freeze 0 to {MOST_FREEZE_S:g}"
            )

    @classmethod
    def from_json(cls, text: str) -> "FilmRequest":
        """The inverse of `to_json`."""
        values = json.loads(text)
        for name in ("trajectories", "models", "sun_deg"):
            values[name] = tuple(values[name])
        values["slow_at"] = None if values["slow_at"] is None else tuple(values["slow_at"])
        return cls(**{**values, "project": Path(values["project"])})

    def to_json(self) -> str:
        """As text, the same for the same request."""
        return json.dumps({**asdict(self), "project": str(self.project)}, sort_keys=True)
