# SPDX-License-Identifier: GPL-3.0-or-later
"""Back-analysis in the scene: what is asked, without Blender, and what is kept of the answer."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy

from ...core.analysis.back_analysis import BackAnalysis
from ...core.analysis.calibration import usual_names
from ...core.analysis.completeness import Completeness, parse_completeness
from ...core.analysis.priors import Prior, laws_in, make_priors
from ...core.analysis.sections import Section
from ...core.errors import RockfallError
from ...core.exchange.job_inputs import input_hashes
from ...core.exchange.simulation_entry import TABLE, ReleaseEntry, SimulationEntry
from ...core.exchange.tables import read_picks
from ...core.impact_models.registry import MODELS, find_model
from ...core.progress import Progress
from ...core.reconstruction.trajectory import Reconstruction
from ...core.remarks import Remark, to_plain
from ...core.simulation.ground import Ground
from ...core.simulation.parameter_draws import FRICTION_NAME
from ...core.terrain.surface import Surface
from ...core.workflow.back_analysis import back_analyse
from ...core.workflow.opening import reconstruct_project
from ...core.workflow.scenarios import placed_source
from ...core.workflow.simulation import ReleaseSource, Scenario, ground_of
from ...core.workflow.whole_runs import ObservedRuns, join_runs, measured_runs, stated_sections, stopped_runs
from . import (
    fingerprints,
    model_parameters,
    models,
    posterior,
    reconstruction,
    screens,
    simulated_sources,
    simulated_trees,
    simulated_zones,
    simulation_setup,
    store,
    structures,
    terrain,
)

CHOICES = [choice for choice in models.CHOICES if not MODELS[choice[0]].draws_from_impacts]
"""Models with coefficients."""
CENTRES = "centres"
"""Observed flights join what simulated ones do."""
VARIANTS = 64
"""Starts of each observed run, moved by the errors of its picks where these are known."""
UNSTATED = "UNSTATED"
"""Nothing is said of whether the observed runs are all that fell."""
MOST_FALLS = 100_000
STALE = "Picks, terrain or other settings were changed since: these are parameters of what was before. Analyse again."


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked, without Blender.

    Attributes
    ----------
    scenario : of the model alone, with what is not fitted.
    runs : gives the observed runs on a ground.
    sections : gives where they are compared, none for the usual ones.
    priors : of the parameters that are fitted.
    sets, rounds : of parameters.
    completeness : whether the observed runs are all that fell.
    observed : see `posterior.Kept`.
    print : of all that.
    remarks : what of the measured trajectories is missing.
    """

    scenario: Scenario
    runs: Callable[[Ground], ObservedRuns]
    sections: Callable[[Ground], tuple[Section, ...]]
    priors: tuple[Prior, ...]
    sets: int
    rounds: int
    completeness: Completeness
    observed: tuple[str, ...]
    print: str
    remarks: tuple[Remark, ...]


def missing(scene: bpy.types.Scene) -> str:
    """What is still needed, in a sentence; empty when all is there."""
    settings = scene.rockfall_back_analysis
    if not terrain.tiles(scene):
        return "Blocks fall on the terrain: import it first, in step 1."
    if not settings.source:
        return "Choose what blocks were observed: under Observed."
    if "SCENE" in settings.source and not store.has_role(scene, store.PICK_ROLE):
        return "Pick impacts first, or choose only tables of observed runs: they say which parameters fit."
    for kind, name in (("PICKS", "picks"), ("STOPS", "releases"), ("STOPS", "stops")):
        if kind in settings.source and not getattr(settings, name):
            return f"Choose the table of {name}."
    if scene.rockfall_simulation.contact != "mesh":
        return "Observed runs are on the surface: choose Blocks meet: Surface, under Motion."
    lines = screens.problem(scene) if settings.at_screens else ""
    return lines or simulated_trees.missing(scene) or structures.problem(scene)


def fitted_names(scene: bpy.types.Scene, model: str) -> tuple[str, ...]:
    """The parameters of a model that are fitted, and friction, in the order of its table."""
    words = scene.rockfall_back_analysis.names.split()
    chosen = [word.partition(".")[2] for word in words if word.partition(".")[0] == model]
    known = [spec.name for spec in find_model(model).parameters if not spec.choices]
    return tuple(name for name in (*known, FRICTION_NAME) if name in chosen) or (
        *(name for name in usual_names(find_model(model)) if name in known),
        FRICTION_NAME,
    )


