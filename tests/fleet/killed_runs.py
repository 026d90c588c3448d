"""A run of a fleet that kills itself at a chosen call of the system, in a fork of one process: one line of text for each.

Run as a program: reads lines `CALLS` from standard input, runs the fleet of argv[1] into argv[2], and answers `done` or
`killed`. CALLS is the number of calls that change files after which the process is ended by SIGKILL; 0: never.
"""

from __future__ import annotations

import hashlib
import os
import signal
import sys
from collections.abc import Callable, Generator, Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from canid.analysis.fleet.job import Failure, Job, Outcome, Settings, Status
from canid.analysis.fleet.key import key
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.running import run as fleet_run
from canid.analysis.fleet.storage import parts
from canid.analysis.fleet.storage import store as fleet_store

# calls by which files and names change; each is a place where a kill may come before or after it
CALLS = ("write", "fsync", "fdatasync", "rename", "replace", "unlink", "rmdir", "mkdir", "ftruncate")
# a part after so few outcomes that a short run makes several, of which some are merged
OUTCOMES_OF_A_PART = 3
MAX_PARTS = 2


def outcomes(jobs: Iterable[Job]) -> Generator[Outcome]:
    """Rows that follow from a log's bytes: what the store has to keep, without the cost of an identification."""
    for job in jobs:
        content = Path(job.log).read_bytes()
        of = key(hashlib.sha256(content).hexdigest(), job.source, job.settings)
        if content.startswith(b"bad"):
            yield Outcome(job.log, of, Status.FAILED, Failure.NOT_A_LOG, "holds no frame", {})
            continue
        number = int.from_bytes(content[:2], "little") / 7.0
        yield Outcome(
            job.log,
            of,
            Status.DAMAGED if content.endswith(b"!") else Status.OK,
            Failure.NONE,
            "cut off" if content.endswith(b"!") else "",
            {
                "drives": [
                    {"sha256": of, "duration": number, "names": ["K"], "estimate": [number], "causes": []}
                ],
                "windows": [{"t": float(k), "estimator": "fopdt", "fit_percent": number} for k in range(5)],
                "events": [{"t": 1.0, "kind": "signal", "says": 'quote " and\nline'}],
                "findings": [{"effect": "dead_zone", "gain": number}] * 2,
                "power": [{"effect": "dead_zone", "strength": float("nan")}],
            },
        )


def killing(after: int) -> None:
    """End this process before one of its calls."""
    left = [after]

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any, **settings: Any) -> Any:
            left[0] -= 1
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*args, **settings)

        return called

    for name in CALLS:
        setattr(os, name, counted(getattr(os, name)))


def once(logs: str, folder: str, after: int) -> None:
    """One run; a name goes to `stored` when its outcome is stored, and to `submitted` when it is analysed."""
    notes = {
        name: os.open(f"{folder}.{name}", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        for name in ("stored", "submitted")
    }
    write = os.write

    def noted(jobs: Iterable[Job]) -> Generator[Outcome]:
        for outcome in outcomes(jobs):
            write(notes["submitted"], f"{outcome.log}\n".encode())
            yield outcome
            # asked for the next one: the last one is stored
            write(notes["stored"], f"{outcome.log}\n".encode())

    fleet_store.SEGMENT_OUTCOMES = OUTCOMES_OF_A_PART
    parts.MAX_PARTS = MAX_PARTS
    plan = planned([logs], vehicle="generic")
    if after:
        killing(after)
    with fleet_store.opened(folder) as store:
        fleet_run.run(plan, store, Settings(), noted)


def main() -> None:
    """Answer lines."""
    logs, folder = sys.argv[1:]
    # imported and read once; the forks have it
    import_module("duckdb")
    planned([logs], vehicle="generic")
    print("ready", flush=True)
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            once(logs, folder, int(line))
            os._exit(0)
        _, status = os.waitpid(child, 0)
        code = os.waitstatus_to_exitcode(status)
        print({0: "done", -signal.SIGKILL: "killed"}.get(code, f"failed {code}"), flush=True)


if __name__ == "__main__":
    main()
