# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall motion``: a project's trajectories over time → motion.csv, track_residuals.csv, figures."""

import argparse
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .options import add_figure_options, add_out, figure_formats, naming
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..analysis.motion_graphs import FrameScale, MotionCourse
    from ..exchange.project import Project
    from ..reconstruction.picks import Picks
    from ..terrain.surface import Surface
    from ..workflow.footage import Footage


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "project",
        metavar="PROJECT",
        help="a project (.toml, .blend); with cameras and tracks also their residuals",
    )
    add_out(parser)
    parser.add_argument("--trajectory", action="extend", nargs="+", metavar="NAME", help="only these (default: all)")
    add_figure_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct, write the tables and figures, print the summary."""
    from ..analysis.motion_figures import save_motion_figures
    from ..analysis.motion_graphs import QUANTITIES, motion_courses
    from ..exchange.motion_tables import write_motion, write_track_residuals
    from ..exchange.project import read_project
    from ..extras import FIGURES, install_command, is_there
    from ..output import output_folder
    from ..workflow.opening import open_terrain, read_project_picks, reconstruct_project
    from ..workflow.refinement import pixels_of

    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.project):
        progress(f"Reading {arguments.project}")
        project = read_project(arguments.project)
        if project.picks is None and any(video.track is not None for video in project.videos):
            raise InputError(
                "The project names no table of picks, of which the motion is computed",
                file=arguments.project,
                advice="rockfall refine makes them from the tracks: give the project.toml that it writes",
            )
        surface = open_terrain(project)
        picks, turned = read_project_picks(project, surface)
        picks = _chosen(picks, arguments.trajectory)
        footage = _footage(project, surface, picks)
        progress("Reconstructing")
        result = reconstruct_project(project, surface, picks)
        videos = [] if footage is None else footage.seen
        seen = pixels_of(videos)[0] if videos else None
        courses = motion_courses(result, surface, [video.view for video in videos], seen, QUANTITIES)
        scale = None if footage is None else _scale(footage)
        progress("Writing the tables")
        write_motion(courses, folder / "motion.csv", scale)
        written = ["motion.csv"]
        if any(course.residuals for course in courses):
            write_track_residuals(courses, folder / "track_residuals.csv")
            written.append("track_residuals.csv")
        notes = [*turned, *([] if footage is None else footage.notes)]
        if not arguments.tables_only and is_there(FIGURES):
            progress("Drawing the figures")
            save_motion_figures(
                courses, folder / "figures", scale, formats=figure_formats(arguments), progress=progress
            )
            written.append("figures")
        elif not arguments.tables_only:
            notes.append(f"No figures without Matplotlib. Install it: {install_command(FIGURES)}")
    for line in (*_summary(courses), *notes):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _chosen(picks: "Picks", names: list[str] | None) -> "Picks":
    from ..reconstruction.picks import take
    from ..workflow.refinement import unknown_trajectory

    if names is None:
        return picks
    for name in names:
        if name not in picks.trajectory:
            raise unknown_trajectory(name, picks)
    return take(picks, np.isin(picks.trajectory, names))


def _footage(project: "Project", surface: "Surface | None", picks: "Picks") -> "Footage | None":
    """What was tracked of these trajectories; None where no video has both a camera and a track."""
    from ..workflow.footage import name_trajectory, open_footage

    if not any(video.camera is not None and video.track is not None for video in project.videos):
        return None
    return name_trajectory(open_footage(project, surface, picks.shift), picks)


def _scale(footage: "Footage") -> "FrameScale | None":
    """The frames of the first video whose track numbers them."""
    from ..analysis.motion_graphs import FrameScale

    for video in footage.videos:
        track = video.track
        if track is None:
            continue
        frame, first = np.unique(track.frame[track.frame >= 0], return_index=True)
        if frame.size > 1:
            video_s = track.time_s[track.frame >= 0][first]
            return FrameScale(video.entry.name, video.clock, video_s, frame.astype(np.float64))
    return None


def _summary(courses: "tuple[MotionCourse, ...]") -> list[str]:
    from ..analysis.motion_graphs import HEIGHT, KINETIC, SPEED

    lines = []
    for course in courses:
        if not course.time_s.size:
            lines.append(f"{course.trajectory}: no flight is known, it has no line in the graphs.")
            continue
        most = {
            one: float(np.nanmax(course.values[one.name])) if course.has(one) else np.nan for one in (SPEED, KINETIC)
        }
        text = f"{course.trajectory}: up to {most[SPEED]:.1f} m/s and {most[KINETIC]:.3g} kJ"
        if course.has(HEIGHT):
            text += f", up to {np.nanmax(course.values[HEIGHT.name]):.1f} m above the ground"
        for one in course.residuals:
            known = one.distance_px[np.isfinite(one.distance_px)]
            rms = (
                f"{np.sqrt(np.mean(known**2)):.1f} px off the motion (root mean square)"
                if known.size
                else "outside of it"
            )
            text += f"; {known.size} pixels of {one.video} {rms}"
        lines.append(f"{text}.")
    return lines
