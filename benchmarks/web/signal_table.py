"""CPU of the table of all signals in the live page, for 1 s of a bus; the peer is cantools, which decodes each frame.

    python -m benchmarks.web.signal_table [--rate 2000] [--signals 300 3000]

Each message has four signals of 16 bits; the frames are of random messages, in chunks of 30 ms as the estimators' process
has them. The median of several seconds. While no page shows the table the frames wait, and are decoded 100,000 together.
"""

from __future__ import annotations

import argparse
import pickle
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import cantools
import numpy as np

from canid.analysis.contents.signal_tables import SignalTables
from canid.signals.dbc_text.parsing import Parser
from canid.signals.vehicle import read_vehicle
from canid.signals.vehicle.database import load
from canid.values.types import Columns

SIGNALS_OF_MESSAGE = 4
CHUNKS = 33
SECONDS = 20


def dbc(signals: int) -> str:
    """A DBC file with so many signals."""
    lines = ['VERSION ""', "", "BU_: A"]
    for number in range(signals // SIGNALS_OF_MESSAGE):
        lines += ["", f"BO_ {0x100 + number} MESSAGE_{number}: 8 A"]
        lines += [f' SG_ Signal_{k} : {16 * k}|16@1- (0.1,-3) [0|0] "m" A' for k in range(SIGNALS_OF_MESSAGE)]
    return "\n".join([*lines, ""])


def chunk(rng: np.random.Generator, t: float, n: int, messages: int) -> Columns:
    """Frames of random messages."""
    ids = (0x100 + rng.integers(0, messages, n)).astype(np.uint32)
    flags, length = np.zeros(n, np.uint8), np.full(n, 8, np.uint8)
    data = rng.integers(0, 256, (n, 8)).astype(np.uint8)
    return Columns(t + np.arange(n) / (n * CHUNKS), np.zeros(n, np.uint16), ids, flags, length, data)


def used(work: Callable[[], object]) -> float:
    """CPU that some work takes, ms."""
    began = time.process_time()
    work()
    return 1e3 * (time.process_time() - began)


def row(signals: int, rate: int, folder: Path) -> str:
    """One row of the table."""
    path = folder / f"{signals}.dbc"
    path.write_text(dbc(signals))
    with Parser() as parser:
        databases = [load(path, None, parser)[0]]
    rng, messages = np.random.default_rng(1), signals // SIGNALS_OF_MESSAGE
    bus = [
        [chunk(rng, s + k / CHUNKS, rate // CHUNKS, messages) for k in range(CHUNKS)] for s in range(SECONDS)
    ]
    theirs = cantools.database.load_file(path)

    def each_frame(second: list[Columns]) -> None:
        for part in second:
            for id_, data in zip(part.id.tolist(), part.data, strict=True):
                theirs.decode_message(id_, data.tobytes())

    def tables() -> SignalTables:
        return SignalTables(read_vehicle("generic"), databases, {})

    shown, waiting = tables(), tables()
    made = []
    for second in bus:
        take = used(lambda second=second: [shown.take(part) for part in second])
        made.append(take + used(lambda: pickle.dumps(shown.table(), protocol=5)))
    kept = used(lambda: [waiting.take(part) for _ in range(10) for second in bus for part in second])
    peer = median(used(lambda second=second: each_frame(second)) for second in bus)
    return f"| {signals:,} | {median(made):.1f} ms | {kept / 10 / SECONDS:.1f} ms | {peer:.0f} ms |"


def main() -> None:
    """Print the table of docs/web.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.web.signal_table")
    parser.add_argument("--rate", type=int, default=2000)
    parser.add_argument("--signals", type=int, nargs="+", default=[300, 3000])
    args = parser.parse_args()
    print("| signals | one table | while none is shown, per s | cantools, each frame, per s |")
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for signals in args.signals:
            print(row(signals, args.rate, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
