"""Live estimates behind python-can's Notifier, on a virtual bus: `python examples/listen.py LOG [SECONDS]`.

A thread plays a log onto the bus, so that the script runs without hardware; with hardware, open your own bus.
"""

from __future__ import annotations

import asyncio
import sys
import threading
import time

import can

import canid


def play(log: str, seconds: float, bus: can.BusABC) -> None:
    """Send the first seconds of a log, ten times as fast as it was recorded; the messages keep their times."""
    with can.LogReader(log) as reader:
        first = begin = 0.0
        for message in reader:
            first, begin = first or message.timestamp, begin or time.monotonic()
            t = message.timestamp - first
            if t > seconds:
                return
            time.sleep(max(begin + t / 10.0 - time.monotonic(), 0.0))
            message.is_rx = True
            bus.send(message)


async def main(log: str, seconds: float) -> None:
    """Take estimates from an asyncio queue; a callback would do as well: canid.Listener("generic", print)."""
    queue: asyncio.Queue[canid.Estimate] = asyncio.Queue()
    with (
        can.Bus("listen", interface="virtual", preserve_timestamps=True) as bus,
        can.Bus("listen", interface="virtual", preserve_timestamps=True) as car,
        canid.Listener("generic", queue=queue, on_error=print) as listener,
    ):
        notifier = can.Notifier(bus, [listener])
        player = threading.Thread(target=play, args=(log, seconds, car))
        player.start()
        t = 0.0
        while t < seconds - 3.0:  # an estimate is up to 1.9 s old
            estimate = await queue.get()
            t = estimate.t
            if estimate.headline:
                print(f"{t:6.1f} s  K of range rate {estimate.channels['range_rate'].K}")
        player.join()
        notifier.stop()
    print(listener)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2]) if sys.argv[2:] else 120.0))
