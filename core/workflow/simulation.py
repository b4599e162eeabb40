# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole rockfalls: what is stated of them becomes a ground and releases, and the models run one after the other."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..analysis.likelihood_free import weighted_quantiles
from ..analysis.measured_rebounds import beyond_measured, beyond_sentence, measured_sentence
from ..constants import GRAVITY_MPS2
from ..errors import InputError
from ..georeference import code_remarks
from ..hazard.screens import Screen
from ..impact_models.machinery.measured import MeasuredRebounds
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..reconstruction.drag import Drag
from ..remarks import Remark, Severity, gravest_first
from ..simulation.engine import (
    ENDS,
    FRICTION,
    IMPACT,
    LEFT_TERRAIN,
    LIMIT,
    STOPPED,
    Recorded,
    Rolling,
    Settings,
    Simulation,
    check_settings,
    simulate,
)
from ..simulation.ground import Ground, make_ground
from ..simulation.hits import hits_of
from ..simulation.parameter_draws import ParameterDraws
from ..simulation.release import Releases
from ..simulation.results import fell_through
from ..simulation.trees import LAW, NOT_KNOWN, Trees
from ..simulation.zones import Zones
from ..terrain.cloud import Cloud
from ..terrain.surface import Surface
from .mesh_fineness import fineness_remarks

type ReleaseSource = Callable[[Ground], Releases]
"""Puts the blocks on a ground: points, a line, a polygon, steep faces, measured releases, a table."""

DENSE = 3.0
"""Where points are further apart than the radius divided by this, blocks feel them one by one."""

END_WORDS = {
    STOPPED: "stopped",
    LEFT_TERRAIN: "left the terrain",
    LIMIT: "were cut off at the limit of time or impacts",
}
MOST_LOOKED_AT = 50_000
"""Impacts from which the share of those beyond the measured conditions is found."""
LONG_S = 1.0
"""Less need not be said."""
MUCH_BEYOND = 0.25
"""From this share on a result of the model observed is mostly one of conditions that nobody has measured."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """Everything that decides a simulation: the same scenario gives the same bits.

    Attributes
    ----------
    terrain : the surface, or the cloud whose points the blocks meet.
    releases : puts the blocks on the ground, with their sizes, densities, number and velocities.
    more_releases : k → the same with k times as many blocks, as far as no table says how many; None where it is not
        known how.
    models : name → the parameters that are not to have their default, for all zones; in the order in which they run.
    draws : name → what each block of this model draws its parameters from, and friction.
    measured : what the model observed draws from; None where it does not run.
    structures : name → walls, fences, roads, houses that stand on the terrain.
    screens : lines at which blocks are measured or held; they change nothing of the runs.
    zones : None for one that is everywhere.
    trees : stems that blocks meet; None for none.
    rolling, friction, drag, gravity_mps2, seed, most_impacts, most_s : see `Settings`.
    record : what to keep of the motion, see `engine.RECORDED`.
    """

    terrain: Surface | Cloud
    releases: ReleaseSource
    models: Mapping[str, Mapping[str, object]]
    measured: MeasuredRebounds | None = None
    structures: Mapping[str, Surface | Cloud] = field(default_factory=dict)
    screens: tuple[Screen, ...] = ()
    zones: Zones | None = None
    rolling: Rolling = "azzoni_1995"
    friction: float = FRICTION
    drag: Drag | None = None
    gravity_mps2: float = GRAVITY_MPS2
    seed: int = 0
    most_impacts: int = Settings.most_impacts
    most_s: float = Settings.most_s
    record: Recorded = "all"
    draws: Mapping[str, ParameterDraws] = field(default_factory=dict)
    trees: Trees | None = None
    more_releases: Callable[[int], ReleaseSource] | None = None

    @property
    def settings(self) -> tuple[Settings, ...]:
        """One for each model."""
        zones = {} if self.zones is None else self.zones.parameters
        return tuple(
            Settings(
                model,
                parameters,
                self.measured,
                zones={zone: models[model] for zone, models in zones.items() if model in models},
                rolling=self.rolling,
                friction=self.friction,
                zone_friction={} if self.zones is None else self.zones.friction,
                draws=self.draws.get(model),
                gravity_mps2=self.gravity_mps2,
                drag=self.drag,
                seed=self.seed,
                most_impacts=self.most_impacts,
                most_s=self.most_s,
                trees=self.trees,
            )
            for model, parameters in self.models.items()
        )


def ground_of(scenario: Scenario) -> Ground:
    """The terrain with its structures and zones.

    Raises
    ------
    InputError : see `make_ground`.
    """
    zones = scenario.zones
    if zones is None:
        return make_ground(scenario.terrain, scenario.structures)
    ground = make_ground(scenario.terrain, scenario.structures, zones.of_face, zones.names)
    return replace(ground, remarks=zones.remarks)


def run_scenario(
    scenario: Scenario, *, threads: int | None = None, progress: Progress = silent
) -> tuple[Simulation, ...]:
    """Prepare the ground, release the blocks and run all models; see `run_models`.

    Raises
    ------
    InputError : anything in the scenario that cannot be.
    CancelledError : the work was ended before the first blocks were finished.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(scenario)
    progress("Releasing the blocks", 0, 0)
    releases = scenario.releases(ground)
    return run_models(ground, releases, scenario.settings, record=scenario.record, threads=threads, progress=progress)


