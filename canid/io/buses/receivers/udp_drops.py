"""Drops of a UDP socket: python-can's udp_multicast does not count them, the kernel does, in /proc/net/udp."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from canid.io.buses.receivers.socketcan import configure

# linux/in.h, linux/in6.h; Python's socket module has neither
IP_MULTICAST_ALL, IPV6_MULTICAST_ALL = 49, 29
# frames that may wait in a new socket: 1 s of a full bus
_MAX_QUEUED_FRAMES = 8000
_TABLES = ("/proc/net/udp", "/proc/net/udp6")


def watch(bus: Any) -> Callable[[], int]:
    """Give the socket behind a udp_multicast bus a large buffer; returns a function that counts its drops."""
    fd = int(bus.fileno())
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(fd)) as sock:
        configure(sock)
        own_group_alone(sock)
    try:
        inode = str(os.fstat(fd).st_ino)
    except OSError:
        return lambda: 0
    seen = 0

    def count() -> int:
        nonlocal seen
        for table in _TABLES:
            with contextlib.suppress(OSError):
                text = Path(table).read_text(encoding="ascii")
                # keeps the last count once the socket is closed
                seen = max(seen, in_table(text, inode))
        return seen

    return count


def own_group_alone(sock: socket.socket) -> None:
    """Receive from the socket's own group only: by default Linux delivers groups that any socket of the machine has joined.

    What came before this, since the socket was opened, may be from any group: it is discarded.
    """
    if sock.family == socket.AF_INET6:
        sock.setsockopt(socket.IPPROTO_IPV6, IPV6_MULTICAST_ALL, 0)
    else:
        sock.setsockopt(socket.IPPROTO_IP, IP_MULTICAST_ALL, 0)
    with contextlib.suppress(BlockingIOError):
        for _ in range(_MAX_QUEUED_FRAMES):
            sock.recv(1, socket.MSG_DONTWAIT)


def in_table(text: str, inode: str) -> int:
    r"""Drops of the socket with this inode; 0 where it is not listed.

    >>> head = "sl local rem st tx:rx tr:when retrnsmt uid timeout inode ref pointer drops"
    >>> in_table(head + "\n1: A B 07 0:0 0:0 0 0 0 4711 2 ffff 23\n", "4711")
    23
    """
    for line in text.splitlines()[1:]:
        fields = line.split()
        if len(fields) >= 13 and fields[9] == inode:
            return int(fields[12])
    return 0
