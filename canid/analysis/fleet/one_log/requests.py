"""What a child of the analysis of a fleet is asked, one request after the other, until its parent is gone; then it ends."""

from __future__ import annotations

import os
import queue
import shutil
import signal
import threading
import time
from contextlib import suppress
from typing import Any, NoReturn

from canid.values.processes.serve import Connection

# s between two checks whether the parent still lives
PARENT_CHECK_S = 0.5


class Requests:
    """The parent's requests. Two threads belong to them: begin when this process has given up what rights it gives up.

    Args:
        connection: to the parent.
        parent: its process.
        scratch: a folder whose content is deleted where the parent is gone; else the parent deletes it.
    """

    def __init__(self, connection: Connection, parent: int, scratch: str) -> None:
        self._connection = connection
        self._parent = parent
        self._scratch = scratch
        self._waiting: queue.SimpleQueue[Any] = queue.SimpleQueue()
        for target in (self._read, self._watch):
            threading.Thread(target=target, daemon=True).start()

    def next(self) -> Any:
        """Wait for a request."""
        return self._waiting.get()

    def _read(self) -> None:
        """Where the input ends, the parent has closed it or died, and nobody wants an answer."""
        with suppress(Exception):  # whatever ends the input ends this process
            for request in self._connection.messages():
                self._waiting.put(request)
        self._end()

    def _watch(self) -> None:
        """End where the parent is gone: another process may hold the other end of the input open."""
        while os.getppid() == self._parent:
            time.sleep(PARENT_CHECK_S)
        self._end()

    def _end(self) -> NoReturn:
        # a confined process may not remove the folder itself: the next run does (`scratch`)
        shutil.rmtree(self._scratch, ignore_errors=True)
        if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)  # and what it has started itself
        os._exit(0)
