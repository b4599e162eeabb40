# SPDX-License-Identifier: GPL-3.0-or-later
"""``rockfall spin``: one point of the block marked in two pictures or more → angular velocities with errors."""

import argparse
from typing import TYPE_CHECKING

from .options import add_out, naming
from .progress import PrintedProgress

if TYPE_CHECKING:
    from ..reconstruction.flight_spins import FlightSpin
    from ..workflow.spins import MeasuredSpins


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "project",
        metavar="PROJECT",
        help="a project (.toml, .blend), with videos that have a camera and a table of spin_marks",
    )
    add_out(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure the spins, write the tables, print the summary."""
    from ..exchange.project import read_project
    from ..exchange.spin_tables import write_spins
    from ..exchange.tables import write_impacts, write_picks
    from ..output import output_folder
    from ..workflow.footage import read_marked_videos
    from ..workflow.opening import open_terrain, read_project_picks, reconstruct_project
    from ..workflow.spins import measure_spins, with_spins

    with output_folder(arguments.out) as folder, PrintedProgress() as progress, naming(arguments.project):
        progress(f"Reading {arguments.project}")
        project = read_project(arguments.project)
        surface = open_terrain(project)
        picks, notes = read_project_picks(project, surface)
        videos, turned = read_marked_videos(project, surface, picks.shift)
        progress("Reconstructing")
        made = reconstruct_project(project, surface, picks)
        spins = measure_spins(made, videos, surface)
        made = reconstruct_project(project, surface, with_spins(made.picks, spins))
        progress("Writing the tables")
        write_spins(spins.flights, folder / "spin.csv")
        write_picks(made.picks, folder / "picks.csv")
        write_impacts(made.impacts, folder / "impacts.csv")
    for line in (*notes, *turned, *_summary(spins)):
        print(line)
    print(f"Written: spin.csv, picks.csv, impacts.csv in {arguments.out}")
    return 0


def _summary(spins: "MeasuredSpins") -> list[str]:
    known = [flight for flight in spins.flights if flight.spin is not None]
    count, there = len(known), len(spins.flights)
    lines = [f"The spin of {count} of {there} marked {'flight' if there == 1 else 'flights'} is known."]
    for flight in spins.flights:
        lines.append(f"{flight.trajectory}, flight {flight.flight}: {_measured(flight)}")
        lines += [f"  {remark}" for remark in flight.remarks]
    if known:
        lines.append("In impacts.csv it is omega1x_radps …, for compare --spin table and simulate --from-impacts.")
    return [*lines, *map(str, spins.remarks)]


def _measured(flight: "FlightSpin") -> str:
    from ..reconstruction.spin_marks import AXIS_WORDS

    if flight.spin is None:
        return "not known."
    return (
        f"{flight.turns_per_s:.2f} ± {flight.sigma_turns_per_s:.2f} turns/s, ω = {flight.spin.rate:.1f} ± "
        f"{flight.spin.sigma_rate:.1f} rad/s, {flight.energy_j / 1e3:.3g} ± {flight.sigma_energy_j / 1e3:.2g} kJ "
        f"({flight.mark_time_s.size} marks; axis {AXIS_WORDS[flight.axis]})"
    )