def run_models(
    ground: Ground,
    releases: Releases,
    settings: Sequence[Settings],
    *,
    record: Recorded = "all",
    first_run: int = 0,
    threads: int | None = None,
    progress: Progress = silent,
) -> tuple[Simulation, ...]:
    """Let the same blocks fall once for each of the settings.

    Parameters
    ----------
    settings : one for each model. With the same seed, run i has the same random numbers in all.
    record, first_run, threads : see `simulate`.
    progress : counts the blocks of all models. A `CancelledError` raised in it ends the work: models that are finished
        are kept, and of the one in progress the runs that are; `remarks_of` says so.

    Raises
    ------
    InputError : no model, one that is given twice, or settings that cannot be: before anything falls.
    CancelledError : the work was ended before the first blocks were finished.
    """
    check_models(ground, settings)
    n = len(releases)
    finished: list[Simulation] = []
    for place, one in enumerate(settings):
        counted = _among(progress, one.model, place * n, len(settings) * n)
        try:
            simulation = simulate(
                ground, releases, one, record=record, first_run=first_run, threads=threads, progress=counted
            )
        except CancelledError:
            if not finished:
                raise
            break
        finished.append(simulation)
        if len(simulation) < simulation.wanted:
            break
    return tuple(finished)


def check_models(ground: Ground, settings: Sequence[Settings]) -> None:
    """Look at all settings before anything falls.

    Raises
    ------
    InputError : no model, one that is given twice, or settings that cannot be.
    """
    models = [one.model for one in settings]
    if not models:
        raise InputError("There is no model to simulate with", advice="Give at least one impact model")
    for model in models:
        if models.count(model) > 1:
            raise InputError(f"The model {model} is given twice", advice="Give each model once")
    for one in settings:
        check_settings(ground, one)


def _among(progress: Progress, model: str, before: int, total: int) -> Progress:
    """The progress of one model among all."""

    def counted(text: str, done: int = 0, _: int = 0) -> None:
        progress(f"{text} {find_model(model).title}", before + done, total)

    return counted


def remarks_of(simulations: Sequence[Simulation], models: Sequence[str] = ()) -> tuple[Remark, ...]:
    """What a user should know of simulations on one ground from the same releases, the gravest first.

    Parameters
    ----------
    models : all that were to run, so that those are named which did not begin.
    """
    remarks = []
    begun = [simulation.settings.model for simulation in simulations]
    idle = [model for model in models if model not in begun]
    short = [simulation for simulation in simulations if len(simulation) < simulation.wanted]
    if short or idle:
        parts = [
            f"{len(one)} of {one.wanted} blocks with {find_model(one.settings.model).title} are finished and kept"
            for one in short
        ]
        parts += [f"not begun: {', '.join(find_model(model).title for model in idle)}"] if idle else []
        remarks.append(Remark(f"Stopped by you: {'; '.join(parts)}.", "warning", "cancelled"))
    for simulation in simulations:
        remarks += _remarks_of_one(simulation)
    ground = simulations[0].ground
    remarks += _remarks_of_trees(simulations[0].settings.trees)
    remarks += [*ground.remarks, *code_remarks(ground.shift.crs), *simulations[0].releases.remarks]
    remarks += _remarks_of_points(simulations[0])
    remarks += fineness_remarks(simulations)
    remarks += [Remark(text, "note", "terrain") for text in _fault_sentences(ground)]
    remarks += [Remark(f"No block meets {name}.", "note", name) for name in _not_met(simulations)]
    return tuple(gravest_first(remarks))


