# SPDX-License-Identifier: GPL-3.0-or-later
"""Setting a scene up for a film, and taking the set-up away again."""

import bpy
import numpy as np

from ....core.colours import MEASURED_COLOUR
from ....core.exchange.project import RenderPreset
from ....core.film.engines import IDENTIFIERS
from ....core.film.framing import View, rounded_scale
from ....core.film.job import GraphKind
from ....core.film.presets import FilmTiming
from ....core.film.simulated import Group, LegendEntry, last_moment, legend
from ....core.film.wording import compared_lines, fastest_speed, notes, simulated_lines
from ....core.impact_models.registry import find_model
from ...scene.footage import timing
from ...scene.models import models
from ...scene.picks import trails
from ...scene.simulation import simulation
from ...scene.storage import store
from . import camera, layout, marks, presence, remembered, simulated
from . import graphs as film_graphs
from .engine import use_engine
from .motions import Motion, motions_of

FILM_ROLE = "film"
BLOCK_PX, TRAIL_PX, MARK_PX = 6.0, 2.2, 2.4
"""At least this many pixels of a picture 640 wide: a block, the width of a trail, the radius of an impact's ring."""
SMALL_WIDTH = 640
SOON_S = 0.3
"""So long after a fall begins something of it is seen."""


def set_up_film(scene: bpy.types.Scene, preset: RenderPreset, engine: str, graphs: GraphKind | None = None) -> None:
    """Camera, captions and growing trails for a film of what is in the scene, which is then played frame by frame.

    graphs : which stand beside the slope and follow the time; None for none.

    Raises
    ------
    RockfallError : there is nothing to film.
    """
    _begin(scene, preset, engine)
    film = FilmTiming(preset.fps, preset.time_scale)
    scene.render.fps, scene.render.fps_base = film.base
    scene.render.frame_map_old, scene.render.frame_map_new = film.remap
    timing.follow_frame_rate(scene)
    settings = scene.rockfall
    playback = "REAL" if preset.stagger_s is None else "TOGETHER"
    if settings.playback != playback:
        settings.playback = playback
    if preset.stagger_s is not None and abs(settings.stagger_s - preset.stagger_s) > 1e-6:
        settings.stagger_s = preset.stagger_s

    motions = motions_of(scene)
    view = _view(scene, motions, preset, whole=False, beside=graphs is not None)
    _size_things(scene, motions, view)
    settings.trail_until_now = True
    motions = motions_of(scene)
    groups, real = simulated.groups_of(scene), simulated.measured(scene, motions)
    final = last_moment(float(real.end_s.max(initial=0.0)), groups)
    last = film.last_frame(final)
    scene.frame_start, scene.frame_end = 0, last
    moments = np.arange(last + 1) * film.frame_s
    shown = models.shown_models(scene)
    remarks = notes(settings.block_scale, preset.time_scale, rings=bool(motions))
    subtitle, more = _said(motions, shown, groups)
    words = layout.Words(
        title=_title(scene),
        subtitle=subtitle,
        note="\n".join(filter(None, (more, remarks))),
        speed_top_mps=settings.speed_top_mps if motions and not shown and not groups else None,
        legend=legend(real, groups, moments, final) if groups else _sources(shown),
        time_s=moments,
        fastest_mps=None if groups else fastest_speed([(each.time_s, each.speed_mps) for each in motions], moments),
        rate=1.0 / film.frame_s,
    )
    _show_simulated(scene, until_now=True)
    front = _furnish(scene, view, motions, words, preset)
    if graphs is not None:
        _add_graphs(scene, front, graphs, preset, words.speed_top_mps)
    presence.show_while_moving(scene, motions)
    use_engine(scene, engine)
    begin = min((float(each.time_s[0]) for each in motions), default=0.0)
    scene.frame_set(min(last, int((begin + SOON_S) / film.frame_s)) if begin > 0 else 0)  # a preview shows the block


