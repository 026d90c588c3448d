"""Numbered frames at a rate, from a process of its own: `python -m benchmarks.recording.sender CHANNEL... RATE TOTAL`.

CHANNEL is a multicast group (python-can's datagrams, packed once and filled in) or an interface of SocketCAN. With
several, the frames go to each of them in turn. RATE: frames/s of each channel, `inf` as fast as they go. Prints how many
frames were sent to each.
"""

from __future__ import annotations

import socket
import struct
import sys
import time
from collections.abc import Callable

# python-can's port of udp_multicast
PORT = 43113
# s between two handfuls, as gateways do
PAUSE = 0.001
# frames between two pauses where they go as fast as they can: the sender is to be faster than any reader, not to drown
# the machine
HANDFUL = 50


def onto(channel: str) -> Callable[[int], object]:
    """A function that sends frame i onto a channel."""
    if channel[0].isdigit():
        return _datagrams(channel)
    sock = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    sock.bind((channel,))
    frame = struct.Struct("=IB3x8s")

    def send(i: int) -> None:
        packed = frame.pack(i % 2048, 8, number(i))
        while True:
            try:
                sock.send(packed)
            except OSError:  # the device's queue is full
                time.sleep(PAUSE)
            else:
                return

    return send


def _datagrams(group: str) -> Callable[[int], object]:
    import can
    from can.interfaces.udp_multicast.utils import pack_message

    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
    out.connect((group, PORT))
    packed = {}
    for id_ in range(2048):
        message = can.Message(0.0, id_, False, data=bytes(8))
        before, after = bytes(pack_message(message)).split(b"\xc4\x08" + bytes(8))
        packed[id_] = before + b"\xc4\x08", after

    def send(i: int) -> None:
        before, after = packed[i % 2048]
        out.send(before + number(i) + after)

    return send


def number(i: int) -> bytes:
    """The payload of frame i: its number, and bytes that compress no better than a car's."""
    return struct.pack(">II", i, i * 2654435761 & 0xFFFFFFFF)


def main() -> None:
    *channels, rate, total = sys.argv[1:]
    sends = [onto(channel) for channel in channels]
    began, i = time.monotonic(), 0
    while i < int(total):
        due = i + HANDFUL if rate == "inf" else int((time.monotonic() - began) * float(rate))
        while i < min(due, int(total)):
            for send in sends:
                send(i)
            i += 1
        if rate != "inf":
            time.sleep(PAUSE)
    print(i)


if __name__ == "__main__":
    main()
