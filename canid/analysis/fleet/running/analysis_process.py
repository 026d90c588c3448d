"""The child of `isolated`: analyses one log after another, within limits, until its parent is gone.

Before the first byte of a log it gives up its rights to write outside of its scratch folder, to send, to start other
programs and to signal others (`confinement`): logs are strangers', and it parses them. What is to be fetched it asks its
parent for. Answers: `READY`; then of each request `(FETCH, log)` as often as needed, which the parent answers as
`fetch_process` does, and `(DONE, outcome, bytes that this process holds)`.
"""

from __future__ import annotations

import faulthandler
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from canid.analysis.fleet.one_log.requests import Requests
from canid.analysis.fleet.running.isolated import DONE, FETCH, MEMORY_EXIT_CODE, READY
from canid.values.processes import limits
from canid.values.processes.confinement import confine
from canid.values.processes.kept_rights import Kept
from canid.values.processes.serve import Connection, connect

if TYPE_CHECKING:
    from canid.analysis.fleet.planning.fetched import Listed

# s beyond a log's own limit, after which a child that nobody ended ends itself: its parent has died, and Python cannot run
GRACE_S = 10.0


def main() -> NoReturn:
    """Answer requests over standard input: (job, fingerprint of its source, the source or None)."""
    connection = connect(plain=True)
    parent, scratch = int(sys.argv[1]), sys.argv[2]
    # of this process, and of those that it starts
    tempfile.tempdir = os.environ["TMPDIR"] = scratch
    code = 1
    try:
        _serve(connection, parent, scratch)
    except MemoryError:
        code = MEMORY_EXIT_CODE
    finally:
        os._exit(code)  # at once: the threads are in the middle of reading


def _serve(connection: Connection, parent: int, scratch: str) -> None:
    from canid.analysis.fleet.answers.joint_diagnosis import diagnose_together
    from canid.analysis.fleet.answers.recent_traces import RecentTraces
    from canid.analysis.fleet.one_log import peak_memory
    from canid.analysis.fleet.one_log.analysis import analyse

    # opens what it is set with, which stays open
    peak_memory.restart()
    confine(Kept(folders=(scratch,), children=True))
    requests = Requests(connection, parent, scratch)
    connection.answer(READY)
    fetched = _by_parent(connection, requests)
    sources: dict[str, Any] = {}
    recent = RecentTraces()
    while True:
        job, fingerprint, source = requests.next()
        if source is not None:
            sources[fingerprint] = source
        # ends the process without the interpreter, should that be kept busy
        faulthandler.dump_traceback_later(job.settings.timeout_s + GRACE_S, exit=True, file=2)
        limits.limit_data(job.settings.memory_bytes)
        try:
            of_job = sources[fingerprint]
            outcome = (
                diagnose_together(job, of_job, recent, fetched)
                if job.together
                else analyse(job, of_job, fetched)
            )
        finally:
            limits.limit_data(None)
            faulthandler.cancel_dump_traceback_later()
        connection.answer((DONE, tuple(outcome), limits.resident_bytes()))


def _by_parent(connection: Connection, requests: Requests) -> Callable[[str, Listed], Any]:
    """What gives a local path for a log: as `fetched.fetched`, by the parent."""
    from canid.analysis.fleet.failed import Failed
    from canid.analysis.fleet.job import Failure
    from canid.analysis.fleet.planning import fetched

    @contextmanager
    def given(log: str, listed: Listed) -> Iterator[Path]:
        if not fetched.is_stored(log):
            with fetched.fetched(log, listed) as path:
                yield path
            return
        connection.answer((FETCH, log))
        copy, failure, reason = requests.next()
        if failure:
            raise Failed(Failure(failure), reason)
        try:
            yield Path(copy)
        finally:
            shutil.rmtree(Path(copy).parent, ignore_errors=True)

    return given


if __name__ == "__main__":
    main()
