# SPDX-License-Identifier: GPL-3.0-or-later
"""The map over the terrain in the 3-D view: each cell in the colour of its class, and the legend."""

import functools
from typing import NamedTuple

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ....core.hazard.classes import Classes, classes_of
from ....core.hazard.evidence import face_evidence
from ....core.hazard.face_tally import FACE_LAYERS
from ....core.hazard.maps import LAYERS, Maps
from ....core.impact_models.registry import MODELS
from ...scene import problems
from ...scene.simulation import hazard_maps, simulation
from ...scene.storage import store
from ...scene.terrain import terrain, terrain_mesh
from ...view import legend
from . import face_overlay

NEARER = 2e-5
"""The map is drawn so much nearer, in depth, that the terrain that it lies on does not speckle it."""
OPACITY = 0.85
WEAK = 0.5
"""Opacity of hatched cells in the texture: it tells them apart, and is not drawn."""
LEGEND_WIDTH = 250
SIMULATION_ROWS = 1.7
"""Height of the title of the legend below, in rows."""
VERTEX = """
void main() {
  place = pos.xy;
  brightness = light;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 1.0);
}
"""
FRAGMENT = (
    face_overlay.LINEAR
    + """
void main() {
  ivec2 cell = ivec2(floor((place - grid.xy) / grid.z));
  ivec2 size = textureSize(map, 0);
  if (cell.x < 0 || cell.y < 0 || cell.x >= size.x || cell.y >= size.y) { discard; }
  vec4 colour = texelFetch(map, cell, 0);
  if (colour.a <= 0.0) { discard; }
  vec3 seen = colour.rgb * (0.45 + 0.55 * brightness);
  bool weak = colour.a < 0.75;
  if (weak && mod(gl_FragCoord.x + gl_FragCoord.y, hatch) < 0.25 * hatch) { seen = vec3(0.05); }
  fragColor = vec4(srgbTarget ? linear(seen) : seen, opacity);
}
"""
)

_handles: list[object] = []
_batches: dict[int, tuple[tuple, gpu.types.GPUBatch]] = {}  # by the mesh: what it was made of
_texture: list["_Painted"] = []


class _Painted(NamedTuple):
    """The colours of a map: a pixel for each of the cells between those that are reached; and where they begin."""

    key: tuple
    texture: gpu.types.GPUTexture
    classes: Classes
    grid: tuple[float, float, float]
    weak: tuple[str, ...]


def register() -> None:
    if bpy.app.background:
        return
    for draw, when in ((_draw_map, "POST_VIEW"), (_draw_legend, "POST_PIXEL")):
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when))


def unregister() -> None:
    _batches.clear()
    _texture.clear()
    face_overlay.unregister()
    _shader.cache_clear()
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def is_drawn(context: bpy.types.Context) -> bool:
    """Whether the 3-D view of the context shows a map."""
    shown = context.scene.rockfall_simulation.show_map and context.space_data.overlay.show_overlays
    return shown and store.has_role(context.scene, store.MAPS_ROLE)


@functools.cache
def _shader() -> gpu.types.GPUShader:
    between = gpu.types.GPUStageInterfaceInfo("map_between")
    between.smooth("VEC2", "place")
    between.smooth("FLOAT", "brightness")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC3", "grid")
    info.push_constant("FLOAT", "opacity")
    info.push_constant("FLOAT", "hatch")
    info.push_constant("BOOL", "srgbTarget")  # Blender sets it: whether the frame buffer takes linear colours
    info.sampler(0, "FLOAT_2D", "map")
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "FLOAT", "light")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "fragColor")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


@problems.guarded
def _draw_map() -> None:
    context = bpy.context
    if not is_drawn(context):
        return
    scene = context.scene
    faces = face_overlay.shown_faces(scene)
    found = hazard_maps.maps_of(scene)
    painted = None if found is None or faces is not None else _painted(scene, found)
    if painted is None and faces is None:
        return
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    with gpu.matrix.push_pop_projection():
        matrix = gpu.matrix.get_projection_matrix()
        matrix[2] -= NEARER * matrix[3]
        gpu.matrix.load_projection_matrix(matrix)
        if faces is not None:
            face_overlay.draw(scene, faces)
        elif painted is not None:
            _draw_cells(scene, painted)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _draw_cells(scene: bpy.types.Scene, painted: _Painted) -> None:
    shader = _shader()
    tiles = [tile for tile in terrain.tiles(scene) if tile.visible_get()]
    meshes = {_drawn_mesh(tile).session_uid for tile in tiles}
    for gone in _batches.keys() - meshes:
        del _batches[gone]
    for tile in tiles:
        batch = _batch_of(tile)
        shader.bind()
        shader.uniform_float("grid", painted.grid)
        shader.uniform_float("opacity", OPACITY)
        shader.uniform_float("hatch", face_overlay.HATCH * bpy.context.preferences.system.ui_scale)
        shader.uniform_sampler("map", painted.texture)
        batch.draw(shader)


