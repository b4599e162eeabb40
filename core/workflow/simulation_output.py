# SPDX-License-Identifier: GPL-3.0-or-later
"""All tables and maps of a simulation in one folder."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from ..exchange.face_maps import write_face_maps
from ..exchange.map_output import draw_maps, write_maps
from ..exchange.screens import write_screens
from ..exchange.simulated_motion import write_simulated_impacts, write_simulated_trajectories
from ..exchange.simulation_entry import IMPACTS, RECORDS, TRAJECTORIES
from ..exchange.simulation_tables import NO_SCREENS, summary, write_hits, write_runs, write_summary, write_tree_hits
from ..exchange.trees import write_trees
from ..hazard.cell_tally import CellTally
from ..hazard.face_tally import FaceTally
from ..hazard.screen_tally import ScreenTally
from ..progress import Progress, silent
from ..remarks import Remark
from ..simulation.engine import Recorded, Simulation
from .maps import Mapped

MAPS, WITH_BARRIERS = "maps", "with_barriers"
LARGE = 20_000
"""From so many blocks on, motion in time is written only when it is asked for."""
HUGE = 1_000_000
"""From so many on, their impacts neither."""


def default_records(blocks: int) -> tuple[str, ...]:
    """The tables beside runs.csv where none are named."""
    return RECORDS if blocks < LARGE else (IMPACTS,) if blocks < HUGE else ()


def recorded_for(tables: Collection[str], structures: bool, screens: bool = False) -> Recorded:
    """What a simulation has to record for some of `RECORDS`, and for hits where there are structures or screens."""
    if TRAJECTORIES in tables or screens:
        return "all"
    return "impacts" if tables or structures else "ends"


def write_simulations(
    simulations: Sequence[Simulation],
    folder: Path,
    *,
    record: Collection[str],
    inputs: Mapping[str, Path],
    mapped: Mapped | None = None,
    remarks: Sequence[Remark] = (),
    progress: Progress = silent,
) -> list[str]:
    """Write runs.csv, what `record` names, hits.csv and screens.csv where there are such, maps, and summary.json.

    Where there are trees go trees.csv and, with impacts, tree_hits.csv.

    Parameters
    ----------
    simulations : of one ground and the same releases, one for each model.
    record : of `RECORDS`; the simulations must have been recorded for them.
    inputs : what it is → file, for the hashes in summary.json.
    mapped : what was counted of them: maps, see `write_all_maps`, and what passes screens.

    Returns
    -------
    The names of the files.

    Raises
    ------
    OSError : the folder cannot be written.
    """
    screens = NO_SCREENS if mapped is None else mapped.screens
    written = write_tables(simulations, folder, record=record, screens=screens, progress=progress)
    written += [] if mapped is None else write_all_maps(mapped, folder, progress)
    if screens:
        write_screens(screens, folder / "screens.csv")
        written.append("screens.csv")
    written += write_met_trees(simulations, folder)
    write_summary(summary(simulations, inputs, remarks), folder / "summary.json")
    return [*written, "summary.json"]


def write_met_trees(simulations: Sequence[Simulation], folder: Path) -> list[str]:
    """Write trees.csv where there are trees; returns its name."""
    trees = simulations[0].settings.trees
    if trees is None:
        return []
    write_trees(trees, simulations[0].ground.shift, folder / "trees.csv")
    return ["trees.csv"]


def write_all_maps(mapped: Mapped, folder: Path, progress: Progress = silent) -> list[str]:
    """Write all maps; returns the names of their folders.

    Those of one model go to maps/, those of several to maps/MODEL/. They are of the blocks as they fall; where there
    are barriers, those of the blocks that these leave have the same names in a folder with_barriers/ there.
    """
    written, models = [], list(dict.fromkeys([*mapped.cells, *mapped.faces]))
    for model in models:
        place = folder / MAPS if len(models) == 1 else folder / MAPS / model
        settings = mapped.simulations[0].settings
        about, said = {"MODEL": model, "SEED": str(settings.seed)}, model
        if settings.trees is not None:
            about["TREES"], said = str(len(settings.trees)), f"{model} among {len(settings.trees)} trees"
        kinds: list[tuple[Path, CellTally | None, FaceTally | None, Mapping[str, str], str]] = [
            (place, mapped.cells.get(model), mapped.faces.get(model), about, said)
        ]
        if model in mapped.held_cells or model in mapped.held_faces:
            held = (mapped.held_cells.get(model), mapped.held_faces.get(model))
            kinds.append((place / WITH_BARRIERS, *held, about | {"BARRIERS": "yes"}, f"{said}, with the barriers"))
        for where, cells, faces, facts, words in kinds:
            written.append(f"{where.relative_to(folder).as_posix()}/")
            _write_maps(mapped.simulations[0], cells, faces, where, facts, words, progress)
    return written


def _write_maps(
    simulation: Simulation,
    cells: CellTally | None,
    faces: FaceTally | None,
    place: Path,
    about: Mapping[str, str],
    said: str,
    progress: Progress,
) -> None:
    ground = simulation.ground
    if faces is not None:
        progress("Writing the maps of faces", 0, 0)
        write_face_maps(faces.maps(ground), place, ground.shift, about)
    if cells is not None:
        maps, releases = cells.maps(), simulation.releases.position
        write_maps(maps, ground.terrain, place, ground.shift, about, progress)
        draw_maps(maps, ground.terrain, place, said=said, releases=releases, progress=progress)


def write_tables(
    simulations: Sequence[Simulation],
    folder: Path,
    *,
    record: Collection[str],
    screens: Mapping[str, ScreenTally] = NO_SCREENS,
    drawn: Sequence[str] | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Write the tables of `write_simulations` but for screens.csv and summary.json; `drawn` as in `write_runs`."""
    progress("Writing the tables", 0, 0)
    write_runs(simulations, folder / "runs.csv", drawn)
    written = ["runs.csv"]
    if IMPACTS in record:
        write_simulated_impacts(simulations, folder / "impacts.csv", progress=progress)
        written.append("impacts.csv")
    if IMPACTS in record and simulations[0].settings.trees is not None:
        write_tree_hits(simulations, folder / "tree_hits.csv")
        written.append("tree_hits.csv")
    if TRAJECTORIES in record:
        write_simulated_trajectories(simulations, folder / "trajectories.csv", progress=progress)
        written.append("trajectories.csv")
    if simulations[0].ground.structures or screens:
        write_hits(simulations, folder / "hits.csv", screens)
        written.append("hits.csv")
    return written
