"""A program that analyses logs on workers of its own, and prints outcomes and the processes that it started."""

from __future__ import annotations

import os

from canid.fleet.analysis import dask_run
from tests.fleet.dask_processes import descendants
from tests.fleet.fleet_jobs import SOURCES, job


def main(logs: list[str]) -> None:
    pids: set[int] = set()
    for outcome in dask_run.outcomes([job(log) for log in logs], SOURCES, scheduler=None, workers=2):
        print(outcome.log, outcome.status.value, flush=True)
        pids |= set(descendants(os.getpid()))
    print(*pids, flush=True)
