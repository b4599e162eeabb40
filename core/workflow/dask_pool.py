# SPDX-License-Identifier: GPL-3.0-or-later
"""Chunks of runs on the workers of Dask: those of a scheduler that is there, or of a cluster on this machine.

Each worker gets the ground, the settings and empty tallies once, also one that comes later; then releases go to it, and
sums come back. A worker that is lost costs the chunks that it had not finished: others compute them again.
"""

import asyncio
import logging
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import ExitStack, suppress
from importlib import import_module
from pathlib import Path
from queue import Empty, Queue
from tempfile import TemporaryDirectory
from threading import Thread
from types import TracebackType
from typing import Any
from uuid import uuid4

from ..errors import InputError, RockfallError
from ..extras import CLUSTER, demand
from ..simulation.release import Releases
from ..versions import versions
from .ensembles import Chunk, Work
from .shared_work import read_shared, write_shared

ANSWER_S = 15.0
"""A scheduler that takes longer does not answer; so long is waited for its first worker, too."""
GONE_S = 60.0
"""Without any worker for so long the work ends; those of a cluster may come back before."""
AHEAD = 2
"""Chunks for each thread of all workers that are sent before one has come back: no thread waits, and memory lasts."""
BEAT_S, LOOK_S = 0.2, 2.0
"""Between two beats of the progress, and two looks at the workers."""
ANYWHERE = "127.0.0.1:0"
"""A port that is free, which only this machine reaches."""
OF_WORKERS = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.tick.limit": "1m",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "2s",
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 30,
}
"""Dask looks at itself and its workers up to a hundred times a second, for people who watch it, and lets them give back
memory that the next chunk takes again. A chunk takes a second."""
TRIES = 3
"""A chunk whose computation fails is computed so often again."""


class DaskPool:
    """Workers, from the beginning to the end of a block.

    Parameters
    ----------
    address : of a scheduler, such as ``tcp://10.0.0.5:8786``; None starts workers on this machine.
    workers : so many there; not for a scheduler, which has its own.

    Raises
    ------
    DependencyError : Dask is not installed.
    InputError : the scheduler does not answer or has no workers; they have another version of what computes.
    """

    def __init__(self, address: str | None = None, workers: int = 1) -> None:
        demand(CLUSTER)
        self._address, self._workers, self._open = address, workers, ExitStack()
        self._client: Any = None

    def __enter__(self) -> "DaskPool":
        from dask import config
        from distributed import Client, LocalCluster

        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is said by us
        with ExitStack() as opening:
            opening.enter_context(warnings.catch_warnings())
            warnings.simplefilter("ignore")
            address: Any = self._address
            if address is None:
                self._open.enter_context(config.set(OF_WORKERS))
                address = self._open.enter_context(
                    LocalCluster(
                        n_workers=self._workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=50
                    )
                )
            try:
                if self._address is not None and not _answers(self._address):
                    raise TimeoutError
                self._client = self._open.enter_context(Client(address, timeout=ANSWER_S, set_as_default=False))
                self._client.wait_for_workers(1, timeout=ANSWER_S)
                self._compare_versions()
            except BaseException as error:
                self._open.close()
                if isinstance(error, OSError | TimeoutError | ValueError):
                    raise self._silent(answered=self._client is not None) from error
                raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(Exception):
            self._open.close()

    def compute(
        self, work: Work, chunks: Iterator[tuple[int, int, Releases]], beat: Callable[[], None]
    ) -> Iterator[tuple[int, Chunk]]:
        """See `ensembles.Pool`."""
        key = f"rockfall-{uuid4().hex}"
        finished: Queue[Any] = Queue()
        sent: dict[Any, int] = {}
        watch = _Watch(self._client)
        more = True
        with ExitStack() as meanwhile:
            self._client.register_plugin(self._plugin(work, meanwhile), name=key)
            meanwhile.callback(self._forget, key, sent)
            while True:
                while more and len(sent) < AHEAD * watch.threads:
                    following = next(chunks, None)
                    if following is None:
                        more = False
                        break
                    number, first, part = following
                    future = self._client.submit(
                        _compute, key, part, first, key=f"{key}-{number}", retries=TRIES, pure=False
                    )
                    sent[future] = number
                    future.add_done_callback(finished.put)
                if not sent:
                    return
                beat()
                watch.look()
                try:
                    future = finished.get(timeout=BEAT_S)
                except Empty:
                    continue
                number = sent.pop(future)
                yield number, _result(future)
                del future

    def _plugin(self, work: Work, meanwhile: ExitStack) -> Any:
        """What brings the work to each worker, once; to those on this machine in a file that they share."""
        if self._address is None:
            folder = meanwhile.enter_context(TemporaryDirectory(prefix="rockfall-", ignore_cleanup_errors=True))
            file = Path(folder) / "work"
            try:
                write_shared(work, file)
            except OSError:  # no room there: it is sent
                return _plugin(work)
            return _plugin(file)
        return _plugin(work)

    def _forget(self, key: str, sent: dict[Any, int]) -> None:
        with suppress(Exception):
            self._client.cancel(list(sent), force=True)
            self._client.unregister_worker_plugin(key)

    def _compare_versions(self) -> None:
        """Refuse workers that would compute other bits."""
        package = __name__.partition(".core.")[0]

        def there() -> dict[str, str]:  # sent as it is: the worker may not have Rockfall
            try:
                return dict(import_module(f"{package}.core.versions").versions())
            except ImportError:
                return {}

        here = versions()
        for address, found in self._client.run(there).items():
            for name, version in here.items():
                if found.get(name) != version:
                    raise InputError(
                        f"The worker {address} has {name} {found.get(name, 'nowhere')}, and here is {version}",
                        advice="Install the same versions everywhere: the result depends on them",
                    )

    def _silent(self, *, answered: bool) -> InputError:
        if self._address is None:
            return InputError("The workers on this machine do not start", advice="Try fewer of them: --workers 1")
        if answered:
            return InputError(
                f"The scheduler at {self._address} has no workers", advice="Start workers for it, and try again"
            )
        return InputError(
            f"The scheduler at {self._address} does not answer within {ANSWER_S:g} s",
            advice="Check the address, whether it runs, and that no firewall is between",
        )


