# SPDX-License-Identifier: GPL-3.0-or-later
"""The numbers of the cell under the mouse, on a card beside it."""

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ....core.errors import RockfallError
from ....core.hazard.evidence import FEW
from ....core.hazard.maps import CLASSES_KJ, QUANTITIES, SHARES, Maps
from ....core.terrain.raycast import cast_ray
from ...scene import problems
from ...scene.simulation import hazard_maps, simulation_setup
from ...view import legend
from . import face_overlay, map_overlay

AWAY = 22
"""Between the mouse and the card [px at interface scale 1]."""
FIRST, NEXT = 12.0, 4.4
"""Widths of the first column and of the others, in heights of the text."""

_handles: list[object] = []


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.WindowManager.draw_cursor_add(_draw, (), "VIEW_3D", "WINDOW"))


def unregister() -> None:
    while _handles:
        bpy.types.WindowManager.draw_cursor_remove(_handles.pop())


def card_of(maps: Maps, row: int, column: int) -> tuple[list[str], list[list[str]]]:
    """What stands on the card of a cell: sentences, and the rows of a table, the first of which are its headings."""

    def value(name: str) -> float:
        values = maps.layers.get(name)
        return float("nan") if values is None else float(values[row, column])

    blocks = value("Nr_blocks")
    if not blocks > 0:
        return [f"No block enters this cell of {maps.cells.size_m:g} m."], []
    said = [
        f"{blocks:.0f} of {maps.blocks} blocks enter this cell of {maps.cells.size_m:g} m: "
        f"{value('Reach_probability'):.3g} %",
        f"{value('Nr_passages'):.0f} passages; {np.nan_to_num(value('Nr_deposited')):.0f} blocks stay here",
        "; ".join(f"{value(f'E_over_{limit}kJ'):.3g} % above {limit} kJ" for limit in CLASSES_KJ),
    ]
    said += [f"Fewer than {FEW} blocks: these values say little"] if blocks < FEW else []
    columns = ["mean", *(f"{share}CI" for share in SHARES), "95CI_error", "max"]
    table = [["", "mean", "median", *(f"{share} %" for share in SHARES[1:]), "± (95 %)", "max"]]
    for prefix, (name, unit, _) in QUANTITIES.items():
        found = [value(f"{prefix}_{column}") for column in columns]
        table.append([f"{name} [{unit}]", *("–" if np.isnan(each) else f"{each:.3g}" for each in found)])
    return said, table


def place_under(context: bpy.types.Context, spot: np.ndarray) -> np.ndarray | None:
    """(3,) where the terrain is under a place of the region, local [m]; None beside it."""
    try:
        surface = simulation_setup.ground(context.scene)
    except RockfallError:
        return None
    hit = cast_ray(surface, *_ray(context, spot))
    return hit.point if hit is not None else None


def _ray(context: bpy.types.Context, spot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origin and direction (3,) of the ray through a place of the region, local."""
    region, view = context.region, context.region_data
    origin = np.array(region_2d_to_origin_3d(region, view, Vector(spot)))
    return origin, np.array(region_2d_to_vector_3d(region, view, Vector(spot)))


@problems.guarded
def _draw(mouse: tuple[int, int]) -> None:
    context = bpy.context
    region, scene = context.region, context.scene
    if region is None or context.region_data is None or not scene.rockfall_simulation.probe_map:
        return
    if not map_overlay.is_drawn(context) or context.mode != "OBJECT":
        return
    obj = hazard_maps.maps_of(scene)
    spot = np.array([mouse[0] - region.x, mouse[1] - region.y], dtype=np.float64)
    if obj is None or not ((spot >= 0) & (spot <= (region.width, region.height))).all():
        return
    place = place_under(context, spot)
    faces = face_overlay.shown_faces(scene)
    if faces is not None:
        origin, direction = _ray(context, spot)
        far = np.inf if place is None else float(np.linalg.norm(place - origin))
        row = face_overlay.face_under(faces, origin, direction, far)
        if row >= 0 or place is not None:
            _draw_card(context, mouse, *face_overlay.card_of(faces, row))
        return
    maps = hazard_maps.read(obj)
    cell = None if place is None else hazard_maps.cell_at(maps.cells, place)
    if cell is not None:
        _draw_card(context, mouse, *card_of(maps, *cell))


def _draw_card(context: bpy.types.Context, mouse: tuple[int, int], said: list[str], table: list[list[str]]) -> None:
    scale, theme = context.preferences.system.ui_scale, context.preferences.themes[0].user_interface
    size = legend.TEXT * scale
    step = 1.5 * size
    blf.size(0, size)
    width = max([blf.dimensions(0, words)[0] for words in said])
    if table:
        width = max(width, (FIRST + NEXT * (len(table[0]) - 1)) * size)
    width, height = width + 1.5 * step, (len(said) + len(table) + 0.8) * step
    region, area = context.region, context.area
    least = region.x + legend.covered_left(area)
    most = region.x + region.width - legend.covered_right(area) - width
    left = max(min(mouse[0] + AWAY * scale, most), least)  # beside the mouse as far as there is room, below it always
    low = mouse[1] - AWAY * scale - height
    if low < region.y:
        low = mouse[1] + AWAY * scale
    left, low = round(left), round(low)
    gpu.state.blend_set("ALPHA")
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    shader.uniform_float("color", (*theme.panel_back[:3], 0.95))
    corners = [(left, low), (left + width, low), (left, low + height), (left + width, low + height)]
    batch_for_shader(shader, "TRI_STRIP", {"pos": corners}).draw(shader)
    blf.color(0, *theme.panel_text[:3], 1.0)
    inner, top = left + 0.75 * step, low + height - 1.2 * step
    for i, words in enumerate(said):
        legend.text(round(inner), round(top - i * step), words)
    for i, cells in enumerate(table, start=len(said)):
        y = round(top - i * step)
        legend.text(round(inner), y, cells[0])
        for j, words in enumerate(cells[1:], start=1):
            right = inner + (FIRST + NEXT * j) * size
            legend.text(round(right - blf.dimensions(0, words)[0]), y, words)
    gpu.state.blend_set("NONE")
