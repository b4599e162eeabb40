# SPDX-License-Identifier: GPL-3.0-or-later
"""Picks fitted to what was seen in videos: which pixels count, the fit, and what changes by it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..progress import Progress, silent
from ..reconstruction.block import Block
from ..reconstruction.choices import SIGMA_AIM, SIGMA_DATUM, Loss
from ..reconstruction.drag import Drag
from ..reconstruction.picks import Picks, take
from ..reconstruction.refinement.refine import refine
from ..reconstruction.refinement.result import Refinement
from ..reconstruction.refinement.views import PixelObservations
from ..reconstruction.sightings import SeenVideo, Sightings, joined, some
from ..remarks import Remark, gravest_first
from ..terrain.surface import Surface
from ..vectors import Array, Indices, norm

NAMED = 8
"""Trajectories that a message lists, at most."""
LEAST_DRAG = 1e-9
"""A fitted drag of zero is none: settings keep a coefficient above zero."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Picks fitted to videos.

    Attributes
    ----------
    before : the picks that were fitted, as they were, in the frame of the fitted ones.
    fit : what came out, with the picks, impacts, views and residuals; the views are those of the videos.
    seen, frame : the m pixels that were used, and their frames, −1 where not given.
    moved_m, later_s : (n,) by how much the picks moved.
    pose_covariance : of the v views, as in `View`; None for those whose pose was held.
    remarks : one on pixels that were left out and those of the fit, the gravest first.
    """

    before: Picks
    fit: Refinement
    seen: PixelObservations
    frame: Indices
    moved_m: Array
    later_s: Array
    pose_covariance: tuple[Array | None, ...]
    remarks: tuple[Remark, ...]

    @property
    def drag_coefficient(self) -> float | None:
        """As settings keep it; None without drag."""
        drag = self.fit.reconstruction.drag
        return None if drag is None else max(drag.coefficient, LEAST_DRAG)


def pixels_of(videos: Sequence[SeenVideo]) -> tuple[PixelObservations, Indices]:
    """All pixels of blocks whose camera's pose is known in their frames, and these frames."""
    parts = [some(Sightings, video.sightings, video.view.path.known_at(video.sightings.time_s)) for video in videos]
    seen = joined(Sightings, parts)
    view = np.repeat(np.arange(len(videos)), [len(part) for part in parts])
    return PixelObservations(view, seen.trajectory, seen.time_s, seen.pixel, seen.known_sigma_px), seen.frame


def refine_picks(
    picks: Picks,
    videos: Sequence[SeenVideo],
    *,
    block: Mapping[str, Block],
    gravity_mps2: float,
    surface: Surface | None = None,
    drag: Drag | None = None,
    normal_radius_m: float | None = None,
    names: Collection[str] | None = None,
    free: Sequence[str] = (),
    sigma_terrain_m: float | None = None,
    sigma_aim: float = SIGMA_AIM,
    sigma_datum: float = SIGMA_DATUM,
    loss: Loss = "huber",
    site: str = "",
    progress: Progress = silent,
) -> Refined:
    """Fit picks to the pixels of videos.

    Parameters
    ----------
    names : of the trajectories; None takes all.
    free : what else is fitted, see `refine`; the clock of a single video is not.
    Others : see `refine`.

    Raises
    ------
    InputError : a trajectory without picks.
    RockfallError : whatever `refine` refuses.
    """
    if names is not None:
        for name in names:
            if name not in picks.trajectory:
                raise unknown_trajectory(name, picks)
        picks = take(picks, np.isin(picks.trajectory, list(names)))
        videos = [_only(video, names) for video in videos]
    seen, frame = pixels_of(videos)
    lost = sum(len(video.sightings) for video in videos) - len(seen)
    clocked = len(videos) > 1
    fit = refine(
        picks,
        [video.view for video in videos],
        seen,
        surface=surface,
        block=block,
        gravity_mps2=gravity_mps2,
        drag=drag,
        normal_radius_m=normal_radius_m,
        free=[name for name in free if clocked or not name.startswith("clock")],
        sigma_terrain_m=sigma_terrain_m,
        sigma_aim=sigma_aim,
        sigma_datum=sigma_datum,
        loss=loss,
        site=site,
        progress=progress,
    )
    before = picks.in_shift(fit.picks.shift)
    text = f"{lost} pixels are not used: the pose of the camera is not known in their frames."
    return Refined(
        before=before,
        fit=fit,
        seen=seen,
        frame=frame,
        moved_m=norm(fit.picks.position - before.position),
        later_s=fit.picks.time_s - before.time_s,
        pose_covariance=tuple(view.pose_covariance if "camera" in free else None for view in fit.views),
        remarks=tuple(gravest_first([*((Remark(text, "note", "pixels"),) if lost else ()), *fit.remarks])),
    )


def unknown_trajectory(name: str, picks: Picks) -> InputError:
    """That the picks have no trajectory of this name."""
    known = list(dict.fromkeys(picks.trajectory.tolist()))
    more = f" and {len(known) - NAMED} more" if len(known) > NAMED else ""
    return InputError(
        f"There is no trajectory {name!r}",
        file=picks.source or None,
        advice=f"The picks have: {', '.join(known[:NAMED])}{more}",
    )


def _only(video: SeenVideo, names: Collection[str]) -> SeenVideo:
    return replace(video, sightings=some(Sightings, video.sightings, np.isin(video.sightings.trajectory, list(names))))
