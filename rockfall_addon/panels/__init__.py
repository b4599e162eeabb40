# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab "Rockfall": one panel per step. Panels compute nothing and name operators by their ids."""

import bpy

from . import (
    alignment,
    film,
    impact,
    impact_table,
    models,
    picking,
    picks,
    playback,
    refinement,
    share,
    start,
    terrain,
    videos,
)

CLASSES = (
    *start.CLASSES,
    *terrain.CLASSES,
    *videos.CLASSES,
    *alignment.CLASSES,
    *picks.CLASSES,
    *picking.CLASSES,
    *impact.CLASSES,
    *impact_table.CLASSES,
    *refinement.CLASSES,
    *models.CLASSES,
    *playback.CLASSES,
    *film.CLASSES,
    *share.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
