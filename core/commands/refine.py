# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall refine``: picks and times fitted to the pixels of the footage → picks and impacts with deviations."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from ..reconstruction.choices import FREE, LOSSES, Loss
from ..reconstruction.sampling import STEP_S
from ..vectors import Array, norm
from .options import add_out, known_names, naming, not_negative, positive
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..exchange.project import Project, RefinementSettings
    from ..reconstruction.impact import Impacts
    from ..reconstruction.picks import Picks
    from ..reconstruction.refinement.reliability import Statement
    from ..reconstruction.refinement.what_if import WhatIf
    from ..terrain.surface import Surface
    from ..workflow.footage import Footage
    from ..workflow.refinement import Refined

MOST_ROWS = 20
POSE = ("rx", "ry", "rz", "x", "y", "z")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "project", metavar="PROJECT", help="a project (.toml, .blend), with videos that have a camera and a track"
    )
    add_out(parser)
    parser.add_argument(
        "--free",
        metavar="A,B,…",
        help="what is fitted beside the picks: camera, clock, clock_drift, drag, gravity; or none (default: as the "
        "project says)",
    )
    parser.add_argument(
        "--loss", choices=LOSSES, help="how pixels that do not fit count (default: as the project says, else huber)"
    )
    parser.add_argument(
        "--sigma-aim",
        type=not_negative,
        metavar="PART",
        help="standard deviation of the tracked spot about the block's centre, in parts of its diameter; 0: the pixels "
        "are the centre's (default: as the project says, else 0.15)",
    )
    parser.add_argument(
        "--sigma-datum",
        type=not_negative,
        metavar="PART",
        help="standard deviation of how the cameras lie to the terrain beside their covariance, in parts of the "
        "distance; 0: they are of one survey (default: as the project says, else 0.0012)",
    )
    parser.add_argument(
        "--sigma-terrain",
        type=positive,
        metavar="M",
        help="accuracy of the terrain's height [m]: about 0.02 for a terrestrial scan, 0.05 from a drone, 0.2 for an "
        "airborne one (default: as the project says, else half the point spacing, from 0.02 to 0.2)",
    )
    parser.add_argument(
        "--trajectory", action="extend", nargs="+", metavar="NAME", help="only these (default: all of the project)"
    )
    parser.add_argument(
        "--step",
        type=positive,
        default=STEP_S,
        metavar="S",
        help="time step of trajectories.csv [s] (default %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Refine, write the tables and the refined project, print the summary."""
    from ..exchange.project import read_project
    from ..output import output_folder
    from ..workflow.footage import name_trajectory, open_footage
    from ..workflow.opening import blocks_of, drag_of, open_terrain
    from ..workflow.refinement import refine_picks

    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.project):
        progress(f"Reading {arguments.project}")
        project = read_project(arguments.project)
        how = _settings(project.refinement, arguments)
        surface = open_terrain(project)
        footage = open_footage(project, surface)
        picks, notes = _picks(project, surface, footage)
        footage = name_trajectory(footage, picks)
        refined = refine_picks(
            picks,
            footage.seen,
            surface=surface,
            block=blocks_of(project, picks),
            gravity_mps2=project.reconstruction.gravity_mps2,
            drag=drag_of(project),
            normal_radius_m=project.reconstruction.normal_radius_m,
            names=arguments.trajectory,
            free=how.free,
            sigma_terrain_m=how.sigma_terrain_m or (project.terrain.sigma_m if project.terrain else None),
            sigma_aim=how.sigma_aim,
            sigma_datum=how.sigma_datum,
            loss=cast(Loss, how.loss),
            site=project.site.name,
            progress=progress,
        )
        progress("Writing the tables")
        written = _write(folder, project, Path(arguments.project), how, footage, refined, surface, arguments.step)
    for sentence in (*notes, *footage.notes, *_summary(refined)):
        print(sentence)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _settings(settings: "RefinementSettings", arguments: argparse.Namespace) -> "RefinementSettings":
    """As the project says, but for what was typed."""
    free = settings.free if arguments.free is None else known_names(arguments.free, FREE, "--free")
    aim = settings.sigma_aim if arguments.sigma_aim is None else arguments.sigma_aim
    datum = settings.sigma_datum if arguments.sigma_datum is None else arguments.sigma_datum
    terrain = arguments.sigma_terrain or settings.sigma_terrain_m
    loss = arguments.loss or settings.loss
    return replace(settings, free=free, loss=loss, sigma_aim=aim, sigma_datum=datum, sigma_terrain_m=terrain)


