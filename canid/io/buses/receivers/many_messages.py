"""Many messages of a socket with one system call: recvmmsg(2) through ctypes, into arrays that are allocated once.

Layouts from bits/socket.h, recvmmsg(2) and cmsg(3); asm-generic/socket.h has the numbers of the control messages.
"""

from __future__ import annotations

import ctypes
import errno
import math
import os
import socket
import sys
import time
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

# s between two calls on a busy bus: what comes meanwhile is received together, and the kernel has stamped it
GATHER_S = 0.02
# frames/s that a socket must have room for while they are gathered for longer: CAN FD at 8 Mbit/s
MOST_PER_S = 20_000
# bytes of its buffer that a message takes at most, with the kernel's own structure of it: half a page and that
_BYTES_PER_MESSAGE = 2304

SO_TIMESTAMPNS, SO_TIMESTAMPNS_NEW = 35, 64
SO_TIMESTAMPING, SO_TIMESTAMPING_NEW = 37, 65
SO_RXQ_OVFL = 40

Octets = npt.NDArray[np.uint8]

# struct iovec, struct msghdr and struct mmsghdr with the padding of the C compiler
_IOVEC = np.dtype([("base", np.uintp), ("length", np.uintp)], align=True)
_MSGHDR = np.dtype(
    [
        ("name", np.uintp),
        ("namelen", np.uint32),
        ("iov", np.uintp),
        ("iovlen", np.uintp),
        ("control", np.uintp),
        ("controllen", np.uintp),
        ("flags", np.int32),
    ],
    align=True,
)
_MMSGHDR = np.dtype([("header", _MSGHDR), ("length", np.uint32)], align=True)
# struct cmsghdr; its data and the next one begin at multiples of the size of an address
_CMSGHDR = np.dtype([("length", np.uintp), ("level", np.int32), ("kind", np.int32)], align=True)
_ALIGNMENT = np.dtype(np.uintp).itemsize