def _answers(address: str) -> bool:
    """Whether what is at an address speaks as a scheduler does; Dask itself waits for ever where it says nothing."""
    from distributed.comm import connect

    answered: Queue[bool] = Queue()

    async def ask() -> None:
        comm = await connect(address, timeout=ANSWER_S)
        await comm.close()

    def wait() -> None:
        try:
            asyncio.run(ask())
            answered.put(True)
        except (OSError, TimeoutError, ValueError):
            answered.put(False)

    Thread(target=wait, daemon=True).start()
    with suppress(Empty):
        return answered.get(timeout=ANSWER_S)
    return False


class _Watch:
    """How many threads there are, and whether any worker is left."""

    def __init__(self, client: Any) -> None:
        self._client, self._looked, self._alive = client, 0.0, time.monotonic()
        self.threads = 1
        self.look()

    def look(self) -> None:
        """Now and then.

        Raises
        ------
        InputError : the scheduler is gone, or no worker has been there for `GONE_S`.
        """
        now = time.monotonic()
        if now - self._looked < LOOK_S:
            return
        self._looked = now
        found: dict[str, Any] = {}
        if self._client.status == "running":
            with suppress(OSError, TimeoutError):
                found = self._client.scheduler_info()["workers"]
        if found:
            self._alive = now
            self.threads = max(sum(int(one["nthreads"]) for one in found.values()), 1)
        elif now - self._alive > GONE_S:
            raise InputError(
                f"There has been no worker for {GONE_S:g} s",
                advice="Start workers, and give the same command again: what is finished is kept",
            )


def _result(future: Any) -> Chunk:
    """The result of a chunk that is finished.

    Raises
    ------
    RockfallError : it cannot be computed.
    """
    from distributed import KilledWorker

    try:
        chunk: Chunk = future.result()
    except KilledWorker as error:
        raise RockfallError(
            "The same chunk has ended several workers, perhaps for want of memory. Give them more, or coarser maps."
        ) from error
    except FutureCancelledError as error:
        raise RockfallError(
            "The scheduler has ended. What is finished is kept: give the same command again."
        ) from error
    except InputError as error:
        raise InputError(error.problem, file=error.file, row=error.row, advice=error.advice) from error
    return chunk


def _compute(key: str, releases: Releases, first_run: int) -> Chunk:
    """On a worker."""
    from distributed import get_worker

    plugin = get_worker().plugins[key]
    if isinstance(plugin.work, Path):
        plugin.work = read_shared(plugin.work)
    work: Work = plugin.work
    return work.chunk(releases, first_run)


def _plugin(work: Work | Path) -> Any:
    """What brings the work to each worker, or says in which file it is."""
    from distributed import WorkerPlugin

    plugin = WorkerPlugin()
    plugin.work = work
    return plugin
