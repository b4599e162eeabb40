# SPDX-License-Identifier: GPL-3.0-or-later
"""From clicks to places on the terrain: a pixel of the footage, or a ray of a free view."""

from dataclasses import dataclass

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.footage.advice import time_sigma_s
from ....core.reconstruction.block import Block
from ....core.terrain.raycast import cast_ray
from ....core.terrain.surface import Surface
from ....core.vectors import Array
from ....core.workflow.first_picks import coordinate_sigma, place_clicked
from ..footage import pictures, sightings
from ..storage import fingerprints, store
from ..terrain import terrain
from . import own_blocks, picks, reconstruction

FIRST_NAME = "B01"


@dataclass(frozen=True, eq=False)
class Place:
    """Where a click lies on the terrain.

    Attributes
    ----------
    position, normal : (3,) local [m], where the block touches the terrain; the normal of the face there.
    time_s : on the common clock [s].
    sigma_time_s, sigma_m : standard deviations of the time and of a coordinate, the latter of the click, the camera and
        the terrain together; NaN in a free view, infinite where the camera was not found in this picture.
    frame, pixel, sigma_px : of the picture, and the (2,) click in it; −1 and NaN in a free view.
    ellipse : (2, 3) half axes of one standard deviation on the terrain [m], of all three.
    grazing_deg : angle between the ray and the terrain.
    warning : a sentence, empty where all is well.
    """

    position: Array
    normal: Array
    time_s: float
    sigma_time_s: float = np.nan
    sigma_m: float = np.nan
    frame: int = -1
    pixel: Array | None = None
    sigma_px: float = np.nan
    ellipse: Array | None = None
    grazing_deg: float = np.nan
    warning: str = ""


def surface_of(scene: bpy.types.Scene) -> Surface:
    """The terrain that is picked on.

    Raises
    ------
    RockfallError : there is none.
    """
    surface = reconstruction.ground(scene)
    if surface is None:
        raise RockfallError("There is no terrain to pick on. Import it first, in the panel Terrain.")
    return surface


def block_of(scene: bpy.types.Scene, name: str) -> Block:
    """The block of a trajectory, also of one that has no picks yet; that of the settings where its own cannot be."""
    if own_blocks.problem_of(scene, name):
        return reconstruction.default_block(scene)
    return reconstruction.blocks_of(scene, {name})[name]


def normal_radius(scene: bpy.types.Scene) -> float | None:
    """Radius in which terrain normals are fitted [m]; None: that of the block."""
    return reconstruction.project_settings(scene, []).reconstruction.normal_radius_m


def trajectory(scene: bpy.types.Scene) -> str:
    """The trajectory that is picked: the one chosen in the tool, else that of the first pick, else a first name."""
    chosen = scene.rockfall_picking.trajectory.strip()
    if chosen:
        return chosen
    shown = fingerprints.remembered(scene)  # asked at every redraw, when thousands of picks cannot be gone through
    return min(shown or trajectories(scene), default=FIRST_NAME)


def trajectories(scene: bpy.types.Scene) -> list[str]:
    """Names of the trajectories that have picks, in the order of their names."""
    return sorted({obj[store.TRAJECTORY] for obj in picks.objects_of(scene)})


def in_picture(
    scene: bpy.types.Scene, camera: bpy.types.Object, pixel: Array, name: str, *, centre: bool | None = None
) -> Place:
    """Where the block of a trajectory is by a click in the picture.

    centre : whether the pixel is that of the block's centre, else that of its contact; None as the tool says.

    Raises
    ------
    RockfallError : no terrain, a camera that is not aligned, a ray that misses the terrain.
    """
    settings = scene.rockfall_picking
    surface = surface_of(scene)
    frame, video_s = pictures.picture_time(scene, camera)
    pixel = np.asarray(pixel, dtype=np.float64)
    sigma_px = store.double(settings.sigma_px)
    of_centre = settings.aim == "CENTRE" if centre is None else centre
    found = place_clicked(
        sightings.view_of(camera),
        video_s,
        pixel,
        sigma_px,
        surface,
        centre_of=block_of(scene, name) if of_centre else None,
        sigma_terrain_m=terrain.accuracy_m(scene),
        normal_radius_m=normal_radius(scene),
    )
    if np.isnan(found.point[0, 0]):
        against = "If the block stands against the sky there, click where it touches the ground, with Click on: Ground."
        advice = against if of_centre else "Click on the surveyed slope."
        raise RockfallError(f"There is no terrain behind this pixel. {advice}")
    step = pictures.frame_step_s(camera)
    return Place(
        position=found.point[0],
        normal=found.normal[0],
        time_s=pictures.common_time(camera, video_s, float(pixel[1])),
        sigma_time_s=time_sigma_s(1 / step),
        sigma_m=coordinate_sigma(found.covariance[0]),
        frame=frame,
        pixel=pixel,
        sigma_px=sigma_px,
        ellipse=found.ellipse[0],
        grazing_deg=float(np.degrees(found.grazing[0])),
        warning=found.warning[0],
    )


def on_ray(scene: bpy.types.Scene, origin: Array, direction: Array, name: str) -> Place:
    """Where a ray of a free view meets the terrain, at the moment that the scene shows.

    Raises
    ------
    RockfallError : no terrain, or the ray misses it.
    """
    surface = surface_of(scene)
    hit = cast_ray(surface, origin, direction)
    if hit is None:
        raise RockfallError("There is no terrain under the mouse.")
    return Place(hit.point, surface.face_normals[hit.face], pictures.now(scene, name))