def _painted(scene: bpy.types.Scene, obj: bpy.types.Object) -> _Painted | None:
    """The shown map, made once until it is another one."""
    maps, name = hazard_maps.read(obj), scene.rockfall_simulation.map_layer
    values = maps.layers.get(name)
    if values is None:
        return None
    key = obj.data.session_uid, name, maps.cells, maps.blocks
    if not _texture or _texture[0].key != key:
        classes, cells = classes_of(name, values), maps.cells
        rows, columns = _reached(maps)
        evidence = hazard_maps.evidence_of(obj, maps)
        colours = classes.colours_of(values[rows, columns]).astype(np.float32)
        colours[..., 3] *= np.where(evidence.weak[rows, columns], WEAK, 1.0)
        height, width = colours.shape[:2]
        buffer = gpu.types.Buffer("FLOAT", colours.size, np.ascontiguousarray(colours).ravel())
        texture = gpu.types.GPUTexture((width, height), format="RGBA8", data=buffer)
        corner = cells.x0_m + columns.start * cells.size_m, cells.y0_m + rows.start * cells.size_m
        _texture[:] = [_Painted(key, texture, classes, (*corner, cells.size_m), evidence.in_words)]
    return _texture[0]


def _reached(maps: Maps) -> tuple[slice, slice]:
    """The rows and columns that have values in some map."""
    filled = np.zeros(maps.cells.shape, np.bool_)
    for values in maps.layers.values():
        filled |= np.isfinite(values)
    rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    if not rows.size:
        return slice(0, 1), slice(0, 1)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def _drawn_mesh(tile: bpy.types.Object) -> bpy.types.Mesh:
    """The mesh that the 3-D view draws of a tile."""
    other = terrain_mesh.stand_in(tile)
    coarse = other is not None and tile.modifiers[terrain_mesh.MODIFIER].show_viewport
    return (other if coarse else tile).data


def _batch_of(tile: bpy.types.Object) -> gpu.types.GPUBatch:
    """The triangles of a tile where it stands, made once until they change."""
    mesh = _drawn_mesh(tile)
    key = terrain_mesh.contents_of(mesh), tuple(value for row in tile.matrix_world for value in row)
    known = _batches.get(mesh.session_uid)
    if known is None or known[0] != key:
        vertices, faces = terrain_mesh.mesh_arrays(mesh)
        world = np.array(tile.matrix_world)
        placed = (vertices @ world[:3, :3].T + world[:3, 3]).astype(np.float32)
        light = np.ones(len(vertices), np.float32)
        shade = mesh.attributes.get(terrain_mesh.SHADING[0])
        if shade is not None and len(shade.data) == len(light):
            shade.data.foreach_get("value", light)
        values = {"pos": np.ascontiguousarray(placed), "light": light}
        batch = batch_for_shader(_shader(), "TRIS", values, indices=np.ascontiguousarray(faces, np.int32))
        known = _batches[mesh.session_uid] = key, batch
    return known[1]


@problems.guarded
def _draw_legend() -> None:
    context = bpy.context
    scene = context.scene
    if not scene.rockfall.show_legend or not is_drawn(context):
        return
    obj = hazard_maps.maps_of(scene)
    faces, settings = face_overlay.shown_faces(scene), scene.rockfall_simulation
    if obj is None:
        return
    if faces is not None:
        layer, classes = FACE_LAYERS[settings.face_layer], face_overlay.classes(scene, faces)
        weak = face_evidence(faces).in_words
    else:
        painted = _painted(scene, obj)
        layer, classes = LAYERS[settings.map_layer], None if painted is None else painted.classes
        weak = () if painted is None else painted.weak
    if classes is None:
        return
    scale = context.preferences.system.ui_scale
    left = context.region.width - legend.covered_right(context.area) - (LEGEND_WIDTH + legend.MARGIN) * scale
    left = max(left, legend.covered_left(context.area) + legend.MARGIN * scale)
    rows = [(label, tuple(colour)) for label, colour in zip(classes.labels, classes.colours.tolist(), strict=True)]
    rows = [(words, None) for words in weak[::-1]] + rows
    unit = f" [{layer.unit}]" if layer.unit else ""
    blocks = f"{terrain.grouped(int(obj[store.MAP_BLOCKS]))} blocks, {MODELS[str(obj[store.MODEL])].title}"
    blocks += ", with barriers" if hazard_maps.with_barriers(obj) else ""
    state = "; changed since: compute again" if hazard_maps.is_stale(scene) else ""
    legend.begin(scale)
    legend.swatches(left, scale, rows[::-1], f"{layer.title}{unit}; {blocks}{state}", _below(context, scale))
    legend.end()


def _below(context: bpy.types.Context, scale: float) -> float:
    """How high the legend of the simulated paths is, which stands below [px]."""
    paths = simulation.paths_of(context.scene)
    if not paths:
        return 0.0
    settings = context.scene.rockfall_simulation
    by_model = settings.colour_by == "MODEL" or not settings.show_paths
    rows = len(paths) + store.has_role(context.scene, store.BLOCK_ROLE) if by_model else 2
    return (rows + SIMULATION_ROWS) * 1.7 * legend.HEIGHT * scale
