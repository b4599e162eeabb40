# SPDX-License-Identifier: GPL-3.0-or-later
"""Every name under which the .blend keeps something of ours, and the objects by their role.

All of it is stored in ID properties: they hold doubles, are saved in the file and follow undo. The spelling on the
right is what saved files contain and never changes; `migration` says what is done when the meaning does.
"""

import json
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ....core.errors import InputError

# of any object
ROLE, ID = "rockfall_role", "rockfall_id"
TERRAIN_ROLE, COARSE_VIEW_ROLE = "terrain", "terrain_view"
LEFT_OUT_ROLE = "left_out"  # points of a cloud that the ground filter took for vegetation: for eyes only
PICK_ROLE, BLOCK_ROLE, FLIGHTS_ROLE = "pick", "block", "flights"
SET_ASIDE_ROLE = "pick_set_aside"  # a pick that cannot be used, until it is corrected
MODEL_BLOCK_ROLE, MODEL_FLIGHTS_ROLE = "twin", "twin_flights"
SIMULATED_BLOCKS_ROLE, SIMULATED_PATHS_ROLE = "simulated_blocks", "simulated_paths"
SIMULATED_TREES_ROLE = "simulated_trees"  # the stems that the shown blocks met
SIMULATED_PATTERN_ROLE = "simulated_pattern"  # the block whose mesh the simulated ones show
MAPS_ROLE = "maps"  # of what passes through the cells of the terrain, of many runs
FACE_MAPS_ROLE = "face_maps"  # of the faces of the terrain and its structures, beside the others
RELEASE_ROLE = "release"  # a drawn line, area or points
STRUCTURE_ROLE = "structure"  # a mesh that blocks meet beside the terrain
SCREEN_ROLE = "screen"  # a line at which passing blocks are measured or held
CAMERA_ROLE = "camera"
SET_ASIDE = "rockfall_set_aside"  # of scenes, picks and actions: values that cannot be used, by their keys
HAS_SET_ASIDE = "rockfall_has_set_aside"  # of the scene: whether picks or values are
COLLECTION_NAME = "rockfall_name"  # of a collection: a person may rename it
HANGS_IN = "rockfall_hangs_in"  # of a collection: the session's numbers of those that it is in

# of the scene: the project
SCHEMA = "rockfall_schema"
SHIFT, CRS, VERTICAL = "rockfall_shift_m", "rockfall_crs", "rockfall_vertical_datum"
SITE, SITE_DESCRIPTION, SITE_MORE = "rockfall_site", "rockfall_site_description", "rockfall_site_more"
PICKS_SOURCE = "rockfall_picks_source"
RENDER_PRESETS = "rockfall_render_presets"
BEFORE_FILM = "rockfall_film_before"
FILM_FILE, FILM_OF = "rockfall_film_file", "rockfall_film_of"  # the latter: fingerprint of what it shows
WORKSPACE, GRAPHS_WORKSPACE = "rockfall_workspace", "rockfall_graphs_workspace"  # of the workspaces

# of the scene: how trajectories are computed
GRAVITY, NORMAL_RADIUS = "rockfall_gravity_mps2", "rockfall_normal_radius_m"
DEFAULT_BLOCK = "rockfall_default_block"  # d1, d2, d3, density
BLOCKS = "rockfall_blocks"  # d1, d2, d3, density and, unless it is an ellipsoid, shape by trajectory, as text
DRAG = "rockfall_drag"  # density of air, drag coefficient
TIME_ORIGIN, OFFSETS = "rockfall_time_origin_s", "rockfall_offsets_s"
KEYED_RATE, TICK_RATE = "rockfall_keyed_rate_hz", "rockfall_tick_rate_hz"

# of the scene: what is shown
SHOWN = "rockfall_shown"  # fingerprint of each trajectory
GROUND, GROUND_CONTENTS = "rockfall_ground", "rockfall_ground_contents"  # fingerprints; 0.1.0 had the first only
PROBLEM, TRAJECTORY_PROBLEMS = "rockfall_problem", "rockfall_trajectory_problems"
SHOWN_MODELS, MODEL_PARAMETERS = "rockfall_twin_models", "rockfall_model_parameters"
OTHER_PARAMETERS = "rockfall_model_parameters_b"  # of the models: the second set, for the graphs
MODEL = "rockfall_model"  # of what a model predicts
LANE = "rockfall_lane"  # of a model's block: number among those of a trajectory
GRAPH_CHOSEN = "rockfall_graph_chosen"  # impacts of other sites that are selected: file → rows, as text
FIT = "rockfall_fit"  # what a calibration has found and proposes, as text
MOTION_LIMITS = "rockfall_motion_limits"  # of the axes of motion graphs, as text
SIMULATION = "rockfall_simulation_shown"  # what was simulated, as text
BACK_ANALYSIS = "rockfall_back_analysis"  # the posterior of a back-analysis, as text
AT_SCREENS = "screens"  # in it: what was found at each screen
BACKGROUND = "rockfall_background"  # of a camera: what was noticed of its video's background, as text
MASS, TOP_SPEED, STALE = "rockfall_mass_kg", "rockfall_top_speed_mps", "rockfall_stale"  # of blocks and flights
BLOCK_SHOWN = "rockfall_block_shown"  # of flights: the block that they were computed with, as text

