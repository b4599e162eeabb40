# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in chunks: what they add up to is that of one piece, also after the work was ended, however that was."""

import errno
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rockfall.core.errors import InputError
from rockfall.core.exchange.content_digest import content_digest
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.run_tally import RunTally
from rockfall.core.hazard.screens import Screen
from rockfall.core.progress import CancelledError
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.engine import Settings, simulate
from rockfall.core.simulation.ground import Ground, make_ground
from rockfall.core.simulation.release import Releases
from rockfall.core.simulation.release_sources import on_points
from rockfall.core.terrain.surface import Surface
from rockfall.core.workflow import ensembles
from rockfall.core.workflow.chunk_store import ChunkStore
from rockfall.core.workflow.ensembles import HereAlone, Work, run_ensemble
from rockfall.core.workflow.maps import map_models
from rockfall.core.workflow.simulation_chunks import simulate_in_chunks, write_chunk_tables
from rockfall.core.workflow.simulation_output import write_simulations, write_tables

SETTINGS = Settings("noel_2017", seed=5)
SIZE, RUNS = 7, 45  # the last chunk is not full


def plane() -> Ground:
    vertices = np.array([[x, y, -0.6 * x] for y in (0.0, 60.0) for x in (0.0, 60.0)])
    return make_ground(Surface(vertices, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane"), {})


def blocks_on(ground: Ground, number: int = RUNS) -> Releases:
    return on_points(ground, np.array([[10.0, 30.0, np.nan]]), Blocks(), number, seed=5)


def same(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> bool:
    return first.keys() == second.keys() and all(
        one.dtype == second[name].dtype and one.tobytes() == second[name].tobytes() for name, one in first.items()
    )


class Counting(HereAlone):
    """Says which chunks it has computed."""

    def __init__(self) -> None:
        self.computed: list[int] = []

    def compute(self, work, chunks, beat):
        for number, chunk in super().compute(work, chunks, beat):
            self.computed.append(number)
            yield number, chunk


class Backwards(Counting):
    """Gives its chunks in another order than it was asked for them."""

    def compute(self, work, chunks, beat):
        yield from reversed(list(super().compute(work, chunks, beat)))


@pytest.fixture(scope="module")
def ground() -> Ground:
    return plane()


@pytest.fixture
def work(ground: Ground) -> Work:
    return Work(ground, SETTINGS, {"runs": RunTally()}, "ends")


def ends(work: Work, releases: Releases, pool=None, **options) -> dict[str, np.ndarray]:
    return run_ensemble(work, releases, pool or HereAlone(), size=SIZE, **options)["runs"].arrays()


def test_chunks_in_any_order_are_the_simulation_in_one_piece(work, ground):
    releases = blocks_on(ground)
    whole = simulate(ground, releases, SETTINGS, record="ends", first_run=3)
    for pool in (HereAlone(), Backwards()):
        found = ends(work, releases, pool, first_run=3)
        np.testing.assert_array_equal(found["number"], np.arange(4, 4 + RUNS))
        for name in ("end", "time_s", "length_m", "v_max_mps", "impacts", "position"):
            np.testing.assert_array_equal(found[name], getattr(whole, name))


@pytest.mark.parametrize("merged_every", [2, 100])
def test_work_that_is_stopped_goes_on_with_the_rest_alone(work, ground, tmp_path, monkeypatch, merged_every):
    monkeypatch.setattr(ensembles, "MERGED_EVERY", merged_every)
    releases, store = blocks_on(ground), ChunkStore(tmp_path / "kept")

    def stop(text: str, done: int, total: int) -> None:
        if done >= 3 * SIZE:
            raise CancelledError

    with pytest.raises(CancelledError):
        ends(work, releases, store=store, progress=stop)
    pool, told = Counting(), []
    resumed = ends(work, releases, pool, store=store, progress=lambda text, done, total: told.append(done))
    assert pool.computed == [3, 4, 5, 6]
    assert told[0] == 3 * SIZE
    assert told[-1] == RUNS
    assert same(resumed, ends(work, releases))
    again = Counting()
    assert same(ends(work, releases, again, store=store), resumed)
    assert again.computed == []


def test_a_chunk_that_was_merged_and_not_yet_removed_counts_once(work, ground, tmp_path):
    releases, store = blocks_on(ground), ChunkStore(tmp_path)
    first = work.chunk(releases.take(slice(0, SIZE)), 0)
    store.keep(0, first)
    left = (tmp_path / "000000.npz").read_bytes()
    store.keep_merged(first.arrays, frozenset([0]))
    (tmp_path / "000000.npz").write_bytes(left)
    assert same(ends(work, releases, store=store), ends(work, releases))


def test_screens_on_workers_are_those_of_one_process(ground, tmp_path):
    releases = blocks_on(ground)
    screens = [
        Screen("road", np.array([[12.0, 1.0], [12.0, 59.0]])),
        Screen("net", np.array([[14.0, 1.0], [14.0, 59.0]]), 2.0, 300.0),
    ]
    settings = [SETTINGS, replace(SETTINGS, model="pfeiffer_bowen_1989")]
    one, many = tmp_path / "one", tmp_path / "many"
    one.mkdir(), many.mkdir()
    mapped = map_models(ground, releases, settings, None, screens, faces=True)
    simulations, passed = mapped.simulations, mapped.screens
    written = write_simulations(simulations, one, record=[], inputs={}, mapped=mapped)
    again, stores = simulate_in_chunks(
        ground, releases, settings, Backwards(), tmp_path / "kept", record=[], screens=screens, faces=True, size=SIZE
    )
    ended, same_passed = again.simulations, again.screens
    for model, tally in mapped.faces.items():
        for name, values in tally.layers().items():
            np.testing.assert_array_equal(again.faces[model].layers()[name], values, err_msg=name)
    assert passed[SETTINGS.model].figures()[0].hits > 10
    tables = write_chunk_tables(stores, many, ended, same_passed, size=SIZE)
    assert [*tables, "summary.json"] == [name for name in written if not name.startswith("maps/")]
    for name in ("runs.csv", "hits.csv", "screens.csv"):
        assert (many / name).read_bytes() == (one / name).read_bytes(), name


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_work_that_is_killed_goes_on_and_gives_the_same_tables(ground, tmp_path):
    kept, releases = tmp_path / "kept", blocks_on(ground)
    code = (
        "import sys, time\nfrom pathlib import Path\n"
        f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from test_ensembles import SETTINGS, SIZE, HereAlone, blocks_on, plane\n"
        "from rockfall.core.workflow.simulation_chunks import simulate_in_chunks\n"
        "ground = plane()\n"
        "class Slow(HereAlone):\n"
        "    def compute(self, work, chunks, beat):\n"
        "        for one in super().compute(work, chunks, beat):\n"
        "            time.sleep(0.1 if one[0] < 3 else 100)\n"
        "            yield one\n"
        f"simulate_in_chunks(ground, blocks_on(ground), [SETTINGS], Slow(), Path({str(kept)!r}), "
        "record=['impacts'], size=SIZE)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    while len(list(kept.glob("*/[0-9]*.npz"))) < 3:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    pool = Counting()
    mapped, stores = simulate_in_chunks(ground, releases, [SETTINGS], pool, kept, record=["impacts"], size=SIZE)
    simulations = mapped.simulations
    assert pool.computed == [3, 4, 5, 6]
    out, whole = tmp_path / "out", tmp_path / "whole"
    out.mkdir()
    whole.mkdir()
    assert write_chunk_tables(stores, out, simulations, {}, size=SIZE) == ["runs.csv", "impacts.csv"]
    write_tables([simulate(ground, releases, SETTINGS, record="impacts")], whole, record=["impacts"])
    for name in ("runs.csv", "impacts.csv"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()
    assert len(simulations[0]) == RUNS
    stores[0].remove()
    assert not kept.exists()


def test_a_full_disk_keeps_what_is_finished(work, ground, tmp_path, monkeypatch):
    releases, store, synced = blocks_on(ground), ChunkStore(tmp_path / "kept"), []
    really = os.fsync

    def full_at_the_sixth(descriptor: int) -> None:
        synced.append(descriptor)
        if len(synced) == 6:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        really(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full_at_the_sixth)
        with pytest.raises(InputError, match=re.escape(os.strerror(errno.ENOSPC))) as caught:
            ends(work, releases, store=store)
    assert caught.value.file == tmp_path / "kept" / "000002.npz"
    assert sorted(file.name for file in store.folder.glob("*.npz")) == ["000000.npz", "000001.npz"]
    pool = Counting()
    assert same(ends(work, releases, pool, store=store), ends(work, releases))
    assert pool.computed == [2, 3, 4, 5, 6]


def cut_short(kept: Path) -> None:
    table = kept / "000002.runs.csv"
    table.write_bytes(b"".join(table.read_bytes().splitlines(keepends=True)[:-3]))


def one_number_changed(kept: Path) -> None:
    table = kept / "000002.runs.csv"
    table.write_bytes(table.read_bytes().replace(b"noel_2017", b"noel_2016", 1))


def missing(kept: Path) -> None:
    (kept / "000002.runs.csv").unlink()


def all_of_another(kept: Path) -> None:
    for file in kept.glob("000001.*"):
        shutil.copy(file, kept / file.name.replace("000001", "000002"))


def sums_of_another(kept: Path) -> None:
    shutil.copy(kept / "000001.npz", kept / "000002.npz")


def of_another_seed(kept: Path) -> None:
    (other,) = (folder for folder in kept.parent.iterdir() if folder != kept)
    for file in other.glob("000002.*"):
        shutil.copy(file, kept)


def sums_damaged(kept: Path) -> None:
    (kept / "000002.npz").write_bytes(b"PK\x03\x04")


def one_sum_changed(kept: Path) -> None:
    with np.load(kept / "000002.npz") as content:
        values = dict(content)
    name = next(key for key in values if key.endswith("/length_m"))
    values[name] = values[name] + 1
    np.savez(kept / "000002.npz", **values)


def no_record(kept: Path) -> None:
    (kept / "000002.json").unlink()


def record_damaged(kept: Path) -> None:
    (kept / "000002.json").write_text('{"chunk": 2, "tables": [')


DAMAGES = {
    cut_short: "runs.csv has 4 of 7 rows", one_number_changed: "runs.csv is another one",
    missing: "runs.csv is missing",
    all_of_another: "it was chunk 1", sums_of_another: "it was chunk 1", of_another_seed: "it is of another simulation",
    sums_damaged: "it is damaged", one_sum_changed: "it is damaged", no_record: "its record is missing",
    record_damaged: "its record is missing, damaged",
}  # fmt: skip


def write_chunked(ground: Ground, kept: Path, out: Path, pool: Counting, settings: Settings = SETTINGS) -> ChunkStore:
    out.mkdir()
    mapped, stores = simulate_in_chunks(
        ground, blocks_on(ground), [settings], pool, kept, record=["impacts"], cell_m=5.0, size=SIZE
    )
    write_chunk_tables(stores, out, mapped.simulations, {}, size=SIZE)
    for name, values in mapped.cells[settings.model].arrays().items():
        (out / f"{name}.bin").write_bytes(np.asarray(values).tobytes())
    return stores[0]


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_kept_chunk_that_differs_from_its_record_is_computed_again_and_said(ground, tmp_path, damage):
    kept = tmp_path / "kept"
    store = write_chunked(ground, kept, tmp_path / "first", Counting())
    write_chunked(ground, kept, tmp_path / "other", Counting(), replace(SETTINGS, seed=6))
    damage(store.folder)
    pool = Counting()
    again = write_chunked(ground, kept, tmp_path / "again", pool)
    assert pool.computed == [2]
    assert contents(tmp_path / "again") == contents(tmp_path / "first")
    (remark,) = again.remarks
    assert DAMAGES[damage] in remark.text
    assert remark.severity == "warning"
    third = Counting()
    assert write_chunked(ground, kept, tmp_path / "third", third).remarks == []
    assert third.computed == []


@pytest.mark.parametrize("damage", [cut_short, missing, no_record], ids=lambda damage: damage.__name__)
def test_tables_of_merged_chunks_are_made_again_and_counted_once(ground, tmp_path, monkeypatch, damage):
    monkeypatch.setattr(ensembles, "MERGED_EVERY", 3)
    store = write_chunked(ground, tmp_path / "kept", tmp_path / "first", Counting())
    assert {file.name for file in store.folder.glob("*.npz")} == {"000006.npz", "merged.npz"}
    damage(store.folder)
    pool = Counting()
    again = write_chunked(ground, tmp_path / "kept", tmp_path / "again", pool)
    assert pool.computed == [2]
    assert contents(tmp_path / "again") == contents(tmp_path / "first")
    assert len(again.remarks) == 1


def test_sums_of_merged_chunks_that_are_damaged_are_computed_again(ground, tmp_path, monkeypatch):
    monkeypatch.setattr(ensembles, "MERGED_EVERY", 3)
    store = write_chunked(ground, tmp_path / "kept", tmp_path / "first", Counting())
    merged = store.folder / "merged.npz"
    merged.write_bytes(merged.read_bytes()[:-100])
    pool = Counting()
    again = write_chunked(ground, tmp_path / "kept", tmp_path / "again", pool)
    assert pool.computed == [0, 1, 2, 3, 4, 5]
    assert contents(tmp_path / "again") == contents(tmp_path / "first")
    assert again.remarks[0].text.startswith(
        "6 kept chunks were not as written, and computed again (0: merged.npz: it is"
    )


def test_a_table_that_is_changed_while_it_is_used_is_refused(ground, tmp_path):
    mapped, stores = simulate_in_chunks(
        ground, blocks_on(ground), [SETTINGS], Counting(), tmp_path / "kept", record=[], size=SIZE
    )
    cut_short(stores[0].folder)
    with pytest.raises(InputError, match="changed while it was used"):
        write_chunk_tables(stores, tmp_path, mapped.simulations, {}, size=SIZE)


def test_what_others_have_put_beside_kept_chunks_stays(work, ground, tmp_path):
    store = ChunkStore(tmp_path / "kept" / "one")
    ends(work, blocks_on(ground), store=store)
    (store.folder / "mine.txt").write_text("mine")
    store.remove()
    assert [file.name for file in store.folder.iterdir()] == ["mine.txt"]


@pytest.mark.skipif(os.name == "nt", reason="links")
def test_kept_chunks_are_not_read_or_removed_through_a_link(work, ground, tmp_path):
    true, link = ChunkStore(tmp_path / "true"), ChunkStore(tmp_path / "link")
    ends(work, blocks_on(ground), store=true)
    link.folder.symlink_to(true.folder)
    with pytest.raises(InputError, match="which is a link"):
        ends(work, blocks_on(ground), store=link)
    link.remove()
    assert len(list(true.folder.glob("*.npz"))) == 7


def test_no_runs_are_refused(work, ground):
    with pytest.raises(InputError, match="nothing to simulate"):
        ends(work, blocks_on(ground).take(slice(0, 0)))


def test_what_is_kept_belongs_to_one_scenario(ground, tmp_path):
    """Another seed, number or size of chunks, and other blocks, begin anew."""
    releases = blocks_on(ground)

    def folders(settings: Settings = SETTINGS, first_run: int = 0, size: int = 30, blocks: Releases = releases) -> None:
        simulate_in_chunks(ground, blocks, [settings], HereAlone(), tmp_path, record=[], first_run=first_run, size=size)

    for options in (
        {}, {}, {"settings": Settings("noel_2017", seed=6)}, {"settings": Settings("noel_2017", friction=0.4)},
        {"first_run": 1}, {"size": 31}, {"blocks": releases.take(slice(0, 44))},
    ):  # fmt: skip
        folders(**options)
    assert len(list(tmp_path.iterdir())) == 6


def test_a_digest_knows_values_types_and_places():
    values = [
        (np.arange(3),), (np.arange(3.0),), (np.arange(3)[::-1],), (1, 2), ([1], 2), ([1, 2],), ("1", 2), (None,),
        ({"a": 1},), ({"a": 2},), (SETTINGS,),
    ]  # fmt: skip
    assert len({content_digest(*each) for each in values}) == len(values)
    assert content_digest({"a": 1, "b": 2}) == content_digest({"b": 2, "a": 1})
    with pytest.raises(TypeError):
        content_digest(object())
