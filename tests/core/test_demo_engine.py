# SPDX-License-Identifier: GPL-3.0-or-later
"""The simulation against the code that made the demo site, which shares nothing with it: first contacts and rebounds.

Where they differ by definition: the demo's blocks leave a mean normal of 0.6 m, tilted at random as for an angular
block; the simulation's leave the normal of the contact. So single flights and single rebounds are compared, not falls.
"""

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from rockfall.core.constants import GRAVITY_MPS2
from rockfall.core.exchange.csv_text import read_table
from rockfall.core.exchange.project import read_project
from rockfall.core.georeference import GlobalShift
from rockfall.core.impact_models import noel_2017
from rockfall.core.simulation.engine import IMPACT, Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import make_releases
from rockfall.core.simulation.results import flights_of, run_figures
from rockfall.core.terrain.readers import read_terrain
from rockfall.core.terrain.surface import Surface
from rockfall.core.vectors import unit
from scipy.stats import norm

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "assets" / "demo"

sys.path.insert(0, str(ROOT / "scripts"))
from making.demo_site import blocks, campaign  # noqa: E402


class Flight(NamedTuple):
    """From leaving the ground to the next contact, as the demo's own code has it."""

    centre: np.ndarray
    velocity: np.ndarray
    radius: float
    seconds: float
    impact: blocks.Impact


@pytest.fixture(scope="module")
def field() -> campaign.Campaign:
    return campaign.Campaign(2017)


@pytest.fixture(scope="module")
def flights(field: campaign.Campaign) -> list[Flight]:
    """All flights of the first throw of each of the fifteen blocks."""
    return [flight for block in range(campaign.BLOCKS) for flight in _flights(field.candidate(block, 0)[1])]


def _flights(run: blocks.Run) -> Iterator[Flight]:
    if run.impacts:
        yield Flight(run.release_centre, run.release_velocity, run.radius, run.impacts[0].time, run.impacts[0])
    for before, after in pairwise(run.impacts):
        yield Flight(before.centre, before.v2, run.radius, after.time - before.time, after)


