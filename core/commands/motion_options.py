# SPDX-License-Identifier: GPL-3.0-or-later
"""How blocks move, as the options of a command say: `add_motion_options`, `add_tree_options` and the seed."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from .tree_options import trees_said

if TYPE_CHECKING:
    from ..exchange.project import ReconstructionSettings
    from ..exchange.simulation_entry import SimulationEntry


def motion_as_asked(
    arguments: argparse.Namespace, models: Sequence[str]
) -> "tuple[SimulationEntry, ReconstructionSettings]":
    """What the options say, without a project: models, motion, trees and seed; and gravity.

    Raises
    ------
    InputError : options that do not go together.
    """
    from ..exchange.project import ReconstructionSettings
    from ..exchange.simulation_entry import SimulationEntry

    how = ReconstructionSettings()
    if arguments.gravity is not None:
        how = replace(how, gravity_mps2=arguments.gravity)
    return stated_or_asked(arguments, SimulationEntry(models=tuple(models))), how


def stated_or_asked(arguments: argparse.Namespace, stated: "SimulationEntry") -> "SimulationEntry":
    """What a project states of motion, trees and seed, with what the options say in its place.

    Raises
    ------
    InputError : options that do not go together.
    """
    return replace(
        stated,
        rolling=arguments.rolling or stated.rolling,
        friction=stated.friction if arguments.friction is None else arguments.friction,
        drag=arguments.drag or stated.drag,
        seed=stated.seed if arguments.seed is None else arguments.seed,
        trees=trees_said(arguments, stated.trees),
    )
