# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs that are counted chunk by chunk: the same as all at once, for any threads; stopped when enough are known."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.screen_tally import ScreenTally
from rockfall.core.hazard.screens import Screen
from rockfall.core.progress import CancelledError
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow import hazard
from rockfall.core.workflow.maps import FACES, HELD_FACES, HELD_MAPS, MAPS, tallies_for
from rockfall.core.workflow.maps import SCREENS as SCREEN_TALLY

SETTINGS = Settings("noel_2017", seed=3)
SCREENS = (
    Screen("road", np.array([[60.0, -90.0], [60.0, 90.0]])),
    Screen("net", np.array([[30.0, -90], [30, 90]]), 1.0, 8e3),
)


@pytest.fixture(scope="module")
def ground() -> Ground:
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(-20, 150, 60), np.linspace(-90, 90, 50)))
    z = -0.8 * np.clip(x, -20, 60) - 0.2 * np.clip(x - 60, 0, None) + 0.3 * np.sin(x / 3) * np.cos(y / 4)
    i = np.arange(50 * 60).reshape(50, 60)
    corners = np.stack([i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[:-1, :-1], i[1:, 1:], i[1:, :-1]], axis=-1)
    faces = corners.reshape(-1, 3).astype(np.int32)
    return make_ground(Surface(np.column_stack([x, y, z]), faces, GlobalShift(), "slope"))


@pytest.fixture(scope="module")
def releases() -> Releases:
    rng = np.random.default_rng(7)
    places = np.column_stack([rng.uniform(-10, 0, 500), rng.uniform(-60, 60, 500), np.full(500, 12.0)])
    return make_releases(places, diameter_m=rng.uniform(0.3, 0.6, 500))


def same(a: ScreenTally, b: ScreenTally) -> None:
    ours, theirs = a.arrays(), b.arrays()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=name)


def test_chunks_give_what_all_runs_at_once_give(
    ground: Ground, releases: Releases, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = simulate(ground, releases, SETTINGS)
    whole = ScreenTally(SCREENS)
    whole.add(simulation)
    for size, threads in ((64, 1), (150, 2)):
        monkeypatch.setattr(hazard, "AT_ONCE", size)
        tally = ScreenTally(SCREENS)
        counted = hazard.run_chunks(ground, releases, SETTINGS, [tally], threads=threads)
        same(tally, whole)
        assert counted.blocks == 500
        assert counted.impacts == simulation.impacts.sum()
        assert sum(counted.ends.values()) == 500


def test_behind_barriers_what_they_hold_is_missing(ground: Ground, releases: Releases) -> None:
    """Blocks that a barrier holds come to rest in its cells, as many as the screens say, and reach none below."""
    tallies = tallies_for(ground, 1.0, True, SCREENS)
    hazard.run_chunks(ground, releases, SETTINGS, list(tallies.values()))
    free, held, together = tallies[MAPS].maps(), tallies[HELD_MAPS].maps(), tallies[SCREEN_TALLY]
    net = together.figures(with_barriers=True)[1]
    assert 0 < net.outcomes["held"] < net.hits
    rest = [np.nansum(maps.layers["Nr_deposited"]) for maps in (free, held)]
    left = together.blocks - rest[0]  # over the edge of the terrain
    assert rest[0] <= rest[1] <= rest[0] + left
    blocks = [np.nan_to_num(maps.layers["Nr_blocks"]) for maps in (free, held)]
    assert (blocks[1] <= blocks[0]).all()
    assert blocks[1].sum() < blocks[0].sum()
    contacts = [np.nansum(tallies[name].layers()["Nr_contacts"]) for name in (FACES, HELD_FACES)]
    assert contacts[1] < contacts[0]


def test_it_ends_when_enough_are_known(ground: Ground, releases: Releases, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hazard, "ROUND", 50)
    asked: list[int] = []

    def enough(blocks: int) -> bool:
        asked.append(blocks)
        return blocks >= 150

    tally = ScreenTally(SCREENS)
    counted = hazard.run_chunks(ground, releases, SETTINGS, [tally], enough=enough)
    assert asked == [50, 100, 200]
    assert counted.blocks == tally.blocks == 200
    assert counted.wanted == 500


def test_a_cancel_keeps_what_has_begun(ground: Ground, releases: Releases, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hazard, "AT_ONCE", 50)

    def stop(text: str, done: int, total: int) -> None:
        if done >= 100:
            raise CancelledError

    tally = ScreenTally(SCREENS)
    counted = hazard.run_chunks(ground, releases, SETTINGS, [tally], threads=1, progress=stop)
    assert 100 <= counted.blocks < 500
    first = ScreenTally(SCREENS)
    first.add(simulate(ground, releases.take(slice(0, counted.blocks)), SETTINGS))
    same(tally, first)


def test_a_barrier_beside_the_terrain_is_refused(ground: Ground) -> None:
    far = Screen("far", np.array([[900.0, 0.0], [900.0, 10.0]]), 3.0, 1e5)
    with pytest.raises(InputError, match="beside the terrain"):
        tallies_for(ground, 1.0, False, [far])
