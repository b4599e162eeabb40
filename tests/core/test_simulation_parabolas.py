# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion as parabolas against the records that it is made of, and against flights that are integrated."""

import numpy as np
import pytest
from rockfall.core.georeference import GlobalShift
from rockfall.core.reconstruction.drag import Drag
from rockfall.core.reconstruction.free_flight import fly
from rockfall.core.simulation.engine import ENDS, Settings, Simulation, simulate
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.parabolas import Parabolas, parabolas_of, polylines_of
from rockfall.core.simulation.release import make_releases
from rockfall.core.terrain.surface import Surface

TOLERANCE_M = 0.01


@pytest.fixture(scope="module", params=["none", "drag"])
def simulation(request: pytest.FixtureRequest) -> Simulation:
    """Blocks down a rough slope that ends on a plain: they fly, roll, stop, and some leave."""
    line = np.arange(120.0)
    x, y = (values.ravel() for values in np.meshgrid(line, line[:60]))
    z = -0.7 * np.minimum(x, 60) - 0.05 * np.maximum(x - 60, 0) + 0.3 * np.sin(x / 3) * np.cos(y / 4)
    i = np.arange(60 * 120).reshape(60, 120)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1)
    vertices = np.column_stack([x, y, z])
    terrain = Surface(vertices, corners.reshape(-1, 3).astype(np.int32), GlobalShift(), "slope")
    rng = np.random.default_rng(3)
    places = np.column_stack([rng.uniform(4, 12, 80), rng.uniform(1, 58, 80), np.full(80, 1.0)])
    velocity = np.tile([6.0, 0.0, 2.0], (80, 1))
    velocity[::8, 1] = 12.0  # over the edge
    releases = make_releases(places, velocity=velocity, diameter_m=0.4)
    settings = Settings("noel_2017", drag=Drag() if request.param == "drag" else None, seed=5)
    return simulate(make_ground(terrain), releases, settings)


@pytest.fixture(scope="module")
def parabolas(simulation: Simulation) -> Parabolas:
    return parabolas_of(simulation, TOLERANCE_M)


def test_every_recorded_moment_is_on_them(simulation: Simulation, parabolas: Parabolas) -> None:
    records = simulation.records
    for run in range(len(simulation)):
        own = np.flatnonzero(parabolas.run == run)
        rows = np.flatnonzero(records.run == run)
        piece = own[np.searchsorted(parabolas.start_s[own], records.time_s[rows], side="right") - 1]
        elapsed = np.minimum(records.time_s[rows] - parabolas.start_s[piece], parabolas.duration_s[piece])
        there, _ = parabolas.states(piece, elapsed)
        assert np.abs(there - records.position[rows]).max() < TOLERANCE_M * 1.01
    assert {"stopped", "left_terrain"} <= {ENDS[end] for end in simulation.end.tolist()}, "the case has both"


def test_they_follow_each_other_without_gaps(simulation: Simulation, parabolas: Parabolas) -> None:
    same = np.flatnonzero(parabolas.run[:-1] == parabolas.run[1:])
    end = parabolas.start_s[same] + parabolas.duration_s[same]
    np.testing.assert_allclose(end, parabolas.start_s[same + 1], atol=1e-9)
    there, _ = parabolas.states(same, parabolas.duration_s[same])
    assert np.abs(there - parabolas.position[same + 1]).max() < TOLERANCE_M * 1.01
    stopped = simulation.end == ENDS.index("stopped")
    last = np.append(np.flatnonzero(np.diff(parabolas.run)), len(parabolas) - 1)
    np.testing.assert_array_equal(np.isinf(parabolas.duration_s[last]), stopped)
    np.testing.assert_allclose(parabolas.position[last][stopped], simulation.position[stopped])


def test_flights_are_those_of_the_equation_of_motion(simulation: Simulation, parabolas: Parabolas) -> None:
    """Between the records too: the first flights, integrated from the releases."""
    releases, settings = simulation.releases, simulation.settings
    first = np.searchsorted(simulation.records.run, np.arange(len(simulation)))
    whole = simulation.records.time_s[first + 1]
    for part in (0.11, 0.5, 0.83):
        exact, _ = fly(
            releases.position,
            releases.velocity,
            part * whole,
            settings.gravity_mps2,
            releases.drag_per_m(settings.drag),
        )
        for run in range(len(simulation)):
            own = np.flatnonzero(parabolas.run == run)
            piece = own[np.searchsorted(parabolas.start_s[own], part * whole[run], side="right") - 1]
            there, _ = parabolas.states(np.array([piece]), np.array([part * whole[run] - parabolas.start_s[piece]]))
            assert np.linalg.norm(there[0] - exact[run]) < (1e-9 if settings.drag is None else TOLERANCE_M)


def test_steps_on_the_ground_need_few(simulation: Simulation, parabolas: Parabolas) -> None:
    assert len(parabolas) < 0.9 * len(simulation.records)


def test_lines_are_within_their_tolerance(parabolas: Parabolas) -> None:
    lines = polylines_of(parabolas, 0.05)
    for run in np.unique(parabolas.run).tolist():
        own = lines.run == run
        assert (np.diff(lines.time_s[own]) >= 0).all()
        pieces = np.flatnonzero((parabolas.run == run) & np.isfinite(parabolas.duration_s))
        for part in (0.0, 0.3, 0.5, 0.9):
            elapsed = part * parabolas.duration_s[pieces]
            there, _ = parabolas.states(pieces, elapsed)
            time = parabolas.start_s[pieces] + elapsed
            drawn = np.column_stack(
                [np.interp(time, lines.time_s[own], lines.position[own, axis]) for axis in range(3)]
            )
            assert np.linalg.norm(drawn - there, axis=1).max() < 0.05 + TOLERANCE_M
