"""Sends numbered CAN frames as fast as the kernel takes them (sendmmsg): `python -m tests.bus.sendmmsg vcan0 1000000`.

A thousand frames for each system call; without waiting.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys

from tests.bus.network import sending

BATCH = 1000
SIZE = 16  # linux/can.h: struct can_frame


class _IoVec(ctypes.Structure):
    _fields_ = (("base", ctypes.c_void_p), ("size", ctypes.c_size_t))


class _MsgHdr(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_void_p),
        ("name_size", ctypes.c_uint),
        ("parts", ctypes.POINTER(_IoVec)),
        ("count", ctypes.c_size_t),
        ("control", ctypes.c_void_p),
        ("control_size", ctypes.c_size_t),
        ("flags", ctypes.c_int),
    )


class _MmsgHdr(ctypes.Structure):
    _fields_ = (("header", _MsgHdr), ("size", ctypes.c_uint))


def burst(channel: str, total: int) -> None:
    """Send frames 0 to `total` - 1."""
    libc = ctypes.CDLL(None, use_errno=True)
    frames = ctypes.create_string_buffer(SIZE * BATCH)
    parts, messages = (_IoVec * BATCH)(), (_MmsgHdr * BATCH)()
    for i in range(BATCH):
        parts[i].base, parts[i].size = ctypes.addressof(frames) + SIZE * i, SIZE
        messages[i].header.parts, messages[i].header.count = ctypes.pointer(parts[i]), 1
    with sending(channel) as sock:
        for first in range(0, total, BATCH):
            n = min(BATCH, total - first)
            for i in range(n):
                struct.pack_into("=IB3x", frames, SIZE * i, 0x100 + (first + i) % 16, 8)
                struct.pack_into(">Q", frames, SIZE * i + 8, first + i)
            done = 0
            while done < n:
                at = ctypes.byref(messages, done * ctypes.sizeof(_MmsgHdr))
                took = libc.sendmmsg(sock.fileno(), at, n - done, 0)
                if took < 0:
                    raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
                done += took


if __name__ == "__main__":
    burst(sys.argv[1], int(sys.argv[2]))
