# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender is asked to make."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

from ..impact_models.machinery.parameters import Value
from .simulated import NUMBER

Kind = Literal["film", "still", "slope", "terrain", "frames", "composed"]
GraphKind = Literal["impacts", "motion"]
AS_SET_UP, BLEND = "", ".blend"
GRAPH_KINDS: tuple[GraphKind, ...] = get_args(GraphKind)


@dataclass(frozen=True)
class FilmJob:
    """One film or picture.

    Attributes
    ----------
    kind : "film" (MP4); "still" (one frame of the film, PNG); "slope" (the whole slope with all trajectories, PNG);
        "terrain" (a terrain file without trajectories, PNG); "frames" (numbered pictures of a folder, MP4);
        "composed" (what `request` says).
    source : the project; a .blend, whose film or still is as its settings say; for "terrain" the terrain file, for
        "frames" the folder.
    out : the file to write.
    preset : name of the render preset.
    engine : "cycles", "workbench" or "eevee"; "auto" until one is chosen; `MEASURED` lets frames tell
        (for a picture it is Cycles); `AS_SET_UP` of a .blend.
    frames : first and last frame, both included; None for all, or for a still the last.
    up, unit_m : how to read a terrain file.
    models : impact models whose blocks are shown beside the real ones, from each impact to the next.
    simulate : impact models whose blocks fall beside the real ones, from their first flight to their end.
    number, seed : of simulated blocks for each real one and model, and of their random numbers.
    parameters : model → parameter → value, where it is not the default.
    graphs : which stand in a film or still and follow its time; None for none.
    title : written into the picture of a terrain; empty for the name of its file.
    request : of "composed", as JSON.
    fps, codec, size : of "frames": frames per second, "h264", "h265" or "av1", width and height [px].
    scene : of a .blend; empty for the one that was open when it was saved.
    """

    kind: Kind
    source: Path
    out: Path
    engine: str = "auto"
    preset: str = "preview"
    frames: tuple[int, int] | None = None
    up: str = "auto"
    unit_m: float | None = None
    title: str = ""
    scene: str = ""
    graphs: GraphKind | None = None
    fps: float = 25.0
    codec: str = "h264"
    request: str = ""
    size: tuple[int, int] = (0, 0)
    models: tuple[str, ...] = ()
    simulate: tuple[str, ...] = ()
    number: int = NUMBER
    seed: int = 0
    parameters: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)

    def with_engine(self, engine: str) -> "FilmJob":
        """The same job for another engine."""
        return replace(self, engine=engine)

    def to_json(self) -> str:
        values = asdict(self)
        return json.dumps({key: str(value) if isinstance(value, Path) else value for key, value in values.items()})

    @classmethod
    def from_json(cls, text: str) -> "FilmJob":
        values = json.loads(text)
        frames, models, simulate = values.pop("frames"), tuple(values.pop("models")), tuple(values.pop("simulate"))
        source, out = Path(values.pop("source")), Path(values.pop("out"))
        values["size"] = tuple(values["size"])
        span = None if frames is None else (frames[0], frames[1])
        return cls(source=source, out=out, frames=span, models=models, simulate=simulate, **values)
