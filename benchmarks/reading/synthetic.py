"""A drive as a data logger sees it: 2,000 frames/s of 12 ids, four of which are wanted, at 100 Hz each.

Times, payloads and noise are made in blocks of one second, so that a log of any length needs no memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from canid.io.buses import python_can
from canid.io.buses.messages import message_of
from canid.signals.vehicle import Vehicle, read_vehicle
from canid.values.types import Frame

HERE = Path(__file__).parent
WANTED = (0x0C1, 0x0C2, 0x0C3, 0x0C4)
OTHERS = (0x012, 0x064, 0x101, 0x1A0, 0x230, 0x2C4, 0x3D3, 0x4F0)
FRAMES_PER_SECOND = 2_000
START = 1_700_000_000.0


def vehicle() -> Vehicle:
    """The vehicle file that maps the 23 signals."""
    return read_vehicle(HERE / "drive.toml")


def frames(seconds: int, seed: int = 1) -> Iterator[Frame]:
    """The log's frames; its payloads compress to some 10 bytes a frame, as a car's do."""
    rng = np.random.default_rng(seed)
    # slots of 0.5 ms: the wanted ids at 100 Hz, the others at 200 Hz, one after the other
    slots = np.array([(*WANTED, *OTHERS, *OTHERS)] * 100).reshape(-1)
    walk = rng.integers(0, 256, (len(set(slots)), 8))
    rows = {id_: row for row, id_ in enumerate(dict.fromkeys(slots.tolist()))}
    row = np.array([rows[id_] for id_ in slots.tolist()])
    for second in range(seconds):
        # most bytes stand still or move slowly; the last two are a counter and a checksum
        walk = (walk + rng.integers(-1, 2, walk.shape) * (rng.random(walk.shape) < 0.5)) % 256
        data = walk[row]
        data[:, 0] = (data[:, 0] + (rng.random(len(slots)) < 0.1)) % 256
        data[:, 6] = np.arange(len(slots)) // 20 % 16
        data[:, 7] = rng.integers(0, 256, len(slots))
        packed = data.astype(np.uint8).tobytes()
        ns = second * 1_000_000_000 + np.arange(len(slots)) * 500_000 + rng.integers(0, 50_000, len(slots))
        if second == 0:
            ns[0] = 0
        for k, (id_, t) in enumerate(zip(slots.tolist(), (ns // 1000 * 1000 * 1e-9).tolist(), strict=True)):
            yield Frame(t, 0, id_, packed[8 * k : 8 * k + 8])


def write(path: Path, source: Iterator[Frame]) -> None:
    """Write frames with python-can's writer of that suffix."""
    with python_can.load().Logger(str(path)) as writer:
        for frame in source:
            writer.on_message_received(message_of(frame, START))


def write_decimal(path: Path, source: Iterator[Frame]) -> None:
    """Write an .asc with decimal numbers, which python-can reads and does not write."""
    with open(path, "w") as file:
        file.write(
            "date Tue Nov 14 22:13:20.000 2023\nbase dec  timestamps absolute\ninternal events logged\n"
        )
        for t, bus, id_, data, _, _ in source:
            file.write(f"{t:9.6f} {bus + 1}  {id_:<15} Rx   d {len(data)} {' '.join(map(str, data))}\n")
