"""The child that fetches logs from storage for a process that may not connect, until its parent is gone.

It copies bytes and reads none of them as a log. It keeps its rights: a storage's package may start a program that gives it
credentials, and keep them in a file. Answers: the path of the copy, in a folder of its own, "", ""; or "", a `Failure`, why.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import NoReturn

from canid.analysis.fleet.failed import NO_MEMORY, Failed, failure_of, reason_of
from canid.analysis.fleet.job import Failure
from canid.analysis.fleet.one_log.requests import Requests
from canid.analysis.fleet.planning.fetched import Listed, fetch
from canid.values.processes import limits
from canid.values.processes.serve import connect


def main() -> NoReturn:
    """Answer requests over standard input: (log, size, time, bytes of memory that this may take)."""
    connection = connect(plain=True)
    scratch = tempfile.tempdir = sys.argv[2]
    requests = Requests(connection, int(sys.argv[1]), scratch)
    try:
        while True:
            log, size, modified_ns, memory_bytes = requests.next()
            limits.limit_data(memory_bytes)
            try:
                answer = _answer(log, Listed(size, modified_ns))
            finally:
                limits.limit_data(None)
            connection.answer(answer)
    finally:
        os._exit(1)  # at once: the threads are in the middle of reading


def _answer(log: str, listed: Listed) -> tuple[str, str, str]:
    folder = tempfile.mkdtemp(prefix="canid-")
    try:
        return str(fetch(log, listed, Path(folder))), "", ""
    except Exception as error:  # each storage has exceptions of its own
        shutil.rmtree(folder, ignore_errors=True)
        failure = failure_of(error, Failure.ERROR)
        reason = str(error) if isinstance(error, Failed) else reason_of(error, "", log)
        return "", failure.value, NO_MEMORY if failure is Failure.MEMORY else reason


if __name__ == "__main__":
    main()
