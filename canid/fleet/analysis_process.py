"""The child of `canid.fleet.isolated`: analyses one log after another, within limits, until its parent is gone."""

from __future__ import annotations

import faulthandler
import os
import pickle
import queue
import shutil
import signal
import sys
import tempfile
import threading
import time
from contextlib import suppress
from typing import IO, Any, NoReturn

from canid.fleet.isolated import MEMORY_EXIT_CODE
from canid.one_thread import use_one_thread

# s between two checks whether the parent still lives
PARENT_CHECK_S = 0.5
# s beyond a log's own limit, after which a child that nobody ended ends itself: its parent has died, and Python cannot run
GRACE_S = 10.0


def main() -> NoReturn:
    """Answer requests over standard input: (job, fingerprint of its source, the source or None)."""
    for ignored in (signal.SIGINT, signal.SIGHUP):
        if ignored in signal.valid_signals():
            signal.signal(ignored, signal.SIG_IGN)  # a Ctrl-C in the terminal is for the parent to answer
    use_one_thread()
    parent, scratch = int(sys.argv[1]), sys.argv[2]
    # what is fetched or written on the way is there, and the parent deletes it
    tempfile.tempdir = scratch
    source, sink = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # nothing that a library prints gets between the answers
    requests: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(source, requests, scratch), daemon=True).start()
    threading.Thread(target=_watch, args=(parent, scratch), daemon=True).start()
    code = 1
    try:
        _serve(requests, sink)
    except MemoryError:
        code = MEMORY_EXIT_CODE
    finally:
        os._exit(code)  # at once: the threads are in the middle of reading


def _serve(requests: queue.SimpleQueue[Any], sink: IO[bytes]) -> None:
    from canid.fleet.analysis import analyse
    from canid.fleet.joint_diagnosis import diagnose_together

    _answer(sink, "ready")
    sources: dict[str, Any] = {}
    while True:
        job, of, source = requests.get()
        if source is not None:
            sources[of] = source
        # ends the process without the interpreter, should that be kept busy
        faulthandler.dump_traceback_later(job.settings.timeout_s + GRACE_S, exit=True, file=2)
        _limit(job.settings.memory_bytes)
        try:
            outcome = (diagnose_together if job.together else analyse)(job, sources[of])
        finally:
            _limit(-1)
            faulthandler.cancel_dump_traceback_later()
        _answer(sink, (tuple(outcome), _resident_bytes()))


def _answer(sink: IO[bytes], answer: Any) -> None:
    pickle.dump(answer, sink, protocol=5)
    sink.flush()


def _read(source: IO[bytes], requests: queue.SimpleQueue[Any], scratch: str) -> None:
    """Pass requests on; where the input ends, the parent has closed it or died, and nobody wants an answer."""
    with suppress(Exception):  # whatever ends the input ends this process
        while True:
            requests.put(pickle.load(source))
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


def _limit(memory_bytes: int) -> None:
    """Let this process allocate so much; more is a MemoryError. Below 0: as much as it wants."""
    try:
        import resource
    except ImportError:  # no POSIX: the system's own limits hold
        return
    with suppress(OSError, ValueError):
        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        bounded = memory_bytes >= 0 and (hard == resource.RLIM_INFINITY or memory_bytes < hard)
        soft = memory_bytes if bounded else hard
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def _resident_bytes() -> int:
    """Memory that this process holds; 0: the system does not say."""
    with suppress(OSError, ValueError, IndexError), open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


if __name__ == "__main__":
    main()
