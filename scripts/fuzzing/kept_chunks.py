# SPDX-License-Identifier: GPL-3.0-or-later
"""The chunks that an ensemble keeps, damaged: what goes on from them is as it would have been, or is refused."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

SIZE, BLOCKS = 4, 12
KEPT = "kept"


@cache
def _ground(terrain: bytes) -> object:
    from rockfall.core.simulation.ground import make_ground
    from rockfall.core.terrain.readers import read_terrain

    with TemporaryDirectory() as folder:
        file = Path(folder) / "terrain.ply"
        file.write_bytes(terrain)
        return make_ground(read_terrain(file))


def _run(terrain: bytes, kept: Path, out: Path) -> dict[str, bytes]:
    """The tables of a simulation that goes on from what is kept."""
    import numpy as np
    from rockfall.core.simulation.blocks import Blocks
    from rockfall.core.simulation.engine import Settings
    from rockfall.core.simulation.release_sources import on_line
    from rockfall.core.workflow.ensembles import HereAlone
    from rockfall.core.workflow.simulation_chunks import simulate_in_chunks, write_chunk_tables

    ground = _ground(terrain)
    line = np.array([[2.0, 4.0, np.nan], [2.0, 18.0, np.nan]])
    low = ground.terrain.bounds[0]
    releases = on_line(ground, [line + np.array([low[0], low[1], 0.0])], Blocks(), BLOCKS, evenly=True)
    mapped, stores = simulate_in_chunks(
        ground, releases, [Settings("noel_2017", {})], HereAlone(), kept, record=("impacts",), cell_m=2.0, size=SIZE
    )
    out.mkdir(parents=True, exist_ok=True)
    names = write_chunk_tables(stores, out, mapped.simulations, mapped.screens, size=SIZE)
    tables = {name: (out / name).read_bytes() for name in names}
    return tables | {"cells": repr([one.arrays() for one in mapped.cells.values()]).encode()}


def files(terrain: bytes, folder: Path) -> dict[str, bytes]:
    """What is kept when all chunks are finished, and before they are removed."""
    _run(terrain, folder / KEPT, folder / "out")
    found = {f"{KEPT}/{file.relative_to(folder / KEPT)}": file.read_bytes() for file in (folder / KEPT).rglob("*.*")}
    return {name: data for name, data in found.items() if data}


def reader(terrain: bytes, folder: Path) -> Callable[[Path], object]:
    """Goes on from what is kept; what differs from a run of its own is wrong."""
    expected = _run(terrain, folder / "none", folder / "expected")

    def read(at: Path) -> object:
        found = _run(terrain, at / KEPT, at / "out")
        assert found.keys() == expected.keys(), "a table is missing"
        for name, data in expected.items():
            assert found[name] == data, f"{name} is another one"
        return found

    return read
