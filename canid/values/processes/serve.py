"""The child's side: pickled messages in on standard input, answers out on standard output, until the input ends."""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Iterator
from typing import IO, Any, NamedTuple

from canid.values.processes import plain_values
from canid.values.processes.one_thread import use_one_thread


class Connection(NamedTuple):
    """The two pipes to the parent."""

    source: IO[bytes]
    sink: IO[bytes]
    plain: bool = False  # answers are values alone, as `Child(answers=...)` expects them

    def messages(self) -> Iterator[Any]:
        """Messages of the parent, until it closes the pipe or dies."""
        while True:
            try:
                message = pickle.load(self.source)
            except EOFError:
                return
            yield message

    def answer(self, answer: Any) -> None:
        """Send an answer. Raises OSError where the parent is gone."""
        self.sink.write(plain_values.dumps(answer) if self.plain else pickle.dumps(answer, protocol=5))
        self.sink.flush()


def connect(*, plain: bool = False) -> Connection:
    """Begin as a child; to be called once, before numpy is imported.

    What a library prints goes to standard error, not between the answers. SIGINT and SIGHUP are ignored: a Ctrl-C in
    the terminal is for the parent to answer. Linear algebra has one thread: other cores belong to other processes.

    Args:
        plain: answer with values alone (`plain_values`): what every child does that parses what strangers wrote.
    """
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    use_one_thread()
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return Connection(sys.stdin.buffer, sink, plain)
