"""Many logs on a Dask cluster: the same analysis as on this machine, in children of the workers.

A job has an outcome exactly once: it is in hand from its submission until its outcome is yielded, and what is in hand is
submitted again where a worker, the scheduler or the connection is lost. A log whose workers die again and again is tried
once more alone, so that no other log is blamed for it, and then fails. A worker that does not see a log which this machine
sees fails fastest of all, and would win all the work: it gets no more, and the log is tried elsewhere.
"""

from __future__ import annotations

import asyncio
import hashlib
import queue
import time
import uuid
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import suppress
from itertools import count
from typing import Any, NamedTuple

from canid.analysis.fleet.job import Failure, Job, Outcome, Source
from canid.analysis.fleet.key import PROGRAM
from canid.analysis.fleet.planning import fetched
from canid.analysis.fleet.running import dask_cluster, dask_worker
from canid.analysis.fleet.running.dask_cluster import Inform, SchedulerLostError
from canid.analysis.fleet.running.isolated import failed
from canid.values.errors import CanidError, ConfigError, one_line

# jobs in hand per thread of the cluster: one that runs, and one that waits for it while the outcome travels
JOBS_PER_THREAD = 2
# s that a scheduler or the last worker may be away: a restart takes some seconds, a machine that reboots a minute
PATIENCE_S = 60.0
# s without an outcome after which the scheduler is asked whether it is still there
CHECK_S = 2.0
# times that a job is submitted again after an error that is not the log's: a result that was lost on its way, say
RETRIES = 3
# failures that may be the worker's: it lacks a mount, credentials, a package or a route
_OF_THE_PLACE = frozenset({Failure.MISSING, Failure.PERMISSION, Failure.NOT_REACHED})


class _Job(NamedTuple):
    """A job in hand."""

    job: Job
    alone: bool  # its workers have died before: nothing else runs at the same time
    retries: int


def outcomes(
    jobs: Iterable[Job],
    sources: Mapping[str, Source],
    *,
    scheduler: str,
    inform: Inform = lambda _: None,
    patience_s: float = PATIENCE_S,
) -> Generator[Outcome]:
    """Analyse many logs on Dask; the outcomes come as they are ready.

    Closing the iterator gives up what runs.

    Args:
        jobs: taken one by one, a few more than are analysed.
        sources: by the jobs' `source`.
        scheduler: address, such as "tls://host:8786".
        inform: takes a line for the user, where the scheduler or the last worker is lost.
        patience_s: s that is waited for it.

    Yields:
        one outcome for each job.

    Raises:
        ConfigError: distributed is missing, nothing answers at the address, there is no worker, or one has no canid or
            another version.
        CanidError: scheduler or workers did not come back.
    """
    dask_cluster.distributed()
    with dask_cluster.quiet():
        run = _Run(jobs, sources, scheduler, inform, patience_s)
        try:
            yield from run.outcomes()
        finally:
            run.close()