def _remarks_of_trees(trees: Trees | None) -> list[Remark]:
    """Which trees stand there, and what they stand for."""
    if trees is None:
        return []
    remarks = [Remark(text, "advice", "trees") for text in trees.left_out]
    mean, thickest = 100 * trees.dbh_m.mean(), 100 * trees.dbh_m.max()
    many = "1 tree" if len(trees) == 1 else f"{len(trees)} trees"
    text = f"Blocks meet {many}, {mean:.3g} cm thick on average and {thickest:.3g} cm at most. {LAW}"
    return [*remarks, Remark(f"{text} {NOT_KNOWN}", "note", "trees")]


def _fault_sentences(ground: Ground) -> list[str]:
    """What is wrong with the triangles, and how blocks meet them."""
    faults = ground.faults
    counted = [(ground.flat, "Triangles without area", "they were left out")]
    if faults is not None:
        counted += [
            (faults.twice, "Triangles that are there twice", "blocks meet them as one"),
            (faults.opposed_edges, "Edges between triangles of opposite winding", "blocks meet both sides alike"),
            (faults.branching_edges, "Edges of more than two triangles", "blocks meet each of them"),
            (faults.spikes, "Spikes in the terrain", "blocks meet them as they are"),
        ]
    return [f"{what}: {count}; {treatment}." for count, what, treatment in counted if count]


def _not_met(simulations: Sequence[Simulation]) -> list[str]:
    """Structures that no block hits, as far as impacts were recorded."""
    ground = simulations[0].ground
    met: set[int] = set()
    for simulation in simulations:
        records = simulation.records
        rows = np.flatnonzero(records.what == IMPACT)
        if rows.size < simulation.impacts.sum():
            return []
        met |= set(np.unique(ground.owner[records.face[rows]]).tolist())
    return [name for place, name in enumerate(ground.structures, 1) if place not in met]


def _remarks_of_points(simulation: Simulation) -> list[Remark]:
    """How dense a cloud is for its blocks."""
    remarks = []
    least = float(simulation.releases.radius_m.min())
    for name, spacing in simulation.ground.spacing_m.items():
        text = f"Blocks meet the points of {name}, {spacing:.3g} m apart"
        if least < DENSE * spacing:
            text += (
                f": that is coarse for the smallest radius of {least:.3g} m, for which they are to be "
                f"{least / DENSE:.2g} m apart at the most. Such blocks feel single points as roughness."
            )
            remarks.append(Remark(text, "warning", "terrain"))
        else:
            remarks.append(Remark(f"{text}.", "note", "terrain"))
    return remarks


