# SPDX-License-Identifier: GPL-3.0-or-later
"""The blocks of single trajectories, where they differ from that of the settings; doubles, kept as text."""

import json

import bpy

from ....core.reconstruction.block import SHAPES, Block
from ..storage import store
from ..storage.stored_values import block_problem


def has(scene: bpy.types.Scene, name: str) -> bool:
    """Whether a trajectory has a block of its own."""
    return name in _kept(scene)


def problem_of(scene: bpy.types.Scene, name: str) -> str:
    """What is wrong with the block that a trajectory has of its own; empty when nothing is."""
    values = _kept(scene).get(name)
    return "" if values is None else block_problem(values)


def give(scene: bpy.types.Scene, name: str, block: Block) -> None:
    """Give a trajectory a block of its own."""
    values: list[float | str] = [block.d1, block.d2, block.d3, block.density]
    _keep(scene, _kept(scene) | {name: values if block.shape == SHAPES[0] else [*values, block.shape]})


def take(scene: bpy.types.Scene, name: str) -> None:
    """The trajectory has the block of the settings again."""
    _keep(scene, {other: values for other, values in _kept(scene).items() if other != name})


def _kept(scene: bpy.types.Scene) -> dict[str, list[float | str]]:
    return store.read_json(scene, store.BLOCKS, {})


def _keep(scene: bpy.types.Scene, blocks: dict[str, list[float | str]]) -> None:
    scene[store.BLOCKS] = json.dumps(blocks)