@cache
def _call() -> Any:
    """The C library's recvmmsg; None where it, or the kernel, does not have it."""
    if sys.platform != "linux":
        return None
    try:
        call = ctypes.CDLL(None, use_errno=True).recvmmsg
    except (OSError, AttributeError):
        return None
    call.argtypes = (ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
    call.restype = ctypes.c_int
    call(-1, None, 0, socket.MSG_DONTWAIT, None)
    return call if ctypes.get_errno() == errno.EBADF else None


def available() -> bool:
    """Whether many messages can be received with one call."""
    return _call() is not None


class ManyMessages:
    """The arrays of one socket, and the call that fills them; the next call overwrites them.

    Example:
        >>> inner, outer = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        >>> messages = ManyMessages(inner, most=4, octets=8, ancillary=32)
        >>> [outer.send(text) for text in (b"ab", b"c")]
        [2, 1]
        >>> messages.receive(), messages.lengths[:2].tolist(), bytes(messages.octets[0, :2])
        (2, [2, 1], b'ab')
        >>> inner.close(), outer.close()
        (None, None)
    """

    def __init__(self, sock: socket.socket, *, most: int, octets: int, ancillary: int, more: int = 0) -> None:
        """`most` messages of `octets` bytes, and of `more` in another array, with `ancillary` bytes of control messages.

        The room for control messages is rounded up to whole words of 8 bytes: a system of 32 bits aligns by 4.
        """
        self.most = most
        self.octets = np.zeros((most, octets), np.uint8)
        self.more = np.zeros((most, more), np.uint8)
        ancillary += -ancillary % 8
        self.ancillary = np.zeros((most, ancillary), np.uint8)
        self._socket = sock
        self._parts = np.zeros((most, 2), _IOVEC)
        self._headers = np.zeros(most, _MMSGHDR)
        for column, array in enumerate((self.octets, self.more)):
            self._parts["base"][:, column] = _addresses(array)
            self._parts["length"][:, column] = array.shape[1]
        header = self._headers["header"]
        header["iov"] = _addresses(self._parts)
        header["iovlen"] = 2 if more else 1
        header["control"] = _addresses(self.ancillary)
        header["controllen"] = ancillary
        self._at = self._headers.ctypes.data
        self._words = self.ancillary.view(np.int64)
        self._usual: _Usual | None = None
        self.lengths = self._headers["length"]  # bytes of each message that are in the arrays
        self.flags = header["flags"]
        self.ancillary_lengths = header["controllen"]

    def receive(self) -> int:
        """Receive what waits, without waiting; returns how many messages. Raises OSError, BlockingIOError for none."""
        count = int(_call()(self._socket.fileno(), self._at, self.most, socket.MSG_DONTWAIT, None))
        if count < 0:
            code = ctypes.get_errno()
            raise OSError(code, os.strerror(code))
        return count

    def stamps(self, count: int) -> Stamps:
        """The control messages of the first `count` messages; they can be read once."""
        words, usual = self._words[:count], self._usual
        if usual is None or not self._are_usual(usual, count):
            lengths = self.ancillary_lengths[:count]
            parsed = stamps(self.ancillary[:count], lengths)
            self._usual = _usual(self.ancillary[0, : int(lengths[0])])
            self.ancillary_lengths[:count] = self.ancillary.shape[1]
        else:
            at = usual.stamp
            parsed = Stamps(words[:, at] * 1_000_000_000 + words[:, at + 1], None, None)
            if usual.length != self.ancillary.shape[1]:
                self.ancillary_lengths[:count] = self.ancillary.shape[1]
        words[:, 0] = 0
        return parsed

    def _are_usual(self, usual: _Usual, count: int) -> bool:
        # the first words are erased behind each reading: headers that fit have come with this call
        if not (self._words[:count, : usual.stamp] == usual.heads).all():
            return False
        # where they fill the room there is none for others
        full = usual.length == self.ancillary.shape[1]
        return full or bool((self.ancillary_lengths[:count] == usual.length).all())


class _Usual(NamedTuple):
    """Control messages that hold the kernel's stamp of 64 bits alone: so are nearly all."""

    length: int
    heads: npt.NDArray[np.int64]  # the words of the header
    stamp: int  # the first word of the time


def _usual(ancillary: Octets) -> _Usual | None:
    messages, heads = _walk(ancillary)
    if len(messages) != 1 or len(heads) % 8 or len(ancillary) % 8:
        return None
    kind, begin, end = messages[0]
    if kind not in (SO_TIMESTAMPNS, SO_TIMESTAMPNS_NEW) or begin != len(heads) or end - begin < 16:
        return None
    return _Usual(len(ancillary), ancillary[:begin].copy().view(np.int64), begin // 8)


def _addresses(array: npt.NDArray[Any]) -> npt.NDArray[np.uintp]:
    return (array.ctypes.data + array.strides[0] * np.arange(len(array))).astype(np.uintp)


class Stamps(NamedTuple):
    """What the control messages of n messages say."""

    ns: npt.NDArray[np.int64]  # (n,) when the kernel received each; 0: not given
    hardware: (
        npt.NDArray[np.int64] | None
    )  # (n,) ns of the device's own clock, 0: not given; None: none at all
    drops: int | None  # the kernel's count as of the last message that gives it


def stamps(ancillary: Octets, lengths: npt.NDArray[Any]) -> Stamps:
    """Parse control messages, of all messages together that have the same ones.

    Args:
        ancillary: (n, width) as the kernel has written them.
        lengths: (n,) bytes of each.
    """
    n = len(ancillary)
    ns, hardware = np.zeros(n, np.int64), np.zeros(n, np.int64)
    drops: int | None = None
    left = np.arange(n)
    while left.size:
        first = left[0]
        messages, heads = _walk(ancillary[first, : int(lengths[first])])
        same = lengths[left] == lengths[first]
        if heads:
            same &= (ancillary[left[:, None], heads] == ancillary[first, heads]).all(axis=1)
        rows, left = left[same], left[~same]
        whole = ancillary if len(rows) == n else ancillary[rows]
        for kind, begin, end in messages:
            value = whole[:, begin:end]
            if kind in (SO_TIMESTAMPNS, SO_TIMESTAMPNS_NEW):
                ns[rows] = _timespec(value)
            elif kind in (SO_TIMESTAMPING, SO_TIMESTAMPING_NEW):
                # three times: software, one that is not used any more, raw hardware
                hardware[rows] = _timespec(value[:, 2 * (end - begin) // 3 :])
            elif kind == SO_RXQ_OVFL:
                drops = max(drops or 0, int(np.ascontiguousarray(value[-1:, :4]).view(np.uint32)[0, 0]))
    return Stamps(ns, hardware if hardware.any() else None, drops)


def _walk(ancillary: Octets) -> tuple[list[tuple[int, int, int]], list[int]]:
    """Kind, begin and end of each control message of the socket's own level, and the places of all their headers."""
    messages, heads = [], list[int]()
    at, size = 0, _CMSGHDR.itemsize
    begins = -(-size // _ALIGNMENT) * _ALIGNMENT
    while at + size <= len(ancillary):
        header = ancillary[at : at + size].view(_CMSGHDR)[0]
        end = at + int(header["length"])
        if end < at + begins or end > len(ancillary):
            break
        heads += range(at, at + size)
        if header["level"] == socket.SOL_SOCKET:
            messages.append((int(header["kind"]), at + begins, end))
        at = -(-end // _ALIGNMENT) * _ALIGNMENT
    return messages, heads


def _timespec(value: Octets) -> npt.NDArray[np.int64]:
    """Ns of n structs timespec, of 64 or 32 bits."""
    kind = np.int64 if value.shape[1] >= 16 else np.int32
    words = np.ascontiguousarray(value[:, : 2 * np.dtype(kind).itemsize]).view(kind).astype(np.int64)
    return words[:, 0] * 1_000_000_000 + words[:, 1]


class Pace:
    """How long to wait for more: on a busy bus, so long after the last call; on a quiet one, not at all.

    More than `GATHER_S` only where a quarter of the socket's buffer holds what comes meanwhile.

    Example:
        >>> inner, outer = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        >>> inner.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        >>> Pace(inner).longest
        0.02
        >>> inner.close(), outer.close()
        (None, None)
    """

    def __init__(self, sock: socket.socket) -> None:
        """Begin quiet."""
        held = sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) / _BYTES_PER_MESSAGE
        self.longest = max(GATHER_S, held / 4.0 / MOST_PER_S)  # s
        self._received = -math.inf  # s, monotonic clock

    def wait(self, gather: float) -> None:
        """Wait for what comes together within `gather` s."""
        left = self._received + min(gather, self.longest) - time.monotonic()
        if left > 0.0:
            time.sleep(left)

    def received(self, *, full: bool) -> None:
        """There were messages; `full`: as many as fit, so that more may wait already."""
        self._received = -math.inf if full else time.monotonic()
