# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees from a table of stems, or drawn for a forest of which the density and diameters are known.

    x_m,y_m,dbh_cm,height_m,species
    2600012.4,1200033.1,34,18,coniferous

``tree`` names a stem. ``energy_factor`` in place of the species says how much more energy a stem takes than a silver
fir of the same diameter. Heights and species that are missing are those of the whole forest.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..georeference import GlobalShift
from ..reading import reader
from ..simulation.trees import SPECIES, THICKEST_M, Trees, factor_of, greatest_loss, placed_trees, random_trees
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface
from .csv_text import read_table
from .map_shapes import SUFFIXES, polygon_of, read_polygons
from .simulation_entry import TreesEntry
from .tables import Columns, write_columns

REQUIRED = ("x_m", "y_m", "dbh_cm")
KNOWN = (*REQUIRED, "height_m", "species", "energy_factor", "tree")
CM = 0.01


def open_trees(entry: TreesEntry, terrain: Surface | Cloud, seed: int) -> tuple[Trees, dict[str, Path]]:
    """The trees that a simulation states, and the files that they are from.

    Parameters
    ----------
    seed : of a forest that is drawn.

    Raises
    ------
    InputError : neither a file nor a density with diameters, or both; see `read_trees` and `random_trees`.
    """
    if entry.file is not None:
        if entry.stems_per_hectare is not None or entry.dbh_cm is not None or entry.within is not None:
            raise InputError(
                "Trees have both a table and a density", advice="Give the table, or stems per hectare with dbh"
            )
        return read_trees(entry.file, terrain, entry.height_m, entry.species), {"trees": entry.file}
    if entry.stems_per_hectare is None or entry.dbh_cm is None:
        missing = "stems per hectare" if entry.stems_per_hectare is None else "diameter at breast height (dbh)"
        raise InputError(f"The trees have no {missing}", advice="Give both, or a table of trees")
    among, files, said = [], {}, tuple[str, ...]()
    if entry.within is not None:
        shapes = read_polygons(entry.within, terrain.shift)
        among, said = [polygon_of(shape, entry.within) for shape in shapes], tuple(map(str, shapes.remarks))
        files["trees_within"] = entry.within
    try:
        trees = random_trees(
            terrain, entry.stems_per_hectare, CM * entry.dbh_cm, CM * entry.dbh_sd_cm, seed,
            height_m=entry.height_m, factor=factor_of(entry.species), among=among,
        )  # fmt: skip
    except InputError as error:
        raise InputError(error.problem, file=error.file or entry.within, advice=error.advice) from error
    return replace(trees, left_out=(*said, *trees.left_out)), files


@reader("table of trees")
def read_trees(path: str | Path, terrain: Surface | Cloud, height_m: float, species: str) -> Trees:
    """Read a table of stems in survey coordinates.

    Parameters
    ----------
    height_m, species : where the table does not say.

    Raises
    ------
    InputError : anything that is wrong with the table, with the row; no tree on the terrain.
    """
    if Path(path).suffix.lower() in SUFFIXES[:-1]:
        raise InputError(
            "Trees are read from a table, not from a map of points",
            file=path,
            advice=f"Export it as comma-separated text with {', '.join(REQUIRED)}; polygons go to --trees-within",
        )
    table = read_table(path, REQUIRED, KNOWN)
    dbh, height = CM * table.numbers("dbh_cm", required=True), table.numbers("height_m")
    height = np.where(np.isnan(height), height_m, height)
    factor = table.numbers("energy_factor")
    for what, values in (("diameter", dbh), ("height", height), ("energy factor", factor)):
        for i in np.flatnonzero(values <= 0)[:1].tolist():
            raise table.error(i, f"The {what} of this tree is {values[i]:g}", "Give a number above zero")
    for i in np.flatnonzero(dbh > THICKEST_M)[:1].tolist():
        raise table.error(
            i, f"This tree is {dbh[i]:g} m thick", f"dbh_cm is in centimetres, and below {THICKEST_M / CM:g}"
        )
    kinds = table.text("species", species)
    for i, kind in enumerate(kinds):
        if np.isnan(factor[i]):
            try:
                factor[i] = factor_of(kind)
            except InputError as error:
                known = ", ".join(SPECIES)
                raise table.error(i, error.problem, f"Known are {known}; else give it an energy_factor") from error
    survey = np.column_stack([table.numbers("x_m", required=True), table.numbers("y_m", required=True)])
    position = terrain.shift.to_local(np.column_stack([survey, np.zeros(len(survey))]))[:, :2]
    names = table.text("tree")
    labels = np.array([name or str(i + 1) for i, name in enumerate(names)], dtype=np.str_)
    try:
        return placed_trees(terrain, position, dbh, height, greatest_loss(dbh, factor), labels)
    except InputError as error:
        raise InputError(error.problem, file=path, advice=error.advice) from error


def write_trees(trees: Trees, shift: GlobalShift, path: str | Path) -> None:
    """Write the table that `read_trees` reads, those that were drawn too.

    Raises
    ------
    OSError : the file cannot be written.
    """
    survey = shift.to_survey(np.column_stack([trees.position, trees.foot_m]))
    columns: Columns = {
        "tree": trees.labels(np.arange(len(trees))),
        "x_m": survey[:, 0],
        "y_m": survey[:, 1],
        "dbh_cm": trees.dbh_m / CM,
        "height_m": trees.height_m,
        "energy_factor": trees.energy_j / greatest_loss(trees.dbh_m),
    }
    write_columns(path, columns)
