"""The longer logs: an hour of a following drive on a busy bus for `canid identify`, and ten million frames for memory."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from operator import attrgetter
from pathlib import Path

import numpy as np

from canid.io.logs import open_log, write_log
from canid.values.types import Frame

# what the generic vehicle sends is 225 frames/s; the rest of the bus is none of canid's business
FRAMES_PER_SECOND = 2_000
OTHERS = (0x2C4, 0x3D3, 0x3E1, 0x4A0, 0x4F0, 0x512, 0x620)


def others(seconds: float, rate: float, seed: int = 2) -> Iterator[Frame]:
    """Frames of ids that no vehicle file maps, evenly spaced."""
    rng = np.random.default_rng(seed)
    period = round(1e9 / rate)
    for k in range(int(seconds * rate)):
        if k % 4096 == 0:
            noise = rng.integers(0, 256, (4096, 2), dtype=np.uint8)
        yield Frame(k * period * 1e-9, 0, OTHERS[k % len(OTHERS)], b"\0\1\2\3\4" + noise[k % 4096].tobytes())


def busy(path: Path, drive: Path, rate: float = FRAMES_PER_SECOND) -> int:
    """Write the frames of `drive` among others, `rate` frames/s in all; returns how many there are."""
    log = open_log(drive)
    n, last = 0, 0.0
    for chunk in log.columns():
        n, last = n + len(chunk.t), float(chunk.t[-1])
    more = others(last, rate - n / last)
    count = 0

    def counted() -> Iterator[Frame]:
        nonlocal count
        for frame in heapq.merge(log, more, key=attrgetter("t")):
            count += 1
            yield frame

    write_log(path, counted(), log.start_utc)
    return count
