"""Busy processes during a trial, each in a session of its own, as other users' jobs are."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def load(count: int) -> Iterator[None]:
    """Keep `count` processes busy at the usual priority.

    A session of its own: Linux' autogroup shares the cores among sessions first.
    """
    command = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(command, start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()
