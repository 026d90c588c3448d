"""µs per frame on the bus's thread and in the whole process: canid.Listener, can.BufferedReader, can.Logger.

Usage: python -m benchmarks listener [FRAMES]

Messages are delivered as a Notifier's thread does, as fast as that goes ("burst") and at 4,000 frames/s ("paced"), the
load of a full 500 kbit/s bus. On the bus's thread only the call counts; the whole process also holds the listener's
own thread, which shares Python's lock with it. The estimator process is not in these figures: `benchmarks live` has it.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import can

from canid.analysis.session.listener import Listener
from canid.io.buses.messages import message_of
from canid.io.logs import open_log

LOG = Path(__file__).parents[2] / "replay_logs/following_urban.blf"
RATE = 4000.0  # frames/s
BATCH = 40
REPEATS = 5


def cost(
    listener: Callable[[can.Message], object], messages: list[can.Message], rate: float
) -> tuple[float, float]:
    """µs per frame: on this thread, by its own clock, and in the whole process."""
    inside, whole = 0.0, time.process_time()
    began = time.monotonic()
    for k in range(0, len(messages), BATCH):
        if rate:
            time.sleep(max(began + k / rate - time.monotonic(), 0.0))
        part = messages[k : k + BATCH]
        before = time.thread_time()
        for message in part:
            listener(message)
        inside += time.thread_time() - before
    return 1e6 * inside / len(messages), 1e6 * (time.process_time() - whole) / len(messages)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks listener", description=__doc__)
    parser.add_argument("frames", nargs="?", type=int, default=12_000)
    count = parser.parse_args().frames
    frames = [frame for frame, _ in zip(open_log(LOG), range(count), strict=False)]
    messages = [message_of(frame, 1.6e9) for frame in frames]
    print(f"{len(messages):,} frames; µs per frame, median of {REPEATS}")
    print(f"{'':22}{'burst':>10}{'(process)':>11}{'paced':>10}{'(process)':>11}")
    with tempfile.TemporaryDirectory() as folder:
        makers: dict[str, Callable[[], can.Listener]] = {
            "canid.Listener": lambda: Listener("generic", lambda _: None),
            "can.BufferedReader": can.BufferedReader,
            "can.Logger .blf": lambda: can.Logger(Path(folder) / f"{time.monotonic_ns()}.blf"),
            "can.Logger .asc": lambda: can.Logger(Path(folder) / f"{time.monotonic_ns()}.asc"),
        }
        for name, make in makers.items():
            cells = []
            for rate in (0.0, RATE):
                rows = []
                for _ in range(REPEATS if not rate else 1):
                    listener = make()
                    if isinstance(listener, Listener):
                        while not listener.counts().ready:
                            time.sleep(0.05)
                    rows.append(cost(listener, messages, rate))
                    listener.stop()
                cells += [statistics.median(of) for of in zip(*rows, strict=True)]
            print(f"{name:22}" + "".join(f"{x:>10.2f}" + " " * (k % 2) for k, x in enumerate(cells)))


if __name__ == "__main__":
    main()