def first_contacts(
    ground: Ground, centre: np.ndarray, velocity: np.ndarray, diameter_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Time, place of the centre, velocity and normal at the first impact of each block, of the simulation."""
    releases = make_releases(centre, velocity=velocity, diameter_m=diameter_m)
    records = simulate(ground, releases, Settings("noel_2017", most_impacts=1)).records
    hits = np.flatnonzero(records.what == IMPACT)
    np.testing.assert_array_equal(records.run[hits], np.arange(len(centre)))
    return records.time_s[hits], records.position[hits], records.v1[hits], records.normal[hits]


def test_greatest_heights_are_those_of_all_flights_looked_at_closely(field: campaign.Campaign) -> None:
    """Every 2 cm of every flight: none of these is higher than what is found, and one is nearly as high."""
    site = field.terrain
    ground = make_ground(Surface(site.vertices, site.faces, GlobalShift(), "gully"))
    throws = [field.candidate(block, 0)[1] for block in range(campaign.BLOCKS)]
    centre, velocity, diameter = (
        np.repeat([value(run) for run in throws], 12, axis=0)
        for value in (lambda run: run.release_centre, lambda run: run.release_velocity, lambda run: 2 * run.radius)
    )
    run = simulate(ground, make_releases(centre, velocity=velocity, diameter_m=diameter), Settings("noel_2017"))
    rows, duration = flights_of(run)
    true = np.full(len(run), -np.inf)
    for row, lasts in zip(rows.tolist(), duration.tolist(), strict=True):
        start, v = run.records.position[row], run.records.v2[row]
        t = np.linspace(0, lasts, 2 + int(np.hypot(*v[:2]) * lasts / 0.02))[:, None]
        place = start + v * t - [0.0, 0.0, GRAVITY_MPS2 / 2] * t**2
        heights = ground.heights_in_flight(place)
        true[run.records.run[row]] = max(true[run.records.run[row]], np.nanmax(heights, initial=-np.inf))
    found = run_figures(run).height_max_m
    assert np.median(true) > 2
    assert (found < true + 0.02).all()
    assert (found > true - 1e-9).all()


def test_first_contacts_are_those_of_the_demos_own_code(field: campaign.Campaign, flights: list[Flight]) -> None:
    assert len(flights) > 250
    site = field.terrain
    ground = make_ground(Surface(site.vertices, site.faces, GlobalShift(), "gully"))
    radius = np.array([flight.radius for flight in flights])
    time, place, velocity, normal = first_contacts(
        ground,
        np.array([flight.centre for flight in flights]),
        np.array([flight.velocity for flight in flights]),
        2 * radius,
    )
    centre = np.array([flight.impact.centre for flight in flights])
    np.testing.assert_allclose(np.linalg.norm(place - centre, axis=1), 0.0, atol=1e-4)
    np.testing.assert_allclose(time, [flight.seconds for flight in flights], atol=5e-5)
    np.testing.assert_allclose(velocity, [flight.impact.v1 for flight in flights], atol=5e-4)
    outward = unit(centre - [flight.impact.contact for flight in flights])
    np.testing.assert_allclose(normal, outward, atol=1e-3)


def test_first_contacts_are_those_of_the_shipped_truth() -> None:
    """Every flight between two impacts of truth.csv, on the terrain as it is stored."""
    source = read_project(DEMO / "project.toml").terrain
    assert source is not None
    surface = read_terrain(source.files[0], shift=source.global_shift, up=source.up)
    table = read_table(DEMO / "truth.csv", ("trajectory",), ())
    trajectory = np.array(table.text("trajectory"))
    before = np.flatnonzero(trajectory[1:] == trajectory[:-1])
    after = before + 1
    assert np.unique(trajectory[before]).size == 15
    leave = surface.shift.to_local(table.vectors(("leave_x_m", "leave_y_m", "leave_z_m")))
    centre = surface.shift.to_local(table.vectors(("x_m", "y_m", "z_m")))
    v1, v2 = (table.vectors(tuple(f"v{part}{axis}_mps" for axis in "xyz")) for part in (1, 2))
    time, place, velocity, _ = first_contacts(
        make_ground(surface), leave[before], v2[before], table.numbers("diameter_m")[before]
    )
    np.testing.assert_allclose(np.linalg.norm(place - centre[after], axis=1), 0.0, atol=1e-4)
    np.testing.assert_allclose(time, table.numbers("time_s")[after] - table.numbers("leave_time_s")[before], atol=5e-5)
    np.testing.assert_allclose(velocity, v1[after], atol=5e-4)


def test_the_model_rebounds_as_the_demos_own_code_does(flights: list[Flight]) -> None:
    """Noël et al. 2017 with the same draws, on the tilted normals that the demo's blocks met."""

    class Given:
        """A generator of one exponent and one tangential factor, which are so many standard deviations off."""

        def __init__(self, exponent: float, tangential: float) -> None:
            self.off = {-1.08: exponent, 0.69: tangential}

        def normal(self, mean: float, sd: float) -> float:
            return mean + self.off[mean] * sd

    rng = np.random.default_rng(5)
    parameters = noel_2017.MODEL.parameter_type(*noel_2017.MODEL.numbers({}))
    for flight in flights:
        impact, off = flight.impact, rng.standard_normal(2)
        v2, omega2 = blocks.rebound(
            impact.v1,
            impact.omega1,
            flight.radius,
            impact.effective_normal,
            Given(*off),  # type: ignore[arg-type]
        )
        found = noel_2017.rebound(
            tuple(impact.v1), tuple(impact.effective_normal), tuple(impact.omega1), flight.radius, 1.0,
            parameters, noel_2017.Draws(*norm.cdf(off)),
        )  # fmt: skip
        np.testing.assert_allclose(found[0], v2, atol=1e-9)
        np.testing.assert_allclose(found[1], omega2, atol=1e-8)
