# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the scene's simulated blocks come from: what was measured, what is drawn, or what is steep."""

from collections.abc import Mapping

import bpy
import numpy as np

from ...core.constants import AIR_DENSITY_KGPM3, DRAG_COEFFICIENT
from ...core.errors import RockfallError
from ...core.reconstruction.drag import Drag
from ...core.reconstruction.picks import take
from ...core.reconstruction.trajectory import Reconstruction
from ...core.simulation.blocks import Blocks
from ...core.simulation.distributions import Distribution
from ...core.simulation.measured_releases import from_reconstruction
from ...core.simulation.polygons import Polygon
from ...core.simulation.release_sources import in_polygon, on_line, on_points, steeper_than
from ...core.terrain.surface import Surface
from ...core.workflow.simulation import ReleaseSource
from . import drawn_releases, fingerprints, picks, reconstruction, store
from .simulation import Origin

FILMED = ("MEASURED", "PICK")
"""Sources that need picks."""
SAME_TIME_S = 1e-9


def missing(scene: bpy.types.Scene) -> str:
    """What the chosen source still needs, in a sentence; empty when all is there."""
    settings = scene.rockfall_simulation
    if settings.source in FILMED and not store.with_role(scene, store.PICK_ROLE):
        return "Nothing is measured yet. Release blocks from a drawn line or area, from steep terrain, or pick first."
    if settings.source == "PICK" and selected_pick(scene) is None:
        return "Select a release or an impact in the view: blocks will start there."
    if settings.source == "DRAWN" and drawn(scene) is None:
        return "Draw where blocks start: choose below, click on the terrain, and press Enter."
    return ""


def source_of(scene: bpy.types.Scene, surface: Surface) -> tuple[ReleaseSource, Mapping[str, Origin]]:
    """What puts the blocks on the ground, and when the blocks of each release start in the scene.

    Raises
    ------
    RockfallError : a drawing that is none; whatever the reconstruction refuses.
    """
    settings = scene.rockfall_simulation
    number, seed = settings.number, settings.seed
    if settings.source == "MEASURED":
        result = reconstruction.reconstruct_scene(scene, surface=surface)
        return lambda ground: from_reconstruction(ground, result, None, number, seed), _origins(result)
    if settings.source == "PICK":
        return _from_pick(scene, surface)
    blocks = blocks_of(scene)
    if settings.source == "STEEP":
        angle = np.radians(store.double(settings.steeper_than_deg))
        return lambda ground: steeper_than(ground, angle, blocks, number, seed), {}
    kind, points = drawn_releases.read(drawn(scene))
    name = drawn(scene).name
    if kind == drawn_releases.POINTS:
        names = np.array([f"{name} {i + 1}" for i in range(len(points))] if len(points) > 1 else [name])
        return lambda ground: on_points(ground, points, blocks, number, seed, names), {}
    if kind == drawn_releases.LINE:
        return lambda ground: on_line(ground, [points], blocks, number, seed, names=[name]), {}
    area = Polygon(name, (points[:, :2],))
    return lambda ground: in_polygon(ground, [area], blocks, number, seed), {}


def fingerprint(scene: bpy.types.Scene) -> str:
    """Of all that decides where blocks start, and as what."""
    settings, parts = scene.rockfall_simulation, [scene.rockfall_simulation.source]
    if settings.source in FILMED:
        parts += [sorted(fingerprints.remembered(scene).items()), scene.get(store.BLOCKS, "")]
        parts += [reconstruction.project_settings(scene, []).block]
    if settings.source == "PICK":
        chosen = selected_pick(scene)
        parts += [chosen.get(store.ID) if chosen is not None else None]
    else:
        parts += [blocks_of(scene)]
    if settings.source == "STEEP":
        parts += [settings.steeper_than_deg]
    if settings.source == "DRAWN" and drawn(scene) is not None:
        try:
            kind, points = drawn_releases.read(drawn(scene))
            parts += [drawn(scene).name, kind, points.tobytes().hex()]
        except RockfallError as error:
            parts += [str(error)]
    return repr(parts)


def blocks_of(scene: bpy.types.Scene) -> Blocks:
    """The law of the blocks that nobody has measured.

    Raises
    ------
    RockfallError : numbers that no block has.
    """
    settings = scene.rockfall_simulation
    proportions = tuple(store.double(value) for value in settings.proportions)
    return Blocks(
        settings.shape,
        Distribution(
            settings.diameter_law,
            store.double(settings.diameter_m),
            0.0 if settings.diameter_law == "fixed" else store.double(settings.diameter_second_m),
        ),
        proportions if settings.shape in ("box", "ellipsoid") else (1.0, 1.0, 1.0),
        Distribution("fixed", store.double(settings.density_kgpm3)),
    )


def drag(scene: bpy.types.Scene) -> Drag:
    """The scene's drag of air."""
    return Drag(*list(scene.get(store.DRAG, (AIR_DENSITY_KGPM3, DRAG_COEFFICIENT))))


def drawn(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The drawing that blocks start from, as long as it is in the scene."""
    obj = scene.rockfall_simulation.drawn
    return obj if obj is not None and obj.name in scene.objects else None


def selected_pick(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The release or impact that blocks start from: the active object, else the one that was chosen last."""
    obj = bpy.context.view_layer.objects.active if bpy.context.view_layer is not None else None
    if _can_start(obj):
        return obj
    kept = scene.rockfall_simulation.pick
    return next((obj for obj in store.with_role(scene, store.PICK_ROLE) if obj.get(store.ID) == kept), None)


def _can_start(obj: bpy.types.Object | None) -> bool:
    return obj is not None and obj.get(store.ROLE) == store.PICK_ROLE and obj.get(store.KIND) in ("release", "impact")


def _from_pick(scene: bpy.types.Scene, surface: Surface) -> tuple[ReleaseSource, Mapping[str, Origin]]:
    settings, obj = scene.rockfall_simulation, selected_pick(scene)
    number, seed, name = settings.number, settings.seed, obj[store.TRAJECTORY]
    table = picks.picks_of(scene)
    onward = (table.trajectory == name) & (table.time_s >= float(obj[store.TIME]) - SAME_TIME_S)
    result = reconstruction.reconstruct_scene(scene, take(table, onward), surface=surface)
    return lambda ground: from_reconstruction(ground, result, None, number, seed), _origins(result)


def _origins(result: Reconstruction) -> dict[str, Origin]:
    """When each trajectory begins: at its release, else at its first impact whose velocity is known."""
    found = {}
    picked, impacts = result.picks, result.impacts
    for i in picked.group_starts.tolist():
        name = str(picked.trajectory[i])
        time_s = float(picked.time_s[i])
        if picked.kind[i] != "release":
            own = np.flatnonzero((impacts.trajectory == name) & np.isfinite(impacts.v2).all(axis=1))
            time_s = float(impacts.time_s[own[0]]) if own.size else time_s
        found[name] = Origin(name, time_s)
    return found