# of simulated blocks and paths
ENDS = "rockfall_ends"  # of paths: the ways to end, as text
RELEASES = "rockfall_releases"  # name, trajectory and clock time of each, as text

# of maps
MAP_CELLS = "rockfall_map_cells"  # south-west corner, size, columns, rows
MAP_BLOCKS = "rockfall_map_blocks"  # how many blocks they are of
MAP_OF = "rockfall_map_of"  # of what they were computed, and what there is to say of them, as text

# of a pick; blocks and flights have the trajectory, too
TRAJECTORY, TIME, POSITION = "rockfall_trajectory", "rockfall_time_s", "rockfall_position_m"
NORMAL, SPIN = "rockfall_normal", "rockfall_angular_velocity_radps"
KIND, STATUS = "rockfall_kind", "rockfall_status"
SIGMA_TIME, SIGMA_POSITION = "rockfall_sigma_time_s", "rockfall_sigma_position_m"
ROW, EXTRA = "rockfall_row", "rockfall_extra"  # where it stood in a table, and the table's other columns
KEY_FRAME, PICK_SHIFT = "rockfall_key_frame", "rockfall_pick_shift_m"
SEEN = "rockfall_seen"  # id of a video → frame and pixel in it
RESULT, FLAGS = "rockfall_result", "rockfall_flags"  # of its impact, see `impact_numbers`
MEASURED_SPIN = "rockfall_measured_spin"  # of the flight that ends here, from marks in videos, as text

# of picks, of what is shown of a run, and of the actions of both; 0.1.0 had none of these
WRITTEN = "rockfall_written"  # how often something was written: the older of two was brought back by an undo
PRINT = "rockfall_print"  # fingerprint of the picks that this shows
BLOCK_KEYS = "rockfall_block_keys"  # of a block's action: frame, place and pick of each key, as text

# of a tile of the terrain
TERRAIN_FILE, TERRAIN_SUMMARY = "rockfall_file", "rockfall_summary"
THIN_SHARE, REACH = "rockfall_thin_share", "rockfall_reach_m"
STANDING_OUT = "rockfall_standing_out"
TURNED = "rockfall_turned"  # its file has y up
FOOTAGE_OF = "rockfall_footage_of"  # id of a video's camera → digest of where it stood when it coloured the tile
COARSE_VIEW_OF = "rockfall_view_of"  # of the full mesh: vertices, triangles, triangles that were wanted, checksums

# of the scene: its videos
SPIN_REMARKS = "rockfall_spin_remarks"  # trajectory → marks that are in no flight, as text
KNOWN_VIDEOS, ACTIVE_CAMERA = (
    "rockfall_known_videos",
    "rockfall_active_camera",
)  # id → file of the cameras it has had: tells a deletion
EVENTS, EVENTS_FILE = "rockfall_events", "rockfall_events_file"
SYNCHRONISED, REFERENCE_CAMERA = "rockfall_synchronised", "rockfall_reference_camera"

# of a camera: its video
VIDEO_FILE, VIDEO_FACTS = "rockfall_video_file", "rockfall_video_facts"
VIDEO_TIMES, VIDEO_SIZE = "rockfall_video_times_s", "rockfall_video_size"
CLOCK, CAPTURE_RATE, ROW_TIME = "rockfall_clock", "rockfall_capture_rate_hz", "rockfall_row_time_s"
IMAGE_BLEND = "rockfall_blend"  # that comes back when the wipe ends
STILL = "rockfall_still"  # of an image: the number of the picture that it holds

