"""Waiting for a thread in short turns, so that progress is shown and a signal's handler runs."""

from __future__ import annotations

import threading
from collections.abc import Callable

# s between two calls of the progress while a thread is waited for
PROGRESS_S = 0.2


def join(thread: threading.Thread, waiting: Callable[[], object]) -> None:
    """Wait for a thread, however long it takes; `waiting` is called every `PROGRESS_S`, what it raises ends the wait.

    >>> thread = threading.Thread(target=lambda: None)
    >>> thread.start()
    >>> join(thread, lambda: None)
    >>> thread.is_alive()
    False
    """
    while thread.is_alive():
        thread.join(PROGRESS_S)
        if thread.is_alive():
            waiting()
