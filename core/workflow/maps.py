# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs and their maps: every block is followed through the cells, whatever is recorded of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ..errors import InputError
from ..hazard.barriers import HeldCellTally, HeldFaceTally
from ..hazard.cell_tally import CellTally
from ..hazard.cells import cells_over
from ..hazard.evidence import FEW
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

MAPS, FACES, SCREENS, HELD_MAPS, HELD_FACES = "maps", "faces", "screens", "held maps", "held faces"
"""Names of tallies: of the blocks as they fall, and of those that barriers leave."""


@dataclass(frozen=True, eq=False)
class Mapped:
    """Simulations, and what was counted of them.

    Attributes
    ----------
    simulations : as those of `run_models`.
    counted : model → name of a tally (see `tallies_for`) → what it has counted.
    """

    simulations: tuple[Simulation, ...]
    counted: Mapping[str, Mapping[str, Tally]]

    @property
    def cells(self) -> dict[str, CellTally]:
        """Model → what its maps are made of."""
        return self._all(MAPS, CellTally)

    @property
    def faces(self) -> dict[str, FaceTally]:
        """Model → contacts with each face."""
        return self._all(FACES, FaceTally)

    @property
    def screens(self) -> dict[str, ScreenTally]:
        """Model → what passes the screens."""
        return self._all(SCREENS, ScreenTally)

    @property
    def held_cells(self) -> dict[str, HeldCellTally]:
        """As `cells`, with the barriers; nothing where there are none."""
        return self._all(HELD_MAPS, HeldCellTally)

    @property
    def held_faces(self) -> dict[str, HeldFaceTally]:
        """As `faces`, with the barriers; nothing where there are none."""
        return self._all(HELD_FACES, HeldFaceTally)

    def _all[T](self, name: str, kind: type[T]) -> dict[str, T]:
        found = {model: tallies[name] for model, tallies in self.counted.items() if name in tallies}
        return {model: tally for model, tally in found.items() if isinstance(tally, kind)}


def tallies_for(ground: Ground, cell_m: float | None, faces: bool, screens: Sequence[Screen] = ()) -> dict[str, Tally]:
    """Name → an empty tally, for all that is to be counted; maps with barriers too where a screen holds blocks.

    Parameters
    ----------
    cell_m, faces, screens : see `map_models`.

    Raises
    ------
    InputError : cells or screens that cannot be, blocks that meet points.
    """
    check_screens(screens, ground)
    barriers, found = [screen for screen in screens if screen.holds], dict[str, Tally]()
    if cell_m is not None:
        cells = cells_over(ground.surface, cell_m)
        found[MAPS] = CellTally(cells)
        if barriers:
            found[HELD_MAPS] = HeldCellTally(cells, barriers)
    if faces:
        check_faces(ground)
        found[FACES] = FaceTally(len(ground.owner))
        if barriers:
            found[HELD_FACES] = HeldFaceTally(len(ground.owner), barriers)
    if screens:
        found[SCREENS] = ScreenTally(screens)
    return found


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
    wanted_tallies = tallies_for(ground, cell_m, faces, screens)
    for one in settings:
        check_settings(ground, one)
    n, simulations = len(releases), list[Simulation]()
    counts = dict[str, dict[str, Tally]]()
    for place, one in enumerate(settings):
        parts, hits = list[Simulation](), ScreenTally(screens)
        tallies = {name: tally.empty() for name, tally in wanted_tallies.items()} | ({SCREENS: hits} if screens else {})

        def told(text: str, done: int = 0, _: int = 0, place: int = place, model: str = one.model) -> None:
            progress(f"{text} {find_model(model).title}", place * n + done, len(settings) * n)

        def enough(_: int, hits: ScreenTally = hits) -> bool:
            return until_known is not None and is_known(hits, until_known)

        try:
            counted = run_chunks(
                ground, releases, one, list(tallies.values()), first_run=first_run, threads=threads, take=parts.append,
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
        counts[one.model] = tallies
        if counted.blocks < wanted:
            break
    return Mapped(tuple(simulations), counts)


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
            text += f", {few} of them by fewer than {FEW} blocks: they are hatched, and say little"
        remarks.append(Remark(f"{text}.", "warning" if 2 * few > reached else "note", "maps"))
    return tuple(remarks)
