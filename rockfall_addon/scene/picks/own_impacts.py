# SPDX-License-Identifier: GPL-3.0-or-later
"""The impacts of the scene's own trajectories, kept until something of a trajectory changes.

While a person drags a pick, its trajectory alone is reconstructed again.
"""

from dataclasses import dataclass, field

import bpy
import numpy as np

from ....core.errors import RockfallError
from ....core.exchange.selection import joined, rows_of
from ....core.reconstruction.impact import Impacts
from ..footage import sync
from ..storage import fingerprints, store
from . import picks, reconstruction


@dataclass(eq=False)
class _Kept:
    """What was found for a scene, and what for."""

    common: object = None
    prints: dict[str, str] = field(default_factory=dict)
    impacts: Impacts | None = None
    problems: dict[str, str] = field(default_factory=dict)


_kept: dict[int, _Kept] = {}  # session_uid of a scene


def impacts_of(scene: bpy.types.Scene) -> tuple[Impacts | None, tuple[str, ...]]:
    """The impacts of each trajectory that can be reconstructed, None without one; and why the others cannot."""
    kept, common, prints = _of(scene), settings_key(scene), fingerprints.remembered(scene)
    if kept.common != common:
        kept.common, kept.prints, kept.impacts, kept.problems = common, {}, None, {}
    changed = [name for name, text in prints.items() if kept.prints.get(name) != text]
    if changed or prints.keys() != kept.prints.keys():
        fresh, problems = _reconstructed(scene, changed)
        kept.impacts = _together(kept.impacts, fresh, set(changed), list(prints))
        kept.problems = {
            name: text for name, text in kept.problems.items() if name in prints and name not in changed
        } | problems
        kept.prints = prints
    return kept.impacts, tuple(kept.problems[name] for name in prints if name in kept.problems)


def settings_key(scene: bpy.types.Scene) -> tuple[object, ...]:
    """All that a reconstruction depends on beside the picks: settings and terrain."""
    settings = scene.rockfall
    kept = (store.GROUND, store.GROUND_CONTENTS, store.SITE, store.GRAVITY, store.BLOCKS, store.NORMAL_RADIUS)
    arrays = (store.DRAG, store.DEFAULT_BLOCK)
    return (
        *(scene.get(key) for key in kept),
        *(tuple(scene.get(key, ())) for key in arrays),
        settings.block_diameter_m,
        settings.density_kgpm3,
        settings.block_shape,
        settings.normal_radius_m,
        settings.use_drag,
        settings.flights_join,
    )


def _reconstructed(scene: bpy.types.Scene, names: list[str]) -> tuple[list[Impacts], dict[str, str]]:
    """Tables of some trajectories, all together or, where one of them has a problem, one by one; and the problems."""
    objects = picks.ordered(scene, picks.objects_of(scene, names)) if names else []
    groups, surface = fingerprints.by_trajectory(objects), reconstruction.ground(scene)
    try:
        if len(groups) > 1:
            together = [obj for members in groups.values() for obj in members]
            return [reconstruction.reconstruct_scene(scene, picks.read(scene, together), surface).impacts], {}
    except RockfallError:  # of one of them
        pass
    tables, problems = [], {}
    for name, members in groups.items():
        try:
            tables.append(sync.reconstruct_trajectory(scene, name, members, surface).impacts)
        except RockfallError as error:
            problems[name] = str(error)
    return tables, problems


def _together(before: Impacts | None, fresh: list[Impacts], changed: set[str], order: list[str]) -> Impacts | None:
    """The rows of what has not changed and the fresh ones, trajectory by trajectory in this order."""
    tables = list(fresh)
    if before is not None:
        stays = np.isin(before.trajectory, [name for name in order if name not in changed])
        tables.append(rows_of(before, stays))
    tables = [table for table in tables if len(table)]
    if not tables:
        return None
    whole = tables[0] if len(tables) == 1 else joined(tables)
    place = {name: i for i, name in enumerate(order)}
    number = np.array([place[name] for name in whole.trajectory.tolist()], dtype=np.intp)
    return whole if (np.diff(number) >= 0).all() else rows_of(whole, np.argsort(number, kind="stable"))


def _of(scene: bpy.types.Scene) -> _Kept:
    if scene.session_uid not in _kept:
        for gone in _kept.keys() - {one.session_uid for one in bpy.data.scenes}:
            del _kept[gone]
        _kept[scene.session_uid] = _Kept()
    return _kept[scene.session_uid]