def set_up_picture(
    scene: bpy.types.Scene, preset: RenderPreset, engine: str, title: str = "", subtitle: str = ""
) -> None:
    """Camera and captions for a still picture of the whole slope, with all trajectories and impacts there are.

    Raises
    ------
    RockfallError : there is nothing to show.
    """
    _begin(scene, preset, engine)
    motions = motions_of(scene)
    view = _view(scene, motions, preset, whole=True)
    _size_things(scene, motions, view)
    scene.rockfall.trail_until_now = False
    motions = motions_of(scene)
    for obj in store.with_role(scene, store.BLOCK_ROLE):
        obj.hide_render = True
    groups, real, shown = simulated.groups_of(scene), simulated.measured(scene, motions), models.shown_models(scene)
    said, more = _said(motions, shown, groups)
    for obj in simulation.blocks_of(scene):
        obj.hide_render = True
    end = np.full(1, np.inf)
    words = layout.Words(
        title=title or _title(scene),
        subtitle=subtitle or said,
        note="\n".join(filter(None, (more if groups else "", notes(rings=bool(motions))))),
        speed_top_mps=scene.rockfall.speed_top_mps if motions and not shown and not groups else None,
        legend=legend(real, groups, end, np.inf) if groups else _sources(shown),
    )
    _show_simulated(scene, until_now=False)
    _furnish(scene, view, motions, words, preset)
    use_engine(scene, engine, still=True)
    scene.frame_set(scene.frame_end)


def remove_film(scene: bpy.types.Scene) -> None:
    """Take the set-up away: the scene is as it was."""
    _remove_furniture(scene)
    presence.show_always(scene)
    for objects in store.by_role(scene, store.PICK_ROLE, store.SET_ASIDE_ROLE, store.BLOCK_ROLE):
        for obj in objects:
            obj.hide_render = False
    simulation.look(scene)
    trails.paint_observed(scene)
    if remembered.is_set_up(scene):
        remembered.put_back(scene)


def _begin(scene: bpy.types.Scene, preset: RenderPreset, engine: str) -> None:
    remembered.remember(scene)
    _remove_furniture(scene)
    render = scene.render
    render.engine = IDENTIFIERS[engine]
    render.resolution_x, render.resolution_y, render.resolution_percentage = preset.width, preset.height, 100


def _view(
    scene: bpy.types.Scene, motions: list[Motion], preset: RenderPreset, whole: bool, beside: bool = False
) -> View:
    aspect = preset.width / preset.height
    if preset.camera is not None:
        return camera.given_view(scene, preset.camera, aspect)
    return camera.automatic_view(scene, motions, aspect, whole, simulated.points_of(scene), beside_graphs=beside)


def _size_things(scene: bpy.types.Scene, motions: list[Motion], view: View) -> None:
    """Blocks and trails large enough to be seen from the camera."""
    blocks = store.with_role(scene, store.BLOCK_ROLE)
    if not motions or not blocks:
        return
    settings = scene.rockfall
    pixel = _pixel_m(scene, view, motions)
    diameter = float(np.median([2 * np.mean(obj.scale) for obj in blocks])) / settings.block_scale
    before = remembered.value(scene, "rockfall.block_scale")
    scale = max(before, rounded_scale(BLOCK_PX * pixel / diameter))
    if abs(settings.block_scale - scale) > 1e-6:
        settings.block_scale = scale
    settings.trail_radius_m = max(remembered.value(scene, "rockfall.trail_radius_m"), TRAIL_PX * pixel / 2)
    simulation.follow(scene)


def _furnish(
    scene: bpy.types.Scene, view: View, motions: list[Motion], words: layout.Words, preset: RenderPreset
) -> bpy.types.Object:
    """Camera, backdrop and captions, all moving with the camera; rings in place of the marks of the picks.

    Returns the sheet of the captions.
    """
    for obj in store.with_role(scene, store.PICK_ROLE) + store.with_role(scene, store.SET_ASIDE_ROLE):
        obj.hide_render = True
    if motions:
        radius = max(scene.rockfall.marker_radius_m, MARK_PX * _pixel_m(scene, view, motions))
        rings = marks.impact_marks(scene, radius)
        if rings is not None:
            _add(scene, rings)
    aspect = preset.width / preset.height
    eye = camera.add_camera(scene, view, camera.scene_points(scene, motions))
    _add(scene, eye)
    scene.camera = eye
    front = _sheet(scene, "Film captions", eye, 2.5 * eye.data.clip_start, aspect)
    for obj in layout.lay_out(words, aspect, preset.height):
        _add(scene, obj)
        obj.parent = front
    behind = _sheet(scene, "Film background", eye, 0.98 * eye.data.clip_end, aspect)
    curtain = layout.backdrop(1.02 * aspect)
    curtain.scale.y = 1.02
    _add(scene, curtain)
    curtain.parent = behind
    curtain.hide_viewport = True
    if scene.render.engine == "CYCLES":
        _keep_search_tree(scene, eye)
    return front


