"""Many logs on this machine: a thread for each worker, and a child process for each thread."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from itertools import islice

from canid.analysis.fleet.job import Job, Outcome, Source
from canid.analysis.fleet.running.isolated import Children

# jobs in hand per worker: one that runs, and one that waits for it
JOBS_PER_WORKER = 2


def outcomes(jobs: Iterable[Job], sources: Mapping[str, Source], workers: int) -> Generator[Outcome]:
    """Analyse many logs; the outcomes come as they are ready.

    Closing the iterator ends everything that runs, at once.

    Args:
        jobs: taken one by one, a few more than are analysed.
        sources: by the jobs' `source`.
        workers: processes.

    Yields:
        one outcome for each job.

    Raises:
        KeyError: a job names a source that there is not.

    Example:
        >>> [one.failure.value for one in outcomes([Job("no.blf", 0, 0, "a")], {"a": Source(None, None, "a")}, 1)]
        ['missing']
    """
    children = Children()
    with ThreadPoolExecutor(workers, thread_name_prefix="canid-fleet") as pool:
        try:
            yield from over(pool, children.analyse, jobs, sources, JOBS_PER_WORKER * workers)
        finally:
            # also where it is closed early: the threads wait for their children
            pool.shutdown(wait=False, cancel_futures=True)
            children.close()


def over(
    executor: Executor,
    analyse: Callable[[Job, Source], Outcome],
    jobs: Iterable[Job],
    sources: Mapping[str, Source],
    in_hand: int,
) -> Generator[Outcome]:
    """Run jobs on any `concurrent.futures.Executor`, at most `in_hand` at a time.

    Args:
        executor: where `analyse` is called.
        analyse: such as `isolated.Child.analyse`.
        jobs: taken one by one.
        sources: by the jobs' `source`.
        in_hand: jobs that were taken and not yielded, at most.
    """
    coming = iter(jobs)
    running: set[Future[Outcome]] = set()
    while True:
        more = islice(coming, in_hand - len(running))
        running |= {executor.submit(analyse, job, sources[job.source]) for job in more}
        if not running:
            return
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()
