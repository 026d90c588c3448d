"""What a Dask worker runs: the analysis of one log, in a child process of the thread that has the task."""

from __future__ import annotations

import atexit

from canid.analysis.fleet.job import Failure, Job, Outcome, Source
from canid.analysis.fleet.key import PROGRAM
from canid.analysis.fleet.running.isolated import Children
from canid.values.errors import ConfigError

# of this worker's threads; they end with it, also where it is killed
_CHILDREN = Children()
atexit.register(_CHILDREN.close)


def analyse(program: str, job: Job, source: Source) -> tuple[Outcome, str]:
    """Analyse one log; see `isolated.Child.analyse`.

    Args:
        program: `key.PROGRAM` of the program that asks.
        job: the log.
        source: how it is decoded.

    Returns:
        the outcome, and the worker's address.

    Raises:
        ConfigError: this worker has another version of canid or Python.
        RuntimeError: this worker is about to end; the log is for another one.
    """
    if program != PROGRAM:
        raise ConfigError(other_version(PROGRAM, program))
    outcome = _CHILDREN.analyse(job, source)
    if _CHILDREN.closed and outcome.failure is Failure.CRASHED:
        raise RuntimeError("this worker ends")
    from distributed import get_worker

    return outcome, str(get_worker().address)


def given(source: Source) -> Source:
    """Return it: a task whose result other tasks share, and which is made anew where its worker has died."""
    return source


def other_version(theirs: str, ours: str) -> str:
    """The line for a worker whose results would be others, or which could not be understood.

    >>> other_version("0.1.0/1/3.12", "0.2.0/1/3.11")
    'a Dask process has canid 0.1.0 on Python 3.12, this is 0.2.0 on Python 3.11: install the same versions on all machines'
    """
    a, b = _versions(theirs), _versions(ours)
    return f"a Dask process has canid {a}, this is {b}: install the same versions on all machines"


def _versions(program: str) -> str:
    """Of `key.PROGRAM`.

    >>> _versions("0.1.0/1/3.12"), _versions("0.1.0/2/3.12"), _versions("0.0.9/1")
    ('0.1.0 on Python 3.12', '0.1.0 (analysis 2) on Python 3.12', '0.0.9')
    """
    version, analysis, python = [*program.split("/"), "", ""][:3]
    of_analysis = f" (analysis {analysis})" if analysis not in ("", "1") else ""
    return f"{version}{of_analysis}" + (f" on Python {python}" if python else "")