class _Run:
    """The jobs in hand, and the client that has them."""

    def __init__(
        self,
        jobs: Iterable[Job],
        sources: Mapping[str, Source],
        address: str,
        inform: Inform,
        patience_s: float,
    ) -> None:
        self._jobs, self._sources = iter(jobs), sources
        self._address, self._inform, self._patience_s = address, inform, patience_s
        self._client: Any = None
        self._in_hand: dict[str, _Job] = {}
        self._futures: dict[str, Any] = {}
        self._shared: dict[str, Any] = {}  # sources on the cluster
        self._suspects: list[Job] = []  # their workers have died
        self._done: queue.SimpleQueue[tuple[int, str]] = queue.SimpleQueue()
        self._generation = 0  # of the client
        # a key is of this run alone: the scheduler gives what another run left under the same key, an error too
        self._run = uuid.uuid4().hex[:12]
        self._numbers = count()
        self._yielded = True  # since the last loss, or nothing was lost
        self._again: list[Job] = []  # that another worker is to analyse
        self._workers: dict[str, int] = {}  # address -> threads, of those that see the logs
        self._blind: set[str] = set()  # addresses of the others
        self._allowed: dict[str, frozenset[str]] = {}  # key -> workers, where some are blind
        self._said_of: set[str] = set()  # hosts of blind workers
        self._counted = -CHECK_S  # s, when the threads were counted

    def outcomes(self) -> Generator[Outcome]:
        """One outcome for each job."""
        self._connect_first()
        while True:
            try:
                self._fill()
                if not self._in_hand:
                    with suppress(SchedulerLostError):
                        self._count()  # who has ended since
                    return
                outcome = self._next()
            except SchedulerLostError:
                self._reconnect()
                continue
            if outcome is not None:
                self._yielded = True
                yield outcome

    def close(self) -> None:
        """Give up what is in hand."""
        self._drop()

    # --- connection ---

    def _connect_first(self) -> None:
        try:
            self._client = dask_cluster.connected(self._address, 2.0 * dask_cluster.CONNECT_S)
            self._start(self._inform)
        except SchedulerLostError as error:
            raise ConfigError(
                f"fleet: {error}: start one with `dask scheduler`, or name its address"
            ) from None

    def _start(self, inform: Inform) -> None:
        self._workers = dask_cluster.await_workers(
            self._client, self._address, self._patience_s, inform, self._blind
        )
        self._counted = time.monotonic()

    def _count(self) -> None:
        """Count the workers again; who has ended is said, and what only such may run is submitted anew."""
        every = dask_cluster.threads(self._client)
        for gone in sorted(self._workers.keys() - every.keys()):
            left = dask_cluster.ended(self._client, gone)
            if left:
                logs = "a log" if left == 1 else f"{left} logs"
                self._inform(
                    f"the Dask worker {gone} has ended in the middle of {logs}: analysed again by others"
                )
        self._blind &= every.keys()
        self._workers = {worker: n for worker, n in every.items() if worker not in self._blind}
        self._counted = time.monotonic()
        for key in [key for key, allowed in self._allowed.items() if allowed.isdisjoint(self._workers)]:
            self._again.append(self._in_hand[key].job)
            self._forget(key)

    def _reconnect(self) -> None:
        """Wait for the scheduler, and submit again what has no outcome."""
        inform = (
            self._inform if self._yielded else _silently
        )  # a second loss before any outcome is the same one
        self._yielded = False
        inform(
            f"the connection to {self._address} is lost: waiting {self._patience_s:g} s for it; what has no result yet "
            "is submitted again"
        )
        deadline = time.monotonic() + self._patience_s
        while True:
            self._drop()
            try:
                left = max(deadline - time.monotonic(), 0.0)
                self._client = dask_cluster.connected(self._address, left)
                self._start(_silently)
                for key in self._in_hand:
                    self._submit(key)
                return
            except SchedulerLostError:
                if time.monotonic() >= deadline - dask_cluster.RETRY_S:
                    raise self._never_back(f"the Dask scheduler {self._address} did not come back") from None

    def _never_back(self, what: str) -> CanidError:
        return CanidError(
            f"fleet: {what} within {self._patience_s:g} s; run the same command again, it goes on from here"
        )

    def _drop(self) -> None:
        """Give the client up: nothing that it still reports counts."""
        self._generation += 1
        self._futures.clear()
        self._shared.clear()
        client, self._client = self._client, None
        if client is not None:
            with suppress(Exception):  # it may be half closed already
                client.close(timeout=dask_cluster.CLOSE_S)

    # --- jobs ---

    def _fill(self) -> None:
        """Take as many jobs as the cluster keeps busy; at the end, one suspect at a time."""
        if time.monotonic() - self._counted >= CHECK_S:
            self._count()
        if self._blind and not self._workers:
            self._start(self._inform)
        while len(self._in_hand) < max(JOBS_PER_THREAD * sum(self._workers.values()), 1):
            job = self._again.pop() if self._again else next(self._jobs, None)
            if job is None:
                break
            self._take(job, alone=False)
        if not self._in_hand and self._suspects:
            self._take(self._suspects.pop(), alone=True)

    def _take(self, job: Job, alone: bool, retries: int = 0) -> None:
        key = f"canid-{_digest(job)}-{self._run}-{next(self._numbers)}"
        self._in_hand[key] = _Job(job, alone, retries)
        self._submit(key)

    def _submit(self, key: str) -> None:
        job = self._in_hand[key].job
        try:
            source = self._source(job.source)
            restrictions: dict[str, Any] = {}
            if self._blind:
                self._allowed[key] = frozenset(self._workers)
                restrictions["workers"] = [*self._workers]
            future = self._client.submit(
                dask_worker.analyse, PROGRAM, job, source, key=key, pure=False, **restrictions
            )
            self._futures[key] = future
            future.add_done_callback(_reporter(self._done, self._generation, key))
        except Exception as error:  # a lost connection has many names
            raise SchedulerLostError(one_line(error)) from None

    def _source(self, name: str) -> Any:
        """A source on the cluster: the result of a task, because scattered data are lost with the workers that hold them."""
        if name not in self._shared:
            key = f"canid-source-{self._sources[name].fingerprint}-{self._run}-{next(self._numbers)}"
            self._shared[name] = self._client.submit(
                dask_worker.given, self._sources[name], key=key, pure=False
            )
        return self._shared[name]

    def _next(self) -> Outcome | None:
        """Wait for an outcome; None: there is none yet, or a job goes on."""
        try:
            generation, key = self._done.get(timeout=CHECK_S)
        except queue.Empty:
            self._await_workers()
            return None
        if generation != self._generation or key not in self._in_hand:
            return None
        future = self._futures[key]
        if future.status == "finished":
            return self._gathered(key, future)
        if future.status != "error":
            raise SchedulerLostError(f"a task was {future.status}")
        return self._erred(key, future)

    def _await_workers(self) -> None:
        """Where no worker is left, wait for one."""
        self._count()
        if self._workers:
            return
        try:
            self._start(self._inform)
        except ConfigError:
            raise self._never_back(f"no worker of {self._address} came back") from None

    def _gathered(self, key: str, future: Any) -> Outcome | None:
        try:
            answer, worker = future.result(timeout=self._patience_s)
        except (Exception, asyncio.CancelledError) as error:  # a lost connection has many names
            raise SchedulerLostError(one_line(error)) from None
        job = self._in_hand[key].job
        self._forget(key)
        outcome = Outcome(*answer)
        if outcome.failure in _OF_THE_PLACE and fetched.seen(job.log):
            self._leave_out(worker, outcome)
            self._again.append(job)
            return None
        return outcome

    def _leave_out(self, worker: str, outcome: Outcome) -> None:
        """Give a worker no more work that does not see a log which is there."""
        self._blind.add(worker)
        self._workers.pop(worker, None)
        host = worker.rpartition(":")[0]
        if host not in self._said_of:
            self._said_of.add(host)
            self._inform(
                f"the Dask worker {worker} does not see {outcome.log} ({outcome.reason}), which is there: it gets no more "
                "logs; mount them there under the same paths"
            )

    def _erred(self, key: str, future: Any) -> Outcome | None:
        try:
            error: BaseException = future.exception(timeout=self._patience_s)
        except (Exception, asyncio.CancelledError) as lost:  # a lost connection has many names
            raise SchedulerLostError(one_line(lost)) from None
        held = self._in_hand[key]
        self._forget(key)
        if isinstance(error, ConfigError):
            raise ConfigError(f"fleet: {error}")
        if isinstance(error, ImportError):
            raise ConfigError(dask_cluster.no_canid("", error))
        if isinstance(error, dask_cluster.distributed().KilledWorker):
            if held.alone:
                return failed(held.job, Failure.CRASHED, "every Dask worker that analysed it died")
            self._suspects.append(held.job)
            return None
        if held.retries < RETRIES:
            self._take(held.job, held.alone, held.retries + 1)
            return None
        return failed(held.job, Failure.ERROR, f"{type(error).__name__}: {one_line(error)}")

    def _forget(self, key: str) -> None:
        del self._in_hand[key]
        self._allowed.pop(key, None)
        self._futures.pop(key).release()


def _silently(line: str) -> None:
    """Of a loss one line is enough."""


def _reporter(done: queue.SimpleQueue[tuple[int, str]], generation: int, key: str) -> Callable[[Any], None]:
    return lambda _: done.put((generation, key))


def _digest(job: Job) -> str:
    """Of a job, the same in every run."""
    return hashlib.sha256(repr(tuple(job)).encode()).hexdigest()[:16]
