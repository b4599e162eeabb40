# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs and their maps: every block is followed through the cells, whatever is recorded of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..errors import InputError
from ..hazard.cell_tally import CellTally
from ..hazard.cells import cells_over
from ..hazard.face_tally import FaceTally
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import Screen, check_screens
from ..hazard.tally import Tally
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..remarks import Remark
from ..simulation.engine import Recorded, Settings, Simulation, check_settings, joined
from ..simulation.ground import Ground
from ..simulation.release import Releases
from ..terrain.cloud import Cloud
from .enough import is_known
from .hazard import run_chunks

FEW = 20
"""Fewer blocks in a cell have no standard error of their 95 % values."""


@dataclass(frozen=True, eq=False)
class Mapped:
    """Simulations, and what was counted of them.

    Attributes
    ----------
    simulations : as those of `run_models`.
    cells : model → what its maps are made of. faces : model → contacts with each face.
    screens : model → what passes the screens.
    """

    simulations: tuple[Simulation, ...]
    cells: Mapping[str, CellTally]
    faces: Mapping[str, FaceTally]
    screens: Mapping[str, ScreenTally]


def map_models(
    ground: Ground,
    releases: Releases,
    settings: Sequence[Settings],
    cell_m: float | None,
    screens: Sequence[Screen] = (),
    *,
    faces: bool = False,
    until_known: float | None = None,
    record: Recorded = "ends",
    first_run: int = 0,
    threads: int | None = None,
    progress: Progress = silent,
) -> Mapped:
    """Let the same blocks fall once for each of the settings, map them, and look at what passes screens.

    Parameters
    ----------
    cell_m : side of the cells, which cover the terrain; None for no maps.
    faces : whether contacts with each face of the mesh are counted.
    until_known : end when the values that this share of the blocks does not exceed are known at the screens; the
        simulations then have the blocks that were enough.
    record, first_run, threads, progress : see `run_models`. The maps do not depend on what is recorded.

    Raises
    ------
    InputError : cells that cannot be, a terrain of points; see `run_models`.
    CancelledError : the work was ended before the first blocks were finished.
    """
    if not settings:
        raise InputError("There is no model to simulate with", advice="Give at least one impact model")
    check_screens(screens, ground)
    cells = None if cell_m is None else cells_over(ground.surface, cell_m)
    for one in settings:
        check_settings(ground, one)
    n, simulations = len(releases), list[Simulation]()
    if faces:
        check_faces(ground)
    maps, touched, passed = dict[str, CellTally](), dict[str, FaceTally](), dict[str, ScreenTally]()
    for place, one in enumerate(settings):
        parts, hits = list[Simulation](), ScreenTally(screens)
        of_cells, of_faces = None if cells is None else CellTally(cells), FaceTally(len(ground.owner))
        tallies: list[Tally] = [] if of_cells is None else [of_cells]
        tallies += [of_faces] if faces else []
        tallies += [hits] if screens else []

        def told(text: str, done: int = 0, _: int = 0, place: int = place, model: str = one.model) -> None:
            progress(f"{text} {find_model(model).title}", place * n + done, len(settings) * n)

        def enough(_: int, hits: ScreenTally = hits) -> bool:
            return until_known is not None and is_known(hits, until_known)

        try:
            counted = run_chunks(
                ground, releases, one, tallies, first_run=first_run, threads=threads, take=parts.append,
                record=record, enough=None if until_known is None else enough, progress=told,
            )  # fmt: skip
        except CancelledError:
            if not simulations:
                raise
            break
        whole = joined(parts, releases.take(slice(0, counted.blocks)))
        ended = until_known is not None and is_known(hits, until_known)
        wanted = counted.blocks if ended else n
        simulations.append(replace(whole, wanted=wanted, seconds=counted.seconds))
        if of_cells is not None:
            maps[one.model] = of_cells
        if faces:
            touched[one.model] = of_faces
        if screens:
            passed[one.model] = hits
        if counted.blocks < wanted:
            break
    return Mapped(tuple(simulations), maps, touched, passed)


def check_faces(ground: Ground) -> None:
    """Whether there are faces to be counted.

    Raises
    ------
    InputError : the blocks meet points.
    """
    if isinstance(ground.terrain, Cloud):
        raise InputError(
            "Blocks meet points, which have no faces to be mapped",
            file=ground.terrain.name,
            advice="Leave out --faces, or let blocks meet the surface (contact: mesh)",
        )


def map_remarks(tallies: Mapping[str, CellTally]) -> tuple[Remark, ...]:
    """What a user should know of maps: model → what they are made of."""
    remarks = []
    for model, tally in tallies.items():
        few, reached = tally.reached_by_few(FEW)
        cells = tally.cells
        title = find_model(model).title
        text = (
            f"Maps of {tally.blocks} blocks with {title}, in cells of {cells.size_m:g} m: {reached} cells are reached"
        )
        if few:
            text += f", {few} of them by fewer than {FEW} blocks, whose 95 % values have no standard error"
        remarks.append(Remark(f"{text}.", "warning" if 2 * few > reached else "note", "maps"))
    return tuple(remarks)