def _picks(project: "Project", surface: "Surface | None", footage: "Footage") -> tuple["Picks", tuple[str, ...]]:
    """The project's picks, or first ones from what was seen; with a sentence about these."""
    from ..exchange.tables import read_picks
    from ..workflow.footage import picks_from_footage
    from ..workflow.opening import read_project_picks

    if project.picks is not None:
        if surface is None:
            return read_picks(project.picks, footage.shift), ()
        return read_project_picks(project, surface)
    names = sorted({name for video in footage.seen for name in video.sightings.trajectory.tolist()} - {""})
    alone = names[0] if len(names) == 1 else project.blocks[0].name if len(project.blocks) == 1 else "block"
    picks = picks_from_footage(project, surface, name=alone)
    count = picks.group_starts.size
    runs = "trajectory" if count == 1 else "trajectories"
    marked = any(video.events is not None for video in project.videos)
    source = "the events seen in the videos" if marked else "the tracks, where a block changes its velocity at once"
    return picks, (f"{len(picks)} first picks of {count} {runs} were made from {source}.",)


def _write(
    folder: Path,
    project: "Project",
    source: Path,
    how: "RefinementSettings",
    footage: "Footage",
    refined: "Refined",
    surface: "Surface | None",
    step_s: float,
) -> list[str]:
    """Write all files; returns their names."""
    from ..exchange.cameras import write_camera
    from ..exchange.footage_tables import write_refinement_residuals, write_reliability, write_what_if
    from ..exchange.project import write_project
    from ..exchange.saved_blend import keep_files
    from ..exchange.tables import write_impacts, write_picks, write_trajectories
    from ..reconstruction.sampling import sample_trajectories

    fit, seen = refined.fit, refined.seen
    made = fit.reconstruction
    write_picks(fit.picks, folder / "picks.csv")
    write_impacts(made.impacts, folder / "impacts.csv")
    write_trajectories(sample_trajectories(made, step_s, surface), folder / "trajectories.csv")
    write_refinement_residuals(
        folder / "residuals.csv",
        trajectory=seen.trajectory,
        video=np.array([view.name for view in fit.views])[seen.view],
        frame=refined.frame,
        time_s=seen.time_s,
        pixel=seen.pixel,
        residual_px=fit.residual_px,
        outlier=fit.outlier,
    )
    write_what_if(fit.what_if, folder / "what_if.csv")
    write_reliability(fit.statements, folder / "reliability.csv")
    written = ["picks.csv", "impacts.csv", "trajectories.csv", "residuals.csv", "what_if.csv", "reliability.csv"]
    entries = {}
    for i, (video, view) in enumerate(zip(footage.videos, fit.views, strict=True)):
        entry, camera, covariance = video.entry, video.camera, refined.pose_covariance[i]
        entries[entry.name] = replace(entry, offset_s=view.clock.offset_s, drift=view.clock.drift, gaps=view.clock.gaps)
        if covariance is not None:
            file = folder / f"camera_{_as_file(entry.name)}.toml"
            held = {name: value for name, value in camera.sigma.items() if name not in POSE}
            write_camera(
                file,
                view.path,
                rmse_px=float(fit.rmse_px_by_view[i]),
                sigma=held | dict(zip(POSE, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
                crs=camera.crs,
                pose_covariance=covariance,
                quality=None if camera.quality is None else camera.quality.of_pose_alone,
                extra=camera.extra,
            )
            entries[entry.name] = replace(entries[entry.name], camera=file)
            written.append(file.name)
    reconstruction = replace(project.reconstruction, flights=made.ends, gravity_mps2=made.gravity_mps2)
    if refined.drag_coefficient is not None:
        reconstruction = replace(reconstruction, drag=True, drag_coefficient=refined.drag_coefficient)
    result = replace(
        project,
        picks=folder / "picks.csv",
        videos=tuple(entries.get(video.name, video) for video in project.videos),
        reconstruction=reconstruction,
        refinement=how,
    )
    write_project(keep_files(result, source, folder), folder / "project.toml")
    return [*written, "project.toml"]


def _as_file(name: str) -> str:
    """A video's name as a part of a file name."""
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


def _summary(refined: "Refined") -> list[str]:
    fit = refined.fit
    views, used = fit.views, np.isfinite(fit.residual_px[:, 0])
    sentences = [
        f"{int(used.sum())} pixels in {len(views)} {'video' if len(views) == 1 else 'videos'}: "
        f"{fit.rmse_px_before:.2f} px off the marked motion, {fit.rmse_px:.2f} px off the fitted one "
        f"(root mean square), {int(fit.outlier.sum())} outliers; {fit.iterations} steps."
    ]
    if len(views) > 1:
        each = [f"{view.name} {rmse:.2f} px" for view, rmse in zip(views, fit.rmse_px_by_view, strict=True)]
        sentences.append(f"By video: {', '.join(each)}.")
    fitted = np.isin(fit.picks.trajectory, np.unique(refined.seen.trajectory)) & (fit.picks.kind != "pass")
    shift, late = refined.moved_m[fitted], np.abs(refined.later_s[fitted])
    if shift.size:
        sentences.append(
            f"The picks moved by {100 * np.median(shift):.1f} cm and {1e3 * np.median(late):.1f} ms (medians), by "
            f"{100 * shift.max():.1f} cm and {1e3 * late.max():.1f} ms at most."
        )
    if fit.noise_scale > 1:
        sentences.append(f"The residuals are {fit.noise_scale:.2f} times what was stated; the deviations allow for it.")
    if fit.aim:
        off = [100 * float(norm(aim)) for aim, _ in fit.aim.values()]
        sentences.append(
            f"The tracked spot lies {np.median(off):.0f} % of the block's diameter off its centre"
            + (f" (median; at most {max(off):.0f} %)." if len(off) > 1 else ".")
        )
    sentences += [f"{name}: {value:.6g} ± {sigma:.2g}" for name, (value, sigma) in fit.unknowns.items()]
    impacts = _impact_lines(fit.reconstruction.impacts)
    tables = [*_what_if_lines(fit.what_if), *_reliability_lines(fit.statements)]
    return [*sentences, *impacts, *tables, *map(str, refined.remarks)]


def _what_if_lines(rows: Sequence["WhatIf"]) -> list[str]:
    """What would change if an input were otherwise, as a table for people: of all trajectories together."""
    from ..reconstruction.refinement.what_if import gravest

    if not rows:
        return []
    return _table(
        [("what if", "speeds, median", "at most", "R, median", "at most"), *(one.cells for one in gravest(rows))]
    )


def _reliability_lines(rows: Sequence["Statement"]) -> list[str]:
    """How large errors of what is stated may be unnoticed, as a table for people: the worst of each kind."""
    from ..reconstruction.refinement.reliability import worst

    if not rows:
        return []
    return _table([("not detectable below", "size", "speeds, median", "at most"), *(one.cells for one in worst(rows))])


def _table(cells: Sequence[tuple[str, ...]]) -> list[str]:
    width = max(len(row[0]) for row in cells)
    return [f"{row[0]:<{width}}" + "".join(f"  {cell:>14}" for cell in row[1:]) for row in cells]


def _impact_lines(impacts: "Impacts") -> list[str]:
    """The impacts as a table for people."""
    from ..reconstruction.intervals import in_words

    if not len(impacts):
        return ["No impacts."]
    speeds = [
        (norm(impacts.v1), _speed_sigma(impacts, "kinetic1_j", impacts.v1)),
        (norm(impacts.v2), _speed_sigma(impacts, "kinetic2_j", impacts.v2)),
    ]
    width = max(len("trajectory"), *map(len, impacts.trajectory.tolist()[:MOST_ROWS]))
    heads = f"  {'incident m/s':>12}  {'restituted m/s':>14}  {'R_N (95 %)':>19}  {'R (95 %)':>19}"
    lines = [f"{'trajectory':<{width}}  impact    time s{heads}"]
    for i in range(min(len(impacts), MOST_ROWS)):
        cells = "".join(
            f"  {_with(of[i], sigma[i], 2):>{wide}}" for (of, sigma), wide in zip(speeds, (12, 14), strict=True)
        )
        for name, value in (("rn", impacts.rn[i]), ("r", impacts.r[i])):
            low, high = impacts.intervals[name][i] if name in impacts.intervals else (np.nan, np.nan)
            cells += f"  {in_words(name, value, low, high, 2).replace(' to ', '–') or '–':>19}"
        lines.append(f"{impacts.trajectory[i]:<{width}}  {impacts.impact[i]:>6}  {impacts.time_s[i]:>8.3f}{cells}")
    if len(impacts) > MOST_ROWS:
        lines.append(f"… and {len(impacts) - MOST_ROWS} more impacts, in impacts.csv.")
    return lines


def _sigma(impacts: "Impacts", name: str) -> Array:
    return impacts.sigma.get(name, np.full(len(impacts), np.nan))


def _speed_sigma(impacts: "Impacts", energy: str, velocity: Array) -> Array:
    """(n,) standard deviation of a speed, from that of the energy ½mv²."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(_sigma(impacts, energy) / (impacts.mass_kg * norm(velocity)))


def _with(value: float, sigma: float, digits: int) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.{digits}f}" + (f" ± {sigma:.{digits}f}" if np.isfinite(sigma) else "")
