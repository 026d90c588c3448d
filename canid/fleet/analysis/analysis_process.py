"""The child of `canid.fleet.analysis.isolated`: analyses one log after another, within limits, until its parent is gone."""

from __future__ import annotations

import faulthandler
import os
import queue
import shutil
import signal
import sys
import tempfile
import threading
import time
from contextlib import suppress
from typing import Any, NoReturn

from canid.fleet.analysis.isolated import MEMORY_EXIT_CODE
from canid.processes import limits
from canid.processes.serve import Connection, connect

# s between two checks whether the parent still lives
PARENT_CHECK_S = 0.5
# s beyond a log's own limit, after which a child that nobody ended ends itself: its parent has died, and Python cannot run
GRACE_S = 10.0


def main() -> NoReturn:
    """Answer requests over standard input: (job, fingerprint of its source, the source or None)."""
    connection = connect()
    parent, scratch = int(sys.argv[1]), sys.argv[2]
    # what is fetched or written on the way is there, and the parent deletes it
    tempfile.tempdir = scratch
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(connection, requests, scratch), daemon=True).start()
    threading.Thread(target=_watch, args=(parent, scratch), daemon=True).start()
    code = 1
    try:
        _serve(requests, connection)
    except MemoryError:
        code = MEMORY_EXIT_CODE
    finally:
        os._exit(code)  # at once: the threads are in the middle of reading


def _serve(requests: queue.SimpleQueue[Any], connection: Connection) -> None:
    from canid.fleet.analysis.analysis import analyse
    from canid.fleet.answers.joint_diagnosis import diagnose_together
    from canid.fleet.answers.recent_traces import RecentTraces

    connection.answer("ready")
    sources: dict[str, Any] = {}
    recent = RecentTraces()
    while True:
        job, fingerprint, source = requests.get()
        if source is not None:
            sources[fingerprint] = source
        # ends the process without the interpreter, should that be kept busy
        faulthandler.dump_traceback_later(job.settings.timeout_s + GRACE_S, exit=True, file=2)
        limits.limit_data(job.settings.memory_bytes)
        try:
            of_job = sources[fingerprint]
            outcome = diagnose_together(job, of_job, recent) if job.together else analyse(job, of_job)
        finally:
            limits.limit_data(None)
            faulthandler.cancel_dump_traceback_later()
        connection.answer((tuple(outcome), limits.resident_bytes()))


def _read(connection: Connection, requests: queue.SimpleQueue[Any], scratch: str) -> None:
    """Pass requests on; where the input ends, the parent has closed it or died, and nobody wants an answer."""
    with suppress(Exception):  # whatever ends the input ends this process
        for request in connection.messages():
            requests.put(request)
    _end(scratch)


def _watch(parent: int, scratch: str) -> None:
    """End where the parent is gone: another process may hold the other end of the input open."""
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK_S)
    _end(scratch)


def _end(scratch: str) -> None:
    shutil.rmtree(scratch, ignore_errors=True)
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)  # and what it has started itself
    os._exit(0)


if __name__ == "__main__":
    main()
