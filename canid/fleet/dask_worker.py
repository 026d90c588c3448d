"""What a Dask worker runs: the analysis of one log, in a child process of the thread that has the task."""

from __future__ import annotations

import atexit

from canid.errors import ConfigError
from canid.fleet.isolated import Children
from canid.fleet.job import Failure, Job, Outcome, Source
from canid.fleet.key import IDENTITY

# of this worker's threads; they end with it, also where it is killed
_CHILDREN = Children()
atexit.register(_CHILDREN.close)


def analyse(identity: str, job: Job, source: Source) -> Outcome:
    """Analyse one log; see `isolated.Child.analyse`.

    Args:
        identity: `key.IDENTITY` of the program that asks.
        job: the log.
        source: how it is decoded.

    Raises:
        ConfigError: this worker has another version of canid.
        RuntimeError: this worker is about to end; the log is for another one.
    """
    if identity != IDENTITY:
        raise ConfigError(other_version(IDENTITY, identity))
    outcome = _CHILDREN.analyse(job, source)
    if _CHILDREN.closed and outcome.failure is Failure.CRASHED:
        raise RuntimeError("this worker ends")
    return outcome


def given(source: Source) -> Source:
    """Return it: a task whose result other tasks share, and which is made anew where its worker has died."""
    return source


def end_children() -> None:
    """End the analyses that run on this worker."""
    _CHILDREN.close()


def other_version(theirs: str, ours: str) -> str:
    """The line for a worker whose results would be others.

    >>> other_version("0.1.0/1", "0.2.0/1")
    'a Dask worker has canid 0.1.0, this is 0.2.0: install the same version on all machines of the cluster'
    """
    a, b = (identity.partition("/")[0] for identity in (theirs, ours))
    if a == b:
        a, b = f"{a} with analysis {theirs.partition('/')[2]}", f"{b} with {ours.partition('/')[2]}"
    return (
        f"a Dask worker has canid {a}, this is {b}: install the same version on all machines of the cluster"
    )
