# SPDX-License-Identifier: GPL-3.0-or-later
"""A design sheet: what barriers must have, from many simulated blocks, with the evidence that these are like the real.

The numbers behind the page that an engineer hands over; `design_page` writes it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod

import numpy as np

from ..analysis.calibration import Calibration, calibrate, usual_names
from ..analysis.comparison import compare
from ..analysis.estimation import FitOptions
from ..analysis.scores import Score, scores
from ..errors import InputError
from ..hazard.cell_tally import CellTally
from ..hazard.cells import cells_over
from ..hazard.design import KNOWN_TO, ON, DesignValues, PartialFactors, Verdict, design_of
from ..hazard.maps import Maps
from ..hazard.screen_tally import ScreenTally
from ..hazard.screens import HELD, OUTCOMES, Screen, check_screens
from ..impact_models.registry import find_model
from ..progress import CancelledError, Progress, silent
from ..reconstruction.impact import Impacts
from ..reconstruction.trajectory import Reconstruction
from ..remarks import Remark, gravest_first
from ..simulation.convergence import fewest
from ..simulation.engine import Settings, Simulation, simulate
from ..simulation.ground import Ground
from ..simulation.parameter_draws import FRICTION_NAME
from ..simulation.release import Releases
from ..simulation.results import run_figures
from ..vectors import Array
from .barrier_verdicts import evidence_sentence, more_words, verdict_remark
from .enough import in_chance_order, is_known
from .hazard import Counted, run_chunks
from .screens import outside_remarks

DRAWN = 250
"""Runs of each model that are drawn, evenly among all."""
FEWEST_IMPACTS = 10
"""With fewer measured impacts nothing is said of how well a model fits them."""
ENERGY_LINES_DEG = (28.5, 32.0, 33.5)
"""Usual angles of the line from the release to the furthest stops (Jaboyedoff and Labiouse 2011)."""
SCORED = ("vn2_mps", "vt2_mps", "rn", "rt", "theta_dev_deg")
REPLICATES = 50


@dataclass(frozen=True, eq=False)
class Evidence:
    """How a model stands to the impacts that were measured on this site.

    Attributes
    ----------
    impacts, trajectories : that could be compared.
    scores : of the model with the parameters of the simulation; where blocks drew them, with their means.
    calibration : of its usual parameters to these impacts, with trajectories held out; None where it was not asked for
        or the impacts are too few.
    """

    impacts: int
    trajectories: int
    scores: tuple[Score, ...]
    calibration: Calibration | None


@dataclass(frozen=True, eq=False)
class ModelDesign:
    """What one model says.

    Attributes
    ----------
    settings, counted : what ran.
    tally : the hits of all screens.
    values : screen → what a barrier there must have; no entry where no block comes.
    evidence : None where nothing was measured here.
    maps : of all runs, without barriers; None where they were not asked for.
    drawn : some of the runs that were counted, for figures.
    energy_lines_deg : (n,) of those of them that come to rest, from the release to the stop.
    """

    settings: Settings
    counted: Counted
    tally: ScreenTally
    values: Mapping[str, DesignValues]
    evidence: Evidence | None
    maps: Maps | None
    drawn: Simulation
    energy_lines_deg: Array


@dataclass(frozen=True, eq=False)
class DesignSheet:
    """Everything that the page says.

    Attributes
    ----------
    title : of the site.
    ground, screens, factors : for which.
    models : one for each.
    measured : the trajectories that were filmed here; None without.
    limit : blocks that were to fall at most with each model, where they fell until the values were known; else None.
    remarks : what must be known, gravest first; those of `verdicts` are among them.
    verdicts : on each barrier and model, whether it is enough, with the evidence.
    """

    title: str
    ground: Ground
    screens: tuple[Screen, ...]
    factors: PartialFactors
    share: float
    models: tuple[ModelDesign, ...]
    measured: Reconstruction | None
    limit: int | None
    remarks: tuple[Remark, ...] = ()
    verdicts: tuple[tuple[Verdict, Remark], ...] = ()


def design_sheet(
    ground: Ground,
    releases: Releases,
    settings: Sequence[Settings],
    screens: Sequence[Screen],
    factors: PartialFactors,
    *,
    title: str = "",
    share: float | None = None,
    measured: Reconstruction | None = None,
    cell_m: float | None = None,
    until_known: bool = False,
    holdout: bool = True,
    threads: int | None = None,
    progress: Progress = silent,
) -> DesignSheet:
    """Simulate with each model, and find what barriers at the screens must have.

    Parameters
    ----------
    share : of the blocks that do not exceed the characteristic values; None takes that of the factors.
    measured : trajectories of this site, for the evidence.
    cell_m : side of the cells of maps; None for no maps.
    until_known : end as soon as the characteristic energy and height of every screen that blocks reach are known to
        `KNOWN_TO`, or as well as more blocks from the same places would tell; else all releases fall.
    holdout : whether the evidence tells how well a model predicts trajectories that it was not fitted to.

    Raises
    ------
    InputError : no screens, no block reaches any of them, a factor without a value, settings that cannot be.
    """
    if not screens:
        raise InputError("There is no screen to design for", advice="Draw a line across the slope, and name it")
    check_screens(screens, ground)
    share = factors.share if share is None else share
    if until_known:
        releases = in_chance_order(releases, settings[0].seed)
    models = []
    for one in settings:
        tally = ScreenTally(screens)
        cells = None if cell_m is None else CellTally(cells_over(ground.surface, cell_m))

        def enough(blocks: int, tally: ScreenTally = tally) -> bool:
            return is_known(tally, share)

        counted = run_chunks(
            ground,
            releases,
            one,
            [tally] if cells is None else [tally, cells],
            threads=threads,
            enough=enough if until_known else None,
            progress=progress,
        )
        if counted.blocks < counted.wanted and not (until_known and is_known(tally, share)):
            raise CancelledError
        places = int(np.unique(releases.place[: counted.blocks]).size)
        values = design_of(tally, factors, share, places)
        if not values:
            names = ", ".join(screen.name for screen in screens)
            raise InputError(
                f"None of {counted.blocks} blocks with {find_model(one.model).title} comes to {names}",
                advice="Draw a screen where blocks pass, or release more",
            )
        maps = None if cells is None else cells.maps()
        models.append(_model_design(ground, releases, one, counted, tally, values, measured, maps, holdout, progress))
    limit = len(releases) if until_known else None
    sheet = DesignSheet(title, ground, tuple(screens), factors, share, tuple(models), measured, limit)
    verdicts = tuple(_verdicts(sheet))
    remarks = gravest_first([*(remark for _, remark in verdicts), *_remarks(sheet)])
    return replace(sheet, remarks=tuple(remarks), verdicts=verdicts)


def _model_design(
    ground: Ground,
    releases: Releases,
    settings: Settings,
    counted: Counted,
    tally: ScreenTally,
    values: Mapping[str, DesignValues],
    measured: Reconstruction | None,
    maps: Maps | None,
    holdout: bool,
    progress: Progress,
) -> ModelDesign:
    progress(f"Runs of {find_model(settings.model).title} to draw", 0, 0)
    some = np.unique(np.linspace(0, counted.blocks - 1, min(DRAWN, counted.blocks)).astype(np.intp))
    drawn = simulate(ground, releases.take(some), settings, runs=some)  # of those that were counted, each as it was
    lines = np.degrees(run_figures(drawn).energy_line)[drawn.at_rest]
    evidence = None if measured is None else evidence_of(measured.impacts, settings, holdout, progress)
    return ModelDesign(settings, counted, tally, values, evidence, maps, drawn, lines[np.isfinite(lines)])


def evidence_of(
    impacts: Impacts, settings: Settings, holdout: bool = True, progress: Progress = silent
) -> Evidence | None:
    """How a model stands to measured impacts; None where they are too few to say."""
    model = find_model(settings.model)
    if model.draws_from_impacts:
        return None  # it is made of them
    progress(f"{model.title} against the measured impacts", 0, 0)
    try:
        predictions = compare(
            impacts, [model.name], {model.name: _parameters(settings)}, replicates=REPLICATES, seed=settings.seed
        )
    except InputError:  # none of them can be compared
        return None
    row = predictions.row
    if row.size < FEWEST_IMPACTS:
        return None
    marks = scores(impacts, predictions, SCORED, distances=False)
    found = None
    if holdout:
        options = FitOptions(resamples=50, seed=settings.seed)
        found = calibrate(impacts, model.name, usual_names(model), None, options, progress=progress)
    return Evidence(int(row.size), int(np.unique(impacts.trajectory[row]).size), marks, found)


def _parameters(settings: Settings) -> dict[str, object]:
    """Of the model; the means of those that each block drew."""
    drawn = {} if settings.draws is None else settings.draws.mean()
    return {**settings.parameters, **{name: value for name, value in drawn.items() if name != FRICTION_NAME}}


def held_share(tally: ScreenTally, screen: Screen) -> float:
    """The share of the hits of a barrier that it holds."""
    place = tally.screens.index(screen)
    figures = tally.figures(with_barriers=True)[place]
    return figures.outcomes[OUTCOMES[HELD]] / figures.hits if figures.hits else np.nan


def _verdicts(sheet: DesignSheet) -> Iterator[tuple[Verdict, Remark]]:
    """Of each barrier and model; the evidence stands before what follows from it."""
    for one in sheet.models:
        title = find_model(one.settings.model).title
        for screen in sheet.screens:
            values = one.values.get(screen.name)
            if values is not None:
                found = verdict_remark(values, title)
                if found is not None:
                    yield found
            elif screen.holds:
                yield "not_known", Remark(_no_block(screen.name, one, title), "warning", screen.name)


def _no_block(screen: str, one: ModelDesign, title: str) -> str:
    """0 of n: with 95 % certainty at most 3/n, since (1 − 3/n)ⁿ is 5 %."""
    most = 100 * (1 - 0.05 ** (1 / one.counted.blocks))
    return (
        f"No block of {one.counted.blocks} with {title} comes to {screen}: nothing is designed there. Up to "
        f"{most:.2g} % may come (95 % certain)."
    )


def _remarks(sheet: DesignSheet) -> list[Remark]:
    """What is not known, and why, beside the verdicts."""
    found, share = [*outside_remarks(sheet.screens, sheet.ground)], f"{100 * sheet.share:g} %"
    found += [remark for remark in sheet.ground.remarks if remark.severity == "warning"]
    for one in sheet.models:
        model, title = one.settings.model, find_model(one.settings.model).title
        for screen in sheet.screens:
            values = one.values.get(screen.name)
            if values is None:
                if not screen.holds:
                    found.append(Remark(_no_block(screen.name, one, title), "warning", screen.name))
                continue
            if not values.is_sample:
                text = (
                    f"Only {values.different} of {values.reach} blocks at {screen.name} differ with {title}: it gives "
                    "the same run to the same release. Release from an area, or blocks of several sizes; intervals are "
                    "not told."
                )
                found.append(Remark(text, "warning", screen.name))
            elif not values.is_known:
                text = (
                    f"The {share} values at {screen.name} have no upper bound with {title}, which takes "
                    f"{fewest(sheet.share)} independent blocks: nothing is designed there. {evidence_sentence(values)} "
                    f"{more_words(values).capitalize()}."
                )
                found.append(Remark(text, "warning", screen.name))
            elif values.known_to > KNOWN_TO:
                text = (
                    f"At {screen.name} the energy is known to {100 * values.energy_j.known_to:.0f} % and the height to "
                    f"{100 * values.height_m.known_to:.0f} % with {title}; {100 * KNOWN_TO:.0f} % is usual."
                )
                if values.more is not None:
                    text += f" {more_words(values).capitalize()}."
                found.append(Remark(text, "advice", screen.name))
        if sheet.limit is not None and one.counted.blocks == sheet.limit and not is_known(one.tally, sheet.share):
            text = f"The limit of {sheet.limit} blocks ended the simulation with {title} before all values were known."
            found.append(Remark(text, "advice", model))
        if one.evidence is None:
            text = (
                f"Nothing measured on this site supports {title} here: its parameters are taken on trust."
                if sheet.measured is None
                else f"Too few impacts were measured here to tell how well {title} fits them."
            )
            found.append(Remark(text, "warning", model))
    unverified = sheet.factors.unverified(*ON)
    if unverified:
        names = ", ".join(f"{factor.symbol} = {factor.value:g}" for factor in unverified)
        text = (
            f"The needed values have in them factors that are not verified: {names}, together × "
            f"{prod(factor.value for factor in unverified):.3g}. Check them against the standard before you sign."
        )
        found.append(Remark(text, "warning", "factors"))
    trees = sheet.models[0].settings.trees
    if trees is not None:
        text = (
            f"All values count on {len(trees)} trees that stand for every block, and a law that knows little of them: "
            "compare with a sheet without trees."
        )
        found.append(Remark(text, "warning", "trees"))
    return found
