# SPDX-License-Identifier: GPL-3.0-or-later
"""Which impacts are selected: the scene's own as their objects are, those of other sites by file and row."""

import bpy

from ...scene.models import comparison, graph_settings
from ...scene.picks import impact_rows, picks
from ...scene.storage import store

Chosen = frozenset[tuple[int, int]]
"""(source, row): source 0 for the scene's own impacts, i for the i-th other table."""

_kept: dict[int, tuple[object, Chosen]] = {}  # session_uid of a scene → what it was found for, and what was found
_changes = [0]


def notice() -> None:
    """Something may be selected otherwise, or another scene's objects be there."""
    _changes[0] += 1


def forget() -> None:
    """Another file was opened."""
    _kept.clear()
    notice()


def selected(context: bpy.types.Context) -> Chosen:
    """What is selected."""
    scene, compared = context.scene, comparison.comparison_of(context.scene)
    key = _changes[0], compared.version, context.view_layer.name, scene.get(store.GRAPH_CHOSEN)
    if scene.session_uid not in _kept or _kept[scene.session_uid][0] != key:
        _kept[scene.session_uid] = key, _find(context, compared)
    return _kept[scene.session_uid][1]


def active(context: bpy.types.Context) -> tuple[int, int] | None:
    """The impact of the active object."""
    obj = impact_rows.selected(context)
    if obj is None or not obj.select_get():
        return None
    rows = comparison.comparison_of(context.scene).pick
    identifier = obj.get(store.ID)
    return (0, rows.index(identifier)) if identifier in rows else None


def select(context: bpy.types.Context, chosen: Chosen, active: tuple[int, int] | None = None) -> None:
    """Select these impacts and no other objects; the active one's object becomes the active object."""
    scene, layer, compared = context.scene, context.view_layer, comparison.comparison_of(context.scene)
    wanted = {compared.pick[row] for source, row in chosen if source == 0 and row < len(compared.pick)} - {""}
    here = {obj.get(store.ID): obj for obj in picks.objects_of(scene) if obj.name in layer.objects}
    for obj in list(layer.objects.selected):
        if obj.get(store.ID) not in wanted:
            obj.select_set(False)
    for identifier in wanted:
        if identifier in here:
            here[identifier].select_set(True)
    if active is not None and active[0] == 0:
        layer.objects.active = here.get(compared.pick[active[1]], layer.objects.active)
    elsewhere = frozenset((str(compared.others[source - 1].path), row) for source, row in chosen if source > 0)
    graph_settings.choose_elsewhere(scene, elsewhere)
    notice()


def go_to(context: bpy.types.Context, row: int) -> None:
    """Go to the moment of one of the scene's own impacts."""
    compared = comparison.comparison_of(context.scene)
    obj = picks.with_id(context.scene, compared.pick[row])
    frame = None if obj is None else obj.get(store.KEY_FRAME)
    if frame is not None:
        context.scene.frame_set(int(frame // 1), subframe=float(frame % 1))


def _find(context: bpy.types.Context, compared: comparison.SceneComparison) -> Chosen:
    chosen = context.view_layer.objects.selected
    ids = {obj.get(store.ID) for obj in chosen if obj.get(store.ROLE) == store.PICK_ROLE and store.is_own(obj)}
    found = {(0, row) for row, identifier in enumerate(compared.pick) if identifier in ids} if ids else set()
    sources = {str(one.path): i + 1 for i, one in enumerate(compared.others)}
    found |= {(sources[path], row) for path, row in graph_settings.chosen_elsewhere(context.scene) if path in sources}
    return frozenset(found)
