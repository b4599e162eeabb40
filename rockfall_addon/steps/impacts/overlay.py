# SPDX-License-Identifier: GPL-3.0-or-later
"""Over the 3-D views: the blocks, ringed and named where they are too small to be seen, and the card of the selected
impact beside its ring. They are drawn after what is drawn over the footage."""

import bpy
import gpu
import numpy as np

from ....core.analysis.graph_layout import Rectangle
from ...scene import problems
from ...scene.picks import picks
from ...scene.storage import store
from ...view import impact_words, pointing
from ...view.graphs import drawing
from ...view.graphs.look import Look, look
from ...view.workspace import free_part

BLOCK, PICK = 16.0, 22.0
"""Diameters of the rings at interface scale 1 [px]; a block that is larger on the screen has none."""
MOST_NAMES = 12
DARK = (0.02, 0.02, 0.02)
OVER_ALL = True
"""The card of an impact is read, whatever legend is there."""

_handles: list[object] = []


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


@problems.guarded
def _draw() -> None:
    context = bpy.context
    if not context.space_data.overlay.show_overlays or not store.has_role(context.scene, store.PICK_ROLE):
        return
    seen = look(context)
    left, bottom, right, top = free_part(context.area, context.region)
    room = Rectangle(left, bottom, max(right - left, 1), max(top - bottom, 1))
    _draw_blocks(context, seen, room)
    pick = pointing.active_pick(context)
    if pick is not None:
        _draw_card(context, pick, seen, room)
    gpu.state.blend_set("NONE")


def _draw_blocks(context: bpy.types.Context, seen: Look, room: Rectangle) -> None:
    """A ring about each block that falls, and its name beside it."""
    if pointing.solved_camera_of(context) is not None:
        return  # over footage its outline is drawn in its pixels
    blocks = [obj for obj in store.with_role(context.scene, store.BLOCK_ROLE) if obj.visible_get()]
    if not blocks:
        return
    centres = np.array([obj.matrix_world.translation for obj in blocks])
    places = pointing.on_screen(context, centres)
    ring, per_m = BLOCK * seen.scale, _pixels_per_metre(context, centres)
    radius = np.array([max(obj.dimensions) / 2 for obj in blocks])
    small = np.isfinite(places[:, 0]) & (2 * radius * per_m < ring)
    region = (room.left, room.bottom, room.right, room.top)
    for colour, width in ((DARK, ring + 3 * seen.scale), ((1.0, 1.0, 1.0), ring)):
        drawing.Points(places[small], colour, 1.0, "ring").draw(width, region)
    if len(blocks) > MOST_NAMES:
        return
    for obj, place in zip(blocks, places, strict=True):
        if np.isfinite(place[0]) and room.holds(*place):
            x, y = place[0] + 0.7 * ring, place[1] + 0.5 * ring
            for dx, colour in ((1, DARK), (0, (1.0, 1.0, 1.0))):  # readable on bright and on dark slopes
                drawing.text(x + dx, y - dx, obj.get(store.TRAJECTORY, ""), seen.text, colour)


def _pixels_per_metre(context: bpy.types.Context, points: np.ndarray) -> np.ndarray:
    """How large a metre is on the screen at points (n, 3)."""
    view = context.region_data
    along = np.c_[points, np.ones(len(points))] @ np.array(view.perspective_matrix)[3]
    with np.errstate(divide="ignore"):
        return abs(view.window_matrix[0][0]) * context.region.width / 2 / np.abs(along)


def _draw_card(context: bpy.types.Context, pick: bpy.types.Object, seen: Look, room: Rectangle) -> None:
    """The ring of the selected pick, and its numbers; why it should be looked at."""
    where = pick.location if picks.moved(pick) else pick[store.POSITION]
    place = pointing.on_screen(context, np.array([list(where)]))
    if not np.isfinite(place).all() or not room.holds(*place[0]):
        return
    region = (room.left, room.bottom, room.right, room.top)
    colour = seen.chosen
    for each, width in ((DARK, (PICK + 3) * seen.scale), (colour, PICK * seen.scale)):
        drawing.Points(place, each, 1.0, "ring").draw(width, region)
    rows = [impact_words.title(pick), *impact_words.numbers(pick)]
    rows += [f"\N{WARNING SIGN} {reason}" for reason in impact_words.reasons(pick)]
    drawing.card((place[0, 0] + 6 * seen.scale, place[0, 1] + 6 * seen.scale), rows, seen, room)