def toggle(scene: bpy.types.Scene, model: str, name: str) -> None:
    """Fit a parameter, or leave it; the last one stays."""
    settings = scene.rockfall_back_analysis
    names = set(fitted_names(scene, model)) ^ {name}
    others = [word for word in settings.names.split() if word.partition(".")[0] != model]
    if names:
        settings.names = " ".join([*others, *(f"{model}.{each}" for each in sorted(names))])


def ask(scene: bpy.types.Scene) -> Question:
    """What is asked, as the scene has it now.

    Raises
    ------
    RockfallError : something is missing, or cannot be; a law that is none.
    """
    lacking = missing(scene)
    if lacking:
        raise RockfallError(lacking)
    settings = scene.rockfall_back_analysis
    model = find_model(settings.model)
    names, observed = fitted_names(scene, model.name), _observed_by(scene)
    priors = make_priors(model, list(names), laws_in(settings.priors))
    entry = replace(simulated_sources.motion_entry(scene), models=(model.name,), releases=ReleaseEntry())
    surface, known = simulation_setup.ground(scene), _print(scene, model.name, names, observed)
    runs, source, left_out = _observed(scene, entry, surface)
    scenario = simulation_setup.scenario_of(scene, entry, surface, source)
    return Question(
        replace(scenario, draws={}),
        runs,
        _sections(scene),
        priors,
        settings.sets,
        settings.rounds,
        completeness_of(scene),
        observed,
        known,
        left_out,
    )


def completeness_of(scene: bpy.types.Scene) -> Completeness:
    """Whether the observed runs are all that fell, as the scene states it."""
    settings = scene.rockfall_back_analysis
    if settings.completeness == "LONGEST":
        return Completeness("longest", settings.falls or None)
    return parse_completeness("" if settings.completeness == UNSTATED else settings.completeness.lower())


def keep_completeness(scene: bpy.types.Scene, stated: Completeness) -> None:
    """State it in the scene."""
    settings = scene.rockfall_back_analysis
    settings.completeness = stated.kind.upper() or UNSTATED
    settings.falls = min(stated.falls or 0, MOST_FALLS)


def _observed(
    scene: bpy.types.Scene, entry: SimulationEntry, surface: Surface
) -> tuple[Callable[[Ground], ObservedRuns], ReleaseSource, tuple[Remark, ...]]:
    """What gives the observed runs, and blocks for them; and what of the measured trajectories is missing.

    Raises
    ------
    RockfallError : no picks, or none that can be used; whatever is wrong with a table.
    """
    settings, project = scene.rockfall_back_analysis, reconstruction.project_settings(scene, [])
    made: list[Callable[[], Reconstruction]] = []
    left_out: tuple[Remark, ...] = ()
    if "SCENE" in settings.source:
        picks, left_out = reconstruction.good_picks(scene)
        made.append(partial(reconstruction.reconstruction_of(scene, picks, surface), flights=CENTRES))
    if "PICKS" in settings.source:
        how = replace(project, reconstruction=replace(project.reconstruction, flights=CENTRES))
        made.append(partial(reconstruct_project, how, surface, read_picks(_path(settings.picks), surface.shift)))
    stops = _path(settings.stops)
    table = replace(entry, releases=ReleaseEntry(TABLE, number=VARIANTS, file=_path(settings.releases)))
    placed = placed_source(table, project.block) if "STOPS" in settings.source else None

    def runs(ground: Ground) -> ObservedRuns:
        found = [measured_runs(ground, one(), VARIANTS) for one in made]
        return join_runs([*found, *([stopped_runs(ground, placed, stops)] if placed is not None else [])])

    return runs, lambda ground: runs(ground).releases, left_out


def _sections(scene: bpy.types.Scene) -> Callable[[Ground], tuple[Section, ...]]:
    """Where runs are compared, as the scene says it now."""
    settings, lines = scene.rockfall_back_analysis, []
    if settings.at_screens:
        lines = [Section(obj.name, line=screens.line_of(obj)[:, :2].copy()) for obj in screens.objects_of(scene)]
    return partial(stated_sections, contours=settings.contours, drops=settings.drops, lines=lines)


def _path(text: str) -> Path:
    return Path(bpy.path.abspath(text))


