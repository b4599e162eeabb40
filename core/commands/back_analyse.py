# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall back-analyse``: parameters with which whole runs come out as observed → posterior.csv, figures."""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from .fitting_options import wrapped
from .observed_run_options import add_observed_arguments, case_as_asked, sections_as_asked
from .options import figure_formats, whole
from .progress import PrintedProgress, stopped_by_interrupt

if TYPE_CHECKING:
    from ..analysis.back_analysis import BackAnalysis

SETS, ROUNDS = 2000, 3
VARIANTS = 64
"""Starts of each observed run, moved by the errors of its picks where these are known."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_observed_arguments(parser)
    parser.add_argument("--model", required=True, metavar="NAME", help="of the model (`rockfall models` lists them)")
    parser.add_argument(
        "--fit",
        action="extend",
        nargs="+",
        required=True,
        metavar="PARAMETER",
        help="parameters of the model that are numbers, and friction (of the motion on the ground)",
    )
    parser.add_argument(
        "--prior",
        action="extend",
        nargs="+",
        default=[],
        metavar="PARAMETER=LAW",
        help="what was thought possible before: LOW..HIGH or normal:MEAN,SD (default: anything in its range)",
    )
    parser.add_argument(
        "--sets", type=whole, default=SETS, metavar="N", help="of parameters in each round (default %(default)s)"
    )
    parser.add_argument(
        "--rounds",
        type=whole,
        default=ROUNDS,
        metavar="N",
        help="the first from the prior, the others around what fits (default %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate in rounds, write the tables, print the summary."""
    from ..analysis.priors import make_priors
    from ..exchange.parameters import write_parameters
    from ..exchange.posterior_tables import back_analysis_content, write_back_analysis, write_posterior
    from ..impact_models.registry import find_model
    from ..output import output_folder
    from ..simulation.parameter_draws import FRICTION_NAME
    from ..workflow.back_analysis import back_analyse, posterior_settings

    model = find_model(arguments.model)
    priors = make_priors(model, arguments.fit, _laws(arguments.prior))
    with output_folder(arguments.out) as folder, PrintedProgress() as progress:
        case = case_as_asked(arguments, (model.name,), VARIANTS, progress, "centres")
        settings = replace(case.scenario.settings[0], draws=None)
        for prior in priors:
            if any(text.partition("=")[0] == f"{model.name}.{prior.name}" for text in arguments.set):
                raise InputError(f"{prior.name} is both fitted and set", advice="Leave out one of the two")
        if arguments.friction is not None and any(prior.name == FRICTION_NAME for prior in priors):
            raise InputError("friction is both fitted and set", advice="Leave out one of the two")
        sections = sections_as_asked(arguments, case.ground)
        with stopped_by_interrupt(progress) as counted:
            done = back_analyse(
                case.ground, case.observed, case.releases, settings, priors, sections,
                sets=arguments.sets, rounds=arguments.rounds, completeness=case.completeness,
                threads=arguments.threads, progress=counted,
            )  # fmt: skip
        progress("Writing the tables")
        write_posterior(model.name, done.draws, folder / "posterior.csv")
        medians, friction = posterior_settings(done)
        write_parameters({model.name: model.settings(medians)}, folder / "parameters.toml")
        write_back_analysis(back_analysis_content(done, case.inputs), folder / "back_analysis.json")
        notes = [] if arguments.tables_only else _draw(arguments, done, folder, progress)
        names = ("posterior.csv", "back_analysis.json", "parameters.toml", "figures")
        written = [name for name in names if (folder / name).exists()]
    for line in (*_summary(done, friction), *notes):
        print(line)
    print(f"Written: {', '.join(written)} in {arguments.out}")
    return 0


def _laws(texts: list[str]) -> dict[str, str]:
    """PARAMETER=LAW texts as parameter → law."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, law = text.partition("=")
        if not (equals and name.strip() and law.strip()):
            raise InputError(f"--prior {text} gives no law", advice="Write PARAMETER=LOW..HIGH, as in rn=0.2..0.6")
        found[name.strip()] = law.strip()
    return found


def _summary(done: "BackAnalysis", friction: float) -> list[str]:
    lines = [line for remark in done.remarks if remark.severity != "note" for line in wrapped(str(remark))]
    runs, n = done.runs, len(done.observed)
    lines.append(
        f"{done.model}: {n} observed run{'s' * (n != 1)}, {runs} simulated in {done.seconds:.0f} s "
        f"({runs / done.seconds:.0f} a second)."
    )
    lines.append(
        f"{'parameter':<18}{'default':>10}{'median':>10}   {'95 % interval':<26}what was thought possible before"
    )
    for one in done.estimates:
        interval = f"{one.low:.4g} … {one.high:.4g} {one.unit}"
        before = f"{one.prior}: {one.left}"
        lines.append(f"{one.name:<18}{one.default:>10.4g}{one.median:>10.4g}   {interval:<26}{before}")
        lines += wrapped(one.verdict, "    ")
    if all(one.name != "friction" for one in done.estimates):
        lines.append(f"friction was {friction:g} throughout.")
    lines += _held_out(done)
    return lines + [line for remark in done.remarks if remark.severity == "note" for line in wrapped(str(remark))]


def _held_out(done: "BackAnalysis") -> list[str]:
    """How well runs held out are predicted, with the model and without it."""
    if not done.prediction.quantities:
        return []
    lines = [f"{'runs held out, mean CRPS':<38}{'runs':>6}{'fitted':>10}{'as it was':>11}{'observed runs alone':>21}"]
    for one in done.prediction.quantities:
        title = f"{one.title} [{one.unit}]" if one.unit else one.title
        scores = f"{one.fitted:>10.3g}{one.default:>11.3g}{one.observed_alone:>21.3g}"
        lines.append(f"{title:<38}{one.n:>6}{scores}{'' if one.helps else '   better without the model'}")
    return lines


def _draw(arguments: argparse.Namespace, done: "BackAnalysis", folder: Path, progress: PrintedProgress) -> list[str]:
    """The figures, if their library is there; else what to install."""
    from ..analysis.posterior_figures import PosteriorPicture, save_posterior_figures
    from ..analysis.run_statistics import plain_means
    from ..extras import FIGURES, install_command, is_there

    if not is_there(FIGURES):
        return [f"No figures without Matplotlib. Install it: {install_command(FIGURES)}"]
    progress("Drawing the figures")
    picture = PosteriorPicture(
        done.model, done.priors, done.draws.values, done.draws.weight, done.estimates, done.checks,
        plain_means(done.predicted, done.observed.seen),
    )  # fmt: skip
    save_posterior_figures(picture, folder / "figures", figure_formats(arguments))
    return []
