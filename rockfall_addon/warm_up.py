# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile the kernels in the background, so that the first import and the first graphs do not wait for them."""

import threading

import bpy
import numpy as np

from ..core.analysis.preparation import prepare_fits, prepare_model
from ..core.constants import GRAVITY_MPS2
from ..core.georeference import GlobalShift
from ..core.impact_models.registry import COMPARED
from ..core.reconstruction.free_flight import fly
from ..core.simulation.engine import Settings, simulate
from ..core.simulation.ground import make_ground
from ..core.simulation.release import make_releases, placed_on
from ..core.terrain.orientation import block_scale_normals
from ..core.terrain.raycast import cast_ray, cast_rays, closest_point, closest_points
from ..core.terrain.surface import Surface
from .scene import models, preparation


def register() -> None:
    if not bpy.app.background:
        preparation.begin(models.ORDER)
        threading.Thread(target=_compile, name="rockfall kernels", daemon=True).start()


def unregister() -> None:
    """A running compilation ends by itself."""


def _compile() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    plane = Surface(vertices, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32), GlobalShift(), "plane", ())
    above = np.array([[0.5, 0.4, 1.0]])
    try:
        cast_rays(plane, above, np.array([[0.0, 0.0, -1.0]]))
        closest_points(plane, above)
        cast_ray(plane, above[0], (0.0, 0.0, -1.0))
        closest_point(plane, above[0])
        block_scale_normals(plane, above, 0.3)
        fly(above, above, np.ones(1), GRAVITY_MPS2, np.ones(1))
        prepare_fits()
        for name in models.ORDER:
            prepare_model(name)
            preparation.done(name)
    finally:
        preparation.end()
    ground = make_ground(plane)
    place = placed_on(ground, above[:, :2], np.array([0.1]))
    simulate(ground, make_releases(place, diameter_m=0.1), Settings(COMPARED[0]), threads=1)
