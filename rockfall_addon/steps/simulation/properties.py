# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be simulated, and how it is shown."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ....core.constants import ROCK_DENSITY_KGPM3
from ....core.hazard.cells import LEAST_M
from ....core.hazard.face_tally import FACE_LAYERS
from ....core.hazard.maps import LAYERS
from ....core.simulation.block_shapes import SHAPES
from ....core.simulation.engine import FRICTION
from ....core.simulation.trees import HEIGHT_M, KIND, SPECIES
from ...scene.models import models
from ...scene.simulation import drawn_releases, simulation
from ...scene.storage import store
from ...scene.storage.settings import DENSITIES, DIAMETERS
from ...view.reporting import redraw


def _look_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    simulation.look(self.id_data)


def _map_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    redraw(context)


def _can_be_source(self: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    return obj.type in drawn_releases.TYPES and obj.get(store.ROLE, store.RELEASE_ROLE) == store.RELEASE_ROLE


class SimulationZone(bpy.types.PropertyGroup):
    """A part of the terrain with parameters of its own: what the vertex group, or attribute, of its name has."""

    name: StringProperty(
        name="Zone", description="A vertex group of the terrain, or an attribute of its vertices or faces",
    )  # fmt: skip
    use_friction: BoolProperty(name="Friction", description="The zone has a friction of its own", default=True)
    friction: FloatProperty(
        name="Friction", description="Coefficient μ of rolling or sliding in the zone",
        default=FRICTION, min=0.0, max=5.0, precision=2,
    )  # fmt: skip
    parameters: StringProperty(
        name="Parameters",
        description="Of the models, in the zone, for example: rt = 0.4, noel_2017.rn_limit = 1. A name alone is for "
        "every model that has it",
    )  # fmt: skip


class ScreenSettings(bpy.types.PropertyGroup):
    """Of a screen: how high it is, and what it holds."""

    height_m: FloatProperty(
        name="Height", description="Of the fence, vertically above the terrain: a barrier catches what passes with all "
        "of the block below it", default=3.0, min=0.1, soft_max=10.0, unit="LENGTH", precision=1,
    )  # fmt: skip
    holds: BoolProperty(
        name="Holds blocks", description="A barrier: it holds blocks that pass below its top with no more energy than "
        "it takes; others go on as they came. Off: the screen measures what passes", default=False,
    )  # fmt: skip
    capacity_kj: FloatProperty(
        name="Capacity [kJ]", description="Kinetic energy, of translation and rotation, up to which it holds a block",
        default=1000.0, min=0.1, soft_max=8500.0, precision=0,
    )  # fmt: skip


class SimulationSettings(bpy.types.PropertyGroup):
    """Where which blocks start, which models carry them, and what is shown of them."""

    source: EnumProperty(
        name="Release from", description="Where the blocks start",
        items=[
            ("MEASURED", "Measured releases", "The first moment of each reconstructed trajectory, as it was measured"),
            ("PICK", "Selected pick", "The selected release or impact, with its measured velocity"),
            ("DRAWN", "Drawn line or area", "Anywhere on a drawn line, in a drawn area, or at drawn points"),
            ("STEEP", "Steep terrain", "All faces steeper than an angle, equally on each square metre of rock"),
        ],
        default="MEASURED",
    )  # fmt: skip
    drawn: PointerProperty(
        name="Drawing", type=bpy.types.Object, poll=_can_be_source,
        description="A line, an area (a closed line) or points on the terrain: drawn with the buttons below, "
        "or any mesh, curve or Grease Pencil object of yours",
    )  # fmt: skip
    pick: StringProperty(name="Pick", description="Id of the pick that blocks were last released from")
    steeper_than_deg: FloatProperty(
        name="Steeper than [°]", description="Blocks start on faces that are steeper than this",
        default=60.0, min=0.0, max=179.0, precision=1,
    )  # fmt: skip
    number: IntProperty(
        name="Number", description="Blocks of each model: from each measured release or drawn point, or altogether",
        default=20, min=1, soft_max=10_000, max=10_000_000,
    )  # fmt: skip
    seed: IntProperty(name="Seed", description="Of the random numbers: the same seed gives the same blocks", min=0)
    diameter_m: FloatProperty(
        name="Diameter", description="Mean diameter of the blocks; measured releases have that of their trajectory",
        default=0.5, **DIAMETERS, unit="LENGTH", precision=2,
    )  # fmt: skip
    diameter_law: EnumProperty(
        name="Sizes", description="How the diameters of the blocks are drawn",
        items=[
            ("fixed", "All alike", "All blocks have one diameter"),
            ("uniform", "Between two", "Any diameter from the first to the second"),
            ("normal", "Normal", "Normal law: mean and standard deviation"),
            ("lognormal", "Lognormal", "Lognormal law: mean and standard deviation of the diameters themselves"),
        ],
        default="fixed",
    )  # fmt: skip
    diameter_second_m: FloatProperty(
        name="Second diameter", description="The largest diameter, or the standard deviation",
        default=1.0, min=0.0, soft_max=10.0, unit="LENGTH", precision=2,
    )  # fmt: skip
    proportions: FloatVectorProperty(
        name="Proportions", description="d1 : d2 : d3 of a box or an ellipsoid",
        size=3, default=(1.0, 1.0, 1.0), min=0.01, precision=2,
    )  # fmt: skip
    density_kgpm3: FloatProperty(
        name="Density [kg/m³]", description="Of the rock",
        default=ROCK_DENSITY_KGPM3, **DENSITIES, precision=0,
    )  # fmt: skip
    shape: EnumProperty(
        name="Shape", description="Decides mass and inertia; the ground is met by the sphere of the mean diameter",
        items=[(name, name.capitalize(), "") for name in SHAPES], default="sphere",
    )  # fmt: skip
    models: EnumProperty(
        name="Models", description="Impact models that carry the same blocks down",
        items=models.CHOICES, options={"ENUM_FLAG"}, default={"noel_2017"},
    )  # fmt: skip
    contact: EnumProperty(
        name="Blocks meet", description="What of the terrain blocks touch",
        items=[
            ("mesh", "Surface", "The triangles of the terrain; clouds were meshed when they were imported"),
            ("points", "Points", "The points of the terrain alone, its vertices, without a surface between them: for "
             "dense scans. They need a third of a block's radius between them, or less"),
        ],
        default="mesh",
    )  # fmt: skip
    check_mesh: BoolProperty(
        name="Check the mesh", description="Also report how much the run-out depends on the triangles: some of the "
        "blocks fall once more on a mesh whose triangles are divided until their edges are half a diameter",
        default=False,
    )  # fmt: skip
    rolling: EnumProperty(
        name="On the ground", description="How a block moves that no longer bounces",
        items=[
            ("azzoni_1995", "Rolls", "Rolling after Azzoni et al. 1995"),
            ("coulomb", "Slides", "Coulomb's sliding"),
            ("none", "Stops", "It stops where it would begin to roll"),
        ],
        default="azzoni_1995",
    )  # fmt: skip
    friction: FloatProperty(
        name="Friction", description="Coefficient μ of rolling or sliding on the ground: the tangent of the angle at "
        "which a block no longer slows down", default=FRICTION, min=0.0, max=5.0, precision=2,
    )  # fmt: skip
    use_drag: BoolProperty(name="Air drag", description="Flights with the drag of air (½ρ C_D A v²)", default=False)

    zones: CollectionProperty(type=SimulationZone)

    trees: EnumProperty(
        name="Trees", description="Stems that blocks meet; they take energy and turn blocks away",
        items=[
            ("NONE", "None", "Blocks meet no trees"),
            ("TABLE", "From a table", "Each stem by its place and diameter: x_m, y_m, dbh_cm"),
            ("DRAWN", "Stems per hectare", "A forest of a density, drawn at random by the seed"),
        ],
        default="NONE",
    )  # fmt: skip
    trees_file: StringProperty(
        name="Table", description="Stems in survey coordinates: x_m, y_m, dbh_cm; if known height_m, species, tree",
        subtype="FILE_PATH",
    )  # fmt: skip
    stems_per_hectare: FloatProperty(
        name="Stems per hectare", description="Density of the forest, in plan",
        default=400.0, min=0.1, soft_max=3000.0, max=1e6, precision=0,
    )  # fmt: skip
    dbh_cm: FloatProperty(
        name="Diameter [cm]", description="Mean diameter at breast height (DBH)",
        default=30.0, min=1.0, soft_max=100.0, max=500.0, precision=0,
    )  # fmt: skip
    dbh_sd_cm: FloatProperty(
        name="Deviation [cm]", description="Standard deviation of the diameters (gamma law); 0 makes all alike",
        default=10.0, min=0.0, soft_max=50.0, max=500.0, precision=0,
    )  # fmt: skip
    trees_within: StringProperty(
        name="Within", description="Polygons outside of which no trees are drawn: a shapefile, KML, GeoJSON, a "
        "GeoPackage, or a table of corners. "
        "Empty: everywhere on the terrain", subtype="FILE_PATH",
    )  # fmt: skip
    tree_height_m: FloatProperty(
        name="Height", description="Above the ground up to which a stem is met, where a table does not say",
        default=HEIGHT_M, min=0.1, soft_max=50.0, unit="LENGTH", precision=1,
    )  # fmt: skip
    tree_species: EnumProperty(
        name="Kind", description="How much energy a stem takes beside a silver fir, where a table does not say",
        items=[
            (name, name.replace("_", " ").capitalize(), f"{factor:g} times a silver fir of the same diameter")
            for name, factor in SPECIES.items()
        ],
        default=KIND,
    )  # fmt: skip
    show_trees: BoolProperty(
        name="Trees", description="Show the stems that the simulated blocks met", default=True, update=_look_changed
    )

    colour_by: EnumProperty(
        name="Colour by", description="What the colours of the simulated paths mean",
        items=[
            ("SPEED", "Speed", "Speed of the block"),
            ("ENERGY", "Energy", "Kinetic energy of the block's translation"),
            ("MODEL", "Model", "The colour of the impact model"),
        ],
        default="MODEL", update=_look_changed,
    )  # fmt: skip
    show_paths: BoolProperty(
        name="Paths", description="Draw the paths of the simulated blocks", default=True, update=_look_changed
    )
    show_blocks: BoolProperty(
        name="Blocks", description="Show the simulated blocks at the scene's time", default=True, update=_look_changed
    )
    map_model: EnumProperty(
        name="Model", description="Impact model of the maps",
        items=[(name, title, text) for name, title, text, _ in models.CHOICES], default="noel_2017",
    )  # fmt: skip
    map_number: IntProperty(
        name="Number", description="Blocks of the maps: from each measured release or drawn point, or altogether. They "
        "are counted and forgotten, so there may be many",
        default=1000, min=1, soft_max=100_000, max=10_000_000,
    )  # fmt: skip
    map_cell_m: FloatProperty(
        name="Cells", description="Side of a cell",
        default=2.0, min=LEAST_M, soft_min=0.5, soft_max=20.0, unit="LENGTH", precision=2,
    )  # fmt: skip
    map_with_barriers: BoolProperty(
        name="With Barriers", default=False,
        description="Maps of the blocks that the drawn barriers do not hold; without, barriers do nothing in the maps",
    )  # fmt: skip
    map_layer: EnumProperty(
        name="Map", description="What is painted on the terrain",
        items=[(name, layer.title, f"{layer.meaning} ({name})") for name, layer in LAYERS.items()],
        default="Reach_probability", update=_map_changed,
    )  # fmt: skip
    map_on: EnumProperty(
        name="Of", description="What the painted map is of",
        items=[
            ("CELLS", "Cells", "Cells in plan: what passes through them"),
            ("FACES", "Faces", "Faces of the mesh: what happens at contacts with them, also on cliffs, which have no "
             "cell of their own"),
        ],
        default="CELLS", update=_map_changed,
    )  # fmt: skip
    face_layer: EnumProperty(
        name="Map", description="What is painted on the faces",
        items=[(name, layer.title, f"{layer.meaning} ({name})") for name, layer in FACE_LAYERS.items()],
        default="Reach_probability", update=_map_changed,
    )  # fmt: skip
    show_map: BoolProperty(
        name="Show on the Terrain", description="Paint the map on the terrain", default=True, update=_map_changed
    )
    probe_map: BoolProperty(
        name="Numbers under the Mouse", description="The numbers of the cell under the mouse, beside it", default=True,
        update=_map_changed,
    )  # fmt: skip

    run_model: StringProperty(name="Model", description="Of the selected run")
    run: IntProperty(
        name="Run", description="The selected run: its path is drawn bold, its numbers stand below; 0 selects none",
        default=0, min=0,
    )  # fmt: skip


CLASSES = (SimulationZone, ScreenSettings, SimulationSettings)


def register() -> None:
    bpy.types.Scene.rockfall_simulation = PointerProperty(type=SimulationSettings)
    bpy.types.Object.rockfall_screen = PointerProperty(type=ScreenSettings)


def unregister() -> None:
    del bpy.types.Object.rockfall_screen
    del bpy.types.Scene.rockfall_simulation
