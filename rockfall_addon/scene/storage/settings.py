# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the scene. A number shown here is single precision: `store.double` gives back what was typed."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ....core.constants import ROCK_DENSITY_KGPM3
from ....core.plausibility import limits

BLOCK_SHAPES = (
    ("ellipsoid", "Ellipsoid", "Volume π/6·d₁·d₂·d₃: a rounded block"),
    ("box", "Box", "Volume d₁·d₂·d₃: a slab or a cube"),
)

DIAMETERS = {**dict(zip(("min", "max"), limits("diameter_m"), strict=True)), "soft_min": 0.01, "soft_max": 5.0}
DENSITIES = {**dict(zip(("min", "max"), limits("density_kgpm3"), strict=True)), "soft_min": 500.0, "soft_max": 5000.0}
"""Of a block: what files may have, so that nothing of them is changed; and what a slider offers."""

COLOURINGS = (
    ("SPEED", "Speed", "Speed of the block"),
    ("ENERGY", "Energy", "Kinetic energy of the block's translation"),
    ("DOUBT", "Doubt", "Relative standard deviation of the speed; flagged flights at the top of the scale"),
)


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ..footage import sync

    sync.recompute(self.id_data)


def _trails_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ..picks import trails

    trails.set_trails(self.id_data)


def _colours_changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ..picks import trails

    trails.paint_observed(self.id_data)


def _row_chosen(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from ..picks import impact_rows

    scene = self.id_data
    obj = impact_rows.chosen(scene)
    if obj is not None and obj != impact_rows.selected(context):
        impact_rows.go_to(context, scene, obj)


def _table_columns() -> list[tuple[str, str, str]]:
    return [
        ("trajectory", "Run", "Trajectory and number of the impact"),
        ("time_s", "Time", "On the common clock [s]"),
        ("speed1_mps", "v₁", "Incident speed [m/s]"),
        ("speed2_mps", "v₂", "Restituted speed [m/s]"),
        ("rn", "R_N", "Apparent normal coefficient of restitution"),
        ("rt", "R_T", "Apparent tangential coefficient of restitution"),
        ("r", "R", "Apparent coefficient of restitution"),
        ("theta1_deg", "θ₁", "Incident angle to the ground [°]"),
        ("theta_dev_deg", "θ_dev", "Deviation angle [°]"),
        ("flags", "Flags", "What deserves a look"),
    ]


class SceneSettings(bpy.types.PropertyGroup):
    """How the scene reconstructs, plays and shows."""

    block_diameter_m: FloatProperty(
        name="Block diameter", description="Mean diameter of the blocks that the project does not describe one by one",
        default=0.35, **DIAMETERS, unit="LENGTH", precision=3, update=_changed,
    )  # fmt: skip
    density_kgpm3: FloatProperty(
        name="Density [kg/m³]", description="Of the rock; masses and energies come from it",
        default=ROCK_DENSITY_KGPM3, **DENSITIES, precision=0, update=_changed,
    )  # fmt: skip
    block_shape: EnumProperty(
        name="Block shape", description="Of blocks without one of their own; volume, mass and inertia come from it",
        items=BLOCK_SHAPES, update=_changed,
    )  # fmt: skip
    normal_radius_m: FloatProperty(
        name="Normal radius",
        description="Radius within which the terrain normal of an impact is fitted. "
        "0: the block's diameter, at least three times the spacing of the terrain's points",
        default=0.0, min=0.0, soft_max=5.0, unit="LENGTH", precision=2, update=_changed,
    )  # fmt: skip
    use_drag: BoolProperty(
        name="Air drag", description="Compute the flights with the drag of air (½ρ C_D A v², Noël et al. 2017)",
        default=False, update=_changed,
    )  # fmt: skip
    flights_join: EnumProperty(
        name="Flights join", description="What the reconstructed flights join",
        items=[
            ("contacts", "Contact points", "The marked points on the terrain, as Noël et al. 2018 publish them"),
            ("centres", "Block centres", "The block's centre at each contact, a radius out along the terrain normal"),
        ],
        default="contacts", update=_changed,
    )  # fmt: skip
    playback: EnumProperty(
        name="Playback", description="When each block starts in the scene",
        items=[
            ("TOGETHER", "Together", "All blocks start together, one after the other by the delay below"),
            ("REAL", "As filmed", "At the times of the common clock"),
        ],
        default="TOGETHER", update=_changed,
    )  # fmt: skip
    stagger_s: FloatProperty(
        name="Delay [s]", description="Between the starts of two blocks",
        default=0.5, min=0.0, soft_max=10.0, precision=2, update=_changed,
    )  # fmt: skip
    block_scale: FloatProperty(
        name="Block size [×]", description="Blocks are drawn so many times their size, to be seen from afar",
        default=1.0, min=0.1, soft_max=10.0, precision=1, update=_changed,
    )  # fmt: skip
    marker_radius_m: FloatProperty(
        name="Impact marker", description="Radius of the discs that mark the picks on the terrain",
        default=0.35, min=0.001, soft_max=5.0, unit="LENGTH", precision=2, update=_changed,
    )  # fmt: skip
    trail_radius_m: FloatProperty(
        name="Trail", description="Radius of the flight curves",
        default=0.08, min=0.0, soft_max=2.0, unit="LENGTH", precision=3, update=_trails_changed,
    )  # fmt: skip
    trail_until_now: BoolProperty(
        name="Grow with time", description="Show the flights up to the current time only",
        default=False, update=_trails_changed,
    )  # fmt: skip
    show_ticks: BoolProperty(
        name="Beads at frames", description="A bead on the flights at each frame of the scene",
        default=False, update=_trails_changed,
    )  # fmt: skip
    colour_by: EnumProperty(
        name="Colour by", description="What the colours of the flights mean; below the terrain they are always red",
        items=COLOURINGS, default="SPEED", update=_colours_changed,
    )  # fmt: skip
    speed_top_mps: FloatProperty(
        name="Top of the scale [m/s]", description="Speed at the upper end of the colour scale",
        default=20.0, min=0.1, precision=1,
    )  # fmt: skip
    energy_top_kj: FloatProperty(
        name="Top of the scale [kJ]", description="Kinetic energy at the upper end of the colour scale",
        default=10.0, min=0.001, precision=2,
    )  # fmt: skip
    impact_index: IntProperty(name="Impact", description="Row of the impact table", update=_row_chosen)
    table_sort: EnumProperty(name="Sort by", items=_table_columns(), default="trajectory")
    table_descending: BoolProperty(name="Descending", description="Largest first", default=False)
    table_flagged: BoolProperty(name="Flagged only", description="List impacts that deserve a look", default=False)
    table_trajectory: BoolProperty(
        name="This trajectory only", description="List the impacts of the selected pick's trajectory", default=False
    )
    show_legend: BoolProperty(name="Legend", description="Draw the colour scale over the 3-D view", default=True)


CLASSES = (SceneSettings,)


def register() -> None:
    bpy.types.Scene.rockfall = bpy.props.PointerProperty(type=SceneSettings)


def unregister() -> None:
    del bpy.types.Scene.rockfall
