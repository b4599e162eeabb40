# SPDX-License-Identifier: GPL-3.0-or-later
"""Chunks: the same bits for any of them, and a cancel that keeps a smaller number of blocks."""

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.cell_tally import CellTally
from rockfall.core.hazard.cells import cells_over
from rockfall.core.progress import CancelledError
from rockfall.core.simulation.engine import Records, Settings, Simulation, joined, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases, make_releases
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow import hazard
from rockfall.core.workflow.hazard import run_chunks

SETTINGS = Settings("noel_2017", seed=3)
BLOCKS = 500


@pytest.fixture(scope="module")
def ground() -> Ground:
    line = np.arange(50.0)
    x, y = np.meshgrid(line, line)
    z = -0.7 * np.minimum(x, 35) + 0.3 * np.sin(x) * np.cos(y)
    i = np.arange(2500).reshape(50, 50)
    faces = [np.stack(part, axis=-1).reshape(-1, 3) for part in
             ((i[:-1, :-1], i[:-1, 1:], i[1:, 1:]), (i[:-1, :-1], i[1:, 1:], i[1:, :-1]))]  # fmt: skip
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return make_ground(Surface(vertices, np.concatenate(faces).astype(np.int32), GlobalShift(), "slope"))


@pytest.fixture(scope="module")
def releases() -> Releases:
    places = np.column_stack([np.full(BLOCKS, 3.0), np.linspace(15, 35, BLOCKS), np.full(BLOCKS, 1.0)])
    return make_releases(places, diameter_m=0.4)


def bits(tally: CellTally) -> dict[str, bytes]:
    return {name: values.tobytes() for name, values in tally.arrays().items()}


@pytest.fixture(scope="module")
def at_once(ground: Ground, releases: Releases) -> CellTally:
    """All blocks in one simulation."""
    tally = CellTally(cells_over(ground.surface, 1.0))
    tally.add(simulate(ground, releases, SETTINGS))
    return tally


@pytest.mark.parametrize(("chunk", "threads"), [(500, 1), (64, 1), (64, 3), (77, 2)])
def test_maps_do_not_depend_on_chunks_and_threads(
    ground: Ground, releases: Releases, at_once: CellTally, chunk: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hazard, "AT_ONCE", chunk)
    tally = at_once.empty()
    counted = run_chunks(ground, releases, SETTINGS, [tally], threads=threads)
    assert (counted.blocks, counted.wanted) == (BLOCKS, BLOCKS)
    assert bits(tally) == bits(at_once)


def test_nor_on_the_order_in_which_parts_are_merged_even_over_files(
    ground: Ground, releases: Releases, at_once: CellTally
) -> None:
    parts = []
    for first in (300, 0, 450, 120):
        part = at_once.empty()
        last = {0: 120, 120: 300, 300: 450, 450: 500}[first]
        run_chunks(ground, releases.take(slice(first, last)), SETTINGS, [part], first_run=first)
        parts.append(CellTally.from_arrays(part.arrays()))
    total = parts.pop()
    for part in parts:
        total.merge(part)
    assert bits(total) == bits(at_once)
    for name, values in total.maps().layers.items():
        np.testing.assert_array_equal(values, at_once.maps().layers[name])


def test_each_chunk_is_handed_on(ground: Ground, releases: Releases, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hazard, "AT_ONCE", 64)
    taken: list[Simulation] = []
    run_chunks(ground, releases, SETTINGS, [], threads=3, take=taken.append)
    assert len(taken) > 4
    whole, together = simulate(ground, releases, SETTINGS), joined(taken, releases)
    np.testing.assert_array_equal(together.number, np.arange(1, BLOCKS + 1))
    for name in ("position", "end", "impacts", "time_s"):
        np.testing.assert_array_equal(getattr(together, name), getattr(whole, name))
    for name in Records.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(together.records, name), getattr(whole.records, name))


def test_runs_may_have_any_numbers(ground: Ground, releases: Releases) -> None:
    whole, some = simulate(ground, releases, SETTINGS), np.array([3, 7, 8, 40, 499])
    part = simulate(ground, releases.take(some), SETTINGS, runs=some)
    np.testing.assert_array_equal(part.number, some + 1)
    np.testing.assert_array_equal(part.position, whole.position[some])
    np.testing.assert_array_equal(part.place_of(np.array([41, 4])), [3, 0])
    np.testing.assert_array_equal(part.records.time_s, whole.records.time_s[np.isin(whole.records.run, some)])


def test_a_cancel_keeps_the_first_blocks(
    ground: Ground, releases: Releases, at_once: CellTally, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hazard, "AT_ONCE", 64)

    def stop(text: str, done: int = 0, total: int = 0) -> None:
        assert total == BLOCKS
        if done >= 128:
            raise CancelledError

    tally = at_once.empty()
    counted = run_chunks(ground, releases, SETTINGS, [tally], threads=2, progress=stop)
    assert 128 <= counted.blocks == tally.blocks < BLOCKS
    fewer = at_once.empty()
    fewer.add(simulate(ground, releases.take(slice(0, counted.blocks)), SETTINGS))
    assert bits(tally) == bits(fewer)


def test_a_cancel_before_the_first_block(ground: Ground, releases: Releases) -> None:
    def stop(text: str, done: int = 0, total: int = 0) -> None:
        raise CancelledError

    with pytest.raises(CancelledError):
        run_chunks(ground, releases, SETTINGS, [], progress=stop)


def test_other_cells_cannot_be_added(ground: Ground) -> None:
    with pytest.raises(InputError, match="Maps of other cells"):
        CellTally(cells_over(ground.surface, 1.0)).merge(CellTally(cells_over(ground.surface, 2.0)))