def _add_graphs(
    scene: bpy.types.Scene,
    front: bpy.types.Object,
    kind: GraphKind,
    preset: RenderPreset,
    speed_top_mps: float | None,
) -> None:
    """Graphs that follow the time, on the sheet of the captions."""
    size = preset.width, preset.height
    made = film_graphs.graphs_of(scene, kind, size, speed_top_mps)
    for obj in film_graphs.lay_out(made, size, timing.frame_rate(scene)):
        _add(scene, obj)
        obj.parent = front


def _keep_search_tree(scene: bpy.types.Scene, eye: bpy.types.Object) -> None:
    """A tiny second user of the terrain's mesh behind the camera.

    Cycles puts all meshes that are used once into one search tree, which it builds anew when a block moves. A mesh that
    is used twice keeps a tree of its own.
    """
    for ground in store.with_role(scene, store.TERRAIN_ROLE):
        twin = bpy.data.objects.new("Film twin of the terrain", ground.data)
        twin.scale, twin.location = (1e-4, 1e-4, 1e-4), (0.0, 0.0, 1.0)
        _add(scene, twin)
        twin.parent = eye
        twin.hide_viewport = True


def _sheet(
    scene: bpy.types.Scene, name: str, eye: bpy.types.Object, distance: float, aspect: float
) -> bpy.types.Object:
    """An empty before the camera in which the picture is one unit high, whatever the focal length becomes."""
    sheet = bpy.data.objects.new(name, None)
    sheet.empty_display_size = 0.01
    _add(scene, sheet)
    sheet.parent = eye
    sheet.location = (0.0, 0.0, -distance)
    for axis in range(3):
        driver = sheet.driver_add("scale", axis).driver
        lens = driver.variables.new()
        lens.name, lens.targets[0].id_type = "lens", "CAMERA"
        lens.targets[0].id, lens.targets[0].data_path = eye.data, "lens"
        driver.expression = f"{distance * eye.data.sensor_width / aspect!r} / lens"
    return sheet


def _add(scene: bpy.types.Scene, obj: bpy.types.Object) -> None:
    obj[store.ROLE] = FILM_ROLE
    obj.hide_select = obj.type != "CAMERA"
    store.collection(scene, "Film").objects.link(obj)


def _remove_furniture(scene: bpy.types.Scene) -> None:
    objects = store.with_role(scene, FILM_ROLE)
    cameras = [obj.data for obj in objects if obj.type == "CAMERA"]
    store.remove_objects(objects)
    for each in cameras:
        if not each.users:
            bpy.data.cameras.remove(each)


def _pixel_m(scene: bpy.types.Scene, view: View, motions: list[Motion]) -> float:
    """Size of a pixel of a small picture where the blocks are [m]; in a large one, things may be a little finer."""
    depth = float(np.median(view.project(np.vstack([motion.position for motion in motions]))[:, 2]))
    return float(view.pixel_m(depth, (SMALL_WIDTH * max(SMALL_WIDTH, scene.render.resolution_x)) ** 0.5))


def _show_simulated(scene: bpy.types.Scene, *, until_now: bool) -> None:
    """Thin paths in place of those of the step, and the measured flights in one colour beside simulated ones."""
    for obj in simulated.make_paths(scene, simulated.PATH_PART * scene.rockfall.trail_radius_m, until_now=until_now):
        _add(scene, obj)
    for obj in simulation.paths_of(scene):
        obj.hide_render = True
    if simulated.groups_of(scene):
        trails.paint_observed(scene, plain=True)


def _sources(names: tuple[str, ...]) -> tuple[LegendEntry, ...]:
    """Whose blocks there are, when there are others than the real ones."""
    if not names:
        return ()
    known = [find_model(name) for name in names]
    return LegendEntry("measured", MEASURED_COLOUR), *(LegendEntry(model.title, model.colour) for model in known)


def _said(motions: list[Motion], shown: tuple[str, ...], groups: list[Group]) -> tuple[str, str]:
    """Two lines on what is seen."""
    if groups:
        return simulated_lines(len(motions), len(groups))
    return compared_lines(len(shown)) if shown else (_count(motions), "")


def _title(scene: bpy.types.Scene) -> str:
    return str(scene.get(store.SITE, "")) or "Rockfall"


def _count(motions: list[Motion]) -> str:
    if not motions:
        return ""
    return f"Reconstructed paths of {len(motions)} block{'' if len(motions) == 1 else 's'}"