# of a camera: where it stood and how it looked
CAMERA, SOLVED, RMSE = "rockfall_camera", "rockfall_solved", "rockfall_rmse_px"
CAMERA_QUALITY = "rockfall_camera_quality"  # what it was solved from, JSON
POSE_TIMES, POSES = "rockfall_pose_times_s", "rockfall_poses"
POSE_SIGMA, POSE_COVARIANCE = "rockfall_pose_sigma", "rockfall_pose_covariance"
CAMERA_SHIFT, ASPECT, REFERENCE_POSE = "rockfall_camera_shift_m", "rockfall_aspect", "rockfall_reference_pose"
CAMERA_KEYED = "rockfall_camera_keyed"  # clock, origin and rate that its keys were written with
PAIRS, OPEN_PAIR, SOLUTION = "rockfall_pairs", "rockfall_open_pair", "rockfall_solution"
KNOWN_LENS, PLACED, FOLLOWED = "rockfall_known_lens", "rockfall_placed", "rockfall_followed"

# of a camera: where a block is seen, and what its refinement proposes
TRACK_NAMES, TRACK_ROWS = "rockfall_track_names", "rockfall_track"
SPIN_MARK_NAMES, SPIN_MARK_ROWS = "rockfall_spin_mark_names", "rockfall_spin_marks"  # of one point of a block
PROPOSAL, PROPOSAL_PATH = "rockfall_proposal", "rockfall_proposal_path"
PROPOSAL_ROWS, PROPOSAL_POSES = "rockfall_proposal_rows", "rockfall_proposal_poses"


def double(value: float) -> float:
    """The double nearest to what the user typed into a single-precision property (0.35, not 0.3499999940)."""
    return float(f"{value:.7g}")


def read_json(holder: bpy.types.ID, key: str, empty: Any) -> Any:
    """What is kept as text; `empty` where there is none.

    Raises
    ------
    RockfallError : it cannot be read. `set_aside` puts such a text aside when a file is opened.
    """
    text = holder.get(key)
    if text is None:
        return empty
    try:
        return json.loads(text)
    except (TypeError, ValueError) as error:
        problem = f"{key} of {holder.name} cannot be read: it was changed from outside"
        raise InputError(problem, advice="Save the file and open it again: it is set aside then") from error


_Table = dict[tuple[str, str | None], list[bpy.types.Object]]
_comings = [0]
_tables: dict[int, _Table | None] = {}  # session_uid of a scene → what `looking` has found, None before


@contextmanager
def looking(scene: bpy.types.Scene) -> Iterator[None]:
    """Inside, the objects of a scene are gone through once, and again only after some of ours came or went."""
    if scene.session_uid in _tables:
        yield
        return
    _tables[scene.session_uid] = None
    try:
        yield
    finally:
        del _tables[scene.session_uid]


def look_again() -> None:
    """Objects of ours came or went."""
    _tables.update(dict.fromkeys(_tables))


def comings() -> tuple[int, ...]:
    """Numbers of which one differs between two moments when objects of ours, or their data, came or went."""
    return _comings[0], len(bpy.data.meshes), len(bpy.data.actions), len(bpy.data.materials), len(bpy.data.node_groups)


def is_own(obj: bpy.types.ID) -> bool:
    """Whether a data-block is of this file: what is linked from another one, or overrides that, is not written to."""
    return obj.library is None and obj.override_library is None


def linked_files(scene: bpy.types.Scene) -> dict[str, int]:
    """Paths of other files → how many objects of ours the scene shows of them."""
    found: dict[str, int] = {}
    for obj in scene.objects if bpy.data.libraries else ():
        if isinstance(obj.get(ROLE), str) and not is_own(obj):
            reference = obj if obj.library is not None else obj.override_library.reference
            library = reference.library if reference is not None else None
            path = library.filepath if library is not None else ""
            found[path] = found.get(path, 0) + 1
    return found


def of_role(scene: bpy.types.Scene, role: str, trajectory: str | None = None) -> list[bpy.types.Object]:
    """The scene's objects of one role, all or those of a trajectory, in no order."""
    key = scene.session_uid
    if role == CAMERA_ROLE and _tables.get(key) is None:  # asked at every change: a type is read four times as quickly
        return [o for o in scene.objects if o.type == "CAMERA" and o.get(ROLE) == role and is_own(o)]
    if key not in _tables:
        found = (o for o in scene.objects if o.get(ROLE) == role and is_own(o))
        return [o for o in found if trajectory is None or o.get(TRAJECTORY) == trajectory]
    if _tables[key] is None:
        _tables[key] = _table(scene)
    return list(_tables[key].get((role, trajectory), ()))


def _table(scene: bpy.types.Scene) -> _Table:
    table: _Table = {}
    for obj in scene.objects:
        role = obj.get(ROLE)
        if isinstance(role, str) and is_own(obj):
            table.setdefault((role, None), []).append(obj)
            name = obj.get(TRAJECTORY)
            if isinstance(name, str):
                table.setdefault((role, name), []).append(obj)
    return table


