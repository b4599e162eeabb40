# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators, one file per step of the workflow. They hold no logic: they call the bridge and report."""

import bpy

from . import demo, film, impacts, look, models, picks, share, terrain

CLASSES = (
    *terrain.CLASSES,
    *picks.CLASSES,
    *impacts.CLASSES,
    *look.CLASSES,
    *models.CLASSES,
    *demo.CLASSES,
    *film.CLASSES,
    *share.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
