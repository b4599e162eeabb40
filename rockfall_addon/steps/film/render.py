# SPDX-License-Identifier: GPL-3.0-or-later
"""Rendering a scene that is set up, and whole jobs from a project file to a film."""

from pathlib import Path

import bpy

from ....core.errors import InputError, RockfallError
from ....core.exchange.project import Project, RenderPreset, read_project
from ....core.film.check import check_film, check_picture
from ....core.film.engines import MEASURED
from ....core.film.falls import fall_beside
from ....core.film.job import BLEND, FilmJob
from ....core.film.maker import FilmMaker, inside_blender
from ....core.film.presets import HD, FilmTiming, find_preset
from ....core.progress import Progress
from ....core.reconstruction.trajectory import Reconstruction
from ....core.simulation.measured_releases import start_times
from ....core.workflow.opening import camera_remarks
from ....core.workflow.simulation import remarks_of
from ...scene import models, problems, simulation
from ...scene.project import load_project
from . import dressing, encoding, saved
from .engine import engine_of, use_engine
from .quicker import use_quicker


def make(job: FilmJob, progress: Progress) -> tuple[str, ...]:
    """Do a job in an empty file, which is filled, or in that of a .blend; returns what a user should know of it.

    Raises
    ------
    RockfallError : the project is bad, has nothing to show, or the file cannot be written.
    """
    scene, remarks = bpy.context.scene, ()
    measured, job = job.engine == MEASURED, job.with_engine("cycles") if job.engine == MEASURED else job
    if job.kind == "frames":
        encoding.encode(job, progress)
        return remarks
    if job.kind == "composed":
        return _compose(job, progress)
    if job.source.suffix.lower() == BLEND:
        scene = saved.open_film(job)
        remarks = tuple(map(str, problems.of_cameras(scene)))
    elif job.kind == "terrain":
        _show_terrain(scene, job)
    else:
        project = read_project(job.source)
        preset = find_preset(project, job.preset)
        result = _load(scene, job.source, preset)
        remarks = tuple(map(str, camera_remarks(project)))
        if job.models:
            models.show_models(scene, result, job.models, job.parameters)
        if job.simulate:
            remarks = (*remarks, *_simulate(scene, job, project, result, progress))
        if job.kind == "slope":
            dressing.set_up_picture(scene, preset, job.engine)
        else:
            dressing.set_up_film(scene, preset, job.engine, job.graphs)
    if job.kind == "film" and measured:
        progress("Measuring which engine is quicker", 0, 0)
        first, last = job.frames or (scene.frame_start, scene.frame_end)
        said = use_quicker(scene, first, min(last, scene.frame_end))
        remarks = (*remarks, *([said] if said else []))
    if job.kind == "film":
        render_film(scene, job.out, job.frames, progress)
    else:
        if job.kind == "still":
            use_engine(scene, engine_of(scene), still=True)
            scene.frame_set(min(job.frames[0] if job.frames else scene.frame_end, scene.frame_end))
        render_picture(scene, job.out)
        progress("Rendering", 1, 1)
    return remarks


def _compose(job: FilmJob, progress: Progress) -> tuple[str, ...]:
    """Draw a film of a project, which this Blender encodes."""
    from ....core.film.composed.making import make_film
    from ....core.film.composed.request import FilmRequest

    token = inside_blender.set(FilmMaker(make, ()))
    try:
        return make_film(
            FilmRequest.from_json(job.request), job.out.parent, name=job.out.stem, codec=job.codec, progress=progress
        ).remarks
    finally:
        inside_blender.reset(token)


def render_film(scene: bpy.types.Scene, path: Path, frames: tuple[int, int] | None, progress: Progress) -> None:
    """Render frames of a scene to an MP4 with H.264.

    Raises
    ------
    RockfallError : the range lies outside the film, or the file is not whole.
    """
    first, last = frames or (scene.frame_start, scene.frame_end)
    if first > scene.frame_end:
        raise InputError(f"The film has no frame {first}", advice=f"Its last frame is {scene.frame_end}")
    scene.frame_start, scene.frame_end = first, min(last, scene.frame_end)
    encoding.use_movie(scene, path)
    total, done = scene.frame_end - first + 1, 0

    def written(*_: object) -> None:
        nonlocal done
        done += 1
        progress("Rendering", done, total)

    bpy.app.handlers.render_write.append(written)
    try:
        bpy.ops.render.render(animation=True, scene=scene.name)
    except RuntimeError as error:
        raise RockfallError(f"Blender could not render the film: {error}") from error
    finally:
        bpy.app.handlers.render_write.remove(written)
    if done != total:
        raise RockfallError(f"Blender rendered {done} of {total} frames of the film.")
    check_film(path, total, _size(scene), progress)


def render_picture(scene: bpy.types.Scene, path: Path) -> None:
    """Render the scene's frame to a PNG.

    Raises
    ------
    RockfallError : the file is not whole.
    """
    render = scene.render
    render.filepath, render.use_file_extension = str(path), True
    render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_mode = "PNG", "RGB"
    try:
        bpy.ops.render.render(write_still=True, scene=scene.name)
    except RuntimeError as error:
        raise RockfallError(f"Blender could not render the picture: {error}") from error
    check_picture(path, _size(scene))


def _load(scene: bpy.types.Scene, project: Path, preset: RenderPreset) -> Reconstruction:
    film, settings = FilmTiming(preset.fps, preset.time_scale), scene.rockfall
    scene.render.fps, scene.render.fps_base = film.base
    settings.playback = "REAL" if preset.stagger_s is None else "TOGETHER"
    settings.stagger_s = preset.stagger_s or 0.0
    return load_project(scene, project, with_videos=False)


def _simulate(
    scene: bpy.types.Scene, job: FilmJob, project: Project, result: Reconstruction, progress: Progress
) -> tuple[str, ...]:
    """Let blocks fall from the starts of the measured ones, and show them; returns what became of them."""
    starts = {name: simulation.Origin(name, time_s) for name, time_s in start_times(result).items()}
    simulations = fall_beside(job, project, len(starts), progress)
    simulation.show(scene, simulations, starts)
    return tuple(map(str, remarks_of(simulations)))


def _show_terrain(scene: bpy.types.Scene, job: FilmJob) -> None:
    from ....core.terrain.readers import read_terrain
    from ....core.terrain.shading import shade, thin_share
    from ...scene.terrain import add_terrain

    surface = read_terrain(job.source, up=job.up, unit_m=job.unit_m)
    shading = shade(surface)
    add_terrain(scene, surface, shading)
    size = " × ".join(f"{length:.0f}" for length in surface.bounds[1] - surface.bounds[0])
    facts = f"{len(surface.faces):,} triangles, {size} m"
    if shading.thin.any():
        facts += f", thin data on {100 * thin_share(surface, shading):.0f} % of it"
    dressing.set_up_picture(scene, HD, job.engine, title=job.title or job.source.name, subtitle=facts)


def _size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height of what is rendered [px]."""
    render = scene.render
    return tuple(side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y))
