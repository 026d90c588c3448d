"""The receive loop of a socket: read at once what waits, else wait for it, and let what follows come too."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable
from typing import TypeVar

# s after the first frame has come until it is read, with those that follow: a wake-up costs more than a frame. The
# kernel has stamped them, and keeps 2 s of them.
READ_DELAY_S = 0.003

T = TypeVar("T")


class SocketWait:
    """Waits at one socket.

    Example:
        >>> inner, outer = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        >>> wait = SocketWait(inner)
        >>> outer.send(b"ab")
        2
        >>> wait.receive(1.0, lambda: inner.recv(8, socket.MSG_DONTWAIT))
        b'ab'
        >>> wait.receive(0.0, lambda: inner.recv(8, socket.MSG_DONTWAIT)) is None
        True
        >>> inner.close(), outer.close()
        (None, None)
    """

    def __init__(self, sock: socket.socket) -> None:
        """Register the socket."""
        self._poll = select.poll()
        self._poll.register(sock, select.POLLIN)

    def receive(
        self,
        timeout: float,
        read: Callable[[], T],
        *,
        empty: Callable[[], None] | None = None,
        lost: Callable[[OSError], None] | None = None,
    ) -> T | None:
        """Read once something is there; a busy bus has a frame waiting: one system call each.

        Args:
            timeout: s.
            read: reads without waiting; raises BlockingIOError where nothing waits.
            empty: called each time that nothing waits.
            lost: called with an error of the socket; where it returns, reading goes on. None: the error is raised.

        Returns:
            what `read` returns, or None where nothing came.
        """
        end = time.monotonic() + timeout
        while True:
            try:
                return read()
            except (BlockingIOError, InterruptedError):
                if empty is not None:
                    empty()
                left = end - time.monotonic()
                if left <= 0:
                    return None
                if self._poll.poll(left * 1000):
                    time.sleep(READ_DELAY_S)
            except OSError as error:
                if lost is None:
                    raise
                lost(error)
