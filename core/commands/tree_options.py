# SPDX-License-Identifier: GPL-3.0-or-later
"""``--trees`` and ``--stems-per-hectare``: stems that blocks meet."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .options import positive

if TYPE_CHECKING:
    from ..exchange.simulation_entry import TreesEntry


def add_tree_options(parser: argparse.ArgumentParser) -> None:
    """A table of trees, or a forest that is drawn."""
    group = parser.add_argument_group("trees that blocks meet (default none)")
    group.add_argument(
        "--trees",
        metavar="FILE",
        help="a table of stems: x_m, y_m, dbh_cm; if known height_m, species or energy_factor, tree (a name)",
    )
    group.add_argument(
        "--stems-per-hectare", type=positive, metavar="N", help="a forest drawn at random by the seed, needs --dbh-cm"
    )
    group.add_argument(
        "--dbh-cm",
        metavar="MEAN[,SD]",
        help="diameters at breast height [cm] of the forest of --stems-per-hectare: mean, standard deviation",
    )
    group.add_argument("--trees-within", metavar="FILE", help="polygons of a map outside of which none are drawn")
    group.add_argument(
        "--tree-height", type=positive, metavar="M", help="up to which a stem is met, where the table does not say [m]"
    )
    group.add_argument(
        "--species",
        metavar="KIND",
        help="coniferous (default), broadleaved or silver_fir, where the table does not say",
    )


def trees_said(arguments: argparse.Namespace, stated: "TreesEntry | None" = None) -> "TreesEntry | None":
    """What the options say of trees, in place of what a project states; None for no trees.

    Raises
    ------
    InputError : options that do not go together, diameters that are no numbers.
    """
    from ..exchange.simulation_entry import TreesEntry

    drawn = (arguments.stems_per_hectare, arguments.dbh_cm, arguments.trees_within)
    if arguments.trees is not None and any(option is not None for option in drawn):
        raise InputError(
            "--trees has each stem, and the other options draw them",
            advice="Give --trees, or --stems-per-hectare with --dbh-cm",
        )
    entry = stated
    if arguments.trees is not None:
        entry = TreesEntry(file=Path(arguments.trees))
    elif any(option is not None for option in drawn):
        entry = replace(stated or TreesEntry(), file=None)
        if arguments.stems_per_hectare is not None:
            entry = replace(entry, stems_per_hectare=arguments.stems_per_hectare)
        if arguments.dbh_cm is not None:
            mean, sd = _mean_and_sd(arguments.dbh_cm)
            entry = replace(entry, dbh_cm=mean, dbh_sd_cm=sd)
        if arguments.trees_within is not None:
            entry = replace(entry, within=Path(arguments.trees_within))
        if not entry.stems_per_hectare or not entry.dbh_cm:
            given, lacking = "--stems-per-hectare", "--dbh-cm"
            if not entry.stems_per_hectare:
                given, lacking = "--dbh-cm" if arguments.dbh_cm is not None else "--trees-within", given
            raise InputError(
                f"{given} is of a forest that is drawn, which needs {lacking}, too",
                advice="Give both, as in --stems-per-hectare 400 --dbh-cm 32,12",
            )
    for option, name in (("tree_height", "height_m"), ("species", "species")):
        value = getattr(arguments, option)
        if value is not None:
            if entry is None:
                raise InputError(
                    f"--{option.replace('_', '-')} is of trees, and there are none",
                    advice="Give --trees, or --stems-per-hectare with --dbh-cm",
                )
            entry = replace(entry, **{name: value})
    return entry


def _mean_and_sd(text: str) -> tuple[float, float]:
    parts = text.split(",")
    try:
        mean, sd = float(parts[0]), float(parts[1]) if len(parts) == 2 else 0.0
    except ValueError:
        mean, sd = 0.0, 0.0
    if not (0 < mean < float("inf") and 0 <= sd < float("inf")) or len(parts) > 2:
        raise InputError(f"--dbh-cm {text} is no mean diameter with a deviation", advice="Write 32, or 32,12: in cm")
    return mean, sd