def run(question: Question, progress: Progress) -> BackAnalysis:
    """Find the posterior, without Blender.

    Raises
    ------
    RockfallError : whatever the core refuses.
    CancelledError : the work was ended.
    """
    progress("Preparing the ground", 0, 0)
    ground = ground_of(question.scenario)
    return back_analyse(
        ground, *question.runs(ground), question.scenario.settings[0], question.priors, question.sections(ground),
        sets=question.sets, rounds=question.rounds, completeness=question.completeness, progress=progress,
    )  # fmt: skip


def keep(scene: bpy.types.Scene, question: Question, found: BackAnalysis) -> None:
    """Keep the answer with the scene."""
    rows = [
        [one.name, one.unit, one.median, one.low, one.high, one.prior, to_plain(one.remarks), one.left]
        for one in found.estimates
    ]
    n, tables = len(found.observed), [Path(file).name for file in question.observed[1:3]]
    named = [name for name in tables if name]
    where = f" of {' and '.join(['this scene'] * ('SCENE' in question.observed[0]) + named)}" if named else ""
    said = f"{n} observed run{'s' * (n != 1)}{where}, {found.runs:,} simulated in {found.seconds:.0f} s."
    remarks = (*question.remarks, *found.remarks)
    posterior.keep(
        scene, found.model, found.draws, rows=rows, said=said, remarks=to_plain(remarks), print=question.print,
        observed=question.observed,
    )  # fmt: skip


def use_medians(scene: bpy.types.Scene) -> None:
    """Give the model, and the motion on the ground, the medians; blocks draw no more.

    Raises
    ------
    RockfallError : nothing is kept.
    """
    kept = posterior.kept_of(scene)
    if kept is None:
        raise RockfallError("There is no back-analysis: run one first.")
    medians = {row.name: float(f"{row.median:.4g}") for row in kept.rows}
    friction = medians.pop(FRICTION_NAME, None)
    if friction is not None:
        scene.rockfall_simulation.friction = friction
    if medians:
        model_parameters.keep(scene, kept.model, medians)
    scene.rockfall_back_analysis.draw = False


def is_stale(scene: bpy.types.Scene, kept: posterior.Kept) -> bool:
    """Whether it was computed from something else than the scene now says."""
    names = tuple(row.name for row in kept.rows)
    return bool(kept.print) and kept.print != _print(scene, kept.model, names, kept.observed)


def _observed_by(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Where the observed runs are asked for: the kinds, the files that these take, and the sections."""
    settings = scene.rockfall_back_analysis
    taken = (("PICKS", settings.picks), ("STOPS", settings.releases), ("STOPS", settings.stops))
    files = [file if kind in settings.source else "" for kind, file in taken]
    sections = (settings.contours.strip(), settings.drops.strip(), "screens" if settings.at_screens else "")
    return " ".join(sorted(settings.source)), *files, ";".join(sections)


def _print(scene: bpy.types.Scene, model: str, names: tuple[str, ...], observed: tuple[str, ...]) -> str:
    settings = scene.rockfall_simulation
    own = models.parameters_of(scene).get(model, {})
    parts = [
        fingerprints.ground(scene),
        fingerprints.ground_contents(scene),
        *_print_of_runs(scene, observed),
        sorted((name, value) for name, value in own.items() if name not in names),
        reconstruction.project_settings(scene, []).reconstruction,
        settings.rolling,
        settings.use_drag,
        None if FRICTION_NAME in names else store.double(settings.friction),
        *simulated_zones.fingerprint(scene),
        *structures.fingerprint(scene),
        *simulated_trees.fingerprint(scene),
    ]
    return hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()


def _print_of_runs(scene: bpy.types.Scene, observed: tuple[str, ...]) -> list[object]:
    """Of the observed runs; of tables by what they contain, wherever they are."""
    kinds, *files, sections = observed
    found: list[object] = [sections]
    if "SCENE" in kinds:
        found += [sorted(fingerprints.remembered(scene).items()), scene.get(store.BLOCKS, "")]
    if any(files):
        read = input_hashes({str(i): _path(file) for i, file in enumerate(files) if file})
        found += [kinds, reconstruction.project_settings(scene, []).block, read]
    if sections.endswith("screens"):
        broken = screens.problem(scene)
        found.append(broken or [(obj.name, screens.line_of(obj).tolist()) for obj in screens.objects_of(scene)])
    return found