def _remarks_of_one(simulation: Simulation) -> list[Remark]:
    """How the runs with one model ended."""
    remarks, model = [], simulation.settings.model
    title = find_model(model).title
    n, counts = len(simulation), np.bincount(simulation.end, minlength=len(simulation.ends))
    limited = counts[ENDS.index(LIMIT)]
    if limited:
        text = f"{limited} of {n} blocks with {title} {END_WORDS[LIMIT]}: they are not at rest."
        remarks.append(Remark(text, "warning", model))
    through = int(fell_through(simulation).sum())
    if through:
        text = f"{through} of {n} blocks with {title} fell through the terrain: it has holes larger than they are."
        remarks.append(Remark(text, "warning", model))
    stayed = int((simulation.at_rest & (simulation.length_m < 2 * simulation.releases.radius_m)).sum())
    if stayed:
        text = (
            f"{stayed} of {n} blocks with {title} stopped within their own diameter: the ground holds them where they "
            "are released. Release them from steeper ground, above it, or with a velocity."
        )
        remarks.append(Remark(text, "warning" if 2 * stayed > n else "note", model))
    held = {f"structure:{name}": f"held by {name}" for name in simulation.ground.structures}
    words = END_WORDS | held
    ends = zip(simulation.ends, counts.tolist(), strict=True)
    ended = ", ".join(f"{count} {words[name]}" for name, count in ends if count)
    text = f"{n} blocks with {title}, {simulation.impacts.sum()} impacts: {ended}."
    remarks.append(Remark(text, "note", model))
    if simulation.settings.trees is not None:
        text = (
            f"{np.count_nonzero(simulation.tree_hits)} of {n} blocks with {title} hit trees, "
            f"{simulation.tree_hits.sum()} times."
        )
        remarks.append(Remark(text, "note", model))
    remarks += _hit_structures(simulation)
    flat = np.hypot(*(simulation.position - simulation.releases.position)[:, :2].T)
    text = (
        f"Run-out in plan {np.median(flat):.1f} m (median), {flat.max():.1f} m at most; speeds up to "
        f"{simulation.v_max_mps.max():.1f} m/s."
    )
    if simulation.seconds >= LONG_S:
        text += f" It took {simulation.seconds:.0f} s."
    remarks.append(Remark(text, "note", model))
    if simulation.settings.draws is not None:
        remarks.append(Remark(_drawn_sentence(simulation.settings.draws), "note", model))
        remarks += [Remark(f"The back-analysis: {one}", "warning", model) for one in simulation.settings.draws.doubts]
    measured = simulation.settings.measured
    if measured is not None and find_model(model).draws_from_impacts:
        remarks.append(Remark(measured_sentence(measured), "note", model))
        remarks += _beyond(simulation, measured)
    return remarks


def _drawn_sentence(draws: ParameterDraws) -> str:
    """What each block drew, for people."""
    ends = np.array([0.025, 0.975])
    spans = [
        "{} from {:.3g} to {:.3g}".format(name, *weighted_quantiles(column, draws.weight, ends).tolist())
        for name, column in zip(draws.names, draws.values.T, strict=True)
    ]
    return (
        f"Each block drew its {', '.join(spans)} (95 % of the draws): the results show what is not known of these, "
        "and not chance alone."
    )


def _hit_structures(simulation: Simulation) -> list[Remark]:
    """How many blocks hit each structure, as far as impacts were recorded."""
    structures = simulation.ground.structures
    if not structures or np.count_nonzero(simulation.records.what == IMPACT) < simulation.impacts.sum():
        return []
    hits, remarks, title = hits_of(simulation), [], find_model(simulation.settings.model).title
    run = simulation.records.run[hits.record]
    for place, name in enumerate(structures):
        own = hits.structure == place
        if own.any():
            blocks, beyond = np.unique(run[own]).size, np.unique(run[own & hits.passes]).size
            text = f"{blocks} of {len(simulation)} blocks with {title} hit {name}, {own.sum()} times"
            remarks.append(Remark(f"{text}; {beyond} of them went on beyond it.", "note", name))
    return remarks


def _beyond(simulation: Simulation, measured: MeasuredRebounds) -> list[Remark]:
    """How many of the impacts are beyond the measured conditions."""
    records = simulation.records
    rows = np.flatnonzero(records.what == IMPACT)
    if simulation.recorded == "ends":
        text = "No impacts were recorded: how many are beyond the measured conditions is not known."
        return [Remark(text, "note", simulation.settings.model)]
    if not rows.size:
        return []
    rows = rows[:: 1 + rows.size // MOST_LOOKED_AT]
    settings = find_model(simulation.settings.model).settings(simulation.settings.parameters)
    beyond = beyond_measured(measured, settings, records.v1[rows], records.normal[rows])
    severity: Severity = "warning" if beyond.mean() > MUCH_BEYOND else "note"
    return [Remark(beyond_sentence(beyond), severity, simulation.settings.model)]