def trajectories_of(scene: bpy.types.Scene, role: str) -> set[str]:
    """The trajectories of which the scene has objects of a role."""
    if scene.session_uid not in _tables:
        return {name for obj in of_role(scene, role) if isinstance(name := obj.get(TRAJECTORY), str)}
    of_role(scene, role)
    return {name for each, name in _tables[scene.session_uid] if each == role and name is not None}


def with_role(scene: bpy.types.Scene, role: str) -> list[bpy.types.Object]:
    """The scene's objects of one role, by name."""
    return sorted(of_role(scene, role), key=lambda o: o.name)


def link(folder: bpy.types.Collection, obj: bpy.types.Object) -> None:
    """Put a new object of ours into a collection."""
    folder.objects.link(obj)
    _comings[0] += 1
    look_again()


def has_role(scene: bpy.types.Scene, role: str) -> bool:
    """Whether the scene has an object of a role: quicker than to list them, for what is asked at every redraw."""
    if role == CAMERA_ROLE or scene.session_uid in _tables:
        return bool(of_role(scene, role))
    return any(o.get(ROLE) == role and is_own(o) for o in scene.objects)


def by_role(scene: bpy.types.Scene, *roles: str) -> list[list[bpy.types.Object]]:
    """The scene's objects of each of some roles, in the order of the scene."""
    found: dict[str, list[bpy.types.Object]] = {role: [] for role in roles}
    for obj in scene.objects:
        role = obj.get(ROLE)
        if isinstance(role, str) and role in found and is_own(obj):
            found[role].append(obj)
    return list(found.values())


def collection(scene: bpy.types.Scene, *path: str) -> bpy.types.Collection:
    """The collection at a path below "Rockfall", created where it is missing."""
    parent = scene.collection
    for name in ("Rockfall", *path):
        child = next((c for c in parent.children if c.get(COLLECTION_NAME) == name and is_own(c)), None)
        parent = _new_collection(parent, name) if child is None else child
    return parent


def collections(scene: bpy.types.Scene, folder: str, names: Iterable[str]) -> dict[str, bpy.types.Collection]:
    """Many collections of one folder below "Rockfall" by name, created where they are missing."""
    parent = collection(scene, folder)
    there = {child.get(COLLECTION_NAME): child for child in reversed(parent.children) if is_own(child)}
    return {name: there.get(name) or _new_collection(parent, name) for name in names}


@contextmanager
def out_of_view(scene: bpy.types.Scene, name: str) -> Iterator[None]:
    """Take a collection below "Rockfall" out of the views while many objects come into it: Blender need not follow."""
    ours, folder = collection(scene), collection(scene, name)
    layers = [
        layer
        for view_layer in scene.view_layers
        for parent in view_layer.layer_collection.children
        if parent.collection == ours
        for layer in parent.children
        if layer.collection == folder and not layer.exclude
    ]
    for layer in layers:
        layer.exclude = True
    try:
        yield
    finally:
        for layer in layers:
            layer.exclude = False


def _new_collection(parent: bpy.types.Collection, name: str) -> bpy.types.Collection:
    child = bpy.data.collections.new(name)
    child[COLLECTION_NAME], child[HANGS_IN] = name, [parent.session_uid]
    parent.children.link(child)
    _comings[0] += 1
    return child


def remove_collection(scene: bpy.types.Scene, name: str, but: Collection[str] = ()) -> None:
    """Remove a collection below "Rockfall" with those in it; their objects must be gone.

    but : names of collections in it that stay, and it with them.
    """
    own = filter(is_own, scene.collection.children)
    ours = next((c for c in own if c.get(COLLECTION_NAME) == "Rockfall"), None)
    for child in list(ours.children) if ours is not None else ():
        if child.get(COLLECTION_NAME) == name and is_own(child):
            inner = [each for each in child.children_recursive if each.get(COLLECTION_NAME) not in but]
            for each in (*inner, *(() if but else (child,))):
                _comings[0] += 1
                bpy.data.collections.remove(each)
            return


def remove_objects(objects: list[bpy.types.Object]) -> None:
    """Remove objects with the data and actions that nothing else uses."""
    look_again()
    for obj in objects:
        _comings[0] += 1
        data, action = obj.data, obj.animation_data.action if obj.animation_data else None
        bpy.data.objects.remove(obj)
        if isinstance(data, bpy.types.Mesh) and not data.users:
            bpy.data.meshes.remove(data)
        elif isinstance(data, bpy.types.Curves) and not data.users:
            bpy.data.hair_curves.remove(data)
        if action is not None and not action.users:
            bpy.data.actions.remove(action)
