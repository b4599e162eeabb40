# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers of Dask: the same bits as here alone, also when one is lost; what cannot be is refused in words."""

import os
import signal
import socket
from collections.abc import Iterator

import numpy as np
import pytest
from rockfall.core.cli import main
from rockfall.core.errors import InputError
from rockfall.core.georeference import GlobalShift
from rockfall.core.hazard.run_tally import RunTally
from rockfall.core.simulation.blocks import Blocks
from rockfall.core.simulation.engine import Settings
from rockfall.core.simulation.ground import make_ground
from rockfall.core.simulation.release_sources import on_points
from rockfall.core.terrain.surface import Surface
from rockfall.core.terrain.writers import write_ply
from rockfall.core.workflow import dask_pool
from rockfall.core.workflow.dask_pool import DaskPool
from rockfall.core.workflow.ensembles import HereAlone, Work, run_ensemble

distributed = pytest.importorskip("distributed")
SIZE = 50


def surface() -> Surface:
    vertices = np.array([[x, y, -0.6 * x] for y in (0.0, 60.0) for x in (0.0, 60.0)])
    return Surface(vertices, np.array([[0, 1, 3], [0, 3, 2]], np.int32), GlobalShift(), "plane")


@pytest.fixture(scope="module")
def cluster() -> Iterator["distributed.LocalCluster"]:
    """Two workers, each a process."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=dask_pool.ANYWHERE, silence_logs=50
    ) as cluster:
        yield cluster


def work_and_blocks(number: int):
    ground = make_ground(surface(), {})
    releases = on_points(ground, np.array([[10.0, 30.0, np.nan]]), Blocks(), number, seed=5)
    return Work(ground, Settings("noel_2017", seed=5), {"runs": RunTally()}, "ends"), releases


def check_same(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert found[name].tobytes() == values.tobytes()


def test_two_workers_give_the_same_bits_also_when_one_is_killed(cluster):
    work, releases = work_and_blocks(6000)
    expected = run_ensemble(work, releases, HereAlone(), size=SIZE)["runs"].arrays()
    with DaskPool(cluster.scheduler_address) as pool:
        check_same(run_ensemble(work, releases, pool, size=SIZE)["runs"].arrays(), expected)
        pids = list(pool._client.run(os.getpid).values())
        assert len(set(pids)) == 2
        killed = []

        def kill_one(text: str, done: int, total: int) -> None:
            if done >= 10 * SIZE and not killed:
                killed.append(done)
                os.kill(pids[0], signal.SIGKILL)

        found = run_ensemble(work, releases, pool, size=SIZE, progress=kill_one)["runs"].arrays()
        assert killed
        assert killed[0] < 6000
        check_same(found, expected)
        assert not pool._client.run(lambda dask_worker: [key for key in dask_worker.plugins if "rockfall" in key])[
            min(pool._client.scheduler_info()["workers"])
        ]


def test_the_command_writes_the_same_tables_with_workers(cluster, tmp_path, capsys):
    write_ply(surface(), tmp_path / "plane.ply")
    (tmp_path / "releases.csv").write_text("x_m,y_m,number\n10,30,30\n12,20,10\n")
    command = ["simulate", str(tmp_path / "releases.csv"), "--terrain", str(tmp_path / "plane.ply"), "--seed", "4"]
    command += ["--model", "stevens_1998", "--diameter", "0.3..0.6", "--cell", "5"]
    here, there = tmp_path / "here", tmp_path / "there"
    assert main([*command, "--out", str(here)]) == 0
    assert main([*command, "--scheduler", cluster.scheduler_address, "--out", str(there)]) == 0
    names = sorted(file.relative_to(here) for file in here.rglob("*"))
    assert names == sorted(file.relative_to(there) for file in there.rglob("*"))
    compared = [name for name in names if name.suffix in (".csv", ".tif")]
    assert len(compared) > 20
    for name in compared:
        assert (there / name).read_bytes() == (here / name).read_bytes()
    assert not (tmp_path / "there.chunks").exists()


def test_workers_of_another_version_are_refused(cluster, monkeypatch):
    here = dask_pool.versions()
    for name in here:
        monkeypatch.setattr(dask_pool, "versions", lambda name=name: here | {name: "9.9"})
        with (
            pytest.raises(InputError, match=f"has {name} {here[name]}, and here is 9.9"),
            DaskPool(cluster.scheduler_address),
        ):
            pass


def test_a_scheduler_that_does_not_answer_and_one_without_workers(monkeypatch):
    monkeypatch.setattr(dask_pool, "ANSWER_S", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InputError, match=r"does not answer within 0\.5 s"), DaskPool(address):
            pass
    for wrong in ("nonsense", "tcp://127.0.0.1:1", "foo://there:3", ""):
        with pytest.raises(InputError, match="does not answer"), DaskPool(wrong):
            pass
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, dashboard_address=dask_pool.ANYWHERE, silence_logs=50
        ) as empty,
        pytest.raises(InputError, match="has no workers"),
        DaskPool(empty.scheduler_address),
    ):
        pass


def test_what_a_chunk_cannot_be_computed_with_is_said(cluster):
    work, releases = work_and_blocks(10)
    bad = Work(work.ground, Settings("noel_2017", rolling="none", gravity_mps2=-1.0), work.tallies, "ends")
    with (
        DaskPool(cluster.scheduler_address) as pool,
        pytest.raises(InputError, match=r"The gravity is -1\.0\. Give"),
    ):
        run_ensemble(bad, releases, pool)


def test_options_that_exclude_each_other(tmp_path, capsys):
    (tmp_path / "releases.csv").write_text("x_m,y_m\n10,30\n")
    command = ["simulate", str(tmp_path / "releases.csv"), "--out", str(tmp_path / "out")]
    for options in (["2", "--scheduler", "a"], ["0"], ["2", "--threads", "2"], ["2", "--until-known", "0.95"]):
        assert main([*command, "--workers", *options]) == 1
    said = capsys.readouterr().err
    assert said.count("rockfall: --") == 4
