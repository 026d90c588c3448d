"""An outage of the storage is waited for, and is no property of the logs that it holds.

Once a log is `not_reached`, no further log of its storage is tried. When all others are done, the storage is asked at
growing intervals; once it answers, its logs are tried again. Where it does not within `PATIENCE_S`, they stay `not_reached`,
and the next run tries them again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import closing

from canid.analysis.fleet.job import Failure, Job, Outcome
from canid.analysis.fleet.planning import address, fetched
from canid.analysis.fleet.running.isolated import failed

# s for which an outage is waited for: a restart of a service takes minutes
PATIENCE_S = 600.0
# s between two questions: the first, and the longest
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 60.0
# times that a log is tried while the storage answers for others
MAX_TRIES = 3
# logs for which the storage is asked: it may have lost one alone
ASKED = 3

# gives the outcomes of jobs, in any order
Runner = Callable[[Iterable[Job]], Generator[Outcome]]


def storage_of(log: str) -> str:
    """The storage of a URL: what answers or does not; "": a local file.

    Example:
        >>> storage_of("s3://bucket/a/b.blf"), storage_of("http://host:80/c.blf"), storage_of("/a.blf")
        ('s3://bucket', 'http://host:80', '')
    """
    scheme = address.scheme_of(log)
    rest = log.removeprefix(f"{scheme}://")
    return f"{scheme}://{rest.partition('/')[0]}" if scheme else ""


def outcomes(jobs: Iterable[Job], runner: Runner, inform: Callable[[str], None]) -> Generator[Outcome]:
    """The outcomes of a runner; logs whose storage did not answer are tried again when it does.

    Args:
        jobs: the logs, taken one by one.
        runner: is called once, and again after each outage; closed where the iterator is.
        inform: takes a line for the user.

    Example:
        >>> def runner(jobs):
        ...     yield from (failed(job, Failure.MISSING, "no such file") for job in jobs)
        >>> [one.failure.value for one in outcomes([Job("/a.blf", 0, 0, "")], runner, print)]
        ['missing']
    """
    tries: dict[str, int] = {}
    lost: dict[str, Outcome] = {}
    while True:
        silent: set[str] = set()  # storages that do not answer
        held: list[Job] = []
        again: list[Job] = []
        in_hand: dict[str, Job] = {}
        with closing(runner(_answering(jobs, silent, held, in_hand))) as running:
            for outcome in running:
                job = in_hand.pop(outcome.log, None)
                if outcome.failure is not Failure.NOT_REACHED or job is None:
                    yield outcome
                    continue
                silent.add(storage_of(outcome.log))
                lost[outcome.log] = outcome
                tries[outcome.log] = tries.get(outcome.log, 0) + 1
                if tries[outcome.log] < MAX_TRIES:
                    again.append(job)
                else:
                    yield outcome
        # those last that have failed before: all that can be reached is, whatever becomes of them
        jobs = left = []
        for storage in sorted(silent):
            waiting = [job for job in (*held, *again) if storage_of(job.log) == storage]
            if not waiting:
                continue
            if _awaited(storage, waiting, inform):
                left += waiting
                continue
            for job in waiting:
                reason = "its storage does not answer"
                yield lost.get(job.log) or failed(job, Failure.NOT_REACHED, reason)
        if not left:
            return


def _answering(
    jobs: Iterable[Job], silent: set[str], held: list[Job], in_hand: dict[str, Job]
) -> Iterator[Job]:
    """The jobs whose storage answers, each noted as in hand; the others are held back."""
    for job in jobs:
        if silent and storage_of(job.log) in silent:
            held.append(job)
        else:
            in_hand[job.log] = job
            yield job


def _awaited(storage: str, waiting: Sequence[Job], inform: Callable[[str], None]) -> bool:
    """Ask a storage until it answers; False: it does not within `PATIENCE_S`."""
    asked = waiting[:ASKED]
    logs = f"{len(waiting):,} log{'s' if len(waiting) > 1 else ''}"
    begun, pause, said = time.monotonic(), FIRST_PAUSE_S, False
    while not any(fetched.answers(job.log) for job in asked):
        left = begun + PATIENCE_S - time.monotonic()
        if left <= 0.0:
            inform(f"{storage} did not answer: {logs} not reached; the same command tries them again")
            return False
        if not said:
            said = True
            inform(f"{storage} does not answer: {logs} wait for it, {PATIENCE_S / 60.0:g} min at most")
        time.sleep(min(pause, left))
        pause = min(2.0 * pause, LONGEST_PAUSE_S)
    inform(
        f"{storage} answers again: {logs} go on"
        if said
        else f"{storage} did not answer for a while: {logs} go on"
    )
    return True
