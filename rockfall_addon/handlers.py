# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs by itself: trajectories follow their picks, keys follow the frame rate, files are brought up to date."""

import bpy
from bpy.app.handlers import persistent

from .scene import problems
from .scene.footage import footage, sync, timing, video_files
from .scene.models import comparison, graph_settings, motion
from .scene.picks import impact_rows, pick_names, picks
from .scene.storage import appended, defaults, fingerprints, folders, migration, set_aside, store
from .scene.terrain import terrain_mesh
from .view import job, strip, trail_lines
from .view.graphs import editor, impact_sheet, motion_sheet, selection

_owner = object()


@persistent
@problems.guarded
def _follow_rate(scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    _keep_rate(scene)
    footage.follow(scene)


@persistent
@problems.guarded
def _frame_shown(_scene: bpy.types.Scene, _depsgraph: bpy.types.Depsgraph | None = None) -> None:
    """While the scene plays, Blender draws other editors than ours by itself."""
    graph_settings.redraw_of(editor.MOTION)


@persistent
@problems.guarded
def _updated(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    with store.looking(scene):
        _keep_rate(scene)
        footage.follow(scene)
        sync.notice(scene, depsgraph)
        trail_lines.notice(depsgraph)
        _selected_otherwise()


@persistent
@problems.guarded
def _loaded(_path: str, _unused: object = None) -> None:
    terrain_mesh.mistrust()
    video_files.forget_files()
    problems.forget()
    job.forget()
    impact_sheet.forget()
    motion_sheet.forget()
    motion.forget()
    selection.forget()
    strip.forget()
    trail_lines.forget()
    _listen()  # subscriptions do not survive loading
    _catch_up()


@persistent
@problems.guarded
def _restored(scene: bpy.types.Scene, _unused: object = None) -> None:
    """At once: Blender stores a step before the edit is absorbed, and its animation would take the edit back."""
    strip.forget()
    trail_lines.forget()
    terrain_mesh.mistrust()
    folders.put_back()
    _keep_rate(scene)
    footage.follow(scene)
    sync.sync(scene, undone=True)
    comparison.catch_up(scene)
    _selected_otherwise()


@persistent
@problems.guarded
def _saving(_path: str, _unused: object = None) -> None:
    for scene in bpy.data.scenes:
        sync.sync(scene, dragging=sync.is_dragging())
        comparison.catch_up(scene)


@persistent
@problems.guarded
def _imported(context: bpy.types.BlendImportContext, _unused: object = None) -> None:
    """Something was appended or linked: what is of this file now belongs to its scenes."""
    came = {item.id for item in context.import_items if item.id is not None}
    for scene in bpy.data.scenes:
        if "LINK" not in context.options:
            appended.take_in(scene, came)
        sync.touch(scene)


@problems.guarded
def _rate_changed() -> None:
    for scene in bpy.data.scenes:
        _keep_rate(scene)


@problems.guarded
def _units_changed() -> None:
    for scene in bpy.data.scenes:
        sync.touch(scene)


@problems.guarded
def _chosen() -> None:
    obj = impact_rows.selected(bpy.context)
    if obj is not None:
        impact_rows.highlight(bpy.context.scene, obj.get(store.ID, ""))


@problems.guarded
def _catch_up() -> None:
    """Files of older versions, and picks that were changed while nobody watched."""
    if not any(map(migration.is_newer, bpy.data.scenes)):
        folders.remember()
    for scene in bpy.data.scenes:
        migration.migrate(scene)
        defaults.begin(scene)
        if not migration.is_left_alone(scene):
            set_aside.look(scene)  # before anything reads it
            for members in fingerprints.by_trajectory(picks.objects_of(scene)).values():
                pick_names.follow(members)  # before Blender takes its first undo step
        sync.touch(scene)


def _selected_otherwise() -> None:
    """Graphs show what is selected in the scene."""
    selection.notice()
    graph_settings.redraw()
    strip.redraw()


def _keep_rate(scene: bpy.types.Scene) -> None:
    if not migration.is_left_alone(scene) and timing.follow_frame_rate(scene):
        sync.touch(scene)


def _listen() -> None:
    for name in ("fps", "fps_base"):
        bpy.msgbus.subscribe_rna(key=(bpy.types.RenderSettings, name), owner=_owner, args=(), notify=_rate_changed)
    units = (bpy.types.UnitSettings, "scale_length")
    bpy.msgbus.subscribe_rna(key=units, owner=_owner, args=(), notify=_units_changed)
    bpy.msgbus.subscribe_rna(key=(bpy.types.LayerObjects, "active"), owner=_owner, args=(), notify=_chosen)


HANDLERS = (
    ("frame_change_pre", _follow_rate),
    ("frame_change_post", _frame_shown),
    ("depsgraph_update_post", _updated),
    ("render_init", _follow_rate),
    ("load_post", _loaded),
    ("save_pre", _saving),
    ("blend_import_post", _imported),
    ("undo_post", _restored),
    ("redo_post", _restored),
)


def register() -> None:
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).append(function)
    _listen()
    if not bpy.app.background:
        bpy.app.timers.register(_catch_up, first_interval=0.0)
    elif hasattr(bpy.data, "scenes"):  # not while Blender starts
        _catch_up()


def unregister() -> None:
    bpy.msgbus.clear_by_owner(_owner)
    for function in (sync.work, comparison.follow_later, _catch_up):
        if bpy.app.timers.is_registered(function):
            bpy.app.timers.unregister(function)
    for name, function in HANDLERS:
        getattr(bpy.app.handlers, name).remove(function)
