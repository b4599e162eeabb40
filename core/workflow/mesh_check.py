# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a simulation depends on its triangles: the same blocks on a finer mesh of the same surface."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..impact_models.registry import find_model
from ..progress import Progress, silent
from ..remarks import Remark
from ..simulation.engine import Settings, simulate
from ..simulation.ground import Ground
from ..simulation.release import Releases, placed_on
from ..terrain.subdivision import subdivided
from ..terrain.surface import Surface
from ..vectors import Array, Indices, norm
from .mesh_fineness import COARSE, length, median_edge
from .simulation import Scenario, ground_of

BLOCKS = 200
"""So many blocks fall once more; that knows the mean run-out to some per cent."""
MOST_FACES = 4_000_000
"""No mesh with more triangles is made: they have to be held and indexed."""
LARGE = 0.05
"""A change of the run-out from which on it is no longer said in passing."""


@dataclass(frozen=True)
class MeshChange:
    """What a finer mesh changes for the same blocks of one model.

    Attributes
    ----------
    model : its name.
    blocks : how many fell on both meshes.
    edge_m, diameter_m : median edge of the finer mesh, and median diameter of the blocks.
    runout_m, refined_m : mean run-out in plan, on the mesh and on the finer one.
    change, error : (refined − mesh)/mesh of the mean run-out, and its standard error from the pairs.
    speed_change, speed_error : the same of the mean greatest speed.
    """

    model: str
    blocks: int
    edge_m: float
    diameter_m: float
    runout_m: float
    refined_m: float
    change: float
    error: float
    speed_change: float
    speed_error: float

    @property
    def within(self) -> float:
        """By how much the run-out may depend on the mesh: the change and twice its standard error."""
        return abs(self.change) + 2 * self.error

    @property
    def is_settled(self) -> bool:
        """Whether the finer mesh is fine enough for the blocks, so that still finer ones would change little more."""
        return self.edge_m <= COARSE * self.diameter_m


def refined_ground(scenario: Scenario, edge_m: float) -> tuple[Ground, float]:
    """The ground of a scenario with the triangles of its terrain divided, once or until their edges are short enough.

    Parameters
    ----------
    edge_m : the median length of edges to come to, as far as `MOST_FACES` allow it.

    Returns
    -------
    ground, edge_m : the median length of edges that it came to.

    Raises
    ------
    InputError : blocks meet points, or there are too many triangles.
    """
    terrain, zones = scenario.terrain, scenario.zones
    if not isinstance(terrain, Surface):
        raise InputError("Blocks meet points: there is no mesh to check", advice="Leave out --check-mesh")
    if 4 * len(terrain.faces) > MOST_FACES:
        raise InputError(
            f"The mesh has {len(terrain.faces)} triangles: too many to divide them for a check",
            advice=f"Check a part of the terrain, up to {MOST_FACES // 4} triangles",
        )
    median, times = median_edge(terrain), 0
    while 4 * len(terrain.faces) <= MOST_FACES and (times == 0 or median > edge_m):
        terrain, median, times = subdivided(terrain), median / 2, times + 1
    if zones is not None:
        zones = replace(zones, of_face=np.repeat(zones.of_face, 4**times))
    return ground_of(replace(scenario, terrain=terrain, zones=zones)), median


def mesh_changes(
    scenario: Scenario, ground: Ground, releases: Releases, *, blocks: int = BLOCKS, progress: Progress = silent
) -> tuple[MeshChange, ...]:
    """Let some of the blocks fall on the mesh and on a finer one, with the same random numbers.

    Triangles are divided once at least, and until their edges are half a diameter: one division alone of a mesh that is
    much coarser than the blocks changes less than what is still to come.

    Parameters
    ----------
    ground, releases : of the scenario. blocks : how many, spread evenly over all.

    Raises
    ------
    InputError : see `refined_ground`.
    """
    progress("Dividing the triangles", 0, 0)
    finer, edge = refined_ground(scenario, COARSE * float(np.median(releases.diameter_m)))
    count = min(blocks, len(releases))
    runs = np.unique(np.linspace(0, len(releases) - 1, count).astype(np.intp))
    some = releases.take(runs)
    there, then = (placed_on(one, some.position[:, :2], some.diameter_m)[:, 2] for one in (ground, finer))
    moved = some.position.copy()
    moved[:, 2] += np.nan_to_num(then - there)  # as high above the finer surface as above the mesh
    return tuple(
        _change(one, ground, finer, edge, some, replace(some, position=moved), runs, progress)
        for one in scenario.settings
    )


def _change(
    settings: Settings,
    ground: Ground,
    finer: Ground,
    edge_m: float,
    some: Releases,
    moved: Releases,
    runs: Indices,
    progress: Progress,
) -> MeshChange:
    one, other = (
        simulate(place, blocks, settings, record="ends", runs=runs, progress=progress)
        for place, blocks in ((ground, some), (finer, moved))
    )
    ways = [norm((run.position - run.releases.position)[:, :2]) for run in (one, other)]
    change, error = _relative(*ways)
    speed_change, speed_error = _relative(one.v_max_mps, other.v_max_mps)
    return MeshChange(
        settings.model, len(one), edge_m, float(np.median(some.diameter_m)), float(ways[0].mean()),
        float(ways[1].mean()), change, error, speed_change, speed_error,
    )  # fmt: skip


def _relative(before: Array, after: Array) -> tuple[float, float]:
    """The change of a mean as a part of it, and its standard error from the pairs; NaN where it is not known."""
    mean = float(before.mean())
    if not mean > 0:
        return float("nan"), float("nan")
    difference = after - before
    error = float(difference.std(ddof=1) / np.sqrt(len(difference))) if len(difference) > 1 else float("nan")
    return float(difference.mean()) / mean, error / mean


def change_remarks(changes: Sequence[MeshChange]) -> list[Remark]:
    """What a finer mesh changes, for people."""
    remarks = []
    for one in changes:
        title = find_model(one.model).title
        if not np.isfinite(one.change) or not np.isfinite(one.error):
            text = f"What a finer mesh changes with {title} is not known: too few blocks move."
            remarks.append(Remark(text, "warning", "mesh"))
            continue
        text = f"Run-out ± {100 * one.within:.2g} % by the mesh with {title}"
        if not one.is_settled:
            text = f"The run-out with {title} depends on the mesh by {100 * one.within:.2g} % or more"
        text += (
            f": on triangles divided to edges of {length(one.edge_m)} the mean run-out of {one.blocks} blocks changes "
            f"by {100 * one.change:+.1f} ± {100 * one.error:.1f} %, their greatest speed by "
            f"{100 * one.speed_change:+.1f} ± {100 * one.speed_error:.1f} % (standard errors)."
        )
        grave = not one.is_settled or abs(one.change) > max(LARGE, 2 * one.error)
        remarks.append(Remark(text, "warning" if grave else "note", "mesh"))
    return remarks
