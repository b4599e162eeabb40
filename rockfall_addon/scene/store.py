# SPDX-License-Identifier: GPL-3.0-or-later
"""Every name under which the .blend keeps something of ours, and the objects by their role.

All of it is stored in ID properties: they hold doubles, are saved in the file and follow undo. The spelling on the
right is what saved files contain and never changes; `migration` says what is done when the meaning does.
"""

from collections.abc import Collection

import bpy

# of any object
ROLE, ID = "rockfall_role", "rockfall_id"
TERRAIN_ROLE, COARSE_VIEW_ROLE = "terrain", "terrain_view"
PICK_ROLE, BLOCK_ROLE, FLIGHTS_ROLE = "pick", "block", "flights"
MODEL_BLOCK_ROLE, MODEL_FLIGHTS_ROLE = "twin", "twin_flights"
SIMULATED_BLOCKS_ROLE, SIMULATED_PATHS_ROLE = "simulated_blocks", "simulated_paths"
SIMULATED_PATTERN_ROLE = "simulated_pattern"  # the block whose mesh the simulated ones show
RELEASE_ROLE = "release"  # a drawn line, area or points
STRUCTURE_ROLE = "structure"  # a mesh that blocks meet beside the terrain
CAMERA_ROLE = "camera"
COLLECTION_NAME = "rockfall_name"  # of a collection: a person may rename it

# of the scene: the project
SCHEMA = "rockfall_schema"
SHIFT, CRS = "rockfall_shift_m", "rockfall_crs"
SITE, SITE_DESCRIPTION = "rockfall_site", "rockfall_site_description"
PICKS_SOURCE = "rockfall_picks_source"
RENDER_PRESETS = "rockfall_render_presets"
BEFORE_FILM = "rockfall_film_before"
WORKSPACE = "rockfall_workspace"  # of the workspace

# of the scene: how trajectories are computed
GRAVITY, NORMAL_RADIUS = "rockfall_gravity_mps2", "rockfall_normal_radius_m"
DEFAULT_BLOCK = "rockfall_default_block"  # d1, d2, d3, density
BLOCKS = "rockfall_blocks"  # d1, d2, d3, density by trajectory, as text
DRAG = "rockfall_drag"  # density of air, drag coefficient
TIME_ORIGIN, OFFSETS = "rockfall_time_origin_s", "rockfall_offsets_s"
KEYED_RATE, TICK_RATE = "rockfall_keyed_rate_hz", "rockfall_tick_rate_hz"

# of the scene: what is shown
SHOWN = "rockfall_shown"  # fingerprint of each trajectory
GROUND, GROUND_CONTENTS = "rockfall_ground", "rockfall_ground_contents"  # fingerprints; 0.1.0 had the first only
PROBLEM, TRAJECTORY_PROBLEMS = "rockfall_problem", "rockfall_trajectory_problems"
SHOWN_MODELS, MODEL_PARAMETERS = "rockfall_twin_models", "rockfall_model_parameters"
OTHER_PARAMETERS = "rockfall_other_parameters"  # of the models: the second set, for the graphs
MODEL = "rockfall_model"  # of what a model predicts
GRAPH_CHOSEN = "rockfall_graph_chosen"  # impacts of other sites that are selected: file → rows, as text
